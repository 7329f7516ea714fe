"""Quality of a mesh: shape of its elements, how well its surface and narrow gaps are
kept, and limits."""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import igl
import igl.embree
import numpy as np

from ..errors import MeshError
from ..geometry import tetrahedra, triangles
from ..geometry.jacobians import lower_bounds
from ..geometry.matching import faces_that_cross, nearest_on, surface_distance
from ..geometry.tetrahedra import MIN_RADIUS_RATIO, TetrahedralMesh
from ..geometry.triangles import Floats, Ints, Mask, TriangleMesh, dots

QUANTILE = 0.99
GAP_MM = 3.0
"""Walls that face each other within this distance are those of a gap."""
PARALLEL = -0.9
"""Cosine between the normals of walls that face each other; less opposed ones meet at
the bottom of a gap."""
OFF_MM = 1e-4
"""A ray starts so far above its own face."""
STILL_OPEN = 0.5
"""A gap counts as kept where so much of its width is left."""
# in reverse, these are the opposite ones
SIDES_OF_ELEMENT = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
MIN_JACOBIAN_RATIO = 0.1
"""Least accepted Jacobian determinant of a quadratic element over its mean: 1 straight,
0 folded over."""
MIN_GAP_KEPT = 0.95
"""Least accepted part of the fissure and other gaps, by the area of their walls, that
stays open."""


@dataclass(frozen=True, eq=False)
class GapWalls:
    """Faces of a closed surface that face a parallel wall across a narrow gap.

    The (g, 3) `middle` of the gap in mm, the face's `normal` and `area` (mm²), and the
    `width` (g,) to the wall in mm.
    """

    middle: Floats
    normal: Floats
    width: Floats
    area: Floats


def _fidelity(mesh: TriangleMesh, target: TriangleMesh) -> dict[str, float]:
    """Return how far two surfaces are from each other, in mm.

    Within `hausdorff99` lies 99 % of either's area; `hausdorff` is the largest
    distance. Every face is sampled at the centroids of its four parts, and for the
    largest distance at its corners.
    """
    ways = [_distances(mesh, target), _distances(target, mesh)]
    return {
        "hausdorff99": surface_distance(ways, QUANTILE)[1],
        "hausdorff": max(float(distance.max()) for distance, _ in ways),
    }


def _gap_walls(mesh: TriangleMesh) -> GapWalls:
    """Return the walls of narrow gaps of a closed surface: rays from centroids meet
    parallel walls within 3 mm."""
    normals = triangles.face_normals(mesh)
    start = triangles.corners(mesh).mean(axis=1) + OFF_MM * normals
    face, distance = _first_hits(mesh, start, normals)
    facing = face >= 0
    cosines = dots(normals[facing], normals[face[facing]])
    facing[facing] = cosines < PARALLEL
    half = 0.5 * distance[facing, None] * normals[facing]
    return GapWalls(
        start[facing] + half,
        normals[facing],
        OFF_MM + distance[facing],
        triangles.face_areas(mesh)[facing],
    )


def _gap_summary(walls: GapWalls) -> dict[str, float | None]:
    """Return the area of gaps' walls, and below which widths in mm 1 % and half of it
    lies (None without a gap).

    The minimum is not given, since the width is 0 at the bottom of every gap.
    """
    narrow = median = None
    if len(walls.width):
        narrow, median = np.quantile(
            walls.width, [0.01, 0.5], weights=walls.area, method="inverted_cdf"
        ).tolist()
    return {
        "percentile1": narrow,
        "median": median,
        "area_mm2": float(walls.area.sum()),
    }


