"""Downloads from a server on this machine: gone on with, checked, and never a torn file under its own name."""

import hashlib
import socket

import pytest
from local_server import Server, gifti, packed, serving

from gyriflow.errors import StorageError
from gyriflow.io import downloads
from gyriflow.io.downloads import CHECKSUMS, fetch

LABELS = packed(300_000)
SURFACE = gifti("left")
LONG = "parcellations/labels.nii.gz"
SHORT = "atlas/left.surf.gii"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(downloads, "FIRST_WAIT_S", 0.0)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")


@pytest.fixture
def server():
    with serving(Server({LONG: LABELS, SHORT: SURFACE})) as running:
        yield running


def fetched(folder, server, *names):
    """Fetches files of the server; returns the names of those that came and the lines that were said."""
    said: list[str] = []
    return fetch(folder, {name: f"{server.url}/{name}" for name in names}, said.append), said


def whole_files(folder):
    """Returns the content of each file of a folder but the record of checksums, by its path."""
    paths = [path for path in folder.rglob("*") if path.is_file() and path.name != CHECKSUMS]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def test_files_come_whole_with_their_checksums(tmp_path, server):
    names, said = fetched(tmp_path / "new", server, LONG, SHORT)
    assert names == [LONG, SHORT]
    assert whole_files(tmp_path / "new") == {LONG: LABELS, SHORT: SURFACE}
    lines = (tmp_path / "new" / CHECKSUMS).read_text().splitlines()
    assert lines == sorted(f"{name} {hashlib.sha256(server.files[name]).hexdigest()}" for name in (LONG, SHORT))
    assert said == [f"1 of 2: {LONG}", f"2 of 2: {SHORT}"]


def test_what_is_there_is_checked_and_not_fetched_again(tmp_path, server):
    fetched(tmp_path, server, SHORT)
    server.asked.clear()
    names, said = fetched(tmp_path, server, LONG, SHORT)
    assert names == [LONG]
    assert server.asked == [(LONG, None)]
    assert said[0] == "1 of 2 files are there: 1 as recorded, 0 recorded now"


def test_a_copy_of_the_users_own_is_recorded_and_kept(tmp_path, server):
    own = tmp_path / "my atlas"
    own.mkdir()
    (own / "left.surf.gii").write_bytes(gifti("mine"))
    names, _ = fetched(tmp_path, server, "my atlas/left.surf.gii")
    assert (names, server.asked) == ([], [])
    (own / "left.surf.gii").write_bytes(gifti("changed"))
    with pytest.raises(StorageError, match=r"not as recorded on first use: my atlas/left\.surf\.gii"):
        fetched(tmp_path, server, "my atlas/left.surf.gii")


def test_a_broken_connection_is_gone_on_with(tmp_path, server):
    server.broken_after[LONG] = [200_000]
    fetched(tmp_path, server, LONG)
    assert whole_files(tmp_path) == {LONG: LABELS}
    (_, first), (_, second) = server.asked
    assert first is None
    # at most a chunk of an answer that broke off is lost
    start = int(second.removeprefix("bytes=").removesuffix("-"))
    assert 200_000 - downloads.CHUNK_BYTES <= start <= 200_000


@pytest.mark.parametrize("lacking", ["ranges", "versions"])
def test_a_server_that_sends_no_parts_sends_all_again(tmp_path, server, lacking):
    setattr(server, lacking, False)
    server.broken_after[LONG] = [200_000]
    fetched(tmp_path, server, LONG)
    assert whole_files(tmp_path) == {LONG: LABELS}


def test_many_breaks_are_borne_as_long_as_something_comes(tmp_path, server):
    server.broken_after[LONG] = [70_000] * 4
    fetched(tmp_path, server, LONG)
    assert whole_files(tmp_path) == {LONG: LABELS}
    assert len(server.asked) == 5 > downloads.TRIES


def test_half_a_file_is_not_there_under_its_name_and_the_next_call_goes_on(tmp_path, server):
    server.broken_after[LONG] = [150_000, *[0] * (downloads.TRIES - 1)]
    with pytest.raises(StorageError, match="cannot be fetched"):
        fetched(tmp_path, server, SHORT, LONG)
    left = whole_files(tmp_path)
    part = left.pop("parcellations/.labels.nii.gz.part")
    del left["parcellations/.labels.nii.gz.part.version"]
    assert left == {SHORT: SURFACE}
    assert LABELS.startswith(part)
    server.asked.clear()
    fetched(tmp_path, server, SHORT, LONG)
    assert server.asked == [(LONG, f"bytes={len(part)}-")]
    assert whole_files(tmp_path) == {LONG: LABELS, SHORT: SURFACE}


