"""Maps over a brain brought onto the vertices of its tetrahedral mesh: from surfaces
and from volumes."""

import logging
import operator
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.matching import barycentric, nearest_on
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    coordinate_ranks,
    corners,
    dots,
    face_areas,
    transformed,
)

log = logging.getLogger(__name__)

FARTHEST_MM = 5.0
QUANTILE = 0.95
"""A map's surface may be this far from the mesh's: all surfaces of one brain are
nearer, but where they are cut."""
NEIGHBOURS = 8
SIGNS = {"gt": ">", "ge": "≥", "le": "≤"}
TIE = 1e-9
"""Relative difference below which two distances count as equal."""


def vertex_map_on_mesh(
    mesh_vertices_mm: Floats,
    pial_facets: Ints,
    surface: TriangleMesh,
    values: Floats,
    path: str | None = None,
) -> Floats:
    """Return a map on a surface as (n,) values at the vertices of a mesh.

    Vertices on the mesh's surface, of `pial_facets` (f, 3), take the value at the
    nearest point of `surface`, linear in its triangles; inner ones that of the nearest
    of these vertices, ties going to smaller coordinates. All is in the mesh's
    coordinates. InputError, with the `path`, where a twentieth of the mesh's surface is
    more than 5 mm from the map's.
    """
    pial = np.unique(pial_facets)
    points = mesh_vertices_mm[pial]
    surface = _solid(surface)
    distance, faces, nearest = nearest_on(points, surface)
    far = float(np.quantile(distance, QUANTILE))
    log.info(
        "the surface of %s is %.2f mm from the mesh's (median; 95 %%: %.2f mm)",
        path,
        np.median(distance),
        far,
    )
    if far > FARTHEST_MM:
        raise InputError(
            "the surface of a map lies far from that of the start brain's mesh",
            path=path,
            found=(
                f"{far:.1f} mm for a twentieth of the mesh's surface,"
                f" {np.median(distance):.1f} mm for half of it"
            ),
            expected=f"at most {FARTHEST_MM:g} mm",
        )
    weights = barycentric(nearest, corners(surface)[faces])
    on_pial = dots(weights, values[surface.faces[faces]])
    mapped = on_pial[_nearest_vertices(mesh_vertices_mm, points)]
    mapped[pial] = on_pial
    return mapped


def volume_map_on_mesh(
    mesh_vertices_mm: Floats,
    data: Floats,
    affine: ArrayLike,
    path: str | None = None,
) -> Floats:
    """Return a volume's (n,) values at the vertices of a mesh, linear between the
    centres of voxels.

    `data` are (i, j, k), `affine` (4, 4) leads to the mesh's coordinates. InputError,
    with the volume's `path`, if vertices lie outside it, or between voxels with NaN or
    infinite values.
    """
    matrix = np.asarray(affine, dtype=float)
    index = np.linalg.solve(
        matrix[:3, :3],
        (mesh_vertices_mm - matrix[:3, 3]).T,
    ).T
    # rounding must not push a vertex on the rim outside
    last = np.array(data.shape) - 0.5 + 1e-6
    beyond = index - np.clip(index, -0.5 - 1e-6, last)
    outside = np.linalg.norm(beyond @ matrix[:3, :3].T, axis=1)
    expected = f"values at all {len(index)} vertices of the start brain's mesh"
    if outside.any():
        raise InputError(
            "a map's volume does not cover the start brain",
            path=path,
            found=(
                f"{np.count_nonzero(outside)} vertices outside it, by up to"
                f" {outside.max():.1f} mm"
            ),
            expected=expected,
        )
    values = map_coordinates(data, index.T, order=1, mode="nearest")
    undefined = ~np.isfinite(values)
    if undefined.any():
        raise InputError(
            "a map has no number in parts of the start brain",
            path=path,
            found=f"{undefined.sum()} vertices at voxels that are NaN or infinite",
            expected=expected,
            remedy=(
                "Fill these voxels, and a voxel or two around the brain, for example"
                " with the nearest values."
            ),
        )
    return values


def require_within(
    values: Floats,
    bounds: Mapping[str, float],
    path: str,
) -> None:
    """Raise InputError where (n,) values of a map are not within the bounds (gt, ge,
    le) of its parameter."""
    is_within = np.ones(len(values), dtype=bool)
    limits = []
    for name, bound in bounds.items():
        is_within &= getattr(operator, name)(values, bound)
        limits.append(f"{SIGNS[name]} {bound:g}")
    wrong = values[~is_within]
    if len(wrong):
        raise InputError(
            "holds values that the parameter cannot have",
            path=path,
            found=(
                f"{len(wrong)} of {len(values)} vertices, from {wrong.min():g} to"
                f" {wrong.max():g}"
            ),
            expected=" and ".join(limits),
        )


def move_to_mesh(
    points: Floats,
    surface: TriangleMesh,
    pose: ArrayLike,
) -> TriangleMesh:
    """Return the surface of a map where it is nearest to (k, 3) points on the mesh on
    average.

    Surfaces of the input are moved like the brain, by its (4, 4) pose; those that
    gyriflow made have been already.
    """
    posed = transformed(surface, pose)
    to_posed, _, _ = nearest_on(points, _solid(posed))
    to_surface, _, _ = nearest_on(points, _solid(surface))
    return posed if to_posed.mean() <= to_surface.mean() else surface


def _solid(surface: TriangleMesh) -> TriangleMesh:
    """Return a surface without the faces that have no area."""
    has_area = face_areas(surface) > 0
    return TriangleMesh(surface.vertices, surface.faces[has_area])


def _nearest_vertices(points: Floats, vertices: Floats) -> Ints:
    """Return the (k,) nearest vertex of each point; of equally near ones the first by
    x, y, z."""
    count = len(vertices)
    neighbours = range(1, min(NEIGHBOURS, count) + 1)
    gaps, candidates = cKDTree(vertices).query(points, k=neighbours)
    least = gaps[:, :1]
    is_nearest = gaps <= least * (1 + TIE)
    rank = coordinate_ranks(vertices)
    ranks = np.where(is_nearest, rank[candidates], count)
    first = ranks.argmin(axis=1)
    rows = np.arange(len(points))
    return candidates[rows, first]
