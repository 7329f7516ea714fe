"""Measure surfaces with fused and with opened sulci, on phantoms of known shape and on
known surfaces.

`python benchmarks/open_sulci.py [PATH …]`: without paths, phantoms, some with noise at
the borders of their labels. For a file `….pial.surf.gii` with its `….white.surf.gii`
(one hemisphere), surfaces are made from labels of 0.8 mm between both, and their area
compared.
"""

import argparse
import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from common import print_rows
from scipy import ndimage
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.extraction import make_simple, remove_bridges, smooth_mask
from gyriflow.anatomy.fissure import sample
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.anatomy.sulci import open_fused_sulci
from gyriflow.anatomy.thickness import Cortex, thickness_from_labels
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import surface_mask
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    area,
    area_cm2,
    convex_hull,
    euler_number,
    transformed,
    vertex_areas,
)
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.gyrification import sulcal_depth

Turn = tuple[float, float, float]

# a ball with sulci around it, at x = ±X + A sin(y/L), all in mm
RADIUS_MM, DEPTH_MM, THICKNESS_MM = 20.0, 6.0, 2.0
PLACES_MM, WAVE_MM, LENGTH_MM = (-6.0, 6.0), 1.5, 4.0
WIDTHS_MM = (0.0, 0.2, 0.5, 1.0)
VOXELS_MM = (0.5, 0.8, 1.0)
TURNS_DEG = ((0, 0, 0), (20, 30, 10), (45, 35, 0))
# cells of a voxel along each axis; the label is that of most cells
CELLS = 3
EDGE_MM = 1.0
# shares of the voxels at a border whose label is replaced by that of its other side
NOISES = (0.0, 0.1, 0.2)
# a voxel of a slit that is further from all sulci is a crack in a crown
MAX_OFF_MM = 1.5
LABEL_MM, MIN_CORTEX_MM = 0.8, 1.6


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Surfaces of a body with fused and with opened sulci, and smooth masks (i, j, k):
    `field`, and with slits.

    `affine` is that of the mask with slits.
    """

    fused: TriangleMesh
    opened: TriangleMesh
    field: np.ndarray
    slits: np.ndarray
    affine: Floats
    report: dict[str, Any]

    def area_errors(self, exact_mm2: float) -> dict[str, float]:
        """Return the relative errors of both areas."""
        return {
            "fused": area(self.fused) / exact_mm2 - 1.0,
            "opened": area(self.opened) / exact_mm2 - 1.0,
        }


def make_surfaces(body: np.ndarray, core: np.ndarray, affine: Floats) -> Surfaces:
    """Return the surfaces of an (i, j, k) body whose core is its white matter, made as
    those of a brain."""
    volume = float(body.sum() * abs(np.linalg.det(affine[:3, :3])))
    bridged, _ = remove_bridges(body, smooth_mask(body))
    fused = surface_of_mask(bridged, affine, volume, EDGE_MM).mesh
    field, _ = make_simple(bridged)
    slits, fine, report = open_fused_sulci(field, affine, core)
    opened = surface_of_mask(
        slits, fine, volume, EDGE_MM, taken_mm3=1e3 * report.get("opened_mL", 0.0)
    ).mesh
    return Surfaces(fused, opened, field, slits, fine, report)


def off_sulci(points: np.ndarray) -> np.ndarray:
    """Return the distance (mm) of (…, 3) points from the middle of the nearest
    sulcus."""
    wave = points[..., 1] / LENGTH_MM
    offset = (points[..., 0] - WAVE_MM * np.sin(wave)) / np.sqrt(
        1.0 + (WAVE_MM / LENGTH_MM * np.cos(wave)) ** 2
    )
    return np.min([np.abs(offset - place) for place in PLACES_MM], axis=0)


def truth(width_mm: float) -> dict[str, float]:
    """Return the area of the ball with sulci of a width, its mean depth below the hull,
    and its gyrification."""
    step = 0.02
    y, z = np.meshgrid(*[np.arange(-RADIUS_MM, RADIUS_MM, step)] * 2, indexing="ij")
    stretch = np.sqrt(1.0 + (WAVE_MM / LENGTH_MM * np.cos(y / LENGTH_MM)) ** 2)
    hull = 4.0 * np.pi * RADIUS_MM**2
    walls = depth = 0.0
    for place in PLACES_MM:
        below = RADIUS_MM - np.sqrt(
            (place + WAVE_MM * np.sin(y / LENGTH_MM)) ** 2 + y**2 + z**2
        )
        wall = 2.0 * stretch * step**2 * ((below > 0) & (below < DEPTH_MM))
        walls, depth = walls + wall.sum(), depth + (wall * below).sum()
    # area of the sulci's mouths, which the ball loses, and of their bottoms
    height, turn = np.meshgrid(
        np.arange(-1, 1, 0.001) + 0.0005, np.arange(0, 2 * np.pi, 0.002), indexing="ij"
    )
    radial = np.sqrt(1.0 - height**2)
    directions = np.stack(
        [radial * np.cos(turn), radial * np.sin(turn), height], axis=-1
    )
    mouth, bottom = (
        4.0
        * np.pi
        * radius**2
        * float((off_sulci(radius * directions) < 0.5 * width_mm).mean())
        for radius in (RADIUS_MM, RADIUS_MM - DEPTH_MM)
    )
    whole = hull - mouth + walls + bottom
    depth = (depth + bottom * DEPTH_MM) / whole
    return {
        "area_mm2": whole,
        "depth_mm": depth,
        "gi": whole / hull,
        "thickness_mm": THICKNESS_MM,
    }


def phantom(width_mm: float, voxel_mm: float, turn_deg: Turn):
    """Return the (i, j, k) masks of the body and of its core inside the cortex, and
    their affine."""
    count = int(np.ceil(RADIUS_MM / voxel_mm)) + 6
    axis = np.arange(-count, count + 1) * voxel_mm + 0.13
    cells = (
        axis[:, None] + voxel_mm * ((np.arange(CELLS) + 0.5) / CELLS - 0.5)
    ).ravel()
    turn = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    points = np.stack(np.meshgrid(cells, cells, cells, indexing="ij"), axis=-1) @ turn
    below = RADIUS_MM - np.linalg.norm(points, axis=-1)
    off = off_sulci(points)
    # distance to the walls: that to the middle of the sulci less half their width
    middle = (off < 0.6 * voxel_mm / CELLS) & (below < DEPTH_MM)
    to_walls = (
        ndimage.distance_transform_edt(~middle, sampling=voxel_mm / CELLS)
        - 0.5 * width_mm
    )
    outside = (below < 0) | ((off < 0.5 * width_mm) & (below < DEPTH_MM))
    core = (below > THICKNESS_MM) & (to_walls > THICKNESS_MM)
    shape = (len(axis), CELLS) * 3
    body, core = (
        mask.reshape(shape).mean(axis=(1, 3, 5)) > 0.5 for mask in (~outside, core)
    )
    affine = np.diag([voxel_mm] * 3 + [1.0])
    affine[:3, 3] = axis[0]
    return body, core & body, affine


def network() -> tuple[np.ndarray, np.ndarray]:
    """Return the unit vectors (20, 3) of a dodecahedron's corners and its edges (30,
    2): a net with Y junctions."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [np.array(c, dtype=float) for c in product((-1.0, 1.0), repeat=3)]
    for a, b in product((-1.0 / golden, 1.0 / golden), (-golden, golden)):
        corners += [np.roll([0.0, a, b], shift) for shift in range(3)]
    points = np.array(corners) / 3.0**0.5
    cosines = points @ points.T
    return points, np.argwhere(np.triu(np.isclose(cosines, 5.0**0.5 / 3.0), 1))


