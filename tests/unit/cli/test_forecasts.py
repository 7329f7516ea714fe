"""What a study takes, as `gyriflow check` says: time, work, memory and disk."""

import nibabel as nib
import numpy as np
import pytest
from configurations import LABELLED
from facts import Facts

from gyriflow.cli import check as checking
from gyriflow.cli.check import work_of
from gyriflow.running.cost import (
    MIN_SURFACE_MIB,
    Needs,
    job_limits,
    job_seconds,
    simulation_needs,
    surface_memory_mib,
    targets_memory_mib,
)
from gyriflow.running.manifest import Job
from gyriflow.running.planning import BY_ANOTHER_JOB
from gyriflow.study import resolve
from gyriflow.study.loading import load

MESH = {"mesher": "tetgen", "order": 1, "surface_edge_mm": 0.67, "core_edge_mm": 4.0}
WEEKS = (22, 24, 25, 27, 30, 34)
ATLAS = [
    {"id": f"x{week}", "week": week, "population": "x", **LABELLED} for week in WEEKS
]
STUDY = {
    "brains": [{"id": "a", "week": 23, "population": "a", **LABELLED}, *ATLAS],
    "start": "a",
    "mesh": MESH,
    "folding": {"preset": "expected", "end_week": 25, "ranks": 2},
    "growth": {"brains": {"x": [brain["id"] for brain in ATLAS]}},
    "runs": {
        "expected": {},
        # so large that it sets the limits of its job
        "rates": {"growth": "rates", "step_s": 600, "end_week": 40, "ranks": 4},
        "measured": {"preset": "measured", "start": "x22", "end_week": 30},
    },
}


JOBS = [
    ("pial_with_thickness", {"brain": "a"}),
    ("pial_with_thickness", {"brain": "x34"}),
    ("measure", {"brain": "a"}),
    ("measure", {"brain": "x34"}),
    ("measure_simulated", {"run": "rates", "brain": "x34", "week": "34.00"}),
    ("register", {"earlier": "x22", "later": "x34"}),
    ("export", {}),
    ("unknown", {"brain": "none"}),
    ("tetrahedralise", {"brain": "a"}),
    ("path_mesh", {"brain": "x22"}),
    ("atlas_path", {"brain": "x22"}),
    ("targets", {"brain": "x22", "origin": "self"}),
    ("predicted_targets", {"brain": "a", "origin": "atlas"}),
    ("simulate", {"run": "expected", "brain": "a"}),
    ("simulate", {"run": "rates", "brain": "a"}),
    ("simulate", {"run": "measured", "brain": "x22"}),
]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("open_sulci", [True, False])
def test_recorded_costs(recorded, order, open_sulci):
    surface = {"edge_length_mm": 0.9, "open_sulci": open_sulci}
    mesh = MESH | {"order": order}
    study = resolve(load(STUDY | {"surface": surface, "mesh": mesh}))
    costs = {}
    for rule, wildcards in JOBS:
        name = " ".join([rule, *wildcards.values()])
        costs[name] = job_seconds(study, rule, wildcards)
    for simulation in study.run_simulations:
        name = f"{simulation.run} {simulation.brain}"
        costs[f"needs of {name}"] = [*simulation_needs(simulation, study.config.mesh)]
        costs[f"limits of {name}"] = [*job_limits(simulation, study.config.mesh)]
    costs["targets MiB"] = targets_memory_mib(study.brains["a"], study.config.mesh)
    recorded(costs)


def test_the_memory_of_a_surface_follows_the_header(tmp_path):
    def needed(edge_mm, size):
        image = nib.Nifti1Image(np.zeros((1, 1, 1), np.uint8), np.eye(4))
        image.header.set_xyzt_units("mm")
        image.header.set_data_shape((size,) * 3)
        image.header.set_zooms((edge_mm,) * 3)
        # voxels that take no room on the disk
        with (tmp_path / "l.nii").open("wb") as file:
            image.header.write_to(file)
            file.truncate(352 + size**3)
        return surface_memory_mib(str(tmp_path / "l.nii"), 25.0)

    assert surface_memory_mib(str(tmp_path / "none.nii"), 25.0) == MIN_SURFACE_MIB
    assert needed(0.8, 100) == MIN_SURFACE_MIB
    assert needed(0.25, 320) > 1.2 * MIN_SURFACE_MIB
    assert needed(0.8, 512) < needed(0.25, 320)


