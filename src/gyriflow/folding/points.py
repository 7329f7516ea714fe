"""The points of elements at which energy, stiffness and growth are taken, and values at nodes brought there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.jacobians import NODES, PARTS, SLOPES, shape_slopes, shape_values

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class IntegrationPoints:
    """Points of the regular element, for elements of an order.

    Attributes
    ----------
    order : int
        Of the elements.
    places : (q, 4) float
        Barycentric coordinates.
    weights : (q,) float
        Their parts of the element's volume, of sum 1.
    """

    order: int
    places: Floats
    weights: Floats

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
