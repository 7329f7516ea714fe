"""Make a brain's posed pial surface from a label volume, from surface files or from a simple shape."""

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import InputError, MeshError
from ..geometry.alignment import angle_deg, motion
from ..geometry.poses import CONVENTIONS, Pose
from ..geometry.triangles import (
    TriangleMesh,
    area,
    area_cm2,
    area_vectors,
    corners,
    euler_number,
    is_closed,
    merged,
    signed_volume,
    submesh,
    transformed,
    volume_ml,
)
from ..settings.schemes import LabelScheme
from ..settings.terms import SIDES, Coordinates, Side
from ..units import CM2_PER_MM2, ML_PER_MM3
from .extraction import (
    LEVEL,
    Floats,
    Mask,
    handles,
    isosurface,
    main_parts,
    make_simple,
    refine,
    remove_bridges,
    smooth_mask,
    unambiguous,
)
from .fissure import (
    FISSURE_MM,
    Fissure,
    MidPlane,
    cut_middle,
    cut_share,
    cut_sides,
    fissure_between,
    hidden_fissure,
    largest_pieces,
    left_faces,
    mid_plane,
    open_fissure,
    plane_between_labels,
    sample,
    separate,
    side_distance,
    signed_side_distance,
    smallest_gap,
    split,
    upright,
)
from .hindbrain import pose_of_labels
from .labels import MIN_CORTEX_OUTSIDE, REPORTED_LOSS, Cerebrum, Labels, read_cerebrum, require_sides
from .layout import layout_of, scheme_contradictions
from .plausible import (
    DOUBTFUL_RATIO,
    cut_warnings,
    max_cut_share,
    proportion_warnings,
    require_common_pose,
    require_left_and_right,
    require_pair,
    require_plausible_size,
    require_single_hemisphere,
    require_whole,
)
from .pose import hemisphere_warnings, pose_of_hemisphere, pose_of_pair, pose_of_surface, pose_of_volume_by_shape
from .repair import (
    RepairedSurface,
    filled_warning,
    make_pieces_sound,
    pieces,
    require_sound,
    sound_pieces,
    surface_of_mask,
)
from .sulci import open_fused_sulci
from .thickness import MIN_VOXELS, voxels_through_cortex

log = logging.getLogger(__name__)

# the mid-plane agrees with the labels if this is the cosine between its normal and the line from left to right: 45°
MIN_AXIS_COSINE = 0.7
# an asymmetry of more than this share of the brain's width gives a warning
MAX_USUAL_ASYMMETRY = 0.03
# largest ratio of the hemispheres' areas; with 4 % of the volume it is about 10
MAX_AREA_RATIO = 15.0
# up to this week labels of 0.8 mm close no sulci: CRL has the same area with fused and opened ones
FUSED_AFTER_GW = 26.0
# voxels of this size are fine enough to determine the pose by shape
POSE_VOXEL_MM = 1.5
# smallest gap between hemispheres from surfaces
MIN_GAP_MM = 0.5
# distance of the medial wall of a single hemisphere from the mid-sagittal plane
WALL_DISTANCE_MM = 0.5


@dataclass(frozen=True, eq=False)
class PialSurface:
    """A posed pial surface in RAS+ mm.

    `whole` is closed and outward, in one piece or in one for each hemisphere. `left` and `right` are its parts, open
    where a connected brain is cut at the fissure, the plane x = `fissure_x_mm`, and at capped medial walls; None for a
    missing hemisphere. `pose` leads from the brain's files. The report has the pose, measures and repairs, in plain
    values for JSON.
    """

    whole: TriangleMesh
    left: TriangleMesh | None
    right: TriangleMesh | None
    fissure_x_mm: float
    pose: Pose
    report: dict[str, Any]


