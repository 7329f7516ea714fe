"""Cortical thickness of simulated brains, and values of a surface at its parts."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError, MeshError
from ..geometry.matching import layer_thickness
from ..geometry.tetrahedra import TetrahedralMesh, linear_pieces
from ..geometry.triangles import Floats, Ints, TriangleMesh
from ..settings.terms import CORTICAL_STEEPNESS

SAME_POINT_MM = 1e-3
"""Surfaces are written in single precision: vertices that are nearer are the same."""

_CUT_EDGES = {
    1: [([0, 0, 0], [1, 2, 3])],
    2: [([0, 0, 1], [2, 3, 3]), ([0, 1, 1], [2, 3, 2])],
    3: [([0, 1, 2], [3, 3, 3])],
}
"""The edges of a tetrahedron that a level cuts in the corners of a triangle, or of two,
by the number of corners above, which come first."""


def depth_of_weight(weight: Floats) -> Floats:
    """Return the depth in cortical thicknesses, d/H, at which the cortical weight has
    (m,) values.

    The inverse of the folding model's w = 1/(1 + exp(10 (d/H − 1))), which is ½ at the
    border of cortex and core.
    """
    # beyond three thicknesses the weight is written as 0
    within = np.clip(weight, 1e-9, 1.0 - 1e-9)
    return 1.0 + np.log(1.0 / within - 1.0) / CORTICAL_STEEPNESS


def simulated_thickness(
    start: TetrahedralMesh,
    depth: Floats,
    positions: Floats,
    pial: TriangleMesh,
) -> Floats:
    """Return the (n,) cortical thickness in mm at the vertices of a simulated pial
    surface.

    It is that of the layer between the pial surface and the border of cortex and core
    (`geometry.matching.layer_thickness`). The border is carried with the tissue: the
    cortex of a later week is what was cortex at the start, however much it has grown or
    been pressed. `depth` (m,) of the mesh of the start is the distance to the pial
    surface over the cortical thickness, 1 at the border, as `depth_of_weight` gives it;
    `positions` (m, 3) are the present ones in mm. MeshError where no point is deeper
    than the cortex.
    """
    # cut in its present shape: linear along the edges, so the points are those of the
    # start
    inner = _level_surface(linear_pieces(start), positions, depth, 1.0)
    if not len(inner.faces):
        deepest = f"points at most {float(np.max(depth)):.3g} cortical thicknesses deep"
        raise MeshError("the brain has no core", found=deepest, expected="more than 1")
    return layer_thickness(pial, inner)


def _level_surface(
    tets: Ints,
    positions: Floats,
    values: Floats,
    level: float,
) -> TriangleMesh:
    """Return the surface on which (n,) values, linear in (m, 4) tetrahedra, have a
    level.

    Its triangles are those of the single tetrahedra, which share no vertices.
    """
    is_above = values > level
    # corners above first
    order = np.argsort(
        ~is_above[tets],
        axis=1,
        kind="stable",
    )
    tets = np.take_along_axis(tets, order, axis=1)
    n_above = is_above[tets].sum(axis=1)
    starts, ends = [], []
    for count, edges in _CUT_EDGES.items():
        cut = tets[n_above == count]
        for start, end in edges:
            starts.append(cut[:, start])
            ends.append(cut[:, end])
    first, second = np.concatenate(starts), np.concatenate(ends)
    share = (level - values[first]) / (values[second] - values[first])
    vertices = positions[first] + share[..., None] * (
        positions[second] - positions[first]
    )
    return TriangleMesh(
        vertices.reshape(-1, 3),
        np.arange(first.size).reshape(-1, 3),
    )


def at_part(
    values: NDArray,
    whole: TriangleMesh,
    part: TriangleMesh,
) -> NDArray:
    """Return the values (n, ...) at the vertices of a surface for the vertices of a
    part of it, such as a hemisphere.

    InputError where the part has a vertex that the whole has not.
    """
    distance, nearest = cKDTree(whole.vertices).query(part.vertices)
    if len(values) != len(whole.vertices) or distance.max() > SAME_POINT_MM:
        sizes = (
            f"{len(values)} values; vertices of the part up to {distance.max():.3g} mm"
            " from those of the whole"
        )
        raise InputError(
            "values do not belong to the surface",
            found=sizes,
            expected=f"{len(whole.vertices)} values",
        )
    return values[nearest]