def branching_area(radius_mm: float, depth_mm: float, n_arcs: int) -> float:
    """Return the area (mm²) of a ball with closed sulci below the first arcs of the
    network: exact, without width."""
    angle = n_arcs * np.arccos(5.0**0.5 / 3.0)
    return float(
        4.0 * np.pi * radius_mm**2
        + angle * (radius_mm**2 - (radius_mm - depth_mm) ** 2)
    )


def branching_phantom(
    voxel_mm: float,
    turn_deg: Turn = (20, 30, 10),
    *,
    radius_mm: float = RADIUS_MM,
    depth_mm: float = DEPTH_MM,
    thickness_mm: float = THICKNESS_MM,
    n_arcs: int = 30,
):
    """Return the masks of a ball with fused sulci below arcs of the network and of its
    core, to-sulci (mm), affine."""
    count = int(np.ceil(radius_mm / voxel_mm)) + 6
    axis = np.arange(-count, count + 1) * voxel_mm + 0.13
    turn = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1) @ turn
    corners, arcs = network()
    share = np.linspace(0.0, 1.0, 200)
    height = np.arange(radius_mm - depth_mm, radius_mm, 0.1)
    ends = corners[arcs[:n_arcs]][:, :, None]
    lines = ends[:, 0] * (1.0 - share[:, None]) + ends[:, 1] * share[:, None]
    lines = lines.reshape(-1, 3)
    lines /= np.linalg.norm(lines, axis=1, keepdims=True)
    sheets = (height[:, None, None] * lines).reshape(-1, 3)
    reach = 3.0 * thickness_mm
    tree = cKDTree(sheets)
    to_sulci, _ = tree.query(points.reshape(-1, 3), distance_upper_bound=reach)
    to_sulci = np.minimum(to_sulci, reach).reshape(points.shape[:3])
    below = radius_mm - np.linalg.norm(points, axis=-1)
    affine = np.diag([voxel_mm] * 3 + [1.0])
    affine[:3, 3] = axis[0]
    return (
        below > 0,
        (below > thickness_mm) & (to_sulci > thickness_mm),
        to_sulci,
        affine,
    )