def from_labels(
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    side: Side | None = None,
    *,
    week: float,
    edge_length_mm: float = 1.0,
    open_sulci: bool = False,
) -> PialSurface:
    """Return the pial surface around the cerebrum of an (i, j, k) label volume with a (4, 4) affine to RAS+ mm.

    A volume with wrong axes is rotated according to its cerebellum, brainstem and sides, or else to its shape. The
    cerebrum's mask is smoothed (Gaussian, σ = 1 voxel) and its handles are removed. Its isosurface is smoothed,
    remeshed to `edge_length_mm`, freed of terraces, moved outward to restore the volume, and rotated so that the
    mid-sagittal plane is x = const. If cortex labels of both sides touch, the fissure is opened there to 1.5 mm,
    half-way between the labels of the two sides if the scheme has them. With `open_sulci`, fused sulci are opened. With
    `side` the volume contains only that hemisphere, which is posed as in `from_surface`.

    InputError if the labels do not fit the scheme or the week, for a single hemisphere without `side`, and for a whole
    brain or labels of the other hemisphere with it. MeshError if the surface keeps self-intersections.
    """
    volume = _read_volume(labels, affine, scheme, side, week)
    if side:
        return _hemisphere_from_volume(volume, side, edge_length_mm, open_sulci)
    return _brain_from_volume(volume, edge_length_mm, open_sulci)


@dataclass(frozen=True, eq=False)
class _Volume:
    """A checked label volume: its cerebrum, the smoothed mask with its posed affine, scheme, pose and warnings."""

    cerebrum: Cerebrum
    field: NDArray[np.float32]
    affine: Floats
    scheme: LabelScheme
    pose: Pose
    week: float
    warnings: list[str]


def _read_volume(labels: Labels, affine: Floats, scheme: LabelScheme, side: Side | None, week: float) -> _Volume:
    # the medial wall of a single hemisphere may have no cortex
    cerebrum = read_cerebrum(labels, affine, scheme, 0.0 if side else MIN_CORTEX_OUTSIDE)
    warnings = logged(cerebrum.warnings)
    pose = Pose() if side else pose_of_labels(labels, affine, scheme)
    if side and set(_labelled_sides(cerebrum.tissue, scheme)) - {side}:
        raise InputError(f"the volume contains labels of another hemisphere than the {side} one")
    warnings += logged(require_plausible_size((2.0 if side else 1.0) * cerebrum.volume_mm3, week))
    if (share := cerebrum.report["border_share"]) > REPORTED_LOSS:
        cut = f"the cerebrum touches the border of the volume with {100 * share:.0f} % of its surface"
        warnings += logged([f"{cut}: parts outside are missing, and the surface is flat there"])
    field = smooth_mask(cerebrum.mask)
    if not side:
        warnings += logged(scheme_contradictions(layout_of(labels), scheme))
        warnings += logged(_require_both(cerebrum, scheme, field))
    if pose is None:
        pose = _pose_by_shape(field, cerebrum.affine, scheme)
    warnings += logged(pose.warnings)
    return _Volume(cerebrum, field, pose.world @ cerebrum.affine, scheme, pose, week, warnings)


def _hemisphere_from_volume(volume: _Volume, side: Side, edge_length_mm: float, open_sulci: bool) -> PialSurface:
    cerebrum, scheme, field, affine = volume.cerebrum, volume.scheme, volume.field, volume.affine
    warnings = list(volume.warnings)
    report, original, taken_ml = {"scheme": scheme.name, **cerebrum.report}, (field, affine), 0.0
    if open_sulci:
        field, affine, taken_ml, report["sulci"], doubts = _with_sulci(field, affine, volume)
        warnings += logged(doubts)
    taken = taken_ml / ML_PER_MM3
    even = surface_of_mask(field, affine, cerebrum.volume_mm3, edge_length_mm, taken_mm3=taken, original=original)
    require_single_hemisphere(even.mesh)
    pose = pose_of_hemisphere(even.mesh, side, "auto", of_volume=True)
    report = {"source": "hemisphere", "side": side, **report, **even.report}
    warnings += logged([*even.warnings, *pose.warnings])
    return _single_hemisphere(replace(even, report=report, warnings=warnings), side, pose, volume.week)


