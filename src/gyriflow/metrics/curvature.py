"""Curvature of triangle surfaces; outward normals, so that gyri are positive and sulci negative."""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from ..errors import MeshError
from ..geometry.triangles import Floats, TriangleMesh, edges, mean_edge_length
from ..parameters.metrics import CURVATURE_RADIUS_MM
from .quadrics import fit_quadrics

log = logging.getLogger(__name__)

EDGES_PER_RADIUS = 2.0
"""Radius of the smallest ball in edges: with fewer neighbours a quadric follows the noise."""

MAX_FAILED_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class Curvature:
    """Curvature per vertex of a surface with n vertices.

    Attributes
    ----------
    maximum, minimum : (n,) float
        Principal curvatures κ1 ≥ κ2 in 1/mm; both are 1/R on a sphere of radius R.
    reliable : (n,) bool
        False where the ball round a vertex reaches the boundary of an open surface, or no quadric could be fitted.
    radius_mm : (n,) float
        Radius of the ball that each vertex's curvature is fitted in.
    """

    maximum: Floats
    minimum: Floats
    reliable: NDArray[np.bool_]
    radius_mm: Floats

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


def curvature(mesh: TriangleMesh, *, radius_mm: float = CURVATURE_RADIUS_MM) -> Curvature:
    """Returns the curvature from quadrics fitted to the surface within `radius_mm` of each vertex.

    The quadric is a local height function with slope (Cazals and Pouget 2005 call it a jet of degree 2); its principal
    curvatures are those at the vertex's foot. It need not pass through the vertex, which averages noise out. Where the
    local edges are longer than half of `radius_mm`, the ball grows to two of them, and a warning names the finest
    scale of the mesh. Weights: see `quadrics.fit_quadrics`. MeshError where a vertex in a hundred has no usable
    neighbourhood.
    """
    finest = EDGES_PER_RADIUS * mean_edge_length(mesh)
    if finest > radius_mm:
        log.warning(
            "curvature at a radius of %.3g mm is finer than the mesh: %.3g mm is the finest it supports",
            radius_mm,
            finest,
        )
    radii = np.maximum(radius_mm, EDGES_PER_RADIUS * _edge_lengths(mesh))
    quadrics = fit_quadrics(mesh, radii)
    failed = int(np.count_nonzero(~quadrics.fitted))
    if failed > MAX_FAILED_SHARE * len(mesh.vertices):
        raise MeshError(
            "no curvature can be fitted",
            found=f"{failed} of {len(mesh.vertices)} vertices without a regular neighbourhood",
            remedy="Repair or remesh the surface",
        )
    a, b, c, d, e, _ = quadrics.coefficients.T
    # first and second fundamental form of the height function; outward normals make a cap negative
    stretch = 1.0 + d**2 + e**2
    mean = -((1.0 + e**2) * a - d * e * b + (1.0 + d**2) * c) / stretch**1.5
    gaussian = (4.0 * a * c - b**2) / stretch**2
    half_difference = np.sqrt(np.maximum(mean**2 - gaussian, 0.0))
    return Curvature(
        maximum=mean + half_difference,
        minimum=mean - half_difference,
        reliable=quadrics.fitted & ~quadrics.one_sided,
        radius_mm=radii,
    )


def _edge_lengths(mesh: TriangleMesh) -> Floats:
    """Returns the (n,) mean length in mm of the edges at each vertex, 0 without edges."""
    pairs, _ = edges(mesh)
    lengths = np.repeat(np.linalg.norm(np.diff(mesh.vertices[pairs], axis=1)[:, 0], axis=1), 2)
    size = len(mesh.vertices)
    return np.bincount(pairs.ravel(), lengths, size) / np.maximum(np.bincount(pairs.ravel(), minlength=size), 1)


def continue_smoothly(values: Floats, known: NDArray[np.bool_], stiffness: sparse.csc_matrix) -> Floats:
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
