"""Limits within which a surface or volume can be a cerebrum: values on both sides of
each."""

import math
from contextlib import nullcontext

import numpy as np
import pytest
from facts import Facts
from shapes import FAR, ellipsoid

from gyriflow.anatomy.plausible import (
    expected_volume_ml,
    require_plausible_size,
    require_plausible_thickness,
    require_single_hemisphere,
    require_whole,
)
from gyriflow.errors import InputError
from gyriflow.geometry.triangles import transformed
from gyriflow.units import ML_PER_MM3


@pytest.mark.parametrize(
    # with the wrong unit of a header that may give the same size, if any
    ("factor", "units"),
    [
        (1e-3, ["metres", "header says micrometres"]),
        (1e3, ["micrometres", "header says metres"]),
        (0.1, ["centimetres"]),
    ],
)
def test_wrong_unit_is_named(factor, units):
    volume_mm3 = factor**3 * expected_volume_ml(24.0) / ML_PER_MM3
    with pytest.raises(InputError, check=Facts(24, "mL", *units)):
        require_plausible_size(volume_mm3, 24.0)


def test_the_expected_volume_is_that_of_the_atlas_and_grows_exponentially():
    volumes = [expected_volume_ml(week) for week in (25.4, 31.0, 36.6)]
    assert volumes == pytest.approx([92.0, math.sqrt(92.0 * 304.0), 304.0])


@pytest.mark.parametrize(
    ("median", "is_refused"), [(0.09, True), (0.11, False), (19.0, False), (21.0, True)]
)
def test_a_map_is_one_of_thickness_where_its_median_can_be_one(median, is_refused):
    # unmeasured vertices count for nothing, and the factor is that of its unit
    values = np.array([np.nan, 0.0, 0.0, 0.0, median, 2 * median, median / 2]) / 1000
    facts = Facts("map.gii", f"{median:g}")
    with pytest.raises(InputError, check=facts) if is_refused else nullcontext():
        require_plausible_thickness(values, 1000.0, "map.gii")


@pytest.mark.parametrize(
    ("narrow", "is_refused", "is_doubted"),
    [(0.48, True, True), (0.52, False, True), (0.58, False, False)],
)
def test_a_whole_brain_is_wider_than_a_hemisphere(narrow, is_refused, is_doubted):
    brain = transformed(ellipsoid((30.0 * narrow, 30.0, 27.0)), FAR[1])
    facts = Facts(f"{narrow:.2f}")
    with pytest.raises(InputError, check=facts) if is_refused else nullcontext():
        assert require_whole(brain, "surface") == [facts] * is_doubted
    # one that is known to be whole is doubted only
    assert len(require_whole(brain, "surface", refuses=False)) == is_doubted
    with nullcontext() if is_doubted else pytest.raises(InputError, check=facts):
        require_single_hemisphere(brain)
