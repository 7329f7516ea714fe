"""How far two surfaces are from each other, for example a simulated and a real brain of a week, once aligned."""

from ..geometry.alignment import fit_onto
from ..geometry.matching import nearest_on, surface_distance
from ..geometry.triangles import TriangleMesh, transformed, vertex_areas


def aligned_distance(a: TriangleMesh, b: TriangleMesh) -> dict[str, float]:
    """Return the distances in mm between two surfaces in RAS+ mm, `a` moved rigidly onto `b` first.

    symmetric_mean is the mean over both directions of the area-weighted mean distance of the vertices to the other
    surface, hausdorff95 the larger of the two 95 % quantiles.
    """
    moved = transformed(a, fit_onto(a, b))
    ways = [(nearest_on(one.vertices, other)[0], vertex_areas(one)) for one, other in ((moved, b), (b, moved))]
    return dict(zip(("symmetric_mean", "hausdorff95"), surface_distance(ways), strict=True))
