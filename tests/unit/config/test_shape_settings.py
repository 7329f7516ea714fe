"""Simple shapes in a configuration: every problem is named with its key."""

from configurations import LABELLED, keys, study

from gyriflow.config import load


def shapes(*settings):
    """Returns a configuration of shapes that are called a, b, ... at week 21."""
    brains = [{"id": name, "week": 21, "shape": shape} for name, shape in zip("abcdef", settings, strict=False)]
    return study(brains)


def test_a_shape_is_a_brain_without_files():
    egg, ball = load(shapes({}, {"semi_axes_mm": [30, 30, 30]})).brains
    assert (egg.source, egg.synthetic, egg.files) == ("shape", True, [])
    assert (egg.shape.kind, ball.shape.kind) == ("ellipsoid", "sphere")


def test_sizes_out_of_bounds_axes_too_unequal_and_bumps_too_high_are_refused():
    assert keys(shapes({"semi_axes_mm": [40, 40], "noise": 0.1}, {"semi_axes_mm": [40, 40, 200]})) == [
        "brains[0].shape.semi_axes_mm[2]",
        "brains[0].shape.noise",
        "brains[1].shape.semi_axes_mm[2]",
    ]
    wrong = shapes({"semi_axes_mm": [10, 21, 12]}, {"semi_axes_mm": [10, 10, 10], "noise_mm": 0.3}, {"noise_mm": 0.45})
    assert keys(wrong) == ["brains[0].shape.semi_axes_mm", "brains[1].shape.noise_mm", "brains[2].shape.noise_mm"]
    assert keys(shapes({"semi_axes_mm": [10, 20, 12]}, {"noise_mm": 0.42})) == []


def test_a_shape_is_the_only_source_of_its_brain_and_takes_no_keys_of_others():
    brains = [
        {"id": "a", "week": 21, "shape": {}, **LABELLED},
        {"id": "c", "week": 20, "shape": {}, "coordinates": "lps"},
    ]
    assert keys(study(brains=brains)) == ["brains[0]", "brains[1].coordinates"]