def test_a_process_that_is_killed_leaves_its_half_file_alone(tmp_path, server, monkeypatch):
    def killed(_url, part, _say):
        part.write_bytes(LABELS[:1000])
        seen.extend(path.name for path in tmp_path.rglob("*") if path.is_file())
        raise KeyboardInterrupt

    seen: list[str] = []
    monkeypatch.setattr(downloads, "_go_on", killed)
    with pytest.raises(KeyboardInterrupt):
        fetched(tmp_path, server, LONG)
    assert seen == [".labels.nii.gz.part"]


def test_half_a_file_of_another_version_is_not_gone_on_with(tmp_path, server):
    server.broken_after[LONG] = [150_000, *[0] * (downloads.TRIES - 1)]
    with pytest.raises(StorageError):
        fetched(tmp_path, server, LONG)
    server.files[LONG] = packed(300_000, seed=1)
    fetched(tmp_path, server, LONG)
    assert whole_files(tmp_path) == {LONG: server.files[LONG]}


def test_another_checksum_is_refused_and_nothing_kept(tmp_path, server):
    fetched(tmp_path, server, LONG)
    (tmp_path / LONG).unlink()
    server.files[LONG] = packed(300_000, seed=1)
    with pytest.raises(StorageError, match=r"labels\.nii\.gz: the server's file is not the one recorded on first use"):
        fetched(tmp_path, server, LONG)
    assert whole_files(tmp_path) == {}


def test_all_damaged_files_are_named_and_left_for_the_user(tmp_path, server):
    fetched(tmp_path, server, LONG, SHORT)
    for name in (LONG, SHORT):
        (tmp_path / name).write_bytes(server.files[name][:-20])
    with pytest.raises(StorageError, match="holds 2 damaged or changed files") as caught:
        fetched(tmp_path, server, LONG, SHORT)
    assert f"not as recorded on first use: {LONG}, {SHORT}" in str(caught.value)
    assert "Delete the damaged ones" in str(caught.value)


def test_a_torn_copy_is_refused_on_first_use(tmp_path, server):
    (tmp_path / "parcellations").mkdir()
    (tmp_path / LONG).write_bytes(LABELS[:-20])
    with pytest.raises(StorageError, match=f"torn or something else: {LONG}"):
        fetched(tmp_path, server, LONG)
    assert not (tmp_path / CHECKSUMS).exists()


@pytest.mark.parametrize("name", [LONG, SHORT])
def test_a_page_in_the_place_of_a_file_is_refused(tmp_path, server, name):
    server.files[name] = b"<!DOCTYPE html><title>Log in</title>"
    with pytest.raises(StorageError, match="the server sent something else; found no whole") as caught:
        fetched(tmp_path, server, name)
    assert "<!DOCTYPE html>" in str(caught.value)
    assert whole_files(tmp_path) == {}


def test_files_that_the_server_lacks_are_named_after_the_others_came(tmp_path, server):
    with pytest.raises(StorageError, match="the server has no such file: ") as caught:
        fetched(tmp_path, server, "a.gii", LONG, "b.gii")
    assert f"{server.url}/a.gii, {server.url}/b.gii" in str(caught.value)
    assert whole_files(tmp_path) == {LONG: LABELS}


def test_a_file_that_nothing_needs_may_be_lacking(tmp_path, server):
    urls = {name: f"{server.url}/{name}" for name in (LONG, "t2.nii.gz")}
    said = []
    assert fetch(tmp_path, urls, said.append, ["t2.nii.gz"]) == [LONG]
    assert any("no t2.nii.gz" in line for line in said)
    assert whole_files(tmp_path) == {LONG: LABELS}


def test_no_server_is_said_once_and_leaves_nothing(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}/a.gii"
        with pytest.raises(StorageError, match=r"a\.gii: cannot be fetched; found .*Connection refused") as caught:
            fetch(tmp_path / "new", {"a.gii": url}, lambda _: None)
    assert "Check the network" in str(caught.value)
    assert caught.value.exit_code == 5
    assert whole_files(tmp_path) == {}


def test_two_downloads_into_one_folder_are_refused(tmp_path, server):
    with downloads._alone_in(tmp_path), pytest.raises(StorageError, match="another download into this folder"):
        fetched(tmp_path, server, SHORT)
    fetched(tmp_path, server, SHORT)


def test_a_folder_that_cannot_be_made_is_refused(tmp_path, server):
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match="cannot be written or read"):
        fetched(tmp_path / "file" / "folder", server, SHORT)


def test_a_record_that_is_no_record_is_refused(tmp_path, server):
    (tmp_path / CHECKSUMS).write_text("one two three four\n")
    with pytest.raises(StorageError, match=CHECKSUMS):
        fetched(tmp_path, server, SHORT)
