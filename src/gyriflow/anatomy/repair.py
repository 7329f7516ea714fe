"""Surfaces made sound: cleaned, freed of stalks, of even triangles, of the right volume, or rebuilt through voxels.

Every repair is counted.
"""

import logging
from dataclasses import dataclass
from typing import Any

import igl
import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import MeshError
from ..geometry.remeshing import from_meshlab, in_meshlab, remesh, self_intersecting_faces, untangle
from ..geometry.triangles import (
    TriangleMesh,
    area,
    corners,
    edges,
    euler_number,
    face_components,
    flipped,
    is_closed,
    merged,
    signed_volume,
    submesh,
    vertex_areas,
    vertex_normals,
)
from ..settings.terms import MAX_HOLE_MM
from ..units import ML_PER_MM3
from .extraction import COMPARABLE as COMPARABLE_PARTS
from .extraction import EDGE_SLOPE, LEVEL, Floats, isosurface, make_simple, without_stalks
from .fissure import sample
from .labels import REPORTED_LOSS
from .terraces import without_terraces

log = logging.getLogger(__name__)

# vertices closer than this are one vertex
SAME_MM = 1e-5
# pieces from this part of the largest area are kept: two hemispheres in one file
COMPARABLE = 0.3
# lengths of brains and hemispheres
SMALLEST_MM, LARGEST_MM = 15.0, 300.0
# an edge as long, and so many times the median, leads to a vertex off the surface
SPIKE_MM, SPIKE_SPREADS = 10.0, 10.0
# voxels in which a surface is looked at for stalks
STALK_VOXEL_MM = 0.8
# cuts follow the triangles, so that they are wider than the stalks
WIDEST_CUT_MM = 12.0
# around a surface that is rebuilt
MARGIN_VOXELS = 6
# smoothing keeps the volume to this part
KEPT = 0.01
# beyond this it has taken structures, not rounded them, and moving the whole surface would not bring them back
MOST_GIVEN_BACK = 0.05
# of Taubin smoothing
SMOOTHING_ITERATIONS = 10
ROUNDS = 2
# how many times walls that would cut each other are held back, and after smoothing with how many rings of neighbours
HELD_BACK, HELD_RINGS = 4, 3
# walls where the field before an opening was above this are walls of what was opened
WITHIN = 0.8


@dataclass(frozen=True, eq=False)
class Sound:
    """A surface after repairs, with what these were, in plain values for JSON, and what is to be told."""

    mesh: TriangleMesh
    report: dict[str, Any]
    warnings: list[str]


def sound_pieces(mesh: TriangleMesh, max_hole_mm: float, *, one: bool = False) -> Sound:
    """Return a surface of one piece or two, or its largest piece, repaired and without parts that hang on stalks."""
    lengths = np.linalg.norm(np.diff(mesh.vertices[edges(mesh)[0]], axis=1), axis=2)
    mesh, repairs = clean(mesh, max_hole_mm, one=one)
    warnings, dropped, kept = [], repairs["area_dropped_mm2"], area(mesh)
    if lengths.max() > max(SPIKE_MM, SPIKE_SPREADS * np.median(lengths)):
        warnings.append(f"an edge is {lengths.max():.0f} mm long: is a vertex far off the surface?")
    if dropped > REPORTED_LOSS * kept:
        warnings.append(
            f"{repairs['pieces_dropped']} pieces apart from the brain or inside it were dropped: "
            f"{100 * dropped / (kept + dropped):.1f} % of the area"
        )
    mesh, stalks = surface_without_stalks(mesh)
    warnings += [
        f"a part of {stalk['volume_mm3']:.0f} mm³ hung on a stalk of {stalk['stalk_mm2']:.0f} mm²: cut off"
        for stalk in stalks
    ]
    return Sound(mesh, {"repair": repairs} | ({"stalks": stalks} if stalks else {}), warnings)


