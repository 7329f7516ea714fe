"""Deformations between brains' spaces in HDF5 files of the project's own, RAS+ mm."""

import json
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from ..errors import InputError
from ..geometry.deformations import Deformation
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
    except (OSError, KeyError, ValueError) as error:
        raise InputError(
            "cannot be read as a deformation",
            path=path,
            found=error,
            expected="an HDF5 file with matrix, displacement and affine",
            remedy="Run the registration again.",
        ) from error
