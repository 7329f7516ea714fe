"""Paths of a mesh through shapes by week, whose elements stay valid on the way."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly
from scipy.spatial import cKDTree

from .alignment import rigid_fit
from .deformations import transform_points
from .diffusion import vertex_sizes
from .jacobians import inverted_on_the_way
from .tetrahedra import TetrahedralMesh, linear_pieces
from .triangles import Floats, Ints

MAX_VELOCITY_RATIO = 3.0
"""Largest velocity at a week as a multiple of the smaller mean velocity on either side
of it: the bound within which a cubic does not overshoot (Fritsch and Carlson 1980, doi
10.1137/0717021)."""
STRAIGHT_MM = 5.0
"""Distance from an element that would be inverted within which the path is straight
(Gaussian)."""
STRAIGHTENING_ROUNDS = 3
MIN_SPACING_GW = 0.5
"""Time between two observed shapes below which growth from one to the other is within
registration noise."""


@dataclass(frozen=True, eq=False)
class Path:
    """A path through k shapes (n, 3) in mm at ascending weeks: a cubic between each
    two.

    `inverted` (k − 1, m) are the elements that it still inverts between two shapes, in
    pieces of a step.
    """

    weeks: Floats
    curve: BPoly
    inverted: list[Ints]

    def __call__(self, week: float) -> Floats:
        return np.asarray(self.curve(week))


def path_through(
    weeks: Sequence[float],
    shapes: Sequence[Floats] | Floats,
    mesh: TetrahedralMesh,
    step_gw: float = 1 / 7,
    stops: Collection[float] = (),
) -> Path:
    """Return a path through (n, 3) shapes of a mesh in mm at ascending weeks, for a run
    with steps of `step_gw`.

    Each shape is aligned rigidly to the one before; shapes at almost the same time are
    merged (`merged_shapes`). `stops` are weeks of shapes that were not observed.
    Velocities are `limited_velocities`; near elements that a step would invert the path
    is straight from shape to shape, so that the velocity may jump at the weeks.
    """
    sizes = vertex_sizes(shapes[0], linear_pieces(mesh))
    aligned = [shapes[0]]
    for shape in shapes[1:]:
        aligned.append(transform_points(shape, rigid_fit(shape, aligned[-1], sizes)))
    at, places = merged_shapes(np.asarray(weeks, dtype=float), np.stack(aligned), stops)
    velocities = limited_velocities(at, places)
    # by interval, since velocities may differ on the two sides of a week: control
    # points of Bernstein's polynomials
    lengths = np.diff(at)[:, None, None]
    first, last = places[:-1], places[1:]
    control = np.stack(
        [
            first,
            first + velocities[:-1] * lengths / 3,
            last - velocities[1:] * lengths / 3,
            last,
        ]
    )
    inverted = []
    for i, length in enumerate(np.diff(at)):
        steps = max(1, int(np.ceil(length / step_gw - 1e-6)))
        ends = np.arange(steps + 1) / steps
        straight = control[0, i] + np.array([1 / 3, 2 / 3])[:, None, None] * (
            control[3, i] - control[0, i]
        )
        for _ in range(STRAIGHTENING_ROUNDS):
            faults = _inverted_between(control[:, i], ends, mesh)
            if not len(faults):
                break
            distance, _ = cKDTree(places[i][mesh.corners[faults]].mean(axis=1)).query(
                places[i]
            )
            near = np.exp(-((distance / STRAIGHT_MM) ** 2))[:, None]
            control[1:3, i] += near * (straight - control[1:3, i])
        else:
            control[1:3, i] = straight
            faults = _inverted_between(control[:, i], ends, mesh)
        inverted.append(faults)
    return Path(at, BPoly(control, at), inverted)


def _inverted_between(control: Floats, ends: Floats, mesh: TetrahedralMesh) -> Ints:
    curve = BPoly(control[:, None], [0.0, 1.0])
    found = np.zeros(len(mesh.tets), dtype=bool)
    before = curve(ends[0])
    for end in ends[1:]:
        after = curve(end)
        found |= inverted_on_the_way(before, after, mesh.tets)
        before = after
    return np.flatnonzero(found)


def merged_shapes(
    weeks: Floats, places: Floats, stops: Collection[float] = ()
) -> tuple[Floats, Floats]:
    """Return weeks and (k, n, 3) places, with shapes closer than `MIN_SPACING_GW` moved
    onto one line in time.

    The line passes through the mean of these shapes, at the start of the path through
    the start itself, with the mean velocity to their neighbours: one scan too many does
    not bend the path. Stops next to them are left out.
    """
    observed = np.flatnonzero(~np.isin(weeks, list(stops)))
    groups = np.split(
        observed, np.flatnonzero(np.diff(weeks[observed]) >= MIN_SPACING_GW) + 1
    )
    if len(groups) == 1 or max(map(len, groups)) == 1:
        return weeks, places
    means = [
        (float(weeks[group].mean()), places[group].mean(axis=0)) for group in groups
    ]
    means[0] = (float(weeks[0]), places[0])
    merged = places.copy()
    kept = np.ones(len(weeks), dtype=bool)
    for number, group in enumerate(groups):
        if len(group) > 1:
            early, first = means[max(number - 1, 0)]
            late, last = means[min(number + 1, len(groups) - 1)]
            week, mean = means[number]
            fractions = (weeks[group] - week) / (late - early)
            merged[group] = mean + fractions[:, None, None] * (last - first)
            before, after = np.searchsorted(observed, [group[0], group[-1]]) + [-1, 1]
            end = observed[after] if after < len(observed) else group[-1] + 1
            around = slice(observed[max(before, 0)], end)
            kept[around] &= np.isin(np.arange(len(weeks))[around], observed)
    return weeks[kept], merged[kept]


def limited_velocities(weeks: Floats, places: Floats) -> Floats:
    """Return the (k, n, 3) velocities at k weeks of points on their way through (k, n,
    3) places.

    It is the parabola's through a place and its neighbours, the mean velocity at the
    ends, limited in length.
    """
    velocities = np.gradient(places, weeks, axis=0)
    speed = np.linalg.norm(np.diff(places, axis=0), axis=2) / np.diff(weeks)[:, None]
    limit = MAX_VELOCITY_RATIO * np.minimum(speed[:-1], speed[1:])
    length = np.linalg.norm(velocities[1:-1], axis=2)
    velocities[1:-1] *= np.minimum(1.0, limit / np.maximum(length, 1e-12))[..., None]
    return np.asarray(velocities)
