"""A brain's pial surface from each kind of input, posed in RAS+ mm: the calls of the surface stage."""

import logging
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gyriflow.geometry.triangles import TriangleMesh, area, corners, merged, signed_volume, transformed
from gyriflow.parameters.schemes import LabelScheme
from gyriflow.surface.extraction import (
    PAD_VOXELS,
    cropped,
    isosurface,
    made_simple,
    refined,
    shifted_affine,
    smoothed_mask,
    unbridged,
)
from gyriflow.surface.fissure import Fissure, fissure_between, opened
from gyriflow.surface.halves import pair_by_shape
from gyriflow.surface.hemispheres import (
    least_gap,
    left_faces,
    parted,
    require_common_pose,
    require_pair,
    set_apart,
    split,
)
from gyriflow.surface.labels import cerebrum_mask, require_sides
from gyriflow.surface.orientation import MidPlane, mid_plane, upright
from gyriflow.surface.outcome import PialSurface, described, faults, require_sound
from gyriflow.surface.posing import as_poses, placed, poses
from gyriflow.surface.remaking import remade
from gyriflow.surface.remeshing import evened
from gyriflow.surface.repair import cleaned, pieces
from gyriflow.surface.sides import fissure_between_labels, sampled, to_the_right
from gyriflow.surface.size import require_plausible_size
from gyriflow.surface.thickness import Thickness, cortical_thickness
from gyriflow.surface.volume import KEPT, after_repairs, with_volume
from gyriflow.units import ML_PER_MM3

log = logging.getLogger(__name__)

Coordinates = Literal["auto", "ras", "lps"]
LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
# labels of cortex below this many voxels are as thick as the voxels allow, not as the cortex is
RESOLVED_VOXELS = 1.5
# slits this near to the mid-surface belong to the fissure
FISSURE_REACH_MM = 3.0
# beyond this part of the brain's width the mid-sagittal plane is doubtful
DOUBTFUL_ASYMMETRY = 0.03


def from_labels(
    labels: NDArray[np.integer],
    affine: NDArray[np.float64],
    scheme: LabelScheme,
    *,
    week: float,
    smoothing_voxels: float = 1.0,
    edge_length_mm: float = 1.0,
    smoothing_iterations: int = 10,
    fissure_mm: float = 1.5,
) -> PialSurface:
    """Returns the pial surface around the cerebrum of an (i, j, k) label volume with a (4, 4) affine to RAS+ mm.

    The cerebrum's mask is smoothed (Gaussian, σ = `smoothing_voxels`), freed of handles and turned into an
    isosurface, which is smoothed, remeshed to `edge_length_mm` and turned so that the mid-sagittal plane is
    x = const, and set outwards by what smoothing took of the volume. Where the scheme tells cortex from the tissue
    inside and cortex labels of both sides touch, the fissure is opened to `fissure_mm` (0: left shut).
    The fissure is half-way between the labels of the two sides where the scheme has them.
    InputError for labels that don't fit the scheme or the week, MeshError where the surface stays tangled.
    """
    mask = cerebrum_mask(labels, scheme)
    volume = float(mask.sum() * abs(np.linalg.det(affine[:3, :3])))
    box, first = cropped(mask)
    extents = np.linalg.norm(affine[:3, :3], axis=0) * [side.stop - side.start for side in box]
    require_plausible_size(volume, extents, week)
    report: dict[str, Any] = {"source": "labels", "scheme": scheme.name, "mask_volume_mL": volume * ML_PER_MM3}
    mask, tissue = np.pad(mask[box], PAD_VOXELS), np.pad(labels[box], PAD_VOXELS)
    affine = shifted_affine(affine, first)
    field = smoothed_mask(mask, smoothing_voxels)
    core = mask & ~np.isin(tissue, scheme.cortex)
    # medial walls of the tissue inside the cortex show the fissure even where the cortex hides it
    walls = isosurface(smoothed_mask(core, smoothing_voxels) if scheme.cortex else field, affine)
    plane = mid_plane(walls)
    require_sides(tissue, scheme, affine, plane.normal)
    fissure = fissure_between(walls, plane)
    to_right = to_the_right(tissue, scheme, affine) if scheme.left and scheme.right else None
    if to_right is not None:
        fissure = fissure_between_labels(to_right, affine, fissure)
    grid, opens = affine, bool(scheme.cortex) and fissure_mm > 0
    # the fissure is opened whole, down to what joins the hemispheres
    left_shut = fissure.near(mask.shape, affine, FISSURE_REACH_MM) if opens else np.zeros_like(mask)
    field, report["slit_voxels_reopened"] = unbridged(mask, field, smoothing_voxels, left_shut)
    if opens:
        field, affine, report["fissure_opened_mL"] = _with_fissure(field, affine, core, fissure, fissure_mm)
    field, report["topology"] = made_simple(field)
    rough = isosurface(field, affine)
    mesh = _even(rough, smoothing_iterations, edge_length_mm, report)
    expected = after_repairs(volume, report["topology"], affine) - report.get("fissure_opened_mL", 0.0) / ML_PER_MM3
    mesh, report["smoothing"] = with_volume(mesh, expected, area(rough))
    if abs(change := report["smoothing"]["volume_change"]) > KEPT:
        _warn(report, f"smoothing changed the volume by {100 * change:.1f} %: finer voxels or less smoothing keep it")
    centres = corners(mesh).mean(axis=1)
    left = left_faces(mesh, fissure.height_above(centres) if to_right is None else sampled(to_right, grid, centres))
    return _posed(mesh, left, plane, report, week)


