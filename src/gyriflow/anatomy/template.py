"""Surfaces registered with an upright template: the rotation that brings them to RAS+, and how sure it is.

The template is the shipped atlas at three weeks, `atlases/spina-bifida/right.week*.surf.gii`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, cKDTree

from ..geometry.alignment import (
    CUBE_ROTATIONS,
    MIRROR,
    Planes,
    RigidFit,
    fits_from_all_sides,
    follow_planes,
    residual_ratio,
)
from ..geometry.triangles import Floats, TriangleMesh, corners, face_areas, face_normals, merged, transformed, unit
from ..io.surfaces import read_surface
from ..shipped import SHIPPED

WEEKS = 21, 28, 34
POINTS = 2400
# of whole brains, points deeper below the hull, in sizes, do not count
DEEPEST = 0.15
# how much a difference of normals counts beside a distance, in sizes, when nearest points are looked for
NORMALS = 0.2
# distances beyond these (in sizes) hardly count: coarse for the start, finer for the end
COARSE, FINE = 0.3, 0.12
FURTHEST = 0.3
# poses that differ by less are one, and so many are refined
DISTINCT_DEG, REFINED = 40.0, 3
# the medial wall: how near to its plane points are, in sizes, and how far their normals are from its own, in degrees
WALL = ((0.30, 40.0), (0.15, 25.0), (0.075, 15.0), (0.075, 10.0))
WALL_ROUNDS, WALL_COSINE = 6, 0.85
# narrower looks that turn the plane by more follow a bend of the wall
BEND_DEG = 1.0


@dataclass(frozen=True, eq=False)
class Shape:
    """Points spread over a closed surface, free of its place and size.

    (n, 3) `points` are relative to the `centre` of volume (3,), in mm, and to the size, the cube root of the volume;
    `normals` are their outward unit normals.
    """

    points: Floats
    normals: Floats
    centre: Floats
    size_mm: float

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.features(self.points, self.normals))

    @staticmethod
    def features(points: Floats, normals: Floats) -> Floats:
        """Return the (n, 6) places between which nearest points are looked for."""
        return np.hstack([points, NORMALS * normals])

    def mirrored(self) -> "Shape":
        """Return the shape of the other side."""
        mirror = MIRROR[:3, :3]
        return Shape(self.points @ mirror, self.normals @ mirror, mirror @ self.centre, self.size_mm)


def shape_of(mesh: TriangleMesh, *, deepest: float = np.inf) -> Shape:
    """Return the shape of a closed, outward surface, by points drawn at random in proportion to area.

    Those `deepest` sizes and more below the convex hull are left out: of whole brains the depth of the fissure, which
    may be open or shut.
    """
    triangles, areas = corners(mesh), face_areas(mesh)
    volumes = np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6.0
    centre = 0.75 * volumes @ triangles.mean(axis=1) / volumes.sum()
    size = float(np.cbrt(volumes.sum()))
    random = np.random.default_rng(0)
    faces = random.choice(len(areas), POINTS, p=areas / areas.sum())
    points = np.einsum("nc,ncd->nd", random.dirichlet(np.ones(3), POINTS), triangles[faces])
    points, normals = (points - centre) / size, face_normals(mesh)[faces]
    if np.isfinite(deepest):
        hull = ConvexHull(points).equations
        outer = (points @ hull[:, :3].T + hull[:, 3]).max(axis=1) > -deepest
        points, normals = points[outer], normals[outer]
    return Shape(points, normals, centre, size)


@cache
def hemispheres() -> tuple[Shape, ...]:
    """Return the right hemispheres of the template."""
    return tuple(map(shape_of, _surfaces()))


@cache
def brains() -> tuple[Shape, ...]:
    """Return the template's brains, of two hemispheres each."""
    return tuple(shape_of(merged(transformed(right, MIRROR), right), deepest=DEEPEST) for right in _surfaces())


def _surfaces() -> list[TriangleMesh]:
    folder = SHIPPED / "atlases" / "spina-bifida"
    return [read_surface(folder / f"right.week{week}.surf.gii") for week in WEEKS]


def register(shape: Shape, targets: Sequence[Shape], rotation: Floats, shift: Floats | None = None) -> RigidFit:
    """Return the best fit of a shape on one of several, from a (3, 3) rotation near it."""
    return min(
        (_descend(shape, target, rotation, shift, FINE, 30, 3) for target in targets), key=lambda fit: fit.residual
    )


