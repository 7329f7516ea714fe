"""Triangle surfaces in mm, of the formats in `FORMATS`, and maps and labels at their
vertices (GIFTI).

Coordinates are transformed to scanner space if the file defines their space.
"""

import hashlib
import itertools
import logging
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

import nibabel as nib
import numpy as np
from nibabel.freesurfer.io import read_geometry
from nibabel.gifti import (
    GiftiCoordSystem,
    GiftiDataArray,
    GiftiImage,
    GiftiLabel,
    GiftiLabelTable,
    GiftiMetaData,
)
from nibabel.nifti1 import intent_codes
from numpy.typing import NDArray

from ..errors import InputError
from ..formats import START_BYTES, SURFACE_SUFFIXES, format_of, side_in_name
from ..geometry.poses import Pose, pose_from
from ..geometry.triangles import Floats, Ints, TriangleMesh, is_closed, merged
from ..quantities import DISTINCT_COLOURS
from ..settings.terms import NO_REGION, SIDES, STRUCTURES, Side
from .files import AGAIN, AnyPath, atomic_write, read_json, reading, require_finite
from .vtk_files import read_vtk

log = logging.getLogger(__name__)

Structure = Literal["CortexLeft", "CortexRight", "Cortex"]
Layer = Literal["Pial", "GrayWhite"]
SIDES_BY_STRUCTURE: dict[str, Side] = {
    structure: side for side, structure in STRUCTURES.items()
}
SURFACE_NAMES = f"a file that ends in {', '.join(SURFACE_SUFFIXES)}"
RawSurface = tuple[Floats, NDArray, str | None, str | None]
"""Points and faces of a file, the space of the points and the structure (each None if
the file has none)."""
System = tuple[str, str, Floats]
"""A space of coordinates, the space that a matrix leads to, and the (4, 4) matrix."""


def read_surface(path: AnyPath, side: str | None = None) -> TriangleMesh:
    """Return the surface of a file of any format in `FORMATS`, in the order of corners
    of the file.

    GIFTI and FreeSurfer coordinates go to scanner space if the file defines how.
    InputError for invalid files, coordinates of another space than the subject's, and
    the other hemisphere than `side`.
    """
    mesh, _, structure = surface_space_structure(path)
    _require_side(path, structure, side)
    return mesh


def surface_space_structure(
    path: AnyPath,
) -> tuple[TriangleMesh, str | None, str | None]:
    """Return a surface as `read_surface` does, the space of its coordinates and its
    structure, None if unknown.

    Such as "NIFTI_XFORM_SCANNER_ANAT" and "CortexLeft", from the file's content or its
    name.
    """
    path = Path(path)
    found = format_of(path, "surface")
    # FreeSurfer's files have many endings
    read = SURFACE_READERS[found.name if found else "FreeSurfer"]
    with reading(path, "a surface", SURFACE_NAMES):
        if not path.stat().st_size:
            raise InputError(
                "is empty",
                path=path,
                expected="a surface",
                remedy=AGAIN,
            )
        vertices, faces, space, structure = read(path)
    is_empty = not vertices.size or not faces.size
    if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,) or is_empty:
        shapes = (
            f"points of shape {vertices.shape}, faces of shape {faces.shape}"
            if faces.size
            else "no faces"
        )
        raise InputError(
            "holds no surface",
            path=path,
            found=shapes,
            expected="(n, 3) points and (m, 3) faces",
            remedy=AGAIN,
        )
    require_finite(vertices, path, "coordinates", "vertices")
    if not (
        np.isfinite(faces).all() and 0 <= faces.min() <= faces.max() < len(vertices)
    ) or (np.abs(faces - np.rint(faces)).max() > 1e-3):
        raise InputError(
            "has faces that name vertices which do not exist",
            path=path,
            found=f"indices {faces.min():.6g} to {faces.max():.6g}",
            expected=f"whole numbers from 0 to {len(vertices) - 1}",
        )
    return (
        TriangleMesh(
            vertices,
            np.rint(faces).astype(np.int64),
        ),
        space,
        structure or _structure_in_name(path),
    )


