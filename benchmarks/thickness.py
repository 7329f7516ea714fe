"""Measure cortical thickness on folded bodies whose thickness is known, voxelised to
labels.

    ./run python benchmarks/thickness.py [--voxels MM ...] [--placements N]

The middle of the cortex is the closed form u (R + h cos(k u₁) cos(k u₂) cos(k u₃ + 1))
over the unit sphere, R = 16 mm; pial and white surface are half a thickness away along
its normal, so their distance is exact. `height_mm` is h, `wave_mm` 2πR/k; a height of 0
is a ball. Each body is voxelised in grids turned and shifted at random, and measured as
labels of a brain are: pial surface, then thickness, `error_percent` of its mean
(weighted by area) and the standard deviation of the map (`sd_mm`).

Definitions are compared on the exact surfaces, in percent of the thickness: `defined`
as gyriflow does (Fischl & Dale), `nearest` the distance to the white surface, and
`laplace` the length of the streamlines of Laplace's equation between both, to second
order in their slope against the normal. Labels are measured besides by the pial
surface and the exact white one (`pial_percent`), and by the exact pial surface and the
border found (`border_percent`), which shows which of the two is wrong.

The last line is one JSON object with `rows` and `definitions`.
"""

import argparse
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
import trimesh
from common import print_rows
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.labels import read_cerebrum
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.anatomy.thickness import border, cortex_of, thickness_from_labels
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.matching import layer_labels, layer_thickness, nearest_on
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import Floats, TriangleMesh, vertex_areas
from gyriflow.settings.schemes import LabelScheme

RADIUS_MM, PHASE, EDGE_MM = 16.0, 1.0, 1.0
VOXELS_MM = ((0.5, 0.5, 0.5), (0.8, 0.8, 0.8), (1.2, 1.2, 1.2), (1.0, 1.0, 3.0))
# subdivisions of an icosahedron: edges of 0.3 mm, and 0.6 mm for Laplace's equation
SUBDIVISIONS, COARSE = 6, 5
LAYERS = 6
MARGIN_VOXELS = 7
SCHEME = LabelScheme(name="folds", cerebrum=(1, 2), cortex=(2,))


@dataclass(frozen=True)
class Folds:
    """A body: height of its folds, waves around it over 2π, and thickness."""

    height_mm: float
    frequency: float
    thickness_mm: float


BODIES = (
    Folds(0.0, 7.0, 2.0),
    Folds(1.0, 7.0, 2.0),
    Folds(2.0, 5.0, 2.0),
    Folds(2.0, 7.0, 2.0),
    Folds(2.0, 7.0, 1.2),
)


