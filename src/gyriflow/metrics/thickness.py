"""Cortical thickness of simulated brains, and values of a surface at its parts."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError, MeshError
from ..geometry.matching import layer_thickness
from ..geometry.tetrahedra import TetrahedralMesh, linear_pieces
from ..geometry.triangles import Floats, TriangleMesh
from ..settings.terms import CORTICAL_STEEPNESS

SAME_POINT_MM = 1e-3
"""Surfaces are written in single precision: vertices that are nearer are the same."""


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
    # takes half a second, which observed brains need not wait for
    import pyvista as pv

    grid = pv.UnstructuredGrid(
        {pv.CellType.TETRA: linear_pieces(start)}, np.asarray(positions, dtype=float)
    )
    grid.point_data["depth"] = depth
    # cut in its present shape: linear along the edges, so the points are those of the
    # start
    border = grid.contour([1.0], scalars="depth").triangulate()
    if not border.n_cells:
        deepest = f"points at most {float(np.max(depth)):.3g} cortical thicknesses deep"
        raise MeshError("the brain has no core", found=deepest, expected="more than 1")
    inner = TriangleMesh(
        np.asarray(border.points, dtype=float), border.faces.reshape(-1, 4)[:, 1:]
    )
    return layer_thickness(pial, inner)


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
