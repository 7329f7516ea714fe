"""Small tetrahedral meshes whose geometry is known."""

import numpy as np

from gyriflow.geometry.tetrahedra import TetrahedralMesh

KUHN = ((0, 4, 6, 7), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7), (0, 1, 5, 7), (0, 5, 4, 7))


def box_mesh(cells: tuple[int, int, int], size: tuple[float, float, float]) -> TetrahedralMesh:
    """Returns a box around the origin, in mm, with six elements per grid cell."""
    counts = np.array(cells) + 1
    ticks = [np.linspace(-s / 2, s / 2, n) for s, n in zip(size, counts, strict=True)]
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), -1)
    number = np.arange(counts.prod()).reshape(counts)
    corner = [
        number[i : counts[0] - 1 + i, j : counts[1] - 1 + j, k : counts[2] - 1 + k].ravel()
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    tets = np.concatenate([np.stack([corner[c] for c in tet], axis=1) for tet in KUHN])
    return TetrahedralMesh(points.reshape(-1, 3), tets)


def ellipsoid_mesh(cells: int, semi_axes: tuple[float, float, float]) -> TetrahedralMesh:
    """Returns an ellipsoid around the origin, in mm: a cube's grid with its shells drawn out to ellipsoids."""
    cube = box_mesh((cells,) * 3, (2.0, 2.0, 2.0))
    x = cube.vertices
    shell = np.abs(x).max(axis=1, keepdims=True)
    length = np.linalg.norm(x, axis=1, keepdims=True)
    # halfway between cube and ball inside, the ball itself at the surface
    round_ = np.where(length > 0, x / np.where(length > 0, length, 1) * shell, 0.0)
    points = shell * round_ + (1 - shell) * x
    return TetrahedralMesh(points * np.array(semi_axes), cube.tets)
