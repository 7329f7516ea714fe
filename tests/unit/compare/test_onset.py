"""Sulci, their names and the week when they appear, in grooves of known depth."""

import numpy as np
import pytest
from shapes import sphere

from gyriflow.compare.onset import find_named_sulci, find_onset, find_sulci, measure_relief, name_sulci, onset_table
from gyriflow.geometry.triangles import TriangleMesh

BALL = sphere(20.0)
POINTS, FACES = BALL.vertices, BALL.faces


def groove(depth: float) -> tuple[TriangleMesh, np.ndarray]:
    """Return a sphere with a groove along the equator's front, and the depth of its vertices below the ball."""
    across, along = POINTS[:, 2], np.abs(np.arctan2(POINTS[:, 1], POINTS[:, 0])) * 20
    depths = depth * np.exp(-((across / 2) ** 2)) * (along < 15)
    return TriangleMesh(POINTS * (1 - depths / 20)[:, None], FACES), depths


REGIONS = np.where((np.abs(POINTS[:, 2]) < 1.5) & (POINTS[:, 0] > 17), 1, np.where(POINTS[:, 0] < -19, 2, 0))
NAMES = {1: "central", 2: "calcarine", 3: "nowhere"}


def test_relief_is_bottom_below_crowns_not_depth_below_the_hull():
    mesh, depths = groove(3.0)
    reliefs = measure_relief(mesh, depths, REGIONS, NAMES)
    assert reliefs["central"] == pytest.approx(3.0, abs=0.35)
    assert reliefs["calcarine"] == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(reliefs["nowhere"])
    # a wide place that lies deep, as the insula does, is no sulcus
    sunken = measure_relief(mesh, np.where(POINTS[:, 0] > 0, 6.0, 0.0), REGIONS, NAMES)
    assert sunken["central"] == 0


def reliefs_of(depths):
    """Return the reliefs of two regions by week."""
    return {week: {"central": depth, "calcarine": 0.1} for week, depth in depths.items()}


def test_onset_is_when_two_millimetres_are_reached_whatever_the_order_of_weeks():
    depths = {25.5: 3.5, 21.0: 0.0, 24.0: 2.8, 22.0: 1.0}
    for order in (list(depths), sorted(depths), sorted(depths, reverse=True)):
        table = find_onset(reliefs_of({week: depths[week] for week in order})).set_index("region")
        # from 1.0 mm at 22 to 2.8 mm at 24 GW
        assert table.loc["central", "onset_week"] == pytest.approx(22 + 2 * 1.0 / 1.8)
        assert tuple(table.loc["central", ["first_relief_mm", "last_relief_mm"]]) == (0.0, 3.5)
        assert not table.loc["central", "there_at_start"]
        assert np.isnan(table.loc["calcarine", "onset_week"])


def test_what_is_there_at_the_start_has_no_onset_and_an_unknown_week_is_skipped():
    late = find_onset(reliefs_of({24.0: 2.8, 25.0: 3.5})).set_index("region")
    assert late.loc["central", "there_at_start"]
    assert np.isnan(late.loc["central", "onset_week"])
    unknown = find_onset(reliefs_of({22.0: np.nan, 24.0: 2.8})).set_index("region")
    assert unknown.loc["central", "onset_week"] == 24.0


def test_sulci_are_valleys_found_by_their_depth():
    mesh, depths = groove(4.0)
    bend = np.where(depths > 1.0, -0.2, 0.05)
    regions = find_sulci(mesh, depths, bend)
    assert set(regions) == {0, 1}
    inside = regions == 1
    assert depths[inside].min() >= 2.0 > depths[~inside].min()
    assert not find_sulci(mesh, depths, np.abs(bend)).any()
    assert not find_sulci(*groove(1.0), bend).any()


def test_sulci_are_named_by_the_regions_that_they_lie_in():
    longitude = np.degrees(np.arctan2(POINTS[:, 1], POINTS[:, 0]))
    band = np.abs(POINTS[:, 2]) < 3
    # a long valley over two regions and a bit of a third, a short one in the second, and one in none
    sulci = np.select(
        [band & (np.abs(longitude + 10) < 50), band & (np.abs(longitude - 90) < 12), POINTS[:, 2] < -18.5], [1, 2, 3], 0
    )
    regions = np.select([POINTS[:, 2] < -10, longitude < -57, longitude < 0], [0, 9, 4], 7)
    mesh = TriangleMesh(POINTS, FACES)
    found, names = name_sulci(mesh, sulci, regions, {4: "central", 7: "calcarine", 9: "cingulate"}, "left")
    assert sorted(names.values()) == ["left 3", "left calcarine", "left calcarine 2", "left central"]
    of = {name: found == number for number, name in names.items()}
    assert np.array_equal(of["left calcarine"], (sulci == 1) & (regions == 7))
    # the bit of the third goes to the largest part, and nothing is lost
    assert np.array_equal(of["left central"] | of["left calcarine"], sulci == 1)
    assert np.array_equal(of["left calcarine 2"], sulci == 2)
    assert np.array_equal(of["left 3"], sulci == 3)
    assert np.array_equal(found > 0, sulci > 0)
    # without names all is as it was
    same, numbers = name_sulci(mesh, sulci, regions, {}, "left")
    assert sorted(numbers.values()) == ["left 1", "left 2", "left 3"]
    assert {numbers[int(number)] for number in np.unique(same[sulci == 2])} == {"left 2"}


FINE = sphere(20.0, 5)


def carved(depth: float, size: float = 1.0) -> TriangleMesh:
    """Return a sphere with a wide groove of a depth in mm along the equator's front."""
    across, along = FINE.vertices[:, 2], np.abs(np.arctan2(FINE.vertices[:, 1], FINE.vertices[:, 0])) * 20
    depths = depth * np.exp(-((across / 3) ** 2)) * (along < 28)
    return TriangleMesh(size * FINE.vertices * (1 - depths / 20)[:, None], FINE.faces)


def test_a_sulcus_of_the_last_brain_appears_when_its_relief_is_reached():
    last = carved(4.0)
    labels = np.where(FINE.vertices[:, 0] > 0, 5, 6)
    sulci, names = find_named_sulci(last, "left", labels, {5: "front", 6: "back"}, radius_mm=3.0)
    assert names == {1: "left front"}
    bottom = np.linalg.norm(last.vertices, axis=1) < 17
    assert (sulci[bottom] == 1).all()
    # smaller brains with shallower grooves, their vertices carried onto the last one; the hull lies below the ball
    surfaces = {21.0: carved(1.5, 0.9), 23.0: carved(2.2), 25.0: carved(4.0)}
    (row,) = onset_table(surfaces, [last] * 3, last, sulci, names).to_dict("records")
    assert row["region"] == "left front"
    assert row["first_relief_mm"] == pytest.approx(0.9 * 0.9, abs=0.2)
    assert row["last_relief_mm"] == pytest.approx(3.2, abs=0.2)
    assert row["onset_week"] == pytest.approx(23.5, abs=0.3)
    # a sulcus that no vertex is carried into is not known
    elsewhere = TriangleMesh(last.vertices * [-1, -1, 1], last.faces)
    assert np.isnan(onset_table({25.0: last}, [elsewhere], last, sulci, names)["first_relief_mm"].item())


def test_sulci_of_a_brain_without_regions_are_numbered():
    _, names = find_named_sulci(carved(4.0), "right", None, {}, radius_mm=3.0)
    assert names == {1: "right 1"}
