"""A brain's pial surface and its cortical thickness from a volume of tissue labels."""

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import TriangleMesh, area, corners
from ..parameters.schemes import LabelScheme
from ..units import ML_PER_MM3
from .brain_pose import DOUBTFUL_BRAIN, NARROWEST_BRAIN, narrowness, pose_of_labels
from .cerebrum import cerebrum_labels, report_border, report_dropped
from .extraction import (
    COMPARABLE,
    LEVEL,
    PAD_VOXELS,
    crop,
    isosurface,
    main_parts,
    make_simple,
    refine,
    remove_bridges,
    shifted_affine,
    smooth_mask,
)
from .fissure import (
    SHIFTED_MM,
    Fissure,
    between,
    fissure_between,
    fissure_between_labels,
    open_fissure,
    plane_between_labels,
    sample,
    to_the_right,
)
from .hemispheres import left_faces
from .labels import (
    LEAST_CORTEX_OUTSIDE,
    require_sides,
)
from .orientation import mid_plane
from .outcome import PialSurface
from .pial import TOLD_LOSS, make_sound, motion, pose_surface, warn
from .shrinkage import KEPT, after_repairs, with_volume
from .single_hemisphere import require_one, single_hemisphere
from .size import require_plausible_size
from .thickness import Thickness, cortical_thickness

log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
Labels = NDArray[np.integer]

# labels of cortex below this many voxels are as thick as the voxels allow, not as the cortex is
RESOLVED_VOXELS = 1.5
# slits this near to the mid-surface belong to the fissure
FISSURE_REACH_MM = 3.0
# cosine between the mid-plane's normal and the line from left to right labels: 45°
SAME_AXIS = 0.7
# of the larger hemisphere's volume
SMALLEST_HEMISPHERE = 0.04


def from_labels(
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    *,
    week: float,
    smoothing_voxels: float = 1.0,
    edge_length_mm: float = 1.0,
    smoothing_iterations: int = 10,
    fissure_mm: float = 1.5,
) -> PialSurface:
    """Returns the pial surface around the cerebrum of an (i, j, k) label volume with a (4, 4) affine to RAS+ mm.

    A volume whose axes are wrong is turned as its cerebellum, brainstem and sides say. The cerebrum's mask is smoothed
    (Gaussian, σ = `smoothing_voxels`), freed of handles and turned into an isosurface, which is smoothed, remeshed to
    `edge_length_mm` and turned so that the mid-sagittal plane is x = const, and set outwards by what smoothing took of
    the volume. Where the scheme separates cortex from the tissue inside and cortex labels of both sides touch, the
    fissure is opened there to `fissure_mm` (0: left shut). It is half-way between the labels of the two sides where the
    scheme has them. InputError for labels that don't fit the scheme or the week and for one hemisphere alone, MeshError
    where the surface stays tangled.
    """
    report: dict[str, Any] = {"source": "labels", "scheme": scheme.name}
    tissue = cerebrum_labels(labels, affine, scheme, report, LEAST_CORTEX_OUTSIDE)
    rotation = _turn(labels, affine, scheme, report)
    affine = motion(rotation) @ affine
    mask = np.isin(tissue, scheme.cerebrum)
    volume = float(mask.sum() * abs(np.linalg.det(affine[:3, :3])))
    box, first = crop(mask)
    extents = np.linalg.norm(affine[:3, :3], axis=0) * [side.stop - side.start for side in box]
    for doubt in require_plausible_size(volume, extents, week):
        warn(report, doubt)
    report["mask_volume_mL"] = volume * ML_PER_MM3
    report_border(mask, report)
    mask, tissue = np.pad(mask[box], PAD_VOXELS), np.pad(tissue[box], PAD_VOXELS)
    affine = shifted_affine(affine, first)
    field = smooth_mask(mask, smoothing_voxels)
    core = mask & ~np.isin(tissue, scheme.cortex)
    _require_both(tissue, scheme, field, affine, report)
    # medial walls of the tissue inside the cortex show the fissure even where the cortex hides it
    walls = isosurface(smooth_mask(core, smoothing_voxels) if scheme.cortex else field, affine)
    plane = mid_plane(walls)
    to_right = to_the_right(tissue, scheme, affine) if scheme.left and scheme.right else None
    if to_right is not None and abs(plane.normal @ _between_sides(tissue, scheme, affine)) < SAME_AXIS:
        plane = plane_between_labels(to_right, affine, mask)
        warn(report, "the hemispheres are no mirror images of each other: the mid-plane is that of their labels")
    require_sides(tissue, scheme, affine, plane.normal)
    fissure = fissure_between(walls, plane)
    if to_right is not None:
        fissure = fissure_between_labels(to_right, affine, fissure)
    if (shift := float(np.abs(fissure.heights).max())) > SHIFTED_MM:
        warn(report, f"the fissure bends away from its plane by up to {shift:.0f} mm: check it")
    grid, opens = affine, bool(scheme.cortex) and fissure_mm > 0
    # what smoothing would shut, and reopened slits leave shut, is not shown
    slit, _ = remove_bridges(mask, field, smoothing_voxels, np.zeros_like(mask))
    hidden = fissure.hidden(slit > LEVEL, affine, fissure_mm)
    # where it is hidden, the fissure is opened whole, down to what joins the hemispheres
    left_shut = fissure.near(mask.shape, affine, FISSURE_REACH_MM, hidden) if opens else np.zeros_like(mask)
    field, report["slit_voxels_reopened"] = remove_bridges(mask, field, smoothing_voxels, left_shut)
    if opens:
        field, affine, report["fissure_opened_mL"] = _with_fissure(field, affine, core, fissure, fissure_mm, hidden)
    # where labels say which side is which, a hemisphere may be far smaller than the other one
    field, report["topology"] = make_simple(field, COMPARABLE if to_right is None else SMALLEST_HEMISPHERE)
    report_dropped(report["topology"], affine, volume, report)
    rough = isosurface(field, affine)
    mesh = make_sound(rough, smoothing_iterations, edge_length_mm, report)
    expected = after_repairs(volume, report["topology"], affine) - report.get("fissure_opened_mL", 0.0) / ML_PER_MM3
    mesh, report["smoothing"] = with_volume(mesh, expected, area(rough))
    if abs(change := report["smoothing"]["volume_change"]) > KEPT:
        warn(report, f"smoothing changed the volume by {100 * change:.1f} %: finer voxels or less smoothing keep it")
    centres = corners(mesh).mean(axis=1)
    # between the walls of the surface itself: cortex may be thicker on one side than on the other
    heights = between(mesh, fissure).height_above(centres) if to_right is None else sample(to_right, grid, centres)
    left = left_faces(mesh, heights)
    return pose_surface(mesh, left, plane, report, week, rotation)


