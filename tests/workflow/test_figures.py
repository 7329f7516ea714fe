"""The rules of figures: which figures a study has, of what, and with which words."""

import inspect
import re
from importlib import import_module

import pytest
from facts import Facts
from planned_figures import planned_figures

from gyriflow.report.page import caption_html
from gyriflow.shipped import SHIPPED

pytestmark = pytest.mark.slow

CAPTIONS = SHIPPED / "workflow" / "report" / "captions"
ATLAS = SHIPPED / "atlases" / "spina-bifida"
LABELS = str(ATLAS / "fetal_SB_atlas_GA21_notoperated" / "parcellation.nii.gz")
SHAPE = {"semi_axes_mm": [20, 26, 18]}
SWEEP = {
    "base": "thin",
    "vary": {"growth_rate_per_s": [1e-7, 3e-7]},
    "compare_week": 22,
}
SHAPES = {
    "brains": [
        {"id": name, "week": week, "shape": SHAPE}
        for name, week in (("a", 21), ("b", 22), ("c", 23))
    ],
    "start": "a",
    "folding": {"end_week": 22},
    "runs": {"thin": {}, "thick": {}},
    "sweeps": {"rate": SWEEP},
    "calibrate": {
        "base": "thin",
        "parameters": {"growth_rate_per_s": [1e-7, 4e-7]},
        "score": {"size": 1.0},
        "compare_week": 22,
        "rounds": [3],
    },
}


def brains_of(population, *weeks):
    """Return brains of a population, all with the same labels."""
    known = {
        "labels": LABELS,
        "scheme": "spina-bifida-atlas",
        "population": population,
    }
    return [{"id": f"{population}{week}", "week": week} | known for week in weeks]


PREDICTIONS = {
    "brains": [*brains_of("own", 22, 23), *brains_of("atlas", 21, 22, 23, 24)],
    "start": "own22",
    "folding": {"end_week": 23, "preset": "expected"},
    "runs": {"expected": {"ensemble": 3}, "plain": {"preset": "fetalfoldsim"}},
    "metrics": {"regions": {"own22": {"labels": LABELS, "names": {5: "cortex"}}}},
}
PREDICTION = {
    "brains": [*brains_of("own", 22.4), *brains_of("atlas", 21, 22, 23, 24)],
    "start": "own22.4",
    "folding": {"end_week": 23.9, "preset": "expected"},
}
COHORT = {
    "brains": [
        {"id": f"s{n}", "week": 21 + 0.1 * n, "subject": f"s{n}", "labels": LABELS}
        | {"scheme": "spina-bifida-atlas"}
        for n in range(10)
    ]
}
STUDIES = {
    "shapes": SHAPES,
    "predictions": PREDICTIONS,
    "prediction": PREDICTION,
    "cohort": COHORT,
}
ENDED = "rate-3e-07"


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    """The figures of each of the studies, which together have all, and the names of
    the rules."""
    plans = {}
    for name, config in STUDIES.items():
        folder = tmp_path_factory.mktemp(name)
        plans[name] = planned_figures(folder, config, ended=[ENDED])
    return plans


@pytest.fixture(scope="module")
def figures(plans):
    return {name: figures for name, (figures, _) in plans.items()}


@pytest.fixture(scope="module")
def rules(plans):
    """The names in the rules. Snakemake has one set of them: that of the last study."""
    _, names = plans["cohort"]
    return names


def only(figures, name):
    """Return the only figure of a name."""
    (figure,) = [figure for figure in figures if figure.name == name]
    return figure


def sectioned(rules):
    """Return the names of the figures of pages, in their order."""
    pages = rules["SECTIONS"], rules["BRAIN_SECTIONS"]
    return [name for page in pages for section in page.values() for name in section]


def drawing_function(figure):
    """Return the function of the report with the name of a figure."""
    for module in figure.params["modules"]:
        functions = vars(import_module(f"gyriflow.report.{module}"))
        if figure.name in functions:
            return functions[figure.name]
    raise AssertionError(figure)


def places(figure):
    """Return rows and columns of a grid with their first surfaces."""
    return {
        (brain["row"], brain["column"]): brain["surfaces"][0]
        for brain in figure.params["grid"]
    }


def test_a_function_gets_its_arguments_and_all_that_a_rule_has_is_of_use(figures):
    used = {}
    for planned in figures.values():
        for figure in planned:
            if "modules" not in figure.params:
                continue
            arguments = inspect.signature(drawing_function(figure)).parameters
            found = figure.inputs | figure.params
            given = {name: found[name] for name in arguments if name in found}
            inspect.signature(drawing_function(figure)).bind(**given)
            # of a model, the elements are read with the parameters of the run
            spare = {"modules", "code", "command"}
            if "elements" in figure.inputs:
                spare.add("parameters")
            unused = set(found) - set(arguments) - spare
            used[figure.rule] = used.get(figure.rule, unused) & unused
    # two figures have one rule, by different tables
    assert used.pop("html_tables") == set()
    assert {rule: names for rule, names in used.items() if names} == {}


