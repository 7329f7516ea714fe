"""What gyriflow uses of Snakemake's internals, tried with the Snakemake that is
installed."""

import ast
import json
import os
import re
import sys

import pytest
from configurations import touched
from facts import Facts
from processes import ran

from gyriflow.code_hash import code_hash
from gyriflow.io.files import files_in
from gyriflow.running.launch import restore_dates
from gyriflow.running.snakemake_internals import dates_before_copy

SNAKEFILE = """
import json
from pathlib import Path
from gyriflow.running.snakemake_internals import (
    know_inputs_by_content, remove_stale, rerun_on_code_changes, usage_patterns
)

contents = json.loads(Path("contents.json").read_text())
names = config.get("names", "a").split()

rule target:
    input: expand("made-{name}.csv", name=names), "tables/coded.csv", "after.csv"

rule copy:
    input: list(contents)
    output: "made-{name}.csv"
    log: "in/logs/{name}.log"
    params: files=[("of", path) for path in contents], place=f"{Path.cwd()}/here"
    wildcard_constraints: name="|".join(names)
    script: "scripts/copy.py"

rule coded:
    output: "tables/coded.csv"
    params: code="own"
    shell: "touch {output}"

# so large that Snakemake makes no checksum of it
rule large:
    output: "large.bin"
    shell: "head -c 2000000 /dev/zero > {output}"

rule after:
    input: "large.bin"
    output: "after.csv"
    shell: "touch {output}"

rerun_on_code_changes(workflow.rules, Path("scripts").absolute())
know_inputs_by_content(contents, ["content-1"], [])
remove_stale(workflow.rules, ".")
codes = [getattr(rule.params, "code", None) for rule in workflow.rules]
print(usage_patterns(workflow.rules), codes)
"""
SCRIPT = """
import shutil
from gyriflow.units import ML_PER_MM3
shutil.copy(snakemake.input[0], snakemake.output[0])
"""


@pytest.fixture
def study(tmp_path):
    """A finished study of one file that is known by its content."""
    (tmp_path / "study" / "scripts").mkdir(parents=True)
    (tmp_path / "study" / "Snakefile").write_text(SNAKEFILE)
    (tmp_path / "study" / "scripts" / "copy.py").write_text(SCRIPT)
    (tmp_path / "given").write_text("one")
    known(tmp_path / "study", {tmp_path / "given": "content-1"})
    done = snakemake(tmp_path / "study", "--config", "names=a b")
    assert done.returncode == 0, done.stderr
    assert done.stdout == Facts(
        str(
            [
                None,
                code_hash(tmp_path / "study" / "scripts" / "copy.py"),
                "own",
                None,
                None,
            ]
        )
    )
    (pattern,) = ast.literal_eval(done.stdout.partition("}")[0] + "}").values()
    assert re.fullmatch(pattern, "in/benchmarks/a.tsv")["name"] == "a"
    assert not re.fullmatch(pattern, "in/logs/a.log")
    return tmp_path / "study"


def known(folder, contents):
    (folder / "contents.json").write_text(
        json.dumps({str(path): content for path, content in contents.items()})
    )


def snakemake(folder, *arguments):
    triggers = ("--rerun-triggers", "mtime", "params", "input")
    return ran(
        sys.executable,
        "-m",
        "snakemake",
        "--cores",
        "1",
        *arguments,
        *triggers,
        cwd=folder,
    )


def reruns(folder):
    dry = snakemake(folder, "-n", "--config", "names=a b")
    assert dry.returncode == 0, dry.stderr
    return "rule copy" in dry.stdout + dry.stderr


def test_inputs_are_known_by_their_content_wherever_they_and_the_study_are(
    study, tmp_path
):
    os.utime(tmp_path / "given", (2e9, 2e9))
    (tmp_path / "given").rename(tmp_path / "an other")
    study.rename(tmp_path / "moved")
    known(tmp_path / "moved", {tmp_path / "an other": "content-1"})
    assert not reruns(tmp_path / "moved")
    # a newer file, and one that is older than what was made of it
    for date in (2e9, 0):
        os.utime(tmp_path / "an other", (date, date))
        known(tmp_path / "moved", {tmp_path / "an other": "content-2"})
        assert reruns(tmp_path / "moved")


def test_jobs_run_again_after_a_change_of_their_code_not_of_its_date(study):
    script = study / "scripts" / "copy.py"
    os.utime(script, (2e9, 2e9))
    assert not reruns(study)
    script.write_text(SCRIPT.replace("ML_PER_MM3", "SECONDS_PER_GW"))
    assert reruns(study)


def test_only_files_that_a_run_made_are_removed_where_no_rule_makes_them_any_more(
    study,
):
    touched(study, "mine.csv", "tables/mine.png")
    # of two that are not made any more, a user has changed one
    (study / "made-a.csv").write_text("mine")
    assert snakemake(study, "-n", "--config", "names=c").returncode == 0
    left = {path.name for path in files_in(study) if path.suffix in (".csv", ".png")}
    assert left == {"mine.csv", "mine.png", "made-a.csv", "coded.csv", "after.csv"}


def test_results_that_are_kept_as_links_count_as_copied_once(study):
    # as by git-annex
    store = study.parent / "annex" / "objects"
    store.mkdir(parents=True)
    for number, name in enumerate(
        ("after.csv", "tables/coded.csv", "made-a.csv", "made-b.csv", "large.bin")
    ):
        kept = (study / name).rename(store / f"key-{number}")
        (study / name).symlink_to(kept)
        os.utime(study / name, (2e9 + number, 2e9 + number), follow_symlinks=False)
    dates = dates_before_copy(study)
    assert len(dates) == 5
    assert restore_dates(dates)
    assert dates_before_copy(study) == {}
    assert not restore_dates({})
    assert not restore_dates({study / "none": 1e9})


def test_the_dates_of_a_copy_are_those_at_which_its_results_were_made(study):
    made = {
        path: path.stat().st_mtime
        for path in (study / "made-a.csv", study / "made-b.csv")
    }
    assert dates_before_copy(study) == {}
    for number, name in enumerate(
        ("after.csv", "tables/coded.csv", "made-a.csv", "made-b.csv", "large.bin")
    ):
        os.utime(study / name, (2e9 + number, 2e9 + number))
    dates = dates_before_copy(study)
    assert {path: dates[path] for path in made} == pytest.approx(made, abs=1e-6)
    # an input that is newer than what was made of it says nothing then
    assert "rule after" not in snakemake(study, "-n", "--config", "names=a b").stdout
    # a result that was not copied
    os.utime(study / "made-b.csv", (made[study / "made-b.csv"],) * 2)
    assert dates_before_copy(study) == {}
    assert "rule after" in snakemake(study, "-n", "--config", "names=a b").stdout