def _structure_in_name(path: AnyPath) -> str | None:
    """Return the structure of the hemisphere that a file's name has, such as `lh.pial`
    or `sub-01_hemi-R_dseg.gii`."""
    side = side_in_name(Path(path).name)
    return STRUCTURES[side] if side else None


def _require_side(
    path: AnyPath,
    structure: str | None,
    side: str | None,
) -> None:
    """Raise InputError if a file's structure is the other hemisphere than `side`,
    "left" or "right"."""
    named = SIDES_BY_STRUCTURE.get(structure or "")
    if side not in STRUCTURES or named in (None, side):
        return
    raise InputError(
        "is the other hemisphere",
        path=path,
        found=structure,
        expected=STRUCTURES[side],
        remedy=(
            f"Give it as the {named} one. If you know that it is the {side} one,"
            " correct the file's own side (AnatomicalStructurePrimary, or its name)."
        ),
    )


def read_hemispheres(
    left: AnyPath, right: AnyPath
) -> tuple[TriangleMesh, TriangleMesh, bool]:
    """Return two hemispheres as `read_surface`, and whether both files name one space;
    warn if they differ."""
    read = [surface_space_structure(path) for path in (left, right)]
    for path, (_, _, structure), side in zip((left, right), read, SIDES, strict=True):
        _require_side(path, structure, side)
    meshes, spaces, _ = zip(*read, strict=True)
    points = meshes[0].vertices, meshes[1].vertices
    if points[0].shape == points[1].shape and np.allclose(*points, atol=1e-3):
        raise InputError(
            "both hemispheres have the same surface",
            found=f"{left} and {right}",
            expected="one file of the left and one of the right hemisphere",
        )
    if spaces[0] != spaces[1]:
        words = " and ".join(
            f"{path} {space or 'no space'}"
            for path, space in zip(
                (left, right),
                spaces,
                strict=True,
            )
        )
        log.warning(
            "the files of the hemispheres name different spaces: %s; are they in the"
            " same coordinates?",
            words,
        )
    return meshes[0], meshes[1], spaces[0] is not None and spaces[0] == spaces[1]


def write_surface(
    path: AnyPath,
    mesh: TriangleMesh,
    structure: Structure | None = None,
    layer: Layer | None = None,
) -> None:
    """Write a surface as GIFTI (float32, int32, RAS+ mm), STL (binary) or PLY, by the
    suffix of `path`."""
    suffix = Path(path).suffix.lower()
    if suffix in (".stl", ".ply", ".obj", ".off"):
        # takes a second, as pyvista does below, which most readers need not wait for
        import trimesh

        body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        with atomic_write(path) as temporary:
            body.export(temporary)
        return
    if suffix != ".gii":
        raise InputError(
            "unknown kind of surface file",
            path=path,
            expected=".gii, .stl, .ply, .obj or .off",
        )
    points = GiftiDataArray(
        mesh.vertices.astype(np.float32),
        intent="NIFTI_INTENT_POINTSET",
        coordsys=GiftiCoordSystem(
            "NIFTI_XFORM_SCANNER_ANAT", "NIFTI_XFORM_SCANNER_ANAT", np.eye(4)
        ),
        meta=GiftiMetaData({"GeometricType": "Anatomical"} | _named(structure, layer)),
    )
    triangles = GiftiDataArray(
        mesh.faces.astype(np.int32),
        intent="NIFTI_INTENT_TRIANGLE",
        meta=GiftiMetaData(
            {"TopologicalType": "Closed" if is_closed(mesh) else "Open"}
        ),
    )
    with atomic_write(path) as temporary:
        nib.save(GiftiImage(darrays=[points, triangles]), temporary)


def write_brain(
    files: Any,
    whole: TriangleMesh,
    left: TriangleMesh | None,
    right: TriangleMesh | None,
) -> None:
    """Write a brain's surface and its hemispheres to `files`: `whole`, `left` and
    `right` if present, `stl`."""
    write_surface(files.whole, whole)
    for side, mesh in zip(
        SIDES,
        (left, right),
        strict=True,
    ):
        if mesh is not None:
            write_surface(files[side], mesh, STRUCTURES[side], "Pial")
    if stl := files.get("stl"):
        write_surface(stl, whole)


