"""Nearest places of a surface that moves in each step, for many points, in C."""

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.triangles import Floats, Ints, Mask, TriangleMesh, corners
from .compilation import library_of, pointer

DECLARATION = """
void nearest_candidates(long count, long width, double factor, void *candidates,
                        void *points, void *vertices, void *nearest, void *has_others);
void nearest_places(long count, long leaves, void *boxes, void *triangles,
                    void *corners, void *vertices, void *points, void *squared,
                    void *nearest);
"""
LEAF_SIZE = 8
"""Number of triangles in the smallest boxes."""


class FaceTree:
    """A tree of boxes around the faces of a surface."""

    def __init__(self, surface: TriangleMesh) -> None:
        triangles = corners(surface)
        # this tree halves its points, too, and has these in the order of its leaves
        order = cKDTree(triangles.mean(axis=1), LEAF_SIZE).indices
        ends = np.array([0, len(order)])
        while np.diff(ends).max() > LEAF_SIZE:
            middles = (ends[:-1] + ends[1:]) // 2
            ends = np.insert(
                ends,
                np.arange(1, len(ends)),
                middles,
            )
        # all leaves are full: the last of their triangles is there several times
        places = ends[:-1, None] + np.arange(LEAF_SIZE)
        places = np.minimum(
            places,
            ends[1:, None] - 1,
        )
        faces = order[places]
        by_leaf = triangles[faces]
        self._triangles = np.ascontiguousarray(np.moveaxis(by_leaf, 1, -1))
        by_corner = surface.faces[faces].swapaxes(1, 2)
        self._corners = np.ascontiguousarray(by_corner, dtype=np.int64)
        self._vertices = np.ascontiguousarray(surface.vertices)
        corners_of_leaf = by_leaf.reshape(len(places), -1, 3)
        boxes = np.stack(
            [corners_of_leaf.min(axis=1), corners_of_leaf.max(axis=1)],
            axis=1,
        )
        levels = [boxes]
        while len(boxes) > 1:
            first, second = boxes[::2], boxes[1::2]
            low = np.minimum(
                first[:, 0],
                second[:, 0],
            )
            high = np.maximum(
                first[:, 1],
                second[:, 1],
            )
            boxes = np.stack([low, high], axis=1)
            levels.append(boxes)
        # the first box is number 1
        levels.append(np.zeros((1, 2, 3)))
        self._boxes = np.concatenate(levels[::-1])

    def nearest(self, points: Floats) -> tuple[Floats, Ints]:
        """Return the distances (k,) of (k, 3) points from the surface, and the vertices
        (k,) nearest to them: of equally near ones the first.

        It is fastest where each point is near the one before.
        """
        interface, code = library_of(__file__, DECLARATION)
        points = np.ascontiguousarray(points)
        count = len(points)
        squared = np.empty(count)
        vertices = np.empty(count, dtype=np.int64)
        known = [
            (self._boxes, np.float64),
            (self._triangles, np.float64),
            (self._corners, np.int64),
            (self._vertices, np.float64),
            (points, np.float64),
        ]
        pointers = []
        for array, dtype in known:
            pointers.append(pointer(interface, array, dtype, array.size))
        code.nearest_places(
            count,
            len(self._triangles),
            *pointers,
            pointer(interface, squared, np.float64, count, is_written=True),
            pointer(interface, vertices, np.int64, count, is_written=True),
        )
        return np.sqrt(squared), vertices


def nearest_candidates(
    points: Floats,
    candidates: Ints,
    vertices: Floats,
    tolerance: float,
) -> tuple[Ints, Mask]:
    """Return the nearest (k,) of the (k, c) candidates of (k, 3) points among (n, 3)
    vertices, and whether another vertex is nearly as near.

    Its squared distance is then larger by at most the relative `tolerance`.
    """
    interface, code = library_of(__file__, DECLARATION)
    candidates = np.ascontiguousarray(candidates, dtype=np.int64)
    points = np.ascontiguousarray(points)
    count, width = candidates.shape
    nearest = np.empty(count, dtype=np.int64)
    has_others = np.empty(count, dtype=bool)
    code.nearest_candidates(
        count,
        width,
        1 + tolerance,
        pointer(interface, candidates, np.int64, count * width),
        pointer(interface, points, np.float64, 3 * count),
        pointer(interface, vertices, np.float64, 3),
        pointer(interface, nearest, np.int64, count, is_written=True),
        pointer(interface, has_others, np.bool_, count, is_written=True),
    )
    return nearest, has_others
