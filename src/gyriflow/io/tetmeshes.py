"""Tetrahedral meshes as XDMF with HDF5, the form that ParaView and dolfinx read. Files
hold mm.

A run's start mesh has its regions in one file, as two blocks: `mesh`, the elements with
fields and tags, and `facets`, the pial triangles. dolfinx reads a tag by
`read_meshtags(mesh, BLOCK, attribute_name=TAG)`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from ..geometry.triangles import Floats
from .files import AnyPath, new_hdf5, reading_hdf5, require_finite, write_text

XDMF_NUMBER = {"f": "Float", "i": "Int", "u": "UInt"}
XDMF_ATTRIBUTE = {1: "Scalar", 3: "Vector", 9: "Tensor"}
XDMF_TOPOLOGY = {3: "Triangle", 4: "Tetrahedron", 10: "Tet_10"}


Stored = tuple[NDArray, str]
"""Values, and where they are stored ("file.h5:/name")."""


def xdmf_grid(
    name: str,
    cells: Stored,
    points: Stored,
    vertex_fields: Mapping[str, Stored],
    cell_fields: Mapping[str, Stored],
    time: float | None = None,
) -> str:
    """Return the XDMF grid of a mesh of triangles or tetrahedra (of 4 or 10 nodes),
    with its fields by name."""
    kind, count = XDMF_TOPOLOGY[cells[0].shape[1]], len(cells[0])
    parts = [] if time is None else [f'<Time Value="{time}"/>']
    parts.append(
        f'<Topology TopologyType="{kind}" NumberOfElements="{count}">'
        f"{_data_item(*cells)}</Topology>"
    )
    parts.append(f'<Geometry GeometryType="XYZ">{_data_item(*points)}</Geometry>')
    for centre, fields in (("Node", vertex_fields), ("Cell", cell_fields)):
        for field, (values, where) in fields.items():
            kind = XDMF_ATTRIBUTE[1 if values.ndim == 1 else values.shape[1]]
            item = _data_item(values, where)
            parts.append(
                f'<Attribute Name="{field}" AttributeType="{kind}" Center="{centre}">'
                f"{item}</Attribute>"
            )
    return f'<Grid Name="{name}" GridType="Uniform">{"".join(parts)}</Grid>'


def _data_item(values: NDArray, where: str) -> str:
    shape = " ".join(map(str, values.shape))
    kind, size = XDMF_NUMBER[values.dtype.kind], values.dtype.itemsize
    return (
        f'<DataItem Dimensions="{shape}" NumberType="{kind}" Precision="{size}"'
        f' Format="HDF">{where}</DataItem>'
    )


def write_xdmf(path: AnyPath, grids: str) -> None:
    """Write an XDMF document of grids."""
    domain = f"<Domain>{grids}</Domain>"
    write_text(path, f'<?xml version="1.0"?>\n<Xdmf Version="3.0">{domain}</Xdmf>\n')


def write_tetrahedral_mesh(
    path: AnyPath,
    mesh: TetrahedralMesh,
    cell_fields: Mapping[str, NDArray] | None = None,
) -> None:
    """Write a mesh in mm, with fields (m,) or (m, 3) of its elements by name, to `path`
    (.xdmf) and its .h5 file."""
    data = Path(path).with_suffix(".h5")
    fields = {
        name: (np.asarray(values), f"{data.name}:/Cell/{name}")
        for name, values in (cell_fields or {}).items()
    }
    with new_hdf5(data) as file:
        file["tets"], file["vertices"] = mesh.tets, mesh.vertices
        for name, (values, _) in fields.items():
            file[f"Cell/{name}"] = values
    cells = (mesh.tets, f"{data.name}:/tets")
    points = (mesh.vertices, f"{data.name}:/vertices")
    write_xdmf(path, xdmf_grid("mesh", cells, points, {}, fields))


def read_tetrahedral_mesh(path: AnyPath) -> TetrahedralMesh:
    """Read a mesh of `write_tetrahedral_mesh`; InputError for other files, and flat or
    inverted elements."""
    data = Path(path).with_suffix(".h5")
    with reading_hdf5(data, "a tetrahedral mesh", "XDMF with its .h5 file") as file:
        mesh = TetrahedralMesh(
            file["vertices"][:],
            file["tets"][:],
        )
    require_finite(mesh.vertices, data, "coordinates", "points")
    if wrong := int((signed_volumes(mesh) <= 0).sum()):
        raise InputError(
            "has elements without a positive volume",
            path=data,
            found=wrong,
            expected="none",
        )
    return mesh


Tags = Mapping[str, NDArray[np.int32]]


@dataclass(frozen=True, eq=False)
class Regions:
    """A tetrahedral mesh in mm with (f, 3) facets of its boundary, and fields (n,) or
    (n, 3) at its vertices by name.

    Tags by name are (m,) of elements and (f,) of facets.
    """

    mesh: TetrahedralMesh
    facets: NDArray[np.int64]
    fields: Mapping[str, NDArray]
    cell_tags: Tags
    facet_tags: Tags


def write_regions(path: AnyPath, regions: Regions) -> None:
    """Write `path` (.xdmf) and its .h5 file."""
    data = Path(path).with_suffix(".h5")
    cells = {"tets": regions.mesh.tets, "facets": regions.facets}
    tags: dict[str, dict[str, Stored]] = {"tets": {}, "facets": {}}
    fields = {}
    with new_hdf5(data) as file:
        file["vertices"] = regions.mesh.vertices
        for kind, by_name in (
            ("tets", regions.cell_tags),
            ("facets", regions.facet_tags),
        ):
            file[kind] = cells[kind]
            for name, tag in by_name.items():
                values, place = np.asarray(tag, dtype=np.int32), f"{kind}_tags/{name}"
                file[place] = values
                tags[kind][name] = values, f"{data.name}:/{place}"
        for name, field in regions.fields.items():
            file[f"fields/{name}"] = field
            fields[name] = field, f"{data.name}:/fields/{name}"
    points = regions.mesh.vertices, f"{data.name}:/vertices"
    tets, facets = ((cells[kind], f"{data.name}:/{kind}") for kind in cells)
    blocks = xdmf_grid("mesh", tets, points, fields, tags["tets"])
    blocks += xdmf_grid("facets", facets, points, {}, tags["facets"])
    write_xdmf(path, blocks)


def read_regions(path: AnyPath) -> Regions:
    """Read regions written by `write_regions` to `path`; InputError if its .h5 file is
    missing or invalid."""
    data = Path(path).with_suffix(".h5")
    with reading_hdf5(data, "regions", "regions.h5 of a run") as file:
        mesh = TetrahedralMesh(
            file["vertices"][:],
            file["tets"][:],
        )
        kinds = ("fields", "tets_tags", "facets_tags")
        groups = [
            {name: values[:] for name, values in file[kind].items()} for kind in kinds
        ]
        return Regions(mesh, file["facets"][:], *groups)


def write_maps(path: AnyPath, maps: Mapping[str, Floats]) -> None:
    """Write named (n,) values at the vertices of a mesh to an HDF5 file, a data set
    each."""
    with new_hdf5(path) as file:
        for name, values in maps.items():
            file[name] = np.asarray(values, dtype=np.float64)


def read_maps(path: AnyPath) -> dict[str, Floats]:
    """Return the named (n,) values of a file of `write_maps`; InputError where it is
    missing or torn."""
    with reading_hdf5(path, "maps", "an HDF5 file") as file:
        return {
            name: np.asarray(values[:], dtype=np.float64)
            for name, values in file.items()
        }
