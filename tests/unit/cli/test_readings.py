"""What was found in the files of scans is kept by their content and the code that reads
them."""

import json
import logging
import os
from pathlib import Path

import pytest

from gyriflow.cli import readings as module
from gyriflow.cli import recognition
from gyriflow.cli.readings import Reading, ScanFiles, readings
from gyriflow.errors import InputError
from gyriflow.shipped import SHIPPED

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
    files = [tmp_path / name for name in "abc"]
    for file, text in zip(files, ("one two", "three", ""), strict=True):
        file.write_text(text)
    return [
        ScanFiles([str(file) for file in group]) for group in (files[:1], files[1:])
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


def test_files_are_read_again_whose_content_name_settings_or_code_are_others(
    scans, tmp_path, monkeypatch
):
    def values(name="a", *settings):
        return readings(words_in, [ScanFiles([str(tmp_path / name)], settings)])[
            0
        ].values

    assert values() == ["one", "two"]
    (tmp_path / "a").write_text("one four")
    assert values() == ["one", "four"]
    assert values("a", 1) == ["one"]
    (tmp_path / "a").rename(tmp_path / "d")
    assert values("d") == ["one", "four"]
    monkeypatch.setattr(module, "code_hash", lambda *_: "code of another version")
    values("d")
    assert len(calls) == 5
    # what is not there yet is not kept
    for _ in range(2):
        with pytest.raises(FileNotFoundError):
            values("e")
    assert len(calls) == 7


@pytest.mark.parametrize("content", ["{", "[]", '{"result": {"x": 2}}'])
def test_a_damaged_result_is_made_again(scans, own_cache, content):
    found = readings(words_in, scans)
    paths = sorted((own_cache / "readings").iterdir())
    for path in paths:
        path.write_text(content)
    assert readings(words_in, scans) == found
    assert all(json.loads(path.read_text())["result"] for path in paths)


def test_nothing_is_kept_where_the_folder_cannot_be_written(scans, own_cache):
    own_cache.write_text("a file")
    assert readings(words_in, scans) == readings(words_in, scans)
    assert len(calls) == 4


def test_the_results_used_last_are_kept(scans, own_cache, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MAX_KEPT", 2)
    first, second, third = (ScanFiles([str(tmp_path / name)]) for name in "abc")
    readings(words_in, [first, second])
    for path in (own_cache / "readings").iterdir():
        os.utime(path, (1e9, 1e9))
    readings(words_in, [first])
    readings(words_in, [third])
    assert len(calls) == 3
    readings(words_in, [first, third])
    assert len(calls) == 3
    readings(words_in, [second])
    assert len(calls) == 4


@pytest.mark.slow
def test_many_scans_are_read_by_several_processes_as_by_one(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "available_cores", lambda: 2)
    monkeypatch.setattr(module, "MIN_IN_POOL", 3)
    folder = SHIPPED / "atlases" / "spina-bifida" / "fetal_SB_atlas_GA21_notoperated"
    scans = []
    for name in "abcd":
        path = tmp_path / f"{name}.nii.gz"
        path.symlink_to(folder / "parcellation.nii.gz")
        scans.append(ScanFiles([str(path)]))
    (tmp_path / "torn.nii.gz").write_bytes(b"torn")
    torn = ScanFiles([str(tmp_path / "torn.nii.gz")])
    whole, refused = readings(recognition._fits_of_file, [scans[0], torn])
    assert whole.values[0]["spina-bifida-atlas"] == ""
    assert refused.error.startswith(str(tmp_path))
    assert readings(recognition._fits_of_file, scans[1:]) == [whole] * 3
