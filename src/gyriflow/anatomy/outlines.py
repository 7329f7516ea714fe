"""Outlines of hemispheres, free of size and place: one that is made here, rigid fits between them, and medial walls."""

from dataclasses import dataclass
from functools import cache

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..geometry.alignment import (
    CUBE_ROTATIONS,
    Fit,
    Planes,
    fits_from_all_sides,
    follow_planes,
    margin,
)
from ..geometry.triangles import TriangleMesh, corners, unit, vertex_areas, vertex_normals
from .extraction import isosurface

Floats = NDArray[np.float64]
# all lengths of an outline are relative to the cube root of the volume
VOXEL = 0.05
# sulci narrower than twice this are closed: folding then makes little difference to the outline
CLOSING = 0.12
OUTLINE_SAMPLES = 1500
# the reference: half lengths of a cerebrum from left to right, from front to back and in height
HALF_LENGTHS = (0.75, 1.0, 0.77)
REFERENCE_VOXEL = 0.04
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
# how narrowly the wall is a plane, in sizes of the hemisphere, while it is looked for; narrower bands follow its bends
WIDTHS = (0.10, 0.05)
COSINE = 0.85
# a wall that was cut along a plane: its normals are looked for ever more narrowly, and this part of the area has them
CUT_WIDTHS_DEG, CUT_SHARE = (40.0, 25.0, 15.0, 10.0, 7.0, 4.0, 2.0), 0.04
CUT_DEG, CUT_DEPTH = 1.0, 0.004
# how far the normal may be off, in degrees: of a cut, and of a fitted plane (deformed atlas brains, one in three)
CUT_ERROR_DEG, FITTED_ERROR_DEG = 0.1, 1.5


@dataclass(frozen=True, eq=False)
class Outline:
    """A hemisphere's outline.

    (n, 3) places on it relative to the `centre` of volume (3,), in mm, and to the size, the cube root of the volume;
    their outward unit normals; and the numbers of a `sample`, chosen at random in proportion to area.
    """

    points: Floats
    normals: Floats
    sample: NDArray[np.int64]
    centre: Floats
    size_mm: float


def outline(mesh: TriangleMesh) -> Outline:
    """Returns the outline of a closed, outward surface: the morphological closing of its inside, slightly smoothed."""
    triple = corners(mesh)
    parts = np.einsum("ij,ij->i", triple[:, 0], np.cross(triple[:, 1], triple[:, 2])) / 6.0
    centre = (parts[:, None] * 0.75 * triple.mean(axis=1)).sum(axis=0) / parts.sum()
    size = float(parts.sum() ** (1 / 3))
    vertices = (mesh.vertices - centre) / size
    pad = CLOSING + 3 * VOXEL
    first = vertices.min(axis=0) - pad
    shape = np.ceil((vertices.max(axis=0) + pad - first) / VOXEL).astype(int)
    places = first + VOXEL * np.indices(shape).reshape(3, -1).T
    inside = igl.fast_winding_number(vertices, mesh.faces, places).reshape(shape) > 0.5
    near = distance_transform_edt(~inside) * VOXEL <= CLOSING
    depth = (distance_transform_edt(near) * VOXEL - CLOSING) / VOXEL
    field = gaussian_filter(np.clip(0.5 + depth, 0.0, 1.0).astype(np.float32), 1.0)
    affine = np.diag([VOXEL] * 3 + [1.0])
    affine[:3, 3] = first
    closed = isosurface(field, affine)
    weights = vertex_areas(closed)
    sample = np.random.default_rng(0).choice(len(weights), OUTLINE_SAMPLES, p=weights / weights.sum())
    return Outline(closed.vertices, vertex_normals(closed), sample, centre, size)


