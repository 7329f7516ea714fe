"""Outlines of hemispheres: their surfaces with the sulci closed, free of size and place, and one that is made here."""

from dataclasses import dataclass
from functools import cache

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from ..geometry.triangles import TriangleMesh, corners, vertex_areas, vertex_normals
from .extraction import isosurface

Floats = NDArray[np.float64]

# all lengths of an outline are relative to the cube root of the volume
VOXEL = 0.05
# sulci narrower than twice this are closed: folding then makes little difference to the outline
CLOSING = 0.12
SAMPLES = 1500
# the reference: half lengths of a cerebrum from left to right, from front to back and in height
HALF_LENGTHS = (0.75, 1.0, 0.77)
REFERENCE_VOXEL = 0.04


@dataclass(frozen=True, eq=False)
class Outline:
    """A hemisphere's outline.

    Attributes
    ----------
    points, normals : (n, 3) float
        Places on the outline relative to the hemisphere's centre of volume and in its size, and outward unit normals.
    sample : (k,) int
        Some of them, chosen at random in proportion to area.
    centre : (3,) float
        The centre of volume in mm.
    size_mm : float
        The cube root of the volume.
    """

    points: Floats
    normals: Floats
    sample: NDArray[np.int64]
    centre: Floats
    size_mm: float


def outline(mesh: TriangleMesh) -> Outline:
    """Returns the outline of a closed, outward surface: the morphological closing of its inside, slightly smoothed."""
    triple = corners(mesh)
    parts = np.einsum("ij,ij->i", triple[:, 0], np.cross(triple[:, 1], triple[:, 2])) / 6.0
    centre = (parts[:, None] * 0.75 * triple.mean(axis=1)).sum(axis=0) / parts.sum()
    size = float(parts.sum() ** (1 / 3))
    vertices = (mesh.vertices - centre) / size
    pad = CLOSING + 3 * VOXEL
    first = vertices.min(axis=0) - pad
    shape = np.ceil((vertices.max(axis=0) + pad - first) / VOXEL).astype(int)
    places = first + VOXEL * np.indices(shape).reshape(3, -1).T
    inside = igl.fast_winding_number(vertices, mesh.faces, places).reshape(shape) > 0.5
    near = distance_transform_edt(~inside) * VOXEL <= CLOSING
    depth = (distance_transform_edt(near) * VOXEL - CLOSING) / VOXEL
    field = gaussian_filter(np.clip(0.5 + depth, 0.0, 1.0).astype(np.float32), 1.0)
    affine = np.diag([VOXEL] * 3 + [1.0])
    affine[:3, 3] = first
    closed = isosurface(field, affine)
    weights = vertex_areas(closed)
    sample = np.random.default_rng(0).choice(len(weights), SAMPLES, p=weights / weights.sum())
    return Outline(closed.vertices, vertex_normals(closed), sample, centre, size)


@cache
def reference() -> Outline:
    """Returns the outline of a right hemisphere in RAS+ that is no one's: half of the `reference_brain`."""
    depth, x, affine = _reference_depth(-0.2)
    return _outline_of(np.minimum(depth, x), affine)


@cache
def reference_brain() -> Outline:
    """Returns the outline of a cerebrum in RAS+ that is no one's.

    An ellipsoid with the proportions of a cerebrum, with temporal lobes, narrower frontal lobes, an underside that is
    higher in front, and Sylvian dents. Its long axis is within a few degrees of y: that defines the pitch.
    """
    depth, _, affine = _reference_depth(-1.2)
    return _outline_of(depth, affine)


def _outline_of(depth: Floats, affine: Floats) -> Outline:
    field = np.clip(0.5 + depth / REFERENCE_VOXEL, 0.0, 1.0).astype(np.float32)
    return outline(isosurface(field, affine))


def _reference_depth(first_x: float) -> tuple[Floats, Floats, Floats]:
    """Returns the depth below the reference's surface on a grid from `first_x` to the right, its x, and its affine."""
    axes = [np.arange(start, 1.2, REFERENCE_VOXEL) for start in (first_x, -1.2, -1.2)]
    x, y, z = np.meshgrid(*axes, indexing="ij")
    p, q, r = (along / half for along, half in zip((np.abs(x), y, z), HALF_LENGTHS, strict=True))
    radius = np.sqrt(p**2 + q**2 + r**2) + 1e-6
    u, v, w = p / radius, q / radius, r / radius

    def bump(centre: tuple[float, float, float], width: float) -> Floats:
        at = np.array(centre) / np.linalg.norm(centre)
        return np.asarray(np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2 + (w - at[2]) ** 2) / (2 * width**2)))

    dome = 1.0 + 0.16 * bump((0.72, 0.22, -0.66), 0.30) - 0.05 * np.maximum(v, 0.0) ** 2
    underside = (0.68 - 0.16 / (1.0 + np.exp((0.42 - v) / 0.05))) / np.maximum(-w, 1e-3)
    sylvian = np.maximum(bump((0.86, 0.42, -0.30), 0.17), 0.95 * bump((0.95, 0.20, -0.20), 0.15))
    edge = -0.03 * np.logaddexp(-dome / 0.03, -underside / 0.03) - 0.15 * sylvian
    affine = np.diag([REFERENCE_VOXEL] * 3 + [1.0])
    affine[:3, 3] = [along[0] for along in axes]
    return (edge - radius) * np.sqrt(x**2 + y**2 + z**2) / radius, x, affine
