"""Outdated results are made again in one run, and nothing else is."""

import os
import shutil
import sys

import pytest
from facts import Facts
from processes import ran

from .conftest import SHAPES, Workflow

pytestmark = pytest.mark.slow

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
    assert workflow.call(*call) == code
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
    name = workflow.write("study.yaml", {"brains": SHAPES})
    command = (sys.executable, "-m", "snakemake", "-n", "--configfile", name)
    snakefile = ("--snakefile", str(workflow.checkout / "Snakefile"))
    outcome = ran(*command, *snakefile, cwd=workflow.directory)
    assert outcome.returncode != 0
    assert outcome.stderr == Facts("./run snakemake")