def _brain_from_volume(volume: _Volume, edge_length_mm: float, open_sulci: bool) -> PialSurface:
    cerebrum, scheme, field, affine = volume.cerebrum, volume.scheme, volume.field, volume.affine
    warnings = list(volume.warnings)
    mask, tissue, report = cerebrum.mask, cerebrum.tissue, {"scheme": scheme.name, **cerebrum.report}
    grid, opened_ml = affine, 0.0
    core = mask & ~np.isin(tissue, scheme.cortex)
    # medial walls of the tissue inside the cortex show the fissure even where the cortex hides it
    walls = isosurface(smooth_mask(core) if scheme.cortex else field, affine)
    fissure, doubts = _fissure_of_labels(tissue, mask, walls, scheme, affine)
    warnings += logged(doubts)
    sides = [np.isin(tissue, side) for side in (scheme.left, scheme.right) if scheme.left and scheme.right]
    side_mm = side_distance(mask, core if scheme.cortex else mask, affine, fissure, *sides)
    field, report["slit_voxels_reopened"] = remove_bridges(mask, field)
    original = field, grid
    # a hidden fissure is opened as a whole, down to the tissue that joins the hemispheres
    hidden = hidden_fissure(side_mm, field > LEVEL, core, affine) if scheme.cortex else np.zeros_like(mask)
    if hidden.any():
        opened = _with_fissure(field, affine, side_mm, hidden)
        if handles(opened[0] > LEVEL):
            # tissue that crosses the fissure makes tunnels of it, and closing these would close the fissure
            hidden = hidden_fissure(side_mm, field > LEVEL, core, affine, bridges=True)
            opened = _with_fissure(field, affine, side_mm, hidden)
        field, affine, opened_ml = opened
    if scheme.cortex:
        report["fissure_opened_mL"] = opened_ml
    if open_sulci:
        field, affine, taken_ml, report["sulci"], doubts = _with_sulci(field, affine, volume, side_mm)
        warnings += logged(doubts)
        opened_ml += taken_ml
    volume_mm3, smallest, taken = cerebrum.volume_mm3, cerebrum.smallest_part, opened_ml / ML_PER_MM3
    even = surface_of_mask(
        field, affine, volume_mm3, edge_length_mm, smallest=smallest, taken_mm3=taken, original=original
    )
    mesh, centres = even.mesh, corners(even.mesh).mean(axis=1)
    warnings += logged(even.warnings)
    heights = sample(side_mm, grid, centres)
    even = replace(even, report={"source": "labels", **report, **even.report}, warnings=warnings)
    return _upright(even, left_faces(mesh, heights), fissure.plane, volume.pose, volume.week)


def _with_sulci(
    field: NDArray[np.float32],
    affine: Floats,
    volume: _Volume,
    side_mm: NDArray[np.float32] | None = None,
) -> tuple[NDArray[np.float32], Floats, float, dict[str, Any], list[str]]:
    """Open fused sulci; return the field, its affine, the volume removed (mL), a report, and warnings."""
    cerebrum, scheme = volume.cerebrum, volume.scheme
    if not scheme.cortex or not np.isin(cerebrum.tissue, scheme.white_matter).any():
        reason = "the labels have no white matter"
        return field, affine, 0.0, {"stays_fused": reason}, _fused_sulci_warning(reason, volume.week)
    core = cerebrum.mask & ~np.isin(cerebrum.tissue, scheme.cortex)
    if (voxels := voxels_through_cortex(cerebrum.mask, core, cerebrum.affine)) < MIN_VOXELS:
        reason = f"the cortex is {voxels:.1f} voxels thick, so roughness of the labels looks like two banks"
        return field, affine, 0.0, {"stays_fused": reason}, _fused_sulci_warning(reason, volume.week)
    # handles are found faster before voxels are refined
    simple, repaired = make_simple(field, cerebrum.smallest_part)
    opened, fine, report = open_fused_sulci(simple, affine, core, side_mm)
    if not report.get("sheets"):
        return field, affine, 0.0, report, _fused_sulci_warning(report.get("stays_fused"), volume.week)
    gained = int((simple > LEVEL).sum()) - int((field > LEVEL).sum())
    gained_ml = gained * float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    report |= {"repaired_before": repaired}
    return opened, fine, report["opened_mL"] - gained_ml, report, filled_warning(repaired, affine)