def make_sound(mesh: TriangleMesh, edge_length_mm: float) -> Sound:
    """Return the surface smoothed and remeshed, each piece a sphere that does not cut itself.

    Where the triangles can't be repaired, the surface is rebuilt through voxels of half an edge length. The report has
    what `rebuild` says as "remade". MeshError where that stays tangled.
    """
    smooth, cutting = make_even(mesh, edge_length_mm)
    report: dict[str, Any] = {"self_intersections": cutting}
    if not (remaining := faults(smooth)):
        return Sound(smooth, report, [])
    mesh, report["remade"] = rebuild(mesh, 0.5 * edge_length_mm)
    smooth, _ = make_even(mesh, edge_length_mm)
    require_sound(smooth)
    return Sound(smooth, report, [f"the surface was rebuilt through voxels, since it had {remaining}"])


def require_sound(mesh: TriangleMesh) -> None:
    """Raise MeshError where the surface is not made of closed spheres without intersections."""
    if problems := faults(mesh):
        raise MeshError(
            "the surface could not be made good",
            found=problems,
            expected="closed pieces of Euler number 2 that do not cut themselves",
        )


def faults(mesh: TriangleMesh) -> str:
    """Return what keeps the surface from being closed spheres without intersections; empty where nothing does."""
    euler = [euler_number(piece) for piece in pieces(mesh)]
    cutting = int(self_intersecting_faces(mesh).sum())
    problems = [
        "edges without two faces" if not is_closed(mesh) else "",
        f"Euler numbers {euler}" if any(number != 2 for number in euler) else "",
        f"{cutting} faces that cut others" if cutting else "",
    ]
    return ", ".join(fault for fault in problems if fault)


def make_even(mesh: TriangleMesh, edge_length_mm: float) -> tuple[TriangleMesh, int]:
    """Return the surface smoothed, remeshed and untangled, and the number of faces that cut others before that.

    Taubin smoothing keeps the volume (Taubin 1995, λ = 0.5, μ = −0.53). Walls of a narrow slit that stay
    tangled are not smoothed.
    """
    document = in_meshlab(mesh)
    document.apply_coord_taubin_smoothing(stepsmoothnum=SMOOTHING_ITERATIONS)
    smooth = from_meshlab(document)
    even = remesh(smooth, edge_length_mm)
    cutting = int(self_intersecting_faces(even).sum())
    if cutting and self_intersecting_faces(even := untangle(even)).any():
        even = untangle(remesh(_held_back(mesh, smooth), edge_length_mm))
    return even, cutting


def _held_back(mesh: TriangleMesh, smooth: TriangleMesh) -> TriangleMesh:
    """Return the smoothed surface with faces that cut others, and some rings around these, as they were before."""
    for _ in range(HELD_BACK):
        held = self_intersecting_faces(smooth)
        if not held.any():
            break
        for _ in range(HELD_RINGS):
            held[:] = np.isin(mesh.faces, mesh.faces[held]).any(axis=1)
        places = smooth.vertices.copy()
        places[mesh.faces[held]] = mesh.vertices[mesh.faces[held]]
        smooth = TriangleMesh(places, mesh.faces)
    return smooth


def clean(mesh: TriangleMesh, max_hole_mm: float, *, one: bool = False) -> tuple[TriangleMesh, dict[str, Any]]:
    """Return the surface as closed, outward, manifold pieces of comparable size, and the count of each repair.

    Equal vertices are joined, degenerate and double faces removed, non-manifold edges opened, holes up to `max_hole_mm`
    across closed, faces turned outward, small pieces and pieces inside others dropped, and all but the largest where
    there is to be `one`. MeshError for larger holes and for surfaces that stay open.
    """
    mesh, doubles = _drop_doubles(mesh)
    # not before: faces that meet in several copies of a vertex would count
    cutting = int(self_intersecting_faces(mesh).sum())
    mesh, opened = _make_manifold(mesh)
    mesh, dropped = _main_pieces(mesh, one)
    mesh, holes = _fill_holes(mesh, max_hole_mm)
    parts = pieces(mesh)
    inward = [signed_volume(piece) < 0 for piece in parts]
    mesh = merged(*(flipped(piece) if turn else piece for piece, turn in zip(parts, inward, strict=True)))
    if not is_closed(mesh):
        raise MeshError(
            "the surface cannot be closed",
            found=f"{int((edges(mesh)[1] != 2).sum())} edges without exactly two faces after repair",
            expected="a closed surface",
        )
    counts = {"faces_that_cut_others": cutting, "pieces_turned_outward": sum(inward)}
    return mesh, doubles | opened | dropped | holes | counts