def register_from_all_sides(shape: Shape, targets: Sequence[Shape]) -> tuple[RigidFit, float]:
    """Return the best fit of a shape on one of several, from 24 starts, and how many times worse the next pose is.

    The next pose is more than 40° away. Near 1, as for a body of revolution, the shape says no pose.
    """
    middle = targets[len(targets) // 2]
    fits = fits_from_all_sides(
        CUBE_ROTATIONS,
        lambda start: _descend(shape, middle, start, None, COARSE, 12, 8),
        lambda fit: register(shape, targets, fit.rotation, fit.shift),
        REFINED,
        DISTINCT_DEG,
    )
    best = min(fits, key=lambda fit: fit.residual)
    confidence = residual_ratio(fits, best, DISTINCT_DEG)
    fine = [_descend(shape, target, best.rotation, best.shift, FINE, 30, 1) for target in targets]
    return min(fine, key=lambda fit: fit.residual), confidence


def _descend(
    shape: Shape, target: Shape, rotation: Floats, shift: Floats | None, scale: float, rounds: int, every: int
) -> RigidFit:
    """Return the fit after rounds of iterative closest points, with every so many of the points.

    Steps follow the symmetric point-to-plane distance, Rusinkiewicz 2019 (doi 10.1145/3306346.3323037), with
    Geman-McClure weights.
    """
    points, normals = shape.points[::every], shape.normals[::every]

    def planes(rotation: Floats, shift: Floats) -> Planes:
        at, facing = points @ rotation.T + shift, normals @ rotation.T
        _, nearest = target.tree.query(target.features(at, facing))
        theirs = target.normals[nearest]
        plane = unit(theirs + facing)
        ahead = np.einsum("ij,ij->i", target.points[nearest] - at, plane)
        return at, plane, ahead, (np.einsum("ij,ij->i", theirs, facing) > 0.5) / (1.0 + (ahead / scale) ** 2) ** 2

    def is_converged(_: Floats, turn: Floats, move: Floats) -> bool:
        return bool(np.hypot(np.linalg.norm(turn - np.eye(3)), np.linalg.norm(move)) < 1e-3)

    rotation, shift = follow_planes(rotation, np.zeros(3) if shift is None else shift, planes, rounds, is_converged)
    there, _ = target.tree.query(target.features(points @ rotation.T + shift, normals @ rotation.T))
    theirs, facing = target.points[::every], target.normals[::every]
    back, _ = shape.tree.query(shape.features((theirs - shift) @ rotation, facing @ rotation))
    squares = [np.mean(np.minimum(distance, FURTHEST) ** 2) for distance in (there, back)]
    return RigidFit(rotation, shift, float(np.sqrt(np.mean(squares))))


def medial_wall(shape: Shape, normal: Floats) -> tuple[Floats, float]:
    """Return the plane normal·p = offset along a hemisphere's medial wall, which faces about the unit vector given.

    The normal (3,) is outward, the offset in sizes of the hemisphere.
    """
    facing = shape.normals @ normal > WALL_COSINE
    points, normals = shape.points[facing], shape.normals[facing]
    heights = points @ normal
    counts, edges = np.histogram(heights, bins=20)
    offset = edges[counts.argmax()] + 0.5 * (edges[1] - edges[0])
    # ever more narrowly, so that a wall that was cut along a plane gets that plane
    for number, look in enumerate(WALL):
        narrower, there = _wall_plane(points, normals, normal, offset, *look)
        if number > 1 and _degrees(narrower @ normal) > BEND_DEG:
            break
        normal, offset = narrower, there
    return normal, float(offset)


def _wall_plane(
    points: Floats, normals: Floats, normal: Floats, offset: float, width: float, most_deg: float
) -> tuple[Floats, float]:
    for _ in range(WALL_ROUNDS):
        weights = _biweight((points @ normal - offset) / width) * _biweight(_degrees(normals @ normal) / most_deg)
        _, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
        normal = np.asarray(axes[:, 0] * np.sign(axes[:, 0] @ normal), dtype=np.float64)
        offset = float(np.average(points, axis=0, weights=weights) @ normal)
    return normal, offset


def _degrees(cosine: ArrayLike) -> Floats:
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), dtype=np.float64)


def _biweight(away: NDArray[np.floating]) -> Floats:
    return np.where(np.abs(away) < 1.0, (1.0 - away**2) ** 2, 0.0)
