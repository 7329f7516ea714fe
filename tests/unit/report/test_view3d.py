"""The 3D view shows the surfaces that there are, small enough, with the values of their
maps."""

from base64 import b64decode

import numpy as np
import pytest
from facts import Facts
from shapes import sphere

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh, volume_ml
from gyriflow.report import view3d
from gyriflow.report.view3d import surfaces_view

BALL = sphere(20.0)


def shorts(text: str) -> np.ndarray:
    return np.frombuffer(b64decode(text), dtype="<u2")


def drawn(runs, observed=()) -> dict:
    return surfaces_view(runs, observed, observed_name="observed brain")


def positions(data: dict, frame: dict) -> np.ndarray:
    """Return positions as the view makes them."""
    return (
        np.array(data["low"])
        + shorts(frame["positions"]).reshape(-1, 3) / 65535 * data["size"]
    )


def growing(values: np.ndarray | None = None) -> list:
    """Return a ball of 21 GW that is a fifth larger at 22 GW, each as one half with a
    map."""
    mesh, maps = BALL, {} if values is None else {"curvedness": values}
    return [
        (21.0, [(mesh, maps)]),
        (22.0, [(TriangleMesh(1.2 * mesh.vertices, mesh.faces), maps)]),
    ]


def test_thinning_keeps_the_shape(monkeypatch):
    monkeypatch.setattr(view3d, "MAX_VERTICES", 600)
    data = drawn({"thin": growing()})
    (group,) = data["groups"]
    places = positions(data, group["frames"][0])
    assert len(places) == pytest.approx(600, rel=0.1)
    coarse = TriangleMesh(places, shorts(group["faces"]).reshape(-1, 3).astype(int))
    assert volume_ml(coarse) == pytest.approx(volume_ml(BALL), rel=0.03)


def test_a_run_has_one_triangulation_and_its_positions_each_week():
    data = drawn({"thin": growing()})
    (group,) = data["groups"]
    places = [positions(data, frame) for frame in group["frames"]]
    assert [frame["week"] for frame in group["frames"]] == [21.0, 22.0]
    assert np.linalg.norm(places[0], axis=1) == pytest.approx(20.0, abs=2e-3)
    assert places[1] == pytest.approx(1.2 * places[0], abs=3e-3)
    assert shorts(group["faces"]).max() == len(places[0]) - 1


def test_values_of_a_map_are_levels_of_its_scale_and_unknown_ones_are_reported():
    values = np.linspace(0.0, 0.2, len(BALL.vertices))
    values[0] = np.nan
    data = drawn({"thin": growing(values)})
    described, _ = data["maps"]
    levels = np.frombuffer(
        b64decode(data["groups"][0]["frames"][0]["values"]["curvedness"]),
        dtype=np.uint8,
    )
    assert levels[0] == 255
    assert levels[1:] / 254 * described["high"] == pytest.approx(
        values[1:].clip(max=described["high"]), abs=1e-3
    )
    assert len(b64decode(described["colours"])) == 3 * 255


def test_displacement_is_measured_from_the_first_week():
    data = drawn({"thin": growing()}, growing())
    assert [described["name"] for described in data["maps"]] == ["displacement_mm"]
    simulated, real = data["groups"]
    start, later = (
        b64decode(frame["values"]["displacement_mm"]) for frame in simulated["frames"]
    )
    assert set(start) == {0}
    moved_mm = np.frombuffer(later, dtype=np.uint8) / 254 * data["maps"][0]["high"]
    assert moved_mm == pytest.approx(4.0, abs=0.02)
    # what was measured has not moved
    assert real["name"] == "observed brain"
    assert not any(frame["values"] for frame in real["frames"])


def test_surfaces_of_a_run_with_other_vertices_are_refused():
    with pytest.raises(InputError, check=Facts("22 GW", 642, 2562)):
        drawn({"thin": [growing()[0], (22.0, [(sphere(20.0, 3), {})])]})
