"""Poses by shape, hindbrain and sides: of hemispheres, of both sides of a brain alike, of all brains of a study.

Where files are well posed, they keep their pose. Left hemispheres are mirrored here, so that all are right ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import Fit, angle_deg, motion
from ..geometry.poses import CONVENTIONS, Pose, turned
from ..geometry.triangles import TriangleMesh, transformed, vertex_areas, vertex_normals
from ..parameters.schemes import LabelScheme
from ..parameters.terms import SIDES
from .fissure import mid_plane
from .outlines import (
    Outline,
    Target,
    medial_wall,
    outline,
    reference,
    register,
    register_deformed,
    register_from_all_sides,
)
from .plausible import USUAL, Limits

Floats = NDArray[np.float64]
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
# the next best pose of a hemisphere has to fit worse by this factor, and the best one this well (in its size)
LEAST_CONFIDENCE, WORST_RESIDUAL = 1.1, 0.085
# two sides of one brain are mirror images as well as this times the asymmetry allowed
PAIR_RESIDUAL_PER_ASYMMETRY = 3.5
# a fit of one side on the other is off by about this many degrees per residual, about each axis
ERROR_DEG_PER_RESIDUAL = 50.0
# beside the shape, poses near these axes of files are likely
CONVENTION_DEG = 35.0
# two hemispheres side by side have their centres this far apart, in sizes
APART = 0.4
# how many other brains of the study are consulted for the pose of a doubtful one
OTHERS = 2
# how far, in sizes of the hemisphere, the Sylvian dent must be in front of the middle for front and back to be clear
SYLVIAN_AHEAD = 0.05
# how well the shape has to agree with axes for the file to be in them: tilts (of the wall), and pitch, in degrees;
# the first is per residual of the hemispheres' fit, as the shape of an asymmetric brain says less
EXACT_DEG_PER_RESIDUAL, DECLARED_DEG, SAME_PITCH_DEG = 70.0, 10.0, 15.0
# files of one brain share their coordinates where their poses differ by less; distances are relative to the size
COMMON_DEG_PER_RESIDUAL, COMMON_OFFSET, COMMON_DISTANCE = 180.0, 0.08, 0.15
# hemispheres of one declared coordinate system stay as they are in it, if they are turned by less than this
DECLARED_TURN_DEG = 30.0
# the medial walls' distance from the mid-sagittal plane where the files do not say it
BESIDE_MM = 0.5
# how many smaller and larger brains each brain is registered with
NEIGHBOURS = 4
# the pitch is known to a degree or two
PITCH_STEP_DEG = 0.5
# decimals of what is reported: a rounded rotation moves no place of a brain by a micrometre
DIGITS = 6
# from the cerebrum's centre to those of cerebellum and brainstem, RAS+: means over weeks 21 to 34 of the example atlas
TO_CEREBELLUM = np.array([0.0, -0.58, -0.81])
TO_BRAINSTEM = np.array([0.0, -0.30, -0.95])
# how far they are at least, in cube roots of its volume: 0.37 and more in weeks 21 to 36
LEAST_OUTSIDE = 0.25
# left and right of the labels weigh as much as the hindbrain does
TO_RIGHT = np.array([1.0, 0.0, 0.0])
# brains turned by less stand as their files say: this is how far atlases and scans differ
LEAST_TURN_DEG = 60.0
# brains turned by more, up to that, are kept and told: atlases and scans rarely differ as much
DOUBTFUL_TURN_DEG = 15.0
PITCH_KEPT = "its mid-plane is set upright, its pitch is kept; check the file's axes"
# told of volumes without labelled sides, which tell a turned brain from a mirrored one
OR_MIRRORED = "if its array has an axis reversed or two exchanged instead, left and right are exchanged now: check them"
# two directions nearer to each other than this (in radians) say nothing of the turn about them
LEAST_SPREAD = 0.06
# a brain that is turned is turned by quarters, as wrong axis codes do, where these are as near as this
QUARTERS_DEG = 15.0


@dataclass(frozen=True, eq=False)
class Hemisphere:
    """A hemisphere, mirrored where it is a left one, with what its shape says about its pose.

    The outline is in the (mirrored) coordinates of the file. `rotation` (3, 3) leads to RAS+: the medial wall faces −x,
    at `wall_mm` along x from the centre of volume, and the pitch is the reference's; `wall_error_deg` is by how much
    the wall's normal may be off. `residual` is the distance to the reference relative to the size, `confidence` how
    many times worse the next best pose is, `sylvian` how far in front of the middle the lateral dents are, in sizes.
    """

    outline: Outline
    rotation: Floats
    wall_mm: float
    wall_error_deg: float
    residual: float
    confidence: float
    sylvian: float

    @property
    def is_clear(self) -> bool:
        """Whether the shape alone says the pose."""
        return self.confidence >= LEAST_CONFIDENCE and self.residual <= WORST_RESIDUAL


@dataclass(frozen=True, eq=False)
class Pair:
    """The hemispheres of a brain, of one pitch, and the fit of the left outline on the right one."""

    left: Hemisphere
    right: Hemisphere
    fit: Fit

    @property
    def both(self) -> tuple[Hemisphere, Hemisphere]:
        """The left and the right hemisphere."""
        return self.left, self.right

    @property
    def size_mm(self) -> float:
        """The mean size of the hemispheres."""
        return float(np.mean([hemisphere.outline.size_mm for hemisphere in self.both]))


def pair_by_shape(left: TriangleMesh, right: TriangleMesh, limits: Limits = USUAL, others: Sequence[Pair] = ()) -> Pair:
    """Returns the poses that the shapes of two closed, outward surfaces say, with further evidence where in doubt.

    Where the shape of a hemisphere fits the reference nearly as well in another pose, that is chosen which is near RAS
    or LPS in both files and has the left hemisphere on the left; else the one in which it fits the most alike of
    `others` clearly best, hemispheres of the same study. InputError where a hemisphere fits badly or still in more than
    one way, where the two are no mirror images of each other, and where they seem to be swapped.
    """
    right_sided = [transformed(left, MIRROR), right]
    hemispheres = [hemisphere_by_shape(mesh) for mesh in right_sided]
    if not all(hemisphere.is_clear for hemisphere in hemispheres):
        hemispheres = (
            _near_a_convention(right_sided, hemispheres)
            or _like_others(right_sided, hemispheres, others)
            or [_require_clear(hemisphere, side) for hemisphere, side in zip(hemispheres, SIDES, strict=True)]
        )
    one, other = hemispheres
    fit = register_deformed(Target(one.outline), Target(other.outline), other.rotation.T @ one.rotation)
    worst = PAIR_RESIDUAL_PER_ASYMMETRY * limits.max_asymmetry
    if fit.residual > worst:
        raise InputError(
            "the hemispheres are no mirror images of each other",
            found=f"a mean distance of {fit.residual:.3f} of their size between one and the other's mirror image",
            expected=f"at most {worst:.3f}",
            remedy="Give both hemispheres of one subject and week. Are both files of the same side? If they are so "
            "asymmetric, raise surface.max_asymmetry.",
        )
    ahead = [hemisphere.sylvian for hemisphere in hemispheres]
    if min(ahead) < -SYLVIAN_AHEAD and max(ahead) > SYLVIAN_AHEAD:
        raise InputError(
            "both hemispheres seem to be of one side",
            found=f"the Sylvian fissure {ahead[0]:+.2f} (left) and {ahead[1]:+.2f} (right) of the size off the middle",
            expected="in front of the middle in both, mirrored",
            remedy="Give one left and one right hemisphere.",
        )
    if np.mean(ahead) < -SYLVIAN_AHEAD:
        raise InputError(
            "the hemispheres seem to be swapped",
            found=f"the Sylvian fissure {-np.mean(ahead):.2f} of the size behind the middle",
            expected="in front of the middle",
            remedy="Swap `left` and `right`; or, if they are right, pose the files yourself and set coordinates: ras.",
        )
    one, other = (
        replace(hemisphere, rotation=turn.as_matrix() @ hemisphere.rotation)
        for hemisphere, turn in zip(hemispheres, _reconcile(one, other, fit), strict=True)
    )
    return Pair(one, other, fit)


def _reconcile(one: Hemisphere, other: Hemisphere, fit: Fit) -> tuple[Rotation, Rotation]:
    """Returns the rotations of both hemispheres that agree best with the fit and their medial walls.

    Least squares of three measures: each wall's tilts and the fit, by their errors. The walls say nothing about the
    pitch: each hemisphere gets the one half-way between the two.
    """
    apart = Rotation.from_matrix(other.rotation @ fit.rotation @ one.rotation.T).as_rotvec()
    walls = np.array([one.wall_error_deg, other.wall_error_deg]) ** 2
    first, second = walls / (walls.sum() + (ERROR_DEG_PER_RESIDUAL * fit.residual) ** 2)
    shares = np.array([[0.5, first, first], [-0.5, -second, -second]])
    turn, back = Rotation.from_rotvec(apart * shares)
    return turn, back


def about_x(angle_deg: float) -> Floats:
    """Returns the (3, 3) rotation about x, from y to z, by an angle in degrees."""
    return Rotation.from_euler("x", angle_deg, degrees=True).as_matrix()


def pitch_deg(rotation: Floats) -> float:
    """Returns the angle in degrees of the rotation about x that is nearest to a (3, 3) rotation."""
    block = rotation[1:, 1:]
    return float(np.degrees(np.arctan2(block[1, 0] - block[0, 1], block[0, 0] + block[1, 1])))


def _require_clear(hemisphere: Hemisphere, side: str) -> Hemisphere:
    if hemisphere.is_clear:
        return hemisphere
    raise InputError(
        f"the pose of the {side} hemisphere cannot be determined from its shape",
        found=f"a residual of {hemisphere.residual:.3f}, the next best pose {hemisphere.confidence:.2f} times worse",
        expected=f"at most {WORST_RESIDUAL}, at least {LEAST_CONFIDENCE} times; or a pose near RAS or LPS",
        remedy="Is it a cerebral hemisphere's closed pial surface? If so, pose it and set coordinates: ras or lps.",
    )


def _near_a_convention(meshes: list[TriangleMesh], hemispheres: list[Hemisphere]) -> list[Hemisphere]:
    """Returns both hemispheres posed from RAS or from LPS axes; empty where the two do not agree with one of these.

    They agree where each fits the reference nearly as well as in its best pose, at no more than 35° from these axes,
    and the left one is on the left. Few random poses are so near: this is evidence where the shape leaves a choice.
    """
    for axes in (convention[:3, :3] for convention in CONVENTIONS.values()):
        posed = []
        for mesh, best in zip(meshes, hemispheres, strict=True):
            fit = register(best.outline, Target(reference()), axes)
            nearly = fit.residual < LEAST_CONFIDENCE * best.residual and fit.residual <= WORST_RESIDUAL
            if nearly and angle_deg(fit.rotation @ axes.T) < CONVENTION_DEG:
                posed.append(_describe(mesh, best.outline, fit, best.confidence))
        # the left one is mirrored, so that both are to be right of the middle
        across = [(axes @ hemisphere.outline.centre)[0] for hemisphere in posed]
        if len(posed) == 2 and sum(across) > APART * posed[0].outline.size_mm:
            return posed
    return []


def _like_others(meshes: list[TriangleMesh], hemispheres: list[Hemisphere], others: Sequence[Pair]) -> list[Hemisphere]:
    """Returns hemispheres posed like those of another brain, the most alike in size; empty where that is doubtful."""
    posed: list[Hemisphere] = []
    for mesh, best, side in zip(meshes, hemispheres, SIDES, strict=True):
        if best.is_clear:
            posed.append(best)
            continue
        known = [getattr(pair, side) for pair in others]
        known.sort(key=lambda hemisphere: abs(np.log(hemisphere.outline.size_mm / best.outline.size_mm)))
        for other in known[:OTHERS]:
            fit, confidence = register_from_all_sides(best.outline, Target(other.outline))
            if confidence >= LEAST_CONFIDENCE and fit.residual <= WORST_RESIDUAL:
                turned = Fit(other.rotation @ fit.rotation, fit.shift, fit.residual)
                posed.append(_describe(mesh, best.outline, turned, confidence))
                break
    return posed if len(posed) == 2 else []


def hemisphere_by_shape(mesh: TriangleMesh) -> Hemisphere:
    """Returns the pose of a right hemisphere (or a mirrored left one) that its shape says, however doubtful."""
    shape = outline(mesh)
    return _describe(mesh, shape, *register_from_all_sides(shape, Target(reference())))


def _describe(mesh: TriangleMesh, shape: Outline, fit: Fit, confidence: float) -> Hemisphere:
    """Returns a hemisphere whose fit on the reference is known, its medial wall upright."""
    points = np.asarray((mesh.vertices - shape.centre) / shape.size_mm, dtype=np.float64)
    start = np.asarray(-fit.rotation[0], dtype=np.float64)
    areas = vertex_areas(mesh)
    wall = medial_wall(points, vertex_normals(mesh), areas, start)
    turn, _ = Rotation.align_vectors([[-1.0, 0.0, 0.0]], [fit.rotation @ wall.normal])
    rotation = turn.as_matrix() @ fit.rotation
    rotation = about_x(pitch_deg(fit.rotation @ rotation.T)) @ rotation
    # of the surface the sulci may outweigh the Sylvian fissure, of the outline it may be shallow
    both = (points, areas), (shape.points, np.ones(len(shape.points)))
    ahead = float(np.mean([_sylvian(places @ rotation.T, weights) for places, weights in both]))
    return Hemisphere(shape, rotation, -wall.offset * shape.size_mm, wall.error_deg, fit.residual, confidence, ahead)


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


def pairs_by_shape(
    brains: Sequence[tuple[TriangleMesh, TriangleMesh]], limits: Limits = USUAL
) -> list[Pair | InputError]:
    """Returns what `pair_by_shape` says of each brain of a study, or why it is refused.

    Those that are doubtful alone are posed like the others, once the poses of these are known.
    """

    def posed(left: TriangleMesh, right: TriangleMesh, others: Sequence[Pair] = ()) -> Pair | InputError:
        try:
            return pair_by_shape(left, right, limits, others)
        except InputError as error:
            return error

    found = [posed(*brain) for brain in brains]
    known = [pair for pair in found if isinstance(pair, Pair)]
    return [
        pair if isinstance(pair, Pair) or not known else posed(*brain, known)
        for pair, brain in zip(found, brains, strict=True)
    ]


def poses(pairs: Sequence[Pair], declared: Sequence[bool]) -> list[Pose]:
    """Returns the poses of the brains of one study, given what `pair_by_shape` says of each.

    Shape gives each hemisphere's pose except for the pitch, in which brains of different age differ: for the pitch they
    are registered with each other. Where hemispheres share coordinates of which one axis is exactly left-right, and
    shape says that these are RAS or LPS, they keep the file's pose, and the other brains follow them; else the
    reference shape's pitch is zero. The mid-sagittal plane is x = 0. For brains where `declared` holds, whose files
    name their coordinate system, the axis need not be exact.
    """
    frames = [_frame(pair, named) for pair, named in zip(pairs, declared, strict=True)]
    pitches, places = _pitches(pairs, frames), _places(pairs, frames)
    return [_make_pose(*brain) for brain in zip(pairs, frames, declared, pitches, places, strict=True)]


def _make_pose(pair: Pair, frame: str | None, declared: bool, pitch: float, place: Floats) -> Pose:
    residual, confidence, ahead = (
        {side: round(getattr(hemisphere, name), DIGITS) for side, hemisphere in zip(SIDES, pair.both, strict=True)}
        for name in ("residual", "confidence", "sylvian")
    )
    evidence = {
        "coordinates": frame,
        "pitch_deg": pitch,
        "residual": residual,
        "confidence": confidence,
        "mirror_residual": round(pair.fit.residual, DIGITS),
        "sylvian_ahead": ahead,
    }
    unclear = "left and right are taken from the configuration: the shapes do not show whether the files are swapped"
    warnings = (unclear,) if np.mean(list(ahead.values())) < SYLVIAN_AHEAD else ()
    if frame:
        left = right = CONVENTIONS[frame]
    else:
        left, right = _separate(pair, pitch, place)
        if _share_coordinates(pair, declared):
            left = right = _mean_motion(left, right, pair)
    # a pose that is the same but for round-off is the same file
    together, left, right = left is right, left.round(DIGITS), right.round(DIGITS)
    whole = left if together else np.eye(4)
    # volumes of the brain are in RAS+
    world = whole @ CONVENTIONS[frame] if frame else whole
    files = {"left": left, "right": right, "whole": whole}
    return Pose(world, files, "file" if frame else "shape", together, evidence, warnings)


def _separate(pair: Pair, pitch: float, place: Floats) -> tuple[Floats, Floats]:
    """Returns the motions that put the medial walls beside x = 0 and the centres around `place` (y and z)."""
    # the left centre of volume less the right one, mirrored, once both are posed
    offset = pair.right.rotation @ pair.fit.shift * pair.right.outline.size_mm
    motions = []
    for hemisphere, sign in ((pair.left, 0.5), (pair.right, -0.5)):
        rotation = about_x(pitch) @ hemisphere.rotation
        target = np.zeros(3)
        target[1:] = place + sign * (about_x(pitch) @ offset)[1:]
        target[0] = BESIDE_MM - hemisphere.wall_mm
        motions.append(motion(rotation, target - rotation @ hemisphere.outline.centre))
    return MIRROR @ motions[0] @ MIRROR, motions[1]


def _share_coordinates(pair: Pair, declared: bool) -> bool:
    """Returns whether the files have both hemispheres where one rigid motion brings them to a brain.

    Files that name one coordinate system do, unless the shapes are turned against each other beyond doubt.
    """
    left, right = _separate(pair, 0.0, np.zeros(2))
    if declared and angle_deg(right[:3, :3].T @ left[:3, :3]) < DECLARED_TURN_DEG:
        return True
    if angle_deg(right[:3, :3].T @ left[:3, :3]) > COMMON_DEG_PER_RESIDUAL * pair.fit.residual:
        return False
    centre = MIRROR[:3, :3] @ pair.left.outline.centre
    away = np.abs((right - left)[:3, :3] @ centre + (right - left)[:3, 3]) / pair.right.outline.size_mm
    return bool(away[0] < COMMON_DISTANCE and np.linalg.norm(away[1:]) < COMMON_OFFSET)


def _mean_motion(left: Floats, right: Floats, pair: Pair) -> Floats:
    """Returns one motion half-way between two, measured at the brain's centre."""
    centre = 0.5 * (MIRROR[:3, :3] @ pair.left.outline.centre + pair.right.outline.centre)
    rotation = Rotation.from_matrix([left[:3, :3], right[:3, :3]]).mean().as_matrix()
    there = 0.5 * sum(side[:3, :3] @ centre + side[:3, 3] for side in (left, right))
    return motion(rotation, there - rotation @ centre)


