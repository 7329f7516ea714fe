"""What was found in the files of scans is kept by their content and the code that reads
them."""

import json
import logging
import os
from pathlib import Path

import pytest

from gyriflow.cli import readings as module
from gyriflow.cli.readings import Reading, ScanFiles, readings
from gyriflow.cli.recognition import fits_of_file
from gyriflow.errors import InputError
from gyriflow.io import kept_results
from gyriflow.io.kept_results import keep_result, kept_result, remove_old_results
from gyriflow.shipped import SHIPPED

LABELS = SHIPPED.joinpath(
    "atlases", "spina-bifida", "fetal_SB_atlas_GA21_notoperated", "parcellation.nii.gz"
)
calls = []


def words_in(files, *limits):
    """Yield the words of text files; InputError for an empty one."""
    calls.append(files)
    logging.getLogger("gyriflow.test").warning("read %s", len(files))
    for path in files:
        words = Path(path).read_text().split()
        yield from words[: limits[0] if limits else None]
        if not words:
            raise InputError("is empty", path=path)


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """Two scans, the second with an empty file after another."""
    calls.clear()
    monkeypatch.setattr(module, "code_hash", lambda *_: "code of this version")
    texts = {"a": "one two", "b": "three", "c": ""}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return [
        ScanFiles([str(tmp_path / name) for name in names]) for names in ("a", "bc")
    ]


def test_what_was_found_is_kept_with_warnings_and_errors(scans, own_cache):
    first, second = readings(words_in, scans)
    assert first == Reading(["one", "two"], ["read 1"])
    assert (second.values, second.warnings) == (["three"], ["read 2"])
    assert second.error.startswith(scans[1].files[1])
    assert readings(words_in, scans) == [first, second]
    assert len(calls) == 2
    # nobody else reads it
    assert (own_cache / "readings").stat().st_mode & 0o077 == 0


def test_files_are_read_again_whose_content_name_or_settings_are_others(
    scans, tmp_path
):
    readings(words_in, scans)
    (tmp_path / "a").write_text("one four")
    assert readings(words_in, scans)[0].values == ["one", "four"]
    assert len(calls) == 3
    (limited,) = readings(words_in, [ScanFiles(scans[0].files, (1,))])
    assert limited.values == ["one"]
    (tmp_path / "a").rename(tmp_path / "d")
    readings(words_in, [ScanFiles([str(tmp_path / "d")])])
    assert len(calls) == 5
    # what is not there yet is not kept
    missing = [ScanFiles([str(tmp_path / "e")])]
    for _ in range(2):
        with pytest.raises(FileNotFoundError):
            readings(words_in, missing)
    assert len(calls) == 7


def test_other_code_reads_again(scans, monkeypatch):
    readings(words_in, scans)
    monkeypatch.setattr(module, "code_hash", lambda *_: "code of another version")
    readings(words_in, scans)
    assert len(calls) == 4


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"result": {"values": 1, "x": 2}}']
)
def test_a_damaged_result_is_made_again(scans, own_cache, content):
    found = readings(words_in, scans)
    paths = sorted((own_cache / "readings").iterdir())
    for path in paths:
        path.write_text(content)
    assert readings(words_in, scans) == found
    assert all(json.loads(path.read_text())["result"] for path in paths)


def test_nothing_is_kept_where_the_folder_cannot_be_written(scans, own_cache):
    own_cache.parent.joinpath("gyriflow").write_text("a file")
    assert readings(words_in, scans) == readings(words_in, scans)
    assert len(calls) == 4


def test_the_results_used_last_are_kept(own_cache, monkeypatch):
    monkeypatch.setattr(kept_results, "MAX_KEPT", 2)
    for number, key in enumerate("abc"):
        keep_result(key, key)
        path = own_cache / "readings" / f"{key}.json"
        os.utime(path, (1e9 + number, 1e9 + number))
    assert kept_result("a") == "a"
    remove_old_results()
    assert [kept_result(key) for key in "abc"] == ["a", None, "c"]


@pytest.mark.slow
def test_many_scans_are_read_by_several_processes_as_by_one(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "available_cores", lambda: 2)
    monkeypatch.setattr(module, "MIN_IN_POOL", 3)
    (tmp_path / "b.nii.gz").write_bytes(b"torn")
    scans = [ScanFiles([str(path)]) for path in (LABELS, tmp_path / "b.nii.gz")]
    whole, torn = readings(fits_of_file, scans)
    assert whole.values[0]["spina-bifida-atlas"] == ""
    assert torn.error.startswith(str(tmp_path))
    others = []
    for name in "cde":
        (tmp_path / f"{name}.nii.gz").symlink_to(LABELS)
        others.append(ScanFiles([str(tmp_path / f"{name}.nii.gz")]))
    assert readings(fits_of_file, others) == [whole] * 3
