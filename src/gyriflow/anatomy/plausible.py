"""Check that a surface or volume can be the cerebrum of its week: size, unit, number
and similarity of hemispheres."""

import logging
from collections.abc import Iterable, Mapping
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    face_components,
    signed_volume,
    submesh,
)
from ..units import ML_PER_MM3

log = logging.getLogger(__name__)

# cerebral volume (mL) at 25.4 and 36.6 GW: the atlas of Fidon et al. 2021 (doi
# 10.5281/zenodo.5524312) and the growth by 230 % between these weeks found by Clouchoux
# et al. 2012 (doi 10.1016/j.ajog.2011.10.002)
EARLY, LATE = (25.4, 92.0), (36.6, 304.0)
# accepted ratio to it: from small fetuses with pathologies to adults, and the
# log-linear growth is coarse
MIN_RATIO, MAX_RATIO = 0.2, 6.0
# beyond these it is doubtful: atlases from 21 to 36 GW have 0.57 to 1.27, coordinates
# in voxels of 0.8 mm give 1.95
MIN_USUAL_RATIO, MAX_USUAL_RATIO = 0.55, 1.45
# width and height over length are 0.74 to 0.83 and 0.63 to 0.72 in atlases
WIDTHS, HEIGHTS = (0.65, 0.93), (0.54, 0.82)
# largest share of the medial wall that is a cut by week, in 25 volumes of the atlases
# of Fidon et al. 2021, CRL and Wu et al. 2021 (21 to 38 GW); most have 0.15 at 22, 0.13
# at 27 and 0.10 at 35 GW
CUT_SHARES = ((21.0, 0.23), (23.0, 0.17), (27.0, 0.15), (31.0, 0.12), (36.0, 0.103))
# a share above this multiple of it is doubtful: individuals vary more than atlases
MAX_CUT_FACTOR = 2.0
# voxels through a cortex, below which its thickness is inaccurate, and area over that
# of a surface without hidden parts
MIN_VOXELS, MIN_AREA_RATIO = 1.5, 0.95
# range of a median cortical thickness, also of bodies other than brains
THICKNESSES_MM = (0.1, 20.0)
UNITS_MM = {
    "metres": 1e3,
    "micrometres": 1e-3,
    "centimetres": 10.0,
    "decimetres": 100.0,
}
# a header of a volume with the other unit, and numbers in mm, gives the same wrong size
WRONG_HEADERS = {"metres": "micrometres", "micrometres": "metres"}
# left and right cerebral hemispheres of one fetus differ by a few percent; successive
# weeks by 15 %
DOUBTFUL_RATIO = 1.15
# shift of one hemisphere along the mid-plane, in cube roots of its volume
MAX_USUAL_SHIFT = 0.08
# shortest over longest extent: 0.61 or more in whole cerebra, 0.46 or less in single
# hemispheres
MIN_NARROWNESS, MIN_USUAL_NARROWNESS = 0.5, 0.56
# a mirrored brain has the shape of one whose sides are exchanged, so only its owner can
# find out which it is
EXCHANGED_OR_MIRRORED = (
    "Find out which side is which, for example by a marker in the MRI that the surfaces"
    " were made from, and change nothing before. If the files are exchanged, swap"
    " `left` and `right`. If the coordinates are mirrored (an axis reversed, or two"
    " exchanged), export the surfaces in RAS or LPS and do not swap"
)


def logged(warnings: Iterable[str]) -> list[str]:
    """Log warnings and return them."""
    warnings = list(warnings)
    for warning in warnings:
        log.warning(warning)
    return warnings


def expected_volume_ml(week: float) -> float:
    """Return a coarse estimate of the volume of a cerebrum (mL) at a gestational week:
    exponential growth."""
    rate = np.log(LATE[1] / EARLY[1]) / (LATE[0] - EARLY[0])
    return float(EARLY[1] * np.exp(rate * (week - EARLY[0])))


