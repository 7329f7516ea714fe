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
    centres = _sums(patch, mesh.vertices, len(sizes)) / sizes[:, None]
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
    start, end = half_edges(mesh).T
    is_forward = start < end
    # (2, k), each edge once, and (3, m), since NumPy is slow along short rows
    edge_ends = np.stack([start[is_forward], end[is_forward]])
    face_vertices = np.ascontiguousarray(mesh.faces.T)
    places = mesh.vertices - mesh.vertices.min(axis=0)
    cell = np.zeros(n_vertices, dtype=np.int64)
    # a patch has the number of its first vertex
    patch = np.zeros(n_vertices, dtype=np.int64)
    needs_division = np.ones(n_vertices, dtype=bool)
    for grid in range(N_GRIDS):
        indices = np.floor(places[needs_division] / size_mm + GRID_SHIFT * grid)
        number = indices @ [MAX_CELLS**2, MAX_CELLS, 1]
        cell[needs_division] = number + grid * MAX_CELLS**3
        size_mm *= GRID_RATIO

        divided_edges = edge_ends[:, needs_division[edge_ends].all(axis=0)]
        start_cell, end_cell = cell[divided_edges]
        linked = divided_edges[:, start_cell == end_cell]
        patch[needs_division] = _first_connected(linked, n_vertices)[needs_division]

        # only new patches and those beside them have to be looked at: the others have
        # not changed since they were
        divided_faces = face_vertices[:, needs_division[face_vertices].any(axis=0)]
        is_changed = np.zeros(n_vertices, dtype=bool)
        is_changed[patch[divided_faces]] = True
        is_near = is_changed[patch]
        is_bad = _changes_topology(
            patch,
            edge_ends[:, is_near[edge_ends].all(axis=0)],
            face_vertices[:, is_near[face_vertices].any(axis=0)],
        )
        sizes = np.bincount(patch, minlength=n_vertices)
        lengths = np.linalg.norm(_sums(patch, normals, n_vertices), axis=1)
        is_bad |= lengths < MIN_MEAN_NORMAL * sizes
        # a single vertex cannot be divided
        is_bad &= is_changed & (sizes > 1)
        if not is_bad.any():
            return _renumber(patch, face_vertices)
        needs_division = is_bad[patch]
    return np.arange(n_vertices), mesh.faces


def _first_connected(edge_ends: Ints, count: int) -> Ints:
    """Return for each of `count` vertices the first one that it is connected with, by
    edges between the vertices `edge_ends` (2, k)."""
    component = connected(edge_ends.T, count)
    vertices = np.arange(count)
    first = np.empty(component.max() + 1, dtype=np.int64)
    # backwards: of a component's vertices, the last one that is written stays
    first[component[::-1]] = vertices[::-1]
    return first[component]


def _changes_topology(patch: Ints, edge_ends: Ints, face_vertices: Ints) -> Mask:
    """Return the (n,) mask of the patches, by their numbers, that would change the
    topology.

    It holds for patches whose edges are all in `edge_ends` (2, k), and all faces at
    their vertices in `face_vertices` (3, m). The topology stays the same if each patch
    is a disk (connected, Euler number 1) with three faces or more around it, and two
    patches share at most one edge.
    """
    count = len(patch)
    start, end = patch[edge_ends]
    corner = patch[face_vertices]
    next_corner = np.roll(corner, -1, axis=0)
    n_inner_edges = (corner == next_corner).sum(axis=0)
    n_vertices = np.bincount(patch, minlength=count)
    n_edges = np.bincount(start[start == end], minlength=count)
    n_faces = np.bincount(corner[0, n_inner_edges == 3], minlength=count)
    is_bad = n_vertices - n_edges + n_faces != 1

    is_between = n_inner_edges == 0
    between = corner[:, is_between]
    n_around = np.bincount(between.ravel(), minlength=count)
    is_bad |= n_around < MIN_FACES
    # one number per half edge
    numbers = between * count + next_corner[:, is_between]
    ordered = np.sort(numbers.ravel())
    repeated = ordered[1:][np.diff(ordered) == 0]
    for patches in np.divmod(repeated, count):
        is_bad[patches] = True
    return is_bad


def _renumber(patch: Ints, face_vertices: Ints) -> tuple[Ints, Ints]:
    """Number patches from 0 in the order of their first vertices; return the patch (n,)
    of each vertex, and the (m, 3) faces whose vertices are in three patches."""
    is_first = patch == np.arange(len(patch))
    number = np.cumsum(is_first) - 1
    patch = number[patch]
    corner = patch[face_vertices]
    is_between = (corner != np.roll(corner, -1, axis=0)).all(axis=0)
    return patch, corner[:, is_between].T


def _sums(patch: Ints, vectors: Floats, count: int) -> Floats:
    """Return the sum of the (n, 3) vectors of each of `count` patches, from the patch
    (n,) of each."""
    sums = [np.bincount(patch, values, count) for values in vectors.T]
    return np.stack(sums, axis=1)
