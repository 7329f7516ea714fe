"""The medial wall of a hemisphere as a plane: that of the cut where hemispheres were cut apart, else a fitted one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import unit

Floats = NDArray[np.float64]

# how narrowly the wall is a plane, in sizes of the hemisphere, while it is looked for; narrower bands follow its bends
WIDTHS = (0.10, 0.05)
COSINE = 0.85
# a wall that was cut along a plane: its normals are looked for ever more narrowly, and this part of the area has them
CUT_WIDTHS_DEG, CUT_SHARE = (40.0, 25.0, 15.0, 10.0, 7.0, 4.0, 2.0), 0.04
CUT_DEG, CUT_DEPTH = 1.0, 0.004
# how far the normal may be off, in degrees: of a cut, and of a fitted plane (deformed atlas brains, one in three)
CUT_ERROR_DEG, FITTED_ERROR_DEG = 0.1, 1.5


@dataclass(frozen=True, eq=False)
class MedialWall:
    """The plane normal·p = offset along a medial wall, and by how much its normal may be off.

    Attributes
    ----------
    normal : (3,) float
        Outward unit vector.
    offset : float
        In the unit of the points.
    error_deg : float
        Standard error of the normal about each axis across it.
    """

    normal: Floats
    offset: float
    error_deg: float


def medial_wall(points: Floats, normals: Floats, areas: Floats, start: Floats) -> MedialWall:
    """Returns the plane along the medial wall, which faces about the unit vector `start`.

    `points` and `normals` (n, 3) are relative to the hemisphere's size; `areas` (n,) are those that belong to them.
    """
    facing = normals @ start > COSINE
    points, normals, total, areas = points[facing], normals[facing], areas.sum(), areas[facing]
    normal: NDArray = start
    for width in CUT_WIDTHS_DEG:
        for _ in range(6):
            normal = unit((normals * (areas * _bell(_degrees(normals @ normal) / width))[:, None]).sum(axis=0)[None])[0]
    heights = points @ normal
    offset = float(np.median(heights[np.abs(heights - _densest(heights, areas)) < 0.02]))
    cut = (_degrees(normals @ normal) < CUT_DEG) & (np.abs(heights - offset) < CUT_DEPTH)
    if areas[cut].sum() > CUT_SHARE * total:
        return MedialWall(normal, float(np.median(heights[cut])), CUT_ERROR_DEG)
    normal = start
    offset = _densest(points @ normal, areas)
    for width in WIDTHS:
        for _ in range(5):
            weights = areas * _bell((points @ normal - offset) / (3.0 * width))
            centre = np.average(points, axis=0, weights=weights)
            _, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
            normal = axes[:, 0] * np.sign(axes[:, 0] @ normal)
            offset = float(centre @ normal)
    return MedialWall(normal, offset, FITTED_ERROR_DEG)


def _bell(away: NDArray) -> NDArray:
    """Returns Tukey's biweight: 1 at 0, 0 from ±1 on."""
    return np.where(np.abs(away) < 1.0, (1.0 - away**2) ** 2, 0.0)


def _degrees(cosines: NDArray) -> NDArray:
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))))


def _densest(heights: Floats, areas: Floats) -> float:
    """Returns the height around which the most area lies."""
    counts, edges = np.histogram(heights, bins=np.arange(heights.min(), heights.max() + 0.02, 0.01), weights=areas)
    return float(edges[counts.argmax()] + 0.005)