def thickness_from_labels(
    labels: NDArray[np.integer],
    affine: NDArray[np.float64],
    scheme: LabelScheme,
    surface: TriangleMesh,
    pose: NDArray[np.float64],
    *,
    smoothing_voxels: float = 1.0,
) -> Thickness:
    """Returns the cortical thickness at the vertices of the pial surface that `from_labels` made of the same labels.

    Parameters
    ----------
    labels, affine, scheme, smoothing_voxels
        As for `from_labels`; the scheme has to tell cortex from the tissue inside.
    surface
        The whole pial surface, posed.
    pose : (4, 4) float
        The motion from the labels' world to the surface's, as in the report of `from_labels`.
    """
    mask = cerebrum_mask(labels, scheme)
    box, first = cropped(mask)
    mask, tissue = np.pad(mask[box], PAD_VOXELS), np.pad(labels[box], PAD_VOXELS)
    pial = transformed(surface, np.linalg.inv(pose))
    cortex = np.isin(tissue, scheme.cortex)
    thickness = cortical_thickness(pial, mask, cortex, shifted_affine(affine, first), smoothing_voxels)
    thickness.report["warnings"] = []
    suggested, voxels = thickness.report["suggested_thickness_mm"], thickness.report["voxels_through_cortex"]
    log.info("cortical thickness: %.2f mm on average, a suggestion for thickness_mm", suggested)
    if voxels < RESOLVED_VOXELS:
        message = f"the cortex's labels are {voxels:.1f} voxels thick: their thickness is a coarse one"
        _warn(thickness.report, message)
    return thickness


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
) -> PialSurface:
    """Returns the pial surface of a brain from closed surfaces of its hemispheres.

    The surfaces are repaired (holes up to `max_hole_mm`), posed, smoothed, remeshed to `edge_length_mm`, turned
    together so that the mid-sagittal plane is x = const, and moved apart along x until they are `gap_mm` from each
    other. With coordinates "auto" each may be in any rigid pose; `posing` is then the report of the pose if it is
    known already, as from all brains of a study. InputError where the pose cannot be told, where they are swapped, of
    different size or not of the week's size; MeshError where one can't be made a closed surface without handles and
    intersections.
    """
    report: dict[str, Any] = {"source": "hemispheres", "coordinates": coordinates}
    left, report["repair_left"] = hemisphere(_in_ras(left, coordinates), max_hole_mm)
    right, report["repair_right"] = hemisphere(_in_ras(right, coordinates), max_hole_mm)
    volume = signed_volume(left) + signed_volume(right)
    require_plausible_size(volume, np.ptp(merged(left, right).vertices, axis=0), week)
    posed = None
    if coordinates == "auto":
        posed = as_poses(posing) if posing else poses([pair_by_shape(left, right)], [False])[0]
        left, right = transformed(left, posed.left), transformed(right, posed.right)
        for warning in posed.report["warnings"]:
            _warn(report, warning)
    both = merged(left, right)
    require_pair(left, right)
    left = _even(left, smoothing_iterations, edge_length_mm, report, "mesh_left")
    right = _even(right, smoothing_iterations, edge_length_mm, report, "mesh_right")
    plane = mid_plane(merged(left, right))
    require_common_pose(plane.asymmetry_mm, float(np.ptp(both.vertices, axis=0).max()))
    report["gap_before_mm"] = least_gap(left, right)
    to_right = plane.normal
    left, right, moved = set_apart(left, right, gap_mm, to_right)
    report["moved_apart_mm"] = moved
    if moved > 0:
        _warn(report, f"the hemispheres were moved apart by {moved:.2f} mm each, to a gap of {gap_mm:g} mm")
        plane = mid_plane(merged(left, right))
    mesh = merged(left, right)
    surface = _posed(mesh, np.arange(len(mesh.faces)) < len(left.faces), plane, report, week)
    if posed:
        turn = np.array(report["pose"])
        report["posing"] = placed(posed, turn, moved * to_right)
        if posed.report["together"]:
            report["pose"] = (turn @ posed.left).tolist()
    return surface


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
    mesh, report["repair"] = cleaned(_in_ras(mesh, coordinates), max_hole_mm)
    require_plausible_size(signed_volume(mesh), np.ptp(mesh.vertices, axis=0), week)
    mesh = _even(mesh, smoothing_iterations, edge_length_mm, report)
    plane = mid_plane(mesh)
    fissure = fissure_between(mesh, plane)
    left = left_faces(mesh, fissure.height_above(corners(mesh).mean(axis=1)))
    return _posed(mesh, left, plane, report, week)


