"""A brain's pial surface from surface files: hemispheres, one of them alone, or the whole brain."""

import logging
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import TriangleMesh, area, corners, merged, signed_volume, transformed
from .brain_pose import (
    DOUBTFUL_BRAIN,
    NARROWEST_BRAIN,
    doubts_of_hemispheres,
    narrowness,
    pose_surface_by_shape,
)
from .fissure import SHIFTED_MM, fissure_between
from .hemisphere_pose import CONVENTIONS, pair_by_shape
from .hemispheres import least_gap, left_faces, require_common_pose, require_pair, set_apart
from .limits import USUAL, Limits
from .orientation import mid_plane
from .outcome import PialSurface
from .pial import TOLD_LOSS, make_sound, motion, pose_surface, warn
from .repair import clean, pieces
from .single_hemisphere import require_one, single_hemisphere
from .size import require_plausible_size
from .stalks import surface_without_stalks
from .study_poses import as_poses, poses, report_placement

log = logging.getLogger(__name__)

Coordinates = Literal["auto", "ras", "lps"]
Side = Literal["left", "right"]


def from_hemispheres(
    left: TriangleMesh,
    right: TriangleMesh,
    posing: dict[str, Any] | None = None,
    *,
    week: float,
    coordinates: Coordinates = "ras",
    gap_mm: float = 0.5,
    edge_length_mm: float = 1.0,
    smoothing_iterations: int = 10,
    max_hole_mm: float = 3.0,
    limits: Limits = USUAL,
) -> PialSurface:
    """Returns the pial surface of a brain from closed surfaces of its hemispheres.

    The surfaces are repaired (holes up to `max_hole_mm`), posed, smoothed, remeshed to `edge_length_mm`, turned
    together so that the mid-sagittal plane is x = const, and moved apart along x until they are `gap_mm` from each
    other. With coordinates "auto" each may be in any rigid pose; `posing` is then the report of the pose if it is known
    already, as from all brains of a study. With coordinates that are named, a shape that contradicts them is told.
    InputError where the pose cannot be determined, or the hemispheres are swapped, of different size or not of the
    week's size; MeshError where one can't be made a closed surface without handles and intersections.
    """
    report: dict[str, Any] = {"source": "hemispheres", "coordinates": coordinates}
    left, report["repair_left"] = hemisphere(in_ras(left, coordinates), max_hole_mm, report)
    right, report["repair_right"] = hemisphere(in_ras(right, coordinates), max_hole_mm, report)
    volume = signed_volume(left) + signed_volume(right)
    for doubt in require_plausible_size(volume, np.ptp(merged(left, right).vertices, axis=0), week):
        warn(report, doubt)
    placing = None
    if coordinates == "auto":
        placing = as_poses(posing) if posing else poses([pair_by_shape(left, right, limits)], [False])[0]
        left, right = transformed(left, placing.left), transformed(right, placing.right)
        for warning in placing.report["warnings"]:
            warn(report, warning)
    both = merged(left, right)
    doubts = require_pair(left, right, limits, coordinates)
    if coordinates != "auto":
        doubts += doubts_of_hemispheres(left, right, coordinates)
    for doubt in doubts:
        warn(report, doubt)
    left = make_sound(left, smoothing_iterations, edge_length_mm, report, "mesh_left")
    right = make_sound(right, smoothing_iterations, edge_length_mm, report, "mesh_right")
    plane = mid_plane(merged(left, right))
    require_common_pose(plane.asymmetry_mm, float(np.ptp(both.vertices, axis=0).max()), limits)
    report["gap_before_mm"] = least_gap(left, right)
    to_right = plane.normal
    left, right, moved = set_apart(left, right, gap_mm, to_right)
    report["moved_apart_mm"] = moved
    if moved > 0:
        warn(report, f"the hemispheres were moved apart by {moved:.2f} mm each, to a gap of {gap_mm:g} mm")
        plane = mid_plane(merged(left, right))
    mesh = merged(left, right)
    surface = pose_surface(mesh, np.arange(len(mesh.faces)) < len(left.faces), plane, report, week)
    turn = np.array(report["pose"])
    before = motion(CONVENTIONS["lps"]) if coordinates == "lps" else np.eye(4)
    both_before = (before, before) if placing is None else (placing.left, placing.right)
    report["motions"] = {
        side: (turn @ translation(sign * moved * to_right) @ one).tolist()
        for side, sign, one in zip(("left", "right"), (-1.0, 1.0), both_before, strict=True)
    }
    if placing:
        report["posing"] = report_placement(placing, turn, moved * to_right)
        if placing.report["together"]:
            report["pose"] = (turn @ placing.left).tolist()
    return surface


