"""The start mesh of a run with its regions, in one file that ParaView and dolfinx open. Files hold mm.

ParaView shows two blocks: `mesh`, the elements with all fields and tags, and `facets`, the pial triangles with theirs.
dolfinx reads the mesh by `read_mesh()`, and tags by `read_meshtags(mesh, NAME, xpath="/Xdmf/Domain[2]")`: a second
domain, which ParaView leaves out, has a grid for each tag, since dolfinx before 0.10 reads a grid's first tag only.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh
from .files import AnyPath, replaced
from .hdf5 import new_hdf5
from .tetmeshes import attribute, document, geometry, topology

Tags = Mapping[str, NDArray[np.int32]]


@dataclass(frozen=True, eq=False)
class Regions:
    """A tetrahedral mesh with tags and fields.

    Attributes
    ----------
    mesh
        Vertices in mm.
    facets : (f, 3) int
        Facets of the boundary as vertex indices.
    fields : {name: (n,) or (n, 3)}
        Fields at the vertices.
    cell_tags, facet_tags : {name: (m,) int}, {name: (f,) int}
        A name in both is read by dolfinx from the grid `facet_NAME` for the facets.
    """

    mesh: TetrahedralMesh
    facets: NDArray[np.int64]
    fields: Mapping[str, NDArray]
    cell_tags: Tags
    facet_tags: Tags


def write_regions(path: AnyPath, regions: Regions) -> None:
    """Writes `path` (.xdmf) and the .h5 beside it."""
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

    def grid(name: str, kind: Literal["tets", "facets"], tags: Tags, fields: Mapping[str, NDArray]) -> str:
        parts = [
            topology(cells[kind], f"{data.name}:/{kind}"),
            geometry(regions.mesh.vertices, f"{data.name}:/vertices"),
            *(
                attribute(tag, "Cell", np.asarray(tags[tag], dtype=np.int32), f"{data.name}:/{kind}_tags/{tag}")
                for tag in tags
            ),
            *(attribute(field, "Node", fields[field], f"{data.name}:/fields/{field}") for field in fields),
        ]
        return f'<Grid Name="{name}" GridType="Uniform">{"".join(parts)}</Grid>'

    shown = grid("mesh", "tets", regions.cell_tags, regions.fields) + grid("facets", "facets", regions.facet_tags, {})
    single = [grid(name, "tets", {name: tag}, {}) for name, tag in regions.cell_tags.items()]
    single += [
        grid(f"facet_{name}" if name in regions.cell_tags else name, "facets", {name: tag}, {})
        for name, tag in regions.facet_tags.items()
    ]
    with replaced(path) as temporary:
        temporary.write_text(document(shown, "".join(single)))


def read_regions(path: AnyPath) -> Regions:
    """Returns what `write_regions` has written to `path`.

    Raises
    ------
    InputError
        Where the .h5 beside it cannot be read or was not written so.
    """
    data = Path(path).with_suffix(".h5")
    try:
        with h5py.File(data) as file:
            mesh = TetrahedralMesh(file["vertices"][:], file["tets"][:])
            groups = [
                {name: values[:] for name, values in file[group].items()}
                for group in ("fields", "tets_tags", "facets_tags")
            ]
            return Regions(mesh, file["facets"][:], *groups)
    except Exception as error:  # HDF5 raises whatever a torn file leads it into
        raise InputError("cannot be read as regions", path=data, found=error, expected="regions.h5 of a run") from None
