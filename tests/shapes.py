"""Small tetrahedral meshes whose geometry is known."""

import numpy as np

from gyriflow.geometry.tetrahedra import TetrahedralMesh, grid


def box_mesh(cells: tuple[int, int, int], size: tuple[float, float, float]) -> TetrahedralMesh:
    """Returns a box around the origin, in mm, with six elements per grid cell."""
    return grid([np.linspace(-s / 2, s / 2, n + 1) for s, n in zip(size, cells, strict=True)])


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
