"""Small meshes and surfaces whose geometry is known."""

import nibabel as nib
import numpy as np
import trimesh
from nibabel.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage

from gyriflow.geometry.tetrahedra import TetrahedralMesh, grid
from gyriflow.geometry.triangles import TriangleMesh

HALF_AXES = np.array([11.0, 24.0, 16.0])
"""Semi-axes in mm of an ellipsoid as large as a small hemisphere of week 21."""


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


def hemisphere(side: int) -> TriangleMesh:
    """Returns an ellipsoid in place of a hemisphere, on the left (-1) or the right (1) of a gap of 3 mm at x = 0."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    return TriangleMesh(ball.vertices * HALF_AXES + [12.5 * side, 0.0, 0.0], ball.faces)


def save_gifti(path, mesh: TriangleMesh, matrix: np.ndarray | None = None) -> None:
    """Writes a GIFTI surface as it is, whatever is wrong with it, with a coordinate-system matrix if one is given."""
    points = GiftiDataArray(mesh.vertices.astype(np.float32), intent="NIFTI_INTENT_POINTSET")
    if matrix is not None:
        points.coordsys = GiftiCoordSystem("NIFTI_XFORM_UNKNOWN", "NIFTI_XFORM_SCANNER_ANAT", matrix)
    triangles = GiftiDataArray(mesh.faces.astype(np.int32), intent="NIFTI_INTENT_TRIANGLE")
    nib.save(GiftiImage(darrays=[points, triangles]), path)
