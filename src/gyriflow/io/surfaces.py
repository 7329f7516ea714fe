"""Triangle surfaces (GIFTI, VTK, STL, PLY, OBJ, FreeSurfer) and per-vertex maps (GIFTI), in mm."""

from pathlib import Path
from typing import Any, Literal

import nibabel as nib
import numpy as np
import pyvista as pv
import trimesh
from nibabel.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage, GiftiMetaData
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import TriangleMesh, is_closed
from ..parameters.terms import Side
from .files import AnyPath, replaced
from .spaces import coordinate_systems, freesurfer_space, read_freesurfer_surface, to_scanner_space, warn_of_tkr_ras

Structure = Literal["CortexLeft", "CortexRight", "Cortex"]
STRUCTURES: dict[str, Structure] = {"left": "CortexLeft", "right": "CortexRight"}
"""What GIFTI calls the hemispheres."""
MESH_SUFFIXES = (".stl", ".ply", ".obj")
VTK_SUFFIXES = (".vtk", ".vtp")
SURFACE_KINDS = (".surf.gii", *MESH_SUFFIXES, *VTK_SUFFIXES, "FreeSurfer's lh.pial")
FREESURFER_SIDES = {"lh": "CortexLeft", "rh": "CortexRight"}
AGAIN = "The file may be truncated or of another kind: copy or export it again."


