"""Make a brain's posed pial surface from a label volume, from surface files or from a
simple shape."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, MeshError
from ..geometry import triangles
from ..geometry.alignment import angle_deg, motion
from ..geometry.deformations import voxel_size
from ..geometry.poses import CONVENTIONS, Pose
from ..geometry.triangles import TriangleMesh
from ..geometry.voxels import distance_to
from ..settings.schemes import LabelScheme
from ..settings.terms import FUSED_AFTER_GW, SIDES, Coordinates, Side
from ..units import CM2_PER_MM2, ML_PER_MM3
from . import extraction, fissure, plausible, repair
from . import pose as posing
from .extraction import LEVEL, Floats, Mask
from .fissure import MidPlane
from .labels import (
    MIN_CORTEX_OUTSIDE,
    REPORTED_LOSS,
    Cerebrum,
    Labels,
    layout_of,
    read_cerebrum,
    require_sides,
    scheme_contradictions,
)
from .repair import RepairedSurface
from .sulci import open_fused_sulci
from .thickness import Cortex, cortex_of

# the mid-plane agrees with the labels if this is the cosine between its normal and the
# line from left to right: 45°
MIN_AXIS_COSINE = 0.7
# an asymmetry of more than this share of the brain's width gives a warning
MAX_USUAL_ASYMMETRY = 0.03
# largest ratio of the hemispheres' areas; with 4 % of the volume it is about 10
MAX_AREA_RATIO = 15.0
# voxels of this size are fine enough to determine the pose by shape
POSE_VOXEL_MM = 1.5
# smallest gap between hemispheres from surfaces
MIN_GAP_MM = 0.5


@dataclass(frozen=True, eq=False)
class PialSurface:
    """A posed pial surface in RAS+ mm.

    `whole` is closed and outward, in one or two pieces. `left` and `right` (None if
    missing) are its parts, open where cut at the fissure, the plane x = `fissure_x_mm`,
    and at capped medial walls. `pose` leads from the brain's files. `cortex` is that of
    the labels, in their coordinates; None without.
    """

    whole: TriangleMesh
    left: TriangleMesh | None
    right: TriangleMesh | None
    fissure_x_mm: float
    pose: Pose
    report: dict[str, Any]
    cortex: Cortex | None = None


@dataclass
class _Brain:
    """The week, report and warnings of a brain while its surface is made."""

    week: float
    report: dict[str, Any]
    warnings: list[str] = field(default_factory=list)

    def warn(self, warnings: Iterable[str]) -> None:
        """Log warnings and keep them."""
        self.warnings += plausible.logged(warnings)

    def take(self, surface: RepairedSurface, suffix: str = "") -> None:
        """Keep the warnings and the report of repairs, its keys with a suffix."""
        self.report |= {
            f"{key}{suffix}": value for key, value in surface.report.items()
        }
        self.warn(surface.warnings)


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
    """Return the pial surface around the cerebrum of an (i, j, k) label volume with a
    (4, 4) affine to RAS+ mm.

    The pose follows from cerebellum, brainstem and sides, or else from the shape. The
    mask is smoothed (Gaussian, σ = 1 voxel) and freed of handles; its surface is
    smoothed, remeshed to `edge_length_mm`, freed of terraces, given the mask's volume,
    and rotated so that the mid-plane is x = const. Where cortex labels of both sides
    touch, the fissure is opened to 1.5 mm; with `open_sulci`, fused sulci are. A
    hemisphere (`side`) is posed as in `from_surface`.

    InputError if the labels do not fit the scheme, the week or the `side`. MeshError if
    self-intersections remain.
    """
    brain = _Brain(
        week, {"source": "hemisphere", "side": side} if side else {"source": "labels"}
    )
    # the medial wall of a single hemisphere may have no cortex
    cerebrum = read_cerebrum(
        labels, affine, scheme, 0.0 if side else MIN_CORTEX_OUTSIDE
    )
    brain.report |= {"scheme": scheme.name, **cerebrum.report}
    brain.warn(cerebrum.warnings)
    smooth = extraction.smooth_mask(cerebrum.mask)
    pose = _checked_pose(cerebrum, smooth, labels, affine, scheme, side, brain)
    affine = pose.world @ cerebrum.affine
    grid, removed_ml = affine, 0.0
    side_mm: NDArray[np.float32] = np.zeros(0, dtype=np.float32)
    cortex = cortex_of(cerebrum, scheme)
    if not side:
        plane, side_mm = _fissure_of_labels(
            cerebrum, cortex.core, smooth, affine, scheme, brain
        )
        smooth, brain.report["slit_voxels_reopened"] = extraction.remove_bridges(
            cerebrum.mask, smooth
        )
    original = smooth, grid
    if scheme.cortex and not side:
        smooth, affine, removed_ml = _with_fissure(smooth, affine, side_mm, cortex.core)
        brain.report["fissure_opened_mL"] = removed_ml
    if open_sulci:
        smooth, affine, taken_ml = _with_sulci(
            smooth, affine, cerebrum, cortex, scheme, None if side else side_mm, brain
        )
        removed_ml += taken_ml
    even = repair.surface_of_mask(
        smooth,
        affine,
        cerebrum.volume_mm3,
        edge_length_mm,
        smallest=extraction.COMPARABLE if side else cerebrum.smallest_part,
        taken_mm3=removed_ml / ML_PER_MM3,
        original=original,
    )
    brain.take(even)
    if side:
        plausible.require_single_hemisphere(even.mesh)
        surface = _one_side(
            even,
            side,
            posing.pose_of_hemisphere(even.mesh, side, "auto", of_volume=True),
            brain,
        )
    else:
        heights = fissure.sample(
            side_mm,
            grid,
            triangles.corners(even.mesh).mean(axis=1),
        )
        surface = _two_sides(
            even,
            fissure.left_faces(even.mesh, heights),
            plane,
            pose,
            brain,
        )
    return replace(surface, cortex=cortex if scheme.cortex else None)


def _checked_pose(
    cerebrum: Cerebrum,
    field: NDArray[np.float32],
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    side: Side | None,
    brain: _Brain,
) -> Pose:
    """Check the size, sides and shape of a cerebrum, with its smoothed `field`, and
    return its pose; that of a hemisphere is found from its surface later."""
    pose = None if side else posing.pose_of_labels(labels, affine, scheme)
    labelled = np.intersect1d(cerebrum.tissue, scheme.cortex or scheme.cerebrum)
    sides = [
        name
        for name, numbers in (("left", scheme.left), ("right", scheme.right))
        if {*labelled} & {*numbers}
    ]
    if side and set(sides) - {side}:
        raise InputError(
            f"the volume contains labels of another hemisphere than the {side} one"
        )
    brain.warn(
        plausible.require_plausible_size(
            (2.0 if side else 1.0) * cerebrum.volume_mm3, brain.week
        )
    )
    if (share := cerebrum.report["border_share"]) > REPORTED_LOSS:
        cut = (
            f"the border of the volume cuts the cerebrum at {100 * share:.0f} % of its"
            " surface"
        )
        wall = "unless it is the medial wall, " if side else ""
        brain.warn(
            [f"{cut}: {wall}parts outside are missing, and the surface is flat there"]
        )
    if not side:
        brain.warn(scheme_contradictions(layout_of(labels), scheme))
        if len(sides) == 1:
            raise InputError(
                f"the volume has labels of the {sides[0]} hemisphere only",
                expected="labels of both hemispheres",
                remedy=(
                    "If there is one hemisphere, give its side, as `side: left`. If"
                    " both have these labels, name their scheme, which is without left"
                    " and right."
                ),
            )
        # parts that are removed below because of their size do not count
        parts, _, _ = extraction.main_parts(field > LEVEL, cerebrum.smallest_part)
        surface = extraction.isosurface(extraction.smooth_mask(parts), cerebrum.affine)
        # a brain that is cut by the field of view may be as narrow, which has been
        # reported already
        brain.warn(
            plausible.require_whole(surface, "volume", refuses=share <= REPORTED_LOSS)
        )
        if pose is None:
            every = max(int(POSE_VOXEL_MM / voxel_size(affine).max()), 1)
            coarse = extraction.unambiguous(field[::every, ::every, ::every])
            rough = extraction.isosurface(
                coarse, cerebrum.affine @ np.diag([every, every, every, 1.0])
            )
            pose = posing.pose_of_volume_by_shape(
                rough, has_sides=bool(scheme.left and scheme.right)
            )
        brain.warn(pose.warnings)
    return pose or Pose()


def _fissure_of_labels(
    cerebrum: Cerebrum,
    core: Mask,
    field: NDArray[np.float32],
    affine: Floats,
    scheme: LabelScheme,
    brain: _Brain,
) -> tuple[MidPlane, NDArray[np.float32]]:
    """Return the mid-plane, and each voxel's distance from the surface between the
    hemispheres."""
    mask, has_sides = cerebrum.mask, bool(scheme.left and scheme.right)
    # medial walls of the tissue inside the cortex show the fissure even where the
    # cortex hides it
    walls = extraction.isosurface(
        extraction.smooth_mask(core) if scheme.cortex else field, affine
    )
    plane = fissure.mid_plane(walls)
    sides = [
        np.isin(cerebrum.tissue, labels)
        for labels in (scheme.left, scheme.right)
        if has_sides
    ]
    if has_sides:
        left, right = sides
        axis = affine[:3, :3] @ (
            np.argwhere(right).mean(axis=0) - np.argwhere(left).mean(axis=0)
        )
        if abs(plane.normal @ (axis / np.linalg.norm(axis))) < MIN_AXIS_COSINE:
            plane = fissure.plane_between_labels(left, right, affine, mask)
            brain.warn(
                [
                    "the hemispheres are not mirror images of each other: the mid-plane"
                    " is that of their labels"
                ]
            )
    require_sides(cerebrum.tissue, scheme, affine, plane.normal)
    return plane, fissure.side_distance(
        mask,
        core if scheme.cortex else mask,
        affine,
        fissure.fissure_between(walls, plane),
        *sides,
    )


def _with_fissure(
    field: NDArray[np.float32],
    affine: Floats,
    side_mm: NDArray[np.float32],
    core: Mask,
) -> tuple[NDArray[np.float32], Floats, float]:
    """Open a hidden fissure as a whole; return the field, its affine, and the volume
    removed (mL).

    Where more than a thousandth of the brain is removed, voxels too coarse for its
    walls are refined first.
    """
    size = voxel_size(affine)
    # an opening of less than two voxels would be lost
    factor = int(np.ceil(1.8 * size.max() / fissure.FISSURE_MM))
    for bridges in (False, True):
        hidden = fissure.hidden_fissure(
            side_mm, field > LEVEL, core, affine, bridges=bridges
        )
        if not hidden.any():
            return field, affine, 0.0
        to_hidden = distance_to(hidden, size)
        before, grid = field, affine
        wide = fissure.open_fissure(field, affine, side_mm, to_hidden)
        if factor > 1 and (field - wide).sum(dtype=float) > 1e-3 * field.sum(
            dtype=float
        ):
            distances = (
                extraction.refine(values, affine, factor)[0]
                for values in (side_mm, to_hidden)
            )
            before, grid = extraction.refine(field, affine, factor)
            wide = fissure.open_fissure(before, grid, *distances)
        # tissue that crosses the fissure makes tunnels of it, and closing these would
        # close the fissure
        if not extraction.handles(wide > LEVEL):
            break
    voxel_ml = abs(np.linalg.det(grid[:3, :3])) * ML_PER_MM3
    return wide, grid, float((before - wide).sum(dtype=float) * voxel_ml)


def _with_sulci(
    field: NDArray[np.float32],
    affine: Floats,
    cerebrum: Cerebrum,
    cortex: Cortex,
    scheme: LabelScheme,
    side_mm: NDArray[np.float32] | None,
    brain: _Brain,
) -> tuple[NDArray[np.float32], Floats, float]:
    """Open fused sulci; return the field, its affine, and the volume removed (mL), less
    what closing handles added."""
    reason = _reason_not_to_open(cerebrum, cortex, scheme)
    if reason:
        report: dict[str, Any] = {"stays_fused": reason}
    else:
        # handles are found faster before voxels are refined
        simple, repaired = extraction.make_simple(field, cerebrum.smallest_part)
        opened, fine_affine, report = open_fused_sulci(
            simple, affine, cortex.core, side_mm
        )
    brain.report["sulci"] = report
    if not report.get("sheets"):
        if "stays_fused" in report and brain.week > FUSED_AFTER_GW:
            brain.warn([f"fused sulci were not opened: {report['stays_fused']}"])
        return field, affine, 0.0
    report["repaired_before"] = repaired
    brain.warn(repair.filled_warning(repaired, affine))
    n_filled = int((simple > LEVEL).sum()) - int((field > LEVEL).sum())
    voxel_ml = float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    return opened, fine_affine, report["opened_mL"] - n_filled * voxel_ml


def _reason_not_to_open(
    cerebrum: Cerebrum,
    cortex: Cortex,
    scheme: LabelScheme,
) -> str:
    """Return why labels do not show where sulci are fused; or ''."""
    if not scheme.cortex or not np.isin(cerebrum.tissue, scheme.white_matter).any():
        return "the labels have no white matter"
    if cortex.voxels_through < plausible.MIN_VOXELS:
        return (
            f"the cortex is {cortex.voxels_through:.1f} voxels thick, so roughness of"
            " the labels looks like two banks"
        )
    return ""


def from_hemispheres(
    left: TriangleMesh,
    right: TriangleMesh,
    *,
    week: float,
    coordinates: Coordinates = "ras",
    declared: bool = False,
    edge_length_mm: float = 1.0,
    max_hemisphere_ratio: float = 1.15,
    max_asymmetry: float = 0.02,
) -> PialSurface:
    """Return the pial surface of a brain from surfaces of its hemispheres.

    They are repaired (small holes, open medial walls), posed, smoothed,
    remeshed to `edge_length_mm`, rotated so that the mid-plane is x = const, and moved
    to a gap of 0.5 mm. With coordinates "auto" each may have any rigid pose; `declared`
    is whether both files name one coordinate system. Hemispheres that share the
    vertices of a cut are joined. InputError if the pose is unclear, or they are swapped
    or of different or impossible size; MeshError if one cannot be made sound.
    """
    if (joined := _joined_along_cut(left, right)) is not None:
        connected = from_surface(
            joined,
            week=week,
            coordinates=coordinates,
            edge_length_mm=edge_length_mm,
        )
        to_pose = connected.pose.of_file()
        plausible.require_left_and_right(
            triangles.transformed(left, to_pose),
            triangles.transformed(right, to_pose),
            coordinates,
        )
        return replace(
            connected,
            report=connected.report
            | {
                "source": "hemispheres",
                "joined_along_cut": True,
            },
        )
    brain = _Brain(week, {"source": "hemispheres", "coordinates": coordinates})
    named = coordinates != "auto"
    to_ras = CONVENTIONS[coordinates] if named else np.eye(4)
    parts = [
        repair.sound_pieces(
            triangles.transformed(mesh, to_ras),
            single=True,
            caps_walls=True,
        )
        for mesh in (left, right)
    ]
    for side, part in zip(SIDES, parts, strict=True):
        brain.take(part, f"_{side}")
    left, right = (part.mesh for part in parts)
    brain.warn(
        plausible.require_plausible_size(
            triangles.signed_volume(left) + triangles.signed_volume(right), week
        )
    )
    if named:
        pose = Pose(
            files=dict.fromkeys((*SIDES, "whole"), to_ras),
            by="configuration",
        )
    else:
        pose = posing.pose_of_pair(left, right, declared=declared)
        left = triangles.transformed(left, pose.of_file("left"))
        right = triangles.transformed(right, pose.of_file("right"))
        brain.warn(pose.warnings)
    length = float(
        np.ptp(
            triangles.merged(left, right).vertices,
            axis=0,
        ).max()
    )
    brain.warn(plausible.require_pair(left, right, max_hemisphere_ratio, coordinates))
    if named:
        brain.warn(posing.require_coordinates(left, right, coordinates))
    parts = [
        repair.make_pieces_sound(replace(part, mesh=mesh), edge_length_mm)
        for part, mesh in zip(
            parts,
            (left, right),
            strict=True,
        )
    ]
    for side, part in zip(SIDES, parts, strict=True):
        brain.take(part, f"_{side}")
    surface = replace(
        parts[0],
        mesh=triangles.merged(*(part.mesh for part in parts)),
        is_cap=np.concatenate([part.is_cap for part in parts]),
    )
    plane = fissure.mid_plane(surface.mesh, named=named)
    if plane.asymmetry_mm > max_asymmetry * length:
        raise InputError(
            "the hemispheres are not posed as one brain",
            found=(
                f"{plane.asymmetry_mm:.1f} mm between the surface and its mirror image"
            ),
            expected=f"at most {max_asymmetry * length:.1f} mm",
            remedy=(
                "Give both of one subject in the same coordinates; if they are, set"
                " surface.asymmetric to true."
            ),
        )
    is_left = np.arange(len(surface.mesh.faces)) < len(parts[0].mesh.faces)
    return _two_pieces(surface, is_left, plane, pose, brain, named=named)


def _joined_along_cut(left: TriangleMesh, right: TriangleMesh) -> TriangleMesh | None:
    """Return the closed surface of two open hemispheres with the same vertices along
    their cut, or None."""
    if triangles.is_closed(left) or triangles.is_closed(right):
        return None
    both = triangles.merged(left, right)
    vertices, index = np.unique(
        both.vertices,
        axis=0,
        return_inverse=True,
    )
    joined = TriangleMesh(
        vertices,
        index.reshape(-1)[both.faces],
    )
    return joined if triangles.is_closed(joined) else None


def _two_pieces(
    surface: RepairedSurface,
    is_left: Mask,
    plane: MidPlane,
    pose: Pose,
    brain: _Brain,
    *,
    named: bool,
) -> PialSurface:
    """Return the pial surface of a brain whose hemispheres are closed pieces, with a
    gap between them."""
    left, right = fissure.cut_sides(surface.mesh, is_left)
    is_cap = np.concatenate([surface.is_cap[is_left], surface.is_cap[~is_left]])
    gap, to_right = fissure.smallest_gap(left, right), plane.normal
    left, right, moved = fissure.separate(left, right, MIN_GAP_MM, to_right)
    mesh = triangles.merged(left, right)
    brain.warn(plausible.facing_warnings(left, right, to_right))
    if moved > 0:
        brain.warn(
            [
                f"each hemisphere was moved by {moved:.2f} mm, to a gap of"
                f" {MIN_GAP_MM:g} mm between them"
            ]
        )
        plane = fissure.mid_plane(mesh, named=named)
    shifts = {
        "left": motion(shift=-moved * to_right),
        "right": motion(shift=moved * to_right),
    }
    files = {side: shift @ pose.of_file(side) for side, shift in shifts.items()}
    pose = replace(pose, files={**pose.files, **files})
    brain.report |= {"moved_apart_mm": moved, "gap_before_mm": gap}
    surface = replace(surface, mesh=mesh, is_cap=is_cap)
    return _two_sides(
        surface, np.arange(len(is_cap)) < len(left.faces), plane, pose, brain
    )


def from_surface(
    mesh: TriangleMesh,
    side: Side | None = None,
    *,
    week: float,
    coordinates: Coordinates = "ras",
    edge_length_mm: float = 1.0,
) -> PialSurface:
    """Return the pial surface of a brain, or of a single hemisphere (`side`), from one
    surface.

    It is repaired and posed as in `from_hemispheres`; two pieces get a gap as there.
    The medial wall of a hemisphere is set upright next to x = `fissure_x_mm`.
    InputError if it is not a surface of `side`, or of an impossible size; MeshError if
    it cannot be made sound.
    """
    brain = _Brain(
        week, {"source": "hemisphere", "side": side} if side else {"source": "pial"}
    )
    clean = repair.sound_pieces(
        mesh,
        single=side is not None,
        caps_walls=True,
    )
    brain.take(clean)
    brain.warn(
        plausible.require_plausible_size(
            (2.0 if side else 1.0) * triangles.signed_volume(clean.mesh), week
        )
    )
    if side:
        plausible.require_single_hemisphere(clean.mesh)
    even = repair.make_pieces_sound(clean, edge_length_mm)
    brain.take(even)
    if side:
        pose = posing.pose_of_hemisphere(even.mesh, side, coordinates)
    else:
        brain.warn(plausible.require_whole(even.mesh, "surface"))
        pose = posing.pose_of_surface(even.mesh, coordinates)
    # files that were found in LPS are turned to RAS+, volumes are in RAS+ already
    brain.report["coordinates"] = (
        coordinates if np.array_equal(pose.world, pose.of_file()) else "lps"
    )
    if side:
        return _one_side(even, side, pose, brain)
    brain.warn(pose.warnings)
    even = replace(
        even,
        mesh=triangles.transformed(even.mesh, pose.of_file()),
    )
    is_configured = coordinates != "auto"
    plane = fissure.mid_plane(even.mesh, named=is_configured)
    heights = fissure.fissure_between(even.mesh, plane).height_above(
        triangles.corners(even.mesh).mean(axis=1)
    )
    is_left = fissure.left_faces(even.mesh, heights)
    sides = fissure.cut_sides(even.mesh, is_left)
    # sides that share no edge need no cut
    if all(triangles.is_closed(side) for side in sides):
        return _two_pieces(even, is_left, plane, pose, brain, named=is_configured)
    return _two_sides(even, is_left, plane, pose, brain)


def from_shape(mesh: TriangleMesh, *, week: float) -> PialSurface:
    """Return a simple geometry, unchanged, as a brain with sides at x = 0; MeshError if
    it is not sound."""
    repair.require_sound(mesh)
    sides = dict(
        zip(
            SIDES,
            fissure.split(mesh, 0.0),
            strict=True,
        )
    )
    return _pial_surface(
        mesh,
        sides,
        0.0,
        Pose(),
        _Brain(
            week,
            {"source": "shape", "rotation_deg": 0.0},
        ),
    )


def _pial_surface(
    whole: TriangleMesh,
    sides: Mapping[Side, TriangleMesh],
    fissure_x: float,
    pose: Pose,
    brain: _Brain,
) -> PialSurface:
    areas: dict[str, float] = {
        side: triangles.area_cm2(part) for side, part in sides.items()
    }
    report = brain.report | {
        "pose": pose.plain(),
        "week": brain.week,
        "fissure_x_mm": fissure_x,
        "area_cm2": {"whole": sum(areas.values()), **areas},
        "volume_mL": triangles.volume_ml(whole),
        "extents_mm": np.ptp(whole.vertices, axis=0).tolist(),
        "vertices": len(whole.vertices),
        "faces": len(whole.faces),
        "pieces": len(repair.pieces(whole)),
        "euler_number": triangles.euler_number(whole),
        "warnings": brain.warnings,
    }
    return PialSurface(
        whole, sides.get("left"), sides.get("right"), fissure_x, pose, report
    )


def _two_sides(
    surface: RepairedSurface,
    is_left: Mask,
    plane: MidPlane,
    pose: Pose,
    brain: _Brain,
) -> PialSurface:
    """Return the pial surface of a brain, upright and cut into its hemispheres."""
    mesh, is_cap, is_kept = _without_islands(
        surface, {"left": is_left, "right": ~is_left}, pose.of_file(), brain
    )
    is_left = is_left[is_kept]
    matrix, angle = fissure.upright(
        plane,
        mesh.vertices.mean(axis=0),
    )
    whole = triangles.transformed(mesh, matrix)
    for cap, sign in ((is_cap & is_left, 1.0), (is_cap & ~is_left, -1.0)):
        _require_medial(triangles.submesh(whole, cap)[0], sign)
    left, right = fissure.cut_sides(
        triangles.submesh(whole, ~is_cap)[0], is_left[~is_cap]
    )
    # x of the plane, which may be tilted by less than half a degree, at the brain's
    # centre
    normal = matrix[:3, :3] @ plane.normal
    offset = plane.offset + normal @ matrix[:3, 3]
    fissure_x = float(
        (offset - normal[1:] @ whole.vertices.mean(axis=0)[1:]) / normal[0]
    )
    if not left.vertices[:, 0].mean() < fissure_x < right.vertices[:, 0].mean():
        brain.warn(
            [
                "the mid-plane is not between the unequal hemispheres: the middle of"
                " their cut is used"
            ]
        )
        fissure_x = fissure.cut_middle(left, right)
    if plane.fissure_points == 0:
        brain.warn(
            [
                "no fissure was found between facing walls: the plane of mirror"
                " symmetry is used"
            ]
        )
    if plane.asymmetry_mm > MAX_USUAL_ASYMMETRY * float(np.ptp(whole.vertices[:, 0])):
        brain.warn(
            [
                f"the brain is far from mirror-symmetric ({plane.asymmetry_mm:.1f} mm):"
                " check its pose"
            ]
        )
    brain.warn(plausible.proportion_warnings(np.ptp(whole.vertices, axis=0)))
    areas = sorted((triangles.area(left), triangles.area(right)))
    if areas[1] > MAX_AREA_RATIO * areas[0]:
        found = (
            f"areas of {areas[0] * CM2_PER_MM2:.2f} and"
            f" {areas[1] * CM2_PER_MM2:.2f} cm²"
        )
        raise InputError(
            "one hemisphere is too small",
            found=found,
            expected=f"a ratio of at most {MAX_AREA_RATIO:g}",
        )
    if areas[1] > plausible.DOUBTFUL_RATIO * areas[0]:
        brain.warn(
            [
                "the hemispheres' areas differ by"
                f" {100 * (areas[1] / areas[0] - 1):.0f} %: check the midline"
            ]
        )
    share = fissure.cut_share(left, right)
    brain.warn(plausible.cut_warnings(share, brain.week))
    brain.report |= {
        "cut_share": share,
        "usual_cut_share": plausible.max_cut_share(brain.week),
        "rotation_deg": angle,
        "fissure_points": plane.fissure_points,
        "asymmetry_mm": plane.asymmetry_mm,
    }
    return _pial_surface(
        whole, {"left": left, "right": right}, fissure_x, pose.then(matrix), brain
    )


def _one_side(
    surface: RepairedSurface,
    side: Side,
    pose: Pose,
    brain: _Brain,
) -> PialSurface:
    """Return the pial surface of a single hemisphere, next to the mid-sagittal
    plane."""
    brain.warn(pose.warnings)
    every = np.ones(
        len(surface.mesh.faces),
        dtype=bool,
    )
    mesh, is_cap, _ = _without_islands(
        surface,
        {side: every},
        np.eye(4),
        brain,
    )
    whole = pial = triangles.transformed(mesh, pose.of_file())
    if is_cap.any():
        _require_medial(
            triangles.submesh(whole, is_cap)[0], 1.0 if side == "left" else -1.0
        )
        pial = triangles.submesh(whole, ~is_cap)[0]
    x = whole.vertices[:, 0]
    fissure_x = float(
        x.max() + posing.WALL_DISTANCE_MM
        if side == "left"
        else x.min() - posing.WALL_DISTANCE_MM
    )
    brain.report["rotation_deg"] = angle_deg(pose.of_file()[:3, :3])
    return _pial_surface(whole, {side: pial}, fissure_x, pose, brain)


def _without_islands(
    surface: RepairedSurface,
    sides: Mapping[Side, Mask],
    of_file: Floats,
    brain: _Brain,
) -> tuple[TriangleMesh, Mask, Mask]:
    """Remove all but the largest piece of a side; return the surface, masks of its caps
    and of the faces kept."""
    is_kept, warnings = fissure.largest_pieces(
        surface.mesh,
        sides,
        np.asarray(
            np.linalg.inv(of_file),
            dtype=float,
        ),
    )
    brain.warn(warnings)
    is_cap = surface.is_cap if len(surface.is_cap) else np.zeros_like(is_kept)
    return (
        triangles.submesh(surface.mesh, is_kept)[0] if warnings else surface.mesh,
        is_cap[is_kept],
        is_kept,
    )


def _require_medial(cap: TriangleMesh, sign: float) -> None:
    """Raise MeshError if the cap of a posed hemisphere does not face the other one, in
    the direction `sign` x."""
    normal = triangles.area_vectors(cap).sum(axis=0)
    if sign * normal[0] < MIN_AXIS_COSINE * np.linalg.norm(normal):
        problem = (
            "the surface has a hole that is too large to close, and is not the medial"
            " wall of a hemisphere"
        )
        found = f"a hole {np.ptp(cap.vertices, axis=0).max():.1f} mm across"
        raise MeshError(
            problem,
            found=found,
            expected="a closed surface, or hemispheres open at medial walls only",
        )
