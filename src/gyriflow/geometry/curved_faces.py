"""Curved faces of quadratic elements as finer flat triangles, whose vertices follow the nodes."""

import numpy as np
from scipy import sparse

from .triangles import Floats, Ints

PARTS = 4
"""Pieces of each edge of a face: two between neighbouring nodes."""
LATTICE = np.array([(i, j, PARTS - i - j) for i in range(PARTS + 1) for j in range(PARTS + 1 - i)])
"""Vertices of the triangles within a face: barycentric coordinates in `PARTS`."""


def _lattice_triangles() -> Ints:
    """Returns the (16, 3) triangles of the lattice, all turned alike."""
    points = [(int(i), int(j), int(k)) for i, j, k in LATTICE]
    number = {point: i for i, point in enumerate(points)}
    triangles = []
    for i, j, k in points:
        if k > 0:
            triangles.append((number[i, j, k], number[i + 1, j, k - 1], number[i, j + 1, k - 1]))
        if k > 0 and i > 0:
            triangles.append((number[i, j, k], number[i, j + 1, k - 1], number[i - 1, j + 1, k]))
    return np.array(triangles, dtype=np.int64)


def _node_weights() -> Floats:
    """Returns the (15, 6) weights of a face's corners a, b, c and nodes ab, bc, ca at the vertices of the lattice."""
    a, b, c = (LATTICE / PARTS).T
    return np.stack([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a], axis=1)


def finer_surface(triangles: Ints) -> tuple[sparse.csr_array, Ints]:
    """Returns a finer surface of curved faces: weights (t, n) of the nodes at its vertices, and its (16 f, 3) faces.

    Its first n vertices are the nodes.

    Parameters
    ----------
    triangles : (4 f, 3) int
        The triangles between the nodes, each face's four as `tetrahedra.boundary_faces` has them; nodes 0 to n − 1.
    """
    split = triangles.reshape(-1, 4, 3)
    nodes = np.concatenate([split[:, [0, 1, 2], [0, 1, 2]], split[:, 3]], axis=1)
    weights = np.broadcast_to(_node_weights(), (len(nodes), len(LATTICE), 6)).reshape(-1, 6)
    names = np.repeat(nodes, len(LATTICE), axis=0)
    # a vertex is the same for all faces that have it: by the nodes that it follows, and how much
    parts = np.rint(weights * 2 * PARTS).astype(np.int64)
    names = np.where(parts == 0, -1, names)
    order = np.argsort(names, axis=1, kind="stable")
    keys = np.concatenate([np.take_along_axis(names, order, 1), np.take_along_axis(parts, order, 1)], axis=1)
    at_node = (parts == 2 * PARTS).sum(axis=1) * ((parts != 0).sum(axis=1) == 1) > 0
    count = int(triangles.max()) + 1
    number = np.empty(len(keys), dtype=np.int64)
    number[at_node] = names[at_node].max(axis=1)
    _, first, place = np.unique(keys[~at_node], axis=0, return_index=True, return_inverse=True)
    number[~at_node] = count + place.ravel()
    between = np.flatnonzero(~at_node)[first]
    rows = np.repeat(np.arange(count, count + len(between)), 6)
    entries = (
        np.concatenate([np.ones(count), weights[between].ravel()]),
        (
            np.concatenate([np.arange(count), rows]),
            np.concatenate([np.arange(count), np.maximum(names[between], 0).ravel()]),
        ),
    )
    matrix = sparse.csr_array(sparse.coo_array(entries, shape=(count + len(between), count)))
    faces = number.reshape(-1, len(LATTICE))[:, _lattice_triangles()].reshape(-1, 3)
    return matrix, faces
