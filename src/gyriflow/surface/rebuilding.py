"""A surface rebuilt through a voxel grid, for where repair of the triangles is not enough."""

from typing import Any

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from ..geometry.triangles import TriangleMesh
from .extraction import EDGE_SLOPE, isosurface, make_simple

MARGIN_VOXELS = 6


def rebuild(mesh: TriangleMesh, voxel_mm: float) -> tuple[TriangleMesh, dict[str, Any]]:
    """Returns the surface of the region that `mesh` winds around, without handles or intersections, and a report.

    The generalised winding number (Jacobson et al. 2013, doi 10.1145/2461912.2461916) separates inside from outside
    even where the surface cuts itself. Details below the voxel size are lost.
    """
    first = mesh.vertices.min(axis=0) - MARGIN_VOXELS * voxel_mm
    shape = np.ceil(np.ptp(mesh.vertices, axis=0) / voxel_mm).astype(int) + 2 * MARGIN_VOXELS
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = first
    points = np.indices(shape).reshape(3, -1).T * voxel_mm + first
    # every face lies within a voxel of one of these points
    near, _ = cKDTree(_spread_points(mesh, voxel_mm)).query(points, distance_upper_bound=3.0 * voxel_mm, workers=-1)
    band = np.isfinite(near)
    distance = np.full(len(points), np.inf)
    distance[band] = np.sqrt(igl.point_mesh_squared_distance(points[band], mesh.vertices, mesh.faces)[0])
    wound = np.zeros(len(points), dtype=bool)
    wound[band] = igl.fast_winding_number(mesh.vertices, mesh.faces, points[band]) > 0.5
    inside = _inside_beyond_band(wound.reshape(shape), band.reshape(shape), mesh, affine)
    signed = np.where(inside, distance.reshape(shape), -distance.reshape(shape))
    field = np.clip(0.5 + EDGE_SLOPE * signed / voxel_mm, 0.0, 1.0).astype(np.float32)
    field, report = make_simple(field)
    return isosurface(field, affine), {"remade_with_voxels_mm": voxel_mm} | report


def _spread_points(mesh: TriangleMesh, voxel_mm: float) -> NDArray[np.float64]:
    """Returns points on the surface, so dense that no place on it is further than about a voxel from one."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    longest = np.linalg.norm(np.stack([b - a, c - b, a - c]), axis=-1).max()
    steps = max(int(np.ceil(longest / voxel_mm)), 1)
    weights = np.array([(i, j, steps - i - j) for i in range(steps + 1) for j in range(steps + 1 - i)]) / steps
    return np.unique(np.einsum("wk,kfd->wfd", weights, np.stack([a, b, c])).reshape(-1, 3).round(3), axis=0)


def _inside_beyond_band(
    inside: NDArray[np.bool_], band: NDArray[np.bool_], mesh: TriangleMesh, affine: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Returns the mask filled where no surface is near: each region there is inside or outside as a whole."""
    number, count = ndimage.label(~band)
    one = np.array(ndimage.maximum_position(~band, number, np.arange(1, count + 1)), dtype=float)
    winding = igl.fast_winding_number(mesh.vertices, mesh.faces, one @ affine[:3, :3].T + affine[:3, 3])
    return inside | np.concatenate([[False], winding > 0.5])[number]
