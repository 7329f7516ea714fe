"""Measure what voxels do to curvature with and without the removal of terraces, on known shapes and on brains.

An ellipsoid and folded spheres are voxelised, and surfaces are made from the voxels as from labels. On the ellipsoid,
mean curvature and shape index are compared with the analytic values (root mean square errors). On folded spheres, mean
curvature is compared with that of the exact surface, by the same quadrics: correlation, and slope of the regression on
the exact values. The smooth surface of a shipped brain is voxelised twice, the second time shifted and rotated; the
correlation between both maps is the repeatability. One line of JSON is printed for each case, then all cases.
"""

import argparse
import json
from collections.abc import Callable
from functools import partial
from unittest.mock import patch

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from scipy.special import sph_harm_y

from gyriflow.anatomy import repair
from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.pial import from_labels
from gyriflow.anatomy.shapes import shape_surface
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.matching import surface_mask
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import Floats, TriangleMesh, area, transformed, unit, vertex_areas
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.metrics.curvature import Curvature, curvature
from gyriflow.shipped import SHIPPED

ATLAS = SHIPPED / "atlases" / "spina-bifida"
SEMI_AXES = np.array([32.0, 42.0, 26.0])
RADIUS = 35.0
FOLDS = {"A 1, λ 8 mm": (1.0, 8.0), "A 2, λ 12 mm": (2.0, 12.0), "A 0.5, λ 12 mm": (0.5, 12.0)}
# offset of the voxel grid, in voxels, so that no plane of it is in the middle of a body
OFFSET = np.array([0.13, 0.37, 0.21])
FINE_MM = 0.8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--voxels", type=float, nargs="+", default=[0.5, 0.8, 1.0], metavar="MM")
    parser.add_argument("--edge", type=float, default=1.0, metavar="MM", help="edge length of the surfaces")
    parser.add_argument(
        "--brains", nargs="*", default=["23_notoperated", "29_operated"], help="brains of the shipped atlas"
    )
    arguments = parser.parse_args()
    rows: list[dict] = []

    def report(body: str, voxel: float, mask: np.ndarray, affine: Floats, judge: Callable) -> None:
        row = {"body": body, "voxel_mm": voxel}
        for name, made in (("before", surface_with_terraces), ("after", surface_of_voxels)):
            found = judge(lambda mask, affine, made=made: made(mask, affine, arguments.edge), mask, affine)
            row[name] = {key: round(value, 4) for key, value in found.items()}
        rows.append(row)
        print(json.dumps(row, ensure_ascii=False), flush=True)

    for voxel in arguments.voxels:
        report("ellipsoid", voxel, *ellipsoid(voxel), lambda made, *volume: errors_on_ellipsoid(made(*volume)))
    for name, fold in FOLDS.items():
        exact = exact_sphere(*fold)
        bend = curvature(exact)

        def against(made: Callable, *volume: Floats, exact=exact, bend=bend) -> dict[str, float]:
            mesh = made(*volume)
            return {"area": area(mesh) / area(exact)} | agreement(mesh, exact, curvature(mesh), bend)

        for voxel in arguments.voxels:
            report(name, voxel, *folded_sphere(*fold, voxel), against)
    for brain in arguments.brains:
        volume = read_label_volume(ATLAS / f"fetal_SB_atlas_GA{brain}" / "parcellation.nii.gz", cropped=True)
        scheme, week = SCHEMES["spina-bifida-atlas"], float(brain[:2])
        body = from_labels(volume.labels, volume.affine, scheme, week=week, edge_length_mm=FINE_MM).whole
        for voxel in arguments.voxels:
            report(brain, voxel, *voxels_of(body, voxel), partial(repeated, body, voxel))
    print(json.dumps(rows, ensure_ascii=False))


def surface_of_voxels(mask: np.ndarray, affine: Floats, edge_mm: float) -> TriangleMesh:
    """Return the surface of an (i, j, k) mask, made as from labels."""
    volume = float(mask.sum() * abs(np.linalg.det(affine[:3, :3])))
    mesh = repair.surface_of_mask(smooth_mask(mask), affine, volume, edge_mm).mesh
    repair.require_sound(mesh)
    return mesh


def surface_with_terraces(mask: np.ndarray, affine: Floats, edge_mm: float) -> TriangleMesh:
    """Return the same surface with its terraces."""
    with patch.object(repair, "without_terraces", lambda mesh, *_: mesh):
        return surface_of_voxels(mask, affine, edge_mm)


def lattice(extent_mm: Floats, voxel_mm: float) -> tuple[Floats, Floats]:
    """Return the (i, j, k, 3) centres of voxels around the origin, and their affine."""
    half = np.ceil(extent_mm / voxel_mm).astype(int) + 8
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = voxel_mm * (OFFSET - half)
    return np.moveaxis(np.indices(2 * half + 1), 0, -1) * voxel_mm + affine[:3, 3], affine


