"""Commands of the user's own: their files, output, failures; a path in them is a name and nothing else."""

import logging

import pytest
from fuzzing import BOUNDED
from hypothesis import given
from hypothesis import strategies as st

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


NAMES = [
    "$(touch pwned)",
    "`touch pwned`",
    "a; touch pwned;",
    'it\'s "both"',
    "'; touch pwned; '",
    '"; touch pwned; "',
    "-rf",
    "a\nb",
    "a & touch pwned & b",
    "{labels}",
    "größe 脑 🧠",
    "*",
    "~",
    "#a",
    "\\",
]


def segmented(folder, name, command="cp -- {image} {labels}"):
    image, labels = folder / name / name, folder / name / f"{name} labels"
    image.parent.mkdir(exist_ok=True)
    image.write_text("grey")
    run_command(command, {"image": image, "labels": labels}, "labels")
    return labels.read_text()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.fault(57)
@pytest.mark.parametrize("name", NAMES)
def test_a_path_is_a_name_and_nothing_else(folder, name):
    assert segmented(folder, name) == "grey"
    assert sorted(path.name for path in folder.iterdir()) == [name]


@pytest.mark.fault(57)
@BOUNDED
@given(name=st.text(" $()`;'\"\\\n&|<>*?~#{}-=!aé", min_size=1, max_size=20))
def test_paths_of_any_characters(folder, name):
    assert segmented(folder, f"x{name}") == "grey"
    assert not (folder / "pwned").exists()


@pytest.mark.fault(57)
@pytest.mark.parametrize(
    "command",
    ['cp "{image}" {labels}', "cp {image} '{labels}'", 'sh -c "cp {image} {labels}"', "cp `echo {image}` {labels}",
     'cp "{image} {labels}', "cat <<END {image}\nEND\ncp {image} {labels}"],
)  # fmt: skip
def test_places_where_a_path_could_not_be_quoted_are_refused(folder, command):
    with pytest.raises(InputError, match="the command has"):
        segmented(folder, "$(touch pwned)", command)
    assert not (folder / "pwned").exists()


def test_quotes_comments_and_variables_elsewhere_are_left_alone(folder):
    command = 'text="it\'s {"; # don\'t mind\ncp {image} {labels}; echo "$text" >> {labels}; echo \\\' >> {labels}'
    assert segmented(folder, "a", command) == "greyit's {\n'\n"
