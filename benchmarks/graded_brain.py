"""One synthetic brain of two hemispheres, meshed as finely as asked: the meshes of `scaling.py`.

The brain is where a function of space is negative: an ellipsoid with shallow dents, as large as a cerebrum at 21 GW,
less a fissure which a bridge spans. Meshes of different size differ by their resolution only.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import TriangleMesh

Floats = NDArray[np.float64]

SEMI_AXES_MM = np.array([21.0, 28.0, 21.5])
FISSURE_MM = 3.0
BRIDGE_CENTRE_MM = np.array([0.0, 2.0, -1.0])
BRIDGE_SEMI_AXES_MM = np.array([np.inf, 9.0, 4.0])
ROUNDING_MM = 0.8
"""About the radius of the rims of the fissure."""
DENT_MM = 0.8
WAVES = np.array([[5, 2, 3], [-2, 6, 1], [3, -4, 5], [1, 5, -6], [6, -3, -2]])
"""Directions and numbers of the waves on the unit sphere whose sum makes the dents."""

SPACING_MM = 0.5
"""Of the grid that the surface is found on, which all meshes are made of."""
LARGEST = 3.0
"""Length of the edges inside, in those at the surface."""
FEWEST_TETS = 40_000
"""With fewer, elements would reach across the fissure."""
TETS_AT_1_MM, POWER = 7.86e4, 2.38
"""Elements with edges of 1 mm at the surface, and the power of its inverse by which they grow; found by trial."""


def brain_mesh(tets: int) -> TetrahedralMesh:
    """Return a mesh of about `tets` elements in RAS+ mm, its fissure at x = 0; ValueError for too few."""
    if tets < FEWEST_TETS:
        raise ValueError(f"elements of so coarse a mesh reach across the fissure: at least {FEWEST_TETS} are needed")
    # not where runs import this file: the meshers' libraries and those of the solver do not go together
    from gyriflow.mesh.tetrahedralisation import tetrahedralise

    edge = (TETS_AT_1_MM / tets) ** (1 / POWER)
    return tetrahedralise(
        brain_surface(),
        surface_edge_mm=edge,
        core_edge_mm=LARGEST * edge,
        envelope_mm=0.1,
        time_limit_s=1800,
        mesher="tetgen",
        order=1,
    )


@cache
def brain_surface() -> TriangleMesh:
    """Return the brain's surface, closed and outward, in RAS+ mm."""
    import igl

    axes = [np.arange(-half, half + SPACING_MM, SPACING_MM) for half in SEMI_AXES_MM + 2.25]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    places = grid.transpose(2, 1, 0, 3).reshape(-1, 3)
    vertices, faces, *_ = igl.marching_cubes(_level(places), places, *map(len, axes), 0.0)
    return TriangleMesh(vertices, faces)


def _level(points: Floats) -> Floats:
    """Return a function in mm of (n, 3) points that is negative inside the brain and close to the distance near it."""
    # deep inside, where directions change fast, by position
    direction = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 10.0)
    dents = DENT_MM * np.cos(direction @ WAVES.T + np.arange(len(WAVES))).mean(axis=1)
    outside = _ellipsoid(points, SEMI_AXES_MM) + dents
    bridge = _ellipsoid(points - BRIDGE_CENTRE_MM, BRIDGE_SEMI_AXES_MM)
    fissure = _smaller(FISSURE_MM / 2 - np.abs(points[:, 0]), bridge)
    return -_smaller(-outside, -fissure)


def _ellipsoid(points: Floats, semi_axes: Floats) -> Floats:
    """Return about the distance to an ellipsoid, negative inside: a function over its gradient's length."""
    points = np.abs(points) + 1e-9  # the gradient vanishes in the centre
    scaled = np.linalg.norm(points / semi_axes, axis=1)
    return scaled * (scaled - 1) / np.linalg.norm(points / semi_axes**2, axis=1)


def _smaller(a: Floats, b: Floats) -> Floats:
    """Return the minimum of both, rounded off where they meet."""
    return -ROUNDING_MM * np.logaddexp(-a / ROUNDING_MM, -b / ROUNDING_MM)
