"""Which files the rules read, as a dry run lists them, where the study decides which
brain a file is of."""

import pytest
from configurations import LABELLED, labelled

from .conftest import Workflow

RUN = "results/runs/reference/b21/metrics"


def population(name, *weeks):
    """Return brains of a population, of some weeks."""
    brains = zip(labelled(*weeks), weeks, strict=True)
    return [
        brain | {"id": f"{name}{week:g}", "population": name} for brain, week in brains
    ]


def surface(brain, part=""):
    return f"results/brains/{brain}/surface/{part}pial.surf.gii"


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
    brains = population("b", 21, 22, 23, 24)
    regions = {"b23": {"labels": "regions.nii.gz", "names": {1: "frontal"}}}
    sweep = {
        "base": "reference",
        "vary": {"thickness_mm": [1.0, 2.0]},
        "compare_week": 23,
    }
    soft = {"map": brains[0]["labels"], "weeks": {21: 1.0, 24: 0.5}}
    runs = {"reference": {"thickness_mm": 1.0}, "soft": {"shear_modulus_core_pa": soft}}
    study = {
        "brains": brains,
        "start": "b21",
        "folding": {"end_week": 24},
        "sweeps": {"thick": sweep},
    }
    study |= {"metrics": {"regions": regions, "template": "b22"}, "runs": runs}
    return planned(study, "all", "export", "sweeps")


def test_a_run_is_validated_by_the_real_brains_of_its_weeks(jobs):
    files = jobs[f"{RUN}/validation.csv"]
    weeks = (22, 23, 24)
    assert [surface(f"b{week}") for week in weeks] == [
        file for file in files if "/brains/" in file
    ]
    simulated = [
        f"results/runs/reference/b21/surfaces/week-{week}.00/pial.surf.gii"
        for week in weeks
    ]
    assert simulated == [file for file in files if "/surfaces/" in file]
    ready = "results/study/validation/b21/week-{}.00/{}.{}.gii".format
    kinds = [
        (name, kind)
        for name in ("observed", "start", "adjacent")
        for kind in ("surf", "shape")
    ]
    assert {ready(week, *kind) for week in weeks for kind in kinds} <= set(files)
    # the adjacent brain is the latest real one before
    assert jobs[ready(24, "observed", "surf")] == [
        surface("b24"),
        surface("b23"),
        surface("b21"),
    ]


def test_regions_are_carried_from_the_brain_that_has_them(jobs):
    files = jobs["results/brains/b22/metrics/left.regions.label.gii"]
    assert "results/brains/b23/metrics/left.regions.label.gii" in files
    assert surface("b23", "left.") in files
    assert "results/study/registration/b23/b22.h5" in files


def test_maps_of_simulated_brains_are_brought_to_the_template_from_their_start(jobs):
    files = jobs[f"{RUN}/week-24.00/left.template.shape.gii"]
    # they keep the vertices of the start
    assert "results/runs/reference/b21/surfaces/week-21.00/left.pial.surf.gii" in files
    assert surface("b22", "left.") in files
    assert "results/study/registration/b22/b21.h5" in files
    own = jobs["results/brains/b22/metrics/left.template.shape.gii"]
    assert [file for file in own if file.endswith(".h5")] == []


def test_maps_of_parameters_are_made_of_the_files_of_the_user(jobs):
    volume, *made = jobs["results/runs/soft/b21/params.yaml"]
    assert volume == LABELLED["labels"]
    assert all(path.startswith("results/brains/b21/") for path in made)
    assert LABELLED["labels"] not in jobs["results/runs/reference/b21/params.yaml"]
    assert (
        "results/runs/soft/b21/folding/maps.h5"
        in jobs["results/runs/soft/b21/folding/steps.csv"]
    )
    assert (
        "results/runs/reference/b21/folding/maps.h5"
        not in jobs["results/runs/reference/b21/folding/steps.csv"]
    )


def test_members_of_a_study_are_gathered_with_the_run_that_equals_one(jobs):
    files = jobs["results/study/thick/members.csv"]
    summaries = [
        f"results/runs/{run}/b21/folding/summary.json"
        for run in ("reference", "thick-2")
    ]
    assert [file for file in files if file.endswith("summary.json")] == summaries
    # what has been solved already is compared at the week of the study
    compared = jobs["results/study/thick/members/reference/b21/comparison.csv"]
    tables = [file for file in compared if file.endswith("metrics.csv")]
    assert tables == [
        f"{RUN}/week-23.00/metrics.csv",
        "results/brains/b23/metrics/metrics.csv",
    ]
    assert surface("b23") in compared
    assert "results/runs/reference/b21/surfaces/week-23.00/pial.surf.gii" in compared


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
    table = "results/runs/a/own22/metrics/week-24.00/deviation.csv"
    jobs = planned(study, "results/study/deviation.csv")
    joined = [
        file
        for file in jobs["results/study/deviation.csv"]
        if file.endswith("deviation.csv")
    ]
    assert joined == [table.replace("24", "23"), table]
    weekly = "results/runs/a/own22/surfaces/week-{}.00".format
    maps = "results/brains/{}/surface/measured_thickness.shape.gii".format
    whole = [
        surface("own22"),
        *(f"{weekly(week)}/pial.surf.gii" for week in (22, 24)),
        surface("own24"),
    ]
    thickness = [
        maps("own22"),
        *(f"{weekly(week)}/thickness.shape.gii" for week in (22, 24)),
        maps("own24"),
    ]
    assert jobs[table][:8] == [*whole, *thickness]
