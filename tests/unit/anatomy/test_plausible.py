"""Limits within which a surface or volume can be a cerebrum: values on both sides of
each."""

import math

import numpy as np
import pytest
from facts import Facts
from shapes import FAR, ellipsoid, hemisphere, moved

from gyriflow.anatomy.plausible import (
    cut_warnings,
    expected_volume_ml,
    facing_warnings,
    max_cut_share,
    proportion_warnings,
    require_pair,
    require_plausible_size,
    require_plausible_thickness,
    require_single_hemisphere,
    require_whole,
)
from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh, signed_volume, transformed
from gyriflow.units import ML_PER_MM3


def test_the_usual_share_of_a_cut_is_between_those_of_the_weeks_beside():
    assert max_cut_share(24.0) == pytest.approx(2.0 * (0.25 * 0.15 + 0.75 * 0.17))


@pytest.mark.parametrize(
    ("factor", "is_refused"), [(0.19, True), (0.21, False), (5.9, False), (6.1, True)]
)
def test_a_volume_is_refused_outside_a_fifth_and_six_times_the_usual(
    factor, is_refused
):
    volume_mm3 = factor * expected_volume_ml(24.0) / ML_PER_MM3
    if is_refused:
        with pytest.raises(InputError, check=Facts("24")):
            require_plausible_size(volume_mm3, 24.0)
    else:
        assert require_plausible_size(volume_mm3, 24.0)


@pytest.mark.parametrize(
    ("factor", "is_usual"), [(0.54, False), (0.56, True), (1.44, True), (1.46, False)]
)
def test_a_volume_is_doubted_outside_the_usual_ratio(factor, is_usual):
    volume_mm3 = factor * expected_volume_ml(30.0) / ML_PER_MM3
    assert (require_plausible_size(volume_mm3, 30.0) == []) == is_usual


def test_the_expected_volume_is_that_of_the_atlas_and_grows_exponentially():
    assert expected_volume_ml(25.4) == pytest.approx(92.0)
    assert expected_volume_ml(36.6) == pytest.approx(304.0)
    assert expected_volume_ml(31.0) == pytest.approx(math.sqrt(92.0 * 304.0))


@pytest.mark.parametrize(
    ("median", "is_refused"), [(0.09, True), (0.11, False), (19.0, False), (21.0, True)]
)
def test_a_map_is_one_of_thickness_where_its_median_can_be_one(median, is_refused):
    # unmeasured vertices count for nothing, and the factor is that of its unit
    values = np.array([np.nan, 0.0, 0.0, 0.0, median, 2 * median, median / 2]) / 1000
    if is_refused:
        with pytest.raises(InputError, check=Facts("map.gii", f"{median:g}")):
            require_plausible_thickness(values, 1000.0, "map.gii")
    else:
        require_plausible_thickness(values, 1000.0, "map.gii")


@pytest.mark.parametrize("axis", [0, 2])
def test_proportions_are_doubted_outside_those_of_brains(axis):
    low, high = {0: (0.65, 0.93), 2: (0.54, 0.82)}[axis]
    for share, is_usual in (
        (low - 0.01, False),
        (low + 0.01, True),
        (high - 0.01, True),
        (high + 0.01, False),
    ):
        extents = np.array([75.0, 100.0, 68.0])
        extents[axis] = 100.0 * share
        assert (proportion_warnings(extents) == []) == is_usual


@pytest.mark.parametrize(
    ("narrow", "verdict"), [(0.48, "refused"), (0.52, "doubted"), (0.58, "")]
)
def test_a_whole_brain_is_wider_than_a_hemisphere(narrow, verdict):
    brain = transformed(ellipsoid((30.0 * narrow, 30.0, 27.0)), FAR[1])
    if verdict == "refused":
        with pytest.raises(InputError, check=Facts(f"{narrow:.2f}")):
            require_whole(brain, "surface")
    else:
        assert require_whole(brain, "surface") == [Facts(f"{narrow:.2f}")] * bool(
            verdict
        )
    # one that is known to be whole is doubted only
    assert len(require_whole(brain, "surface", refuses=False)) == bool(verdict)
    if narrow < 0.56:
        require_single_hemisphere(brain)
    else:
        with pytest.raises(InputError, check=Facts(f"{narrow:.2f}")):
            require_single_hemisphere(brain)


@pytest.mark.parametrize(
    ("ratio", "verdict"), [(1.14, ""), (1.16, "doubted"), (1.31, "refused")]
)
@pytest.mark.parametrize("larger", ["left", "right"])
def test_two_sides_of_a_brain_have_nearly_the_same_volume(ratio, verdict, larger):
    sides = {"left": hemisphere(-1), "right": hemisphere(1)}
    centre = sides[larger].vertices.mean(axis=0)
    sides[larger] = TriangleMesh(
        centre + np.cbrt(ratio) * (sides[larger].vertices - centre), sides[larger].faces
    )
    if verdict == "refused":
        with pytest.raises(InputError, check=Facts("mL", "30 %")):
            require_pair(sides["left"], sides["right"], 1.3, "RAS")
    else:
        found = require_pair(sides["left"], sides["right"], 1.3, "RAS")
        assert found == [Facts(f"{100 * (ratio - 1):.0f} %")] * bool(verdict)


@pytest.mark.parametrize("along", [[0.0, 1.0, 0.0], [0.0, -0.6, 0.8]])
def test_hemispheres_that_are_shifted_along_the_fissure_are_doubted(along):
    pose = FAR[0]
    left, right = hemisphere(-1), hemisphere(1)
    length = np.cbrt(signed_volume(left))
    for share, is_doubted in ((0.07, False), (0.09, True)):
        shifted = moved(right, *(share * length * np.array(along)))
        found = facing_warnings(
            transformed(left, pose), transformed(shifted, pose), pose[:3, 0]
        )
        assert found == [Facts(f"{share * length:.1f} mm")] * is_doubted


def test_a_large_cut_is_doubted_by_the_week():
    limit = 2.0 * 0.15
    assert cut_warnings(limit - 0.01, 27.0) == []
    assert cut_warnings(limit + 0.01, 27.0) == [Facts("31 %", "30 %", 27)]