def require_plausible_size(volume_mm3: float, week: float) -> list[str]:
    """Return warnings of an unusual volume for the week; InputError with a guess of the
    unit if impossible."""
    expected = expected_volume_ml(week)
    volume = volume_mm3 * ML_PER_MM3
    share = volume / expected
    if MIN_RATIO <= share <= MAX_RATIO:
        if MIN_USUAL_RATIO <= share <= MAX_USUAL_RATIO:
            return []
        text = (
            f"a cerebrum of {volume:.0f} mL has {100 * share:.0f} % of the volume"
            f" expected at week {week:g}"
        )
        return [
            f"{text}: is the week correct, and is the file in mm, not in voxel indices?"
        ]
    guess = next(
        (
            u
            for u, mm in UNITS_MM.items()
            if MIN_RATIO <= volume * mm**3 / expected <= MAX_RATIO
        ),
        None,
    )
    if guess:
        wrong_header = (
            f", or its header says {WRONG_HEADERS[guess]} and means mm"
            if guess in WRONG_HEADERS
            else ""
        )
        remedy = (
            f"The file seems to be in {guess}{wrong_header}: give it in mm, with mm in"
            " the header."
        )
    else:
        remedy = (
            "Check the file's unit, its week, and which labels belong to the cerebrum."
        )
    raise InputError(
        f"the cerebrum's size is impossible at week {week:g}",
        found=f"{volume:.3g} mL",
        expected=f"{MIN_RATIO * expected:.0f} to {MAX_RATIO * expected:.0f} mL",
        remedy=remedy,
    )


def require_plausible_thickness(
    values: NDArray,
    factor_mm: float,
    path: str,
) -> None:
    """Raise InputError, with probable units, if the median of the positive values is
    not a cortical thickness."""
    known = values[np.isfinite(values) & (values > 0)]
    median = factor_mm * float(np.median(known)) if len(known) else 0.0
    low, high = THICKNESSES_MM
    if low <= median <= high:
        return
    units = " or ".join(
        unit for unit, mm in UNITS_MM.items() if low <= median * mm <= high
    )
    remedy = (
        f"The map seems to be in {units}: give it in mm."
        if units
        else "Check its quantity and unit."
    )
    raise InputError(
        "does not contain cortical thickness",
        path=path,
        found=f"a median of {median:.4g}",
        expected=f"{low:g} to {high:g} mm",
        remedy=remedy,
    )


def proportion_warnings(extents_mm: Floats) -> list[str]:
    """Return warnings if a posed brain's width, length and height (3,) suggest a wrong
    scale of an axis."""
    width, length, height = map(float, extents_mm)
    return [
        f"the {name} is {share:.2f} of the length, {low} to {high} in most brains: is"
        " the scale of each axis correct?"
        for name, share, (low, high) in (
            ("width", width / length, WIDTHS),
            ("height", height / length, HEIGHTS),
        )
        if not low <= share <= high
    ]


def max_cut_share(week: float) -> float:
    """Return the largest usual share of the medial wall that is a cut, at a gestational
    week."""
    weeks, shares = zip(*CUT_SHARES, strict=True)
    return MAX_CUT_FACTOR * float(np.interp(week, weeks, shares))


def cut_warnings(share: float, week: float) -> list[str]:
    """Return a warning if the cut at the midline takes a larger share of the medial
    wall than in atlases."""
    limit = max_cut_share(week)
    if share <= limit:
        return []
    cut = f"the cut at the midline takes {100 * share:.0f} % of the medial wall"
    return [
        f"{cut}, usually at most {100 * limit:.0f} % at week {week:g}: is the fissure"
        " fused in the labels?"
    ]


def narrowness(mesh: TriangleMesh) -> float:
    """Return the shortest over the longest extent of a surface, along the principal
    axes of its vertices."""
    points = mesh.vertices - mesh.vertices.mean(axis=0)
    covariance = np.cov(points.T)
    _, axes = np.linalg.eigh(covariance)
    along_axes = points @ axes
    extents = np.ptp(along_axes, axis=0)
    return float(extents.min() / extents.max())


def require_single_hemisphere(mesh: TriangleMesh) -> None:
    """Raise InputError if a surface is a whole brain."""
    if (shape := narrowness(mesh)) > MIN_USUAL_NARROWNESS:
        raise InputError(
            "this is not a single hemisphere",
            found=f"a shortest extent of {shape:.2f} of the longest",
            expected=f"at most {MIN_USUAL_NARROWNESS}",
        )


def require_one_brain(
    mesh: TriangleMesh,
    what: str,
    path: str | PathLike[str] | None = None,
) -> None:
    """Raise InputError if a whole brain's surface, of a "surface" or "volume", consists
    of several whole brains."""
    pieces = face_components(mesh)
    brains = 0
    for piece in np.unique(pieces):
        part, _ = submesh(mesh, pieces == piece)
        # single hemispheres are narrower
        brains += narrowness(part) > MIN_USUAL_NARROWNESS
    if brains > 1 and narrowness(mesh) < MIN_USUAL_NARROWNESS:
        raise InputError(
            f"the {what} contains {brains} separate brains, such as twins",
            path=path,
            found=f"{brains} parts, each as wide as a whole cerebrum",
            expected="one brain",
            remedy="Save each brain in a file of its own.",
        )


