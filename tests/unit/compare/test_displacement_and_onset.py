import numpy as np
import pandas as pd
import pytest
from shapes import sphere

from gyriflow.compare.onset import named, onset, relief, sulcal_regions
from gyriflow.compare.validation import displacement_table, vector_agreement
from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh

BALL = sphere(20.0)
POINTS, FACES = BALL.vertices, BALL.faces
TURN = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1.0]])


def stretched(week: float, factor: float = 1.0) -> np.ndarray:
    """Return a sphere that grows along x by a tenth a week, and along y by a part of it."""
    grown = 1 + factor * (week - 21) * np.array([0.10, 0.05, 0.0])
    return POINTS * grown


def test_equal_vectors_agree_and_parts_have_their_slope():
    generator = np.random.default_rng(1)
    u, v, weights = generator.normal(size=(50, 3)), generator.normal(size=(50, 3)), generator.uniform(1, 2, 50)
    assert vector_agreement(u, u, weights) == pytest.approx((1.0, 1.0))
    assert vector_agreement(0.4 * u, u, weights) == pytest.approx((1.0, 0.4))
    assert vector_agreement(-u, u, weights) == pytest.approx((-1.0, -1.0))
    assert abs(vector_agreement(u, v, weights)[0]) < 0.3
    assert np.isnan(vector_agreement(0 * u, u, weights)).all()


def test_displacement_agrees_whatever_pose_the_run_is_in():
    weeks = [21, 22, 24]
    measured = np.stack([stretched(week) for week in weeks])
    simulated = np.stack([stretched(week) @ TURN.T + [5, week, 0] for week in weeks])
    table = displacement_table(weeks, simulated, measured, FACES)
    assert table["from_week"].tolist() == [21, 22]
    assert table["test"].tolist() == ["comparison", "comparison"]
    assert table["displacement_r"].tolist() == pytest.approx([1.0, 1.0])
    assert table["displacement_slope"].tolist() == pytest.approx([1.0, 1.0], abs=1e-6)
    assert table["rms_mm"].tolist() == pytest.approx(table["measured_rms_mm"].tolist())
    half = displacement_table(weeks, np.stack([stretched(week, 0.5) for week in weeks]), measured, FACES)
    assert half["displacement_slope"].iloc[0] == pytest.approx(0.5)


def test_uniform_scaling_stands_beside_it():
    measured = np.stack([POINTS, POINTS * [1.1, 1.05, 1.0]])
    table = displacement_table([21, 22], measured, measured, FACES)
    # on a sphere, Σ x² = Σ y² = Σ z²: (0.1 + 0.05)/√(3 (0.1² + 0.05²))
    assert table["displacement_r_scaling"].iloc[0] == pytest.approx(0.15 / np.sqrt(3 * 0.0125), abs=0.01)
    scale = np.cbrt(1.1 * 1.05) - 1
    assert table["displacement_slope_scaling"].iloc[0] == pytest.approx(scale * 0.15 / 0.0125, rel=0.02)
    uniform = np.stack([POINTS, 1.2 * POINTS])
    alike = displacement_table([21, 22], uniform, uniform, FACES)
    assert alike["displacement_r_scaling"].iloc[0] == pytest.approx(1.0)
    assert alike["displacement_slope_scaling"].iloc[0] == pytest.approx(1.0)


def test_bodies_that_nothing_joins_may_move_apart():
    faces = np.concatenate([FACES, FACES + len(POINTS)])
    measured = np.stack(
        [np.concatenate([stretched(week) - [22, 0, 0], stretched(week) + [22, 0, 0]]) for week in (21, 22)]
    )
    apart = np.stack([measured[0], measured[1] + np.repeat([[-3.0, 0, 1], [2, 0, 0]], len(POINTS), axis=0)])
    table = displacement_table([21, 22], apart, measured, faces)
    assert table["displacement_r"].iloc[0] == pytest.approx(1.0)
    assert table["rms_mm"].iloc[0] == pytest.approx(table["measured_rms_mm"].iloc[0])
    one = displacement_table([21, 22], measured[:, : len(POINTS)], measured[:, : len(POINTS)], FACES)
    for name in ("displacement_r_scaling", "displacement_slope_scaling", "measured_rms_mm"):
        assert table[name].iloc[0] == pytest.approx(one[name].iloc[0])


def test_a_single_week_is_refused():
    with pytest.raises(InputError, match="two or more weeks"):
        displacement_table([21], POINTS[None], POINTS[None], FACES)


def groove(depth: float) -> tuple[TriangleMesh, np.ndarray]:
    """Return a sphere with a groove along the equator's front, and the depth of its vertices below the ball."""
    across, along = POINTS[:, 2], np.abs(np.arctan2(POINTS[:, 1], POINTS[:, 0])) * 20
    depths = depth * np.exp(-((across / 2) ** 2)) * (along < 15)
    return TriangleMesh(POINTS * (1 - depths / 20)[:, None], FACES), depths