def _gap_kept(walls: GapWalls, mesh: TriangleMesh) -> float | None:
    """Return the share of the walls' area before which another surface leaves the gap
    open; None without a gap.

    There its middle is outside the closed surface `mesh`, whose gap is at least half as
    wide.
    """
    if not len(walls.width):
        return None
    # a ray finds the wall in front of it and the one behind
    width = np.zeros(len(walls.width))
    for sign in (1.0, -1.0):
        face, distance = _first_hits(mesh, walls.middle, sign * walls.normal)
        width += np.where(face >= 0, distance, GAP_MM)
    winding = igl.fast_winding_number(mesh.vertices, mesh.faces, walls.middle)
    is_open = (winding < 0.5) & (width >= STILL_OPEN * walls.width)
    kept = walls.area[is_open].sum()
    return float(kept / walls.area.sum())


def _first_hits(
    mesh: TriangleMesh,
    start: Floats,
    direction: Floats,
) -> tuple[Ints, Floats]:
    rays = igl.embree.EmbreeIntersector()
    rays.init(
        np.asfortranarray(mesh.vertices, dtype=np.float32),
        np.asfortranarray(mesh.faces, dtype=np.int32),
        True,
    )
    faces = np.empty(len(start), dtype=np.int64)
    distances = np.empty(len(start))
    for i, (origin, towards) in enumerate(
        zip(
            start.astype(np.float32),
            direction.astype(np.float32),
            strict=True,
        )
    ):
        faces[i], distances[i], *_ = rays.intersectRay_first(
            origin, towards, 0.0, GAP_MM
        )
    return faces, distances


def _distances(mesh: TriangleMesh, target: TriangleMesh) -> tuple[Floats, Floats]:
    """Return the distances in mm of the middles of the quarters of faces and of the
    vertices from a surface, and their areas in mm², 0 for vertices."""
    a, b, c = triangles.corners(mesh).transpose(1, 0, 2)
    centroids = [
        (a + b + c) / 3,
        (4 * a + b + c) / 6,
        (a + 4 * b + c) / 6,
        (a + b + 4 * c) / 6,
    ]
    points = np.concatenate([*centroids, mesh.vertices])
    distance, _, _ = nearest_on(points, target)
    quarters = np.tile(triangles.face_areas(mesh) / 4, 4)
    areas = np.concatenate([quarters, np.zeros(len(mesh.vertices))])
    return distance, areas


def jacobian_ratios(mesh: TetrahedralMesh) -> Floats:
    """Return (m,) lower bounds of elements' determinants over the mean: 1 straight, not
    positive if folded."""
    if mesh.order == 1:
        return np.ones(len(mesh.tets))
    mean = 6 * tetrahedra.signed_volumes(mesh)
    return lower_bounds(mesh.vertices, mesh.tets) / mean


def _dihedral_angles(mesh: TetrahedralMesh) -> Floats:
    """Return the (m, 6) angles in degrees between the faces at each edge, taken as flat
    between corners."""
    corner = mesh.vertices[mesh.corners]
    angles = []
    opposite = reversed(SIDES_OF_ELEMENT)
    for (a, b), (c, d) in zip(SIDES_OF_ELEMENT, opposite, strict=True):
        start = corner[:, a]
        edge = corner[:, b] - start
        first = np.cross(edge, corner[:, c] - start)
        second = np.cross(edge, corner[:, d] - start)
        across = np.cross(first, second)
        sine = np.linalg.norm(across, axis=1)
        cosine = dots(first, second)
        angles.append(np.arctan2(sine, cosine))
    return np.degrees(np.stack(angles, axis=1))


