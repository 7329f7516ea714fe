"""Surfaces and per-vertex maps: what is written comes back, what is broken is named."""

import nibabel as nib
import numpy as np
import pytest
import trimesh
from nibabel.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage
from nibabel.nifti1 import data_type_codes, intent_codes

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh, is_closed, signed_volume
from gyriflow.io.surfaces import read_surface, read_vertex_maps, write_surface, write_vertex_maps


@pytest.fixture
def ball():
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
    return TriangleMesh(sphere.vertices - [-30.0, 20.0, -5.0], sphere.faces)


def gifti(path, vertices, faces, matrix=None, face_type=np.int32):
    points = GiftiDataArray(vertices.astype(np.float32), intent="NIFTI_INTENT_POINTSET")
    if matrix is not None:
        points.coordsys = GiftiCoordSystem(0, 1, matrix)
    kind = {np.int32: "NIFTI_TYPE_INT32", np.float32: "NIFTI_TYPE_FLOAT32"}[face_type]
    triangles = GiftiDataArray(faces.astype(face_type), intent="NIFTI_INTENT_TRIANGLE", datatype=kind)
    nib.save(GiftiImage(darrays=[points, triangles]), path)
    return path


@pytest.mark.parametrize("name", ["a.surf.gii", "a.stl", "a.ply", "a.obj"])
def test_written_surface_comes_back_closed_and_outward(tmp_path, ball, name):
    write_surface(tmp_path / name, ball)
    back = read_surface(tmp_path / name)
    assert len(back.vertices) == len(ball.vertices)
    assert is_closed(back)
    assert signed_volume(back) == pytest.approx(signed_volume(ball), rel=1e-5)
    assert back.vertices.mean(axis=0) == pytest.approx(ball.vertices.mean(axis=0), abs=1e-3)


def test_written_gifti_says_which_hemisphere(tmp_path, ball):
    write_surface(tmp_path / "a.surf.gii", ball, "CortexLeft")
    image = nib.load(tmp_path / "a.surf.gii")
    assert image.darrays[0].meta["AnatomicalStructurePrimary"] == "CortexLeft"
    assert image.darrays[0].data.dtype == np.float32
    assert image.darrays[1].data.dtype == np.int32


def test_coordinate_system_matrix_is_applied(tmp_path, ball):
    matrix = np.array([[0, -1, 0, 7], [1, 0, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1.0]])
    back = read_surface(gifti(tmp_path / "a.gii", ball.vertices, ball.faces, matrix))
    assert back.vertices == pytest.approx(ball.vertices @ matrix[:3, :3].T + matrix[:3, 3], abs=1e-3)


def test_triangles_stored_as_floats_are_read(tmp_path, ball):
    back = read_surface(gifti(tmp_path / "a.gii", ball.vertices, ball.faces, face_type=np.float32))
    assert np.array_equal(back.faces, ball.faces)


def test_nan_vertices_are_counted(tmp_path, ball):
    vertices = ball.vertices.copy()
    vertices[3:5, 1] = np.nan
    with pytest.raises(InputError, match=r"a\.gii.*2 vertices"):
        read_surface(gifti(tmp_path / "a.gii", vertices, ball.faces))


def test_faces_beyond_the_vertices_are_refused(tmp_path, ball):
    with pytest.raises(InputError, match=r"0 to 161"):
        read_surface(gifti(tmp_path / "a.gii", ball.vertices, ball.faces + 1))


@pytest.mark.parametrize("name", ["a.surf.gii", "a.stl", "a.ply"])
@pytest.mark.parametrize("kept", [0.05, 0.5, 0.98])
def test_truncated_surface_is_named(tmp_path, ball, name, kept):
    write_surface(tmp_path / name, ball)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / f"torn.{name}").write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(InputError, match="torn"):
        read_surface(tmp_path / f"torn.{name}")


def test_missing_file_and_map_instead_of_surface_are_refused(tmp_path, ball):
    write_vertex_maps(tmp_path / "a.shape.gii", {"x": ball.vertices[:, 0]})
    for name in ("a.shape.gii", "none.surf.gii", "none.stl"):
        with pytest.raises(InputError, match=name):
            read_surface(tmp_path / name)


def test_named_maps_come_back(tmp_path):
    maps = {"shape_index": np.linspace(-1, 1, 50), "curvedness": np.arange(50.0)}
    write_vertex_maps(tmp_path / "a.shape.gii", maps, "CortexRight")
    back = read_vertex_maps(tmp_path / "a.shape.gii")
    assert list(back) == list(maps)
    for name, values in maps.items():
        assert back[name] == pytest.approx(values, abs=1e-6)


def test_maps_are_what_workbench_calls_metric_files(tmp_path):
    write_vertex_maps(tmp_path / "a.shape.gii", {"sulcal_depth_mm": np.arange(5)}, "CortexLeft")
    image = nib.load(tmp_path / "a.shape.gii")
    (array,) = image.darrays
    assert image.meta["AnatomicalStructurePrimary"] == "CortexLeft"
    assert intent_codes.niistring[array.intent] == "NIFTI_INTENT_SHAPE"
    assert data_type_codes.niistring[array.datatype] == "NIFTI_TYPE_FLOAT32"
    assert array.data.shape == (5,)
    assert array.meta["Name"] == "sulcal_depth_mm"


def test_open_surfaces_are_declared_open(tmp_path, ball):
    for faces, expected in ((ball.faces, "Closed"), (ball.faces[1:], "Open")):
        write_surface(tmp_path / "a.surf.gii", TriangleMesh(ball.vertices, faces), "CortexLeft")
        (triangles,) = nib.load(tmp_path / "a.surf.gii").get_arrays_from_intent("NIFTI_INTENT_TRIANGLE")
        assert triangles.meta["TopologicalType"] == expected
