"""Tetrahedral meshes, regions and frames on disk come back, and ParaView's reader and
dolfinx find all in place."""

import dolfinx
import numpy as np
import pytest
import pyvista
from dolfinx.io import XDMFFile
from facts import Facts
from mpi4py import MPI
from pyvista import wrap
from shapes import box_mesh
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

from gyriflow.errors import InputError
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    quadratic,
    signed_volumes,
)
from gyriflow.io.frames import (
    join_frames,
    read_field,
    read_positions,
    read_tets,
    read_weeks,
    write_frame,
)
from gyriflow.io.tetmeshes import (
    Regions,
    read_regions,
    read_tetrahedral_mesh,
    write_regions,
    write_tetrahedral_mesh,
)


def by_vtk(path):
    """Return what VTK's reader, which is ParaView's, reads of an XDMF file."""
    reader = vtkXdmfReader()
    reader.SetFileName(str(path))
    reader.Update()
    return wrap(reader.GetOutputDataObject(0))


@pytest.mark.parametrize("make", [lambda mesh: mesh, quadratic])
def test_a_mesh_comes_back_with_its_fields_readable_by_others(tmp_path, make):
    mesh, path = make(box_mesh((2, 2, 2), (2.0, 2.0, 2.0))), tmp_path / "brain.xdmf"
    shaken = np.random.default_rng(1).uniform(-0.05, 0.05, mesh.vertices.shape)
    mesh = TetrahedralMesh(mesh.vertices + shaken, mesh.tets)
    middles = mesh.vertices[mesh.corners].mean(axis=1)
    write_tetrahedral_mesh(path, mesh, {"p": middles, "v": signed_volumes(mesh)})
    read, other = read_tetrahedral_mesh(path), by_vtk(path)
    np.testing.assert_array_equal(read.vertices, mesh.vertices)
    np.testing.assert_array_equal(read.tets, mesh.tets)
    np.testing.assert_allclose(other.points, mesh.vertices)
    np.testing.assert_allclose(other.cell_data["p"], middles)
    np.testing.assert_allclose(other.cell_data["v"], signed_volumes(mesh))


@pytest.mark.parametrize(
    ("point", "tet", "found"),
    [(np.nan, [0, 1, 2, 3], "NaN"), (1.0, [0, 2, 1, 3], ""), (0.0, [0, 1, 2, 3], "")],
)
def test_meshes_with_bad_points_or_elements_are_refused(tmp_path, point, tet, found):
    points = np.vstack([np.zeros(3), np.eye(3)])
    points[3, 2] = point
    mesh = TetrahedralMesh(points, np.array([tet]))
    write_tetrahedral_mesh(tmp_path / "bad.xdmf", mesh)
    with pytest.raises(InputError, check=Facts(tmp_path / "bad.h5", 1, found)):
        read_tetrahedral_mesh(tmp_path / "bad.xdmf")


@pytest.mark.parametrize("read", [read_tetrahedral_mesh, read_regions, read_weeks])
def test_missing_and_torn_files_are_refused(tmp_path, read):
    for content in (b"", b"HDF"):
        if content:
            (tmp_path / "a.h5").write_bytes(content)
        with pytest.raises(InputError, check=Facts(tmp_path / "a.h5")):
            read(tmp_path / "a.h5")


WEEKS = (21.0, 21.5, 22.0)


@pytest.fixture
def frames(tmp_path):
    """Three frames of a box that grows with the week, with fields at vertices and
    elements, as many as vertices."""
    box = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    # eight elements of eight vertices: only the place in the file tells the two kinds
    # apart
    mesh = TetrahedralMesh(box.vertices, np.vstack([box.tets, box.tets[:2]]))
    for week in WEEKS:
        vertex_fields = {
            "positions": mesh.vertices * week,
            "w": np.full(8, week),
            "u": mesh.vertices * (week - 21),
        }
        cell_fields = {"stress": week + np.arange(8), "zone": np.arange(8)}
        write_frame(tmp_path / f"{week}.h5", week, vertex_fields, cell_fields)
    path = tmp_path / "frames.h5"
    join_frames(path, mesh.tets, [tmp_path / f"{week}.h5" for week in WEEKS])
    return path, mesh


