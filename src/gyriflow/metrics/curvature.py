"""Curvature of triangle surfaces; outward normals, so that gyri are positive and sulci negative."""

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from ..errors import MeshError
from ..geometry.triangles import Floats, TriangleMesh, edges


@dataclass(frozen=True, eq=False)
class Curvature:
    """Curvature per vertex of a surface with n vertices.

    Attributes
    ----------
    maximum, minimum : (n,) float
        Principal curvatures κ1 ≥ κ2 in 1/mm; both are 1/R on a sphere of radius R.
    reliable : (n,) bool
        False near the boundary of an open surface, where the neighbourhood of a vertex is one-sided.
    """

    maximum: Floats
    minimum: Floats
    reliable: NDArray[np.bool_]

    @property
    def mean(self) -> Floats:
        """The (n,) mean curvature (κ1 + κ2)/2 in 1/mm."""
        return 0.5 * (self.maximum + self.minimum)

    @property
    def gaussian(self) -> Floats:
        """The (n,) Gaussian curvature κ1 κ2 in 1/mm²."""
        return self.maximum * self.minimum

    @property
    def shape_index(self) -> Floats:
        """The (n,) shape index 2/π·atan2(κ1 + κ2, κ1 − κ2): −1 sulcal pit, 0 saddle, +1 gyral node.

        Koenderink and van Doorn 1992, with outward normals; 0 on a plane.
        """
        return 2.0 / np.pi * np.arctan2(self.maximum + self.minimum, self.maximum - self.minimum)

    @property
    def curvedness(self) -> Floats:
        """The (n,) curvedness √((κ1² + κ2²)/2) in 1/mm (Koenderink and van Doorn 1992)."""
        return np.sqrt(0.5 * (self.maximum**2 + self.minimum**2))


def curvature(mesh: TriangleMesh, *, rings: int = 3) -> Curvature:
    """Returns the curvature from quadrics fitted to the `rings` rings of neighbours of each vertex (libigl).

    The method is that of Panozzo, Puppo and Rocca 2010. Vertices closer than `rings` edges to a boundary are marked
    as unreliable. MeshError where a vertex has no usable neighbourhood.
    """
    _, _, first, second, bad = igl.principal_curvature(mesh.vertices, mesh.faces, rings, True)
    values = np.stack([first, second])
    failed = ~np.isfinite(values).all(axis=0)
    failed[np.asarray(bad, dtype=int)] = True
    reliable = ~near_boundary(mesh, rings - 1)
    if (failed & reliable).any():
        raise MeshError(
            "no curvature can be fitted",
            found=f"{np.count_nonzero(failed & reliable)} vertices without a regular neighbourhood",
            remedy="Repair or remesh the surface",
        )
    values[:, failed] = 0.0
    return Curvature(maximum=values.max(axis=0), minimum=values.min(axis=0), reliable=reliable)


def near_boundary(mesh: TriangleMesh, rings: int) -> NDArray[np.bool_]:
    """Returns the (n,) mask of vertices at most `rings` edges away from a boundary; none on a closed surface."""
    pairs, counts = edges(mesh)
    near = np.zeros(len(mesh.vertices), dtype=bool)
    near[pairs[counts == 1]] = True
    for _ in range(rings):
        touched = near[pairs].any(axis=1)
        near[pairs[touched]] = True
    return near


def continued(values: Floats, known: NDArray[np.bool_], stiffness: sparse.csc_matrix) -> Floats:
    """Returns (n,) values with the unknown ones replaced by the smoothest continuation of the known ones.

    The continuation is harmonic (K f = 0 with the (n, n) stiffness matrix K) with a free boundary.
    """
    if known.all() or not known.any():
        return values
    unknown = np.flatnonzero(~known)
    rows = sparse.csr_matrix(stiffness)[unknown]
    filled = values.copy()
    filled[unknown] = spsolve(sparse.csc_matrix(rows[:, unknown]), -rows[:, np.flatnonzero(known)] @ values[known])
    return filled
