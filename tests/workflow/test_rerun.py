"""Which rules run again after a change of code, environment, brains, runs or files; of settings: test_dag.py."""

import copy
import os
import re
import shutil
from contextlib import contextmanager

import pytest

from .conftest import SMALL_STUDY, labelled
from .test_dag import BOTH_RUNS, CARRIED, CONFIGURATION, NEW_RESULTS, ONE_RUN, RESOURCES, SHAPE

pytestmark = pytest.mark.slow

OTHER = b"\n# changed\n"


@contextmanager
def changed_files(root, *names, content=OTHER):
    """Has something else at the end of files of a checkout or study for as long as the block lasts."""
    kept = {root / name: ((root / name).read_bytes(), (root / name).stat()) for name in names}
    try:
        for path, (before, _) in kept.items():
            path.write_bytes(before + content)
        yield
    finally:
        for path, (before, state) in kept.items():
            path.write_bytes(before)
            # Snakemake looks at the times of scripts
            os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


# what is made of the surface of a measured brain that starts no run: its own, and what compares others with it
OF_THE_OTHER_BRAIN = SHAPE | CARRIED | {
    "cortical_thickness": 1, "growth_curves": 1, "growth_rates": 1, "growth_figure": 1, "measure": 1, "study_table": 9,
    "similarity": 2, "displacement_agreement": 2, "onset": 2, "onset_figure": 1, "validation": 2, "register": 1,
    "weekly_figure": 1, "shape_maps": 1, "pial_from_labels": 1, "label_volumes": 1, "named_sulci": 1,
    "quality_page": 1, "quality_table": 1, "outlines_figure": 1, "ready_surfaces": 1,
}  # fmt: skip
# a table of the study is shown by the report
NEW_TABLE = NEW_RESULTS | {"study_table": 1, "report_provenance": 1, "methods": 1}
OF_THE_SOLVER = {
    rule: count for rule, count in BOTH_RUNS.items() if rule not in ("parameters", "regions", "zones_figure")
}


@pytest.mark.fault(39)
@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["src/gyriflow/metrics/similarity.py"], NEW_TABLE | {"similarity": 2}),
        (["src/gyriflow/report/growth.py"], NEW_RESULTS | {"growth_figure": 1}),
        (["src/gyriflow/folding/contact.py"], OF_THE_SOLVER),
        (["workflow/scripts/quality_table.py"], RESOURCES | {"quality_table": 1, "study_warnings": 1}),
        # what the terminal says, the command line, comments in rules and the environment make no result
        (
            ["src/gyriflow/cli/status.py", "src/gyriflow/cli/commands.py", "src/gyriflow/cli/launch.py"]
            + ["workflow/rules/metrics.smk", "profiles/default/config.yaml", "envs/gyriflow.yaml"],
            {},
        ),
    ],
    ids=["metric", "figure", "solver", "script", "around"],
)
def test_a_change_of_code_runs_again_what_uses_it(finished, names, expected):
    with changed_files(finished.checkout, *names):
        assert finished.jobs("--configfile", "study.yaml") == expected


def with_brain(study):
    study["brains"].append({"id": "c", "week": 23, **labelled(23)})


def with_run(study):
    study["runs"]["third"] = {"thickness_mm": 2.0}


def with_other_labels(study):
    study["brains"][1] |= labelled(23)


def with_later_end(study):
    study["folding"]["end_week"] = 22.5


@pytest.mark.fault(39)
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            with_brain,
            SHAPE
            | {"pial_from_labels": 1, "cortical_thickness": 1, "measure": 1, "study_table": 5}
            | {
                "validation": 2,
                "growth_curves": 1,
                "growth_rates": 1,
                "growth_figure": 1,
                "label_volumes": 1,
                "quality_page": 1,
                "quality_table": 1,
            },
        ),
        (with_run, ONE_RUN),
        (with_other_labels, OF_THE_OTHER_BRAIN),
        (with_later_end, BOTH_RUNS | {"folded_surface": 6, "measure": 6}),
    ],
    ids=["brain", "run", "input", "end"],
)
def test_a_change_of_brains_and_runs_makes_what_is_new_and_what_compares(finished, change, expected):
    study = copy.deepcopy(SMALL_STUDY)
    change(study)
    name = finished.write(f"{change.__name__}.yaml", study)
    assert finished.jobs("--configfile", name) == expected | CONFIGURATION


@pytest.mark.fault(39)
def test_a_replaced_input_runs_again_what_was_made_of_it_and_the_dry_run_says_why(finished):
    labels = "phantom-22.nii.gz"
    with changed_files(finished.directory, labels):
        assert finished.jobs("--configfile", "study.yaml") == OF_THE_OTHER_BRAIN
        said = finished.run("-n", "--configfile", "study.yaml").stdout
    (reason,) = re.findall(r"rule pial_from_labels:\n(?: +.*\n)*? +reason: (.*)\n", said)
    assert reason == f"Updated input files: {labels}"


def test_a_lost_table_is_made_again(finished):
    lost = finished.directory / "results" / "study" / "similarity.csv"
    kept = lost.rename(lost.with_suffix(".kept"))
    try:
        jobs = finished.jobs("--configfile", "study.yaml")
    finally:
        kept.rename(lost)
    assert jobs == NEW_TABLE


@pytest.fixture
def surfaced(workflow):
    """A study with a file of labels whose surface counts as made, and the arguments that ask for it."""
    (workflow.directory / "l.nii.gz").write_text("one brain")
    brain = {"id": "a", "week": 21, "labels": "l.nii.gz", "scheme": "binary"}
    study = {"brains": [brain], "start": "a", "folding": {"end_week": 22}}
    arguments = ("surface", "--configfile", workflow.write("study.yaml", study))
    workflow.lay_out(*arguments)
    workflow.count_as_made(*arguments, "--forceall")
    assert workflow.jobs(*arguments) == {}
    return workflow, arguments


def test_an_input_replaced_by_an_older_one_runs_again_what_was_made_of_it(surfaced):
    workflow, arguments = surfaced
    labels, other = workflow.directory / "l.nii.gz", workflow.directory / "other.nii.gz"
    other.write_text("another 1")
    an_hour_ago = labels.stat().st_mtime_ns - 3600 * 10**9
    os.utime(other, ns=(an_hour_ago, an_hour_ago))
    # as `mv` and `rsync -a` do
    other.rename(labels)
    assert workflow.jobs(*arguments) == {"pial_from_labels": 1, "surface": 1}
    assert "input with the content" in workflow.run("-n", *arguments).stdout


def test_a_copy_of_an_input_with_its_date_is_the_same_input(surfaced):
    workflow, arguments = surfaced
    copy = shutil.copy2(workflow.directory / "l.nii.gz", workflow.directory / "copy.nii.gz")
    copy.rename(workflow.directory / "l.nii.gz")
    assert workflow.jobs(*arguments) == {}
