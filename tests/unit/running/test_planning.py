"""Which jobs of a plan run again, and which files Snakemake is told to make."""

import json
import logging
import os
from dataclasses import replace
from pathlib import Path

import pytest
from facts import Facts

from gyriflow.running import launch
from gyriflow.running.manifest import COPIES, Contents, Job, manifest_of, write_manifest
from gyriflow.running.planning import (
    BY_ANOTHER_JOB,
    FORCED,
    MISSING,
    Events,
    Plan,
    hide_results,
    keep_contents,
    link_results,
    listing,
    made_plan,
    restore_results,
    view_of,
)

EDGE = {"edge_mm": 1.0}


def planned_job(rule, inputs, output, settings=EDGE):
    """Return a job with one result."""
    manifest = manifest_of(f"results/logs/{rule}.log")
    return Job(rule, {"given": inputs}, [output], manifest, lambda: settings)


def plan(settings=EDGE):
    """Return the jobs of a study: scan, surface, mesh and metrics of it, a table."""
    jobs = [
        planned_job("surface", ["scan"], "results/surface", settings),
        planned_job("mesh", ["results/surface"], "results/mesh"),
        planned_job("run", ["results/mesh"], "results/run"),
        planned_job("metrics", ["results/surface"], "results/metrics"),
        planned_job("other", ["scan"], "results/other"),
        Job(
            "all",
            {"": ["results/run", "results/metrics", "results/other"]},
            [],
            None,
            dict,
        ),
    ]
    keyed = {job.key: job for job in jobs}
    return Events(jobs=keyed)


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A finished study in the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    (tmp_path / "scan").write_text("a brain")
    jobs = [job for job in plan().jobs.values() if job.outputs]
    for job in jobs:
        (tmp_path / job.outputs[0]).write_text(job.rule)
    for job in jobs:
        write_manifest(job, Contents({}, {}))
    return tmp_path


def reasons(events, targets=("all",), forced=()):
    """Return why jobs run, by rule."""
    made = made_plan(events, targets, forced)
    return {events.jobs[key].rule: why for key, why in made.reasons.items()}


def edit(name, text):
    Path("results", name).write_text(text)


def remove(*names):
    for name in names:
        Path("results", name).unlink()


def record(rule):
    """Write the manifest of a job anew."""
    write_manifest(plan().jobs[f"results/{rule}"], Contents({}, {}))


BEHIND_THE_SURFACE = {"surface", "mesh", "metrics", "run"}


@pytest.mark.parametrize(
    ("change", "edge_mm", "rules"),
    [
        (lambda: None, 1.0, set()),
        (lambda: None, 2.0, BEHIND_THE_SURFACE),
        (lambda: edit("mesh", "edited"), 1.0, {"mesh", "run"}),
        # a removed result is made again only where something needs it
        (lambda: remove("surface"), 1.0, set()),
        # and may be another one then
        (lambda: remove("surface", "metrics"), 1.0, BEHIND_THE_SURFACE),
        (lambda: remove("mesh"), 2.0, BEHIND_THE_SURFACE),
        # its step has failed after that of the surface
        (
            lambda: (remove("mesh"), edit("surface", "of an edge"), record("surface")),
            1.0,
            {"mesh", "metrics", "run"},
        ),
        # it is unknown what it was
        (lambda: remove("mesh", "manifest/mesh.json"), 1.0, {"mesh", "run"}),
    ],
)
def test_what_does_not_match_its_manifest_runs_again_with_what_depends_on_it(
    study, change, edge_mm, rules
):
    change()
    assert set(reasons(plan({"edge_mm": edge_mm}))) == rules


def test_a_reason_names_what_has_changed_or_is_missing(study):
    again = reasons(plan({"edge_mm": 2.0}))
    assert again["surface"] == Facts("edge_mm")
    assert again["run"] == f"{BY_ANOTHER_JOB}: mesh"
    remove("metrics")
    assert reasons(plan())["metrics"] == f"{MISSING}: results/metrics"


def test_what_depends_on_a_forced_job_runs_again(study):
    again = reasons(plan(), forced=["mesh"])
    assert again == {"mesh": FORCED, "run": f"{BY_ANOTHER_JOB}: mesh"}
    assert set(reasons(plan(), forced=["results/run"])) == {"run"}


def test_a_dry_run_lists_the_jobs_that_run_with_files_and_reason_and_counts_them(study):
    made = made_plan(plan(), ["all"], ["mesh"])
    text = listing(made)
    _, mesh, run = text.split("\nrule ")
    assert mesh == Facts("mesh:", "input: results/surface", "output: results/mesh")
    assert mesh == Facts(f"reason: {FORCED}")
    assert run == Facts("run:", f"reason: {BY_ANOTHER_JOB}: mesh")
    counts = listing(made, ["rules"])
    assert text.startswith(counts)
    assert [line.split() for line in counts.splitlines()[-3:]] == [
        ["mesh", "1"],
        ["run", "1"],
        ["total", "2"],
    ]
    assert listing(made, ["rules", "all"]) == ""


