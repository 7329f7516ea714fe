"""Left and right: a whole surface split at the fissure, two hemispheres brought side by side without crossing."""

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..errors import InputError
from ..geometry.triangles import TriangleMesh, corners, face_areas, face_components, signed_volume, submesh
from .limits import Limits

Floats = NDArray[np.float64]
# left and right cerebral hemispheres of one fetus differ by a few percent; successive weeks by 15 %
DOUBTFUL_RATIO = 1.15
FURTHEST_APART_MM = 10.0
# a second closed piece of this part of the largest is a hemisphere
COMPARABLE = 0.1
# and has this part of its area, or more, on its own side of the fissure, as the largest has: a whole brain has half
ON_ITS_SIDE = 0.75
# of a cut surface, patches on the wrong side of the cut up to this share are bulges over the fissure
MOST_GIVEN_BACK = 0.05


def left_faces(mesh: TriangleMesh, heights: Floats) -> NDArray[np.bool_]:
    """Returns the (m,) mask of the faces of the left hemisphere.

    `heights` (m,) are the distances of the faces from the fissure, negative on the left. Two comparable closed pieces
    that lie mostly on different sides are the hemispheres, though they may reach over the fissure. Else patches that
    bulge over the fissure are given back to the hemisphere that surrounds them, so that each is in one piece.
    InputError where such patches are too large: a cut there would not part the hemispheres.
    """
    surface = face_components(mesh)
    areas = face_areas(mesh)
    side = heights < 0
    sizes = np.bincount(surface, weights=areas)
    on_left = np.bincount(surface, weights=areas * side) / sizes
    if len(sizes) > 1 and sizes[1] >= COMPARABLE * sizes[0]:
        # a detached lump is no second hemisphere: the brain beside it lies on both sides
        low, high = sorted(on_left[:2])
        if low <= 1 - ON_ITS_SIDE and high >= ON_ITS_SIDE:
            middles = np.bincount(surface, weights=areas * heights) / sizes
            return np.asarray(middles < 0)[surface]
    a, b = _neighbours(mesh)
    given_back = np.zeros(len(side), dtype=bool)
    # what is given back may join pieces of the other side
    for _ in range(3):
        within = side[a] == side[b]
        piece = _components(a[within], b[within], len(side))
        area = np.bincount(piece, weights=areas)
        largest = [
            piece[side == left][area[piece[side == left]].argmax()] for left in (True, False) if (side == left).any()
        ]
        strays = ~np.isin(piece, largest)
        if not strays.any():
            break
        given_back ^= strays
        side = side ^ strays
    share = float(areas[given_back].sum() / areas.sum())
    if share > MOST_GIVEN_BACK:
        raise InputError(
            "the surface cannot be parted at the fissure",
            found=f"a left and a right part in several pieces, {100 * share:.0f} % of the area beside the largest two",
            expected=f"one piece for each hemisphere, {100 * MOST_GIVEN_BACK:.0f} % beside them",
            remedy="Is the left-right axis that of the coordinates? Give the hemispheres as two closed surfaces.",
        )
    return side


def nearer_left(mesh: TriangleMesh, left: TriangleMesh, right: TriangleMesh) -> NDArray[np.bool_]:
    """Returns the (m,) mask of the faces that lie on the left hemisphere, of a surface close to that of both.

    A face belongs to the hemisphere whose given surface is nearer to its centroid: where a connected brain was cut
    along a curved fissure, so is `mesh`. Stray patches are given back as in `left_faces`.
    """
    centres = corners(mesh).mean(axis=1)
    away, back = (
        np.sqrt(igl.point_mesh_squared_distance(centres, side.vertices, side.faces)[0]) for side in (left, right)
    )
    return left_faces(mesh, away - back)


def split(mesh: TriangleMesh, fissure_x_mm: float) -> tuple[TriangleMesh, TriangleMesh]:
    """Returns the left and the right hemisphere's pial surfaces; together they have every face of `mesh` once.

    The fissure is the plane x = `fissure_x_mm` in RAS+. The parts are open where a connected brain is cut.
    """
    return cut_sides(mesh, left_faces(mesh, corners(mesh)[:, :, 0].mean(axis=1) - fissure_x_mm))


def cut_sides(mesh: TriangleMesh, left: NDArray[np.bool_]) -> tuple[TriangleMesh, TriangleMesh]:
    """Returns the surfaces of the faces where the (m,) mask holds, and of the others.

    InputError where one of the two has no face.
    """
    if left.all() or not left.any():
        raise InputError(
            "the brain lies on one side of the interhemispheric fissure",
            found=f"{int(left.sum())} of {len(left)} faces on the left",
            expected="two hemispheres",
            remedy="Give both hemispheres, in RAS+ or LPS coordinates as named in the config.",
        )
    return submesh(mesh, left)[0], submesh(mesh, ~left)[0]


