"""A smooth hemisphere to fold, meshed as finely as asked, and what a run on any of its meshes comes to.

The shape is the left half of the shipped atlas' brain of 21 GW, from labels smoothed more than a study would, with
shallow bumps of 8 to 24 mm. All meshes hold that one surface: the bumps are far higher than facets and mesh noise, so
that every mesh starts from the same imperfection.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyriflow.geometry.curved_faces import finer_surface
from gyriflow.geometry.matching import match_points, values_at
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed, vertex_normals
from gyriflow.io.frames import read_positions, read_tets
from gyriflow.io.volumes import read_label_volume
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.metrics.hemisphere import Settings, folding_rows, measure_hemisphere, size_rows, spectrum_rows
from gyriflow.parameters.schemes import SCHEMES
from gyriflow.surface.from_labels import hemisphere_from_labels

Floats = NDArray[np.float64]

LABELS = "atlases/spina-bifida/fetal_SB_atlas_GA21_notoperated/parcellation.nii.gz"
START_WEEK = 21.0
SMOOTHING_VOXELS = 2.0
BUMPS, BUMP_MM = 24, 0.15
"""Number of the waves, and the standard deviation of their sum."""
WAVELENGTHS_MM = (8.0, 24.0)
FINE_EDGE_MM = 0.6
"""Edges of the surface that all meshes hold."""
MEASURED_EDGE_MM = 1.0
"""Edges of the surface that is carried along by every run and measured, as those of a study."""
CORE = 1.6
"""Largest distance of nodes inside, in those at the surface: meshes differ by their scale only."""
ROTATION = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
"""Turns the surface while it is meshed: another mesh of the same resolution."""


@cache
def start_surface(root: Path) -> TriangleMesh:
    """Returns the smooth hemisphere, closed and outward, in RAS+ mm; `root` is the folder of the checkout."""
    volume, scheme = read_label_volume(root / LABELS), SCHEMES["spina-bifida-atlas"]
    places = np.stack(np.indices(volume.labels.shape), axis=-1) @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    x = places[..., 0]
    of_cerebrum = x[np.isin(volume.labels, scheme.cerebrum)]
    # half a voxel aside, since the middle lies on voxels
    left = np.where(x < (of_cerebrum.min() + of_cerebrum.max()) / 2 - volume.affine[0, 0] / 2, volume.labels, 0)
    smooth = hemisphere_from_labels(
        left,
        volume.affine,
        scheme,
        "left",
        week=START_WEEK,
        smoothing_voxels=SMOOTHING_VOXELS,
        edge_length_mm=FINE_EDGE_MM,
        smoothing_iterations=20,
    ).whole
    height = bumps(smooth.vertices)
    return TriangleMesh(smooth.vertices + height[:, None] * vertex_normals(smooth), smooth.faces)


def bumps(points: Floats) -> Floats:
    """Returns the (n,) height in mm of the bumps: waves in directions spread evenly (a Fibonacci sphere)."""
    number = np.arange(BUMPS) + 0.5
    polar, azimuth = np.arccos(1 - 2 * number / BUMPS), np.pi * (1 + np.sqrt(5)) * number
    directions = np.stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)], axis=1)
    phases = 2 * np.pi * (points @ directions.T) / np.linspace(*WAVELENGTHS_MM, BUMPS) + number**2
    return BUMP_MM * np.cos(phases).sum(axis=1) / np.sqrt(BUMPS / 2)


def mesh_of(surface: TriangleMesh, order: int, spacing_mm: float, turned: bool = False) -> TetrahedralMesh:
    """Returns a mesh of elements of an order with nodes `spacing_mm` apart at the surface."""
    motion = np.eye(4)
    motion[:3, :3] = ROTATION if turned else np.eye(3)
    mesh = tetrahedralise(
        transformed(surface, motion),
        surface_edge_mm=spacing_mm,
        core_edge_mm=CORE * spacing_mm,
        envelope_mm=0.1,
        time_limit_s=1800,
        mesher="tetgen",
        order=order,
    )
    return TetrahedralMesh(mesh.vertices @ motion[:3, :3], mesh.tets)


@dataclass(frozen=True, eq=False)
class Carried:
    """What a run made of the measured surface at a week.

    Attributes
    ----------
    surface
        The measured surface, moved as the run moves its places; faces are the same in all runs.
    mean_curvature : (n,) float
        In 1/mm at its vertices.
    values
        Metrics by name, of `surface`; own_area and own_volume are those of the run's own mesh.
    """

    surface: TriangleMesh
    mean_curvature: Floats
    values: dict[str, float]


@cache
def measured_surface(root: Path) -> TriangleMesh:
    """Returns the start surface with the edges at which a study measures."""
    return remesh(start_surface(root), MEASURED_EDGE_MM)


def carried(root: Path, frames: Path, week: float, modes: str = "B5") -> Carried:
    """Returns the measured surface as a run has moved it by a week, with its metrics."""
    start = TetrahedralMesh(read_positions(frames, START_WEEK), read_tets(frames))
    own, nodes = boundary_surface(start)
    now = read_positions(frames, week)[nodes]
    before, after, faces = own.vertices, now, own.faces.astype(np.int64)
    if start.order == 2:
        matrix, faces = finer_surface(faces)
        before, after = matrix @ before, matrix @ after
    measured = measured_surface(root)
    match = match_points(measured.vertices, vertex_normals(measured), TriangleMesh(before, faces))
    surface = TriangleMesh(measured.vertices + values_at(match, after - before), measured.faces)
    side = measure_hemisphere("left", surface, None, Settings(spangy_modes=modes))
    rows = size_rows(surface, side.crossing) + folding_rows([side]) + spectrum_rows(side, "shape_index")
    values = {name: value for name, value, _ in rows}
    values |= {f"own_{name}": value for name, value, _ in size_rows(TriangleMesh(after, faces), 0)[:2]}
    return Carried(surface, side.bend.mean, values)
