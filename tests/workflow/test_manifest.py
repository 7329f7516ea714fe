"""Results are outdated exactly if they do not match what they were made from, whatever
Snakemake's records and dates say."""

import os
import shutil
import sys

import pytest
import yaml
from facts import Facts
from processes import ran

from gyriflow.settings.terms import SIDES

from .conftest import SMALL_STUDY, Workflow, labelled

pytestmark = pytest.mark.slow

REGIONS = {
    "labels": [f"{side}.label.gii" for side in SIDES],
    "surface": [f"{side}.surf.gii" for side in SIDES],
}
STUDY = {
    "brains": [{"id": "a", "week": 21, **labelled(21)}],
    "metrics": {"regions": {"a": REGIONS}},
}
"""A brain with regions of the cortex, which is measured only."""
CONFIGURED = ("--configfile", "study.yaml")
SURFACE_STEPS = {"pial_with_thickness": 1, "measure": 1}
OTHER_EDGE = {"surface": {"edge_length_mm": 1.5}}


@pytest.fixture(scope="module")
def made(checkout_copy, tmp_path_factory):
    """The brain's study, which counts as made."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("manifest") / "study")
    workflow.directory.mkdir()
    for files in REGIONS.values():
        for name in files:
            (workflow.directory / name).write_text(f"content of {name}")
    workflow.write("study.yaml", STUDY)
    workflow.lay_out(*CONFIGURED)
    workflow.count_as_made("--forceall", *CONFIGURED)
    return workflow


def copied(made: Workflow, target, *, hidden: bool = True) -> Workflow:
    """Return a copy of a study with new dates in no order, as of `cp -r`; only its
    visible files without `hidden`."""
    left_out = shutil.ignore_patterns() if hidden else shutil.ignore_patterns(".*")
    shutil.copytree(made.directory, target, copy_function=shutil.copy, ignore=left_out)
    for number, path in enumerate(sorted(target.rglob("*"), reverse=True)):
        os.utime(path, (2e9 + number, 2e9 + number))
    return Workflow(made.checkout, target)


def change(workflow: Workflow, settings: dict) -> None:
    """Change sections of a study's configuration."""
    file = workflow.directory / "study.yaml"
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text()) | settings))


def steps(workflow: Workflow, *rules: str) -> dict[str, int]:
    """Return the jobs that a dry run plans, of some rules."""
    jobs = workflow.jobs(*CONFIGURED)
    return {rule: count for rule, count in jobs.items() if rule in rules}


def exchange(first, second) -> None:
    """Exchange the names of two files."""
    kept = first.with_name("kept")
    first.rename(kept)
    second.rename(first)
    kept.rename(second)


@pytest.mark.parametrize("hidden", [True, False])
def test_a_copy_is_up_to_date_with_or_without_hidden_files(made, tmp_path, hidden):
    workflow = copied(made, tmp_path / "copy", hidden=hidden)
    assert workflow.jobs(*CONFIGURED) == {}


@pytest.mark.parametrize("hidden", [True, False])
def test_settings_changed_after_a_copy_run_again_what_depends_on_them(
    made, tmp_path, hidden
):
    workflow = copied(made, tmp_path / "copy", hidden=hidden)
    change(workflow, OTHER_EDGE)
    assert steps(workflow, *SURFACE_STEPS) == SURFACE_STEPS


def test_settings_and_labels_are_compared_where_snakemake_has_no_records(
    made, tmp_path
):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    shutil.rmtree(workflow.directory / ".snakemake")
    assert workflow.jobs(*CONFIGURED) == {}
    change(workflow, OTHER_EDGE)
    assert steps(workflow, *SURFACE_STEPS) == SURFACE_STEPS
    change(workflow, {"surface": {}})
    assert workflow.jobs(*CONFIGURED) == {}
    # another brain under the old name, older than the results
    labels = workflow.directory / "phantom-21.nii.gz"
    labels.write_bytes(labels.read_bytes() + b"other")
    os.utime(labels, (1e9, 1e9))
    assert steps(workflow, *SURFACE_STEPS) == SURFACE_STEPS
    # as in the whole study: its last step runs as well
    assert workflow.jobs(*CONFIGURED)["html_report"] == 1


@pytest.mark.parametrize("how", ["configuration", "files"])
def test_exchanged_files_of_the_two_sides_run_again_what_reads_them(
    made, tmp_path, how
):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    if how == "files":
        for left, right in REGIONS.values():
            exchange(workflow.directory / left, workflow.directory / right)
    else:
        regions = {"a": {kind: files[::-1] for kind, files in REGIONS.items()}}
        change(workflow, {"metrics": {"regions": regions}})
    assert steps(workflow, "given_regions", "measure") == {"given_regions": 1}


def test_a_result_edited_in_a_copy_is_made_again(made, tmp_path):
    workflow = copied(made, tmp_path / "copy")
    table = workflow.directory / "results" / "brains" / "a" / "metrics" / "metrics.csv"
    table.write_text("edited")
    os.utime(table, (1e9, 1e9))
    assert steps(workflow, *SURFACE_STEPS) == {"measure": 1}
    # nothing is deleted before
    assert table.read_text() == "edited"


@pytest.mark.parametrize("hidden", [True, False])
def test_a_copy_of_a_half_updated_study_goes_on_where_it_stopped(
    made, tmp_path, hidden
):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    change(workflow, OTHER_EDGE)
    for surface in workflow.directory.glob("results/brains/a/surface/*"):
        surface.write_text("of the other edge")
    workflow.count_as_made("surface", "--forceall", *CONFIGURED)
    copy = copied(workflow, tmp_path / "copy", hidden=hidden)
    assert steps(copy, *SURFACE_STEPS) == {"measure": 1}


