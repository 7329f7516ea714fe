"""Jobs and the manifests of their results: every difference is found, and nothing else
is one."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from gyriflow.io.volumes import LabelSource
from gyriflow.running.manifest import (
    CHANGED_CODE,
    NO_MANIFEST,
    Contents,
    Job,
    difference,
    manifest_of,
    read_manifest,
    recorded_results,
    write_manifest,
)
from gyriflow.settings.schemes import LabelScheme

LOG = "results/brains/a/logs/pial.log"
SCHEME = LabelScheme(name="own", cerebrum=[1, 2], cortex=[2])
OTHER_SCHEME = LabelScheme(name="own", cerebrum=[1, 2], cortex=[1])
SURFACE = {"edge_length_mm": 1.0, "open_sulci": True}
FINER = SURFACE | {"edge_length_mm": 0.8}
ONE, TWO, PIAL = "results/one.csv", "results/two.csv", "results/pial.surf.gii"


def labels(scheme=SCHEME):
    """Return a setting with the path of a file and what its labels mean."""
    return LabelSource(str(Path("table").absolute()), "auto", scheme)


@pytest.fixture
def job(tmp_path, monkeypatch):
    """A job that has ended, with its manifest, in the working directory."""
    monkeypatch.chdir(tmp_path)
    Path("results").mkdir()
    for name in ("left", "right", "table", ONE, TWO, PIAL):
        Path(name).write_text(f"content of {name}")
    inputs = {"left": ["left"], "right": ["right"], "tables": [ONE, TWO]}
    settings = {
        "labels": labels(),
        "surface": SURFACE,
        "place": str(tmp_path),
        "code": "code 1",
    }
    made = Job("pial", inputs, [PIAL], manifest_of(LOG), lambda: settings)
    write_manifest(made, Contents({}, {}))
    return made


def how(job, **absent):
    """Return how a job differs now from its manifest; absent files would have their old
    content."""
    return difference(job, read_manifest(job.manifest), Contents({}, absent))


def edited(name):
    """Have another file of the same size in a file's place, with an older date."""

    def change(job):
        Path(name).write_text(Path(name).read_text().upper())
        os.utime(name, (1e9, 1e9))
        return job

    return change


def removed(name):
    def change(job):
        Path(name).unlink()
        return job

    return change


def renamed(job):
    Path("left").rename("moved")
    return with_inputs(left=["moved"])(job)


def with_inputs(**roles):
    def change(job):
        return replace(job, inputs=job.inputs | roles)

    return change


def without_left(job):
    inputs = {role: job.inputs[role] for role in ("right", "tables")}
    return replace(job, inputs=inputs)


def with_settings(**values):
    def change(job):
        return replace(job, settings=lambda: job.settings() | values)

    return change


def with_other_meaning(job):
    return with_settings(labels=labels(OTHER_SCHEME))(job)


FINER_SAID = "changed settings edge_length_mm 0.8 (was 1.0)"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (with_settings(), ""),
        # files by their content, also of one that only a setting names
        (edited(PIAL), "changed result pial.surf.gii"),
        (edited(TWO), "changed input two.csv"),
        (edited("table"), "changed settings labels"),
        (removed(ONE), "changed input one.csv"),
        # inputs by their role and order
        (renamed, ""),
        (with_inputs(left=["right"], right=["left"]), "changed input right, left"),
        (with_inputs(tables=[TWO, ONE]), "changed input two.csv, one.csv"),
        (with_inputs(tables=[ONE]), "changed input two.csv"),
        (with_inputs(tables=[]), "changed input one.csv, two.csv"),
        (with_inputs(more=["table"]), "changed input table"),
        (without_left, "changed input left"),
        # settings by their value; the place of a folder is none
        (with_settings(surface=FINER), FINER_SAID),
        (with_other_meaning, "changed settings labels"),
        (with_settings(place="/elsewhere"), ""),
        # code where nothing else has changed
        (with_settings(code="code 2"), CHANGED_CODE),
        (with_settings(code="code 2", surface=FINER), FINER_SAID),
    ],
)
def test_each_difference_of_a_job_from_its_manifest_is_named(job, change, expected):
    assert how(change(job)) == expected


def test_a_manifest_lies_beside_the_results_in_a_folder_of_its_own(job):
    assert job.manifest.as_posix() == "results/brains/a/manifest/pial.json"
    assert manifest_of("pial.log") is None
    assert list(recorded_results(job.manifest.parents[1])) == job.outputs


@pytest.mark.parametrize("text", [None, "{"])
def test_results_without_a_manifest_do_not_match_any_job(job, text):
    job.manifest.unlink()
    if text:
        job.manifest.write_text(text)
    assert how(job) == NO_MANIFEST


def test_a_manifest_has_the_contents_of_inputs_from_before_the_job(job):
    found = Contents({}, {})
    found.read(job.files)
    # while the job runs
    edited("left")(job)
    write_manifest(job, found)
    assert how(job) == "changed input left"


@pytest.mark.parametrize("name", [ONE, "left"])
def test_a_file_that_would_be_made_or_fetched_from_the_same_counts_as_there(job, name):
    content = Contents({}, {}).get(name)
    Path(name).unlink()
    assert how(job, **{name: content}) == ""


def test_files_that_have_not_changed_are_not_read_again(job, tmp_path):
    _, *facts = recorded_results(tmp_path)[PIAL]
    known = {PIAL: ["its hash", *facts]}
    assert Contents(known, {}).get(PIAL) == "its hash"
    edited(PIAL)(job)
    assert Contents(known, {}).get(PIAL) != "its hash"
