"""The commands of gyriflow as a user types them."""

import re
import sys

import pytest
from processes import ran

from .conftest import SMALL_STUDY, labelled


def gyriflow(workflow, *arguments):
    command = sys.executable, "-m", "gyriflow.cli", *arguments
    return ran(*command, cwd=workflow.directory, env=workflow.environment)


@pytest.mark.fault(27)
def test_mistakes_in_a_configuration_end_in_2_before_anything_is_planned(workflow):
    name = workflow.write("bad.yaml", SMALL_STUDY | {"folding": {"end_week": 50, "poisson_ratio": 0.5}})
    outcome = gyriflow(workflow, "check", name)
    assert outcome.returncode == 2
    assert "the configuration has 2 problems" in outcome.stderr
    assert "Traceback" not in outcome.stderr


@pytest.mark.slow
def test_a_study_of_fifty_runs_is_planned_with_its_core_hours(workflow):
    brains = [{"id": "a", "week": 21, **labelled(21)}, {"id": "b", "week": 22, **labelled(22)}]
    vary = {"thickness_mm": [1 + 0.2 * i for i in range(10)], "shear_modulus_cortex_pa": [300, 600, 900, 1500, 3000]}
    fifty = {"fifty": {"base": "reference", "vary": vary, "compare_week": 22}}
    study = {"brains": brains, "start": "a", "folding": {"end_week": 22}, "runs": {"reference": {}}, "studies": fifty}
    name = workflow.write("study.yaml", study)
    outcome = gyriflow(workflow, "check", name, "--stage", "studies", "--cores", "1000")
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    said = outcome.stdout
    assert said.startswith("study.yaml: 2 brains, 1 simulation (reference), 50 of study fifty\n")
    assert "simulate_member×50" in said
    assert float(re.search(r"\nwork +about [\d.e+]+ core hours, ([\d.]+)% of them", said)[1]) > 50
    # the memory of a cluster is not that of this machine
    assert "are there" not in re.search(r"\nmemory .*", said)[0]