def _frame(pair: Pair, declared: bool) -> str | None:
    """Returns "ras" or "lps" where both files are in these coordinates, to the accuracy of the shape, else None."""
    if not _share_coordinates(pair, declared):
        return None
    for name, axes in CONVENTIONS.items():
        turns = [hemisphere.rotation @ axes[:3, :3].T for hemisphere in pair.both]
        # mirrored files have the same axes up to signs, which cancel
        tilts = [np.degrees(np.arccos(np.clip(turn[0, 0], -1.0, 1.0))) for turn in turns]
        most = max(DECLARED_DEG if declared else 0.0, EXACT_DEG_PER_RESIDUAL * pair.fit.residual)
        if np.mean(tilts) < most and max(abs(pitch_deg(turn)) for turn in turns) < SAME_PITCH_DEG:
            return name
    return None


def _pitches(pairs: Sequence[Pair], frames: list[str | None]) -> list[float]:
    """Returns the pitch of each brain in degrees, beyond its shape's.

    Brains next to each other in size are registered, and least squares make of this one pitch for each. Where files
    say the pitch of some brains, the difference is interpolated over the logarithm of size: brains change as they grow.
    It is rounded, so that a brain hardly ever moves where another one of the study is changed or added.
    """
    if not pairs:
        return []
    sizes = np.log([pair.size_mm for pair in pairs])
    rank = np.argsort(np.argsort(sizes))
    rows, values = [], []
    unit_rows = np.eye(len(pairs))
    for i, j in combinations(range(len(pairs)), 2):
        if abs(rank[i] - rank[j]) <= NEIGHBOURS:
            turn, weight = _register_pair(pairs[i], pairs[j])
            rows.append(weight * (unit_rows[i] - unit_rows[j]))
            values.append(weight * turn)
    for row, pair in zip(unit_rows, pairs, strict=True):
        rows.append(row / np.mean([hemisphere.residual for hemisphere in pair.both]) ** 2)
        values.append(0.0)
    solution = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]
    known = []
    for size, pair, frame, found in zip(sizes, pairs, frames, solution, strict=True):
        if frame:
            in_file = [pitch_deg(CONVENTIONS[frame][:3, :3] @ hemisphere.rotation.T) for hemisphere in pair.both]
            known.append((size, float(np.mean(in_file)) - found))
    if known:
        at, differences = np.array(sorted(known)).T
        solution = solution + np.interp(sizes, at, differences)
    return [PITCH_STEP_DEG * round(float(value) / PITCH_STEP_DEG) for value in solution]