def quality_summary(mesh: TetrahedralMesh, surface: TriangleMesh) -> dict[str, Any]:
    """Return counts, extreme and mean qualities, edge lengths and areas of a mesh,
    ready for JSON.

    `surface` is the one that was filled; distance, change of volume and gaps are
    relative to it. Quadratic elements are measured on the triangles
    between nodes. `gap_kept` is None without gaps.
    """
    ratios = tetrahedra.radius_ratios(mesh)
    angles = _dihedral_angles(mesh)
    volumes = tetrahedra.signed_volumes(mesh)
    boundary, _ = tetrahedra.boundary_surface(mesh)
    walls = _gap_walls(surface)
    return {
        "order": mesh.order,
        "tets": len(mesh.tets),
        "vertices": len(mesh.vertices),
        "pial_faces": len(boundary.faces),
        "pial_edge_mm": triangles.mean_edge_length(boundary),
        "pial_area_mm2": triangles.area(boundary),
        "crossing_faces": len(faces_that_cross(boundary)),
        "surface_distance_mm": _fidelity(boundary, surface),
        "gap_mm": {
            "input": _gap_summary(walls),
            "mesh": _gap_summary(_gap_walls(boundary)),
        },
        "gap_kept": _gap_kept(walls, boundary),
        "volume_mm3": float(volumes.sum()),
        "volume_change": float(volumes.sum() / triangles.signed_volume(surface) - 1),
        "min_radius_ratio": float(ratios.min()),
        "median_radius_ratio": float(np.median(ratios)),
        "min_dihedral_deg": float(angles.min()),
        "max_dihedral_deg": float(angles.max()),
        "min_volume_mm3": float(volumes.min()),
        "min_jacobian_ratio": float(jacobian_ratios(mesh).min()),
    }


def refuse_bad_mesh(
    mesh: TetrahedralMesh,
    summary: Mapping[str, Any],
    path: str | PathLike[str] | None = None,
    *,
    min_radius_ratio: float = MIN_RADIUS_RATIO,
    max_surface_distance_mm: float,
    max_volume_change: float = 0.01,
) -> None:
    """Raise MeshError where a mesh with this `quality_summary` passes one of the
    limits, all of them named.

    It has the number of bad elements and the worst place. `path` is where the mesh can
    be looked at.
    """
    found = []
    expected = []
    for name, values, least in (
        ("radius ratio", tetrahedra.radius_ratios(mesh), min_radius_ratio),
        ("ratio of Jacobians", jacobian_ratios(mesh), MIN_JACOBIAN_RATIO),
    ):
        bad = values < least
        if bad.any():
            found.append(_worst_element(mesh, name, values, bad))
            expected.append(f"{name} at least {least:g}")
    change = summary["volume_change"]
    if abs(change) > max_volume_change:
        found.append(
            f"a volume of {summary['volume_mm3']:.0f} mm3, {100 * change:+.1f} %"
            " against the surface's"
        )
        expected.append(f"at most {100 * max_volume_change:g} %")
    distance = summary["surface_distance_mm"]["hausdorff99"]
    if distance > max_surface_distance_mm:
        found.append(
            f"a surface {distance:.3f} mm from the one that was filled (99 % of it is"
            " nearer)"
        )
        expected.append(
            f"at most {max_surface_distance_mm:g} mm (mesh.max_surface_distance_mm)"
        )
    gap_kept = summary["gap_kept"]
    if gap_kept is not None and gap_kept < MIN_GAP_KEPT:
        found.append(
            "narrow gaps, such as the fissure, open along"
            f" {100 * gap_kept:.0f} % of their walls"
        )
        expected.append(f"at least {100 * MIN_GAP_KEPT:g} %")
    if summary["crossing_faces"]:
        found.append(
            f"{summary['crossing_faces']} faces of its surface that cross others"
        )
        expected.append("none that cross")
    if found:
        raise MeshError(
            "the mesh is not good enough",
            path=path,
            found="; ".join(found),
            expected="; ".join(expected),
            remedy=(
                "Mesh with other edge lengths or another mesh.mesher, or raise"
                " mesh.max_surface_distance_mm."
            ),
        )


def _worst_element(
    mesh: TetrahedralMesh,
    name: str,
    values: Floats,
    bad: Mask,
) -> str:
    """Return the number of bad elements by a measure, and the value and place of the
    worst."""
    worst = values.argmin()
    centre = mesh.vertices[mesh.corners[worst]].mean(axis=0)
    return (
        f"{int(bad.sum())} of {len(bad)} elements with {name} to {values[worst]:.4g} at"
        f" {np.round(centre, 1).tolist()} mm"
    )
