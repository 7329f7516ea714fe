"""Files appear whole or not at all, and configurations are read strictly."""

import errno
import hashlib
import os

import numpy as np
import pytest
from facts import Facts

from gyriflow.errors import InputError, StorageError
from gyriflow.io import files
from gyriflow.io.files import atomic_write, contents, read_json, read_tab_separated, write_json
from gyriflow.io.yaml_files import read_keys, read_yaml, write_yaml


@pytest.mark.promise(1)
def test_replaced_file_appears_only_when_the_block_ends_well(tmp_path):
    path = tmp_path / "new" / "a.surf.gii"
    with atomic_write(path) as temporary:
        temporary.write_text("whole")
        assert not path.exists()
        assert temporary.parent == path.parent
        assert temporary.name.startswith(".")
        assert temporary.name.endswith(".surf.gii")
    assert path.read_text() == "whole"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.promise(2)
def test_failed_write_keeps_the_earlier_file_and_leaves_nothing(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("earlier")

    def stopped_half_way():
        with atomic_write(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped_half_way()
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.fault(36)
def test_full_disk_is_a_storage_error_that_names_the_file(tmp_path):
    path = tmp_path / "a.csv"
    with pytest.raises(StorageError, check=Facts(path, "No space left on device")) as caught, atomic_write(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert caught.value.exit_code == 5


def test_json_unwraps_numpy_and_has_no_nan(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"n": np.int64(3), "x": [np.float32(0.5), np.nan, np.inf], "m": np.eye(2), "ok": np.True_})
    assert read_json(path) == {"n": 3, "x": [0.5, None, None], "m": [[1.0, 0.0], [0.0, 1.0]], "ok": True}
    assert "NaN" not in path.read_text()


@pytest.mark.parametrize(
    "rows",
    [
        ("s1\t24\ta", "s2\t25\tb"),
        # tabs at the end of the rows that the heading does not have
        ("s1\t24\ta\t", "s2\t25\tb\t"),
        ("s1\t24\ta\t\t", "s2\t25\tb\t\t"),
        ("s1\t24\ta\t", "s2\t25\tb"),
        # names of the rows without a heading, as R writes them
        ("1\ts1\t24\ta", "2\ts2\t25\tb"),
    ],
)
def test_cells_stay_below_their_heading(tmp_path, rows):
    path = tmp_path / "participants.tsv"
    path.write_text("\n".join(("id\tage\tfile", *rows)) + "\n")
    assert read_tab_separated(path) == [{"id": "s1", "age": "24", "file": "a"}, {"id": "s2", "age": "25", "file": "b"}]


def test_contents_are_read_again_only_where_size_or_times_changed(tmp_path, monkeypatch):
    one, other, gone = tmp_path / "one", tmp_path / "other", tmp_path / "gone"
    one.write_text("a brain")
    other.write_text("another")
    first = contents([one, other, gone, tmp_path], {})
    assert list(first) == [str(one), str(other)]
    assert first[str(one)][0] == hashlib.sha256(b"a brain").hexdigest()
    # an older file of the same size takes its place
    state = one.stat()
    (tmp_path / "older").write_text("a train")
    os.utime(tmp_path / "older", ns=(state.st_atime_ns, state.st_mtime_ns))
    (tmp_path / "older").rename(one)
    read = []
    monkeypatch.setattr(files, "sha256_of", lambda path: read.append(path) or "new")
    second = contents([one, other], first)
    assert read == [str(one)]
    assert (second[str(one)][0], second[str(other)]) == ("new", first[str(other)])


def test_what_is_written_is_read(tmp_path):
    content = {"b": 1.5, "a": [1, "ν"], "c": {"d": None, "e": True}}
    write_yaml(tmp_path / "new" / "x.yaml", content)
    assert read_yaml(tmp_path / "new" / "x.yaml") == content


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("runs:\n  thick: {}\n  thin: {}\n  thick: {}\n", [4, "thick", 2]),
        ("a: [1\nb: 2\n", ["YAML", 2]),
        (None, ["No such file"]),
        ("# a comment\n", ["`week: 21`"]),
        ("- a\n", ["list", "`week: 21`"]),
    ],
)
def test_what_is_no_configuration_is_refused(tmp_path, text, facts):
    if text is not None:
        (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(InputError, check=Facts(tmp_path / "x.yaml", *facts)):
        read_keys(tmp_path / "x.yaml")