def _register_pair(one: Pair, other: Pair) -> tuple[float, float]:
    """Returns the pitch of one brain beyond the other's with which they lie alike, and the result's weight."""
    turns, residuals = [], []
    for a, b in zip(one.both, other.both, strict=True):
        fit = register(a.outline, Target(b.outline), b.rotation.T @ a.rotation)
        turns.append(pitch_deg(b.rotation @ fit.rotation @ a.rotation.T))
        residuals.append(fit.residual)
    return float(np.mean(turns)), float(np.mean(residuals)) ** -2


def _places(pairs: Sequence[Pair], frames: list[str | None]) -> list[Floats]:
    """Returns where the centres of the brains come to lie in the sagittal plane; (2,) in mm.

    In proportion to size as far from the origin as in the brains that are posed by their files; else at the origin.
    """
    known = []
    for pair, frame in zip(pairs, frames, strict=True):
        if frame:
            centres = [CONVENTIONS[frame][:3, :3] @ hemisphere.outline.centre for hemisphere in pair.both]
            known.append([pair.size_mm, *(np.mean(centres, axis=0)[1:] / pair.size_mm)])
    if not known:
        return [np.zeros(2) for _ in pairs]
    sizes, *centres = np.array(sorted(known)).T
    return [pair.size_mm * np.array([np.interp(pair.size_mm, sizes, values) for values in centres]) for pair in pairs]


