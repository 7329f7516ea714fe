"""The rules of figures: which figures a study has, of what, and with which words."""

import inspect
import re
from importlib import import_module

import pytest
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


# a figure of each kind of grid, frames and tables
RECORDED = {
    "shapes": (
        "weekly_figure",
        "shape_maps",
        "displacement_maps",
        # runs with equal zones have one
        "zones_figure",
        # members of a sweep that ended before have no files
        "influence_figure",
        "influence_spectra",
        "growth_figure",
    ),
    "prediction": ("predicted_figure", "atlas_ages"),
    "predictions": ("expected_figure", "regions_figure", "intervals_figure"),
}


@pytest.mark.parametrize("study", RECORDED)
def test_figures_are_drawn_of_these_files(study, figures, recorded):
    found = {}
    for number, figure in enumerate(figures[study]):
        if figure.name in RECORDED[study]:
            params = {
                name: value
                for name, value in figure.params.items()
                if name not in ("modules", "code", "command")
            }
            inputs = {
                name: [files] if isinstance(files, str) else list(map(str, files))
                for name, files in figure.inputs.items()
            }
            drawn = {"files": figure.files, "inputs": inputs, "params": params}
            found[f"{number} {figure.name}"] = drawn
    recorded(found)
