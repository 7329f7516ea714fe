"""Hemispheres posed by their shape: each on the reference, its medial wall upright, and both sides of a brain alike.

Left hemispheres are mirrored, so that all are right ones here.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh, transformed, unit, vertex_areas, vertex_normals
from gyriflow.surface.outlines import Outline, outline, reference
from gyriflow.surface.registration import Fit, Target, found, registered

Floats = NDArray[np.float64]

MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
# the next best pose of a hemisphere has to fit worse by this factor, and the best one this well (in its size)
LEAST_CONFIDENCE, WORST_RESIDUAL = 1.1, 0.085
# two sides of one brain are mirror images as well as this
WORST_PAIR_RESIDUAL = 0.07
# how narrowly the medial wall is a plane, in sizes of the hemisphere, while it is looked for
WALL_WIDTHS = (0.10, 0.05, 0.03, 0.02, 0.012, 0.012)
WALL_COSINE = 0.85
# a wall that was cut along a plane: its normals are looked for ever more narrowly, and this part of the area has them
CUT_WIDTHS_DEG, CUT_SHARE = (40.0, 25.0, 15.0, 10.0, 7.0), 0.04
CUT_DEG, CUT_DEPTH = 5.0, 0.01
# the Sylvian dent is in front of the middle by so much of the hemisphere's size where it is to be told from the back
SYLVIAN_AHEAD = 0.05


@dataclass(frozen=True, eq=False)
class Half:
    """A hemisphere, mirrored where it is a left one, with what its shape says about its pose.

    Attributes
    ----------
    outline
        In the coordinates of the file (mirrored).
    rotation : (3, 3) float
        To RAS+: the medial wall faces −x, the pitch is the reference's.
    wall_mm : float
        Where the medial wall is then, along x from the centre of volume.
    residual, confidence : float
        Distance to the reference relative to the size, and how many times worse the next best pose is.
    sylvian : float
        How far in front of the middle the dents of the lateral side are, in sizes.
    """

    outline: Outline
    rotation: Floats
    wall_mm: float
    residual: float
    confidence: float
    sylvian: float


@dataclass(frozen=True, eq=False)
class Pair:
    """The hemispheres of a brain, of one pitch, and the fit of the left outline on the right one."""

    left: Half
    right: Half
    fit: Fit

    @property
    def offset_mm(self) -> Floats:
        """The left centre of volume less the right one, mirrored, once both are posed; (3,) in mm."""
        return np.asarray(self.right.rotation @ self.fit.shift * self.right.outline.size_mm)


def pair_by_shape(left: TriangleMesh, right: TriangleMesh, path: str | None = None) -> Pair:
    """Returns the poses that the shapes of two closed, outward surfaces say; `path` is for messages.

    InputError where a hemisphere fits the reference badly or in more than one way, where the two are no mirror images
    of each other, and where they seem to be swapped.
    """
    halves = [_half(transformed(left, MIRROR), "left", path), _half(right, "right", path)]
    one, other = halves
    fit = registered(one.outline, Target(other.outline), other.rotation.T @ one.rotation)
    if fit.residual > WORST_PAIR_RESIDUAL:
        raise InputError(
            "the hemispheres are no mirror images of each other",
            path=path,
            found=f"a mean distance of {fit.residual:.3f} of their size between one and the other's mirror image",
            expected=f"at most {WORST_PAIR_RESIDUAL}",
            remedy="Give both hemispheres of one subject and week. Are both files of the same side?",
        )
    ahead = [half.sylvian for half in halves]
    if min(ahead) < -SYLVIAN_AHEAD and max(ahead) > SYLVIAN_AHEAD:
        raise InputError(
            "both hemispheres seem to be of one side",
            path=path,
            found=f"the Sylvian fissure {ahead[0]:+.2f} (left) and {ahead[1]:+.2f} (right) of the size off the middle",
            expected="in front of the middle in both, mirrored",
            remedy="Give one left and one right hemisphere.",
        )
    if np.mean(ahead) < -SYLVIAN_AHEAD:
        raise InputError(
            "the hemispheres seem to be swapped",
            path=path,
            found=f"the Sylvian fissure {-np.mean(ahead):.2f} of the size behind the middle",
            expected="in front of the middle",
            remedy="Swap `left` and `right`; or, if they are right, pose the files yourself and set coordinates: ras.",
        )
    # both sides get the same pitch, half-way between what each says
    apart = pitch_deg(other.rotation @ fit.rotation @ one.rotation.T)
    turns = (0.5 * apart, -0.5 * apart)
    one, other = (replace(half, rotation=about_x(by) @ half.rotation) for half, by in zip(halves, turns, strict=True))
    return Pair(one, other, fit)


def about_x(angle_deg: float) -> Floats:
    """Returns the (3, 3) rotation about x, from y to z, by an angle in degrees."""
    return Rotation.from_euler("x", angle_deg, degrees=True).as_matrix()


def pitch_deg(rotation: Floats) -> float:
    """Returns the angle in degrees of the rotation about x that is nearest to a (3, 3) rotation."""
    block = rotation[1:, 1:]
    return float(np.degrees(np.arctan2(block[1, 0] - block[0, 1], block[0, 0] + block[1, 1])))


def _half(mesh: TriangleMesh, side: str, path: str | None) -> Half:
    shape = outline(mesh)
    fit, confidence = found(shape, Target(reference()))
    if confidence < LEAST_CONFIDENCE or fit.residual > WORST_RESIDUAL:
        raise InputError(
            f"the pose of the {side} hemisphere cannot be told from its shape",
            path=path,
            found=f"a residual of {fit.residual:.3f}, the next best pose {confidence:.2f} times worse",
            expected=f"at most {WORST_RESIDUAL}, at least {LEAST_CONFIDENCE} times",
            remedy="Is it a cerebral hemisphere's closed pial surface? If so, pose it and set coordinates: ras or lps.",
        )
    points = np.asarray((mesh.vertices - shape.centre) / shape.size_mm, dtype=np.float64)
    start = np.asarray(-fit.rotation[0], dtype=np.float64)
    normal, offset = _medial_wall(points, vertex_normals(mesh), vertex_areas(mesh), start)
    turn, _ = Rotation.align_vectors([[-1.0, 0.0, 0.0]], [fit.rotation @ normal])
    rotation = turn.as_matrix() @ fit.rotation
    rotation = about_x(pitch_deg(fit.rotation @ rotation.T)) @ rotation
    ahead = _sylvian(points @ rotation.T, vertex_areas(mesh))
    return Half(shape, rotation, -offset * shape.size_mm, fit.residual, confidence, ahead)


def _medial_wall(points: Floats, normals: Floats, areas: Floats, start: Floats) -> tuple[Floats, float]:
    """Returns the outward unit normal and the offset of the plane along the medial wall, which faces about `start`.

    It is the plane of the cut where the hemispheres were cut apart, else one fitted to the most of the wall.
    """
    facing = normals @ start > WALL_COSINE
    points, normals, total, areas = points[facing], normals[facing], areas.sum(), areas[facing]
    normal: NDArray = start
    for width in CUT_WIDTHS_DEG:
        for _ in range(6):
            normal = unit((normals * (areas * _bell(_degrees(normals @ normal) / width))[:, None]).sum(axis=0)[None])[0]
    offset = _densest(points @ normal, areas)
    cut = (_degrees(normals @ normal) < CUT_DEG) & (np.abs(points @ normal - offset) < CUT_DEPTH)
    if areas[cut].sum() > CUT_SHARE * total:
        return normal, float(np.median(points[cut] @ normal))
    normal = start
    offset = _densest(points @ normal, areas)
    for width in WALL_WIDTHS:
        for _ in range(5):
            weights = areas * _bell((points @ normal - offset) / (3.0 * width))
            centre = np.average(points, axis=0, weights=weights)
            _, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
            normal = axes[:, 0] * np.sign(axes[:, 0] @ normal)
            offset = float(centre @ normal)
    return normal, offset


def _bell(away: NDArray) -> NDArray:
    """Returns Tukey's biweight: 1 at 0, 0 from ±1 on."""
    return np.where(np.abs(away) < 1.0, (1.0 - away**2) ** 2, 0.0)


def _degrees(cosines: NDArray) -> NDArray:
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))))


def _densest(heights: Floats, areas: Floats) -> float:
    """Returns the height around which the most area lies."""
    counts, edges = np.histogram(heights, bins=np.arange(heights.min(), heights.max() + 0.02, 0.01), weights=areas)
    return float(edges[counts.argmax()] + 0.005)


def _sylvian(points: Floats, areas: Floats) -> float:
    """Returns how far in front of the middle the lateral side of posed points is deep below their convex hull."""
    planes = ConvexHull(points).equations
    depth = np.concatenate(
        [-(part @ planes[:, :3].T + planes[:, 3]).max(axis=1) for part in np.array_split(points, 50)]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    lateral = points[:, 0] > low[0] + 0.3 * (high[0] - low[0])
    weights = areas * lateral * np.maximum(depth - 0.03, 0.0) ** 2
    if not weights.any():
        return 0.0
    return float(np.average(points[:, 1], weights=weights) - 0.5 * (low[1] + high[1]))