def pose_of_labels(labels: NDArray[np.integer], affine: Floats, scheme: LabelScheme) -> Pose | None:
    """Returns the pose from cerebellum, brainstem and labelled sides; None where too few of them are labelled.

    It is the file's where the two differ by less than 60°, with a warning from 15° on. InputError where the labels of
    left and right are mirrored: no rotation brings them to their sides.
    """
    centres = {
        name: affine[:3, :3] @ np.argwhere(np.isin(labels, numbers)).mean(axis=0)
        for name, numbers in (
            ("cerebrum", scheme.cerebrum),
            ("cerebellum", scheme.cerebellum),
            ("brainstem", scheme.brainstem),
            ("left", scheme.left),
            ("right", scheme.right),
        )
        if np.isin(labels, numbers).any()
    }
    expected = {"cerebellum": TO_CEREBELLUM, "brainstem": TO_BRAINSTEM}
    found = {name: centres[name] - centres["cerebrum"] for name in expected if name in centres}
    size = float(np.cbrt(np.isin(labels, scheme.cerebrum).sum() * abs(np.linalg.det(affine[:3, :3]))))
    for name, way in found.items():
        if (share := float(np.linalg.norm(way)) / size) < LEAST_OUTSIDE:
            raise InputError(
                f"what the scheme {scheme.name!r} calls the {name} lies inside what it calls the cerebrum",
                found=f"its centre {share:.2f} of the cerebrum's size (the cube root of its volume) from the middle",
                expected=f"{LEAST_OUTSIDE} or more",
                remedy="Choose the scheme of this volume.",
            )
    rotation = None
    if len(found) == 2:
        theirs, ours = (
            (np.cross(*pair), _unit(pair[0] + pair[1]))
            for pair in ([_unit(v) for v in found.values()], [*expected.values()])
        )
        # the brainstem is in front of the cerebellum, so that the cross product points to the right; where both lie in
        # one direction, they say nothing of the turn about it
        if np.linalg.norm(theirs[0]) >= LEAST_SPREAD:
            rotation = _turn_onto([(_unit(theirs[0]), _unit(ours[0])), (theirs[1], ours[1])])
    sides = _unit(centres["right"] - centres["left"]) if {"left", "right"} <= set(centres) else None
    if sides is not None and found:
        hindbrain = [(_unit(found[name]), expected[name]) for name in found]
        turn, mirrored = (_turn_onto([(one, TO_RIGHT), *hindbrain]) for one in (sides, -sides))
        if _is_mirrored(turn, mirrored) if rotation is None else (rotation @ sides)[0] < 0:
            raise InputError(
                "labels of the left hemisphere lie on the right",
                found=f"the sides are the wrong way round with {' and '.join(found)} below and behind",
                expected="left at the smaller x (RAS+)",
                remedy="The volume's affine mirrors the brain, or the scheme's sides are swapped.",
            )
        rotation = turn
    if rotation is None:
        return None
    by = " and ".join([*found, *(["the labelled sides"] if sides is not None else [])])
    rotation = _turn_by_quarters(rotation)
    angle = angle_deg(rotation)
    if angle >= LEAST_TURN_DEG:
        said = f"the brain was turned by {angle:.0f}°, as {by} say: its affine has other axes"
        return turned(rotation, by, "ras", said if sides is not None else f"{said}; {OR_MIRRORED}")
    doubt = f"{by} say that the brain is turned by about {angle:.0f}°: {PITCH_KEPT}"
    return Pose(warnings=(doubt,) if angle > DOUBTFUL_TURN_DEG else ())


