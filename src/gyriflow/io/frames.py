"""Frames of a simulation: one HDF5 file, with an XDMF file that ParaView opens as a
time series.

It has `tets` (m, 4) or (m, 10), and for each output week a group `week_21.00` with
`positions` (n, 3) in mm, fields at the vertices, and in `cell_fields` those of
elements. Positions, the basis of metrics, are in double precision, fields in single.
"""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface
from ..geometry.triangles import TriangleMesh
from ..units import week_tag
from .files import AnyPath, new_hdf5, reading_hdf5
from .tetmeshes import write_xdmf, xdmf_grid

POSITIONS = "positions"
CELL_FIELDS = "cell_fields"


def _group_name(week: float) -> str:
    return f"week_{week_tag(week)}"


def write_frame(
    path: AnyPath,
    week: float,
    vertex_fields: Mapping[str, NDArray],
    cell_fields: Mapping[str, NDArray] | None = None,
    attributes: Mapping[str, float] | None = None,
) -> None:
    """Write the frame of a gestational week to a file of its own.

    Fields at the vertices are `positions` (n, 3) in mm and further arrays (n,) or (n,
    3); those of the elements, in the order of the run's mesh, are (m,), (m, 3) or (m,
    9). `attributes` are numbers that hold for the whole frame.
    """
    with new_hdf5(path) as file:
        frame = file.create_group(_group_name(week))
        frame.attrs.update(attributes or {})
        for name, values in vertex_fields.items():
            frame[name] = values if name == POSITIONS else _single(values)
        for name, values in (cell_fields or {}).items():
            frame[f"{CELL_FIELDS}/{name}"] = _single(values)


def _single(values: NDArray) -> NDArray:
    return values.astype(np.float32) if values.dtype.kind == "f" else values


def join_frames(
    path: AnyPath,
    tets: NDArray,
    frames: Sequence[AnyPath],
) -> None:
    """Join the files of single frames of (m, 4) or (m, 10) tetrahedra, by time, into
    `path` (.h5) and a .xdmf."""
    path = Path(path)
    with new_hdf5(path) as file:
        file["tets"] = tets.astype(np.int32)
        for frame in frames:
            with _reading(frame) as source:
                for name in source:
                    source.copy(name, file)
        series = _time_series(path.name, file)
    write_xdmf(path.with_suffix(".xdmf"), series)


def _time_series(data_name: str, file: h5py.File) -> str:
    tets, grids = file["tets"], []
    for name in (name for name in file if name.startswith("week_")):
        frame, where = file[name], f"{data_name}:/{name}"
        names = set(frame) - {POSITIONS, CELL_FIELDS}
        fields = {field: (frame[field], f"{where}/{field}") for field in sorted(names)}
        cell_fields = frame.get(CELL_FIELDS, {})
        cell_data = {
            field: (values, f"{where}/{CELL_FIELDS}/{field}")
            for field, values in cell_fields.items()
        }
        cells = (tets, f"{data_name}:/tets")
        points = (frame[POSITIONS], f"{where}/{POSITIONS}")
        grids.append(
            xdmf_grid(
                name,
                cells,
                points,
                fields,
                cell_data,
                float(name.removeprefix("week_")),
            )
        )
    return (
        '<Grid Name="folding" GridType="Collection"'
        f' CollectionType="Temporal">{"".join(grids)}</Grid>'
    )


def _reading(path: AnyPath) -> AbstractContextManager[h5py.File]:
    return reading_hdf5(
        path,
        "frames of a simulation",
        "a whole HDF5 file of a run",
        "Simulate the run again.",
    )


def _weeks(file: h5py.File) -> list[float]:
    return sorted(
        float(name.removeprefix("week_")) for name in file if name.startswith("week_")
    )


def read_weeks(path: AnyPath) -> list[float]:
    """Return the gestational weeks of the frames, ascending; InputError, as of all
    readers here, for a torn file."""
    with _reading(path) as file:
        return _weeks(file)


def read_tets(path: AnyPath) -> NDArray[np.int64]:
    """Return the (m, 4) or (m, 10) tetrahedra."""
    with _reading(path) as file:
        return file["tets"][:].astype(np.int64)


def read_field(
    path: AnyPath,
    week: float,
    field: str,
) -> NDArray:
    """Return a field at a week: at the vertices (n, …) or, such as strain, of the
    elements (c, …); InputError, which names what there is, where there is none."""
    with _reading(path) as file:
        if _group_name(week) not in file:
            raise InputError(
                f"has no week {week}",
                path=path,
                found=f"weeks {_weeks(file)}",
            )
        fields = {**file[_group_name(week)]}
        fields |= fields.pop(CELL_FIELDS, {})
        if field not in fields:
            raise InputError(
                f"has no field {field} of week {week}",
                path=path,
                found=sorted(fields),
                remedy="Name it in folding.fields, and run again.",
            )
        return fields[field][:]


def read_pial_frames(
    path: AnyPath,
) -> dict[float, tuple[TriangleMesh, dict[str, NDArray]]]:
    """Return by week the outer surface of the mesh in mm, with the fields at its
    vertices by name."""
    frames: dict[float, tuple[TriangleMesh, dict[str, NDArray]]] = {}
    with _reading(path) as file:
        tets = file["tets"][:].astype(np.int64)
        for week in _weeks(file):
            values = {
                name: data[:]
                for name, data in file[_group_name(week)].items()
                if name != CELL_FIELDS
            }
            if not frames:
                surface, pial = boundary_surface(
                    TetrahedralMesh(values[POSITIONS], tets)
                )
            fields = {name: field[pial] for name, field in values.items()}
            frames[week] = (
                TriangleMesh(
                    fields.pop(POSITIONS),
                    surface.faces,
                ),
                fields,
            )
    return frames


def read_positions(path: AnyPath, week: float) -> NDArray[np.float64]:
    """Return the (n, 3) positions in mm at a week."""
    return read_field(path, week, POSITIONS)
