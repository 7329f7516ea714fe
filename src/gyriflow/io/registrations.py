"""Correspondences between brains, and meshes carried along them, in HDF5 files of the project's own, RAS+ mm."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from ..errors import InputError
from ..geometry.deformations import Correspondence, Deformation, MatchedSurfaces
from ..geometry.triangles import Floats, TriangleMesh
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
    with _reading(path, "a deformation", "an HDF5 file with matrix, displacement and affine") as file:
        return _deformation(file), json.loads(file.attrs["report"])


def _deformation(file: h5py.File) -> Deformation:
    return Deformation(file["matrix"][:], file["displacement"][:], file["affine"][:])


@contextmanager
def _reading(path: AnyPath, what: str, expected: str) -> Iterator[h5py.File]:
    """Opens a file that tells how brains correspond; InputError for whatever goes wrong while it is read."""
    try:
        with h5py.File(path) as file:
            yield file
    except Exception as error:  # HDF5 raises whatever a torn file leads it into
        raise InputError(
            f"cannot be read as {what}",
            path=path,
            found=error,
            expected=expected,
            remedy="Register the brains, or match their surfaces, again.",
        ) from error


def write_matched_surfaces(path: AnyPath, matched: MatchedSurfaces, report: Mapping[str, Any]) -> None:
    """Writes the data sets first (n, 3) and second (n, 3) in mm, and faces (m, 3); the `report` as a deformation's."""
    with new_hdf5(path) as file:
        for name, points in (("first", matched.first.vertices), ("second", matched.second)):
            file.create_dataset(name, data=points, compression="gzip", shuffle=True)
        file.create_dataset("faces", data=matched.first.faces, compression="gzip", shuffle=True)
        file.attrs["report"] = json.dumps(dict(report))


def read_correspondence(path: AnyPath) -> Correspondence:
    """Returns what `write_deformation` or `write_matched_surfaces` has written; InputError for other files."""
    expected = "an HDF5 file with matrix, displacement and affine, or with first, second and faces"
    with _reading(path, "a correspondence of brains", expected) as file:
        if "faces" in file:
            return MatchedSurfaces(TriangleMesh(file["first"][:], file["faces"][:]), file["second"][:])
        return _deformation(file)


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
