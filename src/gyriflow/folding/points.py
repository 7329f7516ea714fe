"""The points of elements at which energy, stiffness and growth are taken, and values at nodes brought there."""

from dataclasses import dataclass

import basix
import numpy as np

from ..geometry.jacobians import NODES, PARTS, SLOPES, shape_slopes, shape_values
from ..geometry.triangles import Floats

DEGREE_OF_ORDER = {1: 1, 2: 3}
"""Degree of the polynomials that are integrated exactly, by the order of the elements: 3 is the least with which a
uniform body of curved quadratic elements is in equilibrium under an affine displacement."""
CUBIC = ((0.32805700641014435, 0.13847614528101285), (0.10697718038088637, 0.11152385471898715))
"""The rule of degree 3 with 8 points: points (a, a, a, 1 − 3a) and the like, and the weight of each. Yu (1984, Comput.
Methods Appl. Mech. Eng. 43, 349-353). All weights are positive, unlike those of rules with fewer points, and no corner
is preferred, so that mirrored elements are integrated alike."""


@dataclass(frozen=True, eq=False)
class IntegrationPoints:
    """Points of the regular element: (q, 4) barycentric coordinates, and (q,) parts of its volume, of sum 1."""

    order: int
    places: Floats
    weights: Floats

    @classmethod
    def of_degree(cls, order: int, degree: int | None = None) -> "IntegrationPoints":
        """Return the points of a symmetric rule that is exact for polynomials of a degree, or of that of the order."""
        degree = degree or DEGREE_OF_ORDER[order]
        if degree == 3:
            places = np.concatenate([a + (1 - 4 * a) * np.eye(4) for a, _ in CUBIC])
            return cls(order, places, np.repeat([weight for _, weight in CUBIC], 4))
        kind = basix.QuadratureType.xiao_gimbutas if degree == 5 else basix.QuadratureType.default
        places, weights = basix.make_quadrature(basix.CellType.tetrahedron, degree, kind)
        return cls(order, np.column_stack([1 - places.sum(axis=1), places]), weights / weights.sum())

    @property
    def smooth(self) -> Floats:
        """The (q, 4) or (q, 10) matrix that gives values at the points of a function in the elements' own space."""
        return self.places if self.order == 1 else shape_values(self.places)

    @property
    def slopes(self) -> Floats:
        """The (q, 4, 3) or (q, 10, 3) gradients of the nodes' shape functions in the regular element, at the points."""
        if self.order == 1:
            return np.broadcast_to(SLOPES, (len(self.places), *SLOPES.shape))
        return shape_slopes(self.places)

    @property
    def bounded(self) -> Floats:
        """The same for a function that is linear in each of the eight parts between ten nodes.

        It stays between the values at the nodes also where these jump, which a quadratic one does not.
        """
        if self.order == 1:
            return self.places
        matrix = np.zeros((len(self.places), len(NODES)))
        for row, place in zip(matrix, self.places, strict=True):
            within = [place @ np.linalg.inv(NODES[list(part)]) for part in PARTS]
            part = int(np.argmax([coordinates.min() for coordinates in within]))
            row[list(PARTS[part])] = within[part]
        return matrix
