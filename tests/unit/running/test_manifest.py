"""Jobs and the manifests of their results: every difference is found, and nothing else
is one."""

from dataclasses import replace

import pytest
from facts import Facts

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


@pytest.fixture
def job(tmp_path, monkeypatch):
    """A job that has ended, with its manifest, in the working directory."""
    monkeypatch.chdir(tmp_path)
    for name in ("left", "right", "table"):
        (tmp_path / name).write_text(name)
    settings = {
        "labels": LabelSource(str(tmp_path / "table"), "auto", SCHEME),
        "surface": {"edge_length_mm": 1.0, "open_sulci": True},
        "place": str(tmp_path),
        "code": "code 1",
    }
    inputs = {
        "left": [str(tmp_path / "left")],
        "right": [str(tmp_path / "right")],
        "tables": ["results/one.csv", "results/two.csv"],
    }
    (tmp_path / "results").mkdir()
    for number, name in enumerate(("one.csv", "two.csv", "pial.surf.gii")):
        (tmp_path / "results" / name).write_text(str(number))
    made = Job(
        "pial",
        inputs,
        ["results/pial.surf.gii"],
        manifest_of(LOG),
        lambda: settings,
    )
    write_manifest(made, Contents({}, {}))
    return made


def how(job):
    """Return how a job differs now from its manifest."""
    return difference(job, read_manifest(job.manifest), Contents({}, {}))


def test_a_manifest_lies_beside_the_results_in_a_folder_of_its_own(job):
    assert job.manifest.as_posix() == "results/brains/a/manifest/pial.json"
    assert manifest_of("pial.log") is None
    assert list(recorded_results(job.manifest.parents[1])) == job.outputs
    assert how(job) == ""


def test_other_content_of_a_file_or_a_result_is_a_difference(job, tmp_path):
    (tmp_path / "results" / "pial.surf.gii").write_text("edited")
    assert how(job) == Facts("changed result", "pial.surf.gii")
    (tmp_path / "results" / "pial.surf.gii").write_text("2")
    (tmp_path / "results" / "two.csv").write_text("of another edge")
    assert how(job) == Facts("changed input", "two.csv")
    (tmp_path / "results" / "two.csv").write_text("1")
    assert how(job) == ""
    # also of a file that only a setting names
    (tmp_path / "table").write_text("other")
    assert how(job) == Facts("changed settings", "labels")


def test_a_moved_or_renamed_file_is_none_unless_its_role_is_another(job, tmp_path):
    (tmp_path / "left").rename(tmp_path / "renamed")
    moved = job.inputs | {"left": [str(tmp_path / "renamed")]}
    assert how(replace(job, inputs=moved)) == ""
    exchanged = moved | {"left": moved["right"], "right": moved["left"]}
    assert how(replace(job, inputs=exchanged)) == Facts("changed input", "right")
    turned = moved | {"tables": moved["tables"][::-1]}
    assert how(replace(job, inputs=turned)) == Facts("changed input", "one.csv")


@pytest.mark.parametrize("tables", [[], ["results/one.csv"]])
def test_fewer_or_more_inputs_are_a_difference(job, tables, tmp_path):
    fewer = job.inputs | {"tables": tables}
    assert how(replace(job, inputs=fewer)) == Facts("changed input", "two.csv")
    more = job.inputs | {"given": [str(tmp_path / "table")]}
    assert how(replace(job, inputs=more)) == Facts("changed input", "table")
    named = {name: files for name, files in job.inputs.items() if name != "left"}
    assert how(replace(job, inputs=named)) == Facts("changed input", "left")


def test_a_removed_input_is_a_difference_unless_it_would_be_made_from_the_same(
    job, tmp_path
):
    manifest = read_manifest(job.manifest)
    content = Contents({}, {}).get("results/one.csv")
    (tmp_path / "results" / "one.csv").unlink()
    assert how(job) == Facts("changed input", "one.csv")
    assert difference(job, manifest, Contents({}, {"results/one.csv": content})) == ""


def test_changed_settings_are_named_with_their_values(job):
    settings = dict(job.settings())
    finer = settings | {"surface": {"edge_length_mm": 0.8, "open_sulci": True}}
    assert how(replace(job, settings=lambda: finer)) == Facts(
        "edge_length_mm 0.8 (was 1.0)"
    )
    # another meaning of the labels, which is no parameter of its own
    other = settings["labels"]._replace(
        scheme=SCHEME.model_copy(update={"cortex": (1,)})
    )
    changed = settings | {"labels": other}
    assert how(replace(job, settings=lambda: changed)) == Facts("labels")
    # the place of a folder is no setting
    elsewhere = settings | {"place": "/elsewhere"}
    assert how(replace(job, settings=lambda: elsewhere)) == ""


def test_changed_code_is_reported_only_where_nothing_else_has_changed(job):
    newer = dict(job.settings()) | {"code": "code 2"}
    assert how(replace(job, settings=lambda: newer)) == CHANGED_CODE
    coarser = newer | {"surface": {"edge_length_mm": 2.0, "open_sulci": True}}
    told = how(replace(job, settings=lambda: coarser))
    assert told == "changed settings edge_length_mm 2.0 (was 1.0)"


@pytest.mark.parametrize("text", [None, "{"])
def test_results_without_a_manifest_do_not_match_any_job(job, text):
    job.manifest.unlink()
    if text:
        job.manifest.write_text(text)
    assert how(job) == NO_MANIFEST


def test_a_manifest_has_the_contents_of_inputs_from_before_the_job(job, tmp_path):
    found = Contents({}, {})
    found.read(job.files)
    # while the job runs
    (tmp_path / "left").write_text("another")
    write_manifest(job, found)
    assert how(job) == Facts("changed input", "left")


def test_a_file_that_is_fetched_counts_as_there(job, tmp_path):
    found = Contents({}, {})
    expected = found.get(str(tmp_path / "left"))
    (tmp_path / "left").unlink()
    awaited = Contents({}, {str(tmp_path / "left"): expected})
    assert difference(job, read_manifest(job.manifest), awaited) == ""


def test_files_that_have_not_changed_are_not_read_again(job, tmp_path):
    known = {job.outputs[0]: [*recorded_results(tmp_path)[job.outputs[0]]]}
    known[job.outputs[0]][0] = "its hash"
    assert Contents(known, {}).get(job.outputs[0]) == "its hash"
    (tmp_path / job.outputs[0]).write_text("of another size")
    assert Contents(known, {}).get(job.outputs[0]) != "its hash"
