"""Limits of a fit to the surfaces of a series: the reach of a pull, the number of
draws, and what is warned of."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from facts import Facts
from shapes import ellipsoid_mesh, rigid, scaling, sphere, uneven

from gyriflow.geometry.deformations import Deformation
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import Floats, TriangleMesh, flipped
from gyriflow.growth import series_shapes
from gyriflow.growth.series_shapes import (
    INNER_MM,
    MAX_OPENING_DRAWS,
    SeriesShapes,
    WeekShape,
    fit_body,
    fit_onto_surface,
    follow_series,
    tissue_below,
    with_stops,
)

BALL = uneven(sphere(20.0, 3), 2.5)
EVERY = np.arange(len(BALL.vertices))


def larger(mm: float) -> TriangleMesh:
    """Return the ball with a larger radius, in other triangles."""
    return sphere(20.0 + mm)


def radii(places: Floats) -> Floats:
    return np.linalg.norm(places, axis=1)


@pytest.mark.parametrize(
    ("mm", "has_tissue", "is_reached"),
    [
        # as far as registration errs
        (3.5, False, True),
        (4.5, False, False),
        (7.0, True, True),
        (9.0, True, False),
    ],
)
def test_a_surface_pulls_further_where_the_tissue_below_is_known(
    mm, has_tissue, is_reached
):
    below = BALL.vertices * ((20.0 + mm - INNER_MM) / 20.0) if has_tissue else None
    found = radii(fit_onto_surface(BALL, larger(mm), inner=below))
    assert found == pytest.approx(np.full(len(found), 20.0 + mm * is_reached), abs=0.1)


def test_a_surface_that_faces_the_other_way_does_not_pull():
    found = fit_onto_surface(BALL, flipped(sphere(21.0, 3)))
    assert found == pytest.approx(BALL.vertices, abs=1e-6)


@dataclass
class StubbornBody:
    """A body that comes a share of the way to its goals, with the number of its draws
    and a way of its own."""

    share: float
    positions_mm: Floats = field(default_factory=lambda: BALL.vertices)
    n_draws: int = 0
    way: list[tuple[float, Floats]] = field(default_factory=list)

    @property
    def boundary(self) -> TriangleMesh:
        return TriangleMesh(self.positions_mm, BALL.faces)

    def follow(self, shape: Floats) -> Floats:
        return self.positions_mm

    def draw(self, goals: Floats) -> Floats:
        self.n_draws += 1
        self.positions_mm = self.positions_mm + self.share * (goals - self.positions_mm)
        return self.positions_mm

    def move_to(self, shape: Floats) -> Floats:
        return self.positions_mm

    def way_from(self, before: Floats) -> list[tuple[float, Floats]]:
        return self.way


@pytest.mark.parametrize(
    ("share", "opens", "n_draws"),
    [
        (1.0, False, 1),
        # close after one draw, hardly closer after one, and closer each time
        (1.0, True, 2),
        (0.02, True, 2),
        (0.3, True, MAX_OPENING_DRAWS + 1),
    ],
)
def test_a_body_is_drawn_until_it_is_close_or_hardly_comes_closer(
    share, opens, n_draws
):
    body = StubbornBody(share)
    below = BALL.vertices * (21.0 - INNER_MM) / 20.0 if opens else None
    fit_body(body, BALL.vertices, (larger(1.0), below), EVERY)
    assert body.n_draws == n_draws


@pytest.mark.parametrize(("mm", "is_warned"), [(0.15, False), (0.4, True)])
def test_a_body_that_stays_from_its_shape_is_warned_of(caplog, mm, is_warned):
    shape = (1 + mm / 20) * BALL.vertices
    body = StubbornBody(1.0)
    fit_body(body, shape, None, EVERY)
    assert body.n_draws == 1
    assert body.positions_mm == pytest.approx(shape)
    assert caplog.messages == []
    fit_body(StubbornBody(0.0), shape, None, EVERY)
    assert caplog.messages == [Facts(f"{mm:.2f} mm")] * is_warned


@dataclass
class FixedBody(StubbornBody):
    """A body that does not move, in a solid mesh."""

    @property
    def boundary(self) -> TriangleMesh:
        return BOUNDARY

    def draw(self, goals: Floats) -> Floats:
        return self.positions_mm


SOLID = ellipsoid_mesh(6, (20.0, 20.0, 20.0))
BOUNDARY, USED = boundary_surface(SOLID)
STILL = Deformation(np.eye(4), np.zeros((9, 9, 9, 3)), scaling(15.0, -60.0))


@pytest.mark.parametrize(("mm", "is_warned"), [(0.15, False), (0.4, True)])
def test_a_body_that_stays_from_its_surface_is_warned_of(caplog, mm, is_warned):
    surface = TriangleMesh((1 + mm / 20) * BOUNDARY.vertices, BOUNDARY.faces)
    body = FixedBody(0.0, SOLID.vertices)
    follow_series(SOLID, [22.0, 23.0], [STILL], [surface], body)
    assert caplog.messages == [Facts("GW 23", "mm")] * is_warned


def test_tissue_below_is_that_of_the_observed_surface_and_of_the_body_at_the_start(
    monkeypatch,
):
    """A body's own normals are rough: their errors would add up from week to week."""
    places = [1.03 * BOUNDARY.vertices, 1.06 * BOUNDARY.vertices]
    surfaces = [TriangleMesh(vertices, BOUNDARY.faces) for vertices in places]
    observed = []

    def record(boundary, surface, pair):
        observed.append(surface.vertices)
        return tissue_below(boundary, surface, pair)

    monkeypatch.setattr(series_shapes, "tissue_below", record)
    body = FixedBody(0.0, SOLID.vertices)
    weeks, pairs = [22.0, 23.0, 24.0], [STILL] * 2
    follow_series(SOLID, weeks, pairs, surfaces, body, has_slits=True)
    assert np.array_equal(observed, [BOUNDARY.vertices, places[0]])
    # 2 mm below the surface, moved by the registration
    shift = Deformation(rigid(shift=(5.0, 0, 0)), STILL.displacement, STILL.affine)
    below = tissue_below(BALL, larger(0.5), shift)
    assert np.abs(radii(below - [5.0, 0, 0]) - 18.5).max() < 0.1


def test_stops_that_round_to_a_week_are_no_stops():
    places = BALL.vertices
    body = StubbornBody(1.0, way=[(0.004, places), (0.5, 2 * places), (0.996, places)])
    shapes = with_stops(WeekShape(22.0, places), 23.0, body)
    # an interrupted series goes on from what it was
    for found in (shapes, SeriesShapes.of(shapes).by_week()):
        weeks = [(shape.week, shape.is_stop) for shape in found]
        assert weeks == [(22.5, True), (23.0, False)]
        assert found[0].positions == pytest.approx(2 * places)
