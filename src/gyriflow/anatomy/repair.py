"""Repair surfaces: clean them, remove stalks, remesh, restore the volume, or rebuild
them; every repair is counted."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse

from ..errors import MeshError
from ..geometry import remeshing, triangles
from ..geometry.contraction import contract
from ..geometry.deformations import transform_points, voxel_index
from ..geometry.matching import nearest_on, surface_mask
from ..geometry.triangles import Ints, TriangleMesh
from ..units import ML_PER_MM3
from .extraction import COMPARABLE as COMPARABLE_PARTS
from .extraction import (
    EDGE_SLOPE,
    LEVEL,
    Floats,
    Mask,
    dilated,
    isosurface,
    make_simple,
    without_stalks,
)
from .fissure import sample
from .labels import REPORTED_LOSS
from .terraces import without_terraces

log = logging.getLogger(__name__)

# vertices closer than this are merged
MERGE_MM = 1e-5
# pieces with at least this share of the largest area are kept: two hemispheres in one
# file
COMPARABLE = 0.3
# range of lengths of brains and hemispheres
MIN_LENGTH_MM, MAX_LENGTH_MM = 15.0, 300.0
# an edge longer than this, and than this multiple of the median, suggests a vertex far
# off the surface
SPIKE_MM, SPIKE_FACTOR = 10.0, 10.0
# voxel size of the search for stalks
STALK_VOXEL_MM = 0.8
# largest hole of a given surface that is closed, but for open medial walls
MAX_HOLE_MM = 3.0
# cuts follow the triangles, so they are wider than the stalks
MAX_CUT_MM = 12.0
# margin around a surface that is rebuilt, with that of `surface_mask`
MARGIN_VOXELS = 2
# a warning is given if closing handles adds more than this
MAX_FILLED_MM3 = 100.0
# a larger relative change of volume by smoothing gives a warning
VOLUME_TOL = 0.01
# with a larger loss, smoothing has removed structures, and moving the whole surface
# cannot restore them
MAX_RESTORED = 0.05
# Taubin smoothing: λ and μ
SMOOTHING_ITERATIONS = 10
TAUBIN_STEPS = (0.5, -0.53)
ROUNDS = 2
# rounds that reset crossing walls, and the rings of neighbours that are reset with them
# after smoothing
N_RESETS, N_RESET_RINGS = 4, 3
# size of the patches that are contracted, as a share of the wanted edge length
PATCH_SHARE = 0.7
# walls where the field before an opening was above this are walls of the opening
INSIDE_LEVEL = 0.8


@dataclass(frozen=True, eq=False)
class RepairedSurface:
    """A surface after repairs, a plain report, warnings, and the (m,) mask of medial
    caps, empty for labels."""

    mesh: TriangleMesh
    report: dict[str, Any]
    warnings: list[str]
    is_cap: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))


def sound_pieces(
    mesh: TriangleMesh,
    *,
    single: bool = False,
    caps_walls: bool = False,
) -> RepairedSurface:
    """Clean a surface of one or two pieces (only the largest with `single`) and remove
    parts on stalks.

    With `caps_walls`, one larger hole of each hemisphere is capped; after posing it
    must face the other one.
    """
    lengths = np.linalg.norm(
        np.diff(
            mesh.vertices[triangles.edges(mesh)[0]],
            axis=1,
        ),
        axis=2,
    )
    mesh, repairs, is_cap = clean(mesh, single=single, caps_walls=caps_walls)
    warnings, dropped, remaining = [], repairs["area_dropped_mm2"], triangles.area(mesh)
    if lengths.max() > max(
        SPIKE_MM,
        SPIKE_FACTOR * np.median(lengths),
    ):
        warnings.append(
            f"an edge is {lengths.max():.0f} mm long: is a vertex far off the surface?"
        )
    if dropped > REPORTED_LOSS * remaining:
        count = repairs["pieces_dropped"]
        pieces_words = "a piece" if count == 1 else f"{count} pieces"
        warnings.append(
            f"{pieces_words} outside or inside the brain"
            f" {'was' if count == 1 else 'were'} dropped:"
            f" {100 * dropped / (remaining + dropped):.1f} % of the area"
        )
    warnings += [
        f"a hemisphere is open at its medial wall, {width:.0f} mm across: it was closed"
        " by a cap, which does not count in area, curvature and depth"
        for width in repairs["medial_walls_capped_mm"]
    ]
    whole = mesh
    mesh, stalks = _surface_without_stalks(mesh)
    if stalks:
        is_cap = is_cap[
            nearest_on(
                triangles.corners(mesh).mean(axis=1),
                whole,
            )[1]
        ]
    warnings += [
        f"a part of {stalk['volume_mm3']:.0f} mm³ on a stalk of"
        f" {stalk['stalk_mm2']:.0f} mm² was cut off"
        for stalk in stalks
    ]
    return RepairedSurface(
        mesh,
        {"repair": repairs} | ({"stalks": stalks} if stalks else {}),
        warnings,
        is_cap,
    )


def make_sound(mesh: TriangleMesh, edge_length_mm: float) -> RepairedSurface:
    """Smooth and remesh a surface so that each piece is a sphere without
    self-intersections.

    Else it is rebuilt through voxels ("remade" in the report). MeshError if
    self-intersections remain.
    """
    smooth, cutting, n_crossing = _make_even(mesh, edge_length_mm)
    report: dict[str, Any] = {"self_intersections": cutting}
    if not (remaining := faults(smooth, n_crossing)):
        return RepairedSurface(smooth, report, [])
    mesh, report["remade"] = _rebuild(mesh, 0.5 * edge_length_mm)
    smooth, _, n_crossing = _make_even(mesh, edge_length_mm)
    require_sound(smooth, n_crossing)
    return RepairedSurface(
        smooth,
        report,
        [f"the surface was rebuilt through voxels, since it had {remaining}"],
    )


def make_pieces_sound(clean: RepairedSurface, edge_length_mm: float) -> RepairedSurface:
    """Make each piece of a clean surface sound by itself, since hemispheres may share
    their medial wall."""
    component, report = triangles.face_components(clean.mesh), dict[str, Any]()
    parts, caps = list[RepairedSurface](), list[Mask]()
    for number, piece in enumerate(pieces(clean.mesh)):
        even = make_sound(piece, edge_length_mm)
        report |= {
            f"{key}_{number + 1}" if number else key: value
            for key, value in even.report.items()
        }
        nearest = nearest_on(
            triangles.corners(even.mesh).mean(axis=1),
            piece,
        )[1]
        is_cap = clean.is_cap[component == number][nearest]
        # the pial surface around a cap is in one piece
        is_cap[~is_cap] = (
            triangles.face_components(triangles.submesh(even.mesh, ~is_cap)[0]) > 0
        )
        parts, caps = [*parts, even], [*caps, is_cap]
    warnings = [warning for part in parts for warning in part.warnings]
    return RepairedSurface(
        triangles.merged(*(part.mesh for part in parts)),
        report,
        warnings,
        np.concatenate(caps),
    )


def require_sound(mesh: TriangleMesh, n_crossing: int | None = None) -> None:
    """Raise MeshError if the surface is not made of closed spheres without
    self-intersections; their number is counted where it is not known."""
    if problems := faults(mesh, n_crossing):
        raise MeshError(
            "the surface could not be repaired",
            found=problems,
            expected="closed pieces of Euler number 2 without self-intersections",
            remedy=(
                "An Euler number of 0 is a handle or a tunnel. Look where the surface"
                " crosses itself or has vertices far off, mend its segmentation there,"
                " and export it again."
            ),
        )


def faults(mesh: TriangleMesh, n_crossing: int | None = None) -> str:
    """Return the faults of a surface that should be closed spheres without
    self-intersections; empty if none."""
    euler = [triangles.euler_number(piece) for piece in pieces(mesh)]
    crossing = n_crossing
    if crossing is None:
        crossing = int(remeshing.self_intersecting_faces(mesh).sum())
    problems = [
        "edges without two faces" if not triangles.is_closed(mesh) else "",
        f"Euler numbers {euler}" if any(number != 2 for number in euler) else "",
        f"{crossing} self-intersecting faces" if crossing else "",
    ]
    return ", ".join(fault for fault in problems if fault)


def taubin_smoothed(mesh: TriangleMesh) -> TriangleMesh:
    """Return a closed surface smoothed without shrinking (Taubin 1995): vertices move
    towards the mean of their neighbours, and away from it, in turn."""
    adjacency = sparse.csr_matrix(
        igl.adjacency_matrix(mesh.faces),
        dtype=float,
    )
    n_neighbours = adjacency.sum(axis=1)
    places = mesh.vertices
    for _ in range(SMOOTHING_ITERATIONS):
        for step in TAUBIN_STEPS:
            means = (adjacency @ places) / n_neighbours
            places = places + step * (means - places)
    return TriangleMesh(places, mesh.faces)


def _make_even(
    mesh: TriangleMesh, edge_length_mm: float
) -> tuple[TriangleMesh, int, int]:
    """Smooth, remesh and untangle a surface; also count crossing faces before, and
    those that remain.

    A surface with much shorter edges, as of a refined volume, is contracted first,
    which is faster. Walls of a narrow slit that keep crossing are not smoothed.
    """
    smooth = taubin_smoothed(mesh)
    few = smooth
    if remeshing.is_fine(smooth, edge_length_mm):
        few = contract(smooth, PATCH_SHARE * edge_length_mm)
    even, crossing, remaining = remeshing.untangle(
        remeshing.remesh(few, edge_length_mm)
    )
    if remaining:
        even, _, remaining = remeshing.untangle(
            remeshing.remesh(_without_crossings(mesh, smooth), edge_length_mm)
        )
    return even, crossing, remaining


def _without_crossings(mesh: TriangleMesh, smooth: TriangleMesh) -> TriangleMesh:
    """Reset self-intersecting faces of a smoothed surface, and some rings around them,
    to their original places."""
    for _ in range(N_RESETS):
        reset = remeshing.self_intersecting_faces(smooth)
        if not reset.any():
            break
        for _ in range(N_RESET_RINGS):
            reset[:] = np.isin(mesh.faces, mesh.faces[reset]).any(axis=1)
        places = smooth.vertices.copy()
        places[mesh.faces[reset]] = mesh.vertices[mesh.faces[reset]]
        smooth = TriangleMesh(places, mesh.faces)
    return smooth


def clean(
    mesh: TriangleMesh,
    max_hole_mm: float = MAX_HOLE_MM,
    *,
    single: bool = False,
    caps_walls: bool = False,
) -> tuple[TriangleMesh, dict[str, Any], Mask]:
    """Return the surface as closed, outward, manifold pieces of similar size, counts of
    repairs, and the mask of caps.

    Equal vertices are merged, degenerate and duplicate faces removed, edges of more
    than two faces split, holes up to `max_hole_mm` closed, faces turned outward, and
    small or inner pieces dropped; `single` and `caps_walls` as in `sound_pieces`.
    MeshError for other holes and surfaces that stay open.
    """
    # before vertices are merged, which may join pieces; without shared vertices, each
    # face is a piece
    mesh, turned = _turn_outward(mesh, 2)
    mesh, doubles = _drop_doubles(mesh)
    # after merging, since faces that meet in copies of a vertex would count
    crossing = int(remeshing.self_intersecting_faces(mesh).sum())
    mesh, opened = _make_manifold(mesh)
    mesh, dropped = _main_pieces(mesh, single)
    # a brain in one piece has no medial walls that could be open
    mesh, holes, is_cap = _fill_holes(
        mesh, max_hole_mm, caps_walls and (single or dropped["pieces"] > 1)
    )
    mesh, turned_later = _turn_outward(mesh, dropped["pieces"])
    if not triangles.is_closed(mesh):
        found = (
            f"{int((triangles.edges(mesh)[1] != 2).sum())} edges without exactly two"
            " faces after repair"
        )
        raise MeshError(
            "the surface cannot be closed", found=found, expected="a closed surface"
        )
    counts = {
        "faces_that_cut_others": crossing,
        "pieces_turned_outward": turned + turned_later,
    }
    return mesh, doubles | opened | dropped | holes | counts, is_cap


def pieces(mesh: TriangleMesh) -> list[TriangleMesh]:
    """Return the connected pieces of a surface, the largest area first."""
    component = triangles.face_components(mesh)
    return [
        triangles.submesh(mesh, component == number)[0]
        for number in range(int(component.max()) + 1)
    ]


def _turn_outward(mesh: TriangleMesh, count: int) -> tuple[TriangleMesh, int]:
    """Turn the `count` largest pieces outward if they are closed; return the surface
    and how many were turned."""
    component = triangles.face_components(mesh)
    parts = [
        triangles.submesh(mesh, component == number)[0]
        for number in range(
            min(
                int(component.max()) + 1,
                count,
            )
        )
    ]
    inward = [
        number
        for number, part in enumerate(parts)
        if triangles.is_closed(part) and triangles.signed_volume(part) < 0
    ]
    is_inward = np.isin(component, inward)[:, None]
    return TriangleMesh(
        mesh.vertices,
        np.where(
            is_inward,
            mesh.faces[:, ::-1],
            mesh.faces,
        ),
    ), len(inward)


def _drop_doubles(mesh: TriangleMesh) -> tuple[TriangleMesh, dict[str, Any]]:
    vertices, _, _, faces = igl.remove_duplicate_vertices(
        mesh.vertices, mesh.faces, MERGE_MM
    )
    used = len(np.unique(mesh.faces))
    faces = np.asarray(faces, dtype=np.int64)
    flat = (faces[:, [0, 1, 2]] == faces[:, [1, 2, 0]]).any(axis=1)
    faces = faces[~flat]
    lowest_first = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    _, first = np.unique(
        np.take_along_axis(faces, lowest_first, axis=1), axis=0, return_index=True
    )
    distinct = TriangleMesh(vertices, faces[np.sort(first)])
    result, used_vertices = triangles.submesh(distinct, ~_duplicate_opposites(distinct))
    return result, {
        "degenerate_faces_removed": int(flat.sum()),
        "double_faces_removed": len(faces) - len(result.faces),
        "duplicate_vertices_joined": max(used - len(used_vertices), 0),
    }


def _duplicate_opposites(mesh: TriangleMesh) -> Mask:
    """Return the (m,) mask of faces that repeat an earlier one in the opposite
    orientation, except shared walls.

    Each edge of a wall that two closed pieces share has as many faces in one direction
    as in the other.
    """
    _, first, face, count = np.unique(
        np.sort(mesh.faces, axis=1),
        axis=0,
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    is_double = (count == 2)[face]
    is_duplicate = is_double.copy()
    if is_double.any():
        start, end = mesh.faces, mesh.faces[:, [1, 2, 0]]
        keys = np.minimum(start, end) * len(mesh.vertices) + np.maximum(start, end)
        _, edge = np.unique(keys.ravel(), return_inverse=True)
        direction = np.bincount(
            edge,
            np.where(start < end, 1.0, -1.0).ravel(),
        )
        single = np.bincount(edge, np.repeat(~is_double, 3))
        edge = edge.reshape(-1, 3)[is_double]
        region = triangles.face_components(triangles.submesh(mesh, is_double)[0])
        # a surface whose faces are all double has no single ones around
        is_wall = (
            np.bincount(
                region,
                (single[edge] > 0).any(axis=1),
            )
            > 0
        )
        is_wall &= (
            np.bincount(
                region,
                (direction[edge] != 0).any(axis=1),
            )
            == 0
        )
        is_duplicate[is_double] = ~is_wall[region]
        is_duplicate[first] = False
    return is_duplicate


def _make_manifold(mesh: TriangleMesh) -> tuple[TriangleMesh, dict[str, Any]]:
    non_manifold = int((triangles.edges(mesh)[1] > 2).sum())
    split = triangles.split_sheets(mesh)
    if (triangles.edges(split)[1] > 2).any():
        document = remeshing.in_meshlab(split)
        document.meshing_repair_non_manifold_edges(method="Remove Faces")
        split = triangles.split_sheets(remeshing.from_meshlab(document))
    faces, _ = igl.bfs_orient(split.faces)
    turned = int((faces != split.faces).any(axis=1).sum())
    return TriangleMesh(split.vertices, faces), {
        "non_manifold_edges_opened": non_manifold,
        "non_manifold_vertices_split": len(split.vertices) - len(mesh.vertices),
        "faces_turned_to_agree": min(turned, len(faces) - turned),
    }


def _main_pieces(
    mesh: TriangleMesh, single: bool
) -> tuple[TriangleMesh, dict[str, Any]]:
    parts = pieces(mesh)
    areas = [triangles.area(piece) for piece in parts]
    main = [parts[0]]
    for piece, size in zip(
        parts[1:],
        areas[1:],
        strict=True,
    ):
        inside = (
            np.median(
                np.abs(
                    igl.fast_winding_number(
                        parts[0].vertices, parts[0].faces, piece.vertices
                    )
                )
            )
            > 0.5
        )
        if size >= COMPARABLE * areas[0] and not (inside or single):
            main.append(piece)
    dropped = {
        "pieces_dropped": len(parts) - len(main),
        "area_dropped_mm2": sum(areas) - sum(map(triangles.area, main)),
    }
    return triangles.merged(*main), {"pieces": len(main)} | dropped


def _fill_holes(
    mesh: TriangleMesh,
    max_hole_mm: float,
    caps_walls: bool,
) -> tuple[TriangleMesh, dict[str, Any], Mask]:
    by_size = sorted(
        (float(np.ptp(mesh.vertices[loop], axis=0).max()), list(loop))
        for loop in igl.boundary_loop_all(mesh.faces)
    )
    sizes = [size for size, _ in by_size]
    loops = [np.asarray(loop) for _, loop in by_size]
    small = sum(size <= max_hole_mm for size in sizes)
    wide, component = sizes[small:], triangles.face_components(mesh)
    pieces_with_wide = {
        int(component[(mesh.faces == loop[0]).any(axis=1)][0]) for loop in loops[small:]
    }
    if wide and not (caps_walls and len(pieces_with_wide) == len(wide)):
        raise MeshError(
            "the surface has holes that are too large to close",
            found=f"{len(wide)} of {len(loops)} holes, up to {wide[-1]:.1f} mm across",
            expected=f"at most {max_hole_mm:g} mm",
            remedy="Give a closed surface.",
        )
    for number, loop in enumerate(loops):
        # new faces have the edges of existing ones in the opposite direction
        is_same = (mesh.faces[:, [0, 1, 2]] == loop[0]) & (
            mesh.faces[:, [1, 2, 0]] == loop[1]
        )
        loops[number] = loop[::-1] if is_same.any() else loop
    for loop in loops[:small]:
        fan = np.stack(
            [
                loop,
                np.roll(loop, -1),
                np.full(len(loop), len(mesh.vertices)),
            ],
            axis=1,
        )
        centre = mesh.vertices[loop].mean(axis=0, keepdims=True)
        mesh = TriangleMesh(
            np.concatenate([mesh.vertices, centre]), np.concatenate([mesh.faces, fan])
        )
    counts = {
        "holes_closed": small,
        "largest_hole_mm": max(sizes[:small], default=0.0),
        "medial_walls_capped_mm": wide,
    }
    mesh, is_cap = (
        _with_caps(mesh, loops[small:])
        if wide
        else (
            mesh,
            np.zeros(
                len(mesh.faces),
                dtype=bool,
            ),
        )
    )
    return mesh, counts, is_cap


def _with_caps(mesh: TriangleMesh, loops: list[Ints]) -> tuple[TriangleMesh, Mask]:
    """Close loops by patches of the smallest area, and remesh these; return the surface
    and the mask of the caps."""
    rims = np.concatenate(
        [
            np.stack(
                [loop, np.roll(loop, -1)],
                axis=1,
            )
            for loop in loops
        ]
    )
    patches = [triangles.smallest_patch(mesh, loop) for loop in loops]
    document = remeshing.in_meshlab(
        TriangleMesh(
            mesh.vertices,
            np.concatenate([mesh.faces, *patches]),
        )
    )
    # the patches: fi is MeshLab's number of a face. Faces that replace them stay
    # selected
    n_faces = len(mesh.faces)
    document.compute_selection_by_condition_per_face(condselect=f"fi >= {n_faces}")
    mean_mm = triangles.edge_lengths(mesh.vertices, rims).mean()
    length = remeshing.pymeshlab.PureValue(float(mean_mm))
    document.meshing_isotropic_explicit_remeshing(
        iterations=remeshing.FINE_ROUNDS,
        targetlen=length,
        featuredeg=remeshing.SHARP_DEG,
        checksurfdist=False,
        selectedonly=True,
    )
    is_cap = np.asarray(
        document.current_mesh().face_selection_array(),
        dtype=bool,
    )
    return remeshing.from_meshlab(document), is_cap


def _surface_without_stalks(
    mesh: TriangleMesh,
) -> tuple[TriangleMesh, list[dict[str, Any]]]:
    """Remove the parts of a closed surface that hang by a stalk and close the cuts;
    return it and the parts."""
    if not MIN_LENGTH_MM < np.ptp(mesh.vertices, axis=0).max() < MAX_LENGTH_MM:
        # surfaces in another unit are reported elsewhere
        return mesh, []
    labels, affine = surface_mask(mesh, STALK_VOXEL_MM)
    remaining, report = without_stalks(labels > 0, affine)
    if not report:
        return mesh, []
    # a face belongs to the same side of a cut as the nearest voxel inside
    nearest = ndimage.distance_transform_edt(
        labels == 0, return_distances=False, return_indices=True
    )
    centres = triangles.corners(mesh).mean(axis=1)
    voxel = np.rint(voxel_index(centres, affine)).astype(int)
    is_kept = remaining[tuple(nearest[(slice(None), *voxel)])]
    cut_open, _ = triangles.submesh(mesh, is_kept)
    return clean(cut_open, MAX_CUT_MM)[0], report


def surface_of_mask(
    field: NDArray[np.float32],
    affine: Floats,
    volume_mm3: float,
    edge_length_mm: float,
    *,
    smallest: float = COMPARABLE_PARTS,
    taken_mm3: float = 0.0,
    original: tuple[NDArray[np.float32], Floats] | None = None,
) -> RepairedSurface:
    """Return the even surface around a smoothed (i, j, k) mask, without terraces and
    with the mask's volume.

    `volume_mm3` is the volume of the mask, `taken_mm3` the part removed by openings;
    parts below `smallest` of the largest are left out. `original` is the field before
    sulci and fissure were opened, with its affine: walls of openings have no terraces.
    The report includes "topology" and "smoothing". MeshError if self-intersections
    remain.
    """
    simple, topology = make_simple(field, smallest)
    rough = isosurface(simple, affine)
    even = make_sound(rough, edge_length_mm)
    before, grid = original or (simple, affine)
    smooth = without_terraces(
        even.mesh,
        grid,
        sample(
            before,
            grid,
            even.mesh.vertices,
        )
        > INSIDE_LEVEL,
    )
    added = int((simple > LEVEL).sum()) - int((field > LEVEL).sum())
    repaired_mm3 = volume_mm3 + added * float(abs(np.linalg.det(affine[:3, :3])))
    mesh, smoothing = _with_volume(
        smooth, repaired_mm3 - taken_mm3, triangles.area(rough)
    )
    moved = np.linalg.norm(
        smooth.vertices - even.mesh.vertices,
        axis=1,
    )
    smoothing |= {
        "terraces_moved_mm": float(moved.mean()),
        "terraces_moved_most_mm": float(moved.max()),
    }
    warnings = [*even.warnings, *filled_warning(topology, affine)]
    if abs(change := smoothing["volume_change"]) > VOLUME_TOL:
        warnings.append(
            f"smoothing changed the volume by {100 * change:.1f} %: use finer voxels"
        )
    return RepairedSurface(
        mesh, {"topology": topology, **even.report, "smoothing": smoothing}, warnings
    )


def filled_warning(topology: Mapping[str, Any], affine: Floats) -> list[str]:
    """Return a warning if closing handles has added much tissue, from the report of
    `make_simple`."""
    added_mm3 = topology["voxels_filled_in_tunnels"] * float(
        abs(np.linalg.det(affine[:3, :3]))
    )
    if added_mm3 <= MAX_FILLED_MM3:
        return []
    return [
        f"closing handles added {added_mm3:.0f} mm³ of tissue: check that no sulcus or"
        " fissure was closed there"
    ]


def _with_volume(
    mesh: TriangleMesh,
    volume_mm3: float,
    area_mm2: float,
) -> tuple[TriangleMesh, dict[str, Any]]:
    """Move a closed surface along its normals until it encloses a volume; return it and
    a report in plain values.

    Walls that would cross are not moved, nor is a surface that lacks more than 5 % or
    still would cross itself. `area_mm2` is the area before smoothing and remeshing.
    """
    before = triangles.signed_volume(mesh) / volume_mm3 - 1.0
    moved = (
        _move_along_normals(mesh, volume_mm3) if abs(before) <= MAX_RESTORED else mesh
    )
    change = triangles.signed_volume(moved) / volume_mm3 - 1.0
    report = {
        "volume_expected_mL": volume_mm3 * ML_PER_MM3,
        "volume_change": change,
        "volume_change_before_correction": before,
        "area_change": triangles.area(moved) / area_mm2 - 1.0,
    }
    log.info(
        "volume changed by %.2f %%, area by %.2f %% through smoothing",
        100 * change,
        100 * report["area_change"],
    )
    return moved, report


def _move_along_normals(mesh: TriangleMesh, volume_mm3: float) -> TriangleMesh:
    free = np.ones(len(mesh.vertices), dtype=bool)
    for _ in range(N_RESETS + 1):
        moved = mesh
        for _ in range(ROUNDS):
            share = float(triangles.vertex_areas(moved)[free].sum())
            offset = (volume_mm3 - triangles.signed_volume(moved)) / share * free
            moved = TriangleMesh(
                moved.vertices + offset[:, None] * triangles.vertex_normals(moved),
                moved.faces,
            )
        if not (crossing := remeshing.self_intersecting_faces(moved)).any():
            return moved
        near = np.isin(mesh.faces, mesh.faces[crossing]).any(axis=1)
        free[mesh.faces[near]] = False
        if not free.any():
            break
    return mesh


def _rebuild(
    mesh: TriangleMesh, voxel_mm: float
) -> tuple[TriangleMesh, dict[str, Any]]:
    """Rebuild a surface through voxels by winding numbers, free of handles and
    crossings; return it and a report."""
    margin_mm = voxel_mm * MARGIN_VOXELS
    lowest = mesh.vertices.min(axis=0) - margin_mm
    highest = mesh.vertices.max(axis=0) + margin_mm
    box = np.array([lowest, highest])
    labels, affine = surface_mask(mesh, voxel_mm, box)
    inside = labels > 0
    # beyond two voxels from the surface, the field is 0 or 1
    near = dilated(inside, 2.0) & dilated(~inside, 2.0)
    places = transform_points(np.argwhere(near), affine)
    distance, _, _ = nearest_on(places, mesh)
    sign = np.where(inside, 1.0, -1.0)
    depth_mm = sign * np.inf
    depth_mm[near] = sign[near] * distance
    slope = EDGE_SLOPE / voxel_mm
    share_inside = np.clip(0.5 + slope * depth_mm, 0.0, 1.0)
    field, report = make_simple(share_inside.astype(np.float32))
    return isosurface(field, affine), report
