"""The pial surface of a mask of voxels, as an isosurface of the smoothed mask."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import ndtr
from skimage.measure import marching_cubes

from ..errors import MeshError
from ..geometry.triangles import TriangleMesh, signed_volume, transformed
from .topology import euler_gain, unambiguous, without_handles

PAD_VOXELS = 6
LEVEL = 0.5
# slope per voxel of a mask's edge smoothed with σ = 1 voxel: 1/√(2π)
EDGE_SLOPE = 0.4
# smaller groups of voxels outside a mask that smoothing closes are roughness of the labels
LEAST_SLIT_VOXELS = 20
# a part of this size of the largest is kept: two hemispheres that do not touch
COMPARABLE = 0.2


def crop(mask: NDArray[np.bool_]) -> tuple[tuple[slice, ...], NDArray[np.int64]]:
    """Returns the slices that cut an (i, j, k) volume to the mask's contents, and the (3,) first index of the cut
    volume once it has been padded with `PAD_VOXELS`.
    """
    box = ndimage.find_objects(mask.astype(np.uint8))[0]
    return box, np.array([side.start for side in box]) - PAD_VOXELS


def shifted_affine(affine: NDArray[np.float64], first: NDArray[np.int64]) -> NDArray[np.float64]:
    """Returns the affine of a volume that was cut (or padded) so that it begins at voxel `first`."""
    moved = np.array(affine, dtype=float)
    moved[:3, 3] += moved[:3, :3] @ first
    return moved


def smooth_mask(mask: NDArray[np.bool_], smoothing_voxels: float) -> NDArray[np.float32]:
    """Returns the mask as a field from 0 to 1, smoothed by a Gaussian of the given σ in voxels."""
    return ndimage.gaussian_filter(mask.astype(np.float32), smoothing_voxels)


def remove_bridges(
    mask: NDArray[np.bool_], field: NDArray[np.float32], smoothing_voxels: float, left_shut: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], int]:
    """Returns a smoothed mask in which slits that smoothing has closed are open again, and their number of voxels.

    A slit is a group of voxels outside the mask, open to the outside: a sulcus, the fissure or the Sylvian opening,
    one voxel wide. Its voxels take the value with which the surface passes where the slit's walls are. Groups of a few
    voxels are roughness of the labels, which smoothing is for; a slit that would pierce the mask stays shut, and so
    does what is in the mask `left_shut`.
    """
    number, _ = ndimage.label(~mask)
    # the volume is padded, so its first voxel is outside
    closed = (number == number[0, 0, 0]) & (field > LEVEL) & ~left_shut
    number, _ = ndimage.label(closed, np.ones((3, 3, 3)))
    inside, slits = field > LEVEL, np.zeros_like(mask)
    for index, tight in enumerate(ndimage.find_objects(number), start=1):
        box = tuple(slice(side.start - 1, side.stop + 1) for side in tight)
        slit = number[box] == index
        opened = inside[box] & ~slit
        if slit.sum() >= LEAST_SLIT_VOXELS and euler_gain(inside[box], opened) == 0:
            inside[box] = opened
            slits[box] |= slit
    # half-way between a slit's voxel and the next, whose value is that beside a slit one voxel wide, lies the wall
    beside = 1.0 - (ndtr(1.5 / smoothing_voxels) - ndtr(0.5 / smoothing_voxels)) if smoothing_voxels > 0 else 1.0
    return np.where(slits, np.float32(1.0 - beside), field), int(slits.sum())


def refine(field: NDArray, affine: NDArray[np.float64], factor: int) -> tuple[NDArray, NDArray[np.float64]]:
    """Returns an (i, j, k) field on voxels `factor` times smaller, linear in between, and their affine."""
    if factor == 1:
        return field, affine
    fine = np.array(affine, dtype=float)
    fine[:3, :3] /= factor
    # the first fine voxel's centre lies nearer to the first coarse voxel's corner
    fine[:3, 3] -= affine[:3, :3].sum(axis=1) * 0.5 * (1.0 - 1.0 / factor)
    return ndimage.zoom(field, factor, order=1, grid_mode=True, mode="nearest"), fine


def main_parts(mask: NDArray[np.bool_], comparable: float = COMPARABLE) -> tuple[NDArray[np.bool_], int, int]:
    """Returns the mask's largest part and those of comparable size, filled, without the other parts.

    The second and third value are the number of parts dropped and the number of voxels in them.
    """
    number, count = ndimage.label(mask)
    sizes = np.bincount(number.ravel(), minlength=count + 1)
    sizes[0] = 0
    kept = sizes >= comparable * sizes.max()
    kept[0] = False
    dropped = ~kept & (sizes > 0)
    return ndimage.binary_fill_holes(kept[number]), int(dropped.sum()), int(sizes[dropped].sum())


def make_simple(
    field: NDArray[np.float32], comparable: float = COMPARABLE
) -> tuple[NDArray[np.float32], dict[str, Any]]:
    """Returns the field with a level set of main parts only, without cavities and handles, and a report.

    Main parts are those of `comparable` times the largest one's size and more.
    """
    inside = field > LEVEL
    if not inside.any():
        raise MeshError(
            "nothing is left of the mask after smoothing",
            remedy="The structure is thinner than the smoothing: lower smoothing_voxels, or check the labels.",
        )
    kept, parts, voxels = main_parts(inside, comparable)
    field = np.where(kept, np.maximum(field, LEVEL + 1e-3), np.minimum(field, LEVEL - 1e-3)).astype(np.float32)
    repair = without_handles(field)
    return unambiguous(repair.field), {
        "parts_dropped": parts,
        "voxels_dropped": voxels,
        "voxels_filled": int((kept & ~inside).sum()),
        "bridges_cut": repair.bridges_cut,
        "voxels_cut_from_bridges": repair.voxels_cut,
        "tunnels_filled": repair.tunnels_filled,
        "voxels_filled_in_tunnels": repair.voxels_filled,
        "handles_left": repair.handles_left,
    }


def isosurface(field: NDArray[np.float32], affine: NDArray[np.float64]) -> TriangleMesh:
    """Returns the outward surface in mm where an (i, j, k) field falls below one half.

    MeshError where it encloses no volume.
    """
    vertices, faces, _, _ = marching_cubes(field, LEVEL, gradient_direction="ascent")
    # an affine that mirrors (LAS, LPI, …) turns the faces inside out: transformed() turns them back
    mesh = transformed(TriangleMesh(vertices, faces), affine)
    if signed_volume(mesh) <= 0:
        raise MeshError("the surface of the mask encloses no volume", found=f"{signed_volume(mesh):.3g} mm³")
    return mesh
