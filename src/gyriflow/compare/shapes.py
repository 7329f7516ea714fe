"""Surfaces prepared for comparison: scaled to the observed brain's volume, with even
triangles, aligned, with their curvature."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ..errors import InputError
from ..geometry.alignment import align
from ..geometry.matching import match_surface, surface_mask, values_at
from ..geometry.remeshing import made_even
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    signed_volume,
    transformed,
    vertex_areas,
)
from ..geometry.voxels import distance_to
from ..metrics.curvature import curvature
from ..quantities import COMPARED_MAPS
from ..settings.terms import CURVATURE_RADIUS_MM

EDGE_MM = 1.0
"""Edge length of even triangles."""
MAX_CURVATURE_PER_MM = 1.0
"""Limit of mean curvature, which is clipped: larger values come from single sharp
edges."""
CORTEX_MM, VOXEL_MM = 2.0, 0.8
"""Depth of the layer that counts as cortex in `cortex_dice`, and edge of the voxels
that are counted."""
DEPTH_TOL_MM = 1e-3
"""Depths this close to `CORTEX_MM` count as equal to it."""
MAX_VOXELS = 1 << 20
"""Largest number of voxels along a direction."""


@dataclass(frozen=True, eq=False)
class PreparedSurface:
    """A closed surface in mm with even triangles, prepared for comparison, with the
    curvature at its n vertices.

    `mean_curvature` (n,) is in 1/mm, positive on gyri, clipped at ±
    `MAX_CURVATURE_PER_MM`; `shape_index` (n,) is from −1, a pit, to 1.
    """

    mesh: TriangleMesh
    mean_curvature: Floats
    shape_index: Floats

    def __post_init__(self) -> None:
        clipped = np.clip(
            self.mean_curvature, -MAX_CURVATURE_PER_MM, MAX_CURVATURE_PER_MM
        )
        object.__setattr__(self, "mean_curvature", clipped)

    @cached_property
    def areas(self) -> Floats:
        """The (n,) areas of the vertices in mm²."""
        return vertex_areas(self.mesh)


def prepare_for_comparison(
    mesh: TriangleMesh,
    observed: TriangleMesh,
    radius_mm: float = CURVATURE_RADIUS_MM,
) -> PreparedSurface:
    """Scale a closed surface to the observed brain's volume, make its triangles even,
    align it rigidly and fit its curvature.

    The observed brain itself (`mesh is observed`) is not scaled. `radius_mm` is that of
    `metrics.curvature`. InputError where a surface encloses no volume.
    """
    volumes = [signed_volume(surface) for surface in (mesh, observed)]
    if min(volumes) <= 0:
        raise InputError(
            "a surface encloses no volume, so it cannot be compared",
            found=f"{volumes[0]:.4g} and {volumes[1]:.4g} mm³",
            expected="closed surfaces with outward faces",
        )
    if mesh is observed:
        even = made_even(observed, EDGE_MM)
    else:
        scaled = scale_to_volume(mesh, observed)
        even = align(made_even(scaled, EDGE_MM), observed)
    fitted = curvature(even, radius_mm=radius_mm)
    return PreparedSurface(even, fitted.mean, fitted.shape_index)


def scale_to_volume(mesh: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """Scale a closed surface uniformly to the volume of another one."""
    factor = (signed_volume(other) / signed_volume(mesh)) ** (1 / 3)
    return transformed(
        mesh,
        np.diag([factor] * 3 + [1.0]),
    )


def interpolate_measures(
    surface: PreparedSurface, observed: PreparedSurface
) -> tuple[dict[str, Floats], float]:
    """Interpolate the measures of a surface at the n vertices of the observed one, both
    aligned.

    Each vertex takes the value at the nearest point whose normal agrees. Returns (n,)
    values by measure, and the share of the observed area for which there is such a
    point.
    """
    match = match_surface(observed.mesh, surface.mesh)
    values = {
        measure: values_at(match, getattr(surface, measure))
        for measure in COMPARED_MAPS
    }
    return values, float(
        np.average(
            match.agrees,
            weights=observed.areas,
        )
    )


def curvature_differences(
    surface: PreparedSurface, observed: PreparedSurface
) -> dict[str, float]:
    """Compare how strongly two surfaces are folded, regardless of where.

    curvature_rms_ratio is the ratio to the observed one; curvature_distance_per_mm is
    the first Wasserstein distance between the distributions of mean curvature over the
    area.
    """
    rms_ratio = _curvature_rms(surface) / _curvature_rms(observed)
    # the distance is the area between the cumulative distributions
    values = np.concatenate([surface.mean_curvature, observed.mean_curvature])
    shares = np.concatenate(
        [
            surface.areas / surface.areas.sum(),
            -observed.areas / observed.areas.sum(),
        ]
    )
    order = values.argsort()
    gaps = np.abs(shares[order].cumsum())
    distance = gaps[:-1] @ np.diff(values[order])
    return {
        "curvature_rms_ratio": rms_ratio,
        "curvature_distance_per_mm": float(distance),
    }


def _curvature_rms(surface: PreparedSurface) -> float:
    """Return the root mean square of mean curvature over the area, in 1/mm."""
    squares = surface.mean_curvature**2
    return float(np.sqrt(np.average(squares, weights=surface.areas)))


def cortex_dice(surface: TriangleMesh, observed: TriangleMesh) -> float:
    """Return the Dice overlap of the outermost `CORTEX_MM` of two aligned closed
    surfaces in mm."""
    first = _ribbon(surface)
    second = _ribbon(observed)
    both = np.intersect1d(first, second, assume_unique=True)
    total = len(first) + len(second)
    return 2 * len(both) / total


@lru_cache(maxsize=2)
def _ribbon(mesh: TriangleMesh) -> Ints:
    """Return the voxels of the outermost `CORTEX_MM` as (k,) numbers, the same for all
    surfaces."""
    lowest = mesh.vertices.min(axis=0)
    highest = mesh.vertices.max(axis=0)
    corner = np.floor(lowest / VOXEL_MM) * VOXEL_MM
    box = np.stack([corner, highest])
    mask, affine = surface_mask(mesh, VOXEL_MM, box)
    # distances are to the centres of voxels outside, half a voxel beyond the surface;
    # voxels exactly as deep as the layer are left out, whatever the rounding
    depth = distance_to(mask == 0, VOXEL_MM) - VOXEL_MM / 2
    in_cortex = (mask > 0) & (depth < CORTEX_MM - DEPTH_TOL_MM)
    first_voxel = np.rint(affine[:3, 3] / VOXEL_MM).astype(np.int64)
    voxels = np.argwhere(in_cortex) + first_voxel
    digits = MAX_VOXELS ** np.arange(3)
    return np.asarray(voxels @ digits)