def _fused_sulci_warning(reason: str | None, week: float) -> list[str]:
    return [f"fused sulci were not opened: {reason}"] if reason and week > FUSED_AFTER_GW else []


def _pose_by_shape(field: NDArray[np.float32], affine: Floats, scheme: LabelScheme) -> Pose:
    every = max(int(POSE_VOXEL_MM / np.linalg.norm(affine[:3, :3], axis=0).max()), 1)
    coarse = unambiguous(field[::every, ::every, ::every])
    rough = isosurface(coarse, affine @ np.diag([every, every, every, 1.0]))
    return pose_of_volume_by_shape(rough, has_sides=bool(scheme.left and scheme.right))


def _fissure_of_labels(
    tissue: Labels, mask: Mask, walls: TriangleMesh, scheme: LabelScheme, affine: Floats
) -> tuple[Fissure, list[str]]:
    plane, doubts = mid_plane(walls), []
    if scheme.left and scheme.right:
        left, right = (np.argwhere(np.isin(tissue, side)).mean(axis=0) for side in (scheme.left, scheme.right))
        axis = affine[:3, :3] @ (right - left)
        if abs(plane.normal @ (axis / np.linalg.norm(axis))) < MIN_AXIS_COSINE:
            plane = plane_between_labels(signed_side_distance(tissue, scheme, affine), affine, mask)
            doubts.append("the hemispheres are not mirror images of each other: the mid-plane is that of their labels")
    require_sides(tissue, scheme, affine, plane.normal)
    return fissure_between(walls, plane), doubts