def write_vertex_maps(
    path: AnyPath,
    maps: dict[str, NDArray],
    structure: Structure | None = None,
) -> None:
    """Write named (n,) per-vertex values as a GIFTI shape file (.shape.gii,
    float32)."""
    arrays = [
        GiftiDataArray(
            np.asarray(values, np.float32),
            intent="NIFTI_INTENT_SHAPE",
            meta=GiftiMetaData({"Name": name}),
        )
        for name, values in maps.items()
    ]
    with atomic_write(path) as temporary:
        nib.save(
            GiftiImage(darrays=arrays, meta=GiftiMetaData(_named(structure))), temporary
        )


def _named(structure: Structure | None, layer: Layer | None = None) -> dict[str, str]:
    names = {
        "AnatomicalStructurePrimary": structure,
        "AnatomicalStructureSecondary": layer,
    }
    return {key: name for key, name in names.items() if name}


def read_vertex_maps(path: AnyPath) -> dict[str, Floats]:
    """Return the named per-vertex values of a GIFTI shape file."""
    arrays = enumerate(_load_gifti(path).darrays)
    return {
        array.meta.get("Name") or f"map {n}": np.asarray(array.data, dtype=float)
        for n, array in arrays
    }


def _surface_map(
    path: AnyPath,
    surface_path: AnyPath,
    side: str | None,
) -> tuple[TriangleMesh, Floats]:
    """Return a surface and the values of a map at its vertices, of a `side` if it is
    known."""
    found = format_of(surface_path, "surface")
    if found and found.name == "STL":
        raise InputError(
            "cannot have a map, since STL files do not number their vertices",
            path=surface_path,
            expected=(
                f"the file that {path} was made on, of a format that numbers vertices,"
                " such as GIFTI"
            ),
        )
    surface, _, structure = surface_space_structure(surface_path)
    image = _load_gifti(path)
    arrays = image.darrays
    if (
        len(arrays) != 1
        or arrays[0].data.dtype.kind not in "biuf"
        or arrays[0].data.size != len(arrays[0].data)
    ):
        kinds = [
            f"{intent_codes.niistring[array.intent]} {array.data.shape}"
            for array in arrays
        ]
        raise InputError(
            "is not a map of one value per vertex",
            path=path,
            found=", ".join(kinds) or "none",
            expected="one array of numbers (.shape.gii, .func.gii)",
        )
    _require_side(surface_path, structure, side)
    surface_side = side or SIDES_BY_STRUCTURE.get(structure or "")
    _require_side(path, _structure_of(image, path), surface_side)
    values = np.asarray(
        arrays[0].data,
        dtype=float,
    ).ravel()
    if len(values) != len(surface.vertices):
        raise InputError(
            "does not belong to its surface",
            path=path,
            found=f"{len(values)} values",
            expected=(
                f"{len(surface.vertices)}, the number of vertices of {surface_path}"
            ),
        )
    require_finite(values, path, "values", "vertices")
    return surface, values


def read_surface_maps(
    paths: Sequence[AnyPath], surface_paths: Sequence[AnyPath]
) -> tuple[TriangleMesh, Floats]:
    """Return surfaces, two are left and right, as one and the values of GIFTI shape or
    func files at their vertices.

    InputError for invalid files, more than one array in a file, another number of
    values than of vertices, NaN and infinite values, STL surfaces, which do not number
    vertices, and other hemispheres than the surface's.
    """
    sides = SIDES if len(paths) == 2 else (None,)
    pieces = [
        _surface_map(*files)
        for files in zip(
            paths,
            surface_paths,
            sides,
            strict=True,
        )
    ]
    return merged(*(surface for surface, _ in pieces)), np.concatenate(
        [values for _, values in pieces]
    )


def read_vertex_arrays(path: AnyPath) -> tuple[list[NDArray], str | None]:
    """Return the arrays of values at vertices of any GIFTI file, and the structure that
    it names, or None."""
    image = _load_gifti(path)
    return [array.data for array in image.darrays], _structure_of(image, path)