def planned(rule, inputs=(), outputs=(), threads=1, **wildcards):
    """Return a job of a plan, with files of one role."""
    files = {"": list(inputs)}
    return Job(rule, files, [*outputs], None, dict, wildcards, lambda: threads)


HOURS = {"atlas_path": 4, "kept_path": 0, "predicted_targets": 1, "simulate": 6}
"""Forecasts of jobs, in place of those by the sizes of brains."""
REASON = "Missing output files: x"
PATH, SHAPES = "results/x22/shapes.h5", "results/a/targets.atlas.h5"
MAKE_PATH = planned("atlas_path", ["x"], [PATH], brain="x22")
KEPT_PATH = planned("kept_path", [], [PATH], brain="x22")
TARGETS = planned("predicted_targets", ["x", PATH], [SHAPES])
EXPECTED = planned("simulate", [SHAPES], threads=2, run="expected", brain="a")
RATES = planned("simulate", [SHAPES], threads=2, run="rates", brain="a")


@pytest.fixture
def forecast(monkeypatch, tmp_path):
    """Return the lines on some jobs on a number of cores, whose times are `HOURS` and
    whose foldings need 20 and 30 GB."""
    memory_mib = {"expected": 20e9 / 2**20, "rates": 30e9 / 2**20}
    monkeypatch.setattr(
        checking, "job_seconds", lambda _, rule, __: 3600 * HOURS.get(rule, 0)
    )
    monkeypatch.setattr(
        checking,
        "simulation_needs",
        lambda folding, _: Needs(5 * 3600, memory_mib[folding.run], 0),
    )

    def lines(jobs, cores=1, reason=REASON):
        reasoned = [(job, reason) for job in jobs]
        monkeypatch.setattr(checking, "_plan", lambda *_, **__: reasoned)
        study = resolve(load(STUDY))
        found = work_of(tmp_path / "x.yaml", tmp_path / "study", cores, [], study)
        return [line for line, _ in found]

    return lines


@pytest.mark.parametrize(
    ("jobs", "cores", "hours"),
    [
        ([EXPECTED, RATES], 1, 12),
        # each on two of the cores
        ([EXPECTED, RATES], 4, 3),
        ([EXPECTED], 1, 6),
        # one after the other, whatever the cores
        ([MAKE_PATH, TARGETS, EXPECTED], 4, 4 + 1 + 3),
        ([KEPT_PATH, TARGETS, EXPECTED], 4, 1 + 3),
    ],
)
def test_a_study_takes_its_work_on_all_cores_or_its_longest_chain(
    forecast, jobs, cores, hours
):
    (line,) = [line for line in forecast(jobs, cores) if line.startswith("time")]
    assert line == Facts(f"about {hours}.0 h", cores)


def test_the_work_and_the_largest_memory_of_a_study_are_those_of_its_foldings(forecast):
    jobs = [EXPECTED, RATES, *[planned("measure")] * 7]
    found = forecast(jobs, 1)
    assert found[:2] == [
        "to run: 9 steps",
        "  Missing output files: simulate×2, measure×7",
    ]
    assert found[3] == Facts("12 core hours", f"{10 / 12:.0%}")
    # of the foldings that run at the same time
    assert found[4] == Facts("memory", "30.0 GB")
    assert forecast(jobs, 4)[4] == Facts("memory", "50.0 GB")


def test_a_path_of_an_atlas_is_kept_or_made_for_some_time(forecast):
    found = forecast([MAKE_PATH, TARGETS])
    assert Facts("path of x22", "has to be made", "4.0 h") in found
    found = forecast([KEPT_PATH, TARGETS])
    assert Facts("path of x22", "kept") in found


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        ("Missing output files: a.csv, b.csv", "Missing output files"),
        (f"{BY_ANOTHER_JOB}: pial", BY_ANOTHER_JOB),
        ("changed input a b.nii.gz, c.nii", "changed input a b.nii.gz, c.nii"),
    ],
)
def test_why_a_step_runs_is_said_without_the_files_of_a_general_reason(
    forecast, reason, words
):
    assert forecast([planned("rule")], reason=reason)[1] == f"  {words}: rule"
