"""What of a simple shape in the place of a brain is made again after a change; an example is planned in test_dag.py."""

import pytest

from .conftest import Workflow, labelled

STUDY = {
    "brains": [
        {"id": "ball", "week": 21, "shape": {}},
        {"id": "old", "week": 22, **labelled(22)},
    ],
    "start": "ball",
    "folding": {"end_week": 22, "contact": {"kind": "none"}},
}
TARGET = "results/brains/ball/surface/pial.surf.gii"


@pytest.fixture(scope="module")
def made(checkout_copy, tmp_path_factory):
    """The surface of the shape, which counts as made."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("shape"))
    name = workflow.write("study.yaml", STUDY)
    folder = workflow.directory / "results" / "brains" / "ball" / "surface"
    folder.mkdir(parents=True)
    sides = [f"{side}pial.surf.gii" for side in ("", "left.", "right.")]
    for file in ["shape.surf.gii", "pial.stl", "surface.json", *sides]:
        (folder / file).touch()
    touched = workflow.run(TARGET, "--cores", "1", "--touch", "--forceall", "--configfile", name)
    assert touched.returncode == 0, touched.stderr
    assert workflow.jobs(TARGET, "--configfile", name) == {}
    return workflow


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"surface": {"edge_length_mm": 1.2}}, {"shape": 1, "pial_from_shape": 1}),
        ({"shape": {"semi_axes_mm": [23, 23, 23]}}, {"shape": 1, "pial_from_shape": 1}),
        ({"shape": {"seed": 1}}, {"shape": 1, "pial_from_shape": 1}),
        # defaults written out, and what is for other kinds of input
        ({"shape": {"noise_mm": 0.05}}, {}),
        ({"surface": {"smoothing_iterations": 3, "max_hole_mm": 1.0}}, {}),
    ],
)
def test_exactly_what_depends_on_a_changed_setting_runs_again(made, change, expected):
    study = dict(STUDY)
    if "shape" in change:
        study["brains"] = [STUDY["brains"][0] | change, STUDY["brains"][1]]
    else:
        study |= change
    name = made.write("changed.yaml", study)
    assert made.jobs(TARGET, "--configfile", name) == expected
