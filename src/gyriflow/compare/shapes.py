"""Surfaces made ready for comparison: the real brain's volume, even triangles, one pose; and what folds they have."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.stats import wasserstein_distance

from ..errors import InputError
from ..geometry.alignment import fit_onto
from ..geometry.matching import surface_mask
from ..geometry.remeshing import remesh
from ..geometry.triangles import Floats, Ints, TriangleMesh, signed_volume, transformed, vertex_areas

EDGE_MM = 1.0
"""Edges that surfaces are compared with, after both have the real brain's volume."""

LARGEST_CURVATURE = 1.0
"""Mean curvature beyond this (1/mm) is clipped: it is that of single sharp edges."""

CORTEX_MM, VOXEL_MM = 2.0, 0.8
"""Depth of what counts as cortex where brains are laid over each other, and the edge of the voxels that are counted."""


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
        clipped = np.clip(self.mean_curvature, -LARGEST_CURVATURE, LARGEST_CURVATURE)
        object.__setattr__(self, "mean_curvature", clipped)

    @property
    def areas(self) -> Floats:
        return vertex_areas(self.mesh)

    @property
    def curvature_rms(self) -> float:
        """The root mean square of mean curvature over the area, in 1/mm."""
        return float(np.sqrt(np.average(self.mean_curvature**2, weights=self.areas)))


def scaled_to(mesh: TriangleMesh, volume_mm3: float) -> TriangleMesh:
    """Scale a closed surface to a volume."""
    factor = (volume_mm3 / signed_volume(mesh)) ** (1 / 3)
    return transformed(mesh, np.diag([factor] * 3 + [1.0]))


def ready(mesh: TriangleMesh, real: TriangleMesh) -> TriangleMesh:
    """Scale a closed surface to the volume of the real brain, remesh it and lay it onto that rigidly.

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
    even = remesh(scaled_to(mesh, volumes[1]), EDGE_MM)
    return transformed(even, fit_onto(even, real))


def against_real(run: Shape, real: Shape) -> dict[str, float]:
    """Return how the folds of a run differ from the real ones, wherever they are.

    curvature_rms_ratio is the run's over the real one; curvature_distance_per_mm the mean difference of mean curvature
    between the two distributions by area (Wasserstein's first distance).
    """
    distance = wasserstein_distance(run.mean_curvature, real.mean_curvature, run.areas, real.areas)
    return {"curvature_rms_ratio": run.curvature_rms / real.curvature_rms, "curvature_distance_per_mm": float(distance)}


def cortex_dice(one: TriangleMesh, other: TriangleMesh) -> float:
    """Return the Dice overlap of the outermost `CORTEX_MM` of two closed surfaces, as they lie to each other in mm."""
    ribbons = [_ribbon(mesh) for mesh in (one, other)]
    both = sum(map(len, ribbons)) - len(np.unique(np.concatenate(ribbons), axis=0))
    return 2 * both / sum(map(len, ribbons))


@lru_cache(maxsize=2)
def _ribbon(mesh: TriangleMesh) -> Ints:
    """Return the voxels of the outermost `CORTEX_MM`, (k, 3) multiples of `VOXEL_MM`."""
    corner = np.floor(mesh.vertices.min(axis=0) / VOXEL_MM)
    box = np.stack([corner * VOXEL_MM, mesh.vertices.max(axis=0)])
    mask, affine = surface_mask(mesh, VOXEL_MM, box)
    # distances are to the centres of voxels outside, half a voxel beyond the surface
    depth = distance_transform_edt(mask, sampling=VOXEL_MM) - VOXEL_MM / 2
    return np.argwhere((mask > 0) & (depth <= CORTEX_MM)) + np.rint(affine[:3, 3] / VOXEL_MM).astype(np.int64)