def _load_gifti(path: AnyPath) -> GiftiImage:
    """Return the image of a GIFTI file; InputError where it is missing, truncated or of
    another kind."""
    with reading(path, "GIFTI", "a whole .gii file"):
        image = nib.load(path)
    if not isinstance(image, GiftiImage):
        raise InputError(
            "is not a GIFTI file",
            path=path,
            found=type(image).__name__,
            expected="a .gii file",
        )
    return image


def _structure_of(image: GiftiImage, path: AnyPath) -> str | None:
    """Return the structure that a GIFTI file names, in its arrays, as a whole or in its
    name, or None."""
    named = (
        meta.get("AnatomicalStructurePrimary")
        for meta in (*(array.meta for array in image.darrays), image.meta)
    )
    return next(filter(None, named), None) or _structure_in_name(path)


def _read_gifti_surface(path: Path) -> RawSurface:
    image = _load_gifti(path)
    points = image.get_arrays_from_intent("NIFTI_INTENT_POINTSET")
    triangles = image.get_arrays_from_intent("NIFTI_INTENT_TRIANGLE")
    if len(points) != 1 or len(triangles) != 1:
        raise InputError(
            "holds no surface",
            path=path,
            found=f"{len(points)} arrays of points, {len(triangles)} of triangles",
            expected="one of each (.surf.gii)",
        )
    matrix, space = _to_scanner_space(_coordinate_systems(path), path)
    if space is None:
        _warn_of_tkr_ras(points[0].meta, path)
    vertices = np.asarray(points[0].data, dtype=float)
    # other shapes are refused by the caller
    if vertices.shape[1:] == (3,):
        vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return vertices, np.asarray(triangles[0].data), space, _structure_of(image, path)


def _read_with_trimesh(path: Path) -> RawSurface:
    # VTK's readers of these formats crash on damaged PLY files and do not triangulate
    # polygons
    import trimesh

    # process=True joins equal vertices: STL stores each corner of each face
    is_stl = path.suffix.lower() == ".stl"
    _require_all_lines(path)
    body = trimesh.load_mesh(path, process=is_stl)
    vertices = np.asarray(body.vertices, dtype=float)
    faces = np.asarray(body.faces)
    return vertices, faces, None, None


PLY_HEADER = re.compile(rb"ply\s.*?format\s+ascii.*?end_header\r?\n?", re.DOTALL)
PLY_ELEMENT = re.compile(rb"^element\s+\w+\s+(\d+)", re.MULTILINE)
OFF_HEADER = re.compile(rb"\w*OFF\s+(\d+)\s+(\d+)\s+\d+", re.IGNORECASE)
COMMENT = re.compile(rb"#[^\r\n]*")


def _require_all_lines(path: Path) -> None:
    """Raise InputError if a PLY or OFF file of text has fewer lines than its header
    specifies: one for each vertex, face or other element.

    Trimesh takes such a file for a surface with fewer faces.
    """
    content = path.read_bytes()
    ending = path.suffix.lower()
    counts: list[bytes] = []
    if ending == ".ply":
        head = PLY_HEADER.match(content)
        counts = PLY_ELEMENT.findall(head[0]) if head else []
    elif ending == ".off":
        content = COMMENT.sub(b"", content)
        head = OFF_HEADER.match(content)
        counts = list(head.groups()) if head else []
    else:
        return
    if head is None:
        return
    expected = sum(map(int, counts))
    lines = [line for line in content[head.end() :].splitlines() if line.strip()]
    if len(lines) < expected:
        raise InputError(
            "is shorter than its header specifies",
            path=path,
            found=f"{len(lines)} lines of vertices and faces",
            expected=expected,
            remedy=AGAIN,
        )


MNI_OBJ = re.compile(rb"\s*P\s+[\d.]")
"""Start of a text file of triangles as CIVET's, whose name also ends in .obj."""


def _read_obj(path: Path) -> RawSurface:
    """Return vertices and faces of a Wavefront file or of a text file of the MNI."""
    with path.open("rb") as file:
        start = file.read(START_BYTES)
    if start.startswith(b"p") and b"\0" in start:
        raise InputError(
            "is a binary .obj file of the MNI",
            path=path,
            expected="its form as text, or another format such as GIFTI",
        )
    return _read_mni_obj(path) if MNI_OBJ.match(start) else _read_wavefront(path)