def test_the_dry_run_says_why_each_step_runs_again(made, tmp_path):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    change(workflow, OTHER_EDGE)
    reasons = workflow.reasons(*CONFIGURED)
    assert "edge_length_mm" in reasons["pial_with_thickness"]
    assert "another job" in reasons["measure"]


def test_results_of_an_earlier_configuration_are_current_again(finished, tmp_path):
    """Also with simulations: what was made from the same is kept."""
    shutil.copytree(finished.directory, tmp_path / "study", symlinks=True)
    workflow = Workflow(finished.checkout, tmp_path / "study")
    workflow.write("study.yaml", SMALL_STUDY | {"surface": {"edge_length_mm": 1.5}})
    assert workflow.jobs(*CONFIGURED)["simulate"] == 2
    workflow.write("study.yaml", SMALL_STUDY)
    assert workflow.jobs(*CONFIGURED) == {}


CHAIN = """
inputflags:
    ancient

rule all:
    input: "results/last.txt"

rule first:
    input: "scan.txt"
    output: "results/first.txt"
    log: "results/logs/first.log"
    params: edge=config["edge"]
    shell: "echo first >> ran; cat {input} > {output}; echo {params.edge} >> {output}"

rule second:
    input: rules.first.output
    output: "results/second.txt"
    log: "results/logs/second.log"
    shell: "echo second >> ran; test ! -e fail; cp {input} {output}"

rule last:
    input: rules.second.output
    output: "results/last.txt"
    log: "results/logs/last.log"
    shell: "echo last >> ran; cp {input} {output}"
"""
CHECKPOINT = """
inputflags:
    ancient

rule all:
    input: "results/joined.txt"

checkpoint split:
    input: "scan.txt"
    output: "results/names.txt"
    log: "results/logs/split.log"
    shell: "echo split >> ran; cp {input} {output}"

rule part:
    input: "results/names.txt"
    output: "results/part-{name}.txt"
    log: "results/logs/part.{name}.log"
    shell: "echo part {wildcards.name} >> ran; cp {input} {output}"

def parts(wildcards):
    names = open(checkpoints.split.get().output[0]).read().split()
    return [f"results/part-{name}.txt" for name in names]

rule join:
    input: parts
    output: "results/joined.txt"
    log: "results/logs/join.log"
    shell: "echo join >> ran; cat {input} > {output}"
"""


def ran_steps(workflow: Workflow, *arguments: str, code: int = 0) -> list[str]:
    """Run the workflow in flow.smk, and return the steps that have run."""
    record = workflow.directory / "ran"
    record.write_text("")
    call = ("--snakefile", "flow.smk", "--cores", "1", *arguments)
    outcome = workflow.run(*call)
    assert outcome.returncode == code, outcome.stdout + outcome.stderr
    return record.read_text().splitlines()


def test_a_chain_of_outdated_results_is_made_again_in_one_run(workflow):
    (workflow.directory / "flow.smk").write_text(CHAIN)
    scan = workflow.directory / "scan.txt"
    scan.write_text("one")
    steps = ["first", "second", "last"]
    assert ran_steps(workflow, "--config", "edge=1") == steps
    assert ran_steps(workflow, "--config", "edge=1") == []
    assert ran_steps(workflow, "--config", "edge=2", "--quiet") == steps
    assert ran_steps(workflow, "--config", "edge=2") == []
    # what has failed or has not begun is made by the next run
    (workflow.directory / "fail").touch()
    assert ran_steps(workflow, "--config", "edge=3", code=1) == steps[:2]
    last = workflow.directory / "results" / "last.txt"
    assert last.read_text() == "one2\n"
    (workflow.directory / "fail").unlink()
    assert ran_steps(workflow, "--config", "edge=3") == steps[1:]
    # a copy is current, also of what was made by two runs
    shutil.rmtree(workflow.directory / ".snakemake")
    assert ran_steps(workflow, "--config", "edge=3") == []
    scan.write_text("two")
    os.utime(scan, (1e9, 1e9))
    assert ran_steps(workflow, "--config", "edge=3") == steps


def test_results_behind_a_checkpoint_are_made_again_where_it_still_leads_to_them(
    workflow,
):
    (workflow.directory / "flow.smk").write_text(CHECKPOINT)
    scan = workflow.directory / "scan.txt"
    scan.write_text("a b")
    assert sorted(ran_steps(workflow)) == ["join", "part a", "part b", "split"]
    assert ran_steps(workflow) == []
    scan.write_text("a")
    assert ran_steps(workflow) == ["split", "part a", "join"]
    assert ran_steps(workflow) == []
    for force in (["--forceall"], ["--forcerun", "split"]):
        assert ran_steps(workflow, *force) == ["split", "part a", "join"]
    assert ran_steps(workflow) == []
    joined = workflow.directory / "results" / "joined.txt"
    assert joined.read_text() == "a"


def test_plain_snakemake_is_refused(workflow):
    name = workflow.write("study.yaml", STUDY)
    command = (sys.executable, "-m", "snakemake", "-n", "--configfile", name)
    snakefile = ("--snakefile", str(workflow.checkout / "Snakefile"))
    outcome = ran(*command, *snakefile, cwd=workflow.directory)
    assert outcome.returncode != 0
    assert outcome.stderr == Facts("./run snakemake")
