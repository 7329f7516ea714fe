"""The tetrahedral mesh, whole and cut open."""

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces
from ..geometry.triangles import Floats, TriangleMesh, submesh
from .panels import Panel, Row, panel_grid
from .scene import MAP, VIEWS
from .style import SIMULATED_SURFACE_COLOUR, styled

CORTEX_COLOUR, CORE_COLOUR = "#E8A33D", "#F3EBDD"
_CUTS = (("cut across", 1, "front"), ("cut along", 2, "top"))


@styled
def mesh_picture(mesh: TetrahedralMesh, in_cortex: NDArray[np.bool_], *, synthetic: bool = False) -> Figure:
    """Returns the mesh from the left, and cut open in a coronal and in an axial plane, with the edges of its elements.

    Elements are left out whole, those whose centroid lies before or above the plane through the middle.

    Parameters
    ----------
    mesh : in RAS+ mm, linear or quadratic
    in_cortex : (m,) whether an element belongs to the cortex
    """
    whole, colours = _open(mesh, np.ones(len(mesh.tets), dtype=bool), in_cortex)
    panels = [Panel(whole, colours, VIEWS["left"], material=MAP, edges=True)]
    centroid = mesh.vertices[mesh.corners].mean(axis=1)
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    for _, axis, view in _CUTS:
        part, colours = _open(mesh, centroid[:, axis] <= middle[axis], in_cortex)
        panels.append(Panel(part, colours, VIEWS[view], material=MAP, edges=True))
    legend = [
        Patch(color=colour, label=label)
        for label, colour in (
            ("pial surface", SIMULATED_SURFACE_COLOUR),
            ("elements of the cortex", CORTEX_COLOUR),
            ("elements of the core", CORE_COLOUR),
        )
    ]
    columns = ["left view", *(f"{name}, {view} view" for name, _, view in _CUTS)]
    return panel_grid(columns, [Row("", panels)], synthetic=synthetic, legend=legend)


def _open(mesh: TetrahedralMesh, keep: NDArray[np.bool_], in_cortex: NDArray[np.bool_]) -> tuple[TriangleMesh, Floats]:
    """Returns the boundary of some of the elements, and the (k, 3) colours of its faces."""
    faces, owners = boundary_faces(TetrahedralMesh(mesh.vertices, mesh.tets[keep]))
    count = len(mesh.vertices)
    own, pial = (
        np.sort(triangles, axis=1) @ np.array([count * count, count, 1])
        for triangles in (faces, boundary_faces(mesh)[0])
    )
    outside = np.isin(own, pial)
    inside = np.where(in_cortex[keep][owners][:, None], to_rgb(CORTEX_COLOUR), to_rgb(CORE_COLOUR))
    colours = np.where(outside[:, None], to_rgb(SIMULATED_SURFACE_COLOUR), inside)
    part, _ = submesh(TriangleMesh(mesh.vertices, faces), np.ones(len(faces), dtype=bool))
    return part, colours