def from_hemispheres(
    left: TriangleMesh,
    right: TriangleMesh,
    *,
    week: float,
    coordinates: Coordinates = "ras",
    declared: bool = False,
    edge_length_mm: float = 1.0,
    max_hole_mm: float = 3.0,
    max_hemisphere_ratio: float = 1.15,
    max_asymmetry: float = 0.02,
) -> PialSurface:
    """Return the pial surface of a brain from surfaces of its hemispheres.

    The surfaces are repaired (holes up to `max_hole_mm`, open medial walls), posed, smoothed, remeshed to
    `edge_length_mm`, rotated together so that the mid-sagittal plane is x = const, and moved along x to a gap of 0.5 mm
    between them. With coordinates "auto" each may have any rigid pose, which is determined from its
    shape; `declared` is whether both files name the same coordinate system. If a shape contradicts named coordinates,
    there is a warning.
    Hemispheres that share the vertices of a cut, as those that gyriflow writes, are joined along it to one surface.
    InputError if the pose cannot be determined, or if the hemispheres are swapped, of different size or of an
    impossible size; MeshError if one cannot be made a closed surface without handles and self-intersections.
    """
    if (joined := joined_along_cut(left, right)) is not None:
        connected = from_surface(
            joined, week=week, coordinates=coordinates, edge_length_mm=edge_length_mm, max_hole_mm=max_hole_mm
        )
        to_pose = connected.pose.of_file()
        require_left_and_right(transformed(left, to_pose), transformed(right, to_pose), coordinates)
        return replace(connected, report=connected.report | {"source": "hemispheres", "joined_along_cut": True})
    to_ras = CONVENTIONS[coordinates] if coordinates != "auto" else np.eye(4)
    sides = [
        sound_pieces(transformed(mesh, to_ras), max_hole_mm, single=True, caps_walls=True) for mesh in (left, right)
    ]
    warnings = logged(warning for side in sides for warning in side.warnings)
    left, right = (side.mesh for side in sides)
    volume = signed_volume(left) + signed_volume(right)
    warnings += logged(require_plausible_size(volume, week))
    if named := coordinates != "auto":
        pose = Pose(files=dict.fromkeys((*SIDES, "whole"), to_ras), by="configuration")
    else:
        pose = pose_of_pair(left, right, declared=declared)
        left, right = transformed(left, pose.of_file("left")), transformed(right, pose.of_file("right"))
        warnings += logged(pose.warnings)
    length = float(np.ptp(merged(left, right).vertices, axis=0).max())
    warnings += logged(require_pair(left, right, max_hemisphere_ratio, coordinates))
    if named:
        warnings += logged(hemisphere_warnings(left, right, coordinates))
    posed = [replace(side, mesh=mesh) for side, mesh in zip(sides, (left, right), strict=True)]
    even = [make_pieces_sound(side, edge_length_mm) for side in posed]
    warnings += logged(warning for side in even for warning in side.warnings)
    whole = merged(*(side.mesh for side in even))
    plane = mid_plane(whole, named=named)
    require_common_pose(plane.asymmetry_mm, max_asymmetry * length)
    report: dict[str, Any] = {"source": "hemispheres", "coordinates": coordinates}
    for name, *steps in zip(SIDES, sides, even, strict=True):
        report |= {f"{key}_{name}": value for step in steps for key, value in step.report.items()}
    surface = RepairedSurface(whole, report, warnings, np.concatenate([side.is_cap for side in even]))
    is_left = np.arange(len(whole.faces)) < len(even[0].mesh.faces)
    return _two_pieces(surface, is_left, plane, pose, week, named=named)


def joined_along_cut(left: TriangleMesh, right: TriangleMesh) -> TriangleMesh | None:
    """Return the closed surface of two open hemispheres with the same vertices along their cut, or None."""
    if is_closed(left) or is_closed(right):
        return None
    both = merged(left, right)
    vertices, index = np.unique(both.vertices, axis=0, return_inverse=True)
    joined = TriangleMesh(vertices, index.reshape(-1)[both.faces])
    return joined if is_closed(joined) else None


def _two_pieces(
    surface: RepairedSurface, is_left: Mask, plane: MidPlane, pose: Pose, week: float, *, named: bool
) -> PialSurface:
    """Return the pial surface of a brain whose hemispheres are closed pieces, with a gap between them."""
    left, right = cut_sides(surface.mesh, is_left)
    is_cap = np.concatenate([surface.is_cap[is_left], surface.is_cap[~is_left]])
    gap, to_right = smallest_gap(left, right), plane.normal
    left, right, moved = separate(left, right, MIN_GAP_MM, to_right)
    warnings = list(surface.warnings)
    if moved > 0:
        warnings += logged([f"each hemisphere was moved by {moved:.2f} mm, to a gap of {MIN_GAP_MM:g} mm between them"])
        plane = mid_plane(merged(left, right), named=named)
    shifts = {"left": motion(shift=-moved * to_right), "right": motion(shift=moved * to_right)}
    files = {side: shift @ pose.of_file(side) for side, shift in shifts.items()}
    pose = replace(pose, files={**pose.files, **files})
    report = {**surface.report, "moved_apart_mm": moved, "gap_before_mm": gap}
    surface = RepairedSurface(merged(left, right), report, warnings, is_cap)
    return _upright(surface, np.arange(len(is_cap)) < len(left.faces), plane, pose, week)