def pose_of_surface(mesh: TriangleMesh) -> tuple[Floats, float, float, float]:
    """Returns the rotation (3, 3) to RAS+ from a whole brain's shape, and how sure it is.

    The brain is cut in its plane of mirror symmetry and one side is posed as a hemisphere. The second value is how many
    times worse the next best pose of it is, which decides up and down; the third how far the Sylvian fissures are in
    front of the middle, in sizes, which decides front and back; the fourth how many times worse than the best pose
    that of RAS+ coordinates is, infinite where it leads away from RAS+.
    """
    plane = mid_plane(mesh, search_deg=90.0)
    body = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=int))
    cut = body.clip_closed_surface(normal=plane.normal, origin=plane.offset * plane.normal).triangulate().clean()
    side = TriangleMesh(cut.points, cut.regular_faces)
    one = hemisphere_by_shape(side)
    mirrored = transformed(side, MIRROR)
    is_right = float(side.vertices[:, 0].mean() - mesh.vertices[:, 0].mean()) > 0
    as_given = one if is_right else hemisphere_by_shape(mirrored)
    fit = register(as_given.outline, Target(reference()), np.eye(3))
    near = angle_deg(fit.rotation) < CONVENTION_DEG
    ras = fit.residual / as_given.residual if near else float("inf")
    rotation, sylvian = one.rotation, one.sylvian
    if sylvian < 0:
        # it is the left hemisphere: front and back change places
        other = as_given if not is_right else hemisphere_by_shape(mirrored)
        mirror = MIRROR[:3, :3]
        rotation, sylvian = mirror @ other.rotation @ mirror, max(other.sylvian, -sylvian)
        one = other
    # its medial wall is the plane of symmetry
    normal = plane.normal * np.sign((rotation @ plane.normal)[0])
    turn, _ = Rotation.align_vectors([[1.0, 0.0, 0.0]], [rotation @ normal])
    return turn.as_matrix() @ rotation, one.confidence, sylvian, ras


