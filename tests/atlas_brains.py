"""A brain of the shipped atlas, of a week that is not in the template: its labels, its
surface and its hemispheres."""

from functools import cache

import numpy as np
from shapes import mask_surface

from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.shipped import SHIPPED

WEEK = 24.0


@cache
def atlas_labels(week: float = WEEK) -> tuple[np.ndarray, np.ndarray]:
    """Return the (i, j, k) labels of an unoperated week in voxels of 1.6 mm, and their
    (4, 4) affine."""
    path = (
        SHIPPED
        / "atlases"
        / "spina-bifida"
        / f"fetal_SB_atlas_GA{week:g}_notoperated"
        / "parcellation.nii.gz"
    )
    volume = read_label_volume(path)
    return volume.labels[::2, ::2, ::2], volume.affine @ np.diag([2.0, 2.0, 2.0, 1.0])


@cache
def atlas_brain() -> TriangleMesh:
    """Return the closed surface of both hemispheres, joined."""
    mask, affine, _ = _cerebrum()
    return mask_surface(mask, affine)


@cache
def atlas_halves() -> tuple[TriangleMesh, TriangleMesh]:
    """Return the closed surfaces of the left and the right hemisphere, cut apart beside
    x = 0, in RAS+."""
    mask, affine, x = _cerebrum()
    left, right = (mask_surface(mask & side, affine) for side in (x < -0.5, x > 0.5))
    return left, right


def _cerebrum() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    labels, affine = atlas_labels()
    x = np.einsum("i,i...->...", affine[0, :3], np.indices(labels.shape)) + affine[0, 3]
    return np.isin(labels, SCHEMES["spina-bifida-atlas"].cerebrum), affine, x
