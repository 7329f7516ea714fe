"""The mid-sagittal plane of a brain, and the rotation that makes it a plane of constant x."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..geometry.triangles import TriangleMesh, vertex_areas, vertex_normals

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAMPLES = 600
DIRECTIONS = 400
STARTS = 5
# the left-right axis is looked for within this angle of the world's x axis
SEARCH_DEG = 60.0
# smaller tilts are left as they are: the plane is not known better than this
LEAST_TILT_DEG = 0.5
# of the distances to the mirror image, those above this quantile count as asymmetry
TRIMMED = 0.8
FISSURE_BAND = 0.2
WIDEST_FISSURE = 0.25
FEWEST_FISSURE_POINTS = 60
# the plane of symmetry is kept where the fissure fits it nearly as well as a plane of its own
CLEARLY_BETTER_MM = 0.02


@dataclass(frozen=True, eq=False)
class MidPlane:
    """The mid-sagittal plane: the points p with normal·p = offset.

    Attributes
    ----------
    normal : (3,) float
        Unit vector from left to right.
    offset : float
        Distance from the origin in mm.
    asymmetry_mm : float
        Mean distance from the surface to its image in the plane of best symmetry, without the largest fifth.
    fissure_points : int
        Number of places between facing walls of the fissure that the plane was fitted to; 0 where too few were
        found and the plane is that of mirror symmetry.
    scatter_mm : float
        Root mean square distance of these places to the plane.
    """

    normal: Floats
    offset: float
    asymmetry_mm: float
    fissure_points: int
    scatter_mm: float


def mid_plane(mesh: TriangleMesh, search_deg: float = SEARCH_DEG) -> MidPlane:
    """Returns the mid-sagittal plane of a closed, outward surface whose left-right axis is within an angle of x.

    Planes of mirror symmetry are the candidates; each is fitted to the fissure, that is, to the middle between medial
    walls that face each other. The best has both little asymmetry and much fissure. In an asymmetric brain the plane
    of symmetry and the fissure differ, and the fissure decides.
    """
    weights = vertex_areas(mesh)
    chosen = np.random.default_rng(0).choice(len(weights), SAMPLES, p=weights / weights.sum())
    sample, tree = mesh.vertices[chosen], cKDTree(mesh.vertices)
    candidates = [_fit_to_fissure(mesh, *plane) for plane in _symmetry_planes(sample, tree, search_deg)]
    return max(candidates, key=lambda plane: (plane.fissure_points + 100.0) / (plane.asymmetry_mm + 0.5))


def _fit_to_fissure(mesh: TriangleMesh, normal: Floats, offset: float, asymmetry: float) -> MidPlane:
    """Returns the plane fitted to the fissure near a plane of symmetry, or that plane where it fits nearly as well."""
    middle = fissure_points(mesh, normal, offset)
    fitted = _plane_through(middle, normal, offset)
    if fitted is None:
        return MidPlane(normal, offset, asymmetry, 0, float("nan"))
    # the first band may have been beside the fissure
    middle = fissure_points(mesh, *fitted)
    fitted = _plane_through(middle, *fitted) or fitted
    count, scatter = _scatter(middle, *fitted)
    before, by_symmetry = _scatter(middle, normal, offset)
    if before > 0.95 * count and by_symmetry < scatter + CLEARLY_BETTER_MM:
        return MidPlane(normal, offset, asymmetry, before, by_symmetry)
    return MidPlane(*fitted, asymmetry, count, scatter)


def fissure_points(mesh: TriangleMesh, normal: Floats, offset: float) -> Floats:
    """Returns (k, 3) places half-way between walls that face each other across the interhemispheric fissure.

    Only walls in a band around the plane normal·p = offset are looked at: a fifth of the brain's width to each side.
    """
    height = mesh.vertices @ normal - offset
    width = np.ptp(height)
    facing = vertex_normals(mesh) @ normal
    near = np.abs(height) < FISSURE_BAND * width
    left, right = np.flatnonzero(near & (facing > 0.5)), np.flatnonzero(near & (facing < -0.5))
    if len(left) < 8 or len(right) < 8:
        return np.empty((0, 3))
    return np.concatenate([_middles(mesh, height, left, right, normal), _middles(mesh, -height, right, left, -normal)])


def _middles(mesh: TriangleMesh, height: Floats, wall: Ints, opposite: Ints, normal: Floats) -> Floats:
    """Returns the places half-way from vertices of one wall to the nearest of the opposite wall straight above."""
    across = np.outer(height, normal)
    in_plane = mesh.vertices - across
    # distances along the plane count five times those across it
    squeezed = in_plane + 0.2 * across
    _, found = cKDTree(squeezed[opposite]).query(squeezed[wall], k=min(8, len(opposite)))
    met = opposite[found]
    gap = height[met] - height[wall][:, None]
    aside = np.linalg.norm(in_plane[met] - in_plane[wall][:, None], axis=-1)
    gap = np.where((gap > 0) & (gap < WIDEST_FISSURE * np.ptp(height)) & (aside < 2.0), gap, np.inf)
    best = np.argmin(gap, axis=1)
    rows = np.flatnonzero(np.isfinite(gap[np.arange(len(wall)), best]))
    return 0.5 * (mesh.vertices[wall[rows]] + mesh.vertices[met[rows, best[rows]]])


def upright(plane: MidPlane, centre: Floats) -> tuple[Floats, float]:
    """Returns the (4, 4) rotation about `centre` that turns the plane to x = const, and its angle in degrees.

    It is the smallest such rotation, so that anterior and superior stay as the world coordinates have them.
    Below half a degree it is none.
    """
    matrix = np.eye(4)
    angle = float(np.degrees(np.arccos(np.clip(plane.normal[0], -1.0, 1.0))))
    if angle < LEAST_TILT_DEG:
        return matrix, 0.0
    axis = np.cross(plane.normal, [1.0, 0.0, 0.0])
    turn = Rotation.from_rotvec(np.radians(angle) * axis / np.linalg.norm(axis)).as_matrix()
    matrix[:3, :3] = turn
    matrix[:3, 3] = centre - turn @ centre
    return matrix, angle


def _symmetry_planes(sample: Floats, tree: cKDTree, search_deg: float) -> list[tuple[Floats, float, float]]:
    """Returns normal, offset and asymmetry (mm) of planes of mirror symmetry with normals within an angle of x."""
    centre = sample.mean(axis=0)
    # a Fibonacci lattice on the cap of directions around x
    index = np.arange(DIRECTIONS) + 0.5
    along = 1.0 - (1.0 - np.cos(np.radians(search_deg))) * index / DIRECTIONS
    turn = np.pi * (1.0 + 5.0**0.5) * index
    radius = np.sqrt(1.0 - along**2)
    directions = np.stack([along, radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    scores = np.array([_mirror_distance(n, float(n @ centre), sample[::3], tree) for n in directions])
    planes = []
    for start in _apart(directions, scores):
        base, aside = directions[start], np.linalg.svd(directions[start][None])[2][1:]
        found = minimize(
            lambda x, *frame: _mirror_distance(*_plane_near(x, *frame), sample, tree),
            np.zeros(3),
            args=(base, aside, centre),
            method="Nelder-Mead",
            options={"initial_simplex": np.vstack([np.zeros(3), 0.1 * np.eye(3)]), "xatol": 1e-4, "fatol": 1e-4},
        )
        planes.append((*_plane_near(found.x, base, aside, centre), float(found.fun)))
    return planes


def _plane_near(x: Floats, base: Floats, aside: Floats, centre: Floats) -> tuple[Floats, float]:
    """Returns the plane with its normal turned from `base` by x[:2] radians, and moved from `centre` by 10 x[2] mm."""
    normal = np.asarray(base + x[:2] @ aside, dtype=float)
    normal /= np.linalg.norm(normal)
    return normal, float(normal @ centre) + 10.0 * float(x[2])


def _scatter(points: Floats, normal: Floats, offset: float) -> tuple[int, float]:
    """Returns how many points are within 3 mm of the plane, and their root mean square distance to it."""
    distance = points @ normal - offset
    near = distance[np.abs(distance) < 3.0]
    return len(near), float(np.sqrt(np.mean(near**2))) if len(near) else float("inf")


def _apart(directions: Floats, scores: Floats) -> list[int]:
    """Returns the numbers of the best directions that are at least 20° from each other."""
    chosen: list[int] = []
    for number in np.argsort(scores):
        if all(abs(directions[number] @ directions[other]) < np.cos(np.radians(20.0)) for other in chosen):
            chosen.append(int(number))
        if len(chosen) == STARTS:
            break
    return chosen


def _mirror_distance(normal: Floats, offset: float, sample: Floats, tree: cKDTree) -> float:
    """Returns the mean distance in mm from the mirrored sample to the surface, without the largest ones."""
    mirrored = sample - 2.0 * np.outer(sample @ normal - offset, normal)
    distance, _ = tree.query(mirrored)
    return float(np.sort(distance)[: int(TRIMMED * len(distance))].mean())


def _plane_through(points: Floats, normal: Floats, offset: float) -> tuple[Floats, float] | None:
    """Returns the plane fitted to points with Tukey weights of shrinking scale, or None where they fix none."""
    for scale in (10.0, 6.0, 4.0, 3.0, 2.0, 2.0, 2.0):
        distance = points @ normal - offset
        weights = np.where(np.abs(distance) < scale, (1.0 - (distance / scale) ** 2) ** 2, 0.0)
        if np.count_nonzero(weights) < FEWEST_FISSURE_POINTS:
            return None
        centre = np.average(points, axis=0, weights=weights)
        spread, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
        # along a single line of points the plane could still turn
        if np.sqrt(spread[1]) < 3.0:
            return None
        fitted = axes[:, 0] * np.sign(axes[:, 0] @ normal)
        if fitted @ normal < np.cos(np.radians(25.0)):
            return None
        normal, offset = fitted, float(fitted @ centre)
    return normal, offset
