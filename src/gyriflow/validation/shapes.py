"""Surfaces made ready for comparison: the real brain's volume, even triangles, one pose."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..geometry.motion import fit_onto
from ..geometry.remeshing import remesh
from ..geometry.triangles import Floats, TriangleMesh, signed_volume, transformed, vertex_areas

EDGE_MM = 1.0
"""Edges that surfaces are compared with, after both have the real brain's volume."""

LARGEST_CURVATURE = 1.0
"""Mean curvature beyond this (1/mm) is clipped: it is that of single sharp edges."""


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