def from_surface(
    mesh: TriangleMesh,
    side: Side | None = None,
    *,
    week: float,
    coordinates: Coordinates = "ras",
    edge_length_mm: float = 1.0,
    max_hole_mm: float = 3.0,
) -> PialSurface:
    """Return the pial surface of a brain, or of a single hemisphere (`side`), from one surface.

    It is repaired (holes up to `max_hole_mm`, open medial walls of hemispheres), smoothed and remeshed to
    `edge_length_mm`. A whole brain is rotated so that the mid-sagittal plane is x = const. If its hemispheres are two
    pieces, they get a gap as in `from_hemispheres`. The medial wall of a single hemisphere is set upright next to
    x = `fissure_x_mm`. With coordinates "auto" the pose is determined from the shape.
    InputError if a hemisphere is a whole brain or the reverse, of the other side, or of an impossible size; MeshError
    if it cannot be made closed and free of handles and self-intersections.
    """
    clean = sound_pieces(mesh, max_hole_mm, single=side is not None, caps_walls=True)
    warnings = logged(clean.warnings)
    warnings += logged(require_plausible_size((2.0 if side else 1.0) * signed_volume(clean.mesh), week))
    if side:
        require_single_hemisphere(clean.mesh)
    even = make_pieces_sound(clean, edge_length_mm)
    warnings += logged(even.warnings)
    if side:
        pose = pose_of_hemisphere(even.mesh, side, coordinates)
    else:
        warnings += logged(require_whole(even.mesh, "surface"))
        pose = pose_of_surface(even.mesh, coordinates)
    warnings += logged(pose.warnings)
    # "lps" if these were found, else the configured coordinates
    read_as = coordinates if np.array_equal(pose.world, pose.of_file()) else "lps"
    report = {"coordinates": read_as, **clean.report, **even.report}
    if side:
        report = {"source": "hemisphere", "side": side, **report}
        return _single_hemisphere(replace(even, report=report, warnings=warnings), side, pose, week)
    mesh, named = transformed(even.mesh, pose.of_file()), coordinates != "auto"
    surface = RepairedSurface(mesh, {"source": "pial", **report}, warnings, even.is_cap)
    plane = mid_plane(mesh, named=named)
    is_left = left_faces(mesh, fissure_between(mesh, plane).height_above(corners(mesh).mean(axis=1)))
    if all(map(is_closed, cut_sides(mesh, is_left))):
        return _two_pieces(surface, is_left, plane, pose, week, named=named)
    return _upright(surface, is_left, plane, pose, week)


def from_shape(mesh: TriangleMesh, *, week: float) -> PialSurface:
    """Return a simple geometry, unchanged, in place of a brain; left and right meet at x = 0.

    It has neither a fissure nor a size to check, and smoothing would round its edges. MeshError if it is not closed or
    has self-intersections.
    """
    require_sound(mesh)
    left, right = split(mesh, 0.0)
    surface = RepairedSurface(mesh, {"source": "shape", "rotation_deg": 0.0}, [])
    return _pial_surface(surface, {"left": left, "right": right}, 0.0, Pose(), week)


def logged(warnings: Iterable[str]) -> list[str]:
    """Log warnings and return them."""
    warnings = list(warnings)
    for warning in warnings:
        log.warning(warning)
    return warnings


def _pial_surface(
    surface: RepairedSurface, sides: Mapping[Side, TriangleMesh], fissure_x: float, pose: Pose, week: float
) -> PialSurface:
    whole = surface.mesh
    areas: dict[str, float] = {side: area_cm2(part) for side, part in sides.items()}
    measures = {
        "pose": pose.plain(),
        "week": week,
        "fissure_x_mm": fissure_x,
        "area_cm2": {"whole": sum(areas.values()), **areas},
        "volume_mL": volume_ml(whole),
        "extents_mm": np.ptp(whole.vertices, axis=0).tolist(),
        "vertices": len(whole.vertices),
        "faces": len(whole.faces),
        "pieces": len(pieces(whole)),
        "euler_number": euler_number(whole),
        "warnings": list(surface.warnings),
    }
    report = {**surface.report, **measures}
    return PialSurface(whole, sides.get("left"), sides.get("right"), fissure_x, pose, report)


