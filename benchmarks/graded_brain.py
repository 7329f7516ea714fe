"""One synthetic brain of two hemispheres, meshed as finely as asked: the meshes of `scaling.py`.

The brain is where a function of space is negative: an ellipsoid with shallow dents, as large as a cerebrum at 21 GW,
less a fissure which a bridge spans. A lattice of tetrahedra is bisected towards the surface, vertices near the surface
are moved onto it, and edges that still cross it are cut, as in isosurface stuffing (Labelle and Shewchuk 2007).
Nothing is random, and meshes of different size differ by their resolution only.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyriflow.geometry.tetrahedra import TetrahedralMesh, grid, volumes_between

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

SEMI_AXES_MM = np.array([21.0, 28.0, 21.5])
FISSURE_MM = 3.0
BRIDGE_CENTRE_MM = np.array([0.0, 2.0, -1.0])
BRIDGE_SEMI_AXES_MM = np.array([np.inf, 9.0, 4.0])
ROUNDING_MM = 0.8
"""About the radius of the rims of the fissure."""
DENT_MM = 0.8
WAVES = np.array([[5, 2, 3], [-2, 6, 1], [3, -4, 5], [1, 5, -6], [6, -3, -2]])
"""Directions and numbers of the waves on the unit sphere whose sum makes the dents."""

FINE_DEPTH_MM = 3.0
"""Elements are of one size down to this depth."""
GROWTH_PER_MM = 0.7
LARGEST = 4.0
"""Below, edges grow by this part of the finest with each mm, up to so many times the finest."""
SNAP = 0.33
"""Vertices nearer to the surface than this part of their shortest edge are moved onto it."""

FEWEST_TETS = 40_000
"""With fewer, elements would reach across the fissure."""
TETS_AT_1_MM, POWER = 2.25e5, 2.73
"""Elements with a finest edge of 1 mm, and the power of its inverse by which they grow; found by trial."""

ROTATION = Rotation.from_rotvec([0.4, 0.3, 0.5]).as_matrix()
"""Of the lattice: were its planes parallel to the fissure, the two would fit each other well or badly by chance."""
PAIRS = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])


def brain_mesh(tets: int) -> TetrahedralMesh:
    """Returns a mesh of about `tets` elements in RAS+ mm, its fissure at x = 0; ValueError for too few."""
    if tets < FEWEST_TETS:
        raise ValueError(f"elements of so coarse a mesh reach across the fissure: at least {FEWEST_TETS} are needed")
    edge = (TETS_AT_1_MM / tets) ** (1 / POWER)
    spacing = LARGEST * edge
    half = np.ceil(SEMI_AXES_MM.max() / spacing) + 1
    lattice = grid([spacing * np.arange(-half, half + 1)] * 3)
    return _cut(*_refined(lattice.vertices @ ROTATION, lattice.tets, edge))


def _level(points: Floats) -> Floats:
    """Returns a function in mm of (n, 3) points that is negative inside the brain and close to the distance near it."""
    # deep inside, where directions change fast, by position
    direction = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 10.0)
    dents = DENT_MM * np.cos(direction @ WAVES.T + np.arange(len(WAVES))).mean(axis=1)
    outside = _ellipsoid(points, SEMI_AXES_MM) + dents
    bridge = _ellipsoid(points - BRIDGE_CENTRE_MM, BRIDGE_SEMI_AXES_MM)
    fissure = _smaller(FISSURE_MM / 2 - np.abs(points[:, 0]), bridge)
    return -_smaller(-outside, -fissure)


def _ellipsoid(points: Floats, semi_axes: Floats) -> Floats:
    """Returns about the distance to an ellipsoid, negative inside: a function over its gradient's length."""
    points = np.abs(points) + 1e-9  # the gradient vanishes in the centre
    scaled = np.linalg.norm(points / semi_axes, axis=1)
    return scaled * (scaled - 1) / np.linalg.norm(points / semi_axes**2, axis=1)


def _smaller(a: Floats, b: Floats) -> Floats:
    """Returns the minimum of both, rounded off where they meet."""
    return -ROUNDING_MM * np.logaddexp(-a / ROUNDING_MM, -b / ROUNDING_MM)


def _to_surface(points: Floats) -> Floats:
    """Returns the (n, 3) way from points near the surface to it: one step of Newton's method along the gradient."""
    level = _level(points)
    gradient = np.stack([_level(points + step) - level for step in 1e-3 * np.eye(3)], axis=1) / 1e-3
    return -(level / (gradient**2).sum(axis=1))[:, None] * gradient