def middle(folds: Folds, subdivisions: int) -> tuple[TriangleMesh, Floats]:
    """Return the middle of the cortex in mm, and its (n, 3) exact unit normals."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    unit = np.array(ball.vertices)
    angles = folds.frequency * unit + [0.0, 0.0, PHASE]
    cosines, sines = np.cos(angles), np.sin(angles)
    radii = RADIUS_MM + folds.height_mm * cosines.prod(axis=1)
    gradient = np.empty_like(unit)
    for axis in range(3):
        others = np.delete(cosines, axis, axis=1).prod(axis=1)
        gradient[:, axis] = -folds.frequency * sines[:, axis] * others
    gradient *= folds.height_mm
    gradient -= np.einsum("ij,ij->i", gradient, unit)[:, None] * unit
    normals = radii[:, None] * unit - gradient
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = TriangleMesh(radii[:, None] * unit, np.array(ball.faces, dtype=np.int64))
    return mesh, normals


def parallel(mesh: TriangleMesh, normals: Floats, shift_mm: float) -> TriangleMesh:
    """Return a surface moved along its (n, 3) normals."""
    return TriangleMesh(mesh.vertices + shift_mm * normals, mesh.faces)


def both_surfaces(folds: Folds) -> tuple[TriangleMesh, TriangleMesh]:
    """Return the exact pial and white surface of a body."""
    mesh, normals = middle(folds, SUBDIVISIONS)
    half = 0.5 * folds.thickness_mm
    return parallel(mesh, normals, half), parallel(mesh, normals, -half)


def mean_over(values: Floats, mesh: TriangleMesh) -> float:
    """Return the mean of values (n,) at the vertices of a surface, by area."""
    return float(np.average(values, weights=vertex_areas(mesh)))


def streamline_lengths(folds: Folds) -> tuple[Floats, TriangleMesh]:
    """Return the (n,) lengths in mm of the streamlines of Laplace's equation between
    both surfaces, and the pial surface on which they end.

    Linear tetrahedra in layers along the normals. A streamline with the slope s against
    the normal is √(1 + s²) times as long as the layer it crosses.
    """
    mesh, normals = middle(folds, COARSE)
    n = len(mesh.vertices)
    heights = folds.thickness_mm * np.linspace(-0.5, 0.5, LAYERS + 1)
    points = np.concatenate(
        [parallel(mesh, normals, height).vertices for height in heights]
    )
    # neighbouring prisms agree on the diagonals if vertices are in order
    low = np.sort(mesh.faces, axis=1)
    tetrahedra = []
    for layer in range(LAYERS):
        (a, b, c), (d, e, f) = (low + layer * n).T, (low + (layer + 1) * n).T
        tetrahedra += [
            np.stack(corners, axis=1)
            for corners in ((a, b, c, f), (a, b, e, f), (a, d, e, f))
        ]
    elements = np.concatenate(tetrahedra)
    sides = points[elements[:, 1:]] - points[elements[:, :1]]
    volumes = np.abs(np.linalg.det(sides)) / 6.0
    slopes = np.linalg.inv(sides).transpose(0, 2, 1)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    local = np.einsum("eik,ejk,e->eij", slopes, slopes, volumes)
    rows = np.repeat(elements, 4, axis=1).ravel()
    columns = np.tile(elements, (1, 4)).ravel()
    stiffness = sparse.csr_matrix((local.ravel(), (rows, columns)))
    potential = np.zeros(len(points))
    potential[-n:] = 1.0
    inner = slice(n, len(points) - n)
    matrix = stiffness[inner, inner]
    right = -(stiffness @ potential)[inner]
    scaling = sparse.diags(1.0 / matrix.diagonal())
    potential[inner], _ = cg(matrix, right, rtol=1e-8, M=scaling)
    gradient = np.einsum("ei,eik->ek", potential[elements], slopes)
    at_nodes = np.zeros_like(points)
    for corner in range(4):
        np.add.at(at_nodes, elements[:, corner], volumes[:, None] * gradient)
    at_nodes = at_nodes.reshape(LAYERS + 1, n, 3)
    along = np.einsum("lnk,nk->ln", at_nodes, normals)
    longer = np.linalg.norm(at_nodes, axis=2) / along
    lengths = np.trapezoid(longer, heights, axis=0)
    return lengths, parallel(mesh, normals, heights[-1])


def definitions(folds: Folds) -> dict[str, Any]:
    """Return the mean thickness of a body's exact surfaces by three definitions, in
    percent of its thickness."""
    pial, white = both_surfaces(folds)
    lengths, ends = streamline_lengths(folds)
    means = {
        "defined": mean_over(layer_thickness(pial, white), pial),
        "nearest": mean_over(nearest_on(pial.vertices, white)[0], pial),
        "laplace": mean_over(lengths, ends),
    }
    percent = {
        name: 100 * (mean / folds.thickness_mm - 1) for name, mean in means.items()
    }
    return named(folds) | percent


def named(folds: Folds) -> dict[str, float]:
    """Return what identifies a body in a table."""
    wave_mm = 2 * np.pi * RADIUS_MM / folds.frequency
    shown = asdict(folds) | {"wave_mm": round(wave_mm, 1)}
    del shown["frequency"]
    return shown


def placement(reach_mm: float, size: Floats, seed: int) -> tuple[Floats, Floats]:
    """Return the (4, 4) affine and the shape of a grid, turned and shifted at random,
    around a body."""
    random = np.random.default_rng(seed)
    turn = Rotation.random(rng=random).as_matrix()
    half = reach_mm + MARGIN_VOXELS * size
    shape = np.ceil(2 * half / size).astype(int)
    corner = size * random.uniform(-0.5, 0.5, 3) - half
    affine = motion(turn) @ motion(shift=corner) @ np.diag([*size, 1.0])
    return affine, shape


def measure(folds: Folds, voxel_mm: tuple[float, ...], seed: int) -> dict[str, Any]:
    """Return the errors of a body's thickness in one grid of voxels, in percent."""
    pial, white = both_surfaces(folds)
    size = np.array(voxel_mm)
    reach = float(np.linalg.norm(pial.vertices, axis=1).max())
    affine, shape = placement(reach, size, seed)
    body, core = (
        layer_labels(mesh, np.zeros(len(mesh.vertices)), tuple(shape), affine) > 0
        for mesh in (pial, white)
    )
    labels = np.where(body, np.where(core, 1, 2), 0)
    volume = float(body.sum() * size.prod())
    found = surface_of_mask(smooth_mask(body), affine, volume, EDGE_MM).mesh
    cortex = cortex_of(read_cerebrum(labels, affine, SCHEME), SCHEME)
    thickness = thickness_from_labels(cortex, found, Pose())
    inner = border(core, affine)
    means = {
        "error": thickness.report["mean_mm"],
        "pial": mean_over(layer_thickness(found, white), found),
        "border": mean_over(layer_thickness(pial, inner), pial),
    }
    row: dict[str, Any] = named(folds) | {"voxel_mm": " x ".join(map(str, voxel_mm))}
    for name, mean in means.items():
        row[f"{name}_percent"] = 100 * (mean / folds.thickness_mm - 1)
    return row | {"sd_mm": thickness.report["sd_mm"]}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--voxels",
        nargs=3,
        action="append",
        type=float,
        metavar="MM",
        help="edges of a voxel; several times for several sizes",
    )
    parser.add_argument("--placements", type=int, default=2)
    arguments = parser.parse_args()
    exact = [definitions(folds) for folds in BODIES]
    print(pd.DataFrame(exact).to_string(index=False, float_format="%.2f"), flush=True)
    rows = []
    for folds in BODIES:
        for voxel_mm in arguments.voxels or VOXELS_MM:
            tries = [
                measure(folds, tuple(voxel_mm), seed)
                for seed in range(arguments.placements)
            ]
            mean = pd.DataFrame(tries).mean(numeric_only=True)
            rows.append(tries[0] | {name: float(mean[name]) for name in mean.index})
            print(rows[-1], flush=True)
    print_rows(rows, definitions=exact)


if __name__ == "__main__":
    main()