def hemisphere_from_labels(
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    side: str,
    *,
    week: float,
    smoothing_voxels: float = 1.0,
    edge_length_mm: float = 1.0,
    smoothing_iterations: int = 10,
) -> PialSurface:
    """Returns the pial surface of the only hemisphere of an (i, j, k) label volume, "left" or "right".

    It is made as `from_labels` makes that of both, and posed as `from_hemisphere` does. InputError where the volume
    holds a whole brain, or labels of the other side.
    """
    report: dict[str, Any] = {"source": "hemisphere", "side": side, "scheme": scheme.name}
    # the wall towards the side that is not there may have no cortex
    tissue = cerebrum_labels(labels, affine, scheme, report)
    others = np.intersect1d(scheme.right if side == "left" else scheme.left, scheme.cortex)
    if len(others) and np.isin(tissue, others).any():
        raise InputError(
            f"the volume holds labels of another hemisphere than the {side} one",
            found=", ".join(scheme.labels[n] for n in others if (tissue == n).any()),
            expected=f"those of the {side} hemisphere",
            remedy="Set its side; or give the whole brain as labels.",
        )
    mask = np.isin(tissue, scheme.cerebrum)
    volume = float(mask.sum() * abs(np.linalg.det(affine[:3, :3])))
    box, first = crop(mask)
    extents = np.linalg.norm(affine[:3, :3], axis=0) * [along.stop - along.start for along in box]
    for doubt in require_plausible_size(2.0 * volume, extents, week):
        warn(report, doubt)
    report["mask_volume_mL"] = volume * ML_PER_MM3
    report_border(mask, report)
    affine = shifted_affine(affine, first)
    field, report["topology"] = make_simple(smooth_mask(np.pad(mask[box], PAD_VOXELS), smoothing_voxels))
    report_dropped(report["topology"], affine, volume, report)
    rough = isosurface(field, affine)
    require_one(rough)
    mesh = make_sound(rough, smoothing_iterations, edge_length_mm, report)
    mesh, report["smoothing"] = with_volume(mesh, after_repairs(volume, report["topology"], affine), area(rough))
    return single_hemisphere(mesh, side, "auto", report, week)


def thickness_from_labels(
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    surface: TriangleMesh,
    pose: Floats,
    *,
    smoothing_voxels: float = 1.0,
) -> Thickness:
    """Returns the cortical thickness at the vertices of the pial surface that `from_labels` made of the same labels.

    Parameters
    ----------
    labels, affine, scheme, smoothing_voxels
        As for `from_labels`; the scheme has to separate cortex from the tissue inside.
    surface
        The whole pial surface, posed.
    pose : (4, 4) float
        The motion from the labels' world to the surface's, as in the report of `from_labels`.
    """
    affine = pose @ affine
    tissue = cerebrum_labels(labels, affine, scheme, {})
    box, first = crop(np.isin(tissue, scheme.cerebrum))
    tissue = np.pad(tissue[box], PAD_VOXELS)
    cerebrum, cortex = np.isin(tissue, scheme.cerebrum), np.isin(tissue, scheme.cortex)
    thickness = cortical_thickness(surface, cerebrum, cortex, shifted_affine(affine, first), smoothing_voxels)
    thickness.report["warnings"] = []
    suggested, voxels = thickness.report["suggested_thickness_mm"], thickness.report["voxels_through_cortex"]
    log.info("cortical thickness: %.2f mm on average, a suggestion for thickness_mm", suggested)
    if voxels < RESOLVED_VOXELS:
        warn(thickness.report, f"the cortex's labels are {voxels:.1f} voxels thick: their thickness is a coarse one")
    return thickness