def pose_surface_by_shape(mesh: TriangleMesh, coordinates: str) -> Pose:
    """Returns the pose of a whole brain's surface, in coordinates that the user names or leaves to "auto".

    Named coordinates are kept, with a warning where the shape clearly contradicts them. InputError where the pose
    must come from the shape and is ambiguous.
    """
    rotation, confidence, sylvian, ras = pose_of_surface(mesh)
    ahead = sylvian >= SYLVIAN_AHEAD
    sure, angles = confidence >= LEAST_CONFIDENCE and ahead, _angles(rotation)
    nearest = min(angles, key=lambda name: angles[name])
    if coordinates != "auto":
        doubts = _against(coordinates, angles, "brain") if sure else []
        return _in_axes(coordinates, "configuration", *doubts)
    if angles[nearest] < CONVENTION_DEG:
        if ahead:
            said = () if nearest == "ras" else (f"the shape says that the coordinates are {nearest.upper()}",)
            return _in_axes(nearest, "shape", *said)
        return Pose(
            by="default",
            warnings=("the shape leaves front and back open: the coordinates were taken as RAS+; set coordinates",),
        )
    if not sure and ras < LEAST_CONFIDENCE:
        doubt = "the shape fits other poses as well as RAS+, in which the coordinates were taken: check the pose"
        return Pose(by="default", warnings=(doubt,))
    if not sure:
        raise InputError(
            "the pose of the brain cannot be determined from its shape",
            found=f"axes {angles[nearest]:.0f}° off {nearest.upper()}, the next best pose {confidence:.2f} times "
            f"worse, the Sylvian fissures {sylvian:+.2f} of the size in front of the middle",
            expected=f"RAS+ or LPS, or at least {LEAST_CONFIDENCE} times and {SYLVIAN_AHEAD:+.2f}",
            remedy="Pose it and set coordinates: ras or lps.",
        )
    return turned(rotation, "shape", "ras", f"the brain was turned by {angles['ras']:.0f}°, as its shape says")


