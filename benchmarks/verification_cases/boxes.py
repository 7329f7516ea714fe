"""Zones of boxes: a clamped flat base, and upright sides that slide in their planes."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gyriflow.folding.zones import Zones, zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, on_whole_faces
from gyriflow.geometry.triangles import TriangleMesh, face_normals
from gyriflow.settings import terms
from gyriflow.settings.folding import FoldingParameters

FLAT_TOL = 0.01
"""Tolerance of a flat base or side, as a fraction of the extent."""


def box_zones(mesh: TetrahedralMesh, parameters: FoldingParameters) -> Zones:
    """Return the zones of a run with `support: free` on a box whose base is clamped and whose sides slide."""
    zones = zones_of_run(mesh, parameters)
    cuts = flat_cuts(mesh, zones.facets)
    return replace(zones, facet_zone=np.where(cuts == terms.FREE, zones.facet_zone, cuts), free=False)


def flat_cuts(mesh: TetrahedralMesh, facets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return BASE for facets of a flat base, SIDE_X and SIDE_Y for those of upright sides, else FREE.

    A facet of a cut faces an end of the mesh and lies within a hundredth of the extent from it.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    near = FLAT_TOL * (high - low)
    normals = face_normals(TriangleMesh(mesh.vertices, facets))
    corners = mesh.vertices[facets]
    zone = np.full(len(facets), terms.FREE)
    for axis, name in ((0, terms.SIDE_X), (1, terms.SIDE_Y)):
        for end, sign in ((low, -1.0), (high, 1.0)):
            at_end = (np.abs(corners[:, :, axis] - end[axis]) <= near[axis]).all(axis=1)
            zone[on_whole_faces(at_end & (sign * normals[:, axis] > 0.7), mesh.order)] = name
    at_base = (corners[:, :, 2] <= low[2] + near[2]).all(axis=1)
    zone[on_whole_faces(at_base & (normals[:, 2] < -0.7), mesh.order)] = terms.BASE
    return zone