def _upright(surface: RepairedSurface, is_left: Mask, plane: MidPlane, pose: Pose, week: float) -> PialSurface:
    to_file = np.asarray(np.linalg.inv(pose.of_file()), dtype=float)
    surface, is_kept = _without_islands(surface, {"left": is_left, "right": ~is_left}, to_file)
    is_left, doubts = is_left[is_kept], list[str]()
    matrix, angle = upright(plane, surface.mesh.vertices.mean(axis=0))
    whole = transformed(surface.mesh, matrix)
    is_cap = surface.is_cap if len(surface.is_cap) else np.zeros_like(is_left)
    for cap, sign in ((is_cap & is_left, 1.0), (is_cap & ~is_left, -1.0)):
        _require_medial(submesh(whole, cap)[0], sign)
    left, right = cut_sides(submesh(whole, ~is_cap)[0], is_left[~is_cap])
    # x of the plane, which may be tilted by less than half a degree, at the brain's centre
    normal = matrix[:3, :3] @ plane.normal
    offset = plane.offset + normal @ matrix[:3, 3]
    fissure_x = float((offset - normal[1:] @ whole.vertices.mean(axis=0)[1:]) / normal[0])
    if not left.vertices[:, 0].mean() < fissure_x < right.vertices[:, 0].mean():
        doubts.append("the mid-plane is not between the unequal hemispheres: the middle of their cut is used")
        fissure_x = cut_middle(left, right)
    if plane.fissure_points == 0:
        doubts.append("no fissure was found between facing walls: the plane of mirror symmetry is used")
    if plane.asymmetry_mm > MAX_USUAL_ASYMMETRY * float(np.ptp(whole.vertices[:, 0])):
        doubts.append(f"the brain is far from mirror-symmetric ({plane.asymmetry_mm:.1f} mm): check its pose")
    doubts += proportion_warnings(np.ptp(whole.vertices, axis=0))
    areas = sorted((area(left), area(right)))
    if areas[1] > MAX_AREA_RATIO * areas[0]:
        found = f"areas of {areas[0] * CM2_PER_MM2:.2f} and {areas[1] * CM2_PER_MM2:.2f} cm²"
        raise InputError("one hemisphere is too small", found=found, expected=f"a ratio of at most {MAX_AREA_RATIO:g}")
    if areas[1] > DOUBTFUL_RATIO * areas[0]:
        doubts.append(f"the hemispheres' areas differ by {100 * (areas[1] / areas[0] - 1):.0f} %: check the midline")
    share = cut_share(left, right)
    doubts += cut_warnings(share, week)
    facts = {
        "cut_share": share,
        "usual_cut_share": max_cut_share(week),
        "rotation_deg": angle,
        "fissure_points": plane.fissure_points,
        "asymmetry_mm": plane.asymmetry_mm,
    }
    report, warnings = {**surface.report, **facts}, [*surface.warnings, *logged(doubts)]
    surface = RepairedSurface(whole, report, warnings)
    return _pial_surface(surface, {"left": left, "right": right}, fissure_x, pose.then(matrix), week)


def _without_islands(
    surface: RepairedSurface, sides: Mapping[Side, Mask], to_file: Floats
) -> tuple[RepairedSurface, Mask]:
    """Leave out what is not connected to a hemisphere's largest piece; return the surface and the faces that remain."""
    is_kept, warnings = largest_pieces(surface.mesh, sides, to_file)
    if not warnings:
        return surface, is_kept
    is_cap = surface.is_cap[is_kept] if len(surface.is_cap) else surface.is_cap
    mesh = submesh(surface.mesh, is_kept)[0]
    return replace(surface, mesh=mesh, is_cap=is_cap, warnings=[*surface.warnings, *logged(warnings)]), is_kept


