"""Sizing, quality and tetrahedralisation."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import igl
import numpy as np
import pytest
import trimesh
from shapes import box_mesh

from gyriflow.errors import MeshError
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface, signed_volumes
from gyriflow.geometry.triangles import TriangleMesh, flipped, mean_edge_length, merged, transformed
from gyriflow.io.surfaces import write_surface
from gyriflow.mesh.quality import dihedral_angles, quality_summary, radius_ratios, refuse_bad_elements
from gyriflow.mesh.sizing import background_mesh, edge_length_at
from gyriflow.mesh.tetrahedralisation import tetrahedralise

REGULAR = TetrahedralMesh([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]], [[0, 2, 1, 3]])
SCRIPT = Path(__file__).parents[3] / "workflow" / "scripts" / "tetrahedralise.py"
OUTPUTS = {"mesh": "brain.xdmf", "data": "brain.h5", "surface": "pial.stl", "quality": "quality.json"}
SIZES = {"surface_edge_mm": 1.5, "core_edge_mm": 3.0, "envelope_mm": 0.1, "time_limit_s": 120}


def ball(radius=8.0, subdivisions=3):
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return TriangleMesh(shape.vertices, shape.faces)


def test_the_regular_element_is_best():
    assert radius_ratios(REGULAR)[0] == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(dihedral_angles(REGULAR), np.degrees(np.arccos(1 / 3)), rtol=1e-12)


def test_the_corner_element_has_its_known_quality():
    corner = TetrahedralMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    inscribed, circumscribed = 1 / (3 + np.sqrt(3)), np.sqrt(3) / 2
    assert radius_ratios(corner)[0] == pytest.approx(3 * inscribed / circumscribed, rel=1e-12)
    angles = np.sort(dihedral_angles(corner)[0])
    np.testing.assert_allclose(angles, [np.degrees(np.arccos(1 / np.sqrt(3)))] * 3 + [90] * 3, rtol=1e-12)


def test_flat_elements_are_refused_with_their_place():
    flat = TetrahedralMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1e-3]], [[0, 1, 2, 3]])
    with pytest.raises(MeshError, match=r"1 of 1 elements.*radius ratio 0\.00"):
        refuse_bad_elements(flat, 0.02)
    refuse_bad_elements(REGULAR, 0.99)


def test_the_summary_counts_every_element_once():
    summary = quality_summary(box_mesh((3, 3, 3), (3.0, 3.0, 3.0)))
    assert summary["tets"] == 162
    assert summary["volume_mm3"] == pytest.approx(27.0)
    assert all(sum(h["counts"]) == 162 for h in summary["histogram"].values())


def test_edge_lengths_grow_with_depth_and_end_at_that_of_the_core():
    lengths = edge_length_at(np.array([0.0, 2.0, 4.0, 100.0]), 0.8, 2.5)
    np.testing.assert_allclose(lengths, [0.8, 0.8, 1.8, 2.5])


def test_the_background_covers_the_surface_with_positive_elements():
    grid, lengths = background_mesh(ball(), 1.5, 3.0)
    assert (signed_volumes(grid) > 0).all()
    assert (grid.vertices.min(axis=0) < -8).all()
    assert (grid.vertices.max(axis=0) > 8).all()
    assert lengths.min() == 1.5


@pytest.fixture(scope="module")
def filled_ball():
    return tetrahedralise(ball(), **SIZES)


def test_a_ball_is_filled_within_the_envelope(filled_ball):
    surface, _ = boundary_surface(filled_ball)
    shape = ball()
    squared = igl.point_mesh_squared_distance(
        surface.vertices.copy(), shape.vertices.copy(), shape.faces.astype(np.int32).copy()
    )[0]
    assert np.sqrt(squared.max()) <= 0.11
    assert (signed_volumes(filled_ball) > 0).all()
    assert mean_edge_length(surface) == pytest.approx(1.5, rel=0.25)


def test_elements_are_coarser_inside(filled_ball):
    centre = np.linalg.norm(filled_ball.vertices[filled_ball.tets].mean(axis=1), axis=1)
    volumes = signed_volumes(filled_ball)
    assert np.median(volumes[centre < 3]) > 2 * np.median(volumes[centre > 7])


def test_two_hemispheres_stay_two():
    halves = merged(ball(4.0, 2), transformed(ball(4.0, 2), [[1, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    mesh = tetrahedralise(halves, **SIZES)
    assert signed_volumes(mesh).sum() == pytest.approx(2 * 4 / 3 * np.pi * 64, rel=0.05)


def test_an_open_or_inverted_surface_is_refused():
    shape = ball(4.0, 2)
    with pytest.raises(MeshError, match="closed and face outwards"):
        tetrahedralise(TriangleMesh(shape.vertices, shape.faces[1:]), **SIZES)
    with pytest.raises(MeshError, match="closed and face outwards"):
        tetrahedralise(flipped(shape), **SIZES)


@pytest.fixture
def dying_mesher(tmp_path, monkeypatch):
    """A mesher that dies with a few last words."""
    (tmp_path / "pytetwild.py").write_text(
        "import os, signal\n"
        "def tetrahedralize(*arrays, **settings):\n"
        "    os.write(1, b'99 % of the elements are inverted')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    # the mesher's process is given this path
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("dying_mesher")
def test_a_mesher_that_dies_leaves_its_last_words():
    with pytest.raises(MeshError, match=r"exit code -9; found 99 % of the elements are inverted\. .*memory ran out"):
        tetrahedralise(ball(), **SIZES)


@pytest.mark.usefixtures("dying_mesher")
def test_the_step_of_a_mesher_that_dies_ends_in_three(tmp_path, capsys):
    write_surface(tmp_path / "pial.surf.gii", ball())
    outputs = {name: str(tmp_path / file) for name, file in OUTPUTS.items()}
    job = SimpleNamespace(
        input=[str(tmp_path / "pial.surf.gii")],
        output=SimpleNamespace(**outputs),
        params=SimpleNamespace(settings=SIZES | {"min_radius_ratio": 0.02}),
        log=[str(tmp_path / "log")],
    )
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(SCRIPT), init_globals={"snakemake": job})
    assert end.value.code == 3
    assert "inverted" in capsys.readouterr().err
    assert "inverted" in (tmp_path / "log").read_text()
    assert not [path for path in outputs.values() if Path(path).exists()]


def test_the_mesher_is_stopped_at_its_time_limit():
    with pytest.raises(MeshError, match=r"stopped after 0\.2 s"):
        tetrahedralise(ball(), **(SIZES | {"time_limit_s": 0.2}))
