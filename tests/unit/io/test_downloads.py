"""Files from a server: whole or not there, gone on with, checked; what is there is left as it is."""

import gzip
import hashlib
import socket

import pytest
from local_server import Server, gifti, packed, serving

from gyriflow.errors import StorageError
from gyriflow.io import downloads
from gyriflow.io.downloads import fetch, sha256_of

LABELS = packed(300_000)
SURFACE = gifti()
LONG = "parcellations/labels.nii.gz"
SHORT = "atlas/left.surf.gii"
HALF = "parcellations/.part.labels.nii.gz"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(downloads, "FIRST_WAIT_S", 0.0)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")


@pytest.fixture
def server():
    with serving(Server({LONG: LABELS, SHORT: SURFACE})) as running:
        yield running


def fetched(folder, server, name, **known):
    """Fetches a file of the server and returns the lines that were said."""
    said: list[str] = []
    fetch(folder / name, f"{server.url}/{name}", said.append, **known)
    return said


def sha256(content):
    return hashlib.sha256(content).hexdigest()


def files_in(folder):
    """Returns the content of each file of a folder by its path."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(("name", "content"), [(LONG, LABELS), (SHORT, SURFACE)])
def test_a_file_comes_whole_and_its_checksum_is_said(tmp_path, server, name, content):
    said = fetched(tmp_path / "new", server, name, sha256=sha256(content), size=len(content))
    assert files_in(tmp_path / "new") == {name: content}
    assert said == [f"{tmp_path}/new/{name}: SHA-256 {sha256(content)}"]
    assert sha256_of(tmp_path / "new" / name) == sha256(content)


@pytest.mark.parametrize(("name", "content"), [(LONG, LABELS), (SHORT, SURFACE)])
def test_without_a_checksum_a_file_has_to_be_readable(tmp_path, server, name, content):
    said = fetched(tmp_path, server, name)
    assert files_in(tmp_path) == {name: content}
    assert said[-1].endswith("as it came; no checksum is known")


def test_a_whole_gzip_file_that_is_no_volume_is_refused(tmp_path, server):
    server.files[LONG] = gzip.compress(b"no volume at all" * 100)
    with pytest.raises(StorageError, match="something else than the file; found a file that cannot be read"):
        fetched(tmp_path, server, LONG)
    assert files_in(tmp_path) == {}


def test_what_is_there_is_checked_and_never_replaced(tmp_path, server):
    (tmp_path / "atlas").mkdir()
    own = gifti(seed=5)
    (tmp_path / SHORT).write_bytes(own)
    assert fetched(tmp_path, server, SHORT) == [f"{tmp_path}/{SHORT} is there already"]
    with pytest.raises(StorageError, match=r"left\.surf\.gii: is not the file of the atlas; found the SHA-256"):
        fetched(tmp_path, server, SHORT, sha256=sha256(SURFACE))
    assert files_in(tmp_path) == {SHORT: own}
    assert server.asked == []


def test_a_broken_connection_is_gone_on_with(tmp_path, server):
    server.broken_after[LONG] = [200_000]
    fetched(tmp_path, server, LONG, sha256=sha256(LABELS))
    assert files_in(tmp_path) == {LONG: LABELS}
    (_, first), (_, second) = server.asked
    assert first is None
    # at most a chunk of an answer that broke off is lost
    start = int(second.removeprefix("bytes=").removesuffix("-"))
    assert 200_000 - downloads.CHUNK_BYTES <= start <= 200_000


def test_a_server_that_sends_no_parts_sends_all_again(tmp_path, server):
    server.ranges = False
    server.broken_after[LONG] = [200_000]
    fetched(tmp_path, server, LONG)
    assert files_in(tmp_path) == {LONG: LABELS}


def test_many_breaks_are_borne_as_long_as_something_comes(tmp_path, server):
    server.broken_after[LONG] = [70_000] * 4
    fetched(tmp_path, server, LONG)
    assert files_in(tmp_path) == {LONG: LABELS}
    assert len(server.asked) == 5 > downloads.TRIES


def test_half_a_file_is_not_there_under_its_name_and_the_next_call_goes_on(tmp_path, server):
    server.broken_after[LONG] = [150_000, *[0] * (downloads.TRIES - 1)]
    with pytest.raises(StorageError, match="cannot be fetched"):
        fetched(tmp_path, server, LONG)
    ((left, part),) = files_in(tmp_path).items()
    assert left == HALF
    assert 0 < len(part) < len(LABELS)
    assert LABELS.startswith(part)
    server.asked.clear()
    fetched(tmp_path, server, LONG)
    assert server.asked == [(LONG, f"bytes={len(part)}-")]
    assert files_in(tmp_path) == {LONG: LABELS}


def test_a_process_that_is_killed_leaves_its_half_file_alone(tmp_path, server, monkeypatch):
    def killed(_url, part, file, _say):
        file.write(LABELS[:1000])
        file.flush()
        seen.extend(path.name for path in tmp_path.rglob("*") if path.is_file())
        raise KeyboardInterrupt

    seen: list[str] = []
    monkeypatch.setattr(downloads, "_go_on", killed)
    with pytest.raises(KeyboardInterrupt):
        fetched(tmp_path, server, LONG)
    assert seen == [".part.labels.nii.gz"]


@pytest.mark.parametrize("name", [LONG, SHORT])
@pytest.mark.parametrize("known", [True, False], ids=["with its checksum", "without"])
def test_half_a_file_of_another_version_is_not_kept(tmp_path, server, name, known):
    before, after = {LONG: (LABELS, packed(300_000, seed=1)), SHORT: (SURFACE, gifti(seed=5))}[name]
    server.broken_after[name] = [len(before) // 2, *[0] * (downloads.TRIES - 1)]
    with pytest.raises(StorageError):
        fetched(tmp_path, server, name)
    server.files[name] = after
    fetched(tmp_path, server, name, **({"sha256": sha256(after)} if known else {}))
    assert files_in(tmp_path) == {name: after}


def test_a_whole_file_that_was_not_renamed_is_kept_in_the_end(tmp_path, server):
    (tmp_path / HALF).parent.mkdir()
    (tmp_path / HALF).write_bytes(LABELS)
    fetched(tmp_path, server, LONG, sha256=sha256(LABELS))
    assert files_in(tmp_path) == {LONG: LABELS}


@pytest.mark.fault(40)
def test_another_checksum_is_refused_and_nothing_kept(tmp_path, server):
    with pytest.raises(StorageError, match="something else than the file; found the SHA-256") as caught:
        fetched(tmp_path, server, LONG, sha256="0" * 64)
    assert f"{sha256(LABELS)} instead of {'0' * 64}" in str(caught.value)
    assert f"{server.url}/{LONG}" in str(caught.value)
    assert caught.value.exit_code == 5
    assert files_in(tmp_path) == {}


@pytest.mark.fault(40)
@pytest.mark.parametrize("name", [LONG, SHORT])
def test_a_page_in_the_place_of_a_file_is_refused(tmp_path, server, name):
    server.files[name] = b"<!DOCTYPE html><title>Log in</title>"
    with pytest.raises(StorageError, match="the server sent something else than the file; found no whole") as caught:
        fetched(tmp_path, server, name, sha256="0" * 64)
    assert "it begins with b'<!DOCTYPE html>" in str(caught.value)
    assert files_in(tmp_path) == {}


def test_a_file_that_the_server_lacks_is_named(tmp_path, server):
    with pytest.raises(StorageError, match=r"b\.gii: cannot be fetched; found 404"):
        fetched(tmp_path, server, "b.gii")
    assert files_in(tmp_path) == {}


def test_no_server_is_said_once_and_leaves_nothing(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}/a.gii"
        with pytest.raises(StorageError, match=r"a\.gii: cannot be fetched; found .*Connection refused") as caught:
            fetch(tmp_path / "new" / "a.gii", url, lambda _: None)
    assert "the network" in str(caught.value)
    assert caught.value.exit_code == 5
    assert files_in(tmp_path) == {}


def test_two_downloads_of_one_file_are_refused(tmp_path, server):
    half = tmp_path / HALF
    half.parent.mkdir()
    with downloads._alone_with(half), pytest.raises(StorageError, match="another download of this file"):
        fetched(tmp_path, server, LONG)
    fetched(tmp_path, server, LONG)
    assert files_in(tmp_path) == {LONG: LABELS}


def test_a_folder_that_cannot_be_made_and_a_full_disk_are_refused(tmp_path, server):
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match="cannot be written or read"):
        fetched(tmp_path / "file", server, SHORT)
    with pytest.raises(StorageError, match="no room for"):
        fetched(tmp_path, server, SHORT, size=2**60)
    assert server.asked == []
