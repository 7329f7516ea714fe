"""The tissue of a step: the depth of a rank's elements, where they grow, and the normals of the pial surface there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import Floats
from ..settings.folding import FoldingParameters
from ..settings.varying import Maps, value_at
from ..units import M_PER_MM, MM_PER_M
from .layers import WEIGHT_REACH, PialSearch, cortical_weight
from .points import IntegrationPoints
from .zones import Zones


@dataclass(frozen=True, eq=False)
class Elements:
    """A rank's elements: their local nodes (c, 4) or (c, 10), the vertices of the mesh (k,) that these are, and points.

    The integration `points` are the same in all elements.
    """

    cells: NDArray[np.integer]
    vertices: NDArray[np.integer]
    points: IntegrationPoints


@dataclass(frozen=True, eq=False)
class Tissue:
    """The tissue of a rank's elements in a step.

    Its values are at the nodes of linear elements, (k,), but at the integration points of quadratic ones, (c, q), so
    that the cortical weight may fall from 1 to 0 within an element: the cortical `weight`, `growing` (1, else 0) and
    the parameters' `maps`. In quadratic elements depth is quadratic between the nodes; quantities that jump between
    nodes, growth and maps, are linear between them.

    `depth` (k,) is the distance of the nodes at `nodes` (k, 3) to the pial surface, in m. `nearest` are the pial
    vertices (k,) nearest to the nodes of linear elements, or the normals (k, 3) at the nodes of quadratic ones.
    """

    elements: Elements
    nodes: Floats
    depth: Floats
    pial: PialSearch
    nearest: NDArray
    weight: Floats
    growing: Floats
    maps: Maps

    @classmethod
    def of(
        cls, elements: Elements, positions: Floats, zones: Zones, maps: Maps, p: FoldingParameters, week: float
    ) -> "Tissue":
        """Return the tissue at (n, 3) positions of all vertices in m, with the cortical thickness of a week.

        Maps are (n,) at all vertices.
        """
        points, cells = elements.points, elements.cells
        pial, nodes = PialSearch(positions, zones.cortex_facets), positions[elements.vertices]
        # of the whole mesh, so that all ranks search equally far
        reach = WEIGHT_REACH * float(np.max(value_at(p.thickness_mm, week, maps))) * M_PER_MM
        growing = zones.growth[elements.vertices]
        maps = {name: maps[name][elements.vertices] for name in p.varying_maps}
        nearest: NDArray
        if points.order == 1:
            to_vertex, nearest = pial.tree.query(nodes)
            depth = pial.distance(nodes, reach, to_vertex)
            depth_of_values = depth
        else:
            depth, nearest = pial.distance_and_normals(nodes, reach)
            growing = growing[cells] @ points.bounded.T
            maps = {name: values[cells] @ points.bounded.T for name, values in maps.items()}
            depth_of_values = np.maximum(depth[cells] @ points.smooth.T, 0.0)
        weight = cortical_weight(depth_of_values * MM_PER_M, value_at(p.thickness_mm, week, maps))
        return cls(elements, nodes, depth, pial, nearest, weight, growing, maps)

    def at_points(self, values: Floats) -> Floats:
        """Return (..., c, q) values at the integration points from those at the tissue's own places."""
        points = self.elements.points
        return values[..., self.elements.cells] @ points.smooth.T if points.order == 1 else values

    def interpolate(self, values: Floats, chunk: slice) -> Floats:
        """Return (..., c, q) values at the points of some elements, linear between those (..., n) of all vertices."""
        elements, points = self.elements, self.elements.points
        linear = points.smooth if points.order == 1 else points.bounded
        return np.asarray(values[..., elements.vertices[elements.cells[chunk]]] @ linear.T)

    def normals(self, needed: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], Floats]:
        """Return which elements (c,) have a place where a normal is `needed`, and their (w, q, 3) unit normals.

        Linear elements have one normal each, that of the pial vertex nearest to their centres.
        """
        cells, points = self.elements.cells, self.elements.points
        if points.order == 1:
            chosen = np.asarray(needed[cells].any(axis=1))
            normals = self.pial.normals_from(self.nodes[cells[chosen]].mean(axis=1), self.nearest[cells[chosen]])
            return chosen, np.repeat(normals[:, None], len(points.weights), axis=1)
        chosen = np.asarray(needed.any(axis=1))
        return chosen, normals_between(self.nearest[cells[chosen]], points.smooth, points.bounded)


def normals_between(normals: Floats, smooth: Floats, bounded: Floats) -> Floats:
    """Return the (c, q, 3) unit normals at points inside elements from those (c, k, 3) at their nodes.

    Only the direction of a normal counts, not its sense: walls that face each other have the same. So normals are
    turned to the side of the first before their mean is taken; where that all but vanishes, the nearest node's stands
    for it. `smooth` and `bounded` are weights of the nodes at the points, see `IntegrationPoints`.
    """
    turned = normals * np.where(np.einsum("cki,ci->ck", normals, normals[:, 0]) < 0, -1.0, 1.0)[:, :, None]
    mean = np.matmul(smooth, turned)
    length = np.linalg.norm(mean, axis=2, keepdims=True)
    heaviest = turned[:, bounded.argmax(axis=1)]
    return np.where(length > 0.1, mean / np.maximum(length, 0.1), heaviest)
