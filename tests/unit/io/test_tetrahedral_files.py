"""Tetrahedral meshes and frames on disk."""

import meshio
import numpy as np
import pytest
from shapes import box_mesh

from gyriflow.errors import InputError
from gyriflow.geometry.tetrahedra import signed_volumes
from gyriflow.io.frames import join_frames, read_field, read_positions, read_tets, read_weeks, write_frame
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, read_vertex_field, write_tetrahedral_mesh


def test_a_mesh_comes_back_with_its_fields_readable_by_others(tmp_path):
    mesh = box_mesh((2, 2, 2), (2.0, 2.0, 2.0))
    path = tmp_path / "brain.xdmf"
    write_tetrahedral_mesh(path, mesh, {"x": mesh.vertices[:, 0], "p": mesh.vertices}, {"v": signed_volumes(mesh)})
    read = read_tetrahedral_mesh(path)
    np.testing.assert_array_equal(read.vertices, mesh.vertices)
    np.testing.assert_array_equal(read.tets, mesh.tets)
    other = meshio.read(path)
    np.testing.assert_array_equal(other.point_data["p"], mesh.vertices)
    np.testing.assert_allclose(other.cell_data["v"][0], signed_volumes(mesh))


def test_a_field_is_read_at_the_vertices_of_the_mesh(tmp_path):
    mesh = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    # a point of no element is no vertex of the mesh
    points = np.vstack([[[9.0, 9.0, 9.0]], mesh.vertices])
    path = tmp_path / "fields.xdmf"
    meshio.Mesh(points, [("tetra", mesh.tets + 1)], {"x": points[:, 0], "p": points}).write(path)
    np.testing.assert_array_equal(read_vertex_field(path, "x"), mesh.vertices[:, 0])
    np.testing.assert_array_equal(read_vertex_field(path, "p"), read_tetrahedral_mesh(path).vertices)
    with pytest.raises(InputError, match=r"fields\.xdmf: lacks a field.*found \['p', 'x'\]; expected growth"):
        read_vertex_field(path, "growth")


def test_any_xdmf_of_tetrahedra_is_read_and_turned_positive(tmp_path):
    mesh = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    turned = mesh.tets.copy()
    turned[::2] = turned[::2, [1, 0, 2, 3]]
    meshio.Mesh(mesh.vertices, [("tetra", turned)]).write(tmp_path / "other.xdmf")
    assert (signed_volumes(read_tetrahedral_mesh(tmp_path / "other.xdmf")) > 0).all()


def test_files_without_tetrahedra_or_with_bad_points_are_refused(tmp_path):
    meshio.Mesh(np.eye(3), [("triangle", [[0, 1, 2]])]).write(tmp_path / "flat.xdmf")
    with pytest.raises(InputError, match="holds no tetrahedra"):
        read_tetrahedral_mesh(tmp_path / "flat.xdmf")
    points = np.vstack([np.eye(3), [[np.nan, 0, 0]]])
    meshio.Mesh(points, [("tetra", [[0, 1, 2, 3]])]).write(tmp_path / "nan.xdmf")
    with pytest.raises(InputError, match="1 of 4"):
        read_tetrahedral_mesh(tmp_path / "nan.xdmf")
    (tmp_path / "torn.xdmf").write_text("<Xdmf>")
    with pytest.raises(InputError, match=r"torn\.xdmf"):
        read_tetrahedral_mesh(tmp_path / "torn.xdmf")
    with pytest.raises(InputError, match=r"missing\.xdmf"):
        read_tetrahedral_mesh(tmp_path / "missing.xdmf")


def test_frames_are_joined_into_one_time_series(tmp_path):
    mesh = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    parts = []
    for week in (21.0, 21.5, 22.0):
        parts.append(tmp_path / f"{week}.h5")
        write_frame(parts[-1], week, {"positions": mesh.vertices * week, "w": np.full(8, week)})
    join_frames(tmp_path / "frames.h5", mesh.tets, parts)
    assert read_weeks(tmp_path / "frames.h5") == [21.0, 21.5, 22.0]
    np.testing.assert_array_equal(read_positions(tmp_path / "frames.h5", 21.5), mesh.vertices * 21.5)
    np.testing.assert_array_equal(read_tets(tmp_path / "frames.h5"), mesh.tets)
    with meshio.xdmf.TimeSeriesReader(tmp_path / "frames.xdmf") as series:
        assert series.num_steps == 3
    with pytest.raises(InputError, match=r"weeks \[21\.0, 21\.5, 22\.0\]"):
        read_field(tmp_path / "frames.h5", 23.0, "w")
