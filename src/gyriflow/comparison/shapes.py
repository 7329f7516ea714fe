"""Surfaces made ready for comparison: the real brain's volume, even triangles, one pose; and what folds they have.

Folds wherever they are: curvature's size and distribution, pits against troughs, long or round.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.ndimage import distance_transform_edt
from scipy.sparse.csgraph import dijkstra
from scipy.stats import wasserstein_distance

from ..errors import InputError
from ..geometry.alignment import fit_onto
from ..geometry.matching import surface_mask
from ..geometry.remeshing import remesh
from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    area,
    face_areas,
    face_components,
    signed_volume,
    submesh,
    transformed,
    vertex_areas,
)

EDGE_MM = 1.0
"""Edges that surfaces are compared with, after both have the real brain's volume."""

LARGEST_CURVATURE = 1.0
"""Mean curvature beyond this (1/mm) is clipped: it is that of single sharp edges."""

PIT, TROUGH = -5 / 8, -3 / 8
"""Shape indices below which a place is a pit, and from there a trough (Koenderink and van Doorn 1992)."""

CORTEX_MM, VOXEL_MM = 2.0, 0.8
"""Depth of what counts as cortex where brains are laid over each other, and the edge of the voxels that are counted."""

LEAST_SULCUS_MM2 = 10.0
"""Connected sulcal areas that are smaller tell of noise."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A surface that is ready, with its curvature.

    Attributes
    ----------
    mesh
        Of `ready`.
    mean_curvature : (n,) float
        In 1/mm at its vertices, positive on gyri, clipped at ± `LARGEST_CURVATURE`.
    shape_index : (n,) float
        From −1, a pit, to 1.
    """

    mesh: TriangleMesh
    mean_curvature: Floats
    shape_index: Floats

    def __post_init__(self) -> None:
        for name in ("mean_curvature", "shape_index"):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (len(self.mesh.vertices),):
                raise ValueError(f"{name} of shape {values.shape} for {len(self.mesh.vertices)} vertices")
        clipped = np.clip(self.mean_curvature, -LARGEST_CURVATURE, LARGEST_CURVATURE)
        object.__setattr__(self, "mean_curvature", clipped)

    @property
    def areas(self) -> Floats:
        """The (n,) areas in mm² that belong to the vertices."""
        return vertex_areas(self.mesh)

    @property
    def curvature_rms(self) -> float:
        """The root mean square of mean curvature over the area, in 1/mm."""
        return float(np.sqrt(np.average(self.mean_curvature**2, weights=self.areas)))


def ready(mesh: TriangleMesh, real: TriangleMesh) -> TriangleMesh:
    """Returns a closed surface scaled to the volume of the real brain, remeshed and laid onto it rigidly.

    The real brain itself is only remeshed. InputError where a surface encloses no volume.
    """
    volumes = [signed_volume(surface) for surface in (mesh, real)]
    if min(volumes) <= 0:
        raise InputError(
            "a surface encloses no volume, so that it cannot be compared",
            found=f"{volumes[0]:.4g} and {volumes[1]:.4g} mm³",
            expected="closed surfaces with their faces outwards",
        )
    if mesh is real:
        return remesh(real, EDGE_MM)
    factor = (volumes[1] / volumes[0]) ** (1 / 3)
    even = remesh(transformed(mesh, np.diag([factor] * 3 + [1.0])), EDGE_MM)
    return transformed(even, fit_onto(even, real))


def fold_measures(shape: Shape) -> dict[str, float]:
    """Returns measures of the folds of a shape that is ready, each a number.

    relative_area
        A/V^⅔, 4.84 for a ball.
    curvature_rms_per_mm
        Root mean square of mean curvature.
    curvature_q05_per_mm, …q50…, …q95…
        Quantiles of mean curvature by area.
    pit_share, trough_share
        Of the area, with shape index below −5/8, and from there to −3/8.
    pits_per_trough
        The former over the latter; NaN without troughs.
    sulci, sulcal_length_over_width
        Number of connected areas with a shape index below −3/8, and their mean length over width, by area: of
        `length_over_width`; NaN without any.
    """
    areas, mean = shape.areas, shape.mean_curvature
    quantiles = np.quantile(mean, [0.05, 0.5, 0.95], weights=areas, method="inverted_cdf")
    pits = float(np.average(shape.shape_index < PIT, weights=areas))
    troughs = float(np.average((shape.shape_index >= PIT) & (shape.shape_index < TROUGH), weights=areas))
    lengths, sizes = sulci(shape.mesh, shape.shape_index)
    return {
        "relative_area": area(shape.mesh) / signed_volume(shape.mesh) ** (2 / 3),
        "curvature_rms_per_mm": shape.curvature_rms,
        **dict(zip((f"curvature_q{share}_per_mm" for share in ("05", "50", "95")), map(float, quantiles), strict=True)),
        "pit_share": pits,
        "trough_share": troughs,
        "pits_per_trough": pits / troughs if troughs > 0 else float("nan"),
        "sulci": float(len(sizes)),
        "sulcal_length_over_width": length_over_width(lengths, sizes),
    }


