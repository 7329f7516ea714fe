"""Paths in a user's command: whatever stands in them is a name and nothing else."""

import pytest
from fuzzing import BOUNDED
from hypothesis import given
from hypothesis import strategies as st

from gyriflow.errors import InputError
from gyriflow.io.commands import run_command

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


def segmented(folder, name, command="cp -- {image} {labels}", container=None):
    image, labels = folder / name / name, folder / name / f"{name} labels"
    image.parent.mkdir(exist_ok=True)
    image.write_text("grey")
    run_command(command, {"image": image, "labels": labels}, "labels", container)
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


@pytest.mark.fault(57)
def test_a_folder_that_containers_would_take_apart_is_refused(folder, monkeypatch):
    (folder / "docker").write_text("#!/bin/sh\ntouch pwned\n")
    (folder / "docker").chmod(0o755)
    monkeypatch.setenv("PATH", str(folder), prepend=":")
    with pytest.raises(InputError, match="a colon or a comma"):
        segmented(folder, "a:b", container="docker://x")
    assert not (folder / "pwned").exists()