def translation(by: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the (4, 4) motion by (3,) mm."""
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


def from_pial(
    mesh: TriangleMesh,
    *,
    week: float,
    coordinates: Coordinates = "ras",
    edge_length_mm: float = 1.0,
    smoothing_iterations: int = 10,
    max_hole_mm: float = 3.0,
) -> PialSurface:
    """Returns the pial surface of a brain from one closed surface, of one piece or one for each hemisphere.

    It is repaired (holes up to `max_hole_mm`), smoothed, remeshed to `edge_length_mm` and turned so that the
    mid-sagittal plane is x = const. InputError where it is not of the week's size, MeshError where it can't be made
    closed and free of handles and intersections.
    """
    report: dict[str, Any] = {"source": "pial", "coordinates": coordinates}
    mesh, report["repair"] = clean(mesh, max_hole_mm)
    _report_dropped(report["repair"], area(mesh), report)
    mesh = without_stalks(mesh, report)
    for doubt in require_plausible_size(signed_volume(mesh), np.ptp(mesh.vertices, axis=0), week):
        warn(report, doubt)
    mesh = make_sound(mesh, smoothing_iterations, edge_length_mm, report)
    _require_both(mesh, report)
    pose = pose_surface_by_shape(mesh, coordinates)
    report["pose_by"] = pose.by
    if np.array_equal(pose.rotation, CONVENTIONS["lps"]):
        report["coordinates"] = "lps"
    for warning in pose.warnings:
        warn(report, warning)
    mesh = transformed(mesh, motion(pose.rotation))
    plane = mid_plane(mesh)
    fissure = fissure_between(mesh, plane)
    if (shift := float(np.abs(fissure.heights).max())) > SHIFTED_MM:
        warn(report, f"the fissure bends away from its plane by up to {shift:.0f} mm: check it")
    left = left_faces(mesh, fissure.height_above(corners(mesh).mean(axis=1)))
    return pose_surface(mesh, left, plane, report, week, pose.rotation)


def from_hemisphere(
    mesh: TriangleMesh,
    side: Side,
    *,
    week: float,
    coordinates: Coordinates = "auto",
    edge_length_mm: float = 1.0,
    smoothing_iterations: int = 10,
    max_hole_mm: float = 3.0,
) -> PialSurface:
    """Returns the pial surface of one hemisphere, the only one that there is.

    It is repaired (holes up to `max_hole_mm`), smoothed, remeshed to `edge_length_mm` and posed with its medial wall
    upright beside x = `fissure_x_mm`. With coordinates "auto" it may be in any rigid pose. InputError where it is a
    whole brain, of the other side, or not of half the size of the week's brains.
    """
    report: dict[str, Any] = {"source": "hemisphere", "side": side, "coordinates": coordinates}
    mesh, report["repair"] = hemisphere(mesh, max_hole_mm, report)
    for doubt in require_plausible_size(2.0 * signed_volume(mesh), np.ptp(mesh.vertices, axis=0), week):
        warn(report, doubt)
    require_one(mesh)
    mesh = make_sound(mesh, smoothing_iterations, edge_length_mm, report)
    return single_hemisphere(mesh, side, coordinates, report, week)


def hemisphere(
    mesh: TriangleMesh, max_hole_mm: float, report: dict[str, Any] | None = None
) -> tuple[TriangleMesh, dict[str, Any]]:
    """Returns the largest piece of a surface, repaired and without parts that hang on stalks, and the repairs.

    The warnings of `report` say what was removed.
    """
    said = {} if report is None else report
    mesh, repairs = clean(mesh, max_hole_mm)
    largest, *others = pieces(mesh)
    repairs["pieces"], repairs["pieces_dropped"] = 1, repairs["pieces_dropped"] + len(others)
    repairs["area_dropped_mm2"] += sum(area(piece) for piece in others)
    _report_dropped(repairs, area(largest), said)
    return without_stalks(largest, said), repairs


def without_stalks(mesh: TriangleMesh, report: dict[str, Any]) -> TriangleMesh:
    """Returns a closed surface without what hangs on it by thin stalks; each part is reported."""
    mesh, stalks = surface_without_stalks(mesh)
    if stalks:
        report["stalks"] = report.get("stalks", []) + stalks
        for stalk in stalks:
            warn(
                report,
                f"a part of {stalk['volume_mm3']:.0f} mm³ hung on a stalk of {stalk['stalk_mm2']:.0f} mm²: cut off",
            )
    return mesh


def in_ras(mesh: TriangleMesh, coordinates: Coordinates) -> TriangleMesh:
    """Returns a surface whose coordinates are RAS+ unless they are named LPS."""
    return transformed(mesh, motion(CONVENTIONS["lps"])) if coordinates == "lps" else mesh


def _report_dropped(repairs: dict[str, Any], kept_mm2: float, report: dict[str, Any]) -> None:
    dropped = repairs["area_dropped_mm2"]
    if dropped > TOLD_LOSS * kept_mm2:
        warn(report, f"{repairs['pieces_dropped']} pieces apart from the brain or inside it were dropped: "
             f"{100 * dropped / (kept_mm2 + dropped):.1f} % of the area")  # fmt: skip


def _require_both(mesh: TriangleMesh, report: dict[str, Any]) -> None:
    """Raises InputError where a whole brain's surface is that of one hemisphere."""
    shape = narrowness(mesh)
    if shape < NARROWEST_BRAIN:
        raise InputError(
            "the surface seems to be one hemisphere only",
            found=f"a narrowest extent that is {shape:.2f} of the longest",
            expected=f"{NARROWEST_BRAIN} or more, as in whole cerebra",
            remedy="Give both hemispheres; or the only one under hemisphere, with its side.",
        )
    if shape < DOUBTFUL_BRAIN:
        warn(report, f"the surface is narrow ({shape:.2f} of its length): are both hemispheres there?")