def pose_of_volume_by_shape(mesh: TriangleMesh, sided: bool) -> Pose:
    """Returns the pose of a label volume from the surface of its cerebrum, in the coordinates of the volume.

    The file's is kept where the shape is within 60° of it or says none, with a warning. `sided` is whether labels say
    which side is which.
    """
    unchecked = Pose(warnings=("neither labels nor shape say how the brain lies: its pose is the file's, unchecked",))
    try:
        found = pose_surface_by_shape(mesh, "auto")
    except InputError:
        return unchecked
    if found.by == "default":
        return unchecked
    rotation = _turn_by_quarters(found.of_file()[:3, :3])
    angle = angle_deg(rotation)
    if angle >= LEAST_TURN_DEG:
        said = f"the brain was turned by {angle:.0f}°, as its shape says: its affine has other axes"
        return turned(rotation, "shape", "ras", said if sided else f"{said}; {OR_MIRRORED}")
    doubt = f"the shape says that the brain is turned by about {angle:.0f}°: {PITCH_KEPT}"
    return Pose(warnings=(doubt,) if angle > DOUBTFUL_TURN_DEG else ())


def pose_of_hemisphere(mesh: TriangleMesh, side: str, coordinates: str, *, of_volume: bool = False) -> Pose:
    """Returns the pose of a clean hemisphere that is alone, in coordinates "ras", "lps" or "auto".

    With "auto", the axes of the file are kept where its shape says that they are RAS or LPS within 35°, and its medial
    wall is then turned upright; else the shape's pose is taken. With `of_volume` it is the surface of a label volume,
    whose mistakes other volumes of the brain are taken to share. InputError where the pose is ambiguous, or the shape
    is that of the other side.
    """
    mirrored = side == "left"
    shape = hemisphere_by_shape(transformed(mesh, MIRROR) if mirrored else mesh)
    mirror = MIRROR[:3, :3] if mirrored else np.eye(3)
    rotation = mirror @ shape.rotation @ mirror
    clear, angles = shape.confidence >= LEAST_CONFIDENCE, _angles(rotation)
    nearest = min(angles, key=lambda name: angles[name])
    if coordinates == "auto" and clear and shape.sylvian < -SYLVIAN_AHEAD:
        raise InputError(
            f"the hemisphere seems to be the {'right' if mirrored else 'left'} one",
            found=f"the Sylvian fissure {-shape.sylvian:.2f} of the size behind the middle",
            expected="in front of the middle",
            remedy="Set the other side; or, if it is right, pose the file yourself and set coordinates: ras.",
        )
    doubts = []
    if shape.sylvian < SYLVIAN_AHEAD:
        doubts.append(f"the side, {side}, is taken from the configuration: it cannot be determined from the shape")
    if coordinates != "auto":
        doubts += _against(coordinates, angles, "hemisphere") if clear else []
        pose = _in_axes(coordinates, "configuration", *doubts)
    elif angles[nearest] < CONVENTION_DEG:
        axes = CONVENTIONS[nearest][:3, :3]
        # the smallest turn that sets the medial wall upright
        upright, _ = Rotation.align_vectors([[1.0, 0.0, 0.0]], [axes @ rotation.T @ np.array([1.0, 0.0, 0.0])])
        if nearest != "ras":
            doubts.append(f"the shape says that the coordinates are {nearest.upper()}")
        pose = turned(upright.as_matrix() @ axes, "file", "ras" if of_volume else nearest, *doubts)
    elif clear:
        doubts.append(f"the hemisphere was turned by {angles['ras']:.0f}°, as its shape says")
        pose = turned(rotation, "shape", "ras", *doubts)
    else:
        raise InputError(
            "the pose of the hemisphere cannot be determined from its shape",
            found=f"the next best pose {shape.confidence:.2f} times worse",
            expected=f"at least {LEAST_CONFIDENCE} times, or RAS or LPS",
            remedy="Pose it and set coordinates: ras or lps.",
        )
    return replace(pose, evidence={"confidence": shape.confidence, "sylvian_ahead": shape.sylvian})


