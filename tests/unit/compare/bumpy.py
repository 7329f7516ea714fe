"""Spheres with bumps whose curvature is known where it is needed."""

from functools import cache

import numpy as np
from shapes import sphere

from gyriflow.compare.shapes import PreparedSurface
from gyriflow.geometry.triangles import Floats, TriangleMesh
from gyriflow.metrics.curvature import curvature

RADIUS = 12.0
"""Small, as comparisons remesh them to a millimetre."""


def field(
    directions: Floats, seed: int, sharpness: float = 12.0, bumps: int = 40
) -> Floats:
    """Return the (n,) sum of bumps and dents at places that a seed gives, for unit
    vectors."""
    generator = np.random.default_rng(seed)
    places = generator.normal(size=(bumps, 3))
    places /= np.linalg.norm(places, axis=1)[:, None]
    return np.exp(sharpness * (directions @ places.T - 1)) @ generator.choice(
        [-1.0, 1.0], bumps
    )


@cache
def bumpy(
    seed: int, height: float = 0.9, sharpness: float = 12.0, subdivisions: int = 4
) -> TriangleMesh:
    """Return a sphere with bumps and dents of a height in mm."""
    ball = sphere(1.0, subdivisions)
    radius = RADIUS + height * field(ball.vertices, seed, sharpness)
    return TriangleMesh(ball.vertices * radius[:, None], ball.faces)


def shaped(mesh: TriangleMesh, pattern: Floats | None = None) -> PreparedSurface:
    """Return a shape with its curvature, or with a pattern in its place."""
    if pattern is None:
        bend = curvature(mesh, radius_mm=3.0)
        return PreparedSurface(mesh, bend.mean, bend.shape_index)
    return PreparedSurface(mesh, 0.1 * pattern, np.tanh(pattern))


REAL, SMOOTH = bumpy(1), bumpy(1, height=0.0)
PREPARED = shaped(REAL)