def from_shape(mesh: TriangleMesh, *, week: float) -> PialSurface:
    """Returns a simple geometry as it is, in the place of a brain: its left and right meet at x = 0.

    It has no fissure to be found and no size of its own, and smoothing would round its edges. MeshError where it is
    not closed or cuts itself.
    """
    require_sound(mesh)
    pose = {"pose": np.eye(4).tolist(), "rotation_deg": 0.0}
    return described(mesh, *split(mesh, 0.0), 0.0, {"source": "shape", **pose}, week)


def _with_fissure(
    field: NDArray[np.float32], affine: NDArray[np.float64], core: NDArray[np.bool_], fissure: Fissure, gap_mm: float
) -> tuple[NDArray[np.float32], NDArray[np.float64], float]:
    """Returns the field with the fissure opened, its affine, and the volume (mL) that this took.

    Where more than a thousandth of the brain is taken, the fissure was shut; voxels that are too coarse for its new
    walls are then made finer first.
    """
    wide = opened(field, affine, core, fissure, gap_mm)
    # an opening of less than two voxels would be lost between them
    factor = int(np.ceil(1.8 * np.linalg.norm(affine[:3, :3], axis=0).max() / gap_mm))
    if factor > 1 and (field - wide).sum(dtype=float) > 1e-3 * field.sum(dtype=float):
        solid, _ = refined(core.astype(np.float32), affine, factor)
        field, affine = refined(field, affine, factor)
        wide = opened(field, affine, solid > 0.5, fissure, gap_mm)
    voxel_ml = abs(np.linalg.det(affine[:3, :3])) * ML_PER_MM3
    return wide, affine, float((field - wide).sum(dtype=float) * voxel_ml)


def hemisphere(mesh: TriangleMesh, max_hole_mm: float) -> tuple[TriangleMesh, dict[str, Any]]:
    """Returns the largest piece of a surface, clean, and the repairs."""
    mesh, repairs = cleaned(mesh, max_hole_mm)
    largest, *others = pieces(mesh)
    repairs["pieces"], repairs["pieces_dropped"] = 1, repairs["pieces_dropped"] + len(others)
    repairs["area_dropped_mm2"] += sum(area(piece) for piece in others)
    return largest, repairs


def _in_ras(mesh: TriangleMesh, coordinates: Coordinates) -> TriangleMesh:
    return transformed(mesh, LPS_TO_RAS) if coordinates == "lps" else mesh


def _even(
    mesh: TriangleMesh, smoothing_iterations: int, edge_length_mm: float, report: dict[str, Any], name: str = "mesh"
) -> TriangleMesh:
    """Returns the surface smoothed and remeshed, each piece a sphere that does not cut itself.

    Where the triangles can't be repaired, the surface is made anew through voxels of half an edge length.
    """
    even, report[name] = evened(mesh, smoothing_iterations, edge_length_mm)
    if faults(even):
        _warn(report, f"the surface was made anew through voxels, since it had {faults(even)}")
        mesh, report[name.replace("mesh", "remade")] = remade(mesh, 0.5 * edge_length_mm)
        even, report[name] = evened(mesh, smoothing_iterations, edge_length_mm)
    require_sound(even)
    return even


def _posed(
    mesh: TriangleMesh, is_left: NDArray[np.bool_], plane: MidPlane, report: dict[str, Any], week: float
) -> PialSurface:
    """Returns the surface with its mid-sagittal plane turned to x = const, its hemispheres and the whole report."""
    matrix, angle = upright(plane, mesh.vertices.mean(axis=0))
    whole = transformed(mesh, matrix)
    left, right = parted(whole, is_left)
    # where the plane, which may have kept a tilt below half a degree, passes the brain's centre
    normal = matrix[:3, :3] @ plane.normal
    offset = plane.offset + normal @ matrix[:3, 3]
    fissure_x = float((offset - normal[1:] @ whole.vertices.mean(axis=0)[1:]) / normal[0])
    width = float(np.ptp(whole.vertices[:, 0]))
    if plane.fissure_points == 0:
        _warn(report, "no fissure was found between facing walls: its place is that of the plane of mirror symmetry")
    if plane.asymmetry_mm > DOUBTFUL_ASYMMETRY * width:
        _warn(report, f"the brain is far from mirror-symmetric ({plane.asymmetry_mm:.1f} mm): check its pose")
    report |= {
        "pose": matrix.tolist(),
        "rotation_deg": angle,
        "fissure_points": plane.fissure_points,
        "fissure_scatter_mm": plane.scatter_mm,
        "asymmetry_mm": plane.asymmetry_mm,
    }
    return described(whole, left, right, fissure_x, report, week)


def _warn(report: dict[str, Any], message: str) -> None:
    log.warning(message)
    report.setdefault("warnings", []).append(message)
