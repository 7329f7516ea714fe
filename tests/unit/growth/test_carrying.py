import numpy as np
import pytest
from shapes import ellipsoid_mesh, rigid, sphere

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import Deformation, carry
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.growth.carrying import carry_over_weeks, maps_on_template

GRID = np.diag([4.0, 4.0, 4.0, 1.0])
GRID[:3, 3] = -30.0


def affine_map(matrix: np.ndarray) -> Deformation:
    return Deformation(matrix, np.zeros((16, 16, 16, 3)), GRID)


def scaled(factor: float, shift: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    matrix = np.diag([factor] * 3 + [1.0])
    matrix[:3, 3] = shift
    return matrix


BALL = ellipsoid_mesh(10, (10.0, 10.0, 10.0))


def test_points_are_carried_in_turn():
    chain = [affine_map(scaled(1.1, (1, 0, 0))), affine_map(scaled(1.2))]
    positions = carry_over_weeks(BALL.vertices, chain)
    assert positions.shape == (3, len(BALL.vertices), 3)
    assert positions[2] == pytest.approx(1.2 * (1.1 * BALL.vertices + [1, 0, 0]))
    with pytest.raises(InputError, match=r"beyond the grid.*interval 1 of 2.*up to 40 mm"):
        carry_over_weeks(BALL.vertices + [60.0, 0, 0], chain)


def test_maps_come_to_the_vertices_of_a_template():
    """A brain that is the template bent and turned, with other triangles; its maps are functions of the place."""
    points = np.stack(np.meshgrid(*[np.arange(16) * 4.0 - 30.0] * 3, indexing="ij"), axis=-1)
    bend = 1.5 * np.sin(points[..., [1, 2, 0]] / 8.0)
    between = Deformation(rigid(0, 0, 25, shift=(5, 0, -3)), bend, GRID)
    template, other = sphere(subdivisions=3), sphere(subdivisions=5)
    brain = TriangleMesh(carry(between, other.vertices), other.faces)

    def waves(places):
        return np.sin(places[:, 0] / 4.0) + places[:, 2] / 10.0

    maps = {"waves": waves(brain.vertices), "half": (brain.vertices[:, 1] > 0).astype(float)}
    found = maps_on_template(maps, brain, template, [between])
    places = carry(between, template.vertices)
    assert found["waves"] == pytest.approx(waves(places), abs=0.01)
    clear = np.abs(places[:, 1]) > 0.5
    assert (found["half"] == (places[:, 1] > 0))[clear].all()
    assert set(found["half"]) == {0, 1}
    assert found["template_distance_mm"].max() < 0.05
    # of the template itself, which needs no registration
    assert maps_on_template({"x": brain.vertices[:, 0]}, brain, brain, [])["x"] == pytest.approx(brain.vertices[:, 0])
    with pytest.raises(InputError, match="beyond the grid"):
        maps_on_template(maps, brain, transformed(template, scaled(1, (60, 0, 0))), [between])
