"""A configuration is used as a whole or refused as a whole, with every problem
named."""

import importlib.util
import json
import math
from pathlib import Path

import jsonschema
import pytest
import yaml
from configurations import (
    cases,
    keys,
    labelled,
    problems,
    refusal,
    resolved,
    study,
    touched,
)
from facts import Facts

from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.atlas import Atlas
from gyriflow.settings.folding import (
    mapped_parameters,
    parameters_from,
    plain_settings,
)
from gyriflow.settings.root import Config
from gyriflow.settings.stages import MeshSettings
from gyriflow.study.loading import load


def test_all_mistakes_of_keys_are_named_at_once_and_then_all_between_keys():
    wrong = study(
        folding={"end_week": 20, "poisson_ratio": 0.5, "thicknes_mm": 2},
        metric={},
        start="a",
    )
    assert problems(wrong) == [
        Facts("folding.poisson_ratio:", 0.5),
        Facts("folding.thicknes_mm:", "thickness_mm"),
        Facts("metric:", "metrics"),
    ]
    across = study(
        folding={"end_week": 20, "step_s": 6e5, "growth_rate_per_s": 2e-6},
        start=["b", "b"],
    )
    assert problems(across) == [
        Facts("start:", "b"),
        Facts("folding.end_week:", 20, 22.5, "b"),
        Facts("folding.step_s:", 600000, 1.2, 1),
    ]
    hints = [refusal(raw).splitlines()[-1] for raw in (wrong, across)]
    assert hints[0] != hints[1] == Facts("config/README.md")


@cases(
    ("path", "facts"),
    """
    $HOME/scans/week24.nii.gz | [$HOME, ~/]
    ${DATA}/week24.nii.gz | [$HOME, ~/]
    file:///scans/week24.nii.gz | ["file://"]
    https://site/week24.nii.gz | ["file://"]
    scans\\week24.nii.gz | [write / between folders]
    scans | ["folder with week24.nii.gz, week25.nii"]
    scan/week24.nii.gz | ["no folder {}/scan"]
    "scans/week24.nii.gz " | [there is week24.nii.gz]
    scans/week24.nii | [there is week24.nii.gz]
    scans/Week24.nii.gz | [there is week24.nii.gz]
    scans/week25.nii.gz | [there is week25.nii]
    scans/week26.mgz | ["there is week24.nii.gz, week25.nii"]
    lost.nii.gz | ["a link to {}/nowhere.nii.gz"]
    """,
)
def test_a_path_without_a_file_says_what_is_there_instead(tmp_path, path, facts):
    (tmp_path / "scans").mkdir()
    for name in ("week24.nii.gz", "week25.nii"):
        (tmp_path / "scans" / name).touch()
    (tmp_path / "lost.nii.gz").symlink_to(tmp_path / "nowhere.nii.gz")
    brain = {"id": "a", "week": 24, "labels": path, "scheme": "binary"}
    expected = [fact.format(tmp_path) for fact in facts]
    assert refusal({"brains": [brain]}, folder=tmp_path) == Facts(
        "brains[0].labels:", *expected
    )


@pytest.mark.parametrize("folder", ["$HOME/atlas", "file:///atlas"])
def test_a_folder_of_an_atlas_is_not_made_of_a_variable_or_an_address(folder):
    section = {"name": "spina-bifida", "folder": folder}
    assert refusal(study(atlas=section)) == Facts("atlas.folder:", folder)


def test_what_is_allowed_by_name_or_missing():
    assert keys({}) == ["brains"]
    assert keys({"start": "a"}) == ["folding.end_week"]
    assert keys({"folding": {"end_week": 24}}) == ["brains", "start"]
    assert load(study(mesh=None)).mesh == MeshSettings()


def test_a_mistake_in_a_run_names_the_run_and_one_in_folding_is_said_once():
    folding = {"end_week": 24, "step_s": 0}
    runs = {"x": {"poison_ratio": 0.4}, "y": {}}
    assert problems(study(folding=folding, runs=runs)) == [
        Facts("folding.step_s:", 0),
        Facts("runs.x.poison_ratio:", "poisson_ratio"),
    ]


@cases(
    ("changes", "pairs"),
    """
    {} | [[reference, a]]
    {start: all} | [[reference, a], [reference, b]]
    {start: null, runs: {r: {start: b}}} | [[r, b]]
    {runs: {r: {start: [b, a]}, s: {start: all}}} | [[r, a], [r, b], [s, a], [s, b]]
    {runs: {r: {start: b}, s: null}} | [[r, b], [s, a]]
    """,
)
def test_a_run_folds_the_brains_that_it_names_or_those_of_the_study(changes, pairs):
    found = [simulation.key for simulation in resolved(**changes).run_simulations]
    assert found == [tuple(pair) for pair in pairs]


MAP = {"map": __file__, "surface": __file__}


def test_starts_that_cannot_be_are_all_named():
    runs = {
        "x": {"start": ["a", "phantom"], "end_week": 22},
        "y": {"start": [], "thickness_mm": MAP},
        "z": {"start": ["b", "b"]},
        "w": {"thickness_mm": MAP},
        "X": {},
    }
    assert problems(study(start="all", runs=runs)) == [
        Facts("runs.X:", "x"),
        Facts("runs.x.start:", "phantom", "a, b"),
        Facts("runs.y.start:"),
        Facts("runs.z.start:", "b"),
        Facts("runs.w.thickness_mm:", "a, b"),
    ]
    called_all = [*labelled(21, 22.5), *labelled(23, names=["all"])]
    assert problems(study(called_all, start=["a", "B"])) == [
        Facts("brains:", "all"),
        Facts("start:", "B", "a, b, all"),
    ]
    early = {"end_week": 22}
    far = study(start="all", folding=early, runs={"x": {}, "y": {"start": "a"}})
    assert problems(far) == [Facts("folding.end_week:", 22, 22.5, "b")]


