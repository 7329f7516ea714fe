"""Stiffness, growth and normals of a step at the integration points of elements, linear and quadratic ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..parameters.folding import FoldingParameters
from ..parameters.varying import Maps
from ..units import MM_PER_M
from .layers import PialSearch, layers_at, normals_between
from .points import IntegrationPoints

Floats = NDArray[np.float64]
AtPoints = tuple[Floats, Floats, Floats, Floats]
"""Shear modulus in Pa and growth increments, (c, q), and unit normals, (c, q, 3), at the integration points."""
NO_GROWTH = 1e-10
"""Growth increment of a step that counts as none, a hundred-millionth of what the cortex grows."""


@dataclass(frozen=True, eq=False)
class Layered:
    """What the layers of a step depend on besides its shape.

    Attributes
    ----------
    cells : (c, 4) or (c, 10) int
        Local nodes of the elements.
    points
        The integration points of an element.
    growth : (k,) float
        1 at local nodes where tissue grows, else 0.
    maps
        Parameters' maps at the local nodes.
    week, step_s
        The middle of the step, and its length.
    """

    cells: NDArray[np.integer]
    points: IntegrationPoints
    growth: Floats
    maps: Maps
    parameters: FoldingParameters
    week: float
    step_s: float


def linear_layers(given: Layered, search: PialSearch, nodes: Floats, reach: float) -> tuple[AtPoints, Floats]:
    """Returns layers that are worked out at the nodes, with one normal for each element, and the nodes' depths in m.

    Parameters
    ----------
    search
        The pial surface at the step's start.
    nodes : (k, 3) float
        Positions of the local nodes in m.
    reach
        Depth in m beyond which all is core.
    """
    cells, points = given.cells, given.points
    to_vertex, nearest = search.nearest(nodes)
    distance = search.distance(nodes, reach, to_vertex)
    layers = layers_at(distance * MM_PER_M, given.growth, given.parameters, given.maps, given.week, given.step_s)
    # the direction matters only where growth differs along and across it
    directed = np.abs(layers.dg - layers.dr)[cells].max(axis=1) > NO_GROWTH
    normals = np.tile([0.0, 0.0, 1.0], (len(cells), 1))
    normals[directed] = search.normals_from(nodes[cells[directed]].mean(axis=1), nearest[cells[directed]])
    mu, dg, dr = (values[cells] @ points.smooth.T for values in (layers.mu, layers.dg, layers.dr))
    return (mu, dg, dr, np.repeat(normals[:, None], len(points.weights), axis=1)), distance


def quadratic_layers(given: Layered, search: PialSearch, nodes: Floats, reach: float) -> tuple[AtPoints, Floats]:
    """Returns layers that are worked out at the integration points, and the nodes' depths in m.

    The depth is quadratic between the nodes, so that the cortical weight may fall from 1 to 0 within an element. What
    jumps between nodes, growth and maps, is linear between them. Parameters are as of `linear_layers`.
    """
    cells, points = given.cells, given.points
    to_pial, at_nodes = search.distance_and_normals(nodes, reach)
    distance = np.maximum(to_pial[cells] @ points.smooth.T, 0.0) * MM_PER_M
    growth = given.growth[cells] @ points.bounded.T
    maps = {name: values[cells] @ points.bounded.T for name, values in given.maps.items()}
    layers = layers_at(distance, growth, given.parameters, maps, given.week, given.step_s)
    directed = np.abs(layers.dg - layers.dr).max(axis=1) > NO_GROWTH
    normals = np.tile([0.0, 0.0, 1.0], (*distance.shape, 1))
    normals[directed] = normals_between(at_nodes[cells[directed]], points.smooth, points.bounded)
    return (layers.mu, layers.dg, layers.dr, normals), to_pial
