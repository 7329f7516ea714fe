"""Paths of a mesh through shapes by week, whose elements stay valid on the way."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly
from scipy.spatial import cKDTree

from .alignment import align_points
from .diffusion import vertex_sizes
from .jacobians import inverted_on_the_way, may_be_inverted
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
    merged. `stops` are weeks of shapes that were not observed. Velocities are limited;
    near elements that a step would invert the path is straight from shape to shape, so
    that the velocity may jump at the weeks.
    """
    sizes = vertex_sizes(shapes[0], linear_pieces(mesh))
    aligned = [shapes[0]]
    for shape in shapes[1:]:
        aligned.append(align_points(shape, aligned[-1], sizes))
    at, places = _merged_shapes(
        np.asarray(weeks, dtype=float),
        np.stack(aligned),
        stops,
    )
    velocities = _limited_velocities(at, places)
    # by interval, since velocities may differ on the two sides of a week: control
    # points of Bernstein's polynomials
    lengths = np.diff(at)
    controls = []
    inverted = []
    for i, length in enumerate(lengths):
        first = places[i]
        last = places[i + 1]
        after_first = first + velocities[i] * length / 3
        before_last = last - velocities[i + 1] * length / 3
        control = np.stack([first, after_first, before_last, last])
        steps = max(
            1,
            int(np.ceil(length / step_gw - 1e-6)),
        )
        inverted.append(_straighten(control, steps, mesh))
        controls.append(control)
    return Path(
        at,
        BPoly(np.stack(controls, axis=1), at),
        inverted,
    )


def _straighten(
    control: Floats,
    steps: int,
    mesh: TetrahedralMesh,
) -> Ints:
    """Straighten a path with (4, n, 3) control points, in place, near elements that its
    steps invert; return those that they still invert."""
    first, _, _, last = control
    thirds = np.array([1 / 3, 2 / 3])
    straight = first + thirds[:, None, None] * (last - first)
    for _ in range(STRAIGHTENING_ROUNDS):
        faults = _inverted_by_steps(control, steps, mesh)
        if not len(faults):
            return faults
        centres = first[mesh.corners[faults]].mean(axis=1)
        distance, _ = cKDTree(centres).query(first)
        near = np.exp(-((distance / STRAIGHT_MM) ** 2))
        control[1:3] += near[:, None] * (straight - control[1:3])
    control[1:3] = straight
    return _inverted_by_steps(control, steps, mesh)


def _inverted_by_steps(
    control: Floats,
    steps: int,
    mesh: TetrahedralMesh,
) -> Ints:
    curve = BPoly(control[:, None], [0.0, 1.0])
    # all shapes on the path and on its steps are between its control points
    suspects = np.flatnonzero(may_be_inverted(control, mesh.tets))
    tets = mesh.tets[suspects]
    found = np.zeros(len(tets), dtype=bool)
    before = control[0]
    for step in range(1, steps + 1):
        after = curve(step / steps)
        found |= inverted_on_the_way(before, after, tets)
        before = after
    return suspects[found]


def _merged_shapes(
    weeks: Floats,
    places: Floats,
    stops: Collection[float] = (),
) -> tuple[Floats, Floats]:
    """Return weeks and (k, n, 3) places, with shapes closer than `MIN_SPACING_GW` moved
    onto one line in time.

    The line passes through the mean of these shapes, at the start of the path through
    the start itself, with the mean velocity to their neighbours: one scan too many does
    not bend the path. Stops next to them are left out.
    """
    observed = np.flatnonzero(~np.isin(weeks, list(stops)))
    is_spaced = np.diff(weeks[observed]) >= MIN_SPACING_GW
    groups = np.split(observed, np.flatnonzero(is_spaced) + 1)
    if len(groups) == 1 or len(groups) == len(observed):
        return weeks, places
    mean_weeks = [weeks[group].mean() for group in groups]
    mean_places = [places[group].mean(axis=0) for group in groups]
    mean_weeks[0] = weeks[0]
    mean_places[0] = places[0]
    merged = places.copy()
    keep = np.ones(len(weeks), dtype=bool)
    is_stop = np.isin(
        np.arange(len(weeks)),
        observed,
        invert=True,
    )
    for number, group in enumerate(groups):
        if len(group) == 1:
            continue
        before = max(number - 1, 0)
        after = min(number + 1, len(groups) - 1)
        duration = mean_weeks[after] - mean_weeks[before]
        parts = (weeks[group] - mean_weeks[number]) / duration
        change = mean_places[after] - mean_places[before]
        merged[group] = mean_places[number] + parts[:, None, None] * change
        # from the group before to the one after
        first = groups[before][-1] if before < number else group[0]
        last = groups[after][0] if after > number else group[-1] + 1
        keep[first:last] &= ~is_stop[first:last]
    return weeks[keep], merged[keep]


def _limited_velocities(weeks: Floats, places: Floats) -> Floats:
    """Return the (k, n, 3) velocities at k weeks of points on their way through (k, n,
    3) places.

    It is the parabola's through a place and its neighbours, the mean velocity at the
    ends, limited in length.
    """
    velocities = np.gradient(places, weeks, axis=0)
    steps = np.diff(places, axis=0)
    durations = np.diff(weeks)
    speeds = np.linalg.norm(steps, axis=2) / durations[:, None]
    slower = np.minimum(
        speeds[:-1],
        speeds[1:],
    )
    limits = MAX_VELOCITY_RATIO * slower
    inner = velocities[1:-1]
    lengths = np.linalg.norm(inner, axis=2)
    factors = np.minimum(
        1.0,
        limits / np.maximum(lengths, 1e-12),
    )
    inner *= factors[..., None]
    return velocities
