"""Whether a whole brain stands as its file says: by what lies below and behind it, by its sides, by its shape."""

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import angle_deg
from ..geometry.triangles import TriangleMesh, transformed
from ..parameters.schemes import LabelScheme
from .hemisphere_pose import (
    CONVENTION_DEG,
    CONVENTIONS,
    LEAST_CONFIDENCE,
    MIRROR,
    SYLVIAN_AHEAD,
    hemisphere_by_shape,
)
from .orientation import mid_plane
from .outline_fit import Target, register
from .outlines import reference

Floats = NDArray[np.float64]

# from the cerebrum's centre to those of cerebellum and brainstem, RAS+: means over weeks 21 to 34 of the example atlas
TO_CEREBELLUM = np.array([0.0, -0.58, -0.81])
TO_BRAINSTEM = np.array([0.0, -0.30, -0.95])
# left and right of the labels weigh as much as the hindbrain does
TO_RIGHT = np.array([1.0, 0.0, 0.0])
# brains turned by less stand as their files say: this is how far atlases and scans differ
LEAST_TURN_DEG = 60.0
# brains turned by more, up to that, are kept and told: atlases and scans rarely differ as much
DOUBTFUL_TURN_DEG = 25.0
# two directions nearer to each other than this (in radians) say nothing of the turn about them
LEAST_SPREAD = 0.06
# the narrowest extent of a whole cerebrum is 0.61 of its longest and more, that of one hemisphere 0.46 and less
NARROWEST_BRAIN, DOUBTFUL_BRAIN = 0.5, 0.56
# a brain that is turned is turned by quarters, as wrong axis codes do, where these are as near as this
QUARTERS_DEG = 15.0


@dataclass(frozen=True, eq=False)
class BrainPose:
    """The rotation (3, 3) that makes a brain's axes RAS+, where it comes from, and its warnings."""

    rotation: Floats
    by: str
    warnings: tuple[str, ...] = ()


def narrowness(mesh: TriangleMesh) -> float:
    """Returns the shortest over the longest extent of a surface along the axes of inertia of its vertices."""
    points = mesh.vertices - mesh.vertices.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov(points.T))
    extents = np.ptp(points @ axes, axis=0)
    return float(extents.min() / extents.max())


def pose_of_labels(labels: NDArray[np.integer], affine: Floats, scheme: LabelScheme) -> BrainPose | None:
    """Returns the pose from cerebellum, brainstem and labelled sides; None where too few of them are labelled.

    It is that of the file where the two differ by less than 60°, with a warning from 25° on. InputError
    where the labels of left and right are mirrored: no rotation brings them to their sides.
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
    rotation = _from_hindbrain(found, expected) if len(found) == 2 else None
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
    return _keep_or_turn(rotation, by)


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


def pose_surface_by_shape(mesh: TriangleMesh, coordinates: str) -> BrainPose:
    """Returns the pose of a whole brain's surface, in coordinates that the user names or leaves to "auto".

    Named coordinates are kept, with a warning where the shape clearly contradicts them. InputError where the pose
    must come from the shape and is ambiguous.
    """
    rotation, confidence, sylvian, ras = pose_of_surface(mesh)
    upright, ahead = confidence >= LEAST_CONFIDENCE, sylvian >= SYLVIAN_AHEAD
    angles = {name: angle_deg(rotation @ axes.T) for name, axes in CONVENTIONS.items()}
    nearest = min(angles, key=lambda name: angles[name])
    if coordinates != "auto":
        doubts: tuple[str, ...] = ()
        if upright and ahead and angles[coordinates] > LEAST_TURN_DEG:
            doubts = (f"the shape says that the brain is turned by {angles[coordinates]:.0f}° against the coordinates "
                      f"{coordinates}: check them, or set coordinates: auto",)  # fmt: skip
        return BrainPose(CONVENTIONS[coordinates], "configuration", doubts)
    if angles[nearest] < CONVENTION_DEG:
        if ahead:
            said = () if nearest == "ras" else (f"the shape says that the coordinates are {nearest.upper()}",)
            return BrainPose(CONVENTIONS[nearest], "shape", said)
        return BrainPose(
            np.eye(3),
            "default",
            ("the shape leaves front and back open: the coordinates were taken as RAS+; set coordinates",),
        )
    if not (upright and ahead) and ras < LEAST_CONFIDENCE:
        doubt = "the shape fits other poses as well as RAS+, in which the coordinates were taken: check the pose"
        return BrainPose(np.eye(3), "default", (doubt,))
    if not (upright and ahead):
        raise InputError(
            "the pose of the brain cannot be determined from its shape",
            found=f"axes {angles[nearest]:.0f}° off {nearest.upper()}, the next best pose {confidence:.2f} times "
            f"worse, the Sylvian fissures {sylvian:+.2f} of the size in front of the middle",
            expected=f"RAS+ or LPS, or at least {LEAST_CONFIDENCE} times and {SYLVIAN_AHEAD:+.2f}",
            remedy="Pose it and set coordinates: ras or lps.",
        )
    return BrainPose(rotation, "shape", (f"the brain was turned by {angles['ras']:.0f}°, as its shape says",))


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


def _from_hindbrain(found: dict[str, Floats], expected: dict[str, Floats]) -> Floats | None:
    """Returns the rotation from cerebellum and brainstem; None where they lie in one direction."""
    one, other = _unit(found["cerebellum"]), _unit(found["brainstem"])
    # the brainstem is in front of the cerebellum, so that this points to the right
    right = np.cross(one, other)
    if np.linalg.norm(right) < LEAST_SPREAD:
        return None
    theirs, ours = (
        np.stack([np.cross(a, b) / np.linalg.norm(np.cross(a, b)), _unit(a + b)])
        for a, b in ((one, other), tuple(expected.values()))
    )
    return np.asarray(Rotation.align_vectors(ours, theirs)[0].as_matrix())


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
    off_lps, off_quarters = (angle_deg(turn @ axes.T) for axes in (CONVENTIONS["lps"], _nearest_quarters(turn)))
    return angle_deg(mirrored) < min(LEAST_TURN_DEG, off_lps, max(DOUBTFUL_TURN_DEG, off_quarters))


def _nearest_quarters(rotation: Floats) -> Floats:
    """Returns the rotation by quarter turns that is nearest to a (3, 3) rotation."""
    quarters = Rotation.create_group("O").as_matrix()
    return np.asarray(min(quarters, key=lambda turn: angle_deg(rotation @ turn.T)).round())


def _turn_by_quarters(rotation: Floats) -> Floats:
    """Returns the rotation by quarter turns that is within 15° of a (3, 3) rotation, else the rotation."""
    nearest = _nearest_quarters(rotation)
    return nearest if angle_deg(rotation @ nearest.T) < QUARTERS_DEG else rotation


def _keep_or_turn(rotation: Floats, by: str) -> BrainPose:
    rotation = _turn_by_quarters(rotation)
    angle = angle_deg(rotation)
    if angle < LEAST_TURN_DEG:
        doubt = f"{by} say that the brain is turned by about {angle:.0f}°, which was kept: check the file's axes"
        return BrainPose(np.eye(3), "file", (doubt,) if angle > DOUBTFUL_TURN_DEG else ())
    return BrainPose(rotation, by, (f"the brain was turned by {angle:.0f}°, as {by} say: its affine has other axes",))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