def against_real(run: Shape, real: Shape) -> dict[str, float]:
    """Returns how the folds of a run differ from the real ones, wherever they are.

    curvature_rms_ratio is the run's over the real one; curvature_distance_per_mm the mean difference of mean curvature
    between the two distributions by area (Wasserstein's first distance).
    """
    distance = wasserstein_distance(run.mean_curvature, real.mean_curvature, run.areas, real.areas)
    return {"curvature_rms_ratio": run.curvature_rms / real.curvature_rms, "curvature_distance_per_mm": float(distance)}


def cortex_dice(one: TriangleMesh, other: TriangleMesh) -> float:
    """Returns the Dice overlap of the outermost `CORTEX_MM` of two closed surfaces, as they lie to each other in mm."""
    box = np.concatenate([one.vertices, other.vertices])
    box = np.stack([box.min(axis=0), box.max(axis=0)])
    ribbons = []
    for mesh in (one, other):
        inside = surface_mask(mesh, VOXEL_MM, box)[0] > 0
        # distances are to the centres of voxels outside, half a voxel beyond the surface
        depth = distance_transform_edt(inside, sampling=VOXEL_MM) - VOXEL_MM / 2
        ribbons.append(inside & (depth <= CORTEX_MM))
    both = np.count_nonzero(ribbons[0] & ribbons[1])
    return 2 * both / sum(map(np.count_nonzero, ribbons))


def sulci(mesh: TriangleMesh, shape_index: Floats) -> tuple[Floats, Floats]:
    """Returns length in mm and area in mm² of each connected area whose shape index is below −3/8.

    The length is the longest of the shortest ways inside the area, found from a far end.
    """
    sulcal = shape_index[mesh.faces].max(axis=1) < TROUGH
    lengths, sizes = [], []
    if sulcal.any():
        part, _ = submesh(mesh, sulcal)
        component = face_components(part)
        for number in range(component.max() + 1):
            piece, _ = submesh(part, component == number)
            size = float(face_areas(piece).sum())
            if size >= LEAST_SULCUS_MM2:
                lengths.append(_length(piece))
                sizes.append(size)
    return np.array(lengths), np.array(sizes)


def length_over_width(lengths: Floats, areas: Floats) -> float:
    """Returns the mean by area of length over width, the width being area over length; NaN of nothing.

    4/π for a disc, the ratio of the sides for a long strip.
    """
    return float(np.average(lengths**2 / areas, weights=areas)) if len(areas) else float("nan")


def _length(piece: TriangleMesh) -> float:
    """Returns the length in mm of the way between two far vertices, the second as far as any from the first.

    Ways run along edges and straight across pairs of faces that share one, which leaves them a few per cent too long.
    """
    corner = piece.faces[:, [0, 1, 2, 1, 2, 0, 2, 0, 1]].reshape(-1, 3)
    sides, opposite = np.sort(corner[:, :2], axis=1), corner[:, 2]
    order = np.argsort(sides @ [len(piece.vertices), 1], kind="stable")
    same = (sides[order[1:]] == sides[order[:-1]]).all(axis=1)
    across = np.stack([opposite[order[1:]], opposite[order[:-1]]], axis=1)[same]
    ways = np.unique(np.sort(np.concatenate([sides, across]), axis=1), axis=0)
    steps = np.linalg.norm(np.diff(piece.vertices[ways], axis=1)[:, 0], axis=1)
    graph = sparse.csr_matrix((steps, ways.T), shape=(len(piece.vertices),) * 2)
    far = int(dijkstra(graph, directed=False, indices=0).argmax())
    return float(dijkstra(graph, directed=False, indices=far).max())
