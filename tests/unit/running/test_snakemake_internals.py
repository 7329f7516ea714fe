"""What gyriflow uses of Snakemake's internals, tried with the Snakemake that is installed."""

import os
import sys

import pytest
from configurations import touched
from facts import Facts
from processes import ran

from gyriflow.code_hash import code_hash
from gyriflow.io.files import files_in

SNAKEFILE = """
import json
from pathlib import Path
from gyriflow.running.snakemake_internals import (
    benchmark_patterns, know_inputs_by_content, remove_stale, rerun_on_code_changes
)

rule target:
    input: "made-a"

rule copy:
    input: json.loads(Path("contents.json").read_text()).keys()
    output: "made-{name}"
    log: "logs/{name}.log"
    benchmark: "benchmarks/{name}.tsv"
    script: "scripts/copy.py"

rule coded:
    output: "tables/coded.csv"
    params: code="own"
    shell: "touch {output}"

rerun_on_code_changes(workflow.rules, Path("scripts").absolute())
know_inputs_by_content(json.loads(Path("contents.json").read_text()), [], [])
remove_stale(workflow.rules, "tables", "none")
print(benchmark_patterns(workflow.rules), [getattr(rule.params, "code", None) for rule in workflow.rules])
"""
SCRIPT = "import shutil\nfrom gyriflow.units import ML_PER_MM3\nshutil.copy(snakemake.input[0], snakemake.output[0])\n"


@pytest.mark.fault(68)
def test_jobs_run_again_after_a_change_of_code_or_where_an_older_file_takes_the_place_of_their_input(tmp_path):
    script, given = tmp_path / "scripts" / "copy.py", tmp_path / "given"
    script.parent.mkdir()
    (tmp_path / "Snakefile").write_text(SNAKEFILE)
    script.write_text(SCRIPT)
    given.write_text("one")
    touched(tmp_path / "tables", "coded.csv", "volumes.csv", "figures/volumes.png", "study.json")
    snakemake = [sys.executable, "-m", "snakemake", "--cores", "1"]
    first = ran(*snakemake, cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    said = str({"copy": r"benchmarks/(?P<name>.+)\.tsv$"})
    assert f"{said} {[None, code_hash(script), 'own']}" in first.stdout
    given.write_text("two")
    os.utime(given, ns=(0, 0))
    again = ran(*snakemake, "-n", cwd=tmp_path)
    assert again.stdout + again.stderr == Facts("two")
    # tables and figures that no rule makes any more have been removed
    assert [path.name for path in files_in(tmp_path / "tables")] == ["coded.csv", "study.json"]
