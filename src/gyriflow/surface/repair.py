"""Surfaces from files made clean: manifold, closed, outward, without stray pieces; every repair is counted."""

from typing import Any

import igl
import numpy as np

from ..errors import MeshError
from ..geometry.meshlab import pymeshlab
from ..geometry.remeshing import self_intersecting_faces
from ..geometry.triangles import (
    TriangleMesh,
    area_vectors,
    edges,
    face_areas,
    face_components,
    flipped,
    is_closed,
    merged,
    signed_volume,
    submesh,
)

# vertices closer than this are one vertex
SAME_MM = 1e-5
# pieces from this part of the largest area are kept: two hemispheres in one file
COMPARABLE = 0.3


def clean(mesh: TriangleMesh, max_hole_mm: float) -> tuple[TriangleMesh, dict[str, Any]]:
    """Returns the surface as closed, outward, manifold pieces of comparable size, and the count of each repair.

    Equal vertices are joined, degenerate and double faces removed, non-manifold edges opened, holes up to
    `max_hole_mm` across closed, faces turned outward, small pieces and pieces inside others dropped.
    MeshError for larger holes and for surfaces that stay open.
    """
    report: dict[str, Any] = {}
    mesh = _drop_doubles(mesh, report)
    # not before: faces that meet in several copies of a vertex would count
    report["faces_that_cut_others"] = int(self_intersecting_faces(mesh).sum())
    mesh = _make_manifold(mesh, report)
    mesh = _main_pieces(mesh, report)
    mesh = _fill_holes(mesh, max_hole_mm, report)
    mesh = _turn_outward(mesh, report)
    if not is_closed(mesh):
        _, counts = edges(mesh)
        raise MeshError(
            "the surface cannot be closed",
            found=f"{int((counts != 2).sum())} edges without exactly two faces after repair",
            expected="a closed surface",
            remedy="Repair the surface by hand, or make it anew from a label volume.",
        )
    return mesh, report


def pieces(mesh: TriangleMesh) -> list[TriangleMesh]:
    """Returns the connected pieces of a surface, the largest area first."""
    component = face_components(mesh)
    return [submesh(mesh, component == number)[0] for number in range(component.max() + 1)]


def _drop_doubles(mesh: TriangleMesh, report: dict[str, Any]) -> TriangleMesh:
    vertices, _, _, faces = igl.remove_duplicate_vertices(mesh.vertices, mesh.faces, SAME_MM)
    used = len(np.unique(mesh.faces))
    faces = np.asarray(faces, dtype=np.int64)
    flat = (faces[:, [0, 1, 2]] == faces[:, [1, 2, 0]]).any(axis=1)
    faces = faces[~flat]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    report["degenerate_faces_removed"] = int(flat.sum())
    report["double_faces_removed"] = len(faces) - len(first)
    result, kept = submesh(TriangleMesh(vertices, faces[np.sort(first)]), np.ones(len(first), dtype=bool))
    report["duplicate_vertices_joined"] = max(used - len(kept), 0)
    report["zero_area_faces"] = int((face_areas(result) < 1e-10).sum())
    return result


def _make_manifold(mesh: TriangleMesh, report: dict[str, Any]) -> TriangleMesh:
    _, counts = edges(mesh)
    bad = int((counts > 2).sum())
    report["non_manifold_edges_opened"] = bad
    document = pymeshlab.MeshSet(verbose=False)
    document.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    if bad:
        document.meshing_repair_non_manifold_edges(method="Remove Faces")
    measures = document.get_topological_measures()
    report["non_manifold_vertices_split"] = int(measures["non_two_manifold_vertices"])
    if bad or report["non_manifold_vertices_split"]:
        document.meshing_repair_non_manifold_vertices(vertdispratio=0.0)
        current = document.current_mesh()
        mesh = TriangleMesh(current.vertex_matrix(), current.face_matrix())
    faces, _ = igl.bfs_orient(mesh.faces)
    agree = np.einsum("ij,ij->i", area_vectors(mesh), area_vectors(TriangleMesh(mesh.vertices, faces))) >= 0
    report["faces_turned_to_agree"] = int(min((~agree).sum(), agree.sum()))
    return TriangleMesh(mesh.vertices, faces)


def _main_pieces(mesh: TriangleMesh, report: dict[str, Any]) -> TriangleMesh:
    found = pieces(mesh)
    areas = [float(face_areas(piece).sum()) for piece in found]
    kept = [found[0]]
    for piece, size in zip(found[1:], areas[1:], strict=True):
        inside = np.median(np.abs(igl.fast_winding_number(found[0].vertices, found[0].faces, piece.vertices))) > 0.5
        if size >= COMPARABLE * areas[0] and not inside:
            kept.append(piece)
    report["pieces"] = len(kept)
    report["pieces_dropped"] = len(found) - len(kept)
    report["area_dropped_mm2"] = sum(areas) - sum(float(face_areas(piece).sum()) for piece in kept)
    return merged(*kept)


def _fill_holes(mesh: TriangleMesh, max_hole_mm: float, report: dict[str, Any]) -> TriangleMesh:
    """Returns the surface with a fan over each hole up to `max_hole_mm` across."""
    loops = [np.asarray(loop) for loop in igl.boundary_loop_all(mesh.faces)]
    sizes = [float(np.ptp(mesh.vertices[loop], axis=0).max()) for loop in loops]
    report["holes_closed"] = len(loops)
    report["largest_hole_mm"] = max(sizes, default=0.0)
    if sizes and max(sizes) > max_hole_mm:
        wide = sorted((size for size in sizes if size > max_hole_mm), reverse=True)
        raise MeshError(
            "the surface has holes that are too large to close",
            found=f"{len(wide)} of {len(loops)} holes, up to {wide[0]:.1f} mm across",
            expected=f"at most {max_hole_mm:g} mm (max_hole_mm)",
            remedy="Give a closed surface, or raise max_hole_mm if the opening may be covered.",
        )
    vertices, faces = [mesh.vertices], [mesh.faces]
    directed = {tuple(pair) for pair in mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}
    for number, loop in enumerate(loops):
        centre = np.full(len(loop), len(mesh.vertices) + number)
        start, end = loop, np.roll(loop, -1)
        # the fan runs along the loop against the faces that are there
        along = (int(start[0]), int(end[0])) in directed
        faces.append(np.stack([end, start, centre] if along else [start, end, centre], axis=1))
        vertices.append(mesh.vertices[loop].mean(axis=0, keepdims=True))
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))


def _turn_outward(mesh: TriangleMesh, report: dict[str, Any]) -> TriangleMesh:
    found = pieces(mesh)
    inward = [signed_volume(piece) < 0 for piece in found]
    report["pieces_turned_outward"] = int(sum(inward))
    return merged(*(flipped(piece) if turn else piece for piece, turn in zip(found, inward, strict=True)))
