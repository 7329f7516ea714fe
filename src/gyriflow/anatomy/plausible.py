"""Whether what is given can be the cerebrum of a week: its size, one hemisphere or two, and how alike these are.

A size out of all proportion catches files in metres, micrometres or centimetres.
"""

import numpy as np

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh, signed_volume
from ..units import ML_PER_MM3

# cerebral volume (mL) at 25.4 and 36.6 GW: the atlas of Fidon et al. 2021 (doi 10.5281/zenodo.5524312) and the growth
# by 230 % between these weeks found by Clouchoux et al. 2012 (doi 10.1016/j.ajog.2011.10.002)
EARLY, LATE = (25.4, 92.0), (36.6, 304.0)
# from small fetuses with pathologies to adults, and the log-linear growth is a coarse one
LEAST, MOST = 0.2, 6.0
# means of atlases from 21 to 36 GW are 0.57 to 1.27 of it; in voxels of 0.8 mm instead of mm, 1.95 times as much
DOUBTFUL_LEAST, DOUBTFUL_MOST = 0.55, 1.45
# width and height over length are 0.74 to 0.83 and 0.63 to 0.72 in atlases
WIDTHS, HEIGHTS = (0.65, 0.93), (0.54, 0.82)
UNITS_MM = {"metres": 1e3, "micrometres": 1e-3, "centimetres": 10.0, "decimetres": 100.0}
# left and right cerebral hemispheres of one fetus differ by a few percent; successive weeks by 15 %
DOUBTFUL_RATIO = 1.15
# the narrowest extent of a whole cerebrum is 0.61 of its longest and more, that of one hemisphere 0.46 and less
NARROWEST_BRAIN, DOUBTFUL_BRAIN = 0.5, 0.56


def expected_volume_ml(week: float) -> float:
    """Return the coarse volume of a cerebrum (mL) at a gestational week, growing exponentially."""
    rate = np.log(LATE[1] / EARLY[1]) / (LATE[0] - EARLY[0])
    return float(EARLY[1] * np.exp(rate * (week - EARLY[0])))


def require_plausible_size(volume_mm3: float, week: float) -> list[str]:
    """Return what is doubtful about a cerebrum's volume at its week: below 0.55 or above 1.45 of the published one.

    InputError where it is out of all proportion, less than a fifth or more than six times, with a guess of the unit.
    """
    expected = expected_volume_ml(week)
    volume = volume_mm3 * ML_PER_MM3
    share = volume / expected
    if LEAST <= share <= MOST:
        if DOUBTFUL_LEAST <= share <= DOUBTFUL_MOST:
            return []
        far = f"a cerebrum of {volume:.0f} mL has {100 * share:.0f} % of the volume expected at week {week:g}"
        return [f"{far}: is the week right, and is the file in mm, not in voxel indices?"]
    guess = next((u for u, mm in UNITS_MM.items() if LEAST <= volume * mm**3 / expected <= MOST), None)
    raise InputError(
        f"the cerebrum's size is not that of week {week:g}",
        found=f"{volume:.3g} mL",
        expected=f"{LEAST * expected:.0f} to {MOST * expected:.0f} mL",
        remedy=f"The file seems to be in {guess}: give it in mm, with mm in the header."
        if guess
        else "Check the file's unit, its week, and which labels make the cerebrum.",
    )


def doubts_of_proportions(extents_mm: Floats) -> list[str]:
    """Return what is doubtful about a posed brain's width, length and height (3,): a wrong scale of an axis."""
    width, length, height = map(float, extents_mm)
    return [
        f"the {name} is {share:.2f} of the length, {least} to {most} in most brains: is the scale of each axis right?"
        for name, share, (least, most) in (("width", width / length, WIDTHS), ("height", height / length, HEIGHTS))
        if not least <= share <= most
    ]


def narrowness(mesh: TriangleMesh) -> float:
    """Return the shortest over the longest extent of a surface along the axes of inertia of its vertices."""
    points = mesh.vertices - mesh.vertices.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov(points.T))
    extents = np.ptp(points @ axes, axis=0)
    return float(extents.min() / extents.max())


def require_one(mesh: TriangleMesh) -> None:
    """Raise InputError where a surface is that of a whole brain."""
    if (shape := narrowness(mesh)) > DOUBTFUL_BRAIN:
        raise InputError(
            "this is no single hemisphere",
            found=f"a narrowest extent that is {shape:.2f} of the longest",
            expected=f"at most {DOUBTFUL_BRAIN}",
        )


def require_whole(mesh: TriangleMesh, what: str, *, refuses: bool = True) -> list[str]:
    """Return what is doubtful about the surface of both hemispheres, of a brain given as a "surface" or a "volume".

    InputError where it is one hemisphere's, unless a narrow one is only to be told.
    """
    shape = narrowness(mesh)
    if refuses and shape < NARROWEST_BRAIN:
        raise InputError(
            f"the {what} seems to {'hold' if what == 'volume' else 'be'} one hemisphere only",
            found=f"a cerebrum whose narrowest extent is {shape:.2f} of its longest",
            expected=f"{NARROWEST_BRAIN} or more, as in whole cerebra",
        )
    narrow = f"the cerebrum is narrow ({shape:.2f} of its length): are both hemispheres there?"
    return [narrow] if shape < DOUBTFUL_BRAIN else []


def require_pair(left: TriangleMesh, right: TriangleMesh, max_ratio: float, coordinates: str) -> list[str]:
    """Return what is doubtful about two surfaces in RAS+ as the left and right hemisphere of one brain.

    `coordinates` are those that the user has named, "ras", "lps" or "auto". InputError where their centroids are not in
    order (left is the smaller x), or their volumes differ by more than a factor: those of one
    fetus differ by a few percent, those of successive weeks by 15 %; unilateral pathology goes further.
    """
    x_left, x_right = left.vertices[:, 0].mean(), right.vertices[:, 0].mean()
    if x_left >= x_right:
        raise InputError(
            "the left hemisphere lies to the right of the right one",
            found=f"centroids at x = {x_left:.1f} (left) and {x_right:.1f} mm (right) in coordinates {coordinates}",
            expected="left at the smaller x (RAS+)",
            remedy="Swap `left` and `right`, or set the other coordinates; both together turn the brain back to front.",
        )
    volumes = signed_volume(left), signed_volume(right)
    ratio = max(volumes) / min(volumes)
    if ratio > max_ratio:
        raise InputError(
            "the hemispheres are too different in size to be of one brain",
            found=f"{volumes[0] / 1e3:.1f} mL (left) and {volumes[1] / 1e3:.1f} mL (right)",
            expected=f"volumes within {100 * (max_ratio - 1):.0f} % of each other",
            remedy="Give both of the same subject and week; if they are, set surface.asymmetric to true.",
        )
    if ratio > DOUBTFUL_RATIO:
        return [f"the hemispheres' volumes differ by {100 * (ratio - 1):.0f} %: are they of one brain?"]
    return []


def require_common_pose(asymmetry_mm: float, most_mm: float) -> None:
    """Raise InputError where two hemispheres together are no mirror images of each other in any plane.

    `asymmetry_mm` is the mean distance to the mirror image.
    """
    if asymmetry_mm > most_mm:
        raise InputError(
            "the hemispheres are not posed as one brain",
            found=f"{asymmetry_mm:.1f} mm between the surface and its mirror image",
            expected=f"at most {most_mm:.1f} mm",
            remedy="Give both of one subject in the same coordinates; if they are, set surface.asymmetric to true.",
        )