def test_a_rule_without_results_asks_for_all_results_of_the_jobs_that_it_names(study):
    events = plan()
    job = replace(
        events.jobs["results/metrics"], outputs=["results/metrics", "results/maps"]
    )
    edit("maps", "maps")
    events.jobs[job.key] = job
    write_manifest(job, Contents({}, {}))
    assert reasons(events) == {}
    remove("maps")
    assert reasons(events) == {"metrics": f"{MISSING}: results/maps"}
    # Snakemake is asked for the other one, which it does not see
    assert made_plan(events, ["all"], []).outdated == ["results/metrics"]
    assert reasons(events, targets=["results/metrics"]) == reasons(events)


@pytest.mark.parametrize("target", ["results/surface", "surface"])
def test_an_asked_for_file_is_made(study, target):
    remove("surface")
    assert "surface" in reasons(plan(), targets=[target])


def test_outdated_results_are_hidden_during_a_run_and_not_lost(study):
    made = made_plan(plan({"edge_mm": 2.0}), ["all"], [])
    names = {"results/surface", "results/mesh", "results/metrics", "results/run"}
    assert set(made.outdated) == names
    hide_results(study, made.outdated)
    assert not any((study / name).exists() for name in names)
    # one was made again, the job of another failed, the others have not begun
    edit("surface", "new")
    restore_results(study, ["results/metrics"])
    left = {path.name: path.read_text() for path in study.glob("results/*[!t]")}
    assert left == {"surface": "new", "mesh": "mesh", "run": "run", "other": "other"}
    assert not list(study.rglob(".outdated*"))


def test_contents_of_copied_results_are_read_once(study):
    for job in plan().jobs.values():
        for path in job.outputs:
            content = (study / path).read_text()
            (study / path).unlink()
            (study / path).write_text(content)
    keep_contents(made_plan(plan(), ["all"], []))
    again = made_plan(plan(), ["all"], [])
    assert again.reasons == {}
    # a file is not opened if its size and times are those that are kept
    kept = json.loads((study / COPIES).read_text())
    kept["results/mesh"][0] = "of another file"
    (study / COPIES).write_text(json.dumps(kept))
    assert set(reasons(plan())) == {"mesh", "run"}


def test_a_view_has_all_but_snakemakes_records_and_can_be_written(study):
    (study / ".snakemake").mkdir()
    (study / "results").chmod(0o500)
    with view_of(study) as view:
        assert (view / "scan").read_text() == "a brain"
        assert (view / "results" / "mesh").read_text() == "mesh"
        assert not (view / ".snakemake").exists()
        link_results(study, view, ["results/mesh"])
        assert not (view / "results" / "mesh").exists()
        assert (view / "results" / "run").read_text() == "run"
        assert (view / "results" / "manifest").is_dir()
    (study / "results").chmod(0o700)
    assert (study / "results" / "mesh").is_file()


@pytest.mark.parametrize(
    ("options", "ends", "code", "n_runs"),
    [
        ([], [(0, {"a", "b", "c"})], 0, 1),
        ([], [(0, {"a"}), (0, {"b", "c"})], 0, 2),
        ([], [(0, {"a"}), (0, {"b"}), (0, {"c"})], 0, 3),
        # such as behind a rule that the call ends with
        ([], [(0, {"a"}), (0, set())], 0, 2),
        ([], [(4, {"a"})], 4, 1),
        ([], [(0, {"a"}), (4, {"b"})], 4, 2),
        (["--forceall"], [(0, {"a"}), (0, {"b", "c"})], 0, 2),
    ],
)
def test_a_run_that_leaves_planned_jobs_is_planned_again(
    monkeypatch, tmp_path, options, ends, code, n_runs
):
    """Snakemake may leave out jobs behind a checkpoint."""
    from snakemake.cli import get_argument_parser

    parsed, _ = get_argument_parser().parse_known_args(options)
    waiting = {"a", "b", "c"}
    calls = []

    def run(call, plan):
        code, ended = ends[len(calls)]
        calls.append(set(plan.reasons))
        waiting.difference_update(ended)
        return code, ended

    def plan_rest(*_):
        return Plan(reasons=dict.fromkeys(waiting, "missing"))

    monkeypatch.setattr(launch, "_call_snakemake", lambda *_: 0)
    monkeypatch.setattr(launch, "made_plan", plan_rest)
    monkeypatch.setattr(launch, "_run_jobs", run)
    call = launch.Call([], parsed, tmp_path, tmp_path)
    assert launch._plan_and_run(call) == code
    assert len(calls) == n_runs
    assert calls[0] == {"a", "b", "c"}
    assert not launch.session.is_planned


@pytest.mark.parametrize("note", ["", " (update)"])
def test_jobs_that_have_ended_are_known(note):
    events = Events()
    started = {"event": "job_info", "jobid": 7, "output": [f"results/a{note}"]}
    for facts in (started, {"event": "job_finished", "job_id": 7}):
        assert not events.ended
        events.take(logging.makeLogRecord(facts))
    assert events.ended == {"results/a"}


def test_output_goes_to_a_file_meanwhile_and_then_to_where_it_went(tmp_path, capfd):
    log = tmp_path / "log" / "details"
    for text in ("first", "second"):
        with launch._output_to(log):
            os.system(f"echo {text} child")
            print(f"{text} python")
        os.system("echo after")
    assert log.read_text() == "first child\nsecond child\n"
    expected = "first python\nafter\nsecond python\nafter\n"
    assert capfd.readouterr().out == expected
