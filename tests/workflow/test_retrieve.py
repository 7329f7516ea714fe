"""Missing files of atlases, fetched by the workflow from a server on this machine; what
is there is left alone."""

from pathlib import Path

import pytest
from configurations import write_atlas
from facts import Facts
from local_server import Server, files_in, packed, serving, sha256

pytestmark = pytest.mark.slow

WEEKS = (21, 22)
FILES = {f"w{week}/labels.nii.gz": packed(100_000, week) for week in WEEKS}


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch):
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")


@pytest.fixture
def server():
    with serving(Server(dict(FILES))) as running:
        yield running


def study(folder: Path, url: str) -> dict:
    """Write an atlas whose files are at a server into a folder and return a study of
    it."""
    weeks = {
        week: {"labels": sha256(FILES[f"w{week}/labels.nii.gz"])} for week in WEEKS
    }
    write_atlas(
        folder,
        {"files": {"labels": "w{week}/labels.nii.gz"}, "weeks": weeks},
        name="far",
        url=url,
    )
    return {"atlas": "atlas.yaml", "start": "far-21", "folding": {"end_week": 22}}


@pytest.fixture
def said(workflow, capfd):
    """Return a function: what a call for study.yaml that ends in a code has told."""

    def said(*arguments, cores=1, code=0):
        capfd.readouterr()
        call = (*arguments, "--cores", str(cores), "--configfile", "study.yaml")
        assert workflow.call(*call) == code
        return capfd.readouterr().err

    return said


def test_missing_files_are_planned_announced_and_fetched_by_what_needs_them(
    workflow, server, said
):
    workflow.write("study.yaml", study(workflow.directory, server.url))
    folder = workflow.directory / "resources" / "atlases" / "far"
    planned = said("-n", "growth")
    assert Facts("far:", 2, folder) in planned.splitlines()
    assert planned == Facts("CC0", "Do what you like.")
    assert server.asked == []

    long = "w21/labels.nii.gz"
    server.broken_after[long] = [60_000]
    # a surface needs the file of its own week only
    assert said(f"{folder}/{long}").count("Do what you like.") == 1
    assert files_in(folder) == {long: FILES[long]}
    assert server.asked.count(long) == 2

    said("retrieve", cores=2)
    assert files_in(folder) == FILES

    # then there is nothing to fetch and nothing to tell, whatever is forced
    server.asked.clear()
    assert "Do what you like." not in said("retrieve", "--forceall")
    said("--delete-all-output")
    assert files_in(folder) == FILES
    assert server.asked == []


def test_copies_of_the_users_own_stay_as_they_are(workflow, server, said):
    raw = study(workflow.directory, server.url)
    raw["atlas"] = {"name": "atlas.yaml", "folder": "mine"}
    workflow.write("study.yaml", raw)
    own = workflow.directory / "mine" / "old" / "w21" / "labels.nii.gz"
    own.parent.mkdir(parents=True)
    own.write_bytes(FILES["w21/labels.nii.gz"])
    before = own.stat()
    # the other file never comes whole
    server.files["w22/labels.nii.gz"] = FILES["w22/labels.nii.gz"][:-20]
    assert "Traceback" not in said("retrieve", code=5)
    assert files_in(workflow.directory / "mine") == {
        "old/w21/labels.nii.gz": FILES["w21/labels.nii.gz"]
    }
    after = own.stat()
    assert (after.st_mtime_ns, after.st_ino) == (before.st_mtime_ns, before.st_ino)

    # a changed copy is named by the stage that reads it, and left to the user
    own.write_bytes(packed(1000))
    refused = said("results/brains/far-21/surface/pial.surf.gii", code=2)
    assert refused == Facts(f"{own}:", "far", sha256(FILES["w21/labels.nii.gz"]))
    assert own.read_bytes() == packed(1000)
