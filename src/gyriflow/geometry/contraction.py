"""Contraction of closed surfaces: each small patch of a surface becomes one vertex, in
the same topology."""

import numpy as np

from .triangles import (
    Floats,
    Ints,
    Mask,
    TriangleMesh,
    connected,
    dots,
    half_edges,
    vertex_normals,
)

# grids of cells that divide a surface into patches: each grid's cells are smaller by
# this ratio, and shifted, so that their borders lie elsewhere
N_GRIDS, GRID_RATIO, GRID_SHIFT = 12, 0.6, 0.37
# cells along an axis of a grid
MAX_CELLS = 2**16
# a patch is flat enough if the mean of its unit normals is at least this long
MIN_MEAN_NORMAL = 0.75
# faces around a vertex of a closed surface
MIN_FACES = 3


def contract(mesh: TriangleMesh, size_mm: float) -> TriangleMesh:
    """Contract each small patch of a closed surface to one vertex, in the same
    topology.

    A patch lies in a cube of edge `size_mm`. Its vertex is the mean of its vertices,
    moved to the tangent plane at the middle one. Bent patches, as at the rim of a
    narrow sulcus, are smaller.
    """
    normals = vertex_normals(mesh)
    patch, faces = _patches(mesh, normals, size_mm)
    sizes = np.bincount(patch)
    centres = _sums(patch, mesh.vertices) / sizes[:, None]
    distances = np.linalg.norm(mesh.vertices - centres[patch], axis=1)
    by_patch = np.lexsort((distances, patch))
    middle = by_patch[np.cumsum(sizes) - sizes]
    # the mean of a curved patch lies off the surface
    upright = normals[middle]
    heights = dots(mesh.vertices[middle] - centres, upright)
    return TriangleMesh(centres + heights[:, None] * upright, faces)


def _patches(mesh: TriangleMesh, normals: Floats, size_mm: float) -> tuple[Ints, Ints]:
    """Return the patch (n,) of each vertex of a closed surface, and the (m, 3) faces
    between patches, which have the surface's topology.

    A patch is a connected part of the surface in a cell of a grid. One that is bent, or
    would change the topology, is divided by the next grid.
    """
    n_vertices = len(mesh.vertices)
    pairs = half_edges(mesh)
    # each edge once
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    places = mesh.vertices - mesh.vertices.min(axis=0)
    cell = np.zeros(n_vertices, dtype=np.int64)
    needs_division = np.ones(n_vertices, dtype=bool)
    for grid in range(N_GRIDS):
        place = np.floor(places[needs_division] / size_mm + GRID_SHIFT * grid)
        number = place @ [MAX_CELLS**2, MAX_CELLS, 1]
        cell[needs_division] = number + grid * MAX_CELLS**3
        size_mm *= GRID_RATIO

        first, second = cell[pairs].T
        inner_edges = pairs[first == second]
        patch = connected(inner_edges, n_vertices).astype(np.int64)
        faces, is_bad = _faces_between(mesh.faces, patch, inner_edges)
        lengths = np.linalg.norm(_sums(patch, normals), axis=1)
        sizes = np.bincount(patch)
        is_bad |= lengths < MIN_MEAN_NORMAL * sizes
        # a single vertex cannot be divided
        is_bad &= sizes > 1
        if not is_bad.any():
            return patch, faces
        needs_division = is_bad[patch]
    return np.arange(n_vertices), mesh.faces


def _faces_between(faces: Ints, patch: Ints, inner_edges: Ints) -> tuple[Ints, Mask]:
    """Return the faces between patches, and the mask of the patches that would change
    the topology.

    `inner_edges` (k, 2) are those within patches. The topology stays the same if each
    patch is a disk (connected, Euler number 1) with three faces or more around it, and
    two patches share at most one edge.
    """
    n_patches = int(patch.max()) + 1
    corners = patch[faces]
    n_inner_edges = (corners == np.roll(corners, -1, axis=1)).sum(axis=1)
    inner_faces = corners[n_inner_edges == 3, 0]
    n_vertices = np.bincount(patch)
    n_edges = np.bincount(patch[inner_edges[:, 0]], minlength=n_patches)
    n_faces = np.bincount(inner_faces, minlength=n_patches)
    is_bad = n_vertices - n_edges + n_faces != 1

    between = corners[n_inner_edges == 0]
    n_around = np.bincount(between.ravel(), minlength=n_patches)
    is_bad |= n_around < MIN_FACES
    # one number per half edge
    numbers = between * n_patches + np.roll(between, -1, axis=1)
    ordered = np.sort(numbers.ravel())
    repeated = ordered[1:][np.diff(ordered) == 0]
    for patches in np.divmod(repeated, n_patches):
        is_bad[patches] = True
    return between, is_bad


def _sums(patch: Ints, vectors: Floats) -> Floats:
    """Return the sum of the (n, 3) vectors of each patch, from the patch (n,) of
    each."""
    return np.stack([np.bincount(patch, values) for values in vectors.T], axis=1)