def _read_wavefront(path: Path) -> RawSurface:
    """Return the vertices of a Wavefront file, in its order, and its faces as
    triangles.

    Trimesh would give a vertex with several normals or texture coordinates once for
    each.
    """
    points: list[list[str]] = []
    faces: list[tuple[int, int, int]] = []
    text = path.read_text(encoding="utf-8", errors="replace").replace("\\\n", " ")
    for line in text.splitlines():
        kind, *words = line.split() or [""]
        if kind == "v":
            points.append(words[:3])
        elif kind == "f":
            first, *others = (_corner(word, len(points)) for word in words)
            for second, third in itertools.pairwise(others):
                faces.append((first, second, third))
    vertices = np.array(points, dtype=float)
    return vertices, np.array(faces, dtype=np.int64), None, None


def _corner(word: str, n_points: int) -> int:
    """Return the vertex of a corner such as `5/2/7`; negative numbers count from the
    last vertex so far."""
    number = int(word.partition("/")[0])
    return number + n_points if number < 0 else number - 1


def _read_mni_obj(path: Path) -> RawSurface:
    """Return vertices and faces of a text file of the MNI (BICPL's polygons).

    After `P`, five properties of light and the number of points follow the points,
    their normals, the number of faces, colours, the end of each face in the list of
    corners, and that list.
    """
    words = path.read_text(encoding="ascii").split()
    n_points = int(words[6])
    points = np.array(
        words[7 : 7 + 3 * n_points],
        dtype=float,
    ).reshape(n_points, 3)
    place = 7 + 6 * n_points
    n_faces, coloured_by = int(words[place]), words[place + 1]
    n_colours = {"0": 1, "1": n_faces, "2": n_points}[coloured_by]
    place += 2 + 4 * n_colours
    ends = np.array(
        words[place : place + n_faces],
        dtype=np.int64,
    )
    if not np.array_equal(
        ends,
        3 * np.arange(1, n_faces + 1),
    ):
        raise InputError(
            "has faces that are no triangles",
            path=path,
            expected="three corners of each face",
        )
    place += n_faces
    corners = np.array(
        words[place : place + 3 * n_faces],
        dtype=np.int64,
    )
    return points, corners.reshape(n_faces, 3), None, None


def read_pose(path: AnyPath) -> Pose:
    """Read the pose in a `surface.json`."""
    return pose_from(read_json(path)["pose"])


def connectivity(path: Path) -> tuple[int, int, str]:
    """Return a surface file's numbers of vertices and triangles, and a digest of the
    triangles in any order."""
    written = None
    if path.exists():
        facts = path.stat()
        written = (facts.st_mtime_ns, facts.st_size)
    return _connectivity(path, written)


@cache
def _connectivity(path: Path, _: tuple[int, int] | None) -> tuple[int, int, str]:
    mesh = read_surface(path)
    triangles = np.sort(mesh.faces, axis=1)
    triangles = triangles[np.lexsort(triangles.T)]
    return (
        len(mesh.vertices),
        len(mesh.faces),
        hashlib.sha256(triangles.tobytes()).hexdigest(),
    )


UNNAMED = ("", "???", "unknown", "Unknown", "none")
"""Names in label tables for vertices without a region."""


def read_vertex_labels(
    path: AnyPath, side: str | None = None
) -> tuple[Ints, dict[int, str]]:
    """Return the (n,) labels of a GIFTI label file and the names of its table, without
    those of no region.

    InputError for other files, non-integer values, and the other hemisphere than
    `side`.
    """
    image = _load_gifti(path)
    _require_side(path, _structure_of(image, path), side)
    arrays = image.darrays
    if len(arrays) != 1 or arrays[0].data.ndim != 1:
        shapes = ", ".join(str(array.data.shape) for array in arrays) or "no arrays"
        raise InputError(
            "is not a label file",
            path=path,
            found=shapes,
            expected="one label for each vertex (.label.gii)",
        )
    values = np.asarray(arrays[0].data)
    require_finite(values, path, "labels", "vertices")
    labels = np.rint(values).astype(np.int64)
    if np.abs(values - labels).max(initial=0.0) > 1e-3:
        raise InputError("contains non-integer values", path=path, expected="labels")
    names = {
        int(key): str(name).strip()
        for key, name in image.labeltable.get_labels_as_dict().items()
    }
    return labels, {
        key: name
        for key, name in names.items()
        if key != NO_REGION and name not in UNNAMED
    }