def pieces(mesh: TriangleMesh) -> list[TriangleMesh]:
    """Return the connected pieces of a surface, the largest area first."""
    component = face_components(mesh)
    return [submesh(mesh, component == number)[0] for number in range(component.max() + 1)]


def _drop_doubles(mesh: TriangleMesh) -> tuple[TriangleMesh, dict[str, Any]]:
    vertices, _, _, faces = igl.remove_duplicate_vertices(mesh.vertices, mesh.faces, SAME_MM)
    used = len(np.unique(mesh.faces))
    faces = np.asarray(faces, dtype=np.int64)
    flat = (faces[:, [0, 1, 2]] == faces[:, [1, 2, 0]]).any(axis=1)
    faces = faces[~flat]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    result, kept = submesh(TriangleMesh(vertices, faces[np.sort(first)]), np.ones(len(first), dtype=bool))
    return result, {
        "degenerate_faces_removed": int(flat.sum()),
        "double_faces_removed": len(faces) - len(first),
        "duplicate_vertices_joined": max(used - len(kept), 0),
    }


def _make_manifold(mesh: TriangleMesh) -> tuple[TriangleMesh, dict[str, Any]]:
    bad = int((edges(mesh)[1] > 2).sum())
    document = in_meshlab(mesh)
    if bad:
        document.meshing_repair_non_manifold_edges(method="Remove Faces")
    split = int(document.get_topological_measures()["non_two_manifold_vertices"])
    if bad or split:
        document.meshing_repair_non_manifold_vertices(vertdispratio=0.0)
        mesh = from_meshlab(document)
    faces, _ = igl.bfs_orient(mesh.faces)
    turned = int((faces != mesh.faces).any(axis=1).sum())
    return TriangleMesh(mesh.vertices, faces), {
        "non_manifold_edges_opened": bad,
        "non_manifold_vertices_split": split,
        "faces_turned_to_agree": min(turned, len(faces) - turned),
    }


def _main_pieces(mesh: TriangleMesh, one: bool) -> tuple[TriangleMesh, dict[str, Any]]:
    parts = pieces(mesh)
    areas = [area(piece) for piece in parts]
    kept = [parts[0]]
    for piece, size in zip(parts[1:], areas[1:], strict=True):
        inside = np.median(np.abs(igl.fast_winding_number(parts[0].vertices, parts[0].faces, piece.vertices))) > 0.5
        if size >= COMPARABLE * areas[0] and not (inside or one):
            kept.append(piece)
    dropped = {"pieces_dropped": len(parts) - len(kept), "area_dropped_mm2": sum(areas) - sum(map(area, kept))}
    return merged(*kept), {"pieces": len(kept)} | dropped


def _fill_holes(mesh: TriangleMesh, max_hole_mm: float) -> tuple[TriangleMesh, dict[str, Any]]:
    loops = [np.asarray(loop) for loop in igl.boundary_loop_all(mesh.faces)]
    sizes = [float(np.ptp(mesh.vertices[loop], axis=0).max()) for loop in loops]
    if sizes and max(sizes) > max_hole_mm:
        wide = sorted((size for size in sizes if size > max_hole_mm), reverse=True)
        raise MeshError(
            "the surface has holes that are too large to close",
            found=f"{len(wide)} of {len(loops)} holes, up to {wide[0]:.1f} mm across",
            expected=f"at most {max_hole_mm:g} mm (max_hole_mm)",
            remedy="Give a closed surface, or raise surface.max_hole_mm if the opening may be covered."
            if wide[0] <= MAX_HOLE_MM
            else "Give a closed surface: holes of this size are not to be covered.",
        )
    vertices, faces = [mesh.vertices], [mesh.faces]
    for number, loop in enumerate(loops):
        centre = np.full(len(loop), len(mesh.vertices) + number)
        start, end = loop, np.roll(loop, -1)
        # the fan runs along the loop against the faces that are there
        along = (mesh.faces[:, [0, 1, 2]] == start[0]) & (mesh.faces[:, [1, 2, 0]] == end[0])
        faces.append(np.stack([end, start, centre] if along.any() else [start, end, centre], axis=1))
        vertices.append(mesh.vertices[loop].mean(axis=0, keepdims=True))
    counts = {"holes_closed": len(loops), "largest_hole_mm": max(sizes, default=0.0)}
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces)), counts


