"""Cortical thickness on a pial surface, white surfaces, the inner border of the cortex,
and labels filled from both."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.deformations import transform_points, voxel_size
from ..geometry.matching import layer_thickness, nearest_on, surface_mask
from ..geometry.poses import Pose, posed_whites
from ..geometry.triangles import (
    TriangleMesh,
    area,
    merged,
    signed_volume,
    transformed,
    vertex_areas,
    vertex_normals,
)
from ..geometry.voxels import distance_to
from ..settings.schemes import FILLED, LabelScheme
from ..settings.terms import SIDES, Side
from .extraction import (
    LEVEL,
    SMOOTHING_VOXELS,
    Floats,
    Mask,
    isosurface,
    main_parts,
    smooth_mask,
)
from .fissure import FISSURE_MM, cut_sides, nearer_left, sample
from .labels import Cerebrum, Labels, read_cerebrum
from .plausible import hides_area, is_inaccurate
from .repair import make_sound, sound_pieces, surface_of_mask, taubin_smoothed

log = logging.getLogger(__name__)

# a vertex has cortex under it if a voxel of it is closer than this, and lies at the
# labels if one outside is
NEAR_VOXELS = 1.0
MAX_OUTSIDE_VOXELS = 1.5
# an opened fissure is this close to its plane
FISSURE_REACH_MM = 3.0
# a layer thinner than this does not count
MIN_LAYER_VOXELS = 1 / 3
QUANTILES = (0.05, 0.95)
# on the medial wall, which has no cortex, white and pial surfaces coincide
MIN_MM = 0.3
HIDDEN = "a part of it is hidden in fused sulci: area and gyrification are lower bounds"
# vertices of both borders at which the number of voxels through the cortex is measured
N_SAMPLES = 8000
# how often what the Gaussian of `smooth_mask` takes away is added again; a third time
# brings back more of the terraces than of the folds
N_TWICINGS = 2
# offset of a surface by which its mean curvature is measured
OFFSET_MM = 0.05
USUAL_MM = 0.4, 3.5  # means in label atlases of 21 to 36 GW are 0.8 to 2.7 mm
# the white surface crosses the pial one if a larger share of its area is further
# outside than this
OUTSIDE_MM, MAX_OUTSIDE_SHARE = 0.5, 0.01
TYPICAL_THICKNESS_MM = 2.0
"""Thickness of the cortex if no brain of the study has a measured one; means in label
atlases are 0.8 to 2.7 mm."""
TYPICAL_VOXEL_MM = 0.8
"""Voxel size if no brain of the study has labels: that of label atlases."""
CUT_TOL_MM = 1e-3
"""A voxel lies below a cut if that is nearer than the pial surface by more than
this."""


OWN_WHITE = (
    "Give each side its own white surface, in the coordinates of its pial one: they are"
    " swapped, both of one side, or in other coordinates."
)


@dataclass(frozen=True, eq=False)
class Thickness:
    """Cortical thickness on a surface; the report has means and shares, in plain values
    for JSON.

    Vertices that are not `is_measured` (n,) have the value of the nearest measured one
    in `values_mm` (n,).
    """

    values_mm: Floats
    is_measured: Mask
    report: dict[str, Any]

    @property
    def measured_mm(self) -> Floats:
        """The (n,) thickness at each vertex, NaN where it was not measured."""
        return np.where(self.is_measured, self.values_mm, np.nan)


@dataclass(frozen=True, eq=False)
class Cortex:
    """The cortex in the labels of a cerebrum: (i, j, k) masks of both, and the (4, 4)
    affine to mm."""

    cerebrum: Mask
    mask: Mask
    affine: Floats

    @cached_property
    def core(self) -> Mask:
        """The (i, j, k) mask of the tissue inside the cortex."""
        return self.cerebrum & ~self.mask

    @cached_property
    def _inner_border(self) -> TriangleMesh:
        """The `border` of the tissue inside the cortex."""
        return border(self.core, self.affine)

    @cached_property
    def voxels_through(self) -> float:
        """The median thickness, between the borders of cerebrum and core, over a
        voxel's longest edge."""
        outer = border(self.cerebrum, self.affine)
        every = max(1, len(outer.vertices) // N_SAMPLES)
        inward, _, nearest = nearest_on(
            outer.vertices[::every],
            self._inner_border,
        )
        outward, _, _ = nearest_on(nearest, outer)
        longest_mm = voxel_size(self.affine).max()
        values = 0.5 * (inward + outward) / longest_mm
        return float(np.median(values[values >= MIN_LAYER_VOXELS]))


def cortex_of(cerebrum: Cerebrum, scheme: LabelScheme) -> Cortex:
    """Return the cortex of a cerebrum; empty if the scheme does not separate it."""
    is_cortex = np.isin(cerebrum.tissue, scheme.cortex)
    return Cortex(cerebrum.mask, is_cortex, cerebrum.affine)


def _cortical_thickness(
    pial: TriangleMesh,
    cortex: Cortex,
    beyond_fissure: Mask | None,
) -> Thickness:
    """Return the thickness on a pial surface in the coordinates of the cortex; in sulci
    at the vertices `beyond_fissure` (n,) only."""
    values = layer_thickness(pial, cortex._inner_border)
    points, affine = pial.vertices, cortex.affine
    size = voxel_size(affine)
    # of long voxels, no centre may be nearer than half their diagonal
    voxel = max(
        float(np.cbrt(size.prod())),
        0.5 * float(np.linalg.norm(size)),
    )
    to_cortex, to_outside = (
        sample(distance_to(mask, size), affine, points)
        for mask in (cortex.mask, ~cortex.cerebrum)
    )
    at_labels = to_outside < MAX_OUTSIDE_VOXELS * voxel
    over_cortex = to_cortex < NEAR_VOXELS * voxel
    if beyond_fissure is not None:
        at_labels |= beyond_fissure
    is_measured = at_labels & over_cortex & (values >= MIN_LAYER_VOXELS * voxel)
    if not is_measured.any():
        raise InputError(
            "the labels of the cortex lie nowhere at the surface of the cerebrum",
            found=(
                f"{int(cortex.mask.sum())} voxels of cortex, all of them deep inside or"
                " thinner than a third of a voxel"
            ),
            expected="a layer around the cerebrum",
        )
    _, nearest = cKDTree(points[is_measured]).query(points[~is_measured])
    filled = values.copy()
    filled[~is_measured] = values[is_measured][nearest]
    report = _summary(values, is_measured, vertex_areas(pial))
    # volume over thickness is the area of the middle of the sheet; a convex brain has
    # more outside
    sheet_mm2 = (
        float(cortex.mask.sum())
        * float(abs(np.linalg.det(affine[:3, :3])))
        / report["mean_mm"]
    )
    complete_mm2 = sheet_mm2 * (
        1.0 + _mean_curvature(pial, is_measured) * report["mean_mm"]
    )
    report |= {
        "area_ratio": area(pial) / complete_mm2,
        "voxel_mm": float(size.max()),
        "voxels_through_cortex": cortex.voxels_through,
    }
    return Thickness(filled, is_measured, report)


def border(mask: Mask, affine: Floats) -> TriangleMesh:
    """Return the surface in mm around the main parts of an (i, j, k) mask, moved to
    enclose their volume.

    A border whose folds are lower than those of the pial surface is too far from it.
    """
    field = _sharp_mask(mask)
    kept, _, _ = main_parts(field > LEVEL)
    field = np.where(
        kept, np.maximum(field, LEVEL + 1e-3), np.minimum(field, LEVEL - 1e-3)
    )
    # terraces of voxels would be nearer than the wall they lie on
    mesh = taubin_smoothed(isosurface(field.astype(np.float32), affine))
    mask_mm3 = main_parts(mask)[0].sum() * abs(np.linalg.det(affine[:3, :3]))
    missing_mm3 = mask_mm3 - signed_volume(mesh)
    return TriangleMesh(
        mesh.vertices + missing_mm3 / area(mesh) * vertex_normals(mesh), mesh.faces
    )


def _sharp_mask(mask: Mask) -> NDArray[np.float32]:
    """Return the mask smoothed as by `smooth_mask`, but with a third of its loss of
    folds.

    A Gaussian G lowers a wall's folds of wave number k by σ²k²/2 of their height. What
    it takes away, smoothed as well, is added again (twicing, Tukey 1977): 1 − (1 − G)³
    in place of G lowers them by a third of that, and moves flat walls as little.
    """
    field = smooth_mask(mask)
    for _ in range(N_TWICINGS):
        field += ndimage.gaussian_filter(mask - field, SMOOTHING_VOXELS)
    return field


def _mean_curvature(mesh: TriangleMesh, at: Mask) -> float:
    """Return the mean curvature (1/mm) of a surface over some vertices, an (n,) mask:
    half of what its area grows."""
    step = OFFSET_MM * vertex_normals(mesh)
    areas = []
    for sign in (-1, 0, 1):
        offset = TriangleMesh(mesh.vertices + sign * step, mesh.faces)
        areas.append(float(vertex_areas(offset)[at].sum()))
    return (areas[2] - areas[0]) / (4.0 * OFFSET_MM * areas[1])


def thickness_from_labels(
    cortex: Cortex,
    surface: TriangleMesh,
    pose: Pose,
    fissure_x_mm: float | None = None,
) -> Thickness:
    """Return the cortical thickness on the whole `surface` around the labels of a
    `cortex`, posed by `pose`; InputError if it has no cortex under it.

    It is the `layer_thickness` to the surface of the cerebrum without its cortex. It is
    not measured without cortex below, nor where a hidden fissure or fused sulci were
    opened; in sulci it is, beyond the fissure at x = `fissure_x_mm`. The report's
    "area_ratio" is the pial area over that of a complete surface around the cortex, (1
    + mean curvature × thickness) × volume / thickness.
    """
    beyond_fissure = None
    if fissure_x_mm is not None:
        from_fissure_mm = np.abs(surface.vertices[:, 0] - fissure_x_mm)
        beyond_fissure = from_fissure_mm > FISSURE_REACH_MM
    thickness = _cortical_thickness(
        transformed(surface, pose.inverse), cortex, beyond_fissure
    )
    mean = thickness.report["mean_mm"]
    log.info("cortical thickness: %.2f mm on average", mean)
    if not USUAL_MM[0] <= mean <= USUAL_MM[1]:
        log.warning(
            "the cortex is %.1f mm thick on average: are its labels correct?", mean
        )
    if is_inaccurate(thickness.report):
        log.warning(
            "the labels of the cortex are %.1f voxels thick: its thickness is"
            " inaccurate",
            thickness.report["voxels_through_cortex"],
        )
    if hides_area(thickness.report):
        log.warning(
            "the pial area is %.2f of a complete surface's around this cortex: %s",
            thickness.report["area_ratio"],
            HIDDEN,
        )
    return thickness


def _summary(
    values: Floats,
    is_measured: Mask,
    areas: Floats,
) -> dict[str, Any]:
    """Summarise the thickness; means are weighted by area."""
    values, weights = values[is_measured], areas[is_measured]
    quantiles = np.quantile(
        values,
        [QUANTILES[0], 0.5, QUANTILES[1]],
        weights=weights,
        method="inverted_cdf",
    )
    low, median, high = map(float, quantiles)
    mean = float(np.average(values, weights=weights))
    return {
        "mean_mm": mean,
        "median_mm": median,
        "quantile05_mm": low,
        "quantile95_mm": high,
        "sd_mm": float(np.sqrt(np.average((values - mean) ** 2, weights=weights))),
        "measured_area_share": float(weights.sum() / areas.sum()),
    }


def thickness_from_white(
    surface: TriangleMesh,
    pose: Pose,
    fissure_x_mm: float,
    whites: Mapping[str, TriangleMesh],
) -> Thickness:
    """Return the cortical thickness on a pial surface from its distance to the white
    surface.

    `surface` is the whole one with its `pose` and fissure; `whites` are by side, or
    "whole", in its files' coordinates. InputError if one is in the other hemisphere or
    crosses the pial surface.
    """
    posed = posed_whites(pose, whites)
    for side, white in posed.items():
        areas = vertex_areas(white)
        middle = float(
            np.average(
                white.vertices[:, 0],
                weights=areas,
            )
        )
        if side in SIDES and (middle < fissure_x_mm) != (side == "left"):
            raise InputError(
                f"the white surface ({side}) lies in the other hemisphere",
                found=(
                    f"its middle at x = {middle:.1f} mm, the fissure at"
                    f" {fissure_x_mm:.1f} mm"
                ),
                expected=(
                    f"{'<' if side == 'left' else '>'} {fissure_x_mm:.1f} mm (RAS+)"
                ),
                remedy=OWN_WHITE,
            )
        require_inside(surface, white, side)
    inner = merged(*posed.values())
    values = layer_thickness(surface, inner)
    is_measured = values >= MIN_MM
    if not is_measured.any():
        raise InputError(
            "the white surface equals the pial surface",
            found=f"a distance of at most {values.max():.2f} mm",
            expected=f"{MIN_MM} mm and more",
        )
    return Thickness(
        values, is_measured, _summary(values, is_measured, vertex_areas(surface))
    )


def require_inside(
    pial: TriangleMesh,
    white: TriangleMesh,
    side: str,
) -> None:
    """Raise InputError if a white surface crosses the closed pial surface of its side
    ("whole": of the brain)."""
    outside = (
        igl.fast_winding_number(
            pial.vertices,
            pial.faces,
            white.vertices,
        )
        < 0.5
    )
    distance, _, _ = nearest_on(white.vertices, pial)
    crossing = outside & (distance > OUTSIDE_MM)
    areas = vertex_areas(white)
    share = float(areas[crossing].sum() / areas.sum())
    if share > MAX_OUTSIDE_SHARE:
        raise InputError(
            f"the white surface ({side}) crosses the pial one",
            found=(
                f"{100 * share:.0f} % of its area outside, by up to"
                f" {distance[crossing].max():.1f} mm"
            ),
            expected=(
                f"at most {100 * MAX_OUTSIDE_SHARE:.0f} % by more than {OUTSIDE_MM} mm"
            ),
            remedy=OWN_WHITE,
        )


def white_from_labels(
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    pial: Mapping[Side, TriangleMesh],
    pose: Pose,
    *,
    edge_length_mm: float = 1.0,
) -> dict[Side, TriangleMesh]:
    """Return by side the surface around the tissue within the cortex of an (i, j, k)
    label volume.

    It is made like the pial surface, which it equals without cortex. MeshError if it
    keeps self-intersections.
    """
    cerebrum = read_cerebrum(labels, pose.world @ affine, scheme)
    core = cerebrum.mask & ~np.isin(cerebrum.tissue, scheme.cortex)
    volume = float(core.sum() * abs(np.linalg.det(cerebrum.affine[:3, :3])))
    field, smallest = smooth_mask(core), cerebrum.smallest_part
    even = surface_of_mask(
        field, cerebrum.affine, volume, edge_length_mm, smallest=smallest
    )
    return _cut_as_pial(even.mesh, pial)


def white_from_surfaces(
    whites: Mapping[str, TriangleMesh],
    pial: Mapping[Side, TriangleMesh],
    pose: Pose,
    *,
    edge_length_mm: float = 1.0,
) -> dict[Side, TriangleMesh]:
    """Pose and remesh white surfaces of the sides or the "whole"; return them by side.
    MeshError if not sound."""
    even = {
        name: make_sound(sound_pieces(mesh).mesh, edge_length_mm).mesh
        for name, mesh in posed_whites(pose, whites).items()
    }
    return (
        _cut_as_pial(even["whole"], pial)
        if "whole" in even
        else {side: even[side] for side in pial}
    )


def _cut_as_pial(
    mesh: TriangleMesh, pial: Mapping[Side, TriangleMesh]
) -> dict[Side, TriangleMesh]:
    if len(pial) == 1:
        return dict.fromkeys(pial, mesh)
    left, right = cut_sides(
        mesh,
        nearer_left(mesh, pial["left"], pial["right"]),
    )
    return {"left": left, "right": right}


def filled_labels(
    whole: TriangleMesh,
    sides: Sequence[TriangleMesh],
    fissure_x_mm: float,
    *,
    whites: Sequence[TriangleMesh] = (),
    thickness_mm: float = TYPICAL_THICKNESS_MM,
    voxel_mm: float = TYPICAL_VOXEL_MM,
) -> tuple[NDArray[np.int32], Floats]:
    """Return an (i, j, k) volume with the labels of `FILLED` inside a pial surface, and
    its (4, 4) affine.

    `whole` is the closed surface, `sides` are its hemispheres, open or capped at the
    midline, all in one pose. Cortex lies between the `sides` and the `whites`, or else
    within `thickness_mm`; cuts and coinciding surfaces have none. Hemispheres are
    joined where their gap at the fissure is as narrow as one that is opened in labels.
    """
    mask, affine = surface_mask(whole, voxel_mm)
    inside = mask > 0
    if len(sides) > 1:
        inside |= _narrow_gaps(inside, affine, fissure_x_mm)
    points, pial = transform_points(np.argwhere(inside), affine), merged(*sides)
    depth, faces, _ = nearest_on(points, pial)
    if whites:
        white = merged(*whites)
        thickness = layer_thickness(pial, white)[pial.faces[faces]].mean(axis=1)
        # the sign depends on the order of corners
        outside = (
            np.abs(igl.fast_winding_number(white.vertices, white.faces, points)) < 0.5
        )
        below_cut = depth > nearest_on(points, whole)[0] + CUT_TOL_MM
        is_cortex = (
            outside & (thickness >= MIN_MM) & ((depth <= thickness) | ~below_cut)
        )
    else:
        is_cortex = depth <= thickness_mm
    labels = np.zeros(inside.shape, dtype=np.int32)
    (cortex,) = FILLED.cortex
    (core,) = set(FILLED.cerebrum) - {cortex}
    labels[inside] = np.where(is_cortex, cortex, core)
    return labels, affine


def _narrow_gaps(
    inside: NDArray[np.bool_],
    affine: Floats,
    fissure_x_mm: float,
) -> NDArray[np.bool_]:
    """Return the mask of the gaps at the fissure up to `FISSURE_MM` and a voxel
    wide."""
    voxel = float(affine[0, 0])
    radius = 0.5 * (FISSURE_MM + voxel)
    near = distance_to(inside, voxel) <= radius
    closed = distance_to(~near, voxel) > radius
    x = affine[0, 3] + voxel * np.arange(inside.shape[0])
    return closed & (np.abs(x - fissure_x_mm) <= FISSURE_REACH_MM)[:, None, None]
