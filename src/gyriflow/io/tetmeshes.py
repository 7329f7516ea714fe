"""Tetrahedral meshes as XDMF with HDF5, the form that ParaView and dolfinx read. Files hold mm.

The start mesh of a run stands in one file with its regions, of which ParaView shows two blocks: `mesh`, the elements
with all fields and tags, and `facets`, the pial triangles with theirs. dolfinx reads the mesh by `read_mesh()`, and
tags by `read_meshtags(mesh, NAME, xpath="/Xdmf/Domain[2]")`: a second domain, which ParaView leaves out, has a grid for
each tag, since dolfinx before 0.10 reads a grid's first tag only.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from .files import AnyPath, new_hdf5, reading_hdf5, require_finite, write_text

XDMF_NUMBER = {"f": "Float", "i": "Int", "u": "UInt"}
XDMF_ATTRIBUTE = {1: "Scalar", 3: "Vector", 9: "Tensor"}
XDMF_TOPOLOGY = {3: "Triangle", 4: "Tetrahedron", 10: "Tet_10"}


def data_item(values: NDArray, where: str) -> str:
    """Return the XDMF element that points to `values` stored at `where` ("file.h5:/name")."""
    shape = " ".join(map(str, values.shape))
    kind, size = XDMF_NUMBER[values.dtype.kind], values.dtype.itemsize
    return f'<DataItem Dimensions="{shape}" NumberType="{kind}" Precision="{size}" Format="HDF">{where}</DataItem>'


def attribute(name: str, centre: str, values: NDArray, where: str) -> str:
    """Return the XDMF element of a field; `centre` is "Node" or "Cell"."""
    kind = XDMF_ATTRIBUTE[1 if values.ndim == 1 else values.shape[1]]
    item = data_item(values, where)
    return f'<Attribute Name="{name}" AttributeType="{kind}" Center="{centre}">{item}</Attribute>'


def topology(cells: NDArray, where: str) -> str:
    """Return the XDMF element of the tetrahedra (of 4 or 10 nodes) or triangles stored at `where`."""
    item = data_item(cells, where)
    return f'<Topology TopologyType="{XDMF_TOPOLOGY[cells.shape[1]]}" NumberOfElements="{len(cells)}">{item}</Topology>'


def geometry(points: NDArray, where: str) -> str:
    """Return the XDMF element of the points stored at `where`."""
    return f'<Geometry GeometryType="XYZ">{data_item(points, where)}</Geometry>'


def grid(name: str, parts: Iterable[str]) -> str:
    """Return the XDMF grid of a mesh, from its elements."""
    return f'<Grid Name="{name}" GridType="Uniform">{"".join(parts)}</Grid>'


def document(*domains: str) -> str:
    """Return a whole XDMF document around the grids of its domains."""
    inside = "".join(f"<Domain>{grids}</Domain>" for grids in domains)
    return f'<?xml version="1.0"?>\n<Xdmf Version="3.0">{inside}</Xdmf>\n'


def write_tetrahedral_mesh(
    path: AnyPath,
    mesh: TetrahedralMesh,
    vertex_fields: Mapping[str, NDArray] | None = None,
    cell_fields: Mapping[str, NDArray] | None = None,
) -> None:
    """Write `path` (.xdmf) and the .h5 beside it: a mesh in mm, with fields (n,) or (n, 3) by name."""
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
    write_text(path, document(grid("mesh", parts)))


def read_tetrahedral_mesh(path: AnyPath) -> TetrahedralMesh:
    """Read the mesh that `write_tetrahedral_mesh` has written to `path`, from the .h5 beside it.

    InputError where the file cannot be read, or holds points that are not numbers, or flat or inverted elements.
    """
    data = Path(path).with_suffix(".h5")
    with reading_hdf5(data, "a tetrahedral mesh", "XDMF with its .h5 beside it") as file:
        mesh = TetrahedralMesh(file["vertices"][:], file["tets"][:])
    require_finite(mesh.vertices, data, "coordinates", "points")
    if wrong := int((signed_volumes(mesh) <= 0).sum()):
        raise InputError("has elements without a positive volume", path=data, found=wrong, expected="none")
    return mesh


# --- a run's mesh with its regions ------------------------------------------------------------------------------

Tags = Mapping[str, NDArray[np.int32]]


@dataclass(frozen=True, eq=False)
class Regions:
    """A tetrahedral mesh in mm with (f, 3) facets of its boundary, and fields (n,) or (n, 3) at its vertices by name.

    Tags are (m,) of the elements and (f,) of the facets, by name; a name in both is read by dolfinx from the grid
    `facet_NAME` for the facets.
    """

    mesh: TetrahedralMesh
    facets: NDArray[np.int64]
    fields: Mapping[str, NDArray]
    cell_tags: Tags
    facet_tags: Tags


def write_regions(path: AnyPath, regions: Regions) -> None:
    """Write `path` (.xdmf) and the .h5 beside it."""
    path = Path(path)
    data = path.with_suffix(".h5")
    cells = {"tets": regions.mesh.tets, "facets": regions.facets}
    tags = {"tets": regions.cell_tags, "facets": regions.facet_tags}
    with new_hdf5(data) as file:
        file["vertices"] = regions.mesh.vertices
        for kind, values in cells.items():
            file[kind] = values
            for name, tag in tags[kind].items():
                file[f"{kind}_tags/{name}"] = np.asarray(tag, dtype=np.int32)
        for name, field in regions.fields.items():
            file[f"fields/{name}"] = field

    def part(name: str, kind: Literal["tets", "facets"], tags: Tags, fields: Mapping[str, NDArray]) -> str:
        parts = [
            topology(cells[kind], f"{data.name}:/{kind}"),
            geometry(regions.mesh.vertices, f"{data.name}:/vertices"),
            *(
                attribute(tag, "Cell", np.asarray(tags[tag], dtype=np.int32), f"{data.name}:/{kind}_tags/{tag}")
                for tag in tags
            ),
            *(attribute(field, "Node", fields[field], f"{data.name}:/fields/{field}") for field in fields),
        ]
        return grid(name, parts)

    shown = part("mesh", "tets", regions.cell_tags, regions.fields) + part("facets", "facets", regions.facet_tags, {})
    single = [part(name, "tets", {name: tag}, {}) for name, tag in regions.cell_tags.items()]
    single += [
        part(f"facet_{name}" if name in regions.cell_tags else name, "facets", {name: tag}, {})
        for name, tag in regions.facet_tags.items()
    ]
    write_text(path, document(shown, "".join(single)))


def read_regions(path: AnyPath) -> Regions:
    """Return what `write_regions` has written to `path`; InputError where the .h5 beside it was not written so."""
    data = Path(path).with_suffix(".h5")
    with reading_hdf5(data, "regions", "regions.h5 of a run") as file:
        mesh = TetrahedralMesh(file["vertices"][:], file["tets"][:])
        kinds = ("fields", "tets_tags", "facets_tags")
        groups = [{name: values[:] for name, values in file[kind].items()} for kind in kinds]
        return Regions(mesh, file["facets"][:], *groups)
