"""Correspondence between the points of two brains: a smooth deformation, or surfaces
with the same vertices."""

from dataclasses import dataclass

import numpy as np
import scipy  # submodules load lazily, which keeps dry runs fast
from numpy.typing import ArrayLike, NDArray

from .triangles import Floats, TriangleMesh, freeze, transformed


@dataclass(frozen=True, eq=False)
class Deformation:
    """The map p → A(p + u(p)) from one brain's space to another's, both in RAS+ mm.

    A is the affine (4, 4) `matrix`, u the (i, j, k, 3) `displacement` in mm on a grid
    in the first brain's space. The grid's `affine` (4, 4) leads from indices to RAS+
    mm. u is interpolated linearly, and constant outside the grid.
    """

    matrix: Floats
    displacement: Floats
    affine: Floats

    def __post_init__(self) -> None:
        freeze(self, "matrix", np.float64, 4)
        freeze(self, "affine", np.float64, 4)
        if self.displacement.ndim != 4 or self.displacement.shape[3] != 3:
            raise ValueError(
                "expected an (i, j, k, 3) displacement, found shape"
                f" {self.displacement.shape}"
            )


@dataclass(frozen=True, eq=False)
class MatchedSurfaces:
    """The first brain's surface in mm, and the (n, 3) positions of its vertices in the
    second brain."""

    first: TriangleMesh
    second: Floats

    def __post_init__(self) -> None:
        freeze(self, "second", np.float64, 3)
        if self.second.shape != self.first.vertices.shape:
            raise ValueError(
                f"expected {len(self.first.vertices)} matched vertices, found"
                f" {len(self.second)}"
            )


Correspondence = Deformation | MatchedSurfaces
"""Result of a registration, or of matched surfaces."""


def transform_points(
    points: NDArray[np.number], matrix: NDArray[np.floating]
) -> Floats:
    """Apply a (4, 4) affine map to (n, 3) points."""
    linear = matrix[:3, :3]
    shift = matrix[:3, 3]
    return np.asarray(
        points @ linear.T + shift,
        dtype=np.float64,
    )


def voxel_size(affine: ArrayLike) -> Floats:
    """Return the (3,) lengths of a voxel in mm, for a volume's (4, 4) affine."""
    axes = np.asarray(affine)[:3, :3]
    return np.linalg.norm(axes, axis=0)


def voxel_index(points: Floats, affine: ArrayLike) -> Floats:
    """Return the (3, …) fractional voxel indices of (…, 3) points in mm, for a volume's
    (4, 4) affine."""
    to_index = np.linalg.inv(np.asarray(affine, dtype=float))
    return np.moveaxis(transform_points(points, to_index), -1, 0)


def between_moved(
    pair: Correspondence,
    first: Floats,
    second: Floats,
) -> Correspondence:
    """Return the correspondence of two brains after (4, 4) rigid motions of the first
    and of the second."""
    if isinstance(pair, MatchedSurfaces):
        moved = transformed(pair.first, first)
        return MatchedSurfaces(moved, transform_points(pair.second, second))
    matrix = second @ pair.matrix @ np.linalg.inv(first)
    turned = pair.displacement @ first[:3, :3].T
    turned = turned.astype(pair.displacement.dtype)
    return Deformation(matrix, turned, first @ pair.affine)


def carry(deformation: Deformation, points: Floats) -> Floats:
    """Map (n, 3) points of the first brain in mm to the second, A(p + u(p))."""
    index = voxel_index(points, deformation.affine)
    moved = np.array(points, dtype=np.float64)
    for axis in range(3):
        moved[:, axis] += scipy.ndimage.map_coordinates(
            deformation.displacement[..., axis], index, order=1, mode="nearest"
        )
    return transform_points(moved, deformation.matrix)