def doubts_of_hemispheres(left: TriangleMesh, right: TriangleMesh, coordinates: str) -> list[str]:
    """Returns what the shapes of two hemispheres say against their sides and the coordinates, "ras" or "lps".

    The surfaces are in RAS+ already, if these are right. Files of the wrong side in the wrong one of the two still
    lie side by side, but with their Sylvian fissures behind the middle.
    """
    shapes = [hemisphere_by_shape(mesh) for mesh in (transformed(left, MIRROR), right)]
    clear = min(shape.confidence for shape in shapes) >= LEAST_CONFIDENCE
    turns = [angle_deg(shape.rotation) for shape in shapes]
    ahead = float(np.mean([shape.sylvian for shape in shapes]))
    # a doubtful shape may be upside down, where front and back change places
    if ahead < -SYLVIAN_AHEAD and (clear or max(turns) < LEAST_TURN_DEG):
        return [f"the Sylvian fissures lie {-ahead:.2f} of the size behind the middle: are left and right swapped, and "
                f"the coordinates not {coordinates.upper()}? Check both, or set coordinates: auto"]  # fmt: skip
    if ahead >= SYLVIAN_AHEAD and clear and min(turns) > LEAST_TURN_DEG:
        return [f"the shapes say that the hemispheres are turned by {np.mean(turns):.0f}° against the coordinates "
                f"{coordinates}: check them, or set coordinates: auto"]  # fmt: skip
    return []


def _angles(rotation: Floats) -> dict[str, float]:
    """Returns by how many degrees a (3, 3) rotation to RAS+ differs from that of each convention of files."""
    return {name: angle_deg(rotation @ axes[:3, :3].T) for name, axes in CONVENTIONS.items()}


def _against(coordinates: str, angles: dict[str, float], what: str) -> list[str]:
    """Returns what a clear shape says against the coordinates that the user names."""
    return [f"the shape says that the {what} is turned by {angles[coordinates]:.0f}° against the coordinates "
            f"{coordinates}: check them, or set coordinates: auto"
            ] if angles[coordinates] > LEAST_TURN_DEG else []  # fmt: skip


def _in_axes(coordinates: str, by: str, *warnings: str) -> Pose:
    return turned(CONVENTIONS[coordinates][:3, :3], by, coordinates, *warnings)


def _turn_onto(pairs: list[tuple[Floats, Floats]]) -> Floats:
    """Returns the rotation (3, 3) that brings the first direction of each pair nearest to the second."""
    ours, theirs = zip(*pairs, strict=True)
    return np.asarray(Rotation.align_vectors(theirs, ours)[0].as_matrix())


def _is_mirrored(turn: Floats, mirrored: Floats) -> bool:
    """Returns whether exchanged sides explain a volume better than a turn does.

    Sides and one more direction fit some rotation, `turn`, even where they are mirrored: a half turn about an oblique
    axis. With the sides exchanged they fit `mirrored`, which is then as small as the brain's tilt. Wrong axis codes
    turn by quarters instead, most often from LPS; else sides of a brain that is upright are taken to be exchanged.
    """
    if angle_deg(turn) < LEAST_TURN_DEG:
        return False
    off_lps, off_quarters = (angle_deg(turn @ axes.T) for axes in (CONVENTIONS["lps"][:3, :3], _nearest_quarters(turn)))
    return angle_deg(mirrored) < min(LEAST_TURN_DEG, off_lps, max(DOUBTFUL_TURN_DEG, off_quarters))


def _nearest_quarters(rotation: Floats) -> Floats:
    """Returns the rotation by quarter turns that is nearest to a (3, 3) rotation."""
    quarters = Rotation.create_group("O").as_matrix()
    return np.asarray(min(quarters, key=lambda turn: angle_deg(rotation @ turn.T)).round())


def _turn_by_quarters(rotation: Floats) -> Floats:
    """Returns the rotation by quarter turns that is within 15° of a (3, 3) rotation, else the rotation."""
    nearest = _nearest_quarters(rotation)
    return nearest if angle_deg(rotation @ nearest.T) < QUARTERS_DEG else rotation


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