def with_noise(
    body: np.ndarray, core: np.ndarray, share: float, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the masks of a body and its core with a share of the voxels at both
    borders replaced."""
    random, masks = np.random.default_rng(seed), []
    for mask in (body, core):
        border = ndimage.binary_dilation(mask) & ~ndimage.binary_erosion(mask)
        masks.append(mask ^ (border & (random.random(mask.shape) < share)))
    return masks[0], masks[1] & masks[0]


def try_branching(
    voxel_mm: float, turn_deg: Turn, noise: float, **shape: float
) -> dict[str, Any]:
    """Measure a phantom with branching sulci: areas relative to the exact one, and
    cracks in crowns (mm³)."""
    whole, solid, to_sulci, affine = branching_phantom(voxel_mm, turn_deg, **shape)
    body, core = with_noise(whole, solid, noise)
    sizes = {"radius_mm": RADIUS_MM, "depth_mm": DEPTH_MM, "n_arcs": 30} | shape
    exact = branching_area(sizes["radius_mm"], sizes["depth_mm"], int(sizes["n_arcs"]))
    surfaces = make_surfaces(body, core, affine)
    places = transform_points(np.argwhere(surfaces.slits <= 0.5), surfaces.affine)
    places = places[sample(surfaces.field, affine, places) > 0.5]
    off = sample(to_sulci, affine, places) > MAX_OFF_MM
    row = {
        "voxel_mm": voxel_mm,
        "turn_deg": turn_deg,
        "noise": noise,
        **shape,
        "area_mm2": exact,
        **surfaces.report,
    }
    cracks_mm3 = float(off.sum() * abs(np.linalg.det(surfaces.affine[:3, :3])))
    return row | surfaces.area_errors(exact) | {"cracks_mm3": cracks_mm3}


def try_surface(pial_file: Path) -> dict[str, Any]:
    """Return area errors of a hemisphere's surfaces with fused and opened sulci, from
    labels between its surfaces."""
    pial = read_surface(pial_file)
    white = read_surface(Path(str(pial_file).replace(".pial.", ".white.")))
    # both may have been moved, and have the same vertices
    shift = np.average(
        pial.vertices - white.vertices, axis=0, weights=vertex_areas(white)
    )
    box = np.array([pial.vertices.min(axis=0), pial.vertices.max(axis=0)])
    fine, affine = surface_mask(pial, LABEL_MM / CELLS, box)
    inner, _ = surface_mask(
        transformed(white, motion(shift=shift)), LABEL_MM / CELLS, box
    )
    # atlases have thin cortex, label volumes of fetuses do not
    inner *= (
        ndimage.distance_transform_edt(fine, sampling=LABEL_MM / CELLS) > MIN_CORTEX_MM
    )
    shape = [size // CELLS for size in fine.shape]
    cells = [side for size in shape for side in (size, CELLS)]
    within = tuple(slice(CELLS * size) for size in shape)
    body, core = (
        np.pad(mask[within].reshape(cells).mean(axis=(1, 3, 5)) > 0.5, 6)
        for mask in (fine, inner)
    )
    affine = affine @ np.diag([CELLS] * 3 + [1.0])
    affine[:3, 3] += 0.5 * (LABEL_MM - LABEL_MM / CELLS) - 6 * LABEL_MM
    surfaces = make_surfaces(body, core & body, affine)
    row = {"path": pial_file.name, "area_cm2": area_cm2(pial)} | surfaces.area_errors(
        area(pial)
    )
    return row | {"euler": euler_number(surfaces.opened), **surfaces.report}


def measure(
    mesh: TriangleMesh, body: np.ndarray, core: np.ndarray, affine: Floats
) -> dict[str, float]:
    """Measure the quantities of `truth` on a surface of the body."""
    hull, weights = convex_hull(mesh), vertex_areas(mesh)
    cortex = Cortex(body, body & ~core, affine)
    # far from any fissure
    thickness = thickness_from_labels(cortex, mesh, Pose(), fissure_x_mm=np.inf)
    depth = float(np.average(sulcal_depth(mesh, hull), weights=weights))
    result = {"area_mm2": area(mesh), "depth_mm": depth, "gi": area(mesh) / area(hull)}
    return result | {"thickness_mm": thickness.report["mean_mm"]}


def try_phantom(width_mm: float, voxel_mm: float, turn_deg: Turn) -> dict[str, Any]:
    """Return the relative errors of a phantom's surfaces with fused and with opened
    sulci."""
    body, core, affine = phantom(width_mm, voxel_mm, turn_deg)
    surfaces, exact = make_surfaces(body, core, affine), truth(width_mm)
    row: dict[str, Any] = {
        "width_mm": width_mm,
        "voxel_mm": voxel_mm,
        "turn_deg": turn_deg,
    }
    for name, mesh in {"fused": surfaces.fused, "opened": surfaces.opened}.items():
        row |= {
            f"{name}_{key}": value / exact[key] - 1
            for key, value in measure(mesh, body, core, affine).items()
        }
    return row


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("surfaces", type=Path, nargs="*", metavar="PATH")
    rows = []
    if paths := parser.parse_args().surfaces:
        tries = [(try_surface, (path,)) for path in paths]
    else:
        tries = [
            (try_phantom, sizes) for sizes in product(WIDTHS_MM, VOXELS_MM, TURNS_DEG)
        ]
        tries += [
            (try_branching, sizes) for sizes in product(VOXELS_MM, TURNS_DEG, NOISES)
        ]
    for function, sizes in tries:
        rows.append(function(*sizes))
        print(json.dumps(rows[-1]), flush=True)
    print_rows(rows)


if __name__ == "__main__":
    main()