@cache
def reference() -> Outline:
    """Returns the outline of a right hemisphere in RAS+ that is no one's.

    Half of an ellipsoid with the proportions of a cerebrum, with a temporal lobe, a narrower frontal lobe, an underside
    that is higher in front, and a Sylvian dent. Its long axis is within a few degrees of y: that defines the pitch.
    """
    axes = [np.arange(start, 1.2, REFERENCE_VOXEL) for start in (-0.2, -1.2, -1.2)]
    x, y, z = np.meshgrid(*axes, indexing="ij")
    p, q, r = (along / half for along, half in zip((np.abs(x), y, z), HALF_LENGTHS, strict=True))
    radius = np.sqrt(p**2 + q**2 + r**2) + 1e-6
    u, v, w = p / radius, q / radius, r / radius

    def bump(centre: tuple[float, float, float], width: float) -> Floats:
        at = np.array(centre) / np.linalg.norm(centre)
        return np.asarray(np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2 + (w - at[2]) ** 2) / (2 * width**2)))

    dome = 1.0 + 0.16 * bump((0.72, 0.22, -0.66), 0.30) - 0.05 * np.maximum(v, 0.0) ** 2
    underside = (0.68 - 0.16 / (1.0 + np.exp((0.42 - v) / 0.05))) / np.maximum(-w, 1e-3)
    sylvian = np.maximum(bump((0.86, 0.42, -0.30), 0.17), 0.95 * bump((0.95, 0.20, -0.20), 0.15))
    edge = -0.03 * np.logaddexp(-dome / 0.03, -underside / 0.03) - 0.15 * sylvian
    affine = np.diag([REFERENCE_VOXEL] * 3 + [1.0])
    affine[:3, 3] = [along[0] for along in axes]
    depth = np.minimum((edge - radius) * np.sqrt(x**2 + y**2 + z**2) / radius, x)
    return outline(isosurface(np.clip(0.5 + depth / REFERENCE_VOXEL, 0.0, 1.0).astype(np.float32), affine))


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

    def planes(rotation: Floats, shift: Floats) -> Planes:
        at, facing = points @ rotation.T + shift, normals @ rotation.T
        ahead, plane, weights = _nearest_planes(at, facing, target, scale)
        return at, plane, ahead, weights

    def arrived(_: Floats, turn: Floats, move: Floats) -> bool:
        return bool(np.hypot(np.linalg.norm(turn - np.eye(3)), np.linalg.norm(move)) < 1e-4)

    return follow_planes(rotation, np.zeros(3) if shift is None else shift, planes, rounds, arrived)


def _residual(source: Outline, target: Target, rotation: Floats, shift: Floats) -> float:
    there, _ = target.places.query(source.points[source.sample] @ rotation.T + shift)
    back, _ = cKDTree(source.points).query((target.outline.points[target.outline.sample] - shift) @ rotation)
    squares = [np.mean(np.minimum(distance, FURTHEST) ** 2) for distance in (there, back)]
    return float(np.sqrt(np.mean(squares)))


@dataclass(frozen=True, eq=False)
class MedialWall:
    """The plane normal·p = offset along a medial wall, in the unit of the points, with its outward unit normal (3,).

    `error_deg` is the standard error of the normal about each axis across it.
    """

    normal: Floats
    offset: float
    error_deg: float


def medial_wall(points: Floats, normals: Floats, areas: Floats, start: Floats) -> MedialWall:
    """Returns the plane along the medial wall, which faces about the unit vector `start`.

    `points` and `normals` (n, 3) are relative to the hemisphere's size; `areas` (n,) are those that belong to them.
    """
    facing = normals @ start > COSINE
    points, normals, total, areas = points[facing], normals[facing], areas.sum(), areas[facing]
    normal: NDArray = start
    for width in CUT_WIDTHS_DEG:
        for _ in range(6):
            normal = unit((normals * (areas * _bell(_degrees(normals @ normal) / width))[:, None]).sum(axis=0)[None])[0]
    heights = points @ normal
    offset = float(np.median(heights[np.abs(heights - _densest(heights, areas)) < 0.02]))
    cut = (_degrees(normals @ normal) < CUT_DEG) & (np.abs(heights - offset) < CUT_DEPTH)
    if areas[cut].sum() > CUT_SHARE * total:
        return MedialWall(normal, float(np.median(heights[cut])), CUT_ERROR_DEG)
    normal = start
    offset = _densest(points @ normal, areas)
    for width in WIDTHS:
        for _ in range(5):
            weights = areas * _bell((points @ normal - offset) / (3.0 * width))
            centre = np.average(points, axis=0, weights=weights)
            _, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
            normal = axes[:, 0] * np.sign(axes[:, 0] @ normal)
            offset = float(centre @ normal)
    return MedialWall(normal, offset, FITTED_ERROR_DEG)


def _bell(away: NDArray) -> NDArray:
    """Returns Tukey's biweight: 1 at 0, 0 from ±1 on."""
    return np.where(np.abs(away) < 1.0, (1.0 - away**2) ** 2, 0.0)


def _degrees(cosines: NDArray) -> NDArray:
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))))


def _densest(heights: Floats, areas: Floats) -> float:
    """Returns the height around which the most area lies."""
    counts, edges = np.histogram(heights, bins=np.arange(heights.min(), heights.max() + 0.02, 0.01), weights=areas)
    return float(edges[counts.argmax()] + 0.005)
