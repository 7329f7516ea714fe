"""Configurations are read strictly."""

import pytest

from gyriflow.errors import InputError
from gyriflow.io.yaml_files import read_keys, read_yaml, write_yaml


def test_what_is_written_is_read(tmp_path):
    content = {"b": 1.5, "a": [1, "ν"], "c": {"d": None, "e": True}}
    write_yaml(tmp_path / "new" / "x.yaml", content)
    assert read_yaml(tmp_path / "new" / "x.yaml") == content


def test_a_key_that_is_there_twice_is_refused_with_both_lines(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_text("runs:\n  thick: {a: 1}\n  thin: {}\n  thick: {a: 2}\n")
    with pytest.raises(
        InputError, match=r"x\.yaml: is not valid YAML, line 4: the key 'thick' of line 2 is there again"
    ):
        read_yaml(path)


def test_a_file_that_is_no_yaml_or_missing_is_refused(tmp_path):
    (tmp_path / "x.yaml").write_text("a: [1\nb: 2\n")
    with pytest.raises(InputError, match=r"not valid YAML, line 2"):
        read_yaml(tmp_path / "x.yaml")
    with pytest.raises(InputError, match="cannot be read"):
        read_yaml(tmp_path / "none.yaml")


@pytest.mark.parametrize(("text", "found"), [("", "nothing"), ("# a comment\n", "nothing"), ("- a\n", "a list")])
def test_a_file_without_keys_is_refused(tmp_path, text, found):
    (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(InputError, match=rf"x\.yaml: holds no keys; found {found}; expected keys"):
        read_keys(tmp_path / "x.yaml")
