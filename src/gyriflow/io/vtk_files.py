"""Surfaces in VTK files, read in a process of its own, since VTK's readers may crash on
damaged files."""

import io
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

LEGACY_SURFACE = re.compile(
    rb"# vtk DataFile[^\n]*\n[^\n]*\n\s*BINARY\s+DATASET\s+POLYDATA"
    rb"\s+POINTS\s+(\d+)\s+(float|double)\s*?\n"
)
LEGACY_POLYGONS = re.compile(rb"\s*POLYGONS\s+(\d+)\s+(\d+)\s*?\n")


def read_vtk(path: Path) -> tuple[NDArray, NDArray]:
    """Return (n, 3) points and (m, 3) triangles of a VTK surface (.vtk, .vtp);
    InputError for other content."""
    if arrays := _little_endian_surface(path.read_bytes()):
        return arrays
    process = subprocess.run(
        [sys.executable, "-m", __name__, str(path)],
        capture_output=True,
        check=False,
        env=os.environ
        | {
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            "PYTHONSAFEPATH": "1",
        },
    )
    if process.returncode:
        *_, words = [
            f"VTK's reader ended with code {process.returncode}",
            *process.stderr.decode().splitlines(),
        ]
        raise InputError(
            "holds no surface of triangles alone",
            path=path,
            found=words,
            expected="triangles (PolyData)",
            remedy=(
                "Save its surface as triangles, for example with ParaView (Extract"
                " Surface, Triangulate). The file may also be truncated."
            ),
        )
    with np.load(io.BytesIO(process.stdout)) as arrays:
        return arrays["points"], arrays["faces"]


def _little_endian_surface(content: bytes) -> tuple[NDArray, NDArray] | None:
    """Return the arrays of a legacy file in little-endian order, as MRtrix writes it
    against the rules, or None."""
    head = LEGACY_SURFACE.match(content)
    if head is None:
        return None
    number = np.dtype("<f4" if head[2] == b"float" else "<f8")
    n_coordinates = 3 * int(head[1])
    end = head.end() + n_coordinates * number.itemsize
    polygons = LEGACY_POLYGONS.match(content, end)
    if polygons is None:
        return None
    n_faces = int(polygons[1])
    n_numbers = int(polygons[2])
    if n_numbers != 4 * n_faces:
        return None
    points = np.frombuffer(content, number, n_coordinates, head.end())
    numbers = np.frombuffer(content, "<i4", n_numbers, polygons.end())
    cells = numbers.reshape(-1, 4)
    if (cells[:, 0] != 3).any():
        return None
    return points.reshape(-1, 3), cells[:, 1:]


def _holds_triangles_alone(data: Any) -> bool:
    if data is None or data.GetClassName() != "vtkPolyData":
        return False
    faces = data.GetPolys()
    is_triangular = data.GetNumberOfPoints() > 0 and faces.IsHomogeneous() == 3
    return is_triangular and faces.GetNumberOfCells() == data.GetNumberOfCells()


def _in_words(data: Any) -> str:
    """Return what a file holds instead of triangles."""
    if data is None:
        return "nothing"
    kind = data.GetClassName().removeprefix("vtk")
    if kind != "PolyData":
        return kind
    offsets = data.GetPolys().GetOffsetsArray()
    corners = np.diff([offsets.GetValue(n) for n in range(offsets.GetNumberOfTuples())])
    counts = {
        "points": data.GetNumberOfPoints(),
        "faces with other than three corners": int((corners != 3).sum()),
        "strips of triangles": data.GetNumberOfStrips(),
        "lines": data.GetNumberOfLines(),
        "single points": data.GetNumberOfVerts(),
    }
    found = [f"{count} {name}" for name, count in counts.items() if count]
    return ", ".join(found) or "nothing"


def _send_surface(path: str) -> None:
    output = os.dup(1)
    os.dup2(2, 1)  # what VTK prints must not mix with the arrays
    # pyvista would take half a second more
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOLegacy import vtkDataSetReader
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    is_xml = path.lower().endswith(".vtp")
    reader = vtkXMLPolyDataReader() if is_xml else vtkDataSetReader()
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutputDataObject(0)
    # VTK may crash on damaged cells, so these are read without its filters
    if not _holds_triangles_alone(data):
        sys.exit(_in_words(data))
    sent = io.BytesIO()
    corners = vtk_to_numpy(data.GetPolys().GetConnectivityArray())
    np.savez(
        sent,
        points=vtk_to_numpy(data.GetPoints().GetData()),
        faces=corners.reshape(-1, 3),
    )
    with os.fdopen(output, "wb") as stream:
        stream.write(sent.getvalue())


if __name__ == "__main__":
    _send_surface(sys.argv[1])
