"""Tetrahedral meshes as XDMF with HDF5, the form that ParaView and dolfinx read. Files hold mm."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from .files import replaced
from .hdf5 import new_hdf5

XDMF_NUMBER = {"f": "Float", "i": "Int", "u": "UInt"}
XDMF_ATTRIBUTE = {1: "Scalar", 3: "Vector", 9: "Tensor"}
XDMF_TOPOLOGY = {3: "Triangle", 4: "Tetrahedron", 10: "Tet_10"}
# what a tetrahedron becomes by corners 1 and 2 changing places
TURNED = {4: [0, 2, 1, 3], 10: [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]}


def data_item(values: NDArray, where: str) -> str:
    """Returns the XDMF element that points to `values` stored at `where` ("file.h5:/name")."""
    shape = " ".join(map(str, values.shape))
    kind, size = XDMF_NUMBER[values.dtype.kind], values.dtype.itemsize
    return f'<DataItem Dimensions="{shape}" NumberType="{kind}" Precision="{size}" Format="HDF">{where}</DataItem>'


def attribute(name: str, centre: str, values: NDArray, where: str) -> str:
    """Returns the XDMF element of a field; `centre` is "Node" or "Cell"."""
    kind = XDMF_ATTRIBUTE[1 if values.ndim == 1 else values.shape[1]]
    item = data_item(values, where)
    return f'<Attribute Name="{name}" AttributeType="{kind}" Center="{centre}">{item}</Attribute>'


def topology(cells: NDArray, where: str) -> str:
    """Returns the XDMF element of the tetrahedra (of 4 or 10 nodes) or triangles stored at `where`."""
    item = data_item(cells, where)
    return f'<Topology TopologyType="{XDMF_TOPOLOGY[cells.shape[1]]}" NumberOfElements="{len(cells)}">{item}</Topology>'


def geometry(points: NDArray, where: str) -> str:
    """Returns the XDMF element of the points stored at `where`."""
    return f'<Geometry GeometryType="XYZ">{data_item(points, where)}</Geometry>'


def document(*domains: str) -> str:
    """Returns a whole XDMF document around the grids of its domains."""
    inside = "".join(f"<Domain>{grids}</Domain>" for grids in domains)
    return f'<?xml version="1.0"?>\n<Xdmf Version="3.0">{inside}</Xdmf>\n'


def write_tetrahedral_mesh(
    path: str | PathLike[str],
    mesh: TetrahedralMesh,
    vertex_fields: Mapping[str, NDArray] | None = None,
    cell_fields: Mapping[str, NDArray] | None = None,
) -> None:
    """Writes `path` (.xdmf) and the .h5 beside it.

    Parameters
    ----------
    mesh
        Vertices in mm.
    vertex_fields, cell_fields
        Arrays of shape (n,) or (n, 3) by name.
    """
    path = Path(path)
    data = path.with_suffix(".h5")
    fields = [("Node", name, np.asarray(values)) for name, values in (vertex_fields or {}).items()]
    fields += [("Cell", name, np.asarray(values)) for name, values in (cell_fields or {}).items()]
    with new_hdf5(data) as file:
        file["tets"] = mesh.tets
        file["vertices"] = mesh.vertices
        for centre, name, values in fields:
            file[f"{centre}/{name}"] = values
    parts = [
        topology(mesh.tets, f"{data.name}:/tets"),
        geometry(mesh.vertices, f"{data.name}:/vertices"),
        *(attribute(name, centre, values, f"{data.name}:/{centre}/{name}") for centre, name, values in fields),
    ]
    with replaced(path) as temporary:
        temporary.write_text(document(f'<Grid Name="mesh" GridType="Uniform">{"".join(parts)}</Grid>'))


def read_tetrahedral_mesh(path: str | PathLike[str]) -> TetrahedralMesh:
    """Returns the tetrahedra of an XDMF file (or any file that meshio reads), every volume made positive.

    They are quadratic where the file has tetrahedra of ten nodes.

    Raises
    ------
    InputError
        Where the file cannot be read, holds no tetrahedra, points that are not numbers, or flat elements.
    """
    read, tets = _content(Path(path))
    points = np.asarray(read.points, dtype=float)
    wrong = int((~np.isfinite(points)).any(axis=1).sum())
    if wrong:
        raise InputError("has points that are not numbers", path=path, found=f"{wrong} of {len(points)}")
    used, local = np.unique(tets, return_inverse=True)
    mesh = TetrahedralMesh(points[used], local.reshape(tets.shape))
    volumes = signed_volumes(mesh)
    if (volumes == 0).any():
        raise InputError("has elements without volume", path=path, found=f"{int((volumes == 0).sum())}")
    turned = np.where((volumes < 0)[:, None], mesh.tets[:, TURNED[mesh.tets.shape[1]]], mesh.tets)
    return TetrahedralMesh(mesh.vertices, turned)


def _content(path: Path) -> tuple[meshio.Mesh, NDArray]:
    try:
        read = meshio.read(path)
        return read, read.cells_dict["tetra10" if "tetra10" in read.cells_dict else "tetra"]
    except KeyError:
        raise InputError("holds no tetrahedra", path=path, found=sorted(read.cells_dict) or "no cells") from None
    except (Exception, SystemExit) as error:  # meshio leaves through sys.exit on files that it does not know
        raise InputError(
            "cannot be read as a tetrahedral mesh", path=path, found=error, expected="XDMF with its .h5 beside it"
        ) from None
