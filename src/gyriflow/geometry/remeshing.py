"""Remeshing of surfaces with even triangles, and removal of self-intersections, by
MeshLab's filters."""

import igl
import numpy as np
import pymeshlab
from scipy.spatial import cKDTree

from .triangles import Floats, Mask, TriangleMesh, corners, submesh

MIN_ROUNDS, FINE_ROUNDS, MAX_ROUNDS = 2, 5, 10
"""Rounds of remeshing: fewest, of a fine surface or a cap, and most."""
FINE_SHARE = 0.5
"""A surface is fine if its median edge is below this share of the wanted length."""
UNTANGLING_ROUNDS = 10
# MeshLab's default
SHARP_DEG = 30.0
EVEN_LENGTHS, EVEN_SHARE = (4 / 5, 4 / 3), 0.75
"""Multiples of the wanted length between which remeshing leaves an edge as it is, and
the share of such edges from which a surface counts as even. Remeshing leaves 0.8 to
0.9, and 0.65 in the narrow sulci of late brains."""
EVENNESS = 0.1
"""Weight of even triangles against distance in decimation. By MeshLab's default of
0.001 triangles are long across folds, and spectra of copies have too much power in
short waves: `benchmarks/spectra.py --evenness` compares."""


def self_intersecting_faces(mesh: TriangleMesh, among: Mask | None = None) -> Mask:
    """Return the (m,) mask of faces that cut others; unlike in `faces_that_cross`,
    contacts do not count.

    With `among` (m,), only faces that cut one of these are searched, in a shorter time
    if these are few.
    """
    if among is None or among.all():
        document = in_meshlab(mesh)
        document.compute_selection_by_self_intersections_per_face()
        return np.asarray(
            document.current_mesh().face_selection_array(),
            dtype=bool,
        )
    places = corners(mesh)
    centres = places.mean(axis=1)
    radius = np.linalg.norm(places - centres[:, None], axis=2).max(axis=1)
    reach = radius + radius[among].max()
    distance, _ = cKDTree(centres[among]).query(
        centres, distance_upper_bound=reach.max()
    )
    near = distance <= reach
    crossing = np.zeros(len(near), dtype=bool)
    crossing[near] = self_intersecting_faces(submesh(mesh, near)[0])
    return crossing


def made_even(mesh: TriangleMesh, edge_length_mm: float) -> TriangleMesh:
    """Return the surface with even triangles of an edge length (mm): remeshed, unless
    it is even, as surfaces from labels are."""
    lengths = _relative_lengths(mesh, edge_length_mm)
    shortest, longest = EVEN_LENGTHS
    is_kept = (lengths > shortest) & (lengths < longest)
    return mesh if is_kept.mean() >= EVEN_SHARE else remesh(mesh, edge_length_mm)


def remesh(
    mesh: TriangleMesh,
    edge_length_mm: float,
    rounds: int | None = None,
    sharp_deg: float = SHARP_DEG,
) -> TriangleMesh:
    """Return the surface with even triangles of an edge length (mm); edges sharper than
    `sharp_deg` are kept.

    `rounds` are as many as the longest edge needs, if they are not given.
    """
    if rounds is None:
        rounds = _rounds_for(mesh, edge_length_mm)
    document = in_meshlab(mesh)
    length = pymeshlab.PureValue(edge_length_mm)
    # MeshLab remembers `selectedonly` of an earlier call
    document.meshing_isotropic_explicit_remeshing(
        iterations=rounds,
        targetlen=length,
        featuredeg=sharp_deg,
        checksurfdist=False,
        selectedonly=False,
    )
    return from_meshlab(document)


def is_fine(mesh: TriangleMesh, edge_length_mm: float) -> bool:
    """Return whether a surface's edges are much shorter than a length (mm)."""
    return _are_short(_relative_lengths(mesh, edge_length_mm))


def _rounds_for(mesh: TriangleMesh, edge_length_mm: float) -> int:
    """Return how many rounds of remeshing a surface needs."""
    lengths = _relative_lengths(mesh, edge_length_mm)
    least = FINE_ROUNDS if _are_short(lengths) else MIN_ROUNDS
    _, longest_kept = EVEN_LENGTHS
    too_long = max(lengths.max() / longest_kept, 1.0)
    # each round halves the edges that are too long
    n_halvings = int(np.ceil(np.log2(too_long)))
    return min(max(n_halvings + 1, least), MAX_ROUNDS)


def _are_short(lengths: Floats) -> bool:
    return bool(np.median(lengths) < FINE_SHARE)


def _relative_lengths(mesh: TriangleMesh, edge_length_mm: float) -> Floats:
    """Return the (m, 3) lengths of the faces' edges as multiples of a length (mm)."""
    return np.asarray(igl.edge_lengths(mesh.vertices, mesh.faces)) / edge_length_mm


def decimate(mesh: TriangleMesh, vertices: int) -> TriangleMesh:
    """Return the surface with about so many vertices, by quadric edge collapse; its
    topology and boundary are kept."""
    document = in_meshlab(mesh)
    document.meshing_decimation_quadric_edge_collapse(
        targetfacenum=2 * vertices,
        qualitythr=1.0,
        planarquadric=True,
        planarweight=EVENNESS,
        preservenormal=True,
        preserveboundary=True,
        preservetopology=True,
    )
    return from_meshlab(document)


def untangle(mesh: TriangleMesh) -> tuple[TriangleMesh, int, int]:
    """Remove self-intersections by Laplacian smoothing of the faces concerned, ever
    wider, in the same topology.

    Also return the number of self-intersecting faces before, and of those that remain.
    """
    counts = []
    for round_ in range(UNTANGLING_ROUNDS + 1):
        document = in_meshlab(mesh)
        document.compute_selection_by_self_intersections_per_face()
        counts.append(int(document.current_mesh().face_selection_array().sum()))
        if not counts[-1] or round_ == UNTANGLING_ROUNDS:
            break
        for _ in range(1 + round_ // 2):
            document.apply_selection_dilatation()
        document.compute_selection_transfer_face_to_vertex()
        document.apply_coord_laplacian_smoothing(
            stepsmoothnum=2,
            cotangentweight=False,
            selected=True,
        )
        mesh = from_meshlab(document)
    return mesh, counts[0], counts[-1]


def in_meshlab(mesh: TriangleMesh) -> pymeshlab.MeshSet:
    """Return a MeshLab document with the surface."""
    document = pymeshlab.MeshSet(verbose=False)
    document.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    return document


def from_meshlab(document: pymeshlab.MeshSet) -> TriangleMesh:
    """Return the current surface of a MeshLab document."""
    mesh = document.current_mesh()
    return TriangleMesh(mesh.vertex_matrix(), mesh.face_matrix())
