"""In which space the coordinates of surface files are, and how they come to scanner space; FreeSurfer's files."""

import logging
import warnings
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import nibabel as nib
import numpy as np
from nibabel.freesurfer.io import read_geometry
from numpy.typing import NDArray

from ..errors import InputError
from .files import AnyPath

log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
System = tuple[str, str, Floats]
"""A space of coordinates, the space that a matrix leads to, and the (4, 4) matrix."""

UNKNOWN = "NIFTI_XFORM_UNKNOWN"
SCANNER = "NIFTI_XFORM_SCANNER_ANAT"
SUBJECT = (SCANNER, "NIFTI_XFORM_ALIGNED_ANAT")
RIGID = 1e-3
C_RAS = ("VolGeomC_R", "VolGeomC_A", "VolGeomC_S")
"""FreeSurfer's metadata of points in GIFTI: where the centre of their volume is in scanner space, in mm."""


def coordinate_systems(path: AnyPath) -> list[System]:
    """Returns the coordinate systems of the points of a GIFTI file, all of them, in the file's order.

    nibabel keeps one only. InputError where a matrix has not 16 finite numbers.
    """
    opener = nib.openers.ImageOpener(str(path), "rb")
    with opener as stream:
        root = ElementTree.parse(stream).getroot()
    found: list[System] = []
    for array in root.iter("DataArray"):
        if array.get("Intent") not in ("NIFTI_INTENT_POINTSET", "1008"):
            continue
        for element in array.iter("CoordinateSystemTransformMatrix"):
            numbers = (element.findtext("MatrixData") or "").split()
            spaces = [(element.findtext(tag) or UNKNOWN).strip() for tag in ("DataSpace", "TransformedSpace")]
            try:
                matrix = np.array(numbers, dtype=float).reshape(4, 4)
            except ValueError as error:
                raise InputError(
                    "has a coordinate system that is no matrix", path=path, found=f"{len(numbers)} entries"
                ) from error
            if not np.isfinite(matrix).all():
                raise InputError("has a coordinate system with NaN or infinite entries", path=path, found=matrix)
            found.append((spaces[0], spaces[1], matrix))
    return found


def to_scanner_space(systems: list[System], path: AnyPath) -> tuple[Floats, str | None]:
    """Returns the (4, 4) matrix that brings coordinates to scanner space, and the space they are in then.

    A rigid matrix into scanner or aligned space is applied. None is where the coordinates are in one of these already.
    Those that lead to Talairach or MNI space are not, since these have other sizes; each that is not applied is logged.
    The space is None where the file does not say it. InputError for matrices into scanner space that change sizes, and
    for coordinates in Talairach or MNI space that a matrix leads out of.
    """
    nothing = np.eye(4)
    moving = [system for system in systems if not np.allclose(system[2], np.eye(4), atol=1e-6)]
    own = next((data for data, _, _ in systems if data in SUBJECT), None)
    if own is not None:
        for _, to, _ in moving:
            log.warning("%s: the coordinates are in %s already; its matrix to %s was not applied", path, own, to)
        return nothing, own
    for space in SUBJECT:
        for data, to, matrix in moving:
            if to != space:
                continue
            rigid = np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=RIGID)
            if not rigid or np.linalg.det(matrix[:3, :3]) < 0:
                raise InputError(
                    f"has a coordinate-system matrix from {data} to {to} that changes sizes or mirrors",
                    path=path,
                    found=f"\n{matrix}\n",
                    expected="a rigid motion",
                    remedy="Give the surface in the coordinates of its scanner.",
                )
            log.warning("%s: the coordinate-system matrix of the file was applied, to %s", path, to)
            return matrix, to
    for _, to, matrix in moving:
        size = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
        log.warning(
            "%s: its matrix to %s, which scales by %.3g, was not applied: sizes are the subject's own", path, to, size
        )
    if moving:
        return nothing, None
    named = next((to for data, to, _ in systems if UNKNOWN not in (data, to)), None)
    return nothing, named or next((to for _, to, _ in systems if to in SUBJECT), None)


def warn_of_tkr_ras(metadata: Mapping[str, str], path: AnyPath) -> None:
    """Warns where points whose space a file does not say may be relative to the centre of a volume (tkr RAS).

    `metadata` are those of the points. FreeSurfer's converter gives the volume's centre there, whichever space it
    writes the points in.
    """
    try:
        centre = [float(metadata[key]) for key in C_RAS]
    except (KeyError, ValueError):
        return
    if any(abs(place) > 1e-3 for place in centre):
        log.warning(
            "%s: does not say the space of its coordinates: they may be relative to the centre of FreeSurfer's volume "
            "(tkr RAS), off volumes in scanner space by C_RAS = (%g, %g, %g) mm. Before volumes of regions or maps are "
            "used with it, convert it anew with mris_convert --to-scanner",
            path,
            *centre,
        )


def freesurfer_space(path: AnyPath) -> str | None:
    """Returns the space that a FreeSurfer surface is read in: scanner space, or None where it lacks its volume."""
    return SCANNER if _volume(path)[2] is not None else None


def read_freesurfer_surface(path: AnyPath) -> tuple[Floats, NDArray[np.int64]]:
    """Returns vertices (mm) and faces of FreeSurfer's own kind of file, such as lh.pial, in scanner space.

    Its coordinates are relative to the centre of a volume (tkr RAS), whose geometry is at the end of the file.
    Without it they stay relative to that centre, and a warning says so. InputError for any other kind of file.
    """
    vertices, faces, matrix = _volume(path)
    if matrix is None:
        log.warning("%s: says nothing of its volume: the coordinates are relative to its centre (tkr RAS)", path)
        return vertices, faces
    return vertices @ matrix[:3, :3].T + matrix[:3, 3], faces


def _volume(path: AnyPath) -> tuple[Floats, NDArray[np.int64], Floats | None]:
    """Returns vertices, faces and the (4, 4) matrix to scanner space, or None where the file does not say it."""
    try:
        with warnings.catch_warnings():
            # about missing geometry, which is reported below
            warnings.simplefilter("ignore", UserWarning)
            vertices, faces, info = read_geometry(str(path), read_metadata=True)
    except FileNotFoundError as error:
        raise InputError("no such file", path=path, expected="a surface") from error
    except Exception as error:  # nibabel's reader runs into what a file of another kind holds
        raise InputError(
            f"cannot be read as a surface: {error}",
            path=path,
            found=f"a file named {Path(path).name}",
            expected=".surf.gii, .vtk, .vtp, .stl, .ply, .obj, or FreeSurfer's own binary kind, such as lh.pial",
            remedy="The file may be truncated or of another kind: copy or export it again.",
        ) from error
    vertices, faces = np.asarray(vertices, dtype=float), np.asarray(faces, dtype=np.int64)
    if not len(vertices) or not len(faces):
        raise InputError("holds no surface", path=path, found=f"{len(vertices)} vertices, {len(faces)} faces")
    if not str(info.get("valid", "")).startswith("1") or not {"xras", "yras", "zras", "cras"} <= set(info):
        return vertices, faces, None
    axes = np.column_stack([info["xras"], info["yras"], info["zras"]]).astype(float)
    matrix = np.eye(4)
    # tkr RAS has the axes of a coronal volume, with columns to the left, rows down, slices forward
    matrix[:3, :3] = axes @ np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    matrix[:3, 3] = info["cras"]
    return vertices, faces, matrix
