"""Simple shapes in a configuration: sizes by kind, every problem named with its key, names in figures."""

import pytest
from configurations import LABELLED, problems, study

from gyriflow.config import load


def shapes(*settings):
    """Returns a configuration of shapes that are called a, b, ... at week 21."""
    brains = [{"id": name, "week": 21, "shape": shape} for name, shape in zip("abcdef", settings, strict=False)]
    return study(brains)


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ({"kind": "sphere"}, (23, 23, 23)),
        ({"kind": "sphere", "radius_mm": 30}, (30, 30, 30)),
        ({"kind": "ellipsoid"}, (21, 28, 22)),
        ({"kind": "ellipsoid", "semi_axes_mm": [20, 30, 25]}, (20, 30, 25)),
    ],
)
def test_a_shape_has_the_size_of_its_kind(shape, size):
    (brain,) = load(shapes(shape)).brains
    assert (brain.source, brain.shape.size_mm) == ("shape", size)
    assert brain.synthetic
    assert (brain.shape.noise_mm, brain.shape.seed) == (0.05, 0)
    assert brain.files == []


def test_all_mistakes_in_shapes_are_named_at_once():
    found = problems(
        shapes(
            {"kind": "cube"},
            {"radius_mm": 20},
            {"kind": "sphere", "radius_mm": 200, "noise": 0.1},
            {"kind": "ellipsoid", "semi_axes_mm": [40, 40], "noise_mm": -0.1},
            {"kind": "sphere", "semi_axes_mm": [20, 20, 20]},
            {"kind": "ellipsoid", "radius_mm": 10},
        )
    )
    assert found == [
        "brains[0].shape.kind: Input should be 'sphere' or 'ellipsoid'; found 'cube'",
        "brains[1].shape.kind: Field required",
        "brains[2].shape.radius_mm: Input should be less than or equal to 150; found 200",
        "brains[2].shape.noise: unknown key; did you mean noise_mm?",
        "brains[3].shape.semi_axes_mm[2]: Field required",
        "brains[3].shape.noise_mm: Input should be greater than or equal to 0; found -0.1",
        "brains[4].shape.semi_axes_mm: has no meaning with kind sphere, whose size is radius_mm",
        "brains[5].shape.radius_mm: has no meaning with kind ellipsoid, whose size is semi_axes_mm",
    ]


def test_axes_too_unequal_and_bumps_too_high_are_refused_with_the_bound():
    found = problems(
        shapes(
            {"kind": "ellipsoid", "semi_axes_mm": [10, 21, 12]},
            {"kind": "sphere", "radius_mm": 10, "noise_mm": 0.3},
            {"kind": "ellipsoid", "noise_mm": 0.45},
        )
    )
    assert found == [
        "brains[0].shape.semi_axes_mm: found 21 as the longest; it should be at most 2 times the shortest, 10",
        "brains[1].shape.noise_mm: found 0.3; it should be at most 0.2, a fiftieth of the smallest size in radius_mm",
        "brains[2].shape.noise_mm: found 0.45; it should be at most 0.42, a fiftieth of the smallest size in "
        "semi_axes_mm",
    ]


def test_a_shape_is_the_only_source_of_its_brain_and_takes_no_keys_of_others():
    brains = [
        {"id": "a", "week": 21, "shape": {"kind": "sphere"}, **LABELLED},
        {"id": "b", "week": 50, "shape": {"kind": "sphere"}},
        {"id": "c", "week": 20, "shape": {"kind": "sphere"}, "coordinates": "lps"},
    ]
    assert problems(study(brains=brains)) == [
        "brains[0]: found labels and shape as its source; expected exactly one of labels, hemispheres, hemisphere, "
        "pial, shape",
        "brains[1].week: Input should be less than or equal to 45; found 50",
        "brains[2].coordinates: has no meaning with shape; only with hemispheres or a hemisphere's surface or pial",
    ]
