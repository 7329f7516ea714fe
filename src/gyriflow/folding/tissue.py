"""The tissue of a step: the depth of a rank's elements, where they grow, and the
normals of the pial surface there."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from ..geometry.jacobians import chunks
from ..geometry.triangles import Floats, Indices, Ints, Mask
from ..settings.folding import FoldingParameters
from ..settings.varying import Maps, value_at
from ..units import M_PER_MM, MM_PER_M
from .layers import WEIGHT_REACH, PialSearch, cortical_weight
from .points import IntegrationPoints
from .zones import Zones


@dataclass(frozen=True, eq=False)
class Elements:
    """A rank's elements: their local nodes `cells` (c, 4) or (c, 10), and the mesh's
    `vertices` (k,) that these are.

    All elements have the same integration `points`.
    """

    cells: Indices
    vertices: Indices
    points: IntegrationPoints


@dataclass(frozen=True, eq=False)
class Layers:
    """Depth, nearest places of the pial surface and cortical weight of a rank's
    tissue, as in `Tissue`."""

    pial: PialSearch
    depth: Floats
    nearest: NDArray
    weight: Floats


def _layers_of(
    elements: Elements,
    positions: Floats,
    facets: Ints,
    thickness_mm: Floats | float,
    reach: float,
) -> Layers:
    """Return the layers at (n, 3) positions of all vertices in m below the pial
    `facets`; depths in quadratic elements are exact up to `reach`, in m."""
    pial = PialSearch(positions, facets)
    nodes = positions[elements.vertices]
    nearest: NDArray
    if elements.points.order == 1:
        depth, nearest = pial.nearest(nodes)
        value_depth = depth
    else:
        depth, nearest = pial.distance_and_normals(nodes, reach)
        interpolation = elements.points.interpolation
        value_depth = np.maximum(
            depth[elements.cells] @ interpolation.T,
            0.0,
        )
    weight = cortical_weight(value_depth * MM_PER_M, thickness_mm)
    return Layers(pial, depth, nearest, weight)


@dataclass(frozen=True, eq=False)
class Tissue:
    """The tissue of a rank's elements in a step.

    The cortical `weight`, `growing` (1, else 0) and the parameters' `maps` are values
    at the nodes (k,) of linear elements, and at the integration points (c, q) of
    quadratic ones, since the cortical weight may fall from 1 to 0 within a quadratic
    element. There depth is interpolated by the shape functions, and growth and maps,
    which may jump between nodes, linearly.

    `depth` (k,) is the distance in m of the nodes, at `nodes` (k, 3), to the pial
    surface. `nearest` are the pial vertices (k,) nearest to the nodes of linear
    elements, or the pial normals (k, 3) there for quadratic ones. These and `weight`
    are computed when they are first used: growth towards shapes does not use them.
    """

    elements: Elements
    nodes: Floats
    growing: Floats
    maps: Maps
    find_layers: Callable[[], Layers]

    @classmethod
    def of(
        cls,
        elements: Elements,
        positions: Floats,
        zones: Zones,
        maps: Maps,
        p: FoldingParameters,
        week: float,
    ) -> "Tissue":
        """Return the tissue at (n, 3) positions of all vertices in m, with the cortical
        thickness of a week.

        Maps are (n,) at all vertices.
        """
        points = elements.points
        cells = elements.cells
        # the maximum over the whole mesh, so that all ranks search equally far
        thickest_mm = float(np.max(value_at(p.thickness_mm, week, maps)))
        reach = WEIGHT_REACH * thickest_mm * M_PER_MM
        growing = zones.growing[elements.vertices]
        maps = {name: maps[name][elements.vertices] for name in p.varying_maps}
        if points.order == 2:
            linear = points.piecewise_linear.T
            growing = growing[cells] @ linear
            maps = {name: values[cells] @ linear for name, values in maps.items()}
        thickness_mm = value_at(p.thickness_mm, week, maps)
        find_layers = partial(
            _layers_of, elements, positions, zones.cortex_facets, thickness_mm, reach
        )
        return cls(
            elements,
            positions[elements.vertices],
            growing,
            maps,
            find_layers,
        )

    @classmethod
    def at_vertices(
        cls,
        positions_mm: Floats,
        zones: Zones,
        distance_mm: Floats,
        weight: Floats,
        maps: Maps,
    ) -> "Tissue":
        """Return the tissue at the (n, 3) positions of all vertices, each an element
        of its own with one point, for maps of growth.

        Distance to the pial surface, cortical weight and maps are (n,).
        """
        positions = positions_mm * M_PER_MM
        pial = PialSearch(positions, zones.cortex_facets)
        vertices = np.arange(len(positions))
        points = IntegrationPoints(
            1,
            np.ones((1, 1)),
            np.ones(1),
        )
        elements = Elements(vertices[:, None], vertices, points)
        _, nearest = pial.nearest(positions)
        layers = Layers(pial, distance_mm * M_PER_MM, nearest, weight)
        return cls(elements, positions, zones.growing, maps, lambda: layers)

    @cached_property
    def layers(self) -> Layers:
        """Where the tissue is in cortex and core."""
        return self.find_layers()

    @property
    def weight(self) -> Floats:
        return self.layers.weight

    @property
    def places_mm(self) -> Floats:
        """The positions (k, 3) or (c, q, 3) in mm that `weight` and the others are
        at, for growth that depends on place (docs/tutorial-folding.md)."""
        nodes_mm = self.nodes * MM_PER_M
        if self.elements.points.order == 1:
            return nodes_mm
        interpolation = self.elements.points.interpolation
        return np.asarray(interpolation @ nodes_mm[self.elements.cells])

    def at_points(self, values: Floats) -> Floats:
        """Return (..., c, q) values at the integration points from values like
        `weight`."""
        points = self.elements.points
        if points.order == 2:
            return values
        return values[..., self.elements.cells] @ points.interpolation.T

    def normals(self, needed: Mask) -> tuple[Mask, Floats]:
        """Return the mask (c,) of elements that need a normal at a node or point, and
        their unit normals (e, q, 3).

        A linear element has one normal, that of the pial vertex nearest to its centre.
        """
        cells = self.elements.cells
        points = self.elements.points
        if points.order == 2:
            mask = needed.any(axis=1)
            at_nodes = self.layers.nearest[cells[mask]]
            return mask, _interpolated_normals(at_nodes, points)
        mask = needed[cells].any(axis=1)
        nodes = cells[mask]
        normals = np.empty((len(nodes), 3))
        for chunk in chunks(len(nodes)):
            corners = nodes[chunk]
            # faster than places in brackets, and than a mean over another axis
            centres = np.take(self.nodes, corners.T, axis=0).mean(axis=0)
            candidates = np.take(self.layers.nearest, corners)
            normals[chunk] = self.layers.pial.normals_from(centres, candidates)
        return mask, np.repeat(
            normals[:, None],
            len(points.weights),
            axis=1,
        )


def _interpolated_normals(normals: Floats, points: IntegrationPoints) -> Floats:
    """Return the (c, q, 3) unit normals at the points of elements from those (c, k, 3)
    at their nodes.

    The sign of a normal does not count, since walls that face each other have opposite
    ones: all are turned to the side of the first before they are interpolated. If the
    result nearly vanishes, the nearest node's normal is taken.
    """
    first = normals[:, 0]
    # c: element, k: node, i: axis
    cosines = np.einsum("cki,ci->ck", normals, first)
    signs = np.where(cosines < 0, -1.0, 1.0)
    turned = normals * signs[:, :, None]
    mean = np.matmul(points.interpolation, turned)
    length = np.linalg.norm(
        mean,
        axis=2,
        keepdims=True,
    )
    nearest_node = points.piecewise_linear.argmax(axis=1)
    unit_mean = mean / np.maximum(length, 0.1)
    return np.where(
        length > 0.1,
        unit_mean,
        turned[:, nearest_node],
    )
