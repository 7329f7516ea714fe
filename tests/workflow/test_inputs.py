"""Which files the rules read, as a dry run lists them, where the study decides which
brain a file is of."""

from pathlib import Path

import pytest
from configurations import LABELLED, labelled
from shapes import hemisphere

from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.surfaces import write_surface

from .conftest import Workflow

LABELS = LABELLED["labels"]


def population(name, *weeks):
    """Return brains of a population, of some weeks."""
    brains = zip(labelled(*weeks), weeks, strict=True)
    return [
        brain | {"id": f"{name}{week:g}", "population": name} for brain, week in brains
    ]


def surface(brain):
    return f"results/brains/{brain}/surface/pial.surf.gii"


def weekly(folder, *weeks, file="pial.surf.gii"):
    return [f"{folder}/surfaces/week-{week}.00/{file}" for week in weeks]


@pytest.fixture(scope="module")
def planned(checkout_copy, tmp_path_factory):
    """Return a function: the inputs of the jobs that a dry run of a configuration
    plans, by output."""

    def inputs(config, *targets):
        folder = tmp_path_factory.mktemp("planned")
        (folder / "regions.nii.gz").touch()
        workflow = Workflow(checkout_copy, folder)
        name = workflow.write("study.yaml", config)
        files = {}
        for job in workflow.plan(*targets, "--configfile", name).jobs:
            files |= dict.fromkeys(job.outputs, job.files)
        return files

    return inputs


@pytest.fixture(scope="module")
def jobs(planned):
    """Brains of four weeks, the first folded, beside a sweep; the third has regions, to
    the second maps are brought."""
    sweep = {
        "base": "reference",
        "vary": {"thickness_mm": [1.0, 2.0]},
        "compare_week": 23,
    }
    soft = {"map": LABELS, "weeks": {21: 1.0, 24: 0.5}}
    study = {
        "brains": population("b", 21, 22, 23, 24),
        "start": "b21",
        "folding": {"end_week": 24},
        "sweeps": {"thick": sweep},
        "metrics": {
            "regions": {"b23": {"labels": "regions.nii.gz", "names": {1: "frontal"}}},
            "template": "b22",
        },
        "runs": {
            "reference": {"thickness_mm": 1.0},
            "soft": {"shear_modulus_core_pa": soft},
        },
    }
    return planned(study, "all", "export", "sweeps")


RUN, SOFT = "results/runs/reference/b21", "results/runs/soft/b21"
OUTPUTS = (
    # a run is validated by the observed brains of its weeks
    f"{RUN}/metrics/validation.csv",
    # whose adjacent one is the latest before
    "results/study/validation/b21/week-24.00/observed.surf.gii",
    # regions are carried from the brain that has them
    "results/brains/b22/metrics/left.regions.label.gii",
    # maps of simulated brains are brought to the template from their start, whose
    # vertices they keep
    f"{RUN}/metrics/week-24.00/left.template.shape.gii",
    "results/brains/b22/metrics/left.template.shape.gii",
    # maps of parameters are made of the files of the user
    f"{SOFT}/params.yaml",
    f"{RUN}/params.yaml",
    f"{SOFT}/folding/steps.csv",
    f"{RUN}/folding/steps.csv",
    # members of a sweep are gathered with the run that equals one, which is compared
    # at the week of the sweep
    "results/study/thick/members.csv",
    "results/study/thick/members/reference/b21/comparison.csv",
)


def test_recorded_inputs(jobs, recorded):
    """A rule reads the files of the right brains."""
    inputs = {}
    for output in OUTPUTS:
        for number, file in enumerate(sorted(jobs[output])):
            is_result = file.startswith("results/")
            inputs[f"{output} {number}"] = file if is_result else Path(file).name
    recorded(inputs)


def test_what_deviates_is_compared_with_what_was_expected_at_its_week(planned):
    """The thickness of the expected brain is that of the start, grown as the run has it
    grow."""
    brains = [*population("own", 22, 23, 24), *population("atlas", 21, 22, 23, 24, 25)]
    study = {
        "brains": brains,
        "start": "own22",
        "folding": {"end_week": 24},
        "runs": {"a": {"preset": "expected"}},
    }
    run = "results/runs/a/own22"
    table = f"{run}/metrics/week-24.00/deviation.csv"
    jobs = planned(study, "results/study/deviation.csv")
    joined = [f for f in jobs["results/study/deviation.csv"] if "deviation" in f]
    assert joined == [table.replace("24", "23"), table]
    maps = "results/brains/{}/surface/measured_thickness.shape.gii".format
    assert jobs[table][:8] == [
        *(surface("own22"), *weekly(run, 22, 24), surface("own24")),
        maps("own22"),
        *weekly(run, 22, 24, file="thickness.shape.gii"),
        maps("own24"),
    ]


def test_growth_towards_shapes_is_measured_on_fine_surfaces(workflow):
    """Growth at a rate needs none."""
    study = {
        "brains": [*population("a", 21, 22, 23), *population("b", 21.5, 23)],
        "growth": {"brains": {"atlas": ["a21", "a22", "a23"]}},
        "start": "b21.5",
        "folding": {"end_week": 23},
        "runs": {"expected": {"preset": "expected"}, "own": {}},
    }
    name = workflow.write("study.yaml", study)
    expected, own = (f"results/runs/{run}/b21.5" for run in ("expected", "own"))
    metrics = "metrics/week-23.00/metrics.csv"

    def fine_surfaces(*targets):
        plan = workflow.plan(*targets, "--configfile", name)
        jobs = [job for job in plan.jobs if job.rule == "fine_surface"]
        return {(job.wildcards["run"], job.wildcards["week"]) for job in jobs}

    half_week = f"{expected}/surfaces/week-22.50/pial.surf.gii"
    found = fine_surfaces(f"{expected}/{metrics}", half_week, f"{own}/{metrics}")
    assert found == {("expected", "22.50"), ("expected", "23.00")}
    found = fine_surfaces("results/study/prediction.csv")
    assert found == {("expected", "21.50"), ("expected", "23.00")}


def test_matched_vertices_take_the_place_of_registration(workflow):
    brains = []
    for week in (21, 22, 23):
        mesh = hemisphere(-1)
        file = f"left-{week}.surf.gii"
        grown = TriangleMesh(mesh.vertices * 1.04 ** (week - 21), mesh.faces)
        write_surface(workflow.directory / file, grown)
        brains.append({"id": f"b{week}", "week": week, "pial": file, "side": "left"})
    folding = {"end_week": 23, "preset": "measured"}
    study = {"brains": brains, "start": "b21", "folding": folding}
    name = workflow.write("study.yaml", study)
    jobs = workflow.jobs("all", "validate", "--configfile", name)
    counts = [jobs[rule] for rule in ("match_surfaces", "targets", "register")]
    assert counts == [2, 1, 0]