def surface_without_stalks(mesh: TriangleMesh) -> tuple[TriangleMesh, list[dict[str, Any]]]:
    """Return a closed surface without what hangs on it by stalks, closed where these were cut, and the parts."""
    if not SMALLEST_MM < np.ptp(mesh.vertices, axis=0).max() < LARGEST_MM:
        # in another unit, which is reported elsewhere
        return mesh, []
    size = np.full(3, STALK_VOXEL_MM)
    first = mesh.vertices.min(axis=0) - 2.0 * size
    shape = np.ceil((np.ptp(mesh.vertices, axis=0) + 4.0 * size) / size).astype(int)
    grid = pv.ImageData(dimensions=shape, spacing=size, origin=first)
    body = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=int))
    image = body.voxelize_binary_mask(reference_volume=grid)
    mask = np.asarray(image["mask"]).reshape(shape, order="F") > 0
    affine = np.diag([*size, 1.0])
    affine[:3, 3] = first
    left, report = without_stalks(mask, affine)
    if not report:
        return mesh, []
    # which side of the cuts each face is on: that of the nearest voxel inside
    _, nearest = ndimage.distance_transform_edt(~mask, return_indices=True)
    at = np.clip(np.rint((corners(mesh).mean(axis=1) - first) / size).astype(int), 0, shape - 1)
    kept = left[tuple(nearest[(slice(None), *at.T)])]
    open_, _ = submesh(mesh, kept)
    return clean(open_, WIDEST_CUT_MM)[0], report


def surface_of_mask(
    field: NDArray[np.float32],
    affine: Floats,
    volume_mm3: float,
    edge_length_mm: float,
    *,
    smallest: float = COMPARABLE_PARTS,
    taken_mm3: float = 0.0,
    shut: tuple[NDArray[np.float32], Floats] | None = None,
) -> Sound:
    """Return the even surface around a smoothed (i, j, k) mask, without terraces and with the mask's volume.

    `volume_mm3` is that of the mask, `taken_mm3` what was taken from it; parts below `smallest` of the largest are left
    out; `shut` is the field before it was opened, with its affine: walls that were not there have no terraces. The
    report has the "topology" and the "smoothing" too. MeshError where the surface stays tangled.
    """
    simple, topology = make_simple(field, smallest)
    rough = isosurface(simple, affine)
    even = make_sound(rough, edge_length_mm)
    before, grid = shut or (simple, affine)
    smooth = without_terraces(even.mesh, grid, sample(before, grid, even.mesh.vertices) > WITHIN)
    added = int((simple > LEVEL).sum()) - int((field > LEVEL).sum())
    repaired_mm3 = volume_mm3 + added * float(abs(np.linalg.det(affine[:3, :3])))
    mesh, smoothing = with_volume(smooth, repaired_mm3 - taken_mm3, area(rough))
    moved = np.linalg.norm(smooth.vertices - even.mesh.vertices, axis=1)
    smoothing |= {"terraces_moved_mm": float(moved.mean()), "terraces_moved_most_mm": float(moved.max())}
    warnings = list(even.warnings)
    if abs(change := smoothing["volume_change"]) > KEPT:
        warnings.append(f"smoothing changed the volume by {100 * change:.1f} %: finer voxels keep it")
    return Sound(mesh, {"topology": topology, **even.report, "smoothing": smoothing}, warnings)


