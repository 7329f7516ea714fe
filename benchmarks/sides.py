"""Give a pair of hemispheres in all 48 axes of files, named rightly and exchanged, and
list what each gets.

    ./run python benchmarks/sides.py [--left LEFT --right RIGHT] [--coordinates auto]

LEFT and RIGHT are closed pial surfaces in RAS+ mm; default: those of the shipped atlas'
brain of 24 GW, cut at x = 0. Half of the axes mirror. The coordinates of the
configuration are `auto`, `ras` and `lps`, or those given. The answers are

- right: the surfaces are accepted, the left hemisphere as the left one;
- refused: exchanged files and mirrored coordinates are both named, or mirrored ones
  alone, or wrong coordinates;
- wrong: accepted, the left hemisphere as the right one. That is so if the files are
  exchanged and mirrored, which gives the shapes of a right brain.

The last line is one JSON object with `rows`: how many axes get each answer, without and
with warnings, and which.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import permutations, product
from typing import Any

import nibabel as nib
import numpy as np
from common import print_rows

from gyriflow.anatomy import template
from gyriflow.anatomy.extraction import isosurface, make_simple, smooth_mask
from gyriflow.anatomy.plausible import require_left_and_right
from gyriflow.anatomy.pose import pose_of_pair, require_coordinates
from gyriflow.anatomy.template import PointCloud
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import RigidFit, motion
from gyriflow.geometry.poses import CONVENTIONS
from gyriflow.geometry.triangles import Floats, TriangleMesh, transformed
from gyriflow.io.surfaces import read_surface
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.shipped import SHIPPED

LABELS = (
    SHIPPED
    / "atlases"
    / "spina-bifida"
    / "fetal_SB_atlas_GA24_notoperated"
    / "parcellation.nii.gz"
)
HALF_GAP_MM = 0.5


def hemispheres_of_atlas() -> list[TriangleMesh]:
    """Return the closed left and right hemisphere of the shipped atlas at 24 GW, in
    RAS+ mm."""
    volume = read_label_volume(LABELS)
    mask = np.isin(volume.labels, SCHEMES["spina-bifida-atlas"].cerebrum)
    x = (
        np.einsum("i,i...->...", volume.affine[0, :3], np.indices(mask.shape))
        + volume.affine[0, 3]
    )
    sides = mask & (x < -HALF_GAP_MM), mask & (x > HALF_GAP_MM)
    fields = [make_simple(smooth_mask(side))[0] for side in sides]
    return [isosurface(field, volume.affine) for field in fields]


def every_axes() -> Iterator[Floats]:
    """Yield the (3, 3) matrices that permute and reverse the axes of RAS+
    coordinates."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            yield np.diag(signs) @ np.eye(3)[list(order)]


def remember_shapes() -> None:
    """Let the pose of each hemisphere in each axes be found once: pairs and mirror
    images have the same ones."""
    found: dict[bytes, tuple[RigidFit, float]] = {}
    search = template.register_from_all_sides

    def once(
        shape: PointCloud, templates: Sequence[PointCloud]
    ) -> tuple[RigidFit, float]:
        # without negative zeros
        key = (shape.points.round(6) + 0.0).tobytes()
        if key not in found:
            found[key] = search(shape, templates)
        return found[key]

    template.register_from_all_sides = once


def answer(
    left: TriangleMesh, right: TriangleMesh, coordinates: str, is_exchanged: bool
) -> tuple[str, bool]:
    """Return what two files get, and whether with warnings."""
    try:
        if coordinates == "auto":
            warnings = pose_of_pair(left, right).warnings
        else:
            left, right = (
                transformed(mesh, CONVENTIONS[coordinates]) for mesh in (left, right)
            )
            require_left_and_right(left, right, coordinates)
            warnings = tuple(require_coordinates(left, right, coordinates))
    except InputError as error:
        return f"refused: {str(error).partition(';')[0]}", False
    return "wrong" if is_exchanged else "right", bool(warnings)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--left")
    parser.add_argument("--right")
    parser.add_argument("--coordinates", nargs="+", default=["auto", *CONVENTIONS])
    files = parser.parse_args()
    if files.left and files.right:
        halves = [read_surface(files.left), read_surface(files.right)]
    else:
        halves = hemispheres_of_atlas()
    remember_shapes()
    counts: dict[tuple[Any, ...], list[str]] = defaultdict(list)
    for axes in every_axes():
        is_mirrored = bool(np.linalg.det(axes) < 0)
        pair = [transformed(half, motion(axes)) for half in halves]
        for is_exchanged in (False, True):
            files_given = pair[::-1] if is_exchanged else pair
            for coordinates in files.coordinates:
                got, has_warnings = answer(*files_given, coordinates, is_exchanged)
                key = (coordinates, is_exchanged, is_mirrored, got, has_warnings)
                counts[key].append("".join(nib.aff2axcodes(motion(axes.T))))
    names = ("coordinates", "exchanged", "mirrored", "answer", "warned")
    rows = []
    for key, found in sorted(counts.items()):
        rows.append(
            {
                **dict(zip(names, key, strict=True)),
                "axes": len(found),
                "which": " ".join(found),
            }
        )
    print_rows(rows)


if __name__ == "__main__":
    main()