def require_pair(left: TriangleMesh, right: TriangleMesh, limits: Limits, coordinates: str) -> list[str]:
    """Returns what is doubtful about two surfaces in RAS+ as the left and right hemisphere of one brain.

    `coordinates` are those that the user has named, "ras", "lps" or "auto". InputError where their centroids are not in
    order (left is the smaller x), or their volumes too different.
    """
    x_left, x_right = left.vertices[:, 0].mean(), right.vertices[:, 0].mean()
    if x_left >= x_right:
        raise InputError(
            "the left hemisphere lies to the right of the right one",
            found=f"centroids at x = {x_left:.1f} (left) and {x_right:.1f} mm (right)",
            expected="left at the smaller x (RAS+)",
            remedy=_remedy_of_order(coordinates),
        )
    volumes = signed_volume(left), signed_volume(right)
    ratio = max(volumes) / min(volumes)
    if ratio > limits.max_hemisphere_ratio:
        raise InputError(
            "the hemispheres are too different in size to be of one brain",
            found=f"{volumes[0] / 1e3:.1f} mL (left) and {volumes[1] / 1e3:.1f} mL (right)",
            expected=f"volumes within {100 * (limits.max_hemisphere_ratio - 1):.0f} % of each other",
            remedy="Give both hemispheres of the same subject and week; if they are, raise "
            "surface.max_hemisphere_ratio.",
        )
    if ratio > DOUBTFUL_RATIO:
        return [f"the hemispheres' volumes differ by {100 * (ratio - 1):.0f} %: are they of one brain?"]
    return []


def _remedy_of_order(coordinates: str) -> str:
    """Returns what to do where left and right are not in order in the coordinates that the user has named."""
    other = {"ras": "lps", "lps": "ras"}.get(coordinates)
    if other is None:
        return "The files seem to be swapped: swap `left` and `right`; or, if they are right, name the coordinates."
    return (
        f"Either the coordinates are {other.upper()} (set coordinates: {other}) or the files are swapped (swap `left` "
        "and `right`). Both changes together would turn the brain back to front; in doubt, set coordinates: auto."
    )


def least_gap(left: TriangleMesh, right: TriangleMesh) -> float:
    """Returns the least distance in mm between two closed surfaces, negative by the depth where they overlap."""
    gaps = []
    for one, other in ((left, right), (right, left)):
        inward = igl.fast_winding_number(other.vertices, other.faces, one.vertices) > 0.5
        distance = np.sqrt(igl.point_mesh_squared_distance(one.vertices, other.vertices, other.faces)[0])
        gaps.append(float(np.where(inward, -distance, distance).min()))
    return min(gaps)


def require_common_pose(asymmetry_mm: float, length_mm: float, limits: Limits) -> None:
    """Raises InputError where two hemispheres together are no mirror images of each other in any plane.

    `asymmetry_mm` is the mean distance to the mirror image, `length_mm` the brain's length.
    """
    if asymmetry_mm > limits.max_asymmetry * length_mm:
        raise InputError(
            "the hemispheres are not posed as one brain",
            found=f"{asymmetry_mm:.1f} mm between the surface and its mirror image",
            expected=f"at most {limits.max_asymmetry * length_mm:.1f} mm",
            remedy="Give both hemispheres of one subject in the same coordinates; if they are so asymmetric, raise "
            "surface.max_asymmetry.",
        )


def set_apart(
    left: TriangleMesh, right: TriangleMesh, gap_mm: float, to_right: Floats
) -> tuple[TriangleMesh, TriangleMesh, float]:
    """Returns the hemispheres moved apart, each by the same, until they are `gap_mm` from each other.

    They move along the direction `to_right` (3,), a unit vector from left to right.

    The third value is the distance in mm by which each was moved; 0 where the gap was there already.
    InputError where more than 10 mm would be needed.
    """
    moved = 0.0
    gap = least_gap(left, right)
    while gap < gap_mm:
        # the shortest way out of an overlap is rarely along this direction, so more than one step may be needed
        step = max(0.5 * (gap_mm - gap), 0.05)
        moved += step
        if moved > FURTHEST_APART_MM:
            raise InputError(
                "the hemispheres overlap too much to be of one brain in one pose",
                found=f"an overlap beyond {2 * FURTHEST_APART_MM:g} mm",
                expected="hemispheres side by side",
                remedy="Give both hemispheres of one subject and week, in the same coordinates.",
            )
        left = TriangleMesh(left.vertices - step * to_right, left.faces)
        right = TriangleMesh(right.vertices + step * to_right, right.faces)
        gap = least_gap(left, right)
    return left, right, moved


def _neighbours(mesh: TriangleMesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns the two faces at each inner edge."""
    pairs = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    order = np.lexsort(pairs.T)
    same = (pairs[order][1:] == pairs[order][:-1]).all(axis=1)
    return face[order][:-1][same], face[order][1:][same]


def _components(a: NDArray[np.int64], b: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    graph = sparse.coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1]
