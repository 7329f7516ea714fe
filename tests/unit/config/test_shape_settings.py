"""Simple shapes in a configuration: sizes by kind, every problem named with its key, names in figures."""

from pathlib import Path
from typing import get_args

import pytest
import yaml
from configurations import problems, study

from gyriflow.config import load
from gyriflow.parameters.synthetic import ShapeKind
from gyriflow.phantom.shapes import shape_surface

EXAMPLE = Path(__file__).parents[3] / "config" / "examples" / "simple-shapes.yaml"


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
        ({"kind": "half-ellipsoid", "semi_axes_mm": [20, 30, 25]}, (20, 30, 25)),
        ({"kind": "slab"}, (40, 40, 12)),
        ({"kind": "slab", "extent_mm": [60, 50, 5]}, (60, 50, 5)),
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
            {"kind": "slab", "extent_mm": [40, 40], "noise_mm": -0.1},
            {"kind": "sphere", "semi_axes_mm": [20, 20, 20]},
            {"kind": "slab", "radius_mm": 10},
        )
    )
    assert found == [
        "brains[0].shape.kind: found 'cube'; it should be 'sphere', 'ellipsoid', 'half-ellipsoid' or 'slab'",
        "brains[1].shape.kind: is missing",
        "brains[2].shape.radius_mm: found 200; it should be less than or equal to 150",
        "brains[2].shape.noise: unknown key; did you mean noise_mm?",
        "brains[3].shape.extent_mm[2]: is missing",
        "brains[3].shape.noise_mm: found -0.1; it should be greater than or equal to 0",
        "brains[4].shape.semi_axes_mm: has no meaning with kind sphere, whose size is radius_mm",
        "brains[5].shape.radius_mm: has no meaning with kind slab, whose size is extent_mm",
    ]


def test_axes_too_unequal_and_bumps_too_high_are_refused_with_the_bound():
    found = problems(
        shapes(
            {"kind": "ellipsoid", "semi_axes_mm": [10, 21, 12]},
            {"kind": "slab", "extent_mm": [40, 40, 10], "noise_mm": 0.3},
            {"kind": "half-ellipsoid", "noise_mm": 0.45},
            {"kind": "slab", "extent_mm": [150, 50, 5]},
        )
    )
    assert found == [
        "brains[0].shape.semi_axes_mm: found 21 as the longest; it should be at most 2 times the shortest, 10",
        "brains[1].shape.noise_mm: found 0.3; it should be at most 0.2, a fiftieth of the smallest size in extent_mm",
        "brains[2].shape.noise_mm: found 0.45; it should be at most 0.42, a fiftieth of the smallest size in "
        "semi_axes_mm",
    ]


def test_a_shape_is_the_only_source_of_its_brain_and_takes_no_keys_of_others():
    brains = [
        {"id": "a", "week": 21, "shape": {"kind": "sphere"}, "phantom": {}},
        {"id": "b", "week": 50, "shape": {"kind": "sphere"}},
        {"id": "c", "week": 20, "shape": {"kind": "sphere"}, "coordinates": "lps"},
    ]
    assert problems(study(brains=brains)) == [
        "brains[0]: found phantom and shape as its source; expected exactly one of labels, segmentation, hemispheres, "
        "hemisphere, pial, phantom, shape",
        "brains[1].week: found 50; it should be less than or equal to 45",
        "brains[2].coordinates: has no meaning with shape; only with hemispheres or hemisphere or pial",
    ]


@pytest.mark.parametrize("week", [15, 20, 40])
def test_a_shape_may_be_of_any_week(week):
    brains = [{"id": "a", "week": week, "shape": {"kind": "sphere"}}]
    assert load(study(brains=brains, folding={"end_week": week + 1})).weeks("reference", "a")[0] == week


@pytest.mark.parametrize("kind", get_args(ShapeKind))
def test_defaults_can_be_made_with_the_default_edge_length(kind):
    config = load(shapes({"kind": kind}))
    settings = config.brains[0].shape
    mesh = shape_surface(kind, settings.size_mm, edge_length_mm=3 * config.surface.edge_length_mm)
    assert len(mesh.faces) > 100


def test_the_example_is_valid_with_each_of_its_shapes():
    text = EXAMPLE.read_text()
    assert load(yaml.safe_load(text)).brain("half-ellipsoid").shape.kind == "half-ellipsoid"
    config = load(yaml.safe_load(text.replace("  # - {id:", "  - {id:")))
    assert {brain.shape.kind for brain in config.brains} == set(get_args(ShapeKind))
    assert {brain.id for brain in config.brains} == set(get_args(ShapeKind))
