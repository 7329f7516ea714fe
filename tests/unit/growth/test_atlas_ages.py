"""Ages of an atlas' brains by their sizes."""

import numpy as np
import pytest
from facts import Facts
from shapes import ellipsoid_mesh

from gyriflow.growth.atlas_path import (
    MIN_AGE_SPACING_GW,
    ages_by_size,
    other_volumes,
    resample_by_size,
)
from gyriflow.growth.series_shapes import sizes_of
from gyriflow.io.yaml_files import read_yaml
from gyriflow.shipped import SHIPPED

WEEKS = np.arange(21.0, 33.0)
SMOOTH = 60 * np.exp(0.1 * (WEEKS - 21) - 0.002 * (WEEKS - 21) ** 2)


def test_an_atlas_that_grows_smoothly_keeps_its_weeks():
    ages = ages_by_size(WEEKS, SMOOTH)
    assert ages.ages == pytest.approx(WEEKS, abs=0.05)
    assert ages.volume(25.5) == pytest.approx(60 * np.exp(0.45 - 0.0405), rel=0.005)


def test_a_week_that_jumps_in_size_is_taken_for_the_age_of_its_size():
    volumes = SMOOTH.copy()
    volumes[4] *= 1.12
    ages = ages_by_size(WEEKS, volumes)
    table = ages.table().set_index("stated_week")
    rate = 0.1 - 0.004 * 4
    assert table.loc[25.0, "age_by_size"] == pytest.approx(
        25 + np.log(1.12) / rate, abs=0.25
    )
    assert table.loc[25.0, "curve_ml"] == pytest.approx(SMOOTH[4], rel=0.02)
    assert table.loc[25.0, "volume_ml"] == pytest.approx(volumes[4])
    others = table.drop(index=[25.0, 26.0])
    assert others["age_by_size"].to_numpy() == pytest.approx(
        others.index.to_numpy(), abs=0.2
    )
    assert (np.diff(ages.ages) >= MIN_AGE_SPACING_GW - 1e-9).all()


def test_one_growth_is_that_of_all_populations_and_the_level_that_of_the_atlas():
    weeks = np.arange(22.0, 35.0)
    true = 50 * np.exp(0.12 * (weeks - 22) - 0.002 * (weeks - 22) ** 2)
    # one atlas grows more slowly by 6 % in all, and the other as much faster
    slow = true * np.exp(-0.06 * (weeks - 22) / 12)
    fast = 1.5 * true * np.exp(0.06 * (weeks - 22) / 12)
    # known in other weeks too
    larger = dict(zip(weeks.tolist(), fast.tolist(), strict=True))
    others = [larger | {20.0: 1.0, 40.0: 1000.0}]
    found = ages_by_size(weeks, slow, others)
    wanted = true[11] / true[1]
    assert found.volume(33) / found.volume(23) == pytest.approx(wanted, rel=0.01)
    middle = (weeks == 28).argmax()
    assert found.volume(28) == pytest.approx(slow[middle], rel=0.02)
    assert found.curve.weeks[[0, -1]].tolist() == [22.0, 34.0]
    # whatever level the others have
    tenth = [{week: 0.1 * volume for week, volume in others[0].items()}]
    again = ages_by_size(weeks, slow, tenth)
    assert again.curve.values == pytest.approx(found.curve.values, rel=1e-6)


def test_shape_follows_the_ages_and_size_the_curve():
    mesh = ellipsoid_mesh(4, (20.0, 24.0, 18.0))
    # longer every week, and one week is too large
    shapes = [mesh.vertices * [1.0, 1 + 0.02 * k, 1.0] for k in range(len(WEEKS))]
    volumes = [sizes_of(mesh, [shape])["volume_ml"][0] for shape in shapes]
    atlas = np.stack(
        [
            shape * np.cbrt(volume / size)
            for shape, size, volume in zip(shapes, volumes, SMOOTH, strict=True)
        ]
    )
    atlas[4] *= 1.04
    ages = ages_by_size(WEEKS, sizes_of(mesh, atlas)["volume_ml"])
    found = resample_by_size(mesh, atlas, WEEKS, ages, ages.ages)
    assert sizes_of(mesh, found)["volume_ml"] == pytest.approx(SMOOTH, rel=0.02)

    def length(places):
        return np.ptp(places[:, 1]) / np.ptp(places[:, 0])

    # the brain called 25 weeks is that of a later one
    assert ages.ages[4] > 26
    assert length(found[4]) < length(atlas[4]) - 0.01
    assert length(found[8]) == pytest.approx(length(atlas[8]), abs=0.01)


def test_the_first_brain_keeps_its_weight_and_ages_far_from_the_stated_ones_are_said(
    caplog,
):
    # CRL's volumes from 24 GW on: the first brain is far below the others
    weeks = np.arange(24.0, 35.0)
    volumes = [
        78.3,
        109.1,
        123.4,
        129.9,
        143.8,
        158.8,
        173.9,
        193.9,
        214.0,
        226.2,
        251.7,
    ]
    found = ages_by_size(weeks, volumes)
    assert found.ages[0] == pytest.approx(24.0, abs=1.0)
    assert found.volume(26) == pytest.approx(volumes[2], rel=0.12)
    volumes[5] *= 1.25
    jumping = ages_by_size(weeks, volumes)
    late = weeks[np.abs(jumping.ages - weeks) > 1.0]
    assert [Facts(f"{week:g} GW") == caplog.text for week in late] == [True] * len(late)
    assert len(late) > 0


def test_the_volumes_of_other_populations_are_read_without_those_left_out():
    content = {
        "sources": {
            "crl": {"volume_ml": {21: 51.9, 22: 60.3}},
            "chinese": {"volume_ml": {22: 60.1}},
        }
    }
    assert other_volumes(content, ["crl", "mine"]) == [{22.0: 60.1}]
    shipped = read_yaml(SHIPPED / "norms" / "volumes.yaml")
    assert [len(volumes) for volumes in other_volumes(shipped, [])] == [18, 14]