def read_surface(path: AnyPath) -> TriangleMesh:
    """Returns the surface of a GIFTI, VTK, STL, PLY, OBJ or FreeSurfer file, in the order of corners of the file.

    Coordinates are the file's; where a GIFTI or FreeSurfer file says how they lie in scanner space, they are brought
    there (`gyriflow.io.spaces`). InputError for missing, truncated or empty files, NaN or infinite coordinates, faces
    that name missing vertices, and coordinates that are not those of the subject.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("no such file", path=path, expected=f"a surface ({', '.join(SURFACE_KINDS)})")
    suffix = path.suffix.lower()
    if suffix in MESH_SUFFIXES:
        vertices, faces = _read_with_trimesh(path)
    elif suffix in VTK_SUFFIXES:
        vertices, faces = _read_with_pyvista(path)
    elif _is_gifti(path):
        vertices, faces = _read_gifti_surface(path)
    else:
        vertices, faces = read_freesurfer_surface(path)
    if vertices.ndim != 2 or faces.ndim != 2 or vertices.shape[1] != 3 or faces.shape[1] != 3 or not faces.size:
        raise InputError(
            "holds no surface",
            path=path,
            found=f"points of shape {vertices.shape}, faces of shape {faces.shape}",
            expected="three coordinates for each point and three corners for each face",
            remedy=AGAIN,
        )
    bad = int(np.count_nonzero(~np.isfinite(vertices).all(axis=1)))
    if bad:
        raise InputError("has NaN or infinite coordinates", path=path, found=f"{bad} vertices", expected="none")
    if not (np.isfinite(faces).all() and 0 <= faces.min() <= faces.max() < len(vertices)) or (
        np.abs(faces - np.rint(faces)).max() > 1e-3
    ):
        raise InputError(
            "has faces that name vertices which do not exist",
            path=path,
            found=f"indices {faces.min():.6g} to {faces.max():.6g}",
            expected=f"whole numbers from 0 to {len(vertices) - 1}",
        )
    return TriangleMesh(vertices, np.rint(faces).astype(np.int64))


def declared(path: AnyPath) -> tuple[str | None, str | None]:
    """Returns what a surface's file says of itself: the space its coordinates are read in, and its structure.

    Both are None where it does not say so. The space is a NIfTI transform code's name, such as
    "NIFTI_XFORM_SCANNER_ANAT", the structure such as "CortexLeft".
    """
    if Path(path).suffix.lower() in (*MESH_SUFFIXES, *VTK_SUFFIXES):
        return None, None
    structure = _structure(path)
    if not _is_gifti(path):
        return freesurfer_space(path), structure
    return to_scanner_space(coordinate_systems(path), path)[1], structure


def read_hemispheres(left: AnyPath, right: AnyPath) -> tuple[TriangleMesh, TriangleMesh, bool]:
    """Returns the surfaces of two hemispheres, and whether both files name one and the same coordinate system.

    InputError as for `read_surface`, and where a file names the other hemisphere as its structure.
    """
    meshes = read_one_hemisphere(left, "left"), read_one_hemisphere(right, "right")
    spaces = [declared(path)[0] for path in (left, right)]
    return *meshes, spaces[0] is not None and len(set(spaces)) == 1


def read_one_hemisphere(path: AnyPath, side: Side) -> TriangleMesh:
    """Returns the surface of a hemisphere; InputError as for `read_surface`, and where its file names the other one."""
    found, expected = _structure(path), STRUCTURES[side]
    if found in STRUCTURES.values() and found != expected:
        raise InputError(
            "is of the other hemisphere",
            path=path,
            found=found,
            expected=expected,
            remedy="Swap `left` and `right`, or set the other `side`, in the configuration; or mend what the file says "
            "of itself (AnatomicalStructurePrimary, lh or rh in its name), if that is wrong.",
        )
    return read_surface(path)


def write_surface(path: AnyPath, mesh: TriangleMesh, structure: Structure | None = None) -> None:
    """Writes a surface as GIFTI (float32, int32, RAS+ mm), STL (binary) or PLY, by the suffix of `path`."""
    suffix = Path(path).suffix.lower()
    if suffix in MESH_SUFFIXES:
        body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        with replaced(path) as temporary:
            body.export(temporary)
        return
    if suffix != ".gii":
        raise InputError("unknown kind of surface file", path=path, expected=".gii, .stl, .ply or .obj")
    meta = {"GeometricType": "Anatomical"} | ({"AnatomicalStructurePrimary": structure} if structure else {})
    points = GiftiDataArray(
        mesh.vertices.astype(np.float32),
        intent="NIFTI_INTENT_POINTSET",
        coordsys=GiftiCoordSystem("NIFTI_XFORM_SCANNER_ANAT", "NIFTI_XFORM_SCANNER_ANAT", np.eye(4)),
        meta=GiftiMetaData(meta),
    )
    triangles = GiftiDataArray(
        mesh.faces.astype(np.int32),
        intent="NIFTI_INTENT_TRIANGLE",
        meta=GiftiMetaData({"TopologicalType": "Closed" if is_closed(mesh) else "Open"}),
    )
    with replaced(path) as temporary:
        nib.save(GiftiImage(darrays=[points, triangles]), temporary)


def write_brain(files: Any, whole: TriangleMesh, left: TriangleMesh | None, right: TriangleMesh | None) -> None:
    """Writes a brain's pial surface and its hemispheres, None for one that is not there.

    Parameters
    ----------
    files
        Paths as `whole` and, by their names, those of the hemispheres that are there, and as `get("stl")` one for the
        whole too, if it is given.
    """
    write_surface(files.whole, whole)
    for side, mesh in (("left", left), ("right", right)):
        if mesh is not None:
            write_surface(files[side], mesh, STRUCTURES[side])
    if stl := files.get("stl"):
        write_surface(stl, whole)


def write_vertex_maps(path: AnyPath, maps: dict[str, NDArray], structure: Structure | None = None) -> None:
    """Writes named (n,) per-vertex values as a GIFTI shape file (.shape.gii, float32)."""
    arrays = [
        GiftiDataArray(np.asarray(values, np.float32), intent="NIFTI_INTENT_SHAPE", meta=GiftiMetaData({"Name": name}))
        for name, values in maps.items()
    ]
    meta = GiftiMetaData({"AnatomicalStructurePrimary": structure} if structure else {})
    with replaced(path) as temporary:
        nib.save(GiftiImage(darrays=arrays, meta=meta), temporary)


def read_vertex_maps(path: AnyPath) -> dict[str, NDArray[np.float64]]:
    """Returns the named per-vertex values of a GIFTI shape file."""
    image = load_gifti(path)
    return {
        array.meta.get("Name") or f"map {number}": np.asarray(array.data, dtype=float)
        for number, array in enumerate(image.darrays)
    }


def load_gifti(path: AnyPath) -> GiftiImage:
    """Returns the image of a GIFTI file; InputError where it is missing, truncated or of another kind."""
    try:
        image = nib.load(path)
    except FileNotFoundError as error:
        raise InputError("no such file", path=path, expected="a GIFTI file") from error
    except Exception as error:  # nibabel's reader raises whatever a torn file leads it into
        raise InputError(
            f"cannot be read as GIFTI: {error}",
            path=path,
            expected="a whole .gii file",
            remedy="The file may be truncated or of another kind: copy or download it again.",
        ) from error
    if not isinstance(image, GiftiImage):
        raise InputError("is not a GIFTI file", path=path, found=type(image).__name__, expected="a .gii file")
    return image


def _is_gifti(path: AnyPath) -> bool:
    return Path(path).suffix.lower() == ".gii" or Path(path).name.endswith(".gii.gz")


def _structure(path: AnyPath) -> str | None:
    """Returns the structure that a surface's file names, such as "CortexLeft"; None where it names none."""
    if Path(path).suffix.lower() in (*MESH_SUFFIXES, *VTK_SUFFIXES):
        return None
    if not _is_gifti(path):
        return FREESURFER_SIDES.get(Path(path).name.split(".")[0])
    image = load_gifti(path)
    points = image.get_arrays_from_intent("NIFTI_INTENT_POINTSET")
    if not points:
        return None
    found: str | None = points[0].meta.get("AnatomicalStructurePrimary") or image.meta.get("AnatomicalStructurePrimary")
    return found


