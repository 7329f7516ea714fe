"""Rigid registration of hemispheres' outlines, from a start or from none, with a measure of confidence."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gyriflow.geometry.triangles import unit
from gyriflow.surface.outlines import Outline

Floats = NDArray[np.float64]

# distances beyond these (in sizes of the hemisphere) hardly count: coarse for the start, finer for the end
COARSE, FINE = 0.3, 0.12
# how much a difference of normals counts beside a distance when nearest places are looked for
NORMALS = 0.2
REFINED = 8
# poses nearer to each other than this are one
DISTINCT_DEG = 40.0
FURTHEST = 0.3


@dataclass(frozen=True, eq=False)
class Fit:
    """A rigid motion of one outline onto another, in sizes of the hemisphere: p → rotation p + shift.

    Attributes
    ----------
    rotation, shift : (3, 3) and (3,) float
    residual : float
        Root mean square distance between the outlines, from each to the other.
    """

    rotation: Floats
    shift: Floats
    residual: float


class Target:
    """An outline with its search trees, on which others are registered."""

    def __init__(self, outline: Outline) -> None:
        self.outline = outline
        self.places = cKDTree(outline.points)
        self.oriented = cKDTree(np.hstack([outline.points, NORMALS * outline.normals]))


def registered(source: Outline, target: Target, start: Floats, shift: Floats | None = None) -> Fit:
    """Returns the fit of `source` on `target` from a (3, 3) rotation near it."""
    rotation, moved = _descended(source, target, start, FINE, 40, 1, shift)
    return Fit(rotation, moved, _residual(source, target, rotation, moved))


def found(source: Outline, target: Target) -> tuple[Fit, float]:
    """Returns the best fit of `source` on `target` from all starts, and how many times worse the next best one is.

    The starts are the 24 rotations of the cube, after one at random. The next best is more than 40° away.
    """
    random = Rotation.random(random_state=1).as_matrix()
    coarse = []
    for cube in Rotation.create_group("O").as_matrix():
        rotation, shift = _descended(source, target, cube @ random, COARSE, 12, 4)
        coarse.append(Fit(rotation, shift, _residual(source, target, rotation, shift)))
    coarse.sort(key=lambda fit: fit.residual)
    fits = [registered(source, target, fit.rotation, fit.shift) for fit in coarse[:REFINED]] + coarse[REFINED:]
    fits.sort(key=lambda fit: fit.residual)
    others = [fit.residual for fit in fits if angle_deg(fit.rotation @ fits[0].rotation.T) > DISTINCT_DEG]
    return fits[0], min(others, default=np.inf) / fits[0].residual


def angle_deg(rotation: Floats) -> float:
    """Returns the angle of a (3, 3) rotation in degrees."""
    return float(np.degrees(Rotation.from_matrix(rotation).magnitude()))


def _descended(
    source: Outline,
    target: Target,
    rotation: Floats,
    scale: float,
    rounds: int,
    every: int,
    shift: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Returns rotation and shift after rounds of symmetric point-to-plane steps with Geman-McClure weights.

    Rusinkiewicz 2019 (doi 10.1145/3306346.3323037) for the step.
    """
    points, normals = (values[source.sample[::every]] for values in (source.points, source.normals))
    shift = np.zeros(3) if shift is None else shift
    for _ in range(rounds):
        at, facing = points @ rotation.T + shift, normals @ rotation.T
        _, nearest = target.oriented.query(np.hstack([at, NORMALS * facing]))
        theirs = target.outline.normals[nearest]
        plane = unit(theirs + facing)
        ahead = np.einsum("ij,ij->i", target.outline.points[nearest] - at, plane)
        weights = (np.einsum("ij,ij->i", theirs, facing) > 0.5) / (1.0 + (ahead / scale) ** 2) ** 2
        rows = np.hstack([np.cross(at, plane), plane])
        step = np.linalg.solve((rows * weights[:, None]).T @ rows + 1e-9 * np.eye(6), rows.T @ (weights * ahead))
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        rotation, shift = turn @ rotation, turn @ shift + step[3:]
        if np.linalg.norm(step) < 1e-4:
            break
    return rotation, shift


def _residual(source: Outline, target: Target, rotation: Floats, shift: Floats) -> float:
    there, _ = target.places.query(source.points[source.sample] @ rotation.T + shift)
    back, _ = cKDTree(source.points).query((target.outline.points[target.outline.sample] - shift) @ rotation)
    squares = [np.mean(np.minimum(distance, FURTHEST) ** 2) for distance in (there, back)]
    return float(np.sqrt(np.mean(squares)))
