"""Which jobs the workflow plans, for whole studies and after one parameter changed."""

import copy

import pytest
import yaml

from .conftest import CHECKOUT, SMALL_STUDY


def test_the_demo_is_planned_from_any_folder(workflow):
    jobs = workflow.jobs()
    assert jobs["pial_from_labels"] == jobs["cortical_thickness"] == 3
    assert jobs["measure"] > 3
    assert "atlas_file" not in jobs
    assert jobs["simulate"] >= 1
    assert jobs["html_report"] == 1


@pytest.mark.parametrize(
    ("target", "present", "absent"),
    [
        ("surface", "pial_from_labels", "tetrahedralise"),
        ("mesh", "tetrahedralise", "simulate"),
        ("growth", "growth_figure", "tetrahedralise"),
        ("folding", "folded_surface", "measure"),
        ("metrics", "study_table", "metrics_figure"),
        ("figures", "weekly_figure", "html_report"),
        ("paper", "displacement_maps", "steps_figure"),
    ],
)
def test_a_stage_is_a_target_and_plans_no_later_stage(workflow, target, present, absent):
    jobs = workflow.jobs(target)
    assert present in jobs
    assert absent not in jobs


@pytest.mark.parametrize(
    ("example", "expected"),
    [
        # a brain a week, of which eight are of an output week after the start
        ("spina-bifida-atlas", {"pial_from_labels": 5, "simulate": 2, "measure": 15, "register": 4}),
        ("simple-shapes", {"shape": 1, "pial_from_shape": 1, "simulate": 2}),
    ],
)
def test_examples_are_planned_from_the_checkout_alone(workflow, example, expected):
    jobs = workflow.jobs("--configfile", str(workflow.checkout / "config" / "examples" / f"{example}.yaml"))
    assert {rule: jobs.get(rule) for rule in expected} == expected
    assert "atlas_file" not in jobs


def test_the_paper_is_planned_with_each_equal_run_once(workflow):
    example = str(workflow.checkout / "config" / "examples" / "paper.yaml")
    jobs = workflow.jobs("paper", "--configfile", example)
    # twelve members, of which one is the reference and one stands in both studies
    assert (jobs["simulate"], jobs["simulate_member"], jobs["compare_member"]) == (2, 10, 12)
    assert (jobs["study_tables"], jobs["tetrahedralise"]) == (2, 1)
    # the real brains of 28 and 29 GW; runs once they are solved
    assert jobs["measure"] == 2
    assert jobs["replication"] == 1


def test_a_calibration_is_planned_round_by_round(workflow):
    example = str(workflow.checkout / "config" / "examples" / "calibration.yaml")
    jobs = workflow.jobs("calibrate", "--configfile", example)
    assert (jobs["calibration_design"], jobs["simulate_member"], jobs["calibration_score"]) == (4, 24, 24)


@pytest.mark.parametrize(
    ("example", "expected"),
    [
        ("crl-atlas", {"atlas_file": 9, "pial_from_labels": 9}),
        ("dhcp-atlas", {"atlas_file": 48, "pial_from_labels": 16, "pial_from_hemispheres": 16}),
    ],
)
def test_examples_of_narrow_licences_are_planned_once_these_are_accepted(workflow, example, expected):
    text = (CHECKOUT / "config" / "examples" / f"{example}.yaml").read_text()
    (workflow.directory / "study.yaml").write_text(text.replace("accept_licence: false", "accept_licence: true"))
    jobs = workflow.jobs("--configfile", "study.yaml")
    assert {rule: jobs.get(rule) for rule in expected} == expected


def test_the_example_of_labels_and_surfaces_is_planned_once_these_are_made(workflow):
    example = CHECKOUT / "config" / "examples" / "labels-and-hemispheres.yaml"
    for brain in yaml.safe_load(example.read_text())["brains"]:
        (workflow.directory / brain["pial"]).parent.mkdir(parents=True, exist_ok=True)
        (workflow.directory / brain["pial"]).touch()
    jobs = workflow.jobs("growth", "--configfile", str(example))
    assert jobs["growth_figure"] == 1
    # nothing is fetched
    assert "atlas_file" not in jobs


def test_the_solver_is_told_of_the_maps_of_a_run(workflow):
    for name in ("left.gii", "right.gii"):
        (workflow.directory / name).touch()
    pair = ["left.gii", "right.gii"]
    runs = {"plain": {}, "thick": {"thickness_mm": {"map": pair, "surface": pair}}}
    with_maps = workflow.write("maps.yaml", SMALL_STUDY | {"runs": runs})
    shown = workflow.run("-n", "folding", "--printshellcmds", "--configfile", with_maps).stdout
    commands = [line for line in shown.splitlines() if "gyriflow.folding" in line]
    assert sorted("--maps results/runs/thick/a/folding/maps.h5 --out" in command for command in commands) == [
        False,
        True,
    ]