def write_vertex_labels(
    path: AnyPath,
    labels: NDArray[np.integer],
    names: Mapping[int, str],
    structure: Structure | None = None,
) -> None:
    """Write (n,) labels, 0 for no region, with their names as a GIFTI label file
    (.label.gii)."""
    table = GiftiLabelTable()
    for number, name in {NO_REGION: "???", **names}.items():
        colour = (
            "#FFFFFF"
            if number == NO_REGION
            else DISTINCT_COLOURS[(number - 1) % len(DISTINCT_COLOURS)]
        )
        red, green, blue = (value / 255 for value in bytes.fromhex(colour[1:]))
        entry = GiftiLabel(
            key=int(number),
            red=red,
            green=green,
            blue=blue,
            alpha=float(number != NO_REGION),
        )
        entry.label = name  # type: ignore[attr-defined]
        table.labels.append(entry)
    array = GiftiDataArray(
        np.asarray(labels, dtype=np.int32),
        intent="NIFTI_INTENT_LABEL",
        meta=GiftiMetaData({"Name": "regions"}),
    )
    with atomic_write(path) as temporary:
        nib.save(
            GiftiImage(
                darrays=[array],
                labeltable=table,
                meta=GiftiMetaData(_named(structure)),
            ),
            temporary,
        )


UNKNOWN = "NIFTI_XFORM_UNKNOWN"
SCANNER = "NIFTI_XFORM_SCANNER_ANAT"
SUBJECT_SPACES = (SCANNER, "NIFTI_XFORM_ALIGNED_ANAT")
RIGID = 1e-3
C_RAS = ("VolGeomC_R", "VolGeomC_A", "VolGeomC_S")
"""FreeSurfer's metadata of points in GIFTI: where the centre of their volume is in
scanner space, in mm."""


def _coordinate_systems(path: AnyPath) -> list[System]:
    # all of them, in the file's order: nibabel keeps one only
    with nib.openers.ImageOpener(str(path), "rb") as stream:
        root = ElementTree.parse(stream).getroot()
    systems: list[System] = []
    elements: list[ElementTree.Element] = []
    for array in root.iter("DataArray"):
        if array.get("Intent") in ("NIFTI_INTENT_POINTSET", "1008"):
            elements += array.iter("CoordinateSystemTransformMatrix")
    for element in elements:
        numbers = (element.findtext("MatrixData") or "").split()
        data, to = (
            (element.findtext(tag) or UNKNOWN).strip()
            for tag in ("DataSpace", "TransformedSpace")
        )
        try:
            matrix = np.array(numbers, dtype=float).reshape(4, 4)
        except ValueError as error:
            raise InputError(
                "has an invalid coordinate-system matrix",
                path=path,
                found=f"{len(numbers)} entries",
            ) from error
        require_finite(matrix, path, "entries in a coordinate system", "rows")
        systems.append((data, to, matrix))
    return systems


