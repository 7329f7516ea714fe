"""Deformations between brains' spaces, and meshes carried along them, in HDF5 files of the project's own, RAS+ mm."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from ..errors import InputError
from ..geometry.deformations import Deformation
from ..geometry.triangles import Floats
from .files import AnyPath
from .hdf5 import new_hdf5


def write_deformation(path: AnyPath, deformation: Deformation, report: Mapping[str, Any]) -> None:
    """Writes the data sets matrix (4, 4), displacement (i, j, k, 3) in mm, float32, and affine (4, 4) of its grid.

    A point p goes to matrix (p + displacement(p)). The `report` is kept as JSON in an attribute of that name.
    """
    with new_hdf5(path) as file:
        file["matrix"] = deformation.matrix
        file["affine"] = deformation.affine
        file.create_dataset(
            "displacement", data=deformation.displacement.astype(np.float32), compression="gzip", shuffle=True
        )
        file.attrs["report"] = json.dumps(dict(report))


def read_deformation(path: AnyPath) -> tuple[Deformation, dict[str, Any]]:
    """Returns the deformation and the report of a file of `write_deformation`; InputError where it is none."""
    try:
        with h5py.File(path) as file:
            deformation = Deformation(file["matrix"][:], file["displacement"][:], file["affine"][:])
            return deformation, json.loads(file.attrs["report"])
    except Exception as error:  # HDF5 raises whatever a torn file leads it into
        raise InputError(
            "cannot be read as a deformation",
            path=path,
            found=error,
            expected="an HDF5 file with matrix, displacement and affine",
            remedy="Run the registration again.",
        ) from error


@dataclass(frozen=True, eq=False)
class CarriedMesh:
    """A mesh carried over weeks, with its local growth.

    Attributes
    ----------
    weeks : (w,) float
        Gestational weeks, ascending.
    positions : (w, n, 3) float
        Of the vertices, in mm.
    growth : {smoothing length in mm: {"area" or "volume": (w - 1, n) float}}
        Local log growth per week between successive weeks; of area at vertices of the surface, NaN elsewhere.
    """

    weeks: Floats
    positions: Floats
    growth: Mapping[float, Mapping[str, Floats]]


def write_carried_mesh(path: AnyPath, carried: CarriedMesh) -> None:
    """Writes the data sets weeks, positions, and growth/{length}mm/{area, volume}."""
    with new_hdf5(path) as file:
        file["weeks"] = np.asarray(carried.weeks, dtype=np.float64)
        file.create_dataset("positions", data=carried.positions.astype(np.float32), compression="gzip", shuffle=True)
        for length, kinds in carried.growth.items():
            for kind, rates in kinds.items():
                file[f"growth/{length:g}mm/{kind}"] = np.asarray(rates, dtype=np.float64)


def read_carried_mesh(path: AnyPath) -> CarriedMesh:
    """Returns what `write_carried_mesh` has written; InputError where the file is none of it."""
    try:
        with h5py.File(path) as file:
            growth = {
                float(length.removesuffix("mm")): {kind: rates[:] for kind, rates in kinds.items()}
                for length, kinds in file.get("growth", {}).items()
            }
            return CarriedMesh(file["weeks"][:], file["positions"][:].astype(np.float64), growth)
    except Exception as error:  # HDF5 raises whatever a torn file leads it into
        raise InputError(
            "cannot be read as a carried mesh",
            path=path,
            found=error,
            expected="an HDF5 file with weeks and positions",
            remedy="Carry the mesh again.",
        ) from error
