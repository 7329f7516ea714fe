"""Which surfaces are taken as matched by their vertices."""

import numpy as np
import pytest
import trimesh

from gyriflow.config import load
from gyriflow.geometry.triangles import TriangleMesh, flipped
from gyriflow.io.surfaces import write_surface
from gyriflow.study import resolve

BALL = trimesh.creation.icosphere(subdivisions=2, radius=30.0)
SURFACE = TriangleMesh(BALL.vertices, BALL.faces)
RUN = {"start": "a", "folding": {"end_week": 23}}


@pytest.fixture
def folder(tmp_path):
    def write(name, mesh):
        write_surface(tmp_path / name, mesh)
        return name

    write("a.gii", SURFACE)
    # other places, another order of the triangles and of their corners
    write("b.gii", flipped(TriangleMesh(1.1 * SURFACE.vertices, SURFACE.faces[::-1])))
    finer = trimesh.creation.icosphere(subdivisions=3, radius=30.0)
    write("fine.gii", TriangleMesh(finer.vertices, finer.faces))
    turned = SURFACE.faces.copy()
    turned[0, 0] = next(corner for corner in range(len(SURFACE.vertices)) if corner not in turned[0])
    write("other.gii", TriangleMesh(SURFACE.vertices, turned))
    (tmp_path / "torn.gii").write_text("")
    return tmp_path


def series(folder, *files, **changes):
    brains = [
        {"id": name, "week": 21 + number, **({"pial": file} if isinstance(file, str) else file)}
        for number, (name, file) in enumerate(zip("abcdef", files, strict=False))
    ]
    return resolve(load(RUN | {"brains": brains} | changes, folder)).series


def test_equal_triangles_in_any_order_are_matched(folder):
    found = series(folder, "a.gii", "b.gii", "a.gii")
    assert found.matched == {"surface": {"a", "b", "c"}}
    assert found.unmatched == {}


@pytest.mark.parametrize(
    ("file", "cause"),
    [
        ("fine.gii", "b has 642 vertices and 1280 triangles where a has 162 and 320"),
        ("other.gii", "b has other triangles than a"),
        ("torn.gii", "torn.gii: cannot be read as GIFTI"),
        ({"hemispheres": {"left": "a.gii", "right": "b.gii"}}, "b is given as hemispheres, a as pial"),
    ],
)
def test_others_are_not_and_say_why(folder, file, cause):
    found = series(folder, "a.gii", file, "b.gii")
    assert found.matched == {}
    assert cause in found.unmatched["surface"]


def test_hemispheres_match_side_by_side(folder):
    pair = {"hemispheres": {"left": "a.gii", "right": "fine.gii"}}
    assert series(folder, pair, pair).matched == {"surface": {"a", "b"}}
    swapped = {"hemispheres": {"left": "fine.gii", "right": "a.gii"}}
    assert "b has 642 vertices" in series(folder, pair, swapped).unmatched["surface"]


def test_an_atlas_is_believed_until_its_files_are_there(folder):
    named = {"name": "dhcp-surface", "weeks": [21, 22], "folder": str(folder)}
    found = resolve(load({"atlas": named, "start": "first", "folding": {"end_week": 22}}, folder)).series
    assert list(found.matched.values()) == [{"dhcp-surface-21", "dhcp-surface-22"}]
    for week, file in ((21, "a.gii"), (22, "fine.gii")):
        for side in ("left", "right"):
            (folder / f"fetal.week{week}.{side}.pial.surf.gii").write_bytes((folder / file).read_bytes())
    found = resolve(load({"atlas": named, "start": "first", "folding": {"end_week": 22}}, folder)).series
    assert found.matched == {}
    assert np.all(["dhcp-surface-22 has 642 vertices" in cause for cause in found.unmatched.values()])