def _turn(labels: Labels, affine: Floats, scheme: LabelScheme, report: dict[str, Any]) -> Floats:
    """Returns the rotation (3, 3) that brings the volume to RAS+."""
    pose = pose_of_labels(labels, affine, scheme)
    if pose is None:
        report["pose_by"] = "file"
        return np.eye(3)
    report["pose_by"] = pose.by
    for warning in pose.warnings:
        warn(report, warning)
    return pose.rotation


def _between_sides(tissue: Labels, scheme: LabelScheme, affine: Floats) -> Floats:
    """Returns the unit vector (3,) from the middle of the left labels to that of the right ones."""
    left, right = (np.argwhere(np.isin(tissue, side)).mean(axis=0) for side in (scheme.left, scheme.right))
    vector = affine[:3, :3] @ (right - left)
    return np.asarray(vector / np.linalg.norm(vector))


def _require_both(
    tissue: Labels, scheme: LabelScheme, field: NDArray[np.float32], affine: Floats, report: dict[str, Any]
) -> None:
    """Raises InputError where there is one hemisphere only, by its labels or by its shape."""
    remedy = "Give a volume with both hemispheres; or the only one under hemisphere, with its side."
    sides = {
        name: bool(np.isin(tissue, np.intersect1d(numbers, scheme.cortex or scheme.cerebrum)).any())
        for name, numbers in (("left", scheme.left), ("right", scheme.right))
    }
    # a part that is left out below, for its size, makes no second hemisphere
    parts, _, _ = main_parts(field > LEVEL, SMALLEST_HEMISPHERE if scheme.left else COMPARABLE)
    shape = narrowness(isosurface(smooth_mask(parts, 1.0), affine))
    if scheme.left and sum(sides.values()) == 1:
        side, other = ("left", "right") if sides["left"] else ("right", "left")
        # as a hemisphere that is alone it would be refused for its width
        if shape > DOUBTFUL_BRAIN:
            raise InputError(
                f"a whole brain has labels of the {side} hemisphere only",
                found=f"a cerebrum whose narrowest extent is {shape:.2f} of its longest",
                expected=f"labels of the {other} hemisphere's {'cortex' if scheme.cortex else 'cerebrum'} too",
                remedy="Give each hemisphere its own labels; or choose a scheme without left and right.",
            )
        raise InputError(
            "the volume holds one hemisphere only",
            found=f"labels of the {side} hemisphere",
            expected="both hemispheres",
            remedy=remedy,
        )
    # a brain that the field of view cuts off may be as flat, which has been reported already
    if shape < NARROWEST_BRAIN and report["border_share"] <= TOLD_LOSS:
        raise InputError(
            "the volume seems to hold one hemisphere only",
            found=f"a cerebrum whose narrowest extent is {shape:.2f} of its longest",
            expected=f"{NARROWEST_BRAIN} or more, as in whole cerebra",
            remedy=remedy,
        )
    if shape < DOUBTFUL_BRAIN:
        warn(report, f"the cerebrum is narrow ({shape:.2f} of its length): are both hemispheres there?")


def _with_fissure(
    field: NDArray[np.float32],
    affine: Floats,
    core: NDArray[np.bool_],
    fissure: Fissure,
    gap_mm: float,
    hidden: NDArray[np.bool_],
) -> tuple[NDArray[np.float32], NDArray[np.float64], float]:
    """Returns the field with the fissure opened, its affine, and the volume (mL) that this took.

    Where more than a thousandth of the brain is taken, the fissure was shut; voxels that are too coarse for its new
    walls are then made finer first.
    """
    wide = open_fissure(field, affine, core, fissure, gap_mm, hidden)
    # an opening of less than two voxels would be lost between them
    factor = int(np.ceil(1.8 * np.linalg.norm(affine[:3, :3], axis=0).max() / gap_mm))
    if factor > 1 and (field - wide).sum(dtype=float) > 1e-3 * field.sum(dtype=float):
        solid, _ = refine(core.astype(np.float32), affine, factor)
        field, affine = refine(field, affine, factor)
        wide = open_fissure(field, affine, solid > 0.5, fissure, gap_mm, hidden)
    voxel_ml = abs(np.linalg.det(affine[:3, :3])) * ML_PER_MM3
    return wide, affine, float((field - wide).sum(dtype=float) * voxel_ml)