def _edges(vertices: Floats, tets: Ints) -> tuple[Ints, Ints, Floats]:
    """Returns the (m, 6) edges of the elements, their (e, 2) ends in ascending order, and their (e,) lengths."""
    ends = np.sort(tets[:, PAIRS], axis=2)
    keys, edges = np.unique(ends[..., 0] * len(vertices) + ends[..., 1], return_inverse=True)
    ends = np.stack(np.divmod(keys, len(vertices)), axis=1)
    return edges.reshape(-1, 6), ends, np.linalg.norm(np.diff(vertices[ends], axis=1)[:, 0], axis=1)


def _halved(tets: Ints, edges: Ints, order: Ints, wanted: Mask, count: int) -> tuple[Ints, Mask]:
    """Returns the elements after halving wanted edges, and the (e,) mask of the edges that were halved.

    Each element is halved at the edge that comes last in the (e,) `order`, so that neighbours divide their common face
    alike; an edge waits until it is the last of all elements around it. The middles of the edges are new vertices with
    numbers from `count` on.
    """
    is_last = order[edges].argmax(axis=1)[:, None] == np.arange(6)
    halved = wanted.copy()
    halved[edges[~is_last]] = False
    split = halved[edges[is_last]]
    middle = (count - 1 + np.cumsum(halved))[edges[is_last][split]]
    ends = PAIRS[is_last[split].argmax(axis=1)]
    first, second = tets[split], tets[split]
    row = np.arange(len(first))
    first[row, ends[:, 0]] = middle
    second[row, ends[:, 1]] = middle
    return np.concatenate([tets[~split], first, second]), halved


def _refined(vertices: Floats, tets: Ints, finest: float) -> tuple[Floats, Ints]:
    """Returns the lattice bisected until no element is larger than its depth allows.

    Elements are bisected at their longest edge, neighbours first where theirs is longer (Rivara 1984). All elements
    keep to three shapes, as those of the lattice are Kuhn's.
    """
    while True:
        level = _level(vertices)
        tets = tets[(level[tets] < LARGEST * finest).any(axis=1)]
        depth = np.abs(level[tets].mean(axis=1))
        edge = finest * np.clip(1 + GROWTH_PER_MM * (depth - FINE_DEPTH_MM), 1, LARGEST)
        # a cube of the lattice has six elements; halving goes on while it comes nearer to the wanted size
        large = volumes_between(vertices, tets) > np.sqrt(2) * edge**3 / 6
        if not large.any():
            return vertices, tets
        edges, ends, lengths = _edges(vertices, tets)
        order = np.lexsort((np.arange(len(ends)), lengths)).argsort()
        longest = np.take_along_axis(edges, order[edges].argmax(axis=1)[:, None], axis=1)[:, 0]
        wanted = np.zeros(len(ends), dtype=bool)
        wanted[longest[large]] = True
        while not wanted[waiting := longest[wanted[edges].any(axis=1)]].all():
            wanted[waiting] = True
        tets, halved = _halved(tets, edges, order, wanted, len(vertices))
        vertices = np.concatenate([vertices, vertices[ends[halved]].mean(axis=1)])


def _cut(vertices: Floats, tets: Ints) -> TetrahedralMesh:
    """Returns the part of the lattice inside the brain."""
    _, ends, lengths = _edges(vertices, tets)
    shortest = np.where(np.bincount(tets.ravel(), minlength=len(vertices)), np.inf, 0.0)
    np.minimum.at(shortest, ends.ravel(), np.repeat(lengths, 2))
    near = np.flatnonzero(np.abs(_level(vertices)) < SNAP * shortest)
    moved = vertices[near]
    for _ in range(3):
        moved += _to_surface(moved)
    close = np.linalg.norm(moved - vertices[near], axis=1) < SNAP * shortest[near]
    vertices[near[close]] = moved[close]
    side = np.sign(_level(vertices))
    side[near[close]] = 0
    tets = tets[(side[tets] < 0).any(axis=1)]
    while (side[tets] > 0).any():
        edges, ends, lengths = _edges(vertices, tets)
        crossing = side[ends].prod(axis=1) < 0
        order = np.lexsort((np.arange(len(ends)), lengths, crossing)).argsort()
        tets, halved = _halved(tets, edges, order, crossing, len(vertices))
        # the inner end first
        cut = np.where(side[ends[halved, :1]] < 0, ends[halved], ends[halved, ::-1])
        vertices = np.concatenate([vertices, _crossings(vertices[cut[:, 0]], vertices[cut[:, 1]])])
        side = np.concatenate([side, np.zeros(len(cut))])
        tets = tets[(side[tets] < 0).any(axis=1)]
    used, local = np.unique(tets, return_inverse=True)
    return TetrahedralMesh(vertices[used], local.reshape(-1, 4))


def _crossings(inside: Floats, outside: Floats) -> Floats:
    """Returns the points where the lines from inside to outside cross the surface, by bisection."""
    for _ in range(30):
        middle = (inside + outside) / 2
        within = (_level(middle) < 0)[:, None]
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    return inside
