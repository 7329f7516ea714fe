"""Configurations are read strictly."""

import pytest

from gyriflow.errors import InputError
from gyriflow.io.yaml_files import read_keys, read_yaml, write_yaml


def test_what_is_written_is_read(tmp_path):
    content = {"b": 1.5, "a": [1, "ν"], "c": {"d": None, "e": True}}
    write_yaml(tmp_path / "new" / "x.yaml", content)
    assert read_yaml(tmp_path / "new" / "x.yaml") == content


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("runs:\n  thick: {}\n  thin: {}\n  thick: {}\n", "line 4: the key 'thick' of line 2 is there again"),
        ("a: [1\nb: 2\n", "not valid YAML, line 2"),
        (None, "cannot be read"),
        ("# a comment\n", "holds no keys; found nothing; expected keys"),
        ("- a\n", "holds no keys; found a list; expected keys"),
    ],
)
def test_what_is_no_configuration_is_refused(tmp_path, text, said):
    if text is not None:
        (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(InputError, match=rf"x\.yaml: .*{said}"):
        read_keys(tmp_path / "x.yaml")