def require_whole(
    mesh: TriangleMesh,
    what: str,
    *,
    refuses: bool = True,
) -> list[str]:
    """Return a warning if a whole brain's surface, a "surface" or "volume", is narrow.

    InputError for one hemisphere, and for several brains.
    """
    require_one_brain(mesh, what)
    shape = narrowness(mesh)
    if refuses and shape < MIN_NARROWNESS:
        raise InputError(
            f"the {what} seems to {'contain' if what == 'volume' else 'be'} one"
            " hemisphere only",
            found=f"a shortest extent of {shape:.2f} of the longest",
            expected=f"{MIN_NARROWNESS} or more, as in whole cerebra",
            remedy=(
                "If there is one hemisphere, give its side, as `side: left`. If there"
                " are both, check the labels and the size of the voxels."
            ),
        )
    narrow = (
        f"the cerebrum is narrow ({shape:.2f} of its length): are both hemispheres"
        " complete?"
    )
    return [narrow] if shape < MIN_USUAL_NARROWNESS else []


def require_left_and_right(
    left: TriangleMesh,
    right: TriangleMesh,
    coordinates: str,
) -> None:
    """Raise InputError if the left of two surfaces in RAS+ is not at the smaller x.

    `coordinates` are those of the configuration. With "auto", the pose is that of the
    shape.
    """
    x_left, x_right = left.vertices[:, 0].mean(), right.vertices[:, 0].mean()
    if x_left >= x_right:
        # the shape tells wrong coordinates from wrong sides, which would be changed for
        # nothing
        by_shape = (
            "Set coordinates: auto, which shows whether other coordinates fit, and do"
            " not swap `left` and `right`"
        )
        raise InputError(
            "the left hemisphere lies to the right of the right one",
            found=(
                f"centroids at x = {x_left:.1f} (left) and {x_right:.1f} mm (right) in"
                f" coordinates {coordinates}"
            ),
            expected="left at the smaller x (RAS+)",
            remedy=(
                EXCHANGED_OR_MIRRORED
                if coordinates == "auto"
                else f"{by_shape} before."
            ),
        )


def require_pair(
    left: TriangleMesh,
    right: TriangleMesh,
    max_ratio: float,
    coordinates: str,
) -> list[str]:
    """Return a warning if two surfaces in RAS+ are hardly one brain's; InputError if
    swapped or beyond `max_ratio`."""
    require_left_and_right(left, right, coordinates)
    volumes = signed_volume(left), signed_volume(right)
    ratio = max(volumes) / min(volumes)
    if ratio > max_ratio:
        raise InputError(
            "the hemispheres are too different in size to belong to one brain",
            found=(
                f"{volumes[0] / 1e3:.1f} mL (left) and {volumes[1] / 1e3:.1f} mL"
                " (right)"
            ),
            expected=f"volumes within {100 * (max_ratio - 1):.0f} % of each other",
            remedy=(
                "Give both of the same subject and week; if they are, set"
                " surface.asymmetric to true."
            ),
        )
    if ratio > DOUBTFUL_RATIO:
        return [
            f"the hemispheres' volumes differ by {100 * (ratio - 1):.0f} %: do they"
            " belong to one brain?"
        ]
    return []


def facing_warnings(
    left: TriangleMesh,
    right: TriangleMesh,
    to_right: Floats,
) -> list[str]:
    """Return a warning if hemispheres are shifted along the mid-plane, whose unit
    normal is `to_right` (3,)."""
    between = right.vertices.mean(axis=0) - left.vertices.mean(axis=0)
    shift = float(np.linalg.norm(between - (between @ to_right) * to_right))
    if shift <= MAX_USUAL_SHIFT * float(np.cbrt(abs(signed_volume(left)))):
        return []
    return [
        f"the medial walls do not face each other: they are shifted by {shift:.1f} mm."
        " Are both in one space?"
    ]


def is_inaccurate(report: Mapping[str, Any]) -> bool:
    """Return whether the cortex is too thin for its voxels, by the report of its
    thickness."""
    return report.get("voxels_through_cortex", MIN_VOXELS) < MIN_VOXELS


def hides_area(report: Mapping[str, Any]) -> bool:
    """Return whether a part of the pial surface is hidden in fused sulci, by the report
    of its thickness.

    It is not known where the thickness is inaccurate, as the complete surface is volume
    over thickness.
    """
    ratio = report.get("area_ratio", MIN_AREA_RATIO)
    return not is_inaccurate(report) and ratio < MIN_AREA_RATIO