def changed(section, **values):
    study = copy.deepcopy(SMALL_STUDY)
    study[section] = study.get(section, {}) | values
    return study


@pytest.mark.promise(6)
@pytest.mark.slow
def test_nothing_is_to_be_done_after_all_was_made(finished):
    assert finished.jobs("--configfile", "study.yaml") == {}


REPORT = {"html_report": 1, "provenance": 1, "all": 1}
RESOURCES = REPORT | {"study_resources": 1}
NEW_RESULTS = RESOURCES | {"study_warnings": 1}
# what holds the configuration itself
CONFIGURATION = {"report_config": 1}
SHAPE = NEW_RESULTS | {
    "metrics_figure": 1, "spectra_figure": 1, "spectral_distance": 1, "asymmetry": 1, "centiles": 1,
    "group_tables": 1, "report_provenance": 1, "view_surfaces": 1, "metrics_table": 1, "methods": 1,
    "folding_agreement": 1, "validation_figure": 1,
}  # fmt: skip
ONE_RUN = SHAPE | {
    "regions": 1, "simulate": 1, "parameters": 1, "folded_surface": 2, "measure": 2, "displacement": 1,
    "similarity": 1, "study_table": 7, "study_runs": 1, "weekly_figure": 1, "displacement_maps": 1, "shape_maps": 1,
    "displacement_figure": 1, "outlines_figure": 1, "displacement_agreement": 1, "onset": 1, "onset_figure": 1,
    "validation": 1,
}  # fmt: skip
OF_THE_STUDY = {
    *SHAPE, "study_table", "study_runs", "displacement_figure", "weekly_figure", "displacement_maps", "shape_maps",
    "outlines_figure", "onset_figure",
}  # fmt: skip
BOTH_RUNS = {rule: count if rule in OF_THE_STUDY else 2 * count for rule, count in ONE_RUN.items()}
CARRIED = {"carried_mesh": 1, "registration_ceiling": 1, "study_table": 8}
MESH = CARRIED | {"tetrahedralise": 1, "mesh_quality": 1}
FIGURES = {
    "metrics_figure": 1, "spectra_figure": 1, "displacement_figure": 1, "growth_figure": 1, "weekly_figure": 1,
    "displacement_maps": 1, "shape_maps": 1, "quality_page": 2, "quality_table": 1,
    "outlines_figure": 1, "onset_figure": 1, "validation_figure": 1, "methods": 1, "report_provenance": 1,
}  # fmt: skip


@pytest.mark.fault(39)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("section", "values", "expected"),
    [
        (
            "metrics",
            {"curvature_radius_mm": 4.0},
            SHAPE
            | {"measure": 6, "study_table": 5, "shape_maps": 1, "onset": 2, "onset_figure": 1, "validation": 2}
            | {"ready_surfaces": 1, "registration_ceiling": 1},
        ),
        ("runs", {"thick": {"thickness_mm": 3.5}}, ONE_RUN),
        ("folding", {"growth_rate_per_s": 1e-7}, BOTH_RUNS | {"growth_figure": 1}),
        ("mesh", {"core_edge_mm": 3.0}, {rule: n for rule, n in (BOTH_RUNS | MESH).items() if rule != "parameters"}),
        (
            "surface",
            {"edge_length_mm": 1.5},
            BOTH_RUNS
            | MESH
            | {
                "pial_from_labels": 2,
                "cortical_thickness": 2,
                "measure": 6,
                "growth_curves": 1,
                "growth_rates": 1,
                "growth_figure": 1,
                "named_sulci": 1,
                "ready_surfaces": 1,
                "quality_page": 2,
                "quality_table": 1,
            },
        ),
        ("report", {"dpi": 100}, NEW_RESULTS | FIGURES),
        ("report", {"core_power_w": 15.0}, RESOURCES),
        # a setting for another kind of input, and the number of ranks, which changes no result: the report alone,
        # as it shows the configuration
        ("surface", {"max_hole_mm": 1.0}, REPORT),
        ("folding", {"ranks": 1}, REPORT),
    ],
)
def test_exactly_what_depends_on_a_changed_parameter_runs_again(finished, section, values, expected):
    name = finished.write(f"{section}-{next(iter(values))}.yaml", changed(section, **values))
    assert finished.jobs("--configfile", name) == expected | CONFIGURATION
