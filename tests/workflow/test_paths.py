"""Paths of atlases that studies keep for each other: found again, not missed, and made
anew where they are damaged."""

import pytest
from atlas_brains import atlas_labels
from configurations import write_atlas
from local_server import Server, serving
from shapes import save_labels

from gyriflow.io.registrations import read_weekly_shapes

from .conftest import COARSE, labelled

WEEKS = (22, 23)
TARGETS = "results/brains/mine/mesh/targets.atlas.h5"
MINE = {
    "id": "mine",
    "week": 22,
    "labels": "mine.nii.gz",
    "scheme": "spina-bifida-atlas",
    "population": "b",
}
PATH = "results/brains/far-22/path/shapes.h5"


@pytest.fixture
def server(tmp_path, monkeypatch):
    """Serve the labels of two weeks, of which no checksums are known."""
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    files = {}
    for week in WEEKS:
        save_labels(tmp_path / "labels.nii.gz", *atlas_labels(week))
        files[f"w{week}.nii.gz"] = (tmp_path / "labels.nii.gz").read_bytes()
    with serving(Server(files)) as running:
        yield running


def study(workflow, url):
    """Write a study that predicts a brain by an atlas at a server, whose files go to
    the folder `atlas`."""
    write_atlas(
        workflow.directory,
        {"scheme": "spina-bifida-atlas", "weeks": [*WEEKS]},
        name="far",
        url=url,
    )
    labels, affine = atlas_labels(22)
    save_labels(
        workflow.directory / "mine.nii.gz",
        labels,
        affine * [[1.05], [0.96], [1.0], [1.0]],
    )
    config = {
        "brains": [MINE],
        "atlas": {"name": "atlas.yaml", "folder": "atlas"},
        "start": "mine",
        "surface": {"edge_length_mm": 2.0},
        "mesh": COARSE | {"max_surface_distance_mm": 1.5},
        "growth": {"path_edge_mm": 3.0},
        "folding": {"preset": "expected", "end_week": 23},
    }
    return workflow.write("study.yaml", config)


@pytest.mark.slow
def test_a_path_is_made_once_and_found_again_whatever_becomes_of_the_kept_one(
    workflow, server
):
    call = (TARGETS, "--cores", "2", "--configfile", study(workflow, server.url))
    planned = workflow.jobs(*call)
    counts = [planned[rule] for rule in ("atlas_file", "atlas_path", "register")]
    assert counts == [2, 1, 2]
    assert workflow.call(*call) == 0
    folder = workflow.directory / "atlas" / "paths"
    (kept,) = folder.glob("far-22-*.h5")
    made = read_weekly_shapes(workflow.directory / PATH)
    assert kept.name == f"far-22-{made.made_from}.h5"

    # a finished study has nothing to do, with the kept path and without it
    assert workflow.jobs(*call) == {}
    folder.rename(workflow.directory / "away")
    assert workflow.jobs(*call) == {}
    (workflow.directory / "away").rename(folder)

    # another study copies it, and needs neither the kept one nor what that was made
    # from any more
    (workflow.directory / "results").rename(workflow.directory / "results of the first")
    planned = workflow.jobs(*call)
    assert (planned["kept_path"], planned["register"]) == (1, 1)
    assert "atlas_path" not in planned
    assert workflow.call(PATH, *call[1:]) == 0
    copied = read_weekly_shapes(workflow.directory / PATH)
    assert (copied.positions == made.positions).all()
    folder.rename(workflow.directory / "away")
    planned = workflow.jobs(*call)
    assert planned["register"] == 1
    assert not {"kept_path", "atlas_path", "path_mesh"} & set(planned)
    (workflow.directory / "away").rename(folder)

    # one that lost its end, or was changed inside
    (workflow.directory / PATH).unlink()
    whole = kept.read_bytes()
    middle = len(whole) // 2
    changed = whole[:middle] + bytes(100) + whole[middle + 100 :]
    for damaged in (whole[:middle], changed):
        kept.write_bytes(damaged)
        assert workflow.jobs(*call)["atlas_path"] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("atlas", "files"), [("dhcp-surface", 2 * 15), ("dhcp-volume", 15)]
)
def test_a_prediction_by_a_shipped_atlas_without_checksums_is_planned(
    workflow, atlas, files
):
    config = {
        "brains": [MINE | labelled(22)],
        "atlas": {"name": atlas, "weeks": [*range(22, 37)], "accept_licence": True},
        "start": "mine",
        "folding": {"preset": "expected", "end_week": 30},
    }
    name = workflow.write("study.yaml", config)
    planned = workflow.jobs(TARGETS, "--configfile", name)
    assert (planned["atlas_file"], planned["atlas_path"]) == (files, 1)
