"""Boxes with a clamped flat base and upright sides that slide in their planes, as slabs
with a cortex of 1 mm."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyriflow.folding.zones import Zones, zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, on_whole_faces
from gyriflow.geometry.triangles import Floats, TriangleMesh, face_normals
from gyriflow.settings import terms
from gyriflow.settings.folding import FoldingParameters, parameters_from

FLAT_TOL = 0.01
"""Tolerance of a flat base or side, as a fraction of the extent."""
RATE_PER_S = 1e-7
CORE_PA = 300.0


def slab_parameters(contrast: float, growth: float, **more: Any) -> FoldingParameters:
    """Return the parameters of a slab whose cortex, `contrast` times as stiff as the
    core, grows by `growth` a step."""
    values = {
        # no parameter depends on the week
        "start_week": 15.0,
        "end_week": 45.0,
        "output_weeks": [15.0, 45.0],
        "thickness_mm": 1.0,
        "shear_modulus_core_pa": CORE_PA,
        "shear_modulus_cortex_pa": CORE_PA * contrast,
        "growth_rate_per_s": RATE_PER_S,
        "step_s": growth / RATE_PER_S,
        "support": "free",
    }
    return parameters_from(values | more)


def graded_depths(
    depth_mm: float, cells: float, fine_mm: float, coarsening: float, max_mm: float
) -> Floats:
    """Return ascending depths of nodes, the last at least `depth_mm`: even to
    `fine_mm`, with `cells` to 1 mm.

    Below, heights of elements increase by `coarsening` to the power 1/`cells`, up to
    `max_mm`.
    """
    depths, height = [0.0], 1 / cells
    while depths[-1] < depth_mm:
        if depths[-1] >= fine_mm - 1e-9:
            height = min(height * coarsening ** (1 / cells), max_mm)
        depths.append(depths[-1] + height)
    return np.array(depths)


def box_zones(mesh: TetrahedralMesh, parameters: FoldingParameters) -> Zones:
    """Return the zones of a run with `support: free` on a box whose base is clamped and
    whose sides slide."""
    zones = zones_of_run(mesh, parameters)
    cuts = flat_cuts(mesh, zones.facets)
    return replace(
        zones,
        facet_zone=np.where(cuts == terms.FREE, zones.facet_zone, cuts),
        free=False,
    )


def flat_cuts(mesh: TetrahedralMesh, facets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return BASE for facets of a flat base, SIDE_X and SIDE_Y for those of upright
    sides, else FREE.

    A facet of a cut faces an end of the mesh and lies within a hundredth of the extent
    from it.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    near = FLAT_TOL * (high - low)
    normals = face_normals(TriangleMesh(mesh.vertices, facets))
    corners = mesh.vertices[facets]
    zone = np.full(len(facets), terms.FREE)
    for axis, name in ((0, terms.SIDE_X), (1, terms.SIDE_Y)):
        for end, sign in ((low, -1.0), (high, 1.0)):
            at_end = (np.abs(corners[:, :, axis] - end[axis]) <= near[axis]).all(axis=1)
            zone[
                on_whole_faces(at_end & (sign * normals[:, axis] > 0.7), mesh.order)
            ] = name
    at_base = (corners[:, :, 2] <= low[2] + near[2]).all(axis=1)
    zone[on_whole_faces(at_base & (normals[:, 2] < -0.7), mesh.order)] = terms.BASE
    return zone