def with_volume(mesh: TriangleMesh, volume_mm3: float, area_mm2: float) -> tuple[TriangleMesh, dict[str, Any]]:
    """Return a closed surface set along its normals so that it encloses a volume, and a report in plain values.

    Smoothing and remeshing draw a convex surface inwards by some hundredths of a mm: ΔV/A is given back. Walls so near
    to each other that they would cut stay where they are. So does the whole surface where more than 5 % of the volume
    is missing, or where it would cut itself even so. `area_mm2` is that of the mask's isosurface before it was smoothed
    and remeshed.
    """
    before = signed_volume(mesh) / volume_mm3 - 1.0
    moved = _set_along_normals(mesh, volume_mm3) if abs(before) <= MOST_GIVEN_BACK else mesh
    change = signed_volume(moved) / volume_mm3 - 1.0
    report = {
        "volume_expected_mL": volume_mm3 * ML_PER_MM3,
        "volume_change": change,
        "volume_change_before_correction": before,
        "area_change": area(moved) / area_mm2 - 1.0,
    }
    log.info("volume changed by %.2f %%, area by %.2f %% through smoothing", 100 * change, 100 * report["area_change"])
    return moved, report


def _set_along_normals(mesh: TriangleMesh, volume_mm3: float) -> TriangleMesh:
    free = np.ones(len(mesh.vertices), dtype=bool)
    for _ in range(HELD_BACK + 1):
        moved = mesh
        for _ in range(ROUNDS):
            share = float(vertex_areas(moved)[free].sum())
            offset = (volume_mm3 - signed_volume(moved)) / share * free
            moved = TriangleMesh(moved.vertices + offset[:, None] * vertex_normals(moved), moved.faces)
        if not (cutting := self_intersecting_faces(moved)).any():
            return moved
        near = np.isin(mesh.faces, mesh.faces[cutting]).any(axis=1)
        free[mesh.faces[near]] = False
        if not free.any():
            break
    return mesh


def rebuild(mesh: TriangleMesh, voxel_mm: float) -> tuple[TriangleMesh, dict[str, Any]]:
    """Return the surface of the region that `mesh` winds around, without handles or intersections, and a report.

    The generalised winding number (Jacobson et al. 2013, doi 10.1145/2461912.2461916) separates inside from outside
    even where the surface cuts itself. Details below the voxel size are lost.
    """
    first = mesh.vertices.min(axis=0) - MARGIN_VOXELS * voxel_mm
    shape = np.ceil(np.ptp(mesh.vertices, axis=0) / voxel_mm).astype(int) + 2 * MARGIN_VOXELS
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = first
    points = np.indices(shape).reshape(3, -1).T * voxel_mm + first
    # NaN beyond the bound, where the field is 0 or 1
    near_by = igl.SIGNED_DISTANCE_TYPE_UNSIGNED, -2.0 * voxel_mm, 2.0 * voxel_mm
    distance = igl.signed_distance(points, mesh.vertices, mesh.faces, *near_by)[0]
    band = np.isfinite(distance)
    distance[~band] = np.inf
    wound = np.zeros(len(points), dtype=bool)
    wound[band] = igl.fast_winding_number(mesh.vertices, mesh.faces, points[band]) > 0.5
    # where no surface is near, each region is inside or outside as a whole
    far = ~band.reshape(shape)
    number, count = ndimage.label(far)
    one = np.array(ndimage.maximum_position(far, number, np.arange(1, count + 1)), dtype=float)
    winding = igl.fast_winding_number(mesh.vertices, mesh.faces, one @ affine[:3, :3].T + affine[:3, 3])
    inside = wound.reshape(shape) | np.concatenate([[False], winding > 0.5])[number]
    signed = np.where(inside, distance.reshape(shape), -distance.reshape(shape))
    field = np.clip(0.5 + EDGE_SLOPE * signed / voxel_mm, 0.0, 1.0).astype(np.float32)
    field, report = make_simple(field)
    return isosurface(field, affine), report
