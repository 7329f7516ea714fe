"""The frames of a folding run: one HDF5 file, with an XDMF file beside it that ParaView opens as a time series.

Layout of the HDF5 file: `tets` (m, 4); per output week a group `week_21.00` with `positions` (n, 3) in mm and fields.
"""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..units import week_tag
from .files import replaced
from .hdf5 import new_hdf5
from .tetmeshes import attribute, document, geometry, topology


def group_name(week: float) -> str:
    """Returns the name of the group of a week."""
    return f"week_{week_tag(week)}"


def write_frame(path: str | PathLike[str], week: float, fields: Mapping[str, NDArray]) -> None:
    """Writes one frame to a file of its own; `fields` holds `positions` (n, 3) in mm and further arrays by name."""
    with new_hdf5(path) as file:
        for name, values in fields.items():
            file[f"{group_name(week)}/{name}"] = values


def join_frames(path: str | PathLike[str], tets: NDArray, frames: Sequence[str | PathLike[str]]) -> None:
    """Joins the files of single frames, in the order of time, into `path` (.h5) with a .xdmf beside it."""
    path = Path(path)
    with new_hdf5(path) as file:
        file["tets"] = tets.astype(np.int32)
        for frame in frames:
            with h5py.File(frame) as source:
                for name in source:
                    source.copy(name, file)
        text = document(_time_series(path.name, file))
    with replaced(path.with_suffix(".xdmf")) as temporary:
        temporary.write_text(text)


def _time_series(data_name: str, file: h5py.File) -> str:
    tets = file["tets"]
    grids = []
    for name in (name for name in file if name.startswith("week_")):
        frame = file[name]
        parts = [
            f'<Time Value="{float(name.removeprefix("week_"))}"/>',
            topology(tets, f"{data_name}:/tets"),
            geometry(frame["positions"], f"{data_name}:/{name}/positions"),
        ]
        for field, values in frame.items():
            if field != "positions":
                centre = "Cell" if len(values) == len(tets) else "Node"
                parts.append(attribute(field, centre, values, f"{data_name}:/{name}/{field}"))
        grids.append(f'<Grid Name="{name}" GridType="Uniform">{"".join(parts)}</Grid>')
    return f'<Grid Name="folding" GridType="Collection" CollectionType="Temporal">{"".join(grids)}</Grid>'


def read_weeks(path: str | PathLike[str]) -> list[float]:
    """Returns the gestational weeks of the frames, ascending."""
    with h5py.File(path) as file:
        return sorted(float(name.removeprefix("week_")) for name in file if name.startswith("week_"))


def read_tets(path: str | PathLike[str]) -> NDArray[np.int64]:
    """Returns the (m, 4) tetrahedra."""
    with h5py.File(path) as file:
        return file["tets"][:].astype(np.int64)


def read_field(path: str | PathLike[str], week: float, field: str) -> NDArray[np.float64]:
    """Returns a field of the frame of a week; InputError where there is none, the weeks present named."""
    with h5py.File(path) as file:
        name = f"{group_name(week)}/{field}"
        if name not in file:
            raise InputError(f"has no {field} of week {week}", path=path, found=f"weeks {read_weeks(path)}")
        return file[name][:]


def read_positions(path: str | PathLike[str], week: float) -> NDArray[np.float64]:
    """Returns the (n, 3) positions in mm at a week."""
    return read_field(path, week, "positions")
