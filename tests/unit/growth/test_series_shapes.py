"""Limits of a fit to the surfaces of a series: the reach of a pull, the number of
draws, and what is warned of."""

import logging
from dataclasses import dataclass, field

import numpy as np
import pytest
from facts import Facts
from shapes import inner, rigid, scaling, sphere, uneven

from gyriflow.geometry.deformations import Deformation
from gyriflow.geometry.triangles import Floats, TriangleMesh, flipped
from gyriflow.growth.series_shapes import (
    INNER_MM,
    MAX_OPENING_DRAWS,
    SeriesShapes,
    WeekShape,
    _carried,
    fit_body,
    fit_onto_surface,
    misfit_mm,
    points_below,
    tissue_below,
    warn_of_misfit,
    with_stops,
)

BALL = uneven(sphere(20.0))
EVERY = np.arange(len(BALL.vertices))


def larger(mm: float) -> TriangleMesh:
    """Return the ball with a larger radius, in other triangles."""
    return sphere(20.0 + mm)


def radii(places: Floats) -> Floats:
    return np.linalg.norm(places, axis=1)


@pytest.mark.parametrize(("mm", "is_reached"), [(3.5, True), (4.5, False)])
def test_a_surface_pulls_as_far_as_registration_errs(mm, is_reached):
    found = radii(fit_onto_surface(BALL, larger(mm)))
    assert found == pytest.approx(np.full(len(found), 20.0 + mm * is_reached), abs=0.1)


@pytest.mark.parametrize(("mm", "is_reached"), [(7.0, True), (9.0, False)])
def test_a_surface_pulls_further_where_the_tissue_below_is_known(mm, is_reached):
    surface = larger(mm)
    below = BALL.vertices * ((20.0 + mm - INNER_MM) / 20.0)
    found = radii(fit_onto_surface(BALL, surface, inner=below))
    assert found == pytest.approx(np.full(len(found), 20.0 + mm * is_reached), abs=0.1)


def test_a_surface_that_faces_the_other_way_does_not_pull():
    found = fit_onto_surface(BALL, flipped(larger(1.0)))
    assert found == pytest.approx(BALL.vertices, abs=1e-6)


def test_the_pull_of_a_surface_is_weighted_by_area():
    """Coarse triangles end at z = 0, where the goal changes: the smoothed pull there is
    the mean of both sides."""
    ball = uneven(sphere(20.0, 5), ratio=3.0)
    half = TriangleMesh(
        ball.vertices * np.where(ball.vertices[:, 2] > 0, 1.05, 1.0)[:, None],
        ball.faces,
    )
    found = radii(fit_onto_surface(ball, half, (4.0,))) - 20.0
    height = ball.vertices[:, 2]
    near = np.abs(height) < 1.0
    assert found[near].mean() == pytest.approx(0.5, abs=0.1)


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
    below = BALL.vertices * (21.0 - INNER_MM) / 20.0
    fit_body(
        body,
        BALL.vertices,
        (larger(1.0), below if opens else None),
        EVERY,
    )
    assert body.n_draws == n_draws


def test_a_body_without_an_observed_surface_is_drawn_to_its_shape_once():
    body = StubbornBody(1.0)
    fit_body(body, 1.02 * BALL.vertices, None, EVERY)
    assert body.n_draws == 1
    assert body.positions_mm == pytest.approx(1.02 * BALL.vertices)


@pytest.mark.parametrize(("mm", "is_warned"), [(0.15, False), (0.4, True)])
def test_a_body_that_stays_from_its_shape_or_surface_is_warned_of(
    caplog, mm, is_warned
):
    fit_body(StubbornBody(0.0), (1 + mm / 20) * BALL.vertices, None, EVERY)
    warn_of_misfit(BALL, larger(mm), 23.0)
    warnings = [
        record.getMessage()
        for record in caplog.records
        if record.levelno >= logging.WARNING
    ]
    assert warnings == [Facts(f"{mm:.2f} mm"), Facts("GW 23", "mm")] * is_warned


def test_a_misfit_is_a_mean_over_area():
    # half a millimetre on the lower half, where triangles are wide
    raised = np.where(BALL.vertices[:, 2] < 0, 1.025, 1.0)[:, None]
    mean, far = misfit_mm(TriangleMesh(BALL.vertices * raised, BALL.faces), BALL)
    assert mean == pytest.approx(0.25, abs=0.03)
    assert far == pytest.approx(0.5, abs=0.05)


def test_stops_that_round_to_a_week_are_no_stops():
    body = StubbornBody(
        1.0,
        way=[(0.004, BALL.vertices), (0.5, 2 * BALL.vertices), (0.996, BALL.vertices)],
    )
    shapes = with_stops(WeekShape(22.0, BALL.vertices), 23.0, body)
    assert [(shape.week, shape.is_stop) for shape in shapes] == [
        (22.5, True),
        (23.0, False),
    ]
    assert shapes[0].positions == pytest.approx(2 * BALL.vertices)
    # an interrupted series goes on from what it was
    again = SeriesShapes.of(shapes).by_week()
    assert [(shape.week, shape.is_stop) for shape in again] == [
        (22.5, True),
        (23.0, False),
    ]


def test_tissue_below_is_that_of_the_observed_surface_and_of_the_body_at_the_start():
    """A body's own normals are rough: their errors would add up from week to week."""
    shift = Deformation(
        rigid(shift=(5.0, 0.0, 0.0)), np.zeros((9, 9, 9, 3)), scaling(15.0, -60.0)
    )
    rough = (
        BALL.vertices
        * (1 + 0.02 * np.random.default_rng(0).choice([-1.0, 1.0], len(EVERY)))[:, None]
    )
    observed = [larger(0.5), larger(1.0)]
    for shapes, expected in (
        ([WeekShape(22.0, rough)], TriangleMesh(rough, BALL.faces)),
        (
            [
                WeekShape(22.0, BALL.vertices),
                WeekShape(22.5, rough, is_stop=True),
                WeekShape(23.0, rough),
            ],
            observed[0],
        ),
    ):
        places, _, target = next(
            _carried(BALL, EVERY, shapes, [shift] * 2, observed, True)
        )
        assert places == pytest.approx(rough + [5.0, 0.0, 0.0])
        surface, below = target
        assert surface is observed[len(shapes) > 1]
        assert below == pytest.approx(
            tissue_below(TriangleMesh(rough, BALL.faces), expected, shift)
        )
    smooth = inner(larger(0.5), INNER_MM).vertices
    assert points_below(larger(0.5)) == pytest.approx(smooth)
    assert np.abs(radii(below - [5.0, 0.0, 0.0]) - 18.5).max() < 0.1
