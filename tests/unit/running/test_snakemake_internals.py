"""What gyriflow uses of Snakemake's internals, tried with the Snakemake that is
installed."""

from contextlib import chdir
from hashlib import sha256

import pytest
from configurations import touched
from facts import Facts
from snakemake import cli

from gyriflow.code_hash import code_hash
from gyriflow.io.files import files_in, write_json
from gyriflow.running.manifest import Contents, manifest_of

SNAKEFILE = """
from pathlib import Path
from gyriflow.running.snakemake_internals import (
    remove_stale, rerun_on_code_changes
)

names = config.get("names", "a").split()

rule target:
    input: expand("results/made-{name}.csv", name=names), "results/tables/coded.csv"

rule copy:
    input: "given"
    output: "results/made-{name}.csv"
    log: "results/logs/{name}.log"
    wildcard_constraints: name="|".join(names)
    script: "scripts/copy.py"

rule coded:
    output: "results/tables/coded.csv"
    params: code="own"
    shell: "touch {output}"

rerun_on_code_changes(workflow.rules, Path("scripts").absolute())
remove_stale(workflow.rules, "results")
codes = [getattr(rule.params, "code", None) for rule in workflow.rules]
commands = [getattr(rule.params, "command", None) for rule in workflow.rules]
print(codes, commands)
"""
SCRIPT = """
import shutil
from gyriflow.units import ML_PER_MM3
shutil.copy(snakemake.input[0], snakemake.output[0])
"""


@pytest.fixture
def study(tmp_path):
    """A study of one file and two names."""
    folder = tmp_path / "study"
    (folder / "scripts").mkdir(parents=True)
    (folder / "Snakefile").write_text(SNAKEFILE)
    (folder / "scripts" / "copy.py").write_text(SCRIPT)
    (folder / "given").write_text("one")
    return folder


@pytest.fixture
def said(study, capfd):
    """A function that returns what Snakemake prints when it reads the rules."""

    def read(*arguments):
        with chdir(study), pytest.raises(SystemExit) as ended:
            cli.main(["--cores", "1", *arguments])
        printed = capfd.readouterr()
        assert ended.value.code == 0, printed.err
        return printed.out

    return read


def test_rules_have_hashes_of_their_code(study, said):
    script = study / "scripts" / "copy.py"
    first = said("-n")
    assert first == Facts(str([None, code_hash(script), "own"]))
    # of a script its text, whatever its date, and of a shell command
    texts = (SCRIPT, "touch {output}")
    hashes = [f"code {sha256(text.encode()).hexdigest()[:12]}" for text in texts]
    assert first == Facts(str([None, *hashes]))


def test_only_files_that_a_run_made_are_removed_where_no_rule_makes_them_any_more(
    study, said, monkeypatch
):
    monkeypatch.chdir(study)
    touched(study, "results/mine.csv", "results/tables/mine.png")
    for name in "ab":
        made = f"results/made-{name}.csv"
        touched(study, made)
        found = Contents({}, {})
        found.read([made])
        manifest = {"results": {made: found.facts(made)}}
        write_json(manifest_of(f"results/logs/{name}.log"), manifest)
    # of two that are not made any more, a user has changed one
    (study / "results" / "made-a.csv").write_text("mine")
    said("-n", "--config", "names=c")
    left = {path.name for path in files_in(study) if path.suffix in (".csv", ".png")}
    assert left == {"mine.csv", "mine.png", "made-a.csv"}
