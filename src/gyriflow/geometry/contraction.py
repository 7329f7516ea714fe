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
    vertex_normals,
)

# grids of cells that divide a surface into patches: each is finer than the one before,
# and shifted, so that its cells meet elsewhere
N_GRIDS, FINER, SHIFT = 12, 0.6, 0.37
# cells along an axis of a grid
MAX_CELLS = 2**16
# a patch is flat enough if the mean of its unit normals is as long
MIN_MEAN_NORMAL = 0.75


def contracted(mesh: TriangleMesh, size_mm: float) -> TriangleMesh:
    """Return a closed surface with one vertex for each patch of at most `size_mm` of
    the given one.

    Each vertex is in the middle of its patch, on the plane that touches the surface
    there. Bent patches are smaller, as those at the edge of a narrow sulcus.
    """
    patch, faces = _patches(mesh, size_mm)
    sizes = np.bincount(patch)
    centres = _sums(patch, mesh.vertices) / sizes[:, None]
    distances = np.linalg.norm(mesh.vertices - centres[patch], axis=1)
    by_patch = np.lexsort((distances, patch))
    middle = by_patch[np.cumsum(sizes) - sizes]
    # the centre of a curved patch is inside the curve
    normals = vertex_normals(mesh)[middle]
    heights = dots(mesh.vertices[middle] - centres, normals)
    return TriangleMesh(centres + heights[:, None] * normals, faces)


def _patches(mesh: TriangleMesh, size_mm: float) -> tuple[Ints, Ints]:
    """Return the patch (n,) of each vertex of a closed surface, and the (m, 3) faces
    between patches, which have the surface's topology.

    A patch is a connected part of the surface in a cell of a grid. One that is bent, or
    would change the topology, is divided by the next grid.
    """
    n_vertices = len(mesh.vertices)
    ends = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=-1)
    pairs = ends.reshape(-1, 2)
    # each edge once
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    normals = vertex_normals(mesh)
    places = mesh.vertices - mesh.vertices.min(axis=0)
    cell = np.zeros(n_vertices, dtype=np.int64)
    is_divided = np.ones(n_vertices, dtype=bool)
    for grid in range(N_GRIDS):
        place = np.floor(places[is_divided] / size_mm + SHIFT * grid)
        number = place @ [MAX_CELLS**2, MAX_CELLS, 1]
        cell[is_divided] = number + grid * MAX_CELLS**3
        size_mm *= FINER

        first, second = cell[pairs].T
        inner_edges = pairs[first == second]
        patch = connected(inner_edges, n_vertices).astype(np.int64)
        faces, is_bad = _faces_between(mesh.faces, patch, inner_edges)
        lengths = np.linalg.norm(_sums(patch, normals), axis=1)
        is_bad |= lengths < MIN_MEAN_NORMAL * np.bincount(patch)
        if not is_bad.any():
            return patch, faces
        is_divided = is_bad[patch]
    return np.arange(n_vertices), mesh.faces


def _faces_between(faces: Ints, patch: Ints, inner_edges: Ints) -> tuple[Ints, Mask]:
    """Return the faces between patches, and the mask of the patches that would change
    the topology.

    `inner_edges` (k, 2) are those within patches. The topology stays if each patch is
    connected and has no hole, so that its Euler number is 1, and no two patches meet
    twice.
    """
    n_patches = int(patch.max()) + 1
    corners = patch[faces]
    n_inner_edges = (corners == np.roll(corners, -1, axis=1)).sum(axis=1)
    inner_faces = corners[n_inner_edges == 3, 0]
    vertices_of = np.bincount(patch)
    edges_of = np.bincount(patch[inner_edges[:, 0]], minlength=n_patches)
    faces_of = np.bincount(inner_faces, minlength=n_patches)
    is_bad = vertices_of - edges_of + faces_of != 1

    between = corners[n_inner_edges == 0]
    half_edges = between * n_patches + np.roll(between, -1, axis=1)
    ordered = np.sort(half_edges.ravel())
    repeated = ordered[1:][np.diff(ordered) == 0]
    for patches in np.divmod(repeated, n_patches):
        is_bad[patches] = True
    return between, is_bad


def _sums(patch: Ints, vectors: Floats) -> Floats:
    """Return the sum of the (n, 3) vectors of each patch, from the patch (n,) of
    each."""
    return np.stack([np.bincount(patch, values) for values in vectors.T], axis=1)
