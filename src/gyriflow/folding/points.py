"""The integration points of elements, and interpolation from nodes to them."""

from dataclasses import dataclass

import numpy as np

from ..geometry.jacobians import NODES, PARTS, SLOPES, shape_slopes, shape_values
from ..geometry.triangles import Floats

CUBIC = (
    (0.32805700641014435, 0.13847614528101285),
    (0.10697718038088637, 0.11152385471898715),
)
"""The rule of degree 3 with 8 points: points (a, a, a, 1 − 3a) and their permutations,
and the weight of each. Yu (1984, Comput. Methods Appl. Mech. Eng. 43, 349-353). All
weights are positive, unlike those of rules with fewer points, and no corner is
preferred, so that mirrored elements are integrated in the same way. 3 is the lowest
degree with which a uniform body of curved quadratic elements is in equilibrium under an
affine displacement."""


@dataclass(frozen=True, eq=False)
class IntegrationPoints:
    """Integration points of elements of an `order`: (q, 4) `barycentric` coordinates,
    and (q,) weights of sum 1."""

    order: int
    barycentric: Floats
    weights: Floats

    @classmethod
    def for_order(cls, order: int) -> "IntegrationPoints":
        """Return a symmetric rule: the centre of linear elements, or the `CUBIC` rule
        for quadratic ones."""
        if order == 1:
            centre = np.full((1, 4), 0.25)
            return cls(order, centre, np.ones(1))
        points = []
        weights = []
        for a, weight in CUBIC:
            points.append(a + (1 - 4 * a) * np.eye(4))
            weights.append(np.full(4, weight))
        return cls(
            order,
            np.concatenate(points),
            np.concatenate(weights),
        )

    @property
    def interpolation(self) -> Floats:
        """The (q, 4) or (q, 10) matrix of shape functions: from values at the nodes to
        values at the points."""
        return self.barycentric if self.order == 1 else shape_values(self.barycentric)

    @property
    def gradients(self) -> Floats:
        """The (q, 4, 3) or (q, 10, 3) gradients of the shape functions in the reference
        element, at the points."""
        if self.order == 1:
            return np.broadcast_to(
                SLOPES,
                (len(self.barycentric), *SLOPES.shape),
            )
        return shape_slopes(self.barycentric)

    @property
    def piecewise_linear(self) -> Floats:
        """The (q, 4) or (q, 10) matrix of interpolation that is linear in each of the
        eight parts between ten nodes.

        Its values stay between those at the nodes where these jump; a quadratic
        interpolation overshoots.
        """
        if self.order == 1:
            return self.barycentric
        matrix = np.zeros((len(self.barycentric), len(NODES)))
        for row, point in zip(
            matrix,
            self.barycentric,
            strict=True,
        ):
            best = -np.inf
            for part in PARTS:
                nodes = list(part)
                weights = point @ np.linalg.inv(NODES[nodes])
                # the point is in the part in which no weight is negative
                if weights.min() > best:
                    best = weights.min()
                    nodes_around = nodes
                    weights_around = weights
            row[nodes_around] = weights_around
        return matrix
