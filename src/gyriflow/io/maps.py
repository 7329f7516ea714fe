"""Maps of parameters: read from GIFTI and NIfTI files, and kept per vertex of a tetrahedral mesh in HDF5."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from nibabel.nifti1 import intent_codes

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh, merged
from ..parameters.terms import AffineSource
from .files import AnyPath, new_hdf5, reading_hdf5, require_finite
from .surfaces import load_gifti, read_surface
from .volumes import read_values


@dataclass(frozen=True, eq=False)
class ScalarVolume:
    """The (i, j, k) value of each voxel, NaN where the volume says nothing, and the (4, 4) affine to RAS+ mm."""

    values: Floats
    affine: Floats


def read_surface_map(path: AnyPath, surface_path: AnyPath) -> tuple[TriangleMesh, Floats]:
    """Return a surface and the values of a GIFTI shape or func file at its vertices.

    InputError for missing or truncated files, more than one array, another number of values than of vertices, NaN and
    infinite values, and STL surfaces, which have no order of vertices.
    """
    if str(surface_path).lower().endswith(".stl"):
        problem = "is no surface that a map can belong to, since STL files do not number their vertices"
        raise InputError(problem, path=surface_path, expected=f"the GIFTI, PLY or OBJ file that {path} was made on")
    surface = read_surface(surface_path)
    arrays = load_gifti(path).darrays
    if len(arrays) != 1 or arrays[0].data.dtype.kind not in "biuf" or arrays[0].data.size != len(arrays[0].data):
        found = [f"{intent_codes.niistring[array.intent]} {array.data.shape}" for array in arrays]
        expected = "one array of numbers (.shape.gii, .func.gii)"
        raise InputError(
            "is not a map of one value per vertex", path=path, found=", ".join(found) or "none", expected=expected
        )
    values = np.asarray(arrays[0].data, dtype=float).ravel()
    if len(values) != len(surface.vertices):
        expected = f"{len(surface.vertices)}, the number of vertices of {surface_path}"
        raise InputError("does not belong to its surface", path=path, found=f"{len(values)} values", expected=expected)
    require_finite(values, path, "values", "vertices")
    return surface, values


def read_surface_maps(paths: Sequence[AnyPath], surface_paths: Sequence[AnyPath]) -> tuple[TriangleMesh, Floats]:
    """Return surfaces side by side as one and the values of their maps, each read as by `read_surface_map`."""
    pieces = [read_surface_map(*files) for files in zip(paths, surface_paths, strict=True)]
    return merged(*(surface for surface, _ in pieces)), np.concatenate([values for _, values in pieces])


def read_volume_map(path: AnyPath, affine_from: AffineSource = "auto") -> ScalarVolume:
    """Return the values of a NIfTI or MGH file, in RAS+ mm whatever its units and storage order.

    `affine_from` as in `read_label_volume`. InputError for missing or truncated files, more than three axes that are
    longer than 1, unclear orientation.
    """
    values, affine = read_values(path, affine_from, "numbers")
    return ScalarVolume(values.astype(float), affine)


def write_maps(path: AnyPath, maps: Mapping[str, Floats]) -> None:
    """Write named (n,) values at the vertices of a mesh to an HDF5 file, a data set each."""
    with new_hdf5(path) as file:
        for name, values in maps.items():
            file[name] = np.asarray(values, dtype=np.float64)


def read_maps(path: AnyPath) -> dict[str, Floats]:
    """Return the named (n,) values of a file of `write_maps`; InputError where it is missing or torn."""
    with reading_hdf5(path, "maps", "an HDF5 file") as file:
        return {name: np.asarray(values[:], dtype=np.float64) for name, values in file.items()}
