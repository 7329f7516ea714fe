"""What `./run snakemake` does around Snakemake: refused configurations, locks, exit codes."""

import subprocess

import pytest

from gyriflow.cli.launch import clear_stale_lock, hold_lock
from gyriflow.errors import StorageError
from gyriflow.io.files import write_json

from .conftest import SMALL_STUDY


def message(outcome):
    assert "Traceback" not in outcome.stderr
    return outcome.stderr


@pytest.mark.fault(27, 28)
def test_three_mistakes_are_shown_at_once_and_end_in_2(workflow):
    study = SMALL_STUDY | {"folding": {"end_week": 50, "poisson_ratio": 0.5, "thicknes_mm": 2}}
    outcome = workflow.run("-n", "--configfile", workflow.write("study.yaml", study))
    assert outcome.returncode == 2
    said = message(outcome)
    assert "the configuration has 3 problems" in said
    assert "folding.poisson_ratio: Input should be less than 0.5; found 0.5" in said
    assert "folding.thicknes_mm: unknown key; did you mean thickness_mm?" in said
    assert "folding.end_week: Input should be less than or equal to 45; found 50" in said


@pytest.mark.fault(31)
@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("runs:\n  x: {}\n  x: {}\n", "line 3: the key 'x' of line 2 is there again"),
        (None, "study.yaml: cannot be read"),
    ],
)
def test_a_file_that_is_no_configuration_ends_in_2(workflow, content, said):
    if content:
        (workflow.directory / "study.yaml").write_text(content)
    outcome = workflow.run("-n", "--configfile", "study.yaml")
    assert outcome.returncode == 2
    assert said in message(outcome)


def test_an_empty_configuration_of_a_folder_ends_in_2(workflow):
    (workflow.directory / "config").mkdir()
    (workflow.directory / "config" / "config.yaml").touch()
    outcome = workflow.run("-n")
    assert outcome.returncode == 2
    assert "config.yaml: holds no keys; found nothing" in message(outcome)


def test_the_results_of_another_study_are_not_mixed_with_this_ones(workflow):
    name = workflow.write("study.yaml", SMALL_STUDY)
    (workflow.directory / "results" / "brains" / "x").mkdir(parents=True)
    other = {"configuration": ["/elsewhere/other.yaml"], "brains": [["x", 25, "labels", "x.nii.gz"]]}
    write_json(workflow.directory / "results" / "study" / "study.json", other)
    outcome = workflow.run("--cores", "1", "surface", "--configfile", name)
    assert outcome.returncode == 2
    assert "the results here are those of another study; found x of /elsewhere/other.yaml" in message(outcome)
    assert workflow.run("-n", "surface", "--configfile", name, "--directory", "own").returncode == 0


def test_a_given_configuration_replaces_the_demo_and_its_files_are_beside_it(workflow, tmp_path):
    folder = tmp_path / "my study"
    folder.mkdir()
    (folder / "labels.nii.gz").touch()
    brains = [{"id": "x", "week": 21, "labels": "labels.nii.gz", "scheme": "binary"}]
    name = workflow.write("my study/study.yaml", SMALL_STUDY | {"brains": brains, "start": "x"})
    outcome = workflow.run("-n", "surface", "--configfile", name, "--directory", "elsewhere")
    assert outcome.returncode == 0, outcome.stderr
    assert str(folder / "labels.nii.gz") in outcome.stdout + outcome.stderr


def test_a_table_of_participants_is_found_beside_its_configuration(workflow):
    # the working directory has a cohort of its own
    for folder in ("study", "elsewhere"):
        (workflow.directory / folder).mkdir()
        (workflow.directory / folder / "labels.nii.gz").touch()
        table = f"participant_id\tweek\tlabels\nof-{folder}\t24\tlabels.nii.gz\n"
        (workflow.directory / folder / "participants.tsv").write_text(table)
    table = {"file": "participants.tsv", "columns": {"scheme": "binary"}}
    study = {"participants": table, "start": "all", "folding": {"end_week": 26}}
    name = workflow.write("study/study.yaml", study)
    outcome = workflow.run("-n", "surface", "--configfile", name, "--directory", "elsewhere")
    assert outcome.returncode == 0, outcome.stderr
    said = outcome.stdout + outcome.stderr
    assert str(workflow.directory / "study" / "labels.nii.gz") in said
    assert "of-elsewhere" not in said


def stale(directory):
    lock = directory / ".snakemake" / "locks" / "0.output.lock"
    lock.parent.mkdir(parents=True)
    lock.write_text("results/brains/a/surface/pial.surf.gii\n")
    return lock


@pytest.mark.fault(33)
def test_a_stale_lock_is_cleared(tmp_path, capsys):
    lock = stale(tmp_path)
    clear_stale_lock(tmp_path)
    assert not lock.exists()
    assert "cleared the lock" in capsys.readouterr().err


@pytest.mark.fault(37)
@pytest.mark.promise(10)
def test_a_live_lock_is_not_cleared_but_refused(tmp_path):
    lock = stale(tmp_path)
    with hold_lock(tmp_path), pytest.raises(StorageError, match="another gyriflow run is live"):
        clear_stale_lock(tmp_path, patience_s=0.1)
    assert lock.exists()


@pytest.mark.fault(37)
@pytest.mark.promise(10)
def test_a_run_beside_a_live_one_is_refused_with_5_but_may_look(workflow):
    holder = subprocess.Popen(
        [*workflow.command()[:1], "-c", "from gyriflow.cli.launch import hold_lock; from pathlib import Path;"
         "lock = hold_lock(Path('.')); print('held', flush=True); input()"],
        cwd=workflow.directory, env=workflow.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert holder.stdout.readline() == "held\n"
        refused = workflow.run("--cores", "1", "surface")
        assert refused.returncode == 5
        assert "another gyriflow run is live" in message(refused)
        assert workflow.jobs("surface")
    finally:
        holder.communicate("\n")


@pytest.mark.fault(36)
def test_a_working_directory_that_cannot_be_written_ends_in_5(workflow):
    (workflow.directory / "file").touch()
    outcome = workflow.run("--cores", "1", "surface", "--directory", "file/below")
    assert outcome.returncode == 5
    assert "file/below: the working directory cannot be written" in message(outcome)