def _single_hemisphere(surface: RepairedSurface, side: Side, pose: Pose, week: float) -> PialSurface:
    surface, _ = _without_islands(surface, {side: np.ones(len(surface.mesh.faces), dtype=bool)}, np.eye(4))
    whole = pial = transformed(surface.mesh, pose.of_file())
    if surface.is_cap.any():
        _require_medial(submesh(whole, surface.is_cap)[0], 1.0 if side == "left" else -1.0)
        pial = submesh(whole, ~surface.is_cap)[0]
    x = whole.vertices[:, 0]
    fissure_x = float(x.max() + WALL_DISTANCE_MM if side == "left" else x.min() - WALL_DISTANCE_MM)
    report = {**surface.report, "rotation_deg": angle_deg(pose.of_file()[:3, :3])}
    return _pial_surface(RepairedSurface(whole, report, surface.warnings), {side: pial}, fissure_x, pose, week)


def _require_medial(cap: TriangleMesh, sign: float) -> None:
    """Raise MeshError if the cap of a posed hemisphere does not face the other one, in the direction `sign` x."""
    normal = area_vectors(cap).sum(axis=0)
    if sign * normal[0] < MIN_AXIS_COSINE * np.linalg.norm(normal):
        problem = "the surface has a hole that is too large to close, and is not the medial wall of a hemisphere"
        found = f"a hole {np.ptp(cap.vertices, axis=0).max():.1f} mm across"
        raise MeshError(problem, found=found, expected="a closed surface, or hemispheres open at medial walls only")


def _labelled_sides(tissue: Labels, scheme: LabelScheme) -> list[Side]:
    cortex = scheme.cortex or scheme.cerebrum
    labels = {"left": scheme.left, "right": scheme.right}
    return [side for side in SIDES if np.isin(tissue, np.intersect1d(labels[side], cortex)).any()]


def _require_both(cerebrum: Cerebrum, scheme: LabelScheme, field: NDArray[np.float32]) -> list[str]:
    if len(sides := _labelled_sides(cerebrum.tissue, scheme)) == 1:
        problem = f"the volume has labels of the {sides[0]} hemisphere only"
        remedy = "Choose a scheme without left and right, or give the hemisphere under `hemisphere`, with its side."
        raise InputError(problem, expected="labels of both hemispheres", remedy=remedy)
    # parts that are removed below because of their size do not count
    parts, _, _ = main_parts(field > LEVEL, cerebrum.smallest_part)
    surface = isosurface(smooth_mask(parts), cerebrum.affine)
    # a brain that is cut by the field of view may be as narrow, which has been reported already
    return require_whole(surface, "volume", refuses=cerebrum.report["border_share"] <= REPORTED_LOSS)


def _with_fissure(
    field: NDArray[np.float32], affine: Floats, side_mm: NDArray[np.float32], hidden: Mask
) -> tuple[NDArray[np.float32], Floats, float]:
    """Open the fissure; return the field, its affine, and the volume removed (mL).

    If more than a thousandth of the brain is removed, the fissure was fused. Voxels that are too coarse for its walls
    are then refined first.
    """
    size = np.linalg.norm(affine[:3, :3], axis=0)
    to_hidden = ndimage.distance_transform_edt(~hidden, sampling=size).astype(np.float32)
    wide = open_fissure(field, affine, side_mm, to_hidden)
    # an opening of less than two voxels would be lost
    factor = int(np.ceil(1.8 * size.max() / FISSURE_MM))
    if factor > 1 and (field - wide).sum(dtype=float) > 1e-3 * field.sum(dtype=float):
        distances = (refine(values, affine, factor)[0] for values in (side_mm, to_hidden))
        field, affine = refine(field, affine, factor)
        wide = open_fissure(field, affine, *distances)
    voxel_ml = abs(np.linalg.det(affine[:3, :3])) * ML_PER_MM3
    return wide, affine, float((field - wide).sum(dtype=float) * voxel_ml)