def test_each_file_is_drawn_once_and_each_input_of_a_grid_is_a_file_of_the_rule(
    figures,
):
    for planned in figures.values():
        files = [file for figure in planned for file in figure.files]
        assert len(set(files)) == len(files)
        assert not [file for file in files if "{" in file]
        for figure in planned:
            in_grid = []
            for brain in figure.params.get("grid", ()):
                in_grid += [*brain["surfaces"], *brain["maps"]]
            if in_grid:
                assert set(in_grid) == set(figure.inputs["grid"])


def test_every_figure_of_a_page_has_a_title_and_a_caption(figures, rules):
    names = sectioned(rules)
    assert sorted(path.stem for path in CAPTIONS.glob("*.rst")) == sorted(names)
    assert len(set(names)) == len(names) > 30
    assert {*rules["IN_SUMMARY"], *rules["TECHNICAL"]} <= set(names)
    values = {}
    for planned in figures.values():
        values |= {figure.name: figure.values for figure in planned}
    # the studies have all, with those that are only for the paper or small
    assert set(names) < set(values)
    for name in names:
        text = (CAPTIONS / f"{name}.rst").read_text()
        title, line, caption = text.split("\n", 2)
        assert line == len(title) * "="
        assert "{" not in (title + caption).format(**values[name])
        assert "system-message" not in caption_html(caption)


def test_the_report_gets_the_paths_of_its_figures_as_text(rules):
    shown = rules["on_page"](rules["SECTIONS"])
    assert "metrics_figure" in {figure["name"] for figure in shown}
    # Snakemake's own files cannot be handed to a job
    assert {type(figure["path"]) for figure in shown} == {str}


def test_targets_ask_for_figures_that_there_are(figures, rules):
    drawn = {figure.name for planned in figures.values() for figure in planned}
    asked_for = set()
    for path in (SHIPPED / "workflow" / "rules").glob("*.smk"):
        for names in re.findall(r"figure_files\(([^)]*)\)", path.read_text()):
            asked_for |= set(re.findall(r'"(\w+)"', names))
    assert asked_for - set(rules["SECTIONS"]) <= drawn
    # in the report's table of brains
    asked_for.add("small_pictures")
    # no figure is left that no target or page asks for
    assert drawn == asked_for - set(rules["SECTIONS"]) | set(sectioned(rules))


def test_the_paper_is_named_in_its_own_figures_alone(figures, rules):
    with_paper = {
        figure.name for figure in figures["shapes"] if "published" in figure.inputs
    }
    assert with_paper == {"paper_displacement_figure", "paper_nearest_figure"}
    assert not with_paper & set(sectioned(rules))


def test_runs_with_equal_zones_have_one_figure_of_them(figures):
    zones = only(figures["shapes"], "zones_figure")
    assert zones.files[0] == "results/runs/thin/a/figures/zones.png"


def test_simulated_and_measured_brains_are_not_exchanged(figures):
    observed = {
        ("ellipsoid", week): f"results/brains/{brain}/surface"
        for week, brain in ((21.0, "a"), (22.0, "b"))
    }
    simulated = {
        (run, week): f"results/runs/{run}/a/surfaces/week-{week:.2f}"
        for run in ("thin", "thick")
        for week in (21.0, 22.0)
    }
    weekly = only(figures["shapes"], "weekly_figure")
    folders = observed | simulated
    assert places(weekly) == {
        place: f"{folder}/pial.surf.gii" for place, folder in folders.items()
    }
    shapes = only(figures["shapes"], "shape_maps")
    assert places(shapes) == {
        place: f"{folder}/left.pial.surf.gii" for place, folder in folders.items()
    }
    for figure in (weekly, shapes):
        for brain in figure.params["grid"]:
            assert brain["simulated"] == (brain["row"] != "ellipsoid")
    displacement = only(figures["shapes"], "displacement_maps")
    frames = [f"results/runs/{run}/a/folding/frames.h5" for run in ("thin", "thick")]
    assert list(displacement.inputs["frames"]) == frames
    assert displacement.params["runs"] == ["thin", "thick"]


def test_members_of_a_sweep_that_ended_before_have_no_files(figures):
    influence = only(figures["shapes"], "influence_figure")
    surfaces = {
        brain["column"]: brain["surfaces"] for brain in influence.params["grid"]
    }
    assert list(surfaces) == ["rate-1e-07", ENDED, "ellipsoid"]
    assert [run for run, files in surfaces.items() if not files] == [ENDED]
    spectra = only(figures["shapes"], "influence_spectra")
    assert len(spectra.inputs["members"]) == 1
    assert list(spectra.params["values"]) == ["rate-1e-07", ENDED]


def test_a_prediction_is_drawn_between_its_start_and_the_atlas(figures):
    predicted = only(figures["prediction"], "predicted_figure")
    surfaces = {
        22.4: "results/brains/own22.4/surface/pial.surf.gii",
        23.9: "results/runs/reference/own22.4/surfaces/week-23.90/fine/pial.surf.gii",
        24: "results/brains/atlas24/surface/pial.surf.gii",
    }
    assert [
        (brain["column"], brain["surfaces"], brain["simulated"])
        for brain in predicted.params["grid"]
    ] == [(Facts(week, "GW"), [path], week == 23.9) for week, path in surfaces.items()]
