"""Try thickness, area ratio and the opening of fused sulci on balls and ellipsoids of known cortex.

`python benchmarks/thickness.py`: cortex of 2 mm in voxels of several sizes and turns; a ball whose fused sulcus hides
shares of its area; a ball with a fused sulcus all round, its cortex thinner on one half.
"""

import json

import numpy as np
from open_sulci import EDGE_MM, measure
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.anatomy.sulci import open_fused_sulci
from gyriflow.anatomy.thickness import cortical_thickness
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.triangles import TriangleMesh, area, convex_hull, transformed

SEMI_AXES_MM, CORTEX_MM = np.array([20.0, 26.0, 18.0]), 2.0
VOXELS_MM = ((0.5,) * 3, (0.8,) * 3, (1.2,) * 3, (0.5, 0.5, 1.5), (1.0, 1.0, 3.0))
TURNS_DEG = ((0, 0, 0), (20, 30, 10))
# a ball with a fused sulcus, oblique to voxels of 0.8 mm
RADIUS_MM, DEPTH_MM, VOXEL_MM = 18.0, 8.0, 0.8
ACROSS, ALONG = np.array([0.8, 0.36, 0.48]), np.array([0.0, 0.8, -0.6])
HALVES_MM = ((1.6, 3.0), (1.3, 2.6), (2.0, 3.0), (2.0, 2.0))
HIDDEN = (0.0, 0.05, 0.1, 0.2)


def grid(size: tuple[float, ...], half_mm: float, turn_deg: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the (i, j, k, 3) places of voxels in a cube around the origin, and their (4, 4) affine."""
    affine = np.diag([*size, 1.0])
    affine[:3, 3] = np.array([0.13, 0.2, -0.1]) - half_mm
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    affine = turn @ affine
    shape = np.ceil(2 * half_mm / np.array(size)).astype(int)
    return transform_points(np.indices(shape).reshape(3, -1).T, affine).reshape(*shape, 3), affine


def ellipsoid(semi_axes: np.ndarray) -> TriangleMesh:
    """Return an ellipsoid of even points."""
    number = np.arange(20_000) + 0.5
    turn, height = np.pi * (1 + 5**0.5) * number, 1 - number / 10_000
    radius = np.sqrt(1 - height**2)
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    return transformed(convex_hull(TriangleMesh(points, np.empty((0, 3), dtype=int))), np.diag([*semi_axes, 1.0]))


def try_voxels(size: tuple[float, ...], turn_deg: tuple[float, ...]) -> dict:
    """Measure the cortex of an ellipsoid."""
    places, affine = grid(size, SEMI_AXES_MM.max() + 8.0, turn_deg)
    body = ((places / SEMI_AXES_MM) ** 2).sum(axis=-1) < 1.0
    depth = np.zeros(body.shape)
    depth[body] = nearest_on(places[body], ellipsoid(SEMI_AXES_MM))[0]
    pial = surface_of_mask(smooth_mask(body), affine, float(body.sum() * np.prod(size)), EDGE_MM).mesh
    report = cortical_thickness(pial, body, body & (depth < CORTEX_MM), affine).report
    return {"voxel_mm": size, "turn_deg": turn_deg, "error": report["mean_mm"] / CORTEX_MM - 1.0, **report}


def try_hidden(share: float) -> dict:
    """Measure the area ratio of a ball whose surface leaves out a fused sulcus with a share of the area."""
    places, affine = grid((VOXEL_MM,) * 3, RADIUS_MM + 6.0, (0, 0, 0))
    depth = RADIUS_MM - np.linalg.norm(places, axis=-1)
    # from above, as deep as the segments of a circle on its two banks have the area
    deep = np.linspace(0.0, 2.0 * RADIUS_MM, 2001)
    half_chord = np.sqrt(np.maximum(deep * (2.0 * RADIUS_MM - deep), 0.0))
    segment = RADIUS_MM**2 * np.arccos(1.0 - deep / RADIUS_MM) - (RADIUS_MM - deep) * half_chord
    reach = np.interp(share / (1.0 - share) * 2.0 * np.pi * RADIUS_MM**2, segment, deep)
    to_end = np.hypot(places @ ACROSS, np.maximum(RADIUS_MM - reach - places @ ALONG, 0.0))
    body, cortex = depth > 0, (depth > 0) & ((depth < CORTEX_MM) | ((to_end < CORTEX_MM) & (share > 0)))
    pial = surface_of_mask(smooth_mask(body), affine, float(body.sum() * VOXEL_MM**3), EDGE_MM).mesh
    return {"hidden": share, "area_ratio": cortical_thickness(pial, body, cortex, affine).report["area_ratio"]}


def try_uneven(thin_mm: float, thick_mm: float) -> dict:
    """Return the opened shares of a fused sulcus in thin and thick cortex, and the error of the area."""
    places, affine = grid((VOXEL_MM,) * 3, RADIUS_MM + 6.0, (0, 0, 0))
    depth, thickness = RADIUS_MM - np.linalg.norm(places, axis=-1), np.where(places @ ALONG < 0, thin_mm, thick_mm)
    to_end = np.hypot(places @ ACROSS, np.maximum(depth - DEPTH_MM, 0.0))
    body, core = depth > 0, (depth > thickness) & (to_end > thickness)
    field, fine, report = open_fused_sulci(smooth_mask(body), affine, core)
    volume, taken = float(body.sum() * VOXEL_MM**3), 1e3 * report["opened_mL"]
    pial = surface_of_mask(field, fine, volume, EDGE_MM, taken_mm3=taken).mesh
    slits = transform_points(np.argwhere(field < 0.5), fine)
    slits = slits[np.linalg.norm(slits, axis=1) < RADIUS_MM]
    radius, turn = np.meshgrid(np.arange(RADIUS_MM - DEPTH_MM + 0.5, RADIUS_MM - 0.5, 0.3), np.arange(0, 6.28, 0.03))
    third = np.cross(ACROSS, ALONG)
    sheet = (radius[..., None] * (np.cos(turn)[..., None] * ALONG + np.sin(turn)[..., None] * third)).reshape(-1, 3)
    is_open, half = cKDTree(slits).query(sheet)[0] < VOXEL_MM, sheet @ ALONG
    truth = 4 * np.pi * RADIUS_MM**2 + 2 * np.pi * (RADIUS_MM**2 - (RADIUS_MM - DEPTH_MM) ** 2)
    opened = {"thin": float(is_open[half < -1].mean()), "thick": float(is_open[half > 1].mean())}
    row = {"thin_mm": thin_mm, "thick_mm": thick_mm, "opened": opened, "area": area(pial) / truth - 1.0}
    return row | {"thickness_mm": measure(pial, body, core, affine)["thickness_mm"]}


if __name__ == "__main__":
    rows: dict[str, list] = {"voxels": [], "hidden": [], "uneven": []}
    for size in VOXELS_MM:
        rows["voxels"] += [try_voxels(size, turn) for turn in TURNS_DEG]
        print(rows["voxels"][-2:], flush=True)
    for share in HIDDEN:
        rows["hidden"].append(try_hidden(share))
        print(rows["hidden"][-1], flush=True)
    for thin, thick in HALVES_MM:
        rows["uneven"].append(try_uneven(thin, thick))
        print(rows["uneven"][-1], flush=True)
    print(json.dumps(rows))
