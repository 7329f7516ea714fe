"""Which jobs the workflow plans for the demo and for the examples, one dry run each."""

import pytest
import yaml
from facts import Facts

from gyriflow.shipped import DEMO

from .conftest import CHECKOUT

EXAMPLES = CHECKOUT / "config" / "examples"


def test_the_demo_is_planned_from_any_folder(workflow, capsys):
    jobs = workflow.jobs()
    said = capsys.readouterr().err.partition("\n")[0]
    assert said == Facts("gyriflow:", "demo", DEMO)
    assert jobs["pial_with_thickness"] == 3
    assert jobs["measure"] == 3
    assert jobs["measure_simulated"] == 3 * jobs["simulate"]
    assert "atlas_file" not in jobs
    assert jobs["simulate"] >= 1
    assert jobs["html_report"] == 1


def test_a_registration_waits_for_the_images_that_it_reads(workflow):
    week = "spina-bifida-unoperated-{}".format
    atlas = {"name": "spina-bifida", "series": "unoperated", "images": True}
    study = {"atlas": atlas, "start": week(21), "folding": {"end_week": 22}}
    registered = f"results/study/registration/{week(21)}/{week(22)}.h5"
    jobs = workflow.jobs(
        registered, "--configfile", workflow.write("study.yaml", study)
    )
    assert jobs == {"atlas_file": 2, "register": 1}


EXPECTED = {
    # a brain a week, of which eight are of an output week after the start
    "spina-bifida-atlas": (
        "all",
        {
            "pial_with_thickness": 5,
            "simulate": 2,
            "measure": 5,
            "measure_simulated": 10,
            "register": 4,
        },
    ),
    "simple-shapes": ("all", {"shape": 1, "pial": 1, "simulate": 2}),
    # twelve members: one is the reference, one is in both sweeps; the observed brain
    # of 28 and 29 GW
    "paper": (
        "paper",
        {
            "simulate": 2,
            "simulate_member": 10,
            "compare_member": 12,
            "sweep_tables": 2,
            "tetrahedralise": 1,
        }
        | {"measure": 2},
    ),
    "calibration": (
        "calibrate",
        {"calibration_design": 4, "simulate_member": 24, "calibration_score": 24},
    ),
    "crl-atlas": ("all", {"atlas_file": 9, "pial_with_thickness": 9}),
    "dhcp-atlas": ("all", {"atlas_file": 48, "pial_with_thickness": 16, "pial": 16}),
    # a stage plans no later one
    "labels-and-hemispheres": (
        "growth",
        {
            "growth_figure": 1,
            "tetrahedralise": None,
            "simulate": None,
            "html_report": None,
        },
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("example", EXPECTED)
def test_an_example_is_planned(workflow, example):
    """Narrow licences are accepted first, and files that an example expects to lie
    there do."""
    target, expected = EXPECTED[example]
    text = (
        (EXAMPLES / f"{example}.yaml")
        .read_text()
        .replace("accept_licence: false", "accept_licence: true")
    )
    folder = workflow.directory / "config" / "examples"
    folder.mkdir(parents=True)
    (folder / "study.yaml").write_text(text)
    for brain in yaml.safe_load(text).get("brains", []):
        for name in ("pial", "labels"):
            for place in (workflow.directory, folder):
                if name in brain and not (place / brain[name]).exists():
                    (place / brain[name]).parent.mkdir(parents=True, exist_ok=True)
                    (place / brain[name]).touch()
    jobs = workflow.jobs(target, "--configfile", "config/examples/study.yaml")
    assert {rule: jobs.get(rule) for rule in expected} == expected
    assert ("atlas_file" in jobs) == ("atlas_file" in expected)
