"""Correspondences between brains, and meshes carried along them, in HDF5 files of the
project's own, RAS+ mm."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.deformations import Correspondence, Deformation, MatchedSurfaces
from ..geometry.triangles import Floats, TriangleMesh
from .files import AnyPath, new_hdf5, reading_hdf5

if TYPE_CHECKING:
    import h5py
    import pandas as pd

REGISTER_AGAIN = "Register the brains, or match their surfaces, again."


def write_correspondence(
    path: AnyPath,
    pair: Correspondence,
    report: Mapping[str, Any],
) -> None:
    """Write what takes one brain to another, and the `report` as JSON in an attribute.

    A deformation has matrix (4, 4), displacement (i, j, k, 3) in mm and affine (4, 4)
    of its grid: a point p goes to matrix (p + displacement(p)). Matched surfaces have
    first (n, 3) and second (n, 3) in mm, and faces (m, 3).
    """
    with new_hdf5(path) as file:
        if isinstance(pair, Deformation):
            file["matrix"], file["affine"] = pair.matrix, pair.affine
            large: dict[str, NDArray] = {
                "displacement": pair.displacement.astype(np.float32)
            }
        else:
            large = {
                "first": pair.first.vertices,
                "second": pair.second,
                "faces": pair.first.faces,
            }
        for name, values in large.items():
            _compress(file, name, values)
        file.attrs["report"] = json.dumps(dict(report))


def _compress(file: "h5py.File", name: str, values: NDArray) -> None:
    file.create_dataset(name, data=values, compression="gzip", shuffle=True)


def read_correspondence(path: AnyPath) -> Correspondence:
    """Return what `write_correspondence` has written; InputError for other files."""
    expected = (
        "an HDF5 file with matrix, displacement and affine, or with first, second and"
        " faces"
    )
    with reading_hdf5(
        path, "a correspondence of brains", expected, REGISTER_AGAIN
    ) as file:
        if "faces" in file:
            return MatchedSurfaces(
                TriangleMesh(
                    file["first"][:],
                    file["faces"][:],
                ),
                file["second"][:],
            )
        return Deformation(
            file["matrix"][:], file["displacement"][:], file["affine"][:]
        )


@dataclass(frozen=True, eq=False)
class WeeklyShapes:
    """The shapes that a mesh has, or is to have, at (w,) ascending gestational weeks,
    its own first.

    `positions` (w, n, 3) are in mm, in any pose; `sizes` ("area_cm2", "volume_ml":
    (w,)) those of the boundary; `surfaces` by name w arrays (m, 3), in mm, of simpler
    predictions of it. `ages` is the table of an atlas' ages by size, if used, `kept`
    that of the individual difference that a prediction keeps; `placed` has for each
    stated week of the atlas the boundary's places (m, 3) on its brain. `stops`
    are weeks without an observed brain, `between` those on the path through the others.
    `tets` are the elements of a mesh without a file. `made_from` stands for everything
    that an atlas' path is made from.
    """

    weeks: Floats
    positions: Floats
    sizes: Mapping[str, Floats] = field(default_factory=dict)
    surfaces: Mapping[str, Sequence[Floats]] = field(default_factory=dict)
    ages: "pd.DataFrame | None" = None
    stops: Sequence[float] = ()
    between: Sequence[float] = ()
    tets: NDArray[np.int64] | None = None
    made_from: str = ""
    kept: "pd.DataFrame | None" = None
    placed: Mapping[float, Floats] = field(default_factory=dict)

    def index(self, week: float) -> int:
        """Return the number of a week among those of the shapes; InputError where it is
        missing."""
        found = np.flatnonzero(self.weeks == week)
        if not len(found):
            weeks = ", ".join(f"{week:g}" for week in self.weeks)
            raise InputError(
                f"the mesh has no shape at {week:g} GW",
                found=f"shapes at {weeks} GW",
                remedy=REGISTER_AGAIN,
            )
        return int(found[0])


def write_weekly_shapes(path: AnyPath, shapes: WeeklyShapes) -> None:
    """Write the data sets weeks, stops, between, positions, tets, sizes/{name},
    surfaces/{name}, placed/{week}, ages/{column} and kept/{column}.

    `made_from` is an attribute of the file.
    """
    with new_hdf5(path) as file:
        for name, weeks in {
            "weeks": shapes.weeks,
            "stops": shapes.stops,
            "between": shapes.between,
        }.items():
            file[name] = np.asarray(weeks, dtype=np.float64)
        places = {"positions": shapes.positions} | {
            f"surfaces/{name}": at for name, at in shapes.surfaces.items()
        }
        for week, at in shapes.placed.items():
            places[f"placed/{week!r}"] = at
        for name, values in places.items():
            _compress(
                file,
                name,
                np.asarray(values, dtype=np.float32),
            )
        if shapes.tets is not None:
            _compress(file, "tets", shapes.tets)
        for name, values in shapes.sizes.items():
            file[f"sizes/{name}"] = np.asarray(values, dtype=np.float64)
        for group, table in {
            "ages": shapes.ages,
            "kept": shapes.kept,
        }.items():
            if table is not None:
                for column in table:
                    file[f"{group}/{column}"] = table[column].to_numpy(dtype=np.float64)
        file.attrs["made_from"] = shapes.made_from


def read_weekly_shapes(path: AnyPath) -> WeeklyShapes:
    """Read what `write_weekly_shapes` has written; InputError where the file is none of
    it."""
    expected = "an HDF5 file with weeks and positions"
    with reading_hdf5(
        path, "shapes of a mesh by week", expected, "Make them again."
    ) as file:
        sizes = {name: values[:] for name, values in file.get("sizes", {}).items()}
        surfaces = {
            name: list(at[:].astype(np.float64))
            for name, at in file.get("surfaces", {}).items()
        }
        placed = {
            float(week): at[:].astype(np.float64)
            for week, at in file.get("placed", {}).items()
        }
        tables = {}
        for group in ("ages", "kept"):
            if group in file:
                import pandas as pd

                columns = {name: values[:] for name, values in file[group].items()}
                tables[group] = pd.DataFrame(columns)
        positions = file["positions"][:].astype(np.float64)
        stops, between = (file[name][:].tolist() for name in ("stops", "between"))
        tets = file["tets"][:] if "tets" in file else None
        made_from = file.attrs["made_from"]
        return WeeklyShapes(
            file["weeks"][:],
            positions,
            sizes,
            surfaces,
            tables.get("ages"),
            stops,
            between,
            tets,
            made_from,
            tables.get("kept"),
            placed,
        )


def stored_name(brain: str, key: str) -> str:
    """Return the file name under which studies find the path of an atlas, of a first
    brain and with a key."""
    return f"{brain}-{key}.h5"


def read_path_key(path: AnyPath) -> str | None:
    """Return `made_from` of weekly shapes without reading these; None for other or
    damaged files."""
    with (
        suppress(InputError),
        reading_hdf5(path, "shapes of a mesh by week", "an HDF5 file") as file,
    ):
        return file.attrs["made_from"]
    return None
