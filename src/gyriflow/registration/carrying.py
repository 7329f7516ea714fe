"""What is carried along a registration: points over the weeks, maps and regions to another brain's surface."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.deformations import Deformation, carry, carry_back, transform_points
from ..geometry.matching import labels_at, match_points, values_at
from ..geometry.triangles import Floats, Ints, TriangleMesh, vertex_normals

OUTSIDE = 0.001
"""Largest share of points that may lie beyond the grid that a displacement is known on."""


def carry_over_weeks(points: Floats, deformations: Sequence[Deformation]) -> Floats:
    """Returns the (w + 1, n, 3) positions of (n, 3) points, the first as given, carried through w deformations in turn.

    InputError where points leave the grids that the deformations are known on.
    """
    positions = [points]
    for number, deformation in enumerate(deformations):
        _require_on_grid(deformation, positions[-1], f"interval {number + 1} of {len(deformations)}")
        positions.append(carry(deformation, positions[-1]))
    return np.stack(positions)


def carry_back_over_weeks(points: Floats, deformations: Sequence[Deformation]) -> Floats:
    """Returns the (w + 1, n, 3) positions of points of the last week, carried back; the first week's come first."""
    positions = [points]
    for deformation in reversed(deformations):
        positions.append(carry_back(deformation, positions[-1]))
    return np.stack(positions[::-1])


def carry_both_ways(points: Floats, earlier: Sequence[Deformation], later: Sequence[Deformation]) -> Floats:
    """Returns the (w, n, 3) positions of (n, 3) points in all weeks: carried back, as given, and carried on."""
    return np.concatenate([carry_back_over_weeks(points, earlier), carry_over_weeks(points, later)[1:]])


def carry_map(values: Floats, source: TriangleMesh, target: TriangleMesh, deformation: Deformation) -> Floats:
    """Returns (n,) or (n, k) values of the vertices of `source` at those of `target`.

    The source is carried into the target's space; each vertex of the target takes the value of the nearest point whose
    normal agrees.
    """
    shape = _carry_surface(source, deformation)
    return values_at(match_points(target.vertices, vertex_normals(target), shape), values)


def carry_regions(
    labels: NDArray[np.integer], source: TriangleMesh, target: TriangleMesh, deformation: Deformation
) -> Ints:
    """Returns the region labels of the vertices of `source` at those of `target`, as by `carry_map`."""
    shape = _carry_surface(source, deformation)
    return labels_at(match_points(target.vertices, vertex_normals(target), shape), labels)


def _carry_surface(source: TriangleMesh, deformation: Deformation) -> TriangleMesh:
    _require_on_grid(deformation, source.vertices, "the surface")
    return TriangleMesh(carry(deformation, source.vertices), source.faces)


def _require_on_grid(deformation: Deformation, points: Floats, what: str) -> None:
    index = transform_points(points, np.linalg.inv(deformation.affine))
    last = np.array(deformation.displacement.shape[:3]) - 1
    beyond = ((index < 0) | (index > last)).any(axis=1)
    if beyond.mean() > OUTSIDE:
        away = np.linalg.norm((index - np.clip(index, 0, last)) @ deformation.affine[:3, :3].T, axis=1)
        raise InputError(
            f"points lie beyond the grid that the registration knows ({what})",
            found=f"{np.count_nonzero(beyond)} of {len(points)} points, up to {away.max():.3g} mm",
            expected="points inside the brain that was registered",
            remedy="The surface or mesh is not in the pose of the volume that was registered, or of another brain.",
        )
