"""How a real brain deviates from what was expected of it at its age."""

import numpy as np

from ..geometry.diffusion import diffuse
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas, vertex_normals

SMOOTHING_MM = 3.0
"""Standard deviation that areas are smoothed with before they are compared."""


def deviation_maps(expected: TriangleMesh, real: TriangleMesh) -> dict[str, Floats]:
    """Return distance_mm and log_area at the (n,) vertices of the expected surface.

    The distance is along the normal, positive where the real brain lies outside; the other is the logarithm of the real
    over the expected area.

    Parameters
    ----------
    expected, real
        The expected surface in the pose of the real one, and the same moved onto that.
    """
    ratio = vertex_areas(real) / vertex_areas(expected)
    return {
        "distance_mm": ((real.vertices - expected.vertices) * vertex_normals(expected)).sum(axis=1),
        "log_area": np.log(diffuse(expected.vertices, expected.faces, ratio, SMOOTHING_MM)),
    }


def thickness_difference_mm(real: Floats, start: Floats, run_at_start: Floats, run: Floats) -> Floats:
    """Return by how much the (n,) real thickness exceeds that of the start brain, grown as the run has it grow."""
    return real - start * run / run_at_start