REGIONS = np.where((np.abs(POINTS[:, 2]) < 1.5) & (POINTS[:, 0] > 17), 1, np.where(POINTS[:, 0] < -19, 2, 0))
NAMES = {1: "central", 2: "calcarine", 3: "nowhere"}


def test_relief_is_bottom_below_crowns_not_depth_below_the_hull():
    mesh, depths = groove(3.0)
    table = relief(mesh, depths, REGIONS, NAMES).set_index("region")
    assert table.loc["central", "relief_mm"] == pytest.approx(3.0, abs=0.35)
    assert table.loc["calcarine", "relief_mm"] == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(table.loc["nowhere", "relief_mm"])
    # a wide place that lies deep, as the insula does, is no sulcus
    sunken = relief(mesh, np.where(POINTS[:, 0] > 0, 6.0, 0.0), REGIONS, NAMES)
    assert sunken["relief_mm"].iloc[0] == 0


def reliefs_of(depths):
    """Return tables of `relief` by week, with what is known of two regions beside the ball."""
    return {
        week: pd.DataFrame({"region": ["central", "calcarine"], "relief_mm": [d, 0.1]}) for week, d in depths.items()
    }


def test_onset_is_when_two_millimetres_are_reached_whatever_the_order_of_weeks():
    depths = {25.5: 3.5, 21.0: 0.0, 24.0: 2.8, 22.0: 1.0}
    for order in (list(depths), sorted(depths), sorted(depths, reverse=True)):
        table = onset(reliefs_of({week: depths[week] for week in order})).set_index("region")
        # from 1.0 mm at 22 to 2.8 mm at 24 GW
        assert table.loc["central", "onset_week"] == pytest.approx(22 + 2 * 1.0 / 1.8)
        assert tuple(table.loc["central", ["first_relief_mm", "last_relief_mm"]]) == (0.0, 3.5)
        assert not table.loc["central", "there_at_start"]
        assert np.isnan(table.loc["calcarine", "onset_week"])


def test_what_is_there_at_the_start_has_no_onset_and_an_unknown_week_is_skipped():
    late = onset(reliefs_of({24.0: 2.8, 25.0: 3.5})).set_index("region")
    assert late.loc["central", "there_at_start"]
    assert np.isnan(late.loc["central", "onset_week"])
    unknown = onset(reliefs_of({22.0: np.nan, 24.0: 2.8})).set_index("region")
    assert unknown.loc["central", "onset_week"] == 24.0


def test_sulci_are_valleys_found_by_their_depth():
    mesh, depths = groove(4.0)
    bend = np.where(depths > 1.0, -0.2, 0.05)
    regions = sulcal_regions(mesh, depths, bend)
    assert set(regions) == {0, 1}
    inside = regions == 1
    assert depths[inside].min() >= 2.0 > depths[~inside].min()
    assert not sulcal_regions(mesh, depths, np.abs(bend)).any()
    assert not sulcal_regions(*groove(1.0), bend).any()


def test_sulci_are_named_by_the_regions_that_they_lie_in():
    longitude = np.degrees(np.arctan2(POINTS[:, 1], POINTS[:, 0]))
    band = np.abs(POINTS[:, 2]) < 3
    # a long valley over two regions and a bit of a third, a short one in the second, and one in none
    sulci = np.select(
        [band & (np.abs(longitude + 10) < 50), band & (np.abs(longitude - 90) < 12), POINTS[:, 2] < -18.5], [1, 2, 3], 0
    )
    regions = np.select([POINTS[:, 2] < -10, longitude < -57, longitude < 0], [0, 9, 4], 7)
    mesh = TriangleMesh(POINTS, FACES)
    found, names = named(mesh, sulci, regions, {4: "central", 7: "calcarine", 9: "cingulate"}, "left")
    assert sorted(names.values()) == ["left 3", "left calcarine", "left calcarine 2", "left central"]
    of = {name: found == number for number, name in names.items()}
    assert np.array_equal(of["left calcarine"], (sulci == 1) & (regions == 7))
    # the bit of the third goes to the largest part, and nothing is lost
    assert np.array_equal(of["left central"] | of["left calcarine"], sulci == 1)
    assert np.array_equal(of["left calcarine 2"], sulci == 2)
    assert np.array_equal(of["left 3"], sulci == 3)
    assert np.array_equal(found > 0, sulci > 0)
    # without names all is as it was
    same, numbers = named(mesh, sulci, regions, {}, "left")
    assert sorted(numbers.values()) == ["left 1", "left 2", "left 3"]
    assert {numbers[int(number)] for number in np.unique(same[sulci == 2])} == {"left 2"}
