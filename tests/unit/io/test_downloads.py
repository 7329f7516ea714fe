"""Files from a server: whole or not there, checked; what is there is left as it is."""

import socket

import pytest
from facts import Facts
from local_server import Server, files_in, gifti, packed, serving, sha256

from gyriflow.errors import StorageError
from gyriflow.io import downloads
from gyriflow.io.downloads import fetch

LABELS = packed(300_000)
SURFACE = gifti()
LONG = "parcellations/labels.nii.gz"
SHORT = "atlas/left.surf.gii"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr("pooch.core.time.sleep", lambda _: None)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")


@pytest.fixture
def server():
    with serving(Server({LONG: LABELS, SHORT: SURFACE})) as running:
        yield running


def fetched(folder, server, name, **known):
    """Fetches a file of the server and return the lines that were said."""
    said: list[str] = []
    fetch(folder / name, f"{server.url}/{name}", said.append, **known)
    return said


@pytest.mark.parametrize(("name", "content"), [(LONG, LABELS), (SHORT, SURFACE)])
def test_a_file_comes_whole_through_a_linked_folder_and_its_checksum_is_said(
    tmp_path, server, name, content
):
    (tmp_path / "store").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "store")
    said = fetched(tmp_path / "link", server, name, sha256=sha256(content))
    assert files_in(tmp_path / "store") == {name: content}
    assert (tmp_path / "link").is_symlink()
    assert said == [Facts(tmp_path / "link" / name, sha256(content))]


def test_what_is_there_is_checked_and_never_replaced(tmp_path, server):
    (tmp_path / "atlas").mkdir()
    own = gifti(seed=5)
    (tmp_path / SHORT).write_bytes(own)
    assert fetched(tmp_path, server, SHORT) == [Facts(tmp_path / SHORT)]
    facts = Facts(tmp_path / SHORT, sha256(own), sha256(SURFACE))
    with pytest.raises(StorageError, check=facts):
        fetched(tmp_path, server, SHORT, sha256=sha256(SURFACE))
    assert files_in(tmp_path) == {SHORT: own}
    assert server.asked == []


PAGE, OTHER = b"<!DOCTYPE html><title>Log in</title>", "0" * 64
HALF = [150_000] * downloads.TRIES


@pytest.mark.parametrize(
    ("name", "content", "broken", "known", "facts"),
    [
        (LONG, LABELS, HALF, OTHER, [150_000]),
        (LONG, LABELS, [], OTHER, [sha256(LABELS), OTHER]),
        (LONG, PAGE, [], None, ["b'<!DOCTYPE html>"]),
        (SHORT, PAGE, [], None, ["b'<!DOCTYPE html>"]),
        (SHORT, SURFACE[:-20], [], None, ["b'<?xml"]),
    ],
    ids=["broken", "checksum", "page for volume", "page for surface", "half a surface"],
)
def test_what_is_not_the_file_is_refused_and_nothing_is_kept(
    tmp_path, server, name, content, broken, known, facts
):
    server.files[name], server.broken_after[name] = content, list(broken)
    facts = Facts(f"{server.url}/{name}:", *facts)
    with pytest.raises(StorageError, check=facts) as caught:
        fetched(tmp_path, server, name, sha256=known)
    assert caught.value.exit_code == 5
    assert files_in(tmp_path) == {}


def test_without_a_network_nothing_is_kept(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nowhere = Server({}, url=f"http://127.0.0.1:{free.getsockname()[1]}")
        url = f"{nowhere.url}/{SHORT}:"
        facts = Facts(url, "Connection refused", tmp_path / "atlas")
        with pytest.raises(StorageError, check=facts):
            fetched(tmp_path, nowhere, SHORT)
    assert files_in(tmp_path) == {}