def _to_scanner_space(
    systems: list[System], path: AnyPath
) -> tuple[Floats, str | None]:
    """Return the (4, 4) matrix that brings coordinates to scanner space, and the space
    they are in then.

    A rigid matrix into scanner or aligned space is applied; others, as to MNI space of
    other size, are logged. InputError for matrices into scanner space that change
    sizes.
    """
    moving = [
        system
        for system in systems
        if not np.allclose(
            system[2],
            np.eye(4),
            atol=1e-6,
        )
    ]
    space = next(
        (data for data, _, _ in systems if data in SUBJECT_SPACES),
        None,
    )
    if space is not None:
        for _, to, _ in moving:
            log.warning(
                "%s: the coordinates are in %s already; its matrix to %s was not"
                " applied",
                path,
                space,
                to,
            )
        return np.eye(4), space
    into_subject = (system for system in moving if system[1] in SUBJECT_SPACES)
    for data, to, matrix in sorted(
        into_subject, key=lambda system: SUBJECT_SPACES.index(system[1])
    ):
        rigid = np.allclose(
            matrix[:3, :3] @ matrix[:3, :3].T,
            np.eye(3),
            atol=RIGID,
        )
        if not rigid or np.linalg.det(matrix[:3, :3]) < 0:
            raise InputError(
                f"has a coordinate-system matrix from {data} to {to} that changes sizes"
                " or mirrors",
                path=path,
                found=f"\n{matrix}\n",
                expected="a rigid motion",
            )
        log.warning(
            "%s: the coordinate-system matrix of the file was applied, to %s", path, to
        )
        return matrix, to
    for _, to, matrix in moving:
        size = np.cbrt(abs(np.linalg.det(matrix[:3, :3])))
        text = (
            "%s: its matrix to %s, which scales by %.3g, was not applied, to keep the"
            " subject's own size"
        )
        log.warning(text, path, to, size)
    if moving:
        return np.eye(4), None
    named = next(
        (to for data, to, _ in systems if UNKNOWN not in (data, to)),
        None,
    )
    return np.eye(4), named or next(
        (to for _, to, _ in systems if to in SUBJECT_SPACES), None
    )


def _warn_of_tkr_ras(metadata: Mapping[str, str], path: AnyPath) -> None:
    # FreeSurfer's converter writes the volume's centre with the points, whatever their
    # space
    try:
        centre = [float(metadata[key]) for key in C_RAS]
    except (KeyError, ValueError):
        return
    if any(abs(place) > 1e-3 for place in centre):
        text = (
            "%s: does not define its space: coordinates may be relative to the centre"
            " of FreeSurfer's volume (tkr RAS), off volumes in scanner space by C_RAS ="
            " (%g, %g, %g) mm. Before volumes of regions or maps are used with it,"
            " convert it anew with mris_convert --to-scanner"
        )
        log.warning(text, path, *centre)


REAL_RAS = b"\0\0\0\2\0\0\0\1"
"""FreeSurfer's tag, after the faces, of a surface in scanner coordinates."""


def _read_freesurfer_surface(path: Path) -> RawSurface:
    """Return vertices (mm) and faces of a FreeSurfer file such as lh.pial, their space
    and structure.

    From the volume's centre (tkr RAS) they go to scanner space by the geometry at the
    end of the file, if it is there.
    """
    # its warnings are about missing geometry, which is reported
    with warnings.catch_warnings(action="ignore", category=UserWarning):
        points, faces, info = read_geometry(str(path), read_metadata=True)
    vertices = np.asarray(points, dtype=float)
    # two lines, the numbers of vertices and faces, and these
    start = re.match(rb"[^\n]*\n[^\n]*\n", content := path.read_bytes())
    if start and content.startswith(
        REAL_RAS, start.end() + 8 + 12 * (len(vertices) + len(faces))
    ):
        return vertices, faces, SCANNER, None
    if not str(info.get("valid", "")).startswith("1") or not {
        "xras",
        "yras",
        "zras",
        "cras",
    } <= set(info):
        log.warning(
            "%s: has no volume geometry: its coordinates are relative to the volume's"
            " centre (tkr RAS)",
            path,
        )
        return vertices, faces, None, None
    axes = np.column_stack(
        [
            info["xras"],
            info["yras"],
            info["zras"],
        ]
    ).astype(float)
    # tkr RAS has the axes of a coronal volume, with columns to the left, rows down,
    # slices forward
    rotation = axes @ np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return vertices @ rotation.T + info["cras"], faces, SCANNER, None


SURFACE_READERS: dict[str, Callable[[Path], RawSurface]] = {
    "GIFTI": _read_gifti_surface,
    "VTK": lambda path: (*read_vtk(path), None, None),
    **dict.fromkeys(("STL", "PLY"), _read_with_trimesh),
    "OBJ": _read_obj,
    "OFF": _read_with_trimesh,
    "FreeSurfer": _read_freesurfer_surface,
}
"""The reader of each format of surfaces."""
