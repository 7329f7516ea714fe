"""The 3D view shows the surfaces that there are, small enough, with the values of their maps."""

from base64 import b64decode

import numpy as np
import pytest
import pyvista as pv

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.report.labels import DISPLACEMENT
from gyriflow.report.view3d import TimedSurface, thin_out, view_data, with_displacement


def ball(radius: float = 20.0, count: int = 40) -> TriangleMesh:
    body = pv.Sphere(radius=radius, theta_resolution=count, phi_resolution=count)
    return TriangleMesh(np.asarray(body.points, dtype=float), body.regular_faces)


def shorts(text: str) -> np.ndarray:
    return np.frombuffer(b64decode(text), dtype="<u2")


def positions(data: dict, frame: dict) -> np.ndarray:
    """Returns positions as the view makes them."""
    return np.array(data["low"]) + shorts(frame["positions"]).reshape(-1, 3) / 65535 * data["size"]


def growing(values: np.ndarray | None = None) -> list[TimedSurface]:
    mesh = ball()
    return [
        TimedSurface(
            week, TriangleMesh(scale * mesh.vertices, mesh.faces), {} if values is None else {"curvedness": values}
        )
        for week, scale in ((21.0, 1.0), (22.0, 1.2))
    ]


def test_thinning_keeps_vertices_and_the_shape():
    mesh = ball()
    kept, faces = thin_out(mesh, 400)
    assert len(kept) == pytest.approx(400, rel=0.1)
    assert faces.max() == len(kept) - 1
    coarse = pv.PolyData.from_regular_faces(mesh.vertices[kept], faces)
    assert coarse.volume == pytest.approx(pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces).volume, rel=0.03)
    assert len(thin_out(mesh, 10**6)[0]) == len(mesh.vertices)


def test_a_run_has_one_triangulation_and_its_positions_each_week():
    data = view_data({"thin": growing()}, [], measured="real brain")
    (group,) = data["groups"]
    places = [positions(data, frame) for frame in group["frames"]]
    assert [frame["week"] for frame in group["frames"]] == [21.0, 22.0]
    assert np.linalg.norm(places[0], axis=1) == pytest.approx(20.0, abs=2e-3)
    assert places[1] == pytest.approx(1.2 * places[0], abs=3e-3)
    assert shorts(group["faces"]).max() == len(places[0]) - 1


def test_values_of_a_map_are_levels_of_its_scale_and_unknown_ones_are_told():
    count = len(ball().vertices)
    values = np.linspace(0.0, 0.2, count)
    values[0] = np.nan
    data = view_data({"thin": growing(values)}, [], measured="real brain")
    (described,) = data["maps"]
    levels = np.frombuffer(b64decode(data["groups"][0]["frames"][0]["values"]["curvedness"]), dtype=np.uint8)
    assert levels[0] == 255
    assert levels[1:] / 254 * described["high"] == pytest.approx(values[1:].clip(max=described["high"]), abs=1e-3)
    assert len(b64decode(described["colours"])) == 3 * 255


def test_displacement_is_measured_from_the_first_week():
    start, later = with_displacement(growing())
    assert start.maps[DISPLACEMENT].max() == 0
    assert later.maps[DISPLACEMENT] == pytest.approx(4.0, abs=1e-5)


def test_surfaces_of_a_run_with_other_vertices_are_refused():
    with pytest.raises(InputError, match="differ in their vertices"):
        with_displacement([TimedSurface(21.0, ball(), {}), TimedSurface(22.0, ball(count=20), {})])


def test_many_surfaces_are_thinned_more_to_fit_the_budget():
    runs = {f"run{number}": growing() for number in range(8)}
    small = view_data(runs, growing(), measured="real brain", budget_bytes=200_000)
    sent = sum(
        len(frame["positions"]) + len(frame.get("faces", "")) for group in small["groups"] for frame in group["frames"]
    ) + sum(len(group.get("faces", "")) for group in small["groups"])
    assert sent < 200_000
    assert [group["kind"] for group in small["groups"]] == ["simulated"] * 8 + ["real"]