def ellipsoid(voxel_mm: float) -> tuple[np.ndarray, Floats]:
    """Return the mask of the ellipsoid, and its affine."""
    centres, affine = lattice(SEMI_AXES, voxel_mm)
    return ((centres / SEMI_AXES) ** 2).sum(axis=-1) < 1.0, affine


def errors_on_ellipsoid(mesh: TriangleMesh) -> dict[str, float]:
    """Return the root mean square errors of mean curvature (1/mm) and shape index, and the area over the exact area."""
    squares = SEMI_AXES**2
    on = mesh.vertices / np.linalg.norm(mesh.vertices / SEMI_AXES, axis=1, keepdims=True)
    scale = (on**2 / squares**2).sum(axis=1)
    mean = (squares.sum() - (on**2).sum(axis=1)) / (2 * squares.prod() * scale**1.5)
    gaussian = 1.0 / (squares.prod() * scale**2)
    index = 2 / np.pi * np.arctan2(mean, np.sqrt(np.maximum(mean**2 - gaussian, 0.0)))
    bend, weights = curvature(mesh), vertex_areas(mesh)
    errors = {"mean_curvature": bend.mean - mean, "shape_index": bend.shape_index - index}
    rms = {name: float(np.sqrt(np.average(error**2, weights=weights))) for name, error in errors.items()}
    exact = shape_surface(tuple(SEMI_AXES), edge_length_mm=1.0, noise_mm=0.0)
    return {f"rms_{name}": value for name, value in rms.items()} | {"area": area(mesh) / area(exact)}


def radius(points: Floats, height_mm: float, wavelength_mm: float) -> Floats:
    """Return the radius of a folded sphere (a spherical harmonic of that height on a sphere) in (…, 3) directions."""
    degree = round(2 * np.pi * RADIUS / wavelength_mm)

    def harmonic(polar: Floats, azimuth: Floats) -> Floats:
        return np.real(sph_harm_y(degree, degree // 2, polar, azimuth))

    polar = np.arccos(np.clip(unit(points)[..., 2], -1.0, 1.0))
    highest = np.abs(harmonic(np.linspace(0.0, np.pi, 4001), np.zeros(4001))).max()
    return RADIUS + height_mm / highest * harmonic(polar, np.arctan2(points[..., 1], points[..., 0]))


def exact_sphere(height_mm: float, wavelength_mm: float) -> TriangleMesh:
    """Return a folded sphere with its vertices on the exact shape."""
    mesh = shape_surface((RADIUS,) * 3, edge_length_mm=FINE_MM, noise_mm=0.0)
    for is_remeshed in (True, False):
        directions = unit(mesh.vertices)
        vertices = directions * radius(directions, height_mm, wavelength_mm)[:, None]
        mesh = TriangleMesh(vertices, mesh.faces)
        mesh = remesh(mesh, FINE_MM) if is_remeshed else mesh
    return mesh


def folded_sphere(height_mm: float, wavelength_mm: float, voxel_mm: float) -> tuple[np.ndarray, Floats]:
    """Return the mask of a folded sphere, and its affine."""
    centres, affine = lattice(np.full(3, RADIUS + height_mm), voxel_mm)
    radii = np.linalg.norm(centres, axis=-1)
    mask, near = radii < RADIUS, np.abs(radii - RADIUS) <= height_mm
    mask[near] = radii[near] < radius(centres[near], height_mm, wavelength_mm)
    return mask, affine


def agreement(mesh: TriangleMesh, reference: TriangleMesh, bend: Curvature, exact: Curvature) -> dict[str, float]:
    """Return how well the curvature of a surface agrees with that at the nearest vertices of a reference."""
    _, nearest = cKDTree(reference.vertices).query(mesh.vertices)
    return {
        "r_mean_curvature": float(np.corrcoef(bend.mean, exact.mean[nearest])[0, 1]),
        "slope": float(np.polyfit(exact.mean[nearest], bend.mean, 1)[0]),
        "r_shape_index": float(np.corrcoef(bend.shape_index, exact.shape_index[nearest])[0, 1]),
    }


def voxels_of(body: TriangleMesh, voxel_mm: float) -> tuple[np.ndarray, Floats]:
    """Return the mask of a closed surface, and its affine."""
    mask, affine = surface_mask(body, voxel_mm)
    return mask > 0, affine


def repeated(body: TriangleMesh, voxel_mm: float, made: Callable, *volume: Floats) -> dict[str, float]:
    """Return how well two surfaces of one body agree: voxelised as it is, and shifted and rotated."""
    pose = motion(Rotation.from_rotvec(np.radians([11.0, -17.0, 23.0])).as_matrix(), OFFSET * voxel_mm)
    first, second = made(*volume), made(*voxels_of(transformed(body, pose), voxel_mm))
    second = transformed(second, np.linalg.inv(pose))
    return {"area": area(first) / area(body)} | agreement(first, second, curvature(first), curvature(second))


if __name__ == "__main__":
    main()
