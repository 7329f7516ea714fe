"""Rigid registration of hemispheres' outlines, from a start or from none, with a measure of confidence."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..geometry.alignment import (
    CUBE_ROTATIONS,
    Fit,
    fits_from_all_sides,
    margin,
    step_towards_planes,
)
from ..geometry.triangles import unit
from .outlines import Outline

Floats = NDArray[np.float64]

# distances beyond these (in sizes of the hemisphere) hardly count: coarse for the start, finer for the end
COARSE, FINE = 0.3, 0.12
# how much a difference of normals counts beside a distance when nearest places are looked for
NORMALS = 0.2
REFINED = 8
# poses nearer to each other than this are one
DISTINCT_DEG = 40.0
FURTHEST = 0.3
# smooth deformations: how much their mean square counts beside that of the distances left, and the rounds
STIFFNESS, BENDS = 0.03, 20


class Target:
    """An outline with its search trees, on which others are registered."""

    def __init__(self, outline: Outline) -> None:
        self.outline = outline
        self.places = cKDTree(outline.points)
        self.oriented = cKDTree(np.hstack([outline.points, NORMALS * outline.normals]))


def register(source: Outline, target: Target, start: Floats, shift: Floats | None = None) -> Fit:
    """Returns the fit of `source` on `target` from a (3, 3) rotation near it."""
    rotation, moved = _descend(source, target, start, FINE, 40, 1, shift)
    return Fit(rotation, moved, _residual(source, target, rotation, moved))


def register_from_all_sides(source: Outline, target: Target) -> tuple[Fit, float]:
    """Returns the best fit of `source` on `target` from all sides, and how many times worse the next best one is.

    The starts are the 24 rotations of the cube, after one at random. The next best is more than 40° away.
    """
    random = Rotation.random(random_state=1).as_matrix()

    def roughly(start: Floats) -> Fit:
        rotation, shift = _descend(source, target, start, COARSE, 12, 4)
        return Fit(rotation, shift, _residual(source, target, rotation, shift))

    def better(fit: Fit) -> Fit:
        return register(source, target, fit.rotation, fit.shift)

    fits = fits_from_all_sides(CUBE_ROTATIONS @ random, roughly, better, REFINED, DISTINCT_DEG)
    best = min(fits, key=lambda fit: fit.residual)
    return best, margin(fits, best, DISTINCT_DEG)


def register_deformed(one: Target, other: Target, start: Floats) -> Fit:
    """Returns the fit of `one` on `other`, two shapes that are alike but for a smooth deformation.

    It is the rigid part of a quadratic deformation, which leaves the bends out of it where nearest places alone would
    turn a shape to make up for them. Both directions count alike. The residual is that of the rigid fit.
    """
    there = register(one.outline, other, start)
    back = Fit(there.rotation.T, -there.rotation.T @ there.shift, there.residual)
    ahead, behind = _rigid_part_of_bending(one.outline, other, there), _rigid_part_of_bending(other.outline, one, back)
    mean = Rotation.from_matrix([ahead.rotation, behind.rotation.T]).mean().as_matrix()
    return Fit(mean, 0.5 * (ahead.shift - behind.rotation.T @ behind.shift), there.residual)


def _rigid_part_of_bending(source: Outline, target: Target, fit: Fit) -> Fit:
    """Returns the rigid part of the quadratic deformation that takes on from a fit."""
    points = source.points[source.sample]
    start, facing = points @ fit.rotation.T + fit.shift, source.normals[source.sample] @ fit.rotation.T
    columns = np.hstack([np.ones((len(start), 1)), start])
    products = [columns[:, i] * columns[:, j] for i in range(4) for j in range(i, 4)]
    # orthonormal, so that the coefficients' squares add up to the mean square of the deformation
    basis = np.linalg.qr(np.stack(products, axis=1))[0] * np.sqrt(len(start))
    bends = np.zeros((basis.shape[1], 3))
    for _ in range(BENDS):
        at = start + basis @ bends
        ahead, plane, weights = _nearest_planes(at, facing, target, FINE)
        rows = (basis[:, :, None] * plane[:, None, :]).reshape(len(basis), -1)
        stiff = STIFFNESS * len(start)
        step = np.linalg.solve(
            (rows * weights[:, None]).T @ rows + stiff * np.eye(bends.size),
            rows.T @ (weights * ahead) - stiff * bends.ravel(),
        )
        bends = bends + step.reshape(bends.shape)
        if np.abs(step).max() < 1e-4:
            break
    at = start + basis @ bends
    turn, _ = Rotation.align_vectors(at - at.mean(axis=0), points - points.mean(axis=0))
    rotation = turn.as_matrix()
    return Fit(rotation, at.mean(axis=0) - rotation @ points.mean(axis=0), fit.residual)


def _nearest_planes(at: Floats, facing: Floats, target: Target, scale: float) -> tuple[Floats, Floats, Floats]:
    """Returns how far nearest places are, along which directions, and their Geman-McClure weights.

    The directions are those of the symmetric point-to-plane distance, Rusinkiewicz 2019 (doi 10.1145/3306346.3323037).
    """
    _, nearest = target.oriented.query(np.hstack([at, NORMALS * facing]))
    theirs = target.outline.normals[nearest]
    plane = unit(theirs + facing)
    ahead = np.einsum("ij,ij->i", target.outline.points[nearest] - at, plane)
    return ahead, plane, (np.einsum("ij,ij->i", theirs, facing) > 0.5) / (1.0 + (ahead / scale) ** 2) ** 2


def _descend(
    source: Outline,
    target: Target,
    rotation: Floats,
    scale: float,
    rounds: int,
    every: int,
    shift: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Returns rotation and shift after rounds of symmetric point-to-plane steps."""
    points, normals = (values[source.sample[::every]] for values in (source.points, source.normals))
    shift = np.zeros(3) if shift is None else shift
    for _ in range(rounds):
        at, facing = points @ rotation.T + shift, normals @ rotation.T
        ahead, plane, weights = _nearest_planes(at, facing, target, scale)
        turn, move = step_towards_planes(at, plane, ahead, weights)
        rotation, shift = turn @ rotation, turn @ shift + move
        if np.hypot(np.linalg.norm(turn - np.eye(3)), np.linalg.norm(move)) < 1e-4:
            break
    return rotation, shift


def _residual(source: Outline, target: Target, rotation: Floats, shift: Floats) -> float:
    there, _ = target.places.query(source.points[source.sample] @ rotation.T + shift)
    back, _ = cKDTree(source.points).query((target.outline.points[target.outline.sample] - shift) @ rotation)
    squares = [np.mean(np.minimum(distance, FURTHEST) ** 2) for distance in (there, back)]
    return float(np.sqrt(np.mean(squares)))
