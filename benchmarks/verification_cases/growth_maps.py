"""Maps of growth of a body that follows its path exactly, against the growth of the
continuous shape.

A box grows by 8 % in each direction while three oblique waves stretch and shear it.
Growth of an element is the stretch of its own way (docs/model.md), so the map has what
the program would show of a run without any error of the solver, and what it lacks is
resolution.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyriflow.folding.growth import GrowthInputs
from gyriflow.folding.output import growth_components, log_growth_at_vertices
from gyriflow.folding.points import IntegrationPoints
from gyriflow.folding.stretches import deformation_gradients, log_stretch, packed
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    grid,
    linear_pieces,
    quadratic,
)
from gyriflow.geometry.triangles import TriangleMesh, vertex_normals
from gyriflow.settings.folding import parameters_from

Floats = NDArray[np.float64]

STRETCH = 1.08
LENGTHS = np.array([5.0, 6.0, 7.0]) / 6.0
"""Lengths of the waves, as multiples of their mean."""
DIRECTIONS = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]]) / np.sqrt(2)
"""Directions of the waves: along and across the axis that each of them moves."""
HEIGHT = 0.016
"""Height of the waves over their mean length: 0.6 mm for 38 mm."""
TENSOR = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
"""How often the entries of a packed symmetric tensor count in its norm."""


@dataclass(frozen=True)
class WavyBox:
    """A box of `side_mm` with `nodes` intervals along a side, and waves of `wave_mm` on
    average."""

    side_mm: float
    wave_mm: float
    nodes: int
    order: int = 1

    @property
    def per_wave(self) -> float:
        """The distances of nodes in a wave: the elements in it, if they are linear."""
        return self.wave_mm * self.nodes / self.side_mm

    def mesh(self) -> TetrahedralMesh:
        """Return the mesh of the box around the origin."""
        axis = np.linspace(
            -self.side_mm / 2, self.side_mm / 2, self.nodes // self.order + 1
        )
        mesh = grid([axis, axis, axis])
        return quadratic(mesh) if self.order == 2 else mesh

    def shape(self, vertices: Floats) -> tuple[Floats, Floats]:
        """Return the (n, 3) places of vertices after growth, and the (n, 3, 3)
        gradients of the deformation there."""
        wavenumbers = 2 * np.pi / (self.wave_mm * LENGTHS[:, None]) * DIRECTIONS
        height = HEIGHT * self.wave_mm
        # the first wave moves points along x, the second along y, the third along z
        phases = vertices @ wavenumbers.T
        places = STRETCH * vertices + height * np.sin(phases)
        gradients = (
            STRETCH * np.eye(3) + height * np.cos(phases)[:, :, None] * wavenumbers
        )
        return places, gradients


def errors_of_map(box: WavyBox) -> dict[str, float]:
    """Return the errors of a map of growth, as fractions of the part of growth that
    differs from place to place.

    `tensor` is that of ln V at all vertices (L2), `area` that of the growth of area at
    the vertices of the surface, as figures show it, and `slope` what is left there of
    differences in growth (regression on the exact growth).
    """
    mesh = box.mesh()
    places, gradients = box.shape(mesh.vertices)
    points = IntegrationPoints.for_order(box.order)
    in_elements = deformation_gradients(
        mesh.vertices, places, mesh.tets, points.gradients
    )
    growth = np.einsum("q,cqij->cij", points.weights, in_elements)
    run = {
        "start_week": 21.0,
        "end_week": 22.0,
        "output_weeks": [21.0, 22.0],
        "fissure_x_mm": 0.0,
    }
    inputs = GrowthInputs(mesh, zones_of_run(mesh, parameters_from(run)), {})
    found = log_growth_at_vertices(places, inputs, growth)
    exact = packed(log_stretch(gradients, left=True))
    sizes = vertex_sizes(places, linear_pieces(mesh))[:, None] * TENSOR
    differences = exact - np.average(exact, axis=0, weights=sizes[:, 0])
    tensor_error = np.sqrt(
        (sizes * (found - exact) ** 2).sum() / (sizes * differences**2).sum()
    )

    found_area, exact_area = area_growth(box, mesh, places, gradients, found, exact)
    area_error = np.sqrt(np.mean((found_area - exact_area) ** 2)) / exact_area.std()
    slope = np.polyfit(exact_area, found_area, 1)[0]
    return {
        "per_wave": box.per_wave,
        "tensor": float(tensor_error),
        "area": float(area_error),
        "slope": float(slope),
    }


def area_growth(
    box: WavyBox,
    mesh: TetrahedralMesh,
    places: Floats,
    gradients: Floats,
    found: Floats,
    exact: Floats,
) -> tuple[Floats, Floats]:
    """Return the growth of area at the vertices inside the faces of the box, by the map
    and of the continuous shape."""
    on_side = np.abs(mesh.vertices) > 0.4999 * box.side_mm
    in_face = on_side.sum(axis=1) == 1
    surface, used = boundary_surface(mesh)
    mesh_normals = np.zeros_like(places)
    mesh_normals[used] = vertex_normals(TriangleMesh(places[used], surface.faces))
    # Nanson's formula
    before = np.where(on_side, np.sign(mesh.vertices), 0.0)
    normals = np.einsum("nji,nj->ni", np.linalg.inv(gradients), before)[in_face]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    growth = []
    for logs, directions in (
        (found[in_face], mesh_normals[in_face]),
        (exact[in_face], normals),
    ):
        tangential = growth_components(logs, directions)["tangential_growth_per_step"]
        growth.append(np.expm1(2 * tangential))
    return growth[0], growth[1]