def test_parameters_of_a_run_are_what_the_folding_program_reads():
    folding = {"end_week": 24, "stress_memory_gw": "infinite", "ranks": 7}
    (one,) = resolved(folding=folding).run_simulations
    known = {"start_week": one.weeks[0], "output_weeks": one.weeks, "fissure_x_mm": 0.0}
    plain = plain_settings(one.settings)
    assert plain["stress_memory_gw"] == "infinite"
    assert not {"ranks", "start"} & set(plain)
    read = parameters_from(known | plain).model_dump()
    given = one.settings.model_dump(exclude={"ranks", "start"})
    assert given["stress_memory_gw"] == math.inf
    assert {key: read[key] for key in given} == given


def test_a_map_has_its_parameter_s_name_and_its_files_are_listed(tmp_path):
    names = ("l.gii", "r.gii", "l.surf.gii", "r.surf.gii", "soft.nii.gz")
    left, right, left_surface, right_surface, soft = (str(tmp_path / f) for f in names)
    touched(tmp_path, *names)
    text = """
    end_week: 24
    thickness_mm: {map: [l.gii, r.gii], surface: [l.surf.gii, r.surf.gii]}
    growth_rate_per_s: {map: l.gii, surface: l.surf.gii, weeks: {30: 0.5, 21: 1}}
    shear_modulus_core_pa: {map: soft.nii.gz}
    core_growth_rate_per_s: {weeks: {25: 1.0e-7}}
    """
    run = load(study(folding=yaml.safe_load(text)), tmp_path).runs["reference"]
    settings = plain_settings(run)
    assert settings["thickness_mm"] == {"map": "thickness_mm"}
    growth = settings["growth_rate_per_s"]
    assert growth == {"weeks": {21.0: 1.0, 30.0: 0.5}, "map": "growth_rate_per_s"}
    assert list(growth["weeks"]) == [21.0, 30.0]
    assert settings["core_growth_rate_per_s"] == {"weeks": {25.0: 1e-7}}
    mapped = mapped_parameters(run)
    assert {name: (value.map, value.surface) for name, value in mapped.items()} == {
        "thickness_mm": ((left, right), (left_surface, right_surface)),
        "growth_rate_per_s": (left, left_surface),
        "shear_modulus_core_pa": (soft, None),
    }


def test_a_run_keeps_the_keys_of_its_growth_model_and_leaves_those_of_another():
    curve, larger = {21: 99, 30: 252}, {21: 110, 30: 280}
    runs = {
        "large": {"growth": {"area_cm2": larger}},
        "shapes": {"growth": "shapes"},
        "same": {"growth": "sizes"},
    }
    growth = {"model": "sizes", "area_cm2": curve}
    folding = {"end_week": 24, "growth": growth}
    found = load(study(folding=folding, runs=runs)).runs.values()
    assert [(run.growth.model, run.growth.area_cm2) for run in found] == [
        ("sizes", larger),
        ("shapes", "measured"),
        ("sizes", curve),
    ]


def test_a_run_s_preset_lies_over_folding_and_its_own_keys_over_both():
    runs = {
        "plain": {},
        "paper": {"preset": "fetalfoldsim"},
        "own": {"preset": "fetalfoldsim", "thickness_mm": 3},
    }
    own = {"end_week": 24, "thickness_mm": 2.2, "step_s": 3600}
    folding = own | {"preset": "expected"}
    found = load(study(folding=folding, runs=runs)).runs.values()
    assert [(run.thickness_mm, run.step_s, run.support) for run in found] == [
        (2.2, 3600, "free"),
        (1.5, 43200, "ellipsoid"),
        (3, 43200, "ellipsoid"),
    ]


CONFIG = Path(__file__).parents[3] / "config"
EXAMPLES = sorted([CONFIG / "config.yaml", *(CONFIG / "examples").glob("*.yaml")])
SCHEMA = Config.model_json_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def test_the_schema_of_all_keys_is_current():
    assert json.loads((CONFIG / "schema.json").read_text()) == SCHEMA, (
        "run python -m gyriflow.settings > config/schema.json"
    )


def test_the_page_of_keys_has_every_section():
    program = CONFIG.parent / "docs" / "reference.py"
    spec = importlib.util.spec_from_file_location("reference", program)
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    listed = []
    for models in reference.SECTIONS.values():
        listed += [model.__name__ for model in models.values()]
    sections = {*SCHEMA["$defs"], *Atlas.model_json_schema()["$defs"]}
    # runs have the keys of folding
    sections = (sections - {"Run"}) | {"Atlas", "ComparisonSettings"}
    assert sorted(listed) == sorted(sections)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_editors_find_the_schema_of_each_example_and_it_holds(path):
    first_line = path.read_text().split("\n", 1)[0]
    named = first_line.removeprefix("# yaml-language-server: $schema=")
    assert (path.parent / named).resolve() == CONFIG / "schema.json"
    content = json.loads(json.dumps(read_yaml(path)))  # keys of JSON are texts
    VALIDATOR.validate(content)
