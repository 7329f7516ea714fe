"""Ages of an atlas' brains by their sizes."""

import numpy as np
import pytest
from facts import Facts

from gyriflow.growth.atlas_path import (
    MIN_AGE_SPACING_GW,
    ages_by_size,
    other_volumes,
)
from gyriflow.growth.curves import value
from gyriflow.io.yaml_files import read_yaml
from gyriflow.shipped import SHIPPED


def test_one_growth_is_that_of_all_populations_and_the_level_that_of_the_atlas():
    weeks = np.arange(22.0, 35.0)
    true = 50 * np.exp(0.12 * (weeks - 22) - 0.002 * (weeks - 22) ** 2)
    # the atlas grows more slowly by 6 % in all, and another one as much faster
    slower = np.exp(-0.06 * (weeks - 22) / 12)
    fast = dict(zip(weeks.tolist(), (1.5 * true / slower).tolist(), strict=True))
    # known in other weeks too
    others = fast | {20.0: 1.0, 40.0: 1000.0}
    found = ages_by_size(weeks, true * slower, [others])
    early, middle, late = value(found.curve, [23, 28, 33])
    assert late / early == pytest.approx(true[11] / true[1], rel=0.01)
    assert middle == pytest.approx((true * slower)[6], rel=0.02)
    assert found.curve.weeks[[0, -1]].tolist() == [22.0, 34.0]


def test_the_first_brain_keeps_its_weight_and_ages_far_from_the_stated_ones_are_said(
    caplog,
):
    # CRL's volumes from 24 GW on: the first brain is far below the others
    weeks = np.arange(24.0, 35.0)
    volumes = [78.3, 109, 123, 130, 144, 159, 174, 194, 214, 226, 252]
    found = ages_by_size(weeks, volumes)
    assert found.ages[0] == pytest.approx(24.0, abs=1.0)
    assert value(found.curve, 26) == pytest.approx(volumes[2], rel=0.12)
    volumes[5] *= 1.25
    ages = ages_by_size(weeks, volumes).ages
    assert (np.diff(ages) >= MIN_AGE_SPACING_GW - 1e-9).all()
    late = weeks[np.abs(ages - weeks) > 1.0]
    assert len(late) > 0
    for week in late:
        assert Facts(f"{week:g} GW") == caplog.text


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
