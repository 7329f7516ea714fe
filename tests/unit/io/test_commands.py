"""Commands of the user's own: their files, their output, their failures, and the container around them."""

import logging
import os

import pytest

from gyriflow.errors import InputError
from gyriflow.io.commands import run_command


@pytest.fixture
def files(tmp_path):
    folder = tmp_path / "a folder's"
    folder.mkdir()
    (folder / "image").write_text("grey")
    return {"image": folder / "image", "labels": folder / "labels"}


def test_a_command_reads_and_writes_the_files_and_its_output_is_logged(files, caplog):
    caplog.set_level(logging.INFO)
    run_command("cp {image} {labels}; echo ${HOME:+said}; echo wrong >&2", files, "labels")
    assert files["labels"].read_text() == "grey"
    assert {"said", "wrong"} <= {record.getMessage() for record in caplog.records}


@pytest.mark.parametrize(
    ("command", "code"), [("echo no model; exit 3", 3), ("echo no model", 0), ("no-such-model", 127)]
)
def test_a_failed_command_is_named_with_its_last_words(files, command, code):
    with pytest.raises(
        InputError, match=rf"(?s)found exit code {code} of '{command}'\n  .*no.(such.)?model.*in the place of"
    ):
        run_command(command, files, "labels")


@pytest.mark.parametrize(
    ("program", "image", "words"),
    [
        ("apptainer", "my.sif", ["exec", "--bind", "FOLDER", "my.sif", "sh", "-c"]),
        ("docker", "docker://lab/model:1", ["--volume", "FOLDER:FOLDER", "--entrypoint", "sh", "lab/model:1", "-c"]),
    ],
)
def test_a_container_sees_the_files(files, tmp_path, monkeypatch, caplog, program, image, words):
    caplog.set_level(logging.INFO)
    folder = tmp_path / "bin"
    folder.mkdir()
    # a stand-in that says how it was called and runs the command, its last argument, as it is
    stand_in = folder / program
    stand_in.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\nfor last; do :; done\neval "$last"\n')
    stand_in.chmod(0o755)
    for name in ("sh", "cp"):
        (folder / name).symlink_to(f"/bin/{name}")
    monkeypatch.setenv("PATH", str(folder))
    run_command("cp {image} {labels}", files, "labels", image)
    assert files["labels"].read_text() == "grey"
    said = [record.getMessage() for record in caplog.records]
    place = said.index(words[0])
    found = said[place : place + len(words)]
    assert found == [word.replace("FOLDER", str(files["image"].parent)) for word in words]


def test_without_a_program_for_containers_one_is_asked_for(files, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", os.fspath(tmp_path))
    with pytest.raises(InputError, match=r"my.sif: no program that runs containers.*expected apptainer or singularity"):
        run_command("x {image} {labels}", files, "labels", "my.sif")
