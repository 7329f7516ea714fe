"""Which stages run again after a change of settings, brains, code or files, and that no
other does."""

import copy
import os
import re
from collections import Counter
from contextlib import contextmanager

import pytest

from .conftest import SMALL_STUDY, Workflow, labelled

pytestmark = pytest.mark.slow

STAGES = (
    *("pial_with_thickness", "growth_curves", "growth_rates", "growth_figure"),
    *("tetrahedralise", "prepare", "simulate", "measure_simulated", "measure"),
    *("validation", "study_records", "html_report"),
)
"""The rules that stand for all: tables and figures follow what they are made of."""
CONFIGURED = ("--configfile", "study.yaml")
REPORT = {"html_report": 1}
RESULTS = REPORT | {"study_records": 1}
ONE_RUN = RESULTS | {
    "prepare": 1,
    "simulate": 1,
    "measure_simulated": 2,
    "validation": 1,
}
BOTH_RUNS = RESULTS | {
    rule: 2 * count for rule, count in ONE_RUN.items() if rule not in RESULTS
}
CURVES = {"growth_curves": 1, "growth_rates": 1, "growth_figure": 1}
# of the surface of a measured brain that starts no run: its own, and what compares
# others with it
OF_THE_OTHER_BRAIN = (
    RESULTS
    | CURVES
    | {
        "pial_with_thickness": 1,
        "measure": 1,
        "validation": 2,
    }
)


def planned(workflow: Workflow, *arguments: str) -> dict[str, int]:
    """Return the jobs of `STAGES` that a dry run plans."""
    return {
        rule: count
        for rule, count in workflow.jobs(*arguments).items()
        if rule in STAGES
    }


@contextmanager
def changed_files(root, *names, content=b"\n# changed\n"):
    """Have something else at the end of files of a checkout or study for as long as the
    block lasts."""
    kept = {
        root / name: ((root / name).read_bytes(), (root / name).stat())
        for name in names
    }
    try:
        for path, (before, _) in kept.items():
            path.write_bytes(before + content)
        yield
    finally:
        for path, (before, state) in kept.items():
            path.write_bytes(before)
            # Snakemake looks at the times of scripts
            os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


SETTINGS = {
    "metric": (
        {"metrics": {"curvature_radius_mm": 4.0}},
        RESULTS | {"measure": 2, "measure_simulated": 4, "validation": 2},
    ),
    "run": ({"runs": {"thick": {"thickness_mm": 3.5}}}, ONE_RUN),
    "growth": (
        {"folding": {"growth_rate_per_s": 1e-7}},
        BOTH_RUNS | {"growth_figure": 1},
    ),
    "mesh": (
        {"mesh": {"surface_edge_mm": 0.9}},
        BOTH_RUNS | {"tetrahedralise": 1},
    ),
    "surface": (
        {"surface": {"edge_length_mm": 1.5}},
        BOTH_RUNS
        | CURVES
        | {
            "tetrahedralise": 1,
            "pial_with_thickness": 2,
            "measure": 2,
        },
    ),
    "later end": (
        {"folding": {"end_week": 22.5}},
        BOTH_RUNS | {"measure_simulated": 6},
    ),
    # the number of ranks changes no result, but the report shows the configuration
    "ranks": ({"folding": {"ranks": 1}}, RESULTS),
    "new brain": (
        {"brains": [{"id": "c", "week": 23, **labelled(23)}]},
        RESULTS | CURVES | {"pial_with_thickness": 1, "measure": 1, "validation": 2},
    ),
}


@pytest.mark.parametrize("change", SETTINGS)
def test_exactly_what_depends_on_a_change_of_the_configuration_runs_again(
    finished, change
):
    values, expected = SETTINGS[change]
    study = copy.deepcopy(SMALL_STUDY)
    for section, content in values.items():
        study[section] = (
            [*study[section], *content]
            if section == "brains"
            else study.get(section, {}) | content
        )
    assert (
        planned(finished, "--configfile", finished.write("changed.yaml", study))
        == expected
    )


CODE = {
    "figure": (["src/gyriflow/report/growth.py"], RESULTS | {"growth_figure": 1}),
    "solver": (
        ["src/gyriflow/folding/contact.py"],
        {rule: count for rule, count in BOTH_RUNS.items() if rule != "prepare"},
    ),
    # what the terminal says, comments in rules and the environment make no result
    "around": (
        [
            "src/gyriflow/running/launch.py",
            "workflow/rules/metrics.smk",
            "envs/gyriflow.yaml",
        ],
        {},
    ),
}


@pytest.mark.parametrize("change", CODE)
def test_a_change_of_code_runs_again_what_uses_it(finished, change):
    names, expected = CODE[change]
    with changed_files(finished.checkout, *names):
        listed = finished.run("-n", "--configfile", "study.yaml").stdout
    rules = Counter(re.findall(r"^rule (\w+):$", listed, re.MULTILINE))
    assert {rule: rules[rule] for rule in STAGES if rule in rules} == expected
