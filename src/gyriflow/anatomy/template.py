"""Register surfaces to the shipped atlas at three weeks: the rotation to RAS+ and its
confidence."""

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
    angle_deg,
    follow_planes,
)
from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    corners,
    dots,
    face_areas,
    face_normals,
    merged,
    transformed,
    unit,
)
from ..io.surfaces import read_surface
from ..shipped import SHIPPED

WEEKS = 21, 28, 34
POINTS = 2400
# points of whole brains deeper than this below the hull (in sizes) are left out
MAX_DEPTH = 0.15
# weight of a difference of normals relative to a distance (in sizes) in the search for
# nearest points
NORMAL_WEIGHT = 0.2
# scales of the robust weight of distances (in sizes), at first and at the end
COARSE, FINE = 0.3, 0.12
MAX_DISTANCE = 0.3
# poses that differ by less count as one; number of poses that are refined
DISTINCT_DEG, N_REFINED = 40.0, 3
# the medial wall: largest distances of its points from the plane (in sizes) and of
# their normals from the plane's (°)
WALL = ((0.30, 40.0), (0.15, 25.0), (0.075, 15.0), (0.075, 10.0))
WALL_ROUNDS, WALL_COSINE = 6, 0.85
# narrower fits that rotate the plane by more than this follow a bend of the wall
BEND_DEG = 1.0


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points on a closed surface, independent of its position and size.

    (n, 3) `points` are relative to the `centre` of volume (3,) in mm, over the size,
    the cube root of the volume.
    """

    points: Floats
    normals: Floats
    centre: Floats
    size_mm: float

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(_features(self.points, self.normals))

    def mirrored(self) -> "PointCloud":
        """Return the mirror image."""
        mirror = MIRROR[:3, :3]
        return PointCloud(
            self.points @ mirror,
            self.normals @ mirror,
            mirror @ self.centre,
            self.size_mm,
        )


def _features(points: Floats, normals: Floats) -> Floats:
    """Return the (n, 6) features in whose space nearest points are searched."""
    return np.hstack([points, NORMAL_WEIGHT * normals])


def shape_of(mesh: TriangleMesh, *, max_depth: float = np.inf) -> PointCloud:
    """Sample a closed, outward surface by area, but for points deeper than `max_depth`
    sizes below its hull."""
    triangles, areas = corners(mesh), face_areas(mesh)
    volumes = dots(triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6.0
    centre = 0.75 * volumes @ triangles.mean(axis=1) / volumes.sum()
    size = float(np.cbrt(volumes.sum()))
    random = np.random.default_rng(0)
    faces = random.choice(
        len(areas),
        POINTS,
        p=areas / areas.sum(),
    )
    points = np.einsum(
        "nc,ncd->nd", random.dirichlet(np.ones(3), POINTS), triangles[faces]
    )
    points, normals = (points - centre) / size, face_normals(mesh)[faces]
    if np.isfinite(max_depth):
        hull = ConvexHull(points).equations
        outer = (points @ hull[:, :3].T + hull[:, 3]).max(axis=1) > -max_depth
        points, normals = points[outer], normals[outer]
    return PointCloud(points, normals, centre, size)


@cache
def template_shapes(kind: str) -> tuple[PointCloud, ...]:
    """Return the right hemispheres of the template for the `kind` "hemisphere", its
    whole brains for "brain"."""
    folder = SHIPPED / "atlases" / "spina-bifida"
    surfaces = [read_surface(folder / f"right.week{week}.surf.gii") for week in WEEKS]
    if kind == "hemisphere":
        return tuple(map(shape_of, surfaces))
    return tuple(
        shape_of(merged(transformed(right, MIRROR), right), max_depth=MAX_DEPTH)
        for right in surfaces
    )


def register_shape(
    shape: PointCloud,
    targets: Sequence[PointCloud],
    rotation: Floats,
    shift: Floats | None = None,
    every: int = 3,
) -> RigidFit:
    """Return the best fit of every `every`-th point of a shape to one of several
    targets, starting from a (3, 3) rotation close to it."""
    fits = [
        _descend(
            shape,
            target,
            rotation,
            shift,
            FINE,
            30,
            every,
        )
        for target in targets
    ]
    return min(fits, key=lambda fit: fit.residual)


def register_from_all_sides(
    shape: PointCloud, targets: Sequence[PointCloud]
) -> tuple[RigidFit, float]:
    """Return the best fit of a shape to one of several targets from 24 starts, and its
    confidence.

    This is the residual of the best pose more than 40° away over that of the best: near
    1 the pose is unclear.
    """
    middle = targets[len(targets) // 2]
    coarse = [
        _descend(
            shape,
            middle,
            start,
            None,
            COARSE,
            12,
            8,
        )
        for start in CUBE_ROTATIONS
    ]
    distinct: list[RigidFit] = []
    for fit in sorted(coarse, key=lambda fit: fit.residual):
        turns = [_turn_deg(fit, other) for other in distinct]
        if min(turns, default=np.inf) > DISTINCT_DEG:
            distinct.append(fit)
    # that from the axes of the file is always one of them
    refined = [
        register_shape(shape, targets, fit.rotation, fit.shift)
        for fit in dict.fromkeys([coarse[0], *distinct[:N_REFINED]])
    ]
    best = min(refined, key=lambda fit: fit.residual)
    others = [fit.residual for fit in refined if _turn_deg(fit, best) > DISTINCT_DEG]
    confidence = min(others, default=np.inf) / best.residual
    found = register_shape(
        shape,
        targets,
        best.rotation,
        best.shift,
        every=1,
    )
    return found, confidence


def _turn_deg(first: RigidFit, second: RigidFit) -> float:
    """Return the angle between the rotations of two fits in degrees."""
    return angle_deg(first.rotation @ second.rotation.T)


def _descend(
    shape: PointCloud,
    target: PointCloud,
    rotation: Floats,
    shift: Floats | None,
    scale: float,
    rounds: int,
    every: int,
) -> RigidFit:
    """Return the fit after `rounds` of iterative closest points, with every `every`-th
    point.

    Symmetric point-to-plane steps (Rusinkiewicz 2019, doi 10.1145/3306346.3323037),
    Geman-McClure weights.
    """
    points, normals = shape.points[::every], shape.normals[::every]

    def planes(rotation: Floats, shift: Floats) -> Planes:
        moved = points @ rotation.T + shift
        facing = normals @ rotation.T
        _, nearest = target._tree.query(_features(moved, facing))
        target_normals = target.normals[nearest]
        plane = unit(target_normals + facing)
        distances = dots(target.points[nearest] - moved, plane)
        agrees = dots(target_normals, facing) > 0.5
        weights = agrees / (1.0 + (distances / scale) ** 2) ** 2
        return Planes(moved, plane, distances, weights)

    rotation, shift = follow_planes(
        rotation, np.zeros(3) if shift is None else shift, planes, rounds, _is_converged
    )
    forward, _ = target._tree.query(
        _features(points @ rotation.T + shift, normals @ rotation.T)
    )
    target_points, facing = target.points[::every], target.normals[::every]
    backward, _ = shape._tree.query(
        _features((target_points - shift) @ rotation, facing @ rotation)
    )
    squares = [
        np.mean(np.minimum(distance, MAX_DISTANCE) ** 2)
        for distance in (forward, backward)
    ]
    return RigidFit(
        rotation,
        shift,
        float(np.sqrt(np.mean(squares))),
    )


def _is_converged(_: Floats, turn: Floats, move: Floats) -> bool:
    change = np.linalg.norm(turn - np.eye(3))
    return bool(np.hypot(change, np.linalg.norm(move)) < 1e-3)


def medial_wall(shape: PointCloud, normal: Floats) -> tuple[Floats, float]:
    """Fit normal·p = offset (in sizes) to a hemisphere's medial wall, given its
    approximate outward normal (3,)."""
    facing = shape.normals @ normal > WALL_COSINE
    points, normals = shape.points[facing], shape.normals[facing]
    heights = points @ normal
    counts, edges = np.histogram(heights, bins=20)
    offset = edges[counts.argmax()] + 0.5 * (edges[1] - edges[0])
    # successively narrower, so that a wall that was cut along a plane gets that plane
    for number, limits in enumerate(WALL):
        new_normal, new_offset = _wall_plane(points, normals, normal, offset, *limits)
        if number > 1 and _degrees(new_normal @ normal) > BEND_DEG:
            break
        normal, offset = new_normal, new_offset
    return normal, float(offset)


def _wall_plane(
    points: Floats,
    normals: Floats,
    normal: Floats,
    offset: float,
    width: float,
    max_deg: float,
) -> tuple[Floats, float]:
    for _ in range(WALL_ROUNDS):
        weights = _biweight((points @ normal - offset) / width) * _biweight(
            _degrees(normals @ normal) / max_deg
        )
        _, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
        normal = np.asarray(
            axes[:, 0] * np.sign(axes[:, 0] @ normal),
            dtype=np.float64,
        )
        offset = float(np.average(points, axis=0, weights=weights) @ normal)
    return normal, offset


def _degrees(cosine: ArrayLike) -> Floats:
    return np.asarray(
        np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), dtype=np.float64
    )


def _biweight(distance: NDArray[np.floating]) -> Floats:
    return np.where(
        np.abs(distance) < 1.0,
        (1.0 - distance**2) ** 2,
        0.0,
    )
