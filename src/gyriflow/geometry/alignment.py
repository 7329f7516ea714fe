"""Rigid alignment of shapes from a start or from all sides, by steps towards planes."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from .triangles import Floats

CUBE_ROTATIONS: Floats = np.array(sorted(Rotation.create_group("O").as_matrix(), key=lambda turn: -np.trace(turn)))
"""The 24 rotations of a cube, none first: no rotation is more than 63 degrees from all of them."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A rigid motion of one shape onto another, p → rotation p + shift.

    Attributes
    ----------
    rotation, shift : (3, 3) and (3,) float
    residual : float
        Distance between the shapes that is left, in the unit of the shapes.
    """

    rotation: Floats
    shift: Floats
    residual: float


def angle_deg(rotation: Floats) -> float:
    """Returns the angle of a (3, 3) rotation in degrees."""
    return float(np.degrees(Rotation.from_matrix(rotation).magnitude()))


def step_towards_planes(
    points: Floats, normals: Floats, ahead: Floats, weights: Floats | None = None
) -> tuple[Floats, Floats]:
    """Returns the rotation and shift by which points come nearest to planes in the least-squares sense.

    One step of the point-to-plane iteration (Chen and Medioni 1992): a turn w and a shift t move a point p by
    w × (p − c) + t. Directions in which nothing pulls, such as the turns of a sphere, stay.

    Parameters
    ----------
    points, normals : (n, 3) float
        Points, and the unit normals of the planes that they are to reach.
    ahead : (n,) float
        How far each plane is, along its normal.
    weights : (n,) float or None
        Of the squared distances.
    """
    centre = points.mean(axis=0)
    rows = np.hstack([np.cross(points - centre, normals), normals])
    size = np.ones(len(points)) if weights is None else np.sqrt(weights)
    turn, move = np.split(np.linalg.lstsq(rows * size[:, None], ahead * size, rcond=1e-6)[0], 2)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return rotation, centre + move - rotation @ centre


def fits_from_all_sides(
    starts: Iterable[Floats],
    roughly: Callable[[Floats], Fit],
    better: Callable[[Fit], Fit],
    candidates: int,
    apart_deg: float,
) -> list[Fit]:
    """Returns the fits that an alignment without a known start leads to, that from the first start first.

    An iteration finds the nearest pose that fits, which need not be the best. It is therefore begun `roughly` from
    each of the (3, 3) rotations `starts`; the best few of the poses that differ, and that from the first start, are
    made `better`, all alike, so that their residuals can be compared.

    Parameters
    ----------
    candidates
        How many poses are compared.
    apart_deg
        Rotations that differ by less are one pose.
    """
    rough = [roughly(start) for start in starts]
    apart: list[int] = []
    for i in map(int, np.argsort([fit.residual for fit in rough], kind="stable")):
        if all(angle_deg(rough[i].rotation @ rough[j].rotation.T) > apart_deg for j in apart):
            apart.append(i)
    return [better(rough[i]) for i in dict.fromkeys([0, *apart[:candidates]])]


def margin(fits: Iterable[Fit], chosen: Fit, apart_deg: float) -> float:
    """Returns how many times more the best fit of another pose leaves than the chosen one; infinity without any.

    Near 1 the shapes fit as well in another pose.
    """
    others = [fit.residual for fit in fits if angle_deg(fit.rotation @ chosen.rotation.T) > apart_deg]
    return float(min(others, default=np.inf) / chosen.residual)
