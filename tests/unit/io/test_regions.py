"""Regions on disk: they come back, and ParaView's reader and dolfinx find every tag in its place."""

import dolfinx
import numpy as np
import pytest
from dolfinx.io import XDMFFile
from mpi4py import MPI
from pyvista import wrap
from shapes import box_mesh
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

from gyriflow.errors import InputError
from gyriflow.geometry.tetrahedra import boundary_faces
from gyriflow.io.regions import Regions, read_regions, write_regions


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A box tagged by place: elements by the side of x = 0 and by height, facets by the side and where they face up."""
    mesh = box_mesh((4, 3, 2), (4.0, 3.0, 2.0))
    facets, _ = boundary_faces(mesh)
    cells, faces = mesh.vertices[mesh.tets].mean(axis=1), mesh.vertices[facets]
    cell_tags = {"hemisphere": np.where(cells[:, 0] < 0, 1, 2), "layer": np.where(cells[:, 2] < 0, 5, 7)}
    facet_tags = {
        "zone": np.where((faces[:, :, 2] == 1.0).all(axis=1), 3, 0),
        "hemisphere": np.where(faces[:, :, 0].mean(axis=1) < 0, 1, 2),
    }
    fields = {"height_mm": mesh.vertices[:, 2], "normal": mesh.vertices}
    path = tmp_path_factory.mktemp("regions") / "regions.xdmf"
    write_regions(path, Regions(mesh, facets, fields, cell_tags, facet_tags))
    return path, mesh, facets, cell_tags, facet_tags


def test_what_is_written_comes_back(written):
    path, mesh, facets, cell_tags, facet_tags = written
    back = read_regions(path)
    np.testing.assert_array_equal(back.mesh.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.mesh.tets, mesh.tets)
    np.testing.assert_array_equal(back.facets, facets)
    for found, expected in ((back.cell_tags, cell_tags), (back.facet_tags, facet_tags)):
        assert set(found) == set(expected)
        for name, tag in expected.items():
            np.testing.assert_array_equal(found[name], tag)
    np.testing.assert_array_equal(back.fields["normal"], mesh.vertices)


def test_other_files_are_refused(written, tmp_path):
    with pytest.raises(InputError, match=r"none\.h5: cannot be read as regions"):
        read_regions(tmp_path / "none.xdmf")
    (tmp_path / "torn.h5").write_bytes(written[0].with_suffix(".h5").read_bytes()[:3000])
    with pytest.raises(InputError, match=r"torn\.h5: cannot be read as regions"):
        read_regions(tmp_path / "torn.xdmf")


@pytest.fixture(scope="module")
def domain(written):
    """The mesh as dolfinx reads it, whose own order of elements is another one."""
    with XDMFFile(MPI.COMM_SELF, written[0], "r") as file:
        mesh = file.read_mesh()
    for dimension in (2, 3):
        mesh.topology.create_entities(dimension)
        mesh.topology.create_connectivity(dimension, 0)
        mesh.topology.create_connectivity(dimension, 3)
    return mesh


def midpoints(tags, domain):
    """Returns where the tagged entities lie."""
    return dolfinx.mesh.compute_midpoints(domain, tags.dim, tags.indices)


@pytest.mark.parametrize(
    ("grid", "dimension", "expected"),
    [
        ("hemisphere", 3, lambda x: np.where(x[:, 0] < 0, 1, 2)),
        ("layer", 3, lambda x: np.where(x[:, 2] < 0, 5, 7)),
        ("zone", 2, lambda x: np.where(x[:, 2] > 1 - 1e-9, 3, 0)),
        ("facet_hemisphere", 2, lambda x: np.where(x[:, 0] < 0, 1, 2)),
    ],
)
def test_dolfinx_reads_every_tag_where_it_belongs(written, domain, grid, dimension, expected):
    path, mesh, facets, *_ = written
    with XDMFFile(MPI.COMM_SELF, path, "r") as file:
        tags = file.read_meshtags(domain, grid, xpath="/Xdmf/Domain[2]")
    assert tags.dim == dimension
    assert len(tags.values) == (len(facets) if dimension == 2 else len(mesh.tets))
    np.testing.assert_array_equal(tags.values, expected(midpoints(tags, domain)))


def test_dolfinx_finds_the_zones_on_the_facets_that_paraview_shows(written, domain):
    with XDMFFile(MPI.COMM_SELF, written[0], "r") as file:
        zones = file.read_meshtags(domain, "facets")
    assert (midpoints(zones, domain)[zones.values == 3][:, 2] == 1.0).all()
    # two triangles in each of the upper side's 4 x 3 squares
    assert (zones.values == 3).sum() == 24


def test_paraview_opens_elements_and_facets_at_once(written):
    path, mesh, facets, cell_tags, facet_tags = written
    reader = vtkXdmfReader()
    reader.SetFileName(str(path))
    reader.Update()
    blocks = wrap(reader.GetOutputDataObject(0))
    assert blocks.keys() == ["mesh", "facets"]
    assert [block.n_cells for block in blocks] == [len(mesh.tets), len(facets)]
    assert set(blocks["mesh"].point_data) == {"height_mm", "normal"}
    for block, tags in (("mesh", cell_tags), ("facets", facet_tags)):
        assert set(blocks[block].cell_data) == set(tags)
        for name, tag in tags.items():
            np.testing.assert_array_equal(blocks[block].cell_data[name], tag)
