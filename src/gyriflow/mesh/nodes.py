"""Quadratic elements whose outer nodes are moved onto the smooth surface, as far as
elements stay sound.

Facets are bumps of the size of an element, which grow with the cortex if nodes stay on
the middles of edges.
"""

import logging
from collections.abc import Callable
from functools import partial

import numpy as np

from ..geometry import tetrahedra
from ..geometry.jacobians import coefficients
from ..geometry.matching import MIN_NORMAL_COSINE, faces_that_cross, nearest_on
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import (
    Floats,
    Mask,
    TriangleMesh,
    dots,
    edge_lengths,
    edges,
    face_normals,
    vertex_normals,
)
from .quality import jacobian_ratios

log = logging.getLogger(__name__)
FARTHEST = 0.25
"""Largest move of a node, in lengths of the shortest outer edge that ends there."""
HALVINGS = 6
"""How often the move of an unsound element's nodes is halved before it is given up."""
SOUND = 0.3
"""Least ratio of the determinant of a curved element's map to its mean."""
WORSE = 0.5
"""Part of its radius ratio that an element keeps at least when its corners move."""


def curve_edges(mesh: TetrahedralMesh, surface: TriangleMesh) -> TetrahedralMesh:
    """Return a linear mesh as quadratic elements whose outer nodes lie on a smooth
    surface (mm) where they can.

    Corners move first, with straight sides; then nodes on the middles of outer edges.
    Where an element would become unsound, or the surface cross itself, moves are halved
    and then given up.
    """
    are_spoilt = partial(_are_spoilt, tetrahedra.radius_ratios(mesh))
    moved, _ = _move(mesh, *_project(mesh, surface), are_spoilt)
    straight = tetrahedra.quadratic(moved)
    target, way = _project(straight, surface)
    middles = way & (np.arange(len(way)) >= len(mesh.vertices))
    result, left = _move(straight, target, middles, _are_unsound)
    outer, _ = tetrahedra.boundary_faces(straight)
    n_middles = np.count_nonzero(np.unique(outer) >= len(mesh.vertices))
    log.info(
        "quadratic elements: %d of %d nodes on middles of outer edges on the surface,"
        " least ratio of Jacobians %.2f",
        left.sum(),
        n_middles,
        jacobian_ratios(result).min(),
    )
    return result


def _are_spoilt(ratios_before: Floats, placed: TetrahedralMesh) -> Mask:
    """Return whether linear elements are inverted or have lost most of their radius
    ratio."""
    is_inverted = tetrahedra.signed_volumes(placed) <= 0
    is_worse = tetrahedra.radius_ratios(placed) < WORSE * ratios_before
    return np.asarray(is_inverted | is_worse)


def _are_unsound(placed: TetrahedralMesh) -> Mask:
    values = coefficients(placed.vertices, placed.tets)
    return np.asarray(values.min(axis=1) < SOUND * values.mean(axis=1))


def _project(mesh: TetrahedralMesh, surface: TriangleMesh) -> tuple[Floats, Mask]:
    """Return the vertices (n, 3) with those on the boundary moved onto a surface where
    it is near, and whether each has been moved."""
    boundary, outer = tetrahedra.boundary_surface(mesh)
    distance, face, place = nearest_on(boundary.vertices, surface)
    ends, _ = edges(boundary)
    lengths = edge_lengths(boundary.vertices, ends)
    shortest = np.full(len(outer), np.inf)
    np.minimum.at(
        shortest,
        ends.ravel(),
        np.repeat(lengths, 2),
    )
    # the wall of a sulcus may be nearer to a node than the place it comes from
    normals = vertex_normals(boundary)
    normals_there = face_normals(surface)[face]
    agrees = dots(normals, normals_there) >= MIN_NORMAL_COSINE
    is_near = agrees & (distance <= FARTHEST * shortest)
    moved = outer[is_near]
    target = mesh.vertices.copy()
    target[moved] = place[is_near]
    is_moved = np.zeros(len(target), dtype=bool)
    is_moved[moved] = True
    return target, is_moved


def _move(
    mesh: TetrahedralMesh,
    target: Floats,
    way: Mask,
    unsound: Callable[[TetrahedralMesh], Mask],
) -> tuple[TetrahedralMesh, Mask]:
    part = way.astype(float)
    triangles, _ = tetrahedra.boundary_faces(mesh)
    used, local = np.unique(triangles, return_inverse=True)
    faces = local.reshape(-1, 3)
    crossed = faces_that_cross(TriangleMesh(mesh.vertices[used], faces))
    for round_ in range(3 * HALVINGS):
        placed = TetrahedralMesh(
            mesh.vertices + part[:, None] * (target - mesh.vertices), mesh.tets
        )
        bad = mesh.tets[unsound(placed)].ravel()
        new = np.setdiff1d(
            faces_that_cross(TriangleMesh(placed.vertices[used], faces)), crossed
        )
        bad = np.unique(np.concatenate([bad, triangles[new].ravel()]))
        bad = bad[part[bad] > 0]
        if not len(bad):
            break
        part[bad] = part[bad] / 2 if round_ < HALVINGS else 0.0
    return placed, part > 0