def _read_gifti_surface(path: Path) -> tuple[NDArray[np.float64], NDArray]:
    image = load_gifti(path)
    points = image.get_arrays_from_intent("NIFTI_INTENT_POINTSET")
    triangles = image.get_arrays_from_intent("NIFTI_INTENT_TRIANGLE")
    if len(points) != 1 or len(triangles) != 1 or not len(points[0].data) or not len(triangles[0].data):
        raise InputError(
            "holds no surface",
            path=path,
            found=f"{len(points)} arrays of points, {len(triangles)} of triangles",
            expected="one of each (.surf.gii)",
        )
    vertices = np.asarray(points[0].data, dtype=float)
    matrix, space = to_scanner_space(coordinate_systems(path), path)
    if space is None:
        warn_of_tkr_ras(points[0].meta, path)
    return vertices @ matrix[:3, :3].T + matrix[:3, 3], np.asarray(triangles[0].data)


def _read_with_pyvista(path: Path) -> tuple[NDArray[np.float64], NDArray]:
    try:
        data = pv.read(path)
    except Exception as error:  # VTK's readers raise whatever their parsing runs into
        raise InputError(f"cannot be read as VTK: {error}", path=path, remedy=AGAIN) from error
    if not isinstance(data, pv.UnstructuredGrid | pv.PolyData) or not data.n_points or not data.n_cells:
        raise InputError("holds no surface", path=path, found=type(data).__name__, expected="polygons (PolyData)")
    _require_sound_cells(data, path)
    surface = data.extract_surface(algorithm=None) if isinstance(data, pv.UnstructuredGrid) else data
    surface = surface.triangulate()
    return np.asarray(surface.points, dtype=float), np.asarray(surface.regular_faces)


def _require_sound_cells(data: pv.UnstructuredGrid | pv.PolyData, path: Path) -> None:
    """Raises InputError where cells name points that are not there, on which VTK's filters end the whole process."""
    arrays = [data.GetCells()] if isinstance(data, pv.UnstructuredGrid) else []
    if isinstance(data, pv.PolyData):
        arrays = [data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()]
    for cells in arrays:
        corners, starts = (pv.convert_array(array) for array in (cells.GetConnectivityArray(), cells.GetOffsetsArray()))
        named = len(corners) == 0 or 0 <= corners.min() <= corners.max() < data.n_points
        whole = len(starts) == 0 or (
            starts[0] == 0 and starts[-1] == len(corners) and np.all(np.diff(starts.astype(np.int64)) >= 0)
        )
        if not (named and whole):
            raise InputError(
                "has cells that name points which do not exist",
                path=path,
                found=f"points {corners.min()} to {corners.max()}" if len(corners) else "cells without points",
                expected=f"0 to {data.n_points - 1}",
                remedy=AGAIN,
            )
    wrong = int(np.count_nonzero(~np.isfinite(np.asarray(data.points)).all(axis=1)))
    if wrong:
        raise InputError("has NaN or infinite coordinates", path=path, found=f"{wrong} vertices", expected="none")


def _read_with_trimesh(path: Path) -> tuple[NDArray[np.float64], NDArray]:
    try:
        # process=True joins equal vertices: STL stores each corner of each face
        body = trimesh.load_mesh(path, process=path.suffix.lower() == ".stl")
        vertices, faces = np.asarray(body.vertices, dtype=float), np.asarray(body.faces)
    except Exception as error:  # trimesh's readers raise whatever their parsing runs into
        raise InputError(
            f"cannot be read as {path.suffix}: {error}",
            path=path,
            remedy=AGAIN,
        ) from error
    if not len(vertices) or not len(faces):
        raise InputError("holds no surface", path=path, found=f"{len(vertices)} vertices, {len(faces)} faces")
    return vertices, faces
