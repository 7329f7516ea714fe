"""What the commands hand on to Snakemake, and what they tell to type next."""

import shutil

import pytest
from click.testing import CliRunner

from gyriflow import launch
from gyriflow.cli import beginning
from gyriflow.cli.commands import main


@pytest.fixture
def handed_on(monkeypatch, tmp_path):
    """Returns the arguments that Snakemake gets for those of `gyriflow run`."""
    monkeypatch.chdir(tmp_path)

    def arguments(*given):
        got = []
        monkeypatch.setattr(launch, "main", lambda asked: got.extend(asked) or 0)
        assert CliRunner().invoke(main, ["run", *given]).exit_code == 0
        return got

    return arguments


def test_a_run_on_this_machine_gets_its_cores(handed_on):
    assert "--cores" in handed_on()
    assert handed_on("--cores", "3")[:2] == ["--cores", "3"]


def test_the_cores_of_this_machine_are_no_limit_to_a_cluster(handed_on):
    assert "--cores" not in handed_on("--profile", "profiles/slurm")
    assert "--cores" not in handed_on("--executor=slurm")
    # but a limit that is asked for is one
    assert handed_on("--cores", "200", "--profile", "profiles/slurm")[:2] == ["--cores", "200"]


@pytest.mark.parametrize(("installed", "typed"), [(None, "./run gyriflow"), ("/usr/bin/gyriflow", "gyriflow")])
def test_what_to_type_next_can_be_typed(monkeypatch, tmp_path, installed, typed):
    monkeypatch.setattr(shutil, "which", lambda name: installed)
    monkeypatch.setattr(beginning, "write_configuration", lambda folder, path, force: ["1 brain"])
    folder = tmp_path / "brains of our lab"
    folder.mkdir()
    said = CliRunner().invoke(main, ["init", str(folder)]).output
    assert said.endswith(f"; next: {typed} check '{folder}/gyriflow.yaml'\n")
