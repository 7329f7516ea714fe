"""A body without a sulcus follows surfaces in which one opens, although registration
does not know of it."""

from itertools import pairwise

import numpy as np
from shapes import box_mesh, scaling
from skimage.measure import marching_cubes

from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.deformations import Deformation
from gyriflow.geometry.matching import faces_that_cross, nearest_on
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    linear_pieces,
    volumes_between,
)
from gyriflow.geometry.triangles import TriangleMesh, corners, face_areas
from gyriflow.growth.series_shapes import fit_onto_surface, follow_series

SIZE_MM = np.array([12.0, 12.0, 8.0])
"""Of a block below z = 0."""
WIDTH_MM, HALF_LENGTH_MM, VOXEL_MM = 0.5, 4.0, 0.5
CORTEX_MM = 2.0
DEPTHS_MM = (0.0, 1.5, 3.0)
"""Of the slit in the plane x = 0, week by week. Its banks touch at first."""


def grid(margin_mm):
    """Return the (3, i, j, k) places of a grid around the block, and its affine."""
    low = -SIZE_MM / [2, 2, 1] - margin_mm
    shape = ((SIZE_MM + 2 * margin_mm) / VOXEL_MM).astype(int) + 1
    places = VOXEL_MM * np.indices(shape) + low.reshape(3, 1, 1, 1)
    return places, scaling(VOXEL_MM, low)


def block_with_slit(depth_mm):
    """Return the surface of the block with a slit; its bottom is half an ellipse."""
    (x, y, z), affine = grid(2 * VOXEL_MM)
    over = np.abs([x, y, z + SIZE_MM[2] / 2]) - SIZE_MM.reshape(3, 1, 1, 1) / 2
    outside = np.linalg.norm(np.maximum(over, 0), axis=0)
    signed = outside + np.minimum(over.max(axis=0), 0)
    depth = depth_mm * np.sqrt(np.clip(1 - (y / HALF_LENGTH_MM) ** 2, 0, 1))
    slit = np.where(depth > 0.2, np.maximum(np.abs(x) - WIDTH_MM / 2, -z - depth), 0.3)
    distance = np.maximum(signed, -slit)
    places, faces, _, _ = marching_cubes(distance, 0.0, spacing=(VOXEL_MM,) * 3)
    return TriangleMesh(places + affine[:3, 3], faces)


def registration(before_mm, after_mm):
    """Return the map of a week by labels: the tissue below the cortex sinks, and the
    top does not know of the slit."""
    (x, y, z), affine = grid(3.0)
    place = np.exp(-((x / 2) ** 2) / 2) * np.sqrt(np.clip(1 - (y / 5.5) ** 2, 0, 1))
    below = before_mm + CORTEX_MM
    share = np.interp(-z, [0.0, below, SIZE_MM[2]], [0.0, 1.0, 0.0])
    sunk = np.zeros((*x.shape, 3), np.float32)
    sunk[..., 2] = -(after_mm - before_mm) * place * share
    return Deformation(np.eye(4), sunk, affine)


def area_at_slit(surface):
    x, y, z = corners(surface).mean(axis=1).T
    near = (np.abs(x) < 5) & (np.abs(y) < 5) & (z > -6)
    return face_areas(surface)[near].sum()


def test_a_body_opens_a_slit_that_registration_does_not_know():
    box = box_mesh((12, 12, 8), tuple(SIZE_MM))
    mesh = TetrahedralMesh(box.vertices - [0, 0, SIZE_MM[2] / 2], box.tets)
    surfaces = [block_with_slit(depth) for depth in DEPTHS_MM]
    pairs = [registration(*depths) for depths in pairwise(DEPTHS_MM)]
    body = ElasticFit(mesh)
    shapes = follow_series(mesh, range(3), pairs, surfaces[1:], body, has_slits=True)
    faces, used = boundary_surface(mesh)[0].faces, boundary_surface(mesh)[1]
    start = area_at_slit(surfaces[0])
    for week, surface in enumerate(surfaces[1:], start=1):
        positions = shapes.positions[shapes.weeks.index(week)]
        body = TriangleMesh(positions[used], faces)
        assert len(faces_that_cross(body)) == 0
        assert (volumes_between(positions, linear_pieces(mesh)) > 0).all()
        away, _, _ = nearest_on(surface.vertices, body)
        assert np.quantile(away, 0.99) < 0.8
        gained, opened = area_at_slit(body) - start, area_at_slit(surface) - start
        assert gained > 0.4 * opened
    assert 0.7 < gained / opened < 1.1
    # by places and normals alone the slit has hardly an effect
    top = TriangleMesh(mesh.vertices[used], faces)
    alone = TriangleMesh(fit_onto_surface(top, surfaces[-1]), faces)
    assert area_at_slit(alone) - start < 0.2 * opened