def test_frames_are_joined_into_one_time_series(frames):
    path, mesh = frames
    assert read_weeks(path) == [*WEEKS]
    np.testing.assert_array_equal(read_positions(path, 21.5), mesh.vertices * 21.5)
    np.testing.assert_array_equal(read_tets(path), mesh.tets)
    np.testing.assert_array_equal(read_field(path, 22.0, "w"), np.full(8, 22.0))
    np.testing.assert_array_equal(read_field(path, 21.5, "stress"), 21.5 + np.arange(8))
    with pytest.raises(InputError, check=Facts(path, 23, *WEEKS)):
        read_field(path, 23.0, "w")
    with pytest.raises(InputError, check=Facts(path, "strain", 21, "w", "stress")):
        read_field(path, 21.0, "strain")


def test_paraview_reads_the_series_with_fields_of_vertices_and_elements(frames):
    path, mesh = frames
    reader = pyvista.get_reader(path.with_suffix(".xdmf"))
    assert reader.time_values == [*WEEKS]
    reader.set_active_time_value(21.5)
    grid = reader.read()
    np.testing.assert_array_equal(grid.points, mesh.vertices * 21.5)
    np.testing.assert_array_equal(grid.cells_dict[pyvista.CellType.TETRA], mesh.tets)
    assert set(grid.point_data) == {"w", "u"}
    assert set(grid.cell_data) == {"stress", "zone"}
    np.testing.assert_allclose(grid.point_data["u"], mesh.vertices / 2)
    np.testing.assert_array_equal(grid.cell_data["stress"], 21.5 + np.arange(8))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A box tagged by place: elements by the side of x = 0 and by height, facets by the
    side and where they face up."""
    mesh = box_mesh((4, 3, 2), (4.0, 3.0, 2.0))
    facets, _ = boundary_faces(mesh)
    cells, faces = mesh.vertices[mesh.tets].mean(axis=1), mesh.vertices[facets]
    cell_tags = {
        "hemisphere": np.where(cells[:, 0] < 0, 1, 2),
        "layer": np.where(cells[:, 2] < 0, 5, 7),
    }
    facet_tags = {
        "zone": np.where((faces[:, :, 2] == 1.0).all(axis=1), 3, 0),
        "hemisphere": np.where(faces[:, :, 0].mean(axis=1) < 0, 1, 2),
    }
    fields = {"height_mm": mesh.vertices[:, 2], "normal": mesh.vertices}
    path = tmp_path_factory.mktemp("regions") / "regions.xdmf"
    write_regions(path, Regions(mesh, facets, fields, cell_tags, facet_tags))
    return path, mesh, facets, cell_tags, facet_tags


def test_what_is_written_comes_back(written):
    path, mesh, *arrays = written
    back = read_regions(path)
    found = [back.facets, back.cell_tags, back.facet_tags]
    np.testing.assert_equal(found, arrays)
    np.testing.assert_array_equal(back.mesh.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.mesh.tets, mesh.tets)
    np.testing.assert_array_equal(back.fields["normal"], mesh.vertices)


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


@pytest.mark.parametrize(
    ("block", "name", "expected"),
    [
        ("mesh", "hemisphere", lambda x: np.where(x[:, 0] < 0, 1, 2)),
        ("mesh", "layer", lambda x: np.where(x[:, 2] < 0, 5, 7)),
        ("facets", "zone", lambda x: np.where(x[:, 2] > 1 - 1e-9, 3, 0)),
        ("facets", "hemisphere", lambda x: np.where(x[:, 0] < 0, 1, 2)),
    ],
)
def test_dolfinx_reads_every_tag_where_it_belongs(
    written, domain, block, name, expected
):
    path, mesh, facets, *_ = written
    with XDMFFile(MPI.COMM_SELF, path, "r") as file:
        tags = file.read_meshtags(domain, block, attribute_name=name)
    assert len(tags.values) == len(mesh.tets if block == "mesh" else facets)
    np.testing.assert_array_equal(
        tags.values,
        expected(dolfinx.mesh.compute_midpoints(domain, tags.dim, tags.indices)),
    )
