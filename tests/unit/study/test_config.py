"""A configuration is used as a whole or refused as a whole, with every problem
named."""

import importlib.util
import json
import math
from datetime import date
from pathlib import Path

import jsonschema
import pytest
from configurations import keys, labelled, problems, refusal, resolved, study
from facts import Facts

from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.atlas import Atlas
from gyriflow.settings.folding import output_weeks, parameters_from, plain_settings
from gyriflow.settings.root import Config
from gyriflow.settings.stages import MeshSettings
from gyriflow.study import resolve
from gyriflow.study.loading import load


def test_all_mistakes_are_named_at_once():
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
    assert (
        refusal(wrong).splitlines()[-1]
        != refusal(across).splitlines()[-1]
        == Facts("config/README.md")
    )


@pytest.mark.parametrize(
    ("path", "facts"),
    [
        ("$HOME/scans/week24.nii.gz", ["$HOME", "~/"]),
        ("${DATA}/week24.nii.gz", ["$HOME", "~/"]),
        ("file:///scans/week24.nii.gz", ["file://"]),
        ("https://site/week24.nii.gz", ["file://"]),
        (r"scans\week24.nii.gz", ["write / between folders"]),
        ("scans", ["folder with week24.nii.gz, week25.nii"]),
        ("scan/week24.nii.gz", ["no folder {}/scan"]),
        ("scans/week24.nii.gz ", ["there is week24.nii.gz"]),
        ("scans/week24.nii", ["there is week24.nii.gz"]),
        ("scans/Week24.nii.gz", ["there is week24.nii.gz"]),
        ("scans/week25.nii.gz", ["there is week25.nii"]),
        ("scans/week26.mgz", ["there is week24.nii.gz, week25.nii"]),
        ("lost.nii.gz", ["a link to {}/nowhere.nii.gz"]),
    ],
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


def test_a_folder_of_an_atlas_is_not_made_of_a_variable_or_an_address():
    for folder in ("$HOME/atlas", "file:///atlas"):
        section = {"name": "spina-bifida", "folder": folder}
        assert refusal(study(atlas=section)) == Facts("atlas.folder:", folder)


@pytest.mark.parametrize(
    ("folding", "key", "facts"),
    [
        ({"thickness_mm": 0}, "thickness_mm", [0]),
        ({"thickness_mm": {"weeks": {21: True}}}, "thickness_mm.weeks", [21, True]),
        ({"thickness_mm": {"map": "x.shape.gii"}}, "thickness_mm.map", ["x.shape.gii"]),
        ({"step_s": "fast"}, "step_s", ["fast"]),
        ({"step_s": True}, "step_s", [True]),
        (
            {"stress_memory_gw": "forever"},
            "stress_memory_gw",
            [0, "infinite", "forever"],
        ),
        ({"growth_rate_per_s": float("nan")}, "growth_rate_per_s", ["nan"]),
        ({"fields": ["tension"]}, "fields[0]", ["displacement", "tension"]),
        (
            {"contact": "walls"},
            "contact",
            ["global", "planes", "none", "walls"],
        ),
        ({"end_week": 21}, "end_week", [21, "a"]),
        ({"growth_rate_per_s": -1e-8}, "growth_rate_per_s", [0, -1e-8]),
        # what would fail later in the run
        ({"growth_rate_per_s": 1e-5, "step_s": 604800}, "step_s", [604800, 6.05]),
    ],
)
def test_an_impossible_value_is_refused_with_its_key_and_the_bound(folding, key, facts):
    assert problems(study(folding={"end_week": 24} | folding)) == [
        Facts(f"folding.{key}:", *facts)
    ]


@pytest.mark.parametrize(
    ("changes", "key", "facts"),
    [
        ({"brains": {"id": "a"}}, "brains", ["list"]),
        ({"brains": ["l.nii.gz"]}, "brains[0]", ["keys"]),
        ({"runs": [{"name": "x"}]}, "runs", ["keys"]),
        ({"mesh": [{"order": 2}]}, "mesh", ["keys"]),
        ({"mesh": {"surface_edge_mm": "0,8"}}, "mesh.surface_edge_mm", ["write 0.8"]),
        ({"mesh": {"surface_edge_mm": "0.8 mm"}}, "mesh.surface_edge_mm", ["number"]),
        ({"start": date(2026, 11, 29)}, "start", ["2026-11-29", "quotes"]),
        ({"start": False}, "start", ["no", "off", "quotes"]),
        ({"start": 17}, "start", [17, "quotes"]),
    ],
)
def test_a_wrong_type_is_named_in_words_of_yaml(changes, key, facts):
    (found,) = [text for text in problems(study(**changes)) if text.startswith(key)]
    assert found == Facts(f"{key}:", *facts)
    for word in ("tuple", "dictionary", "instance", "datetime"):
        assert word not in found


def test_what_is_allowed_by_name_or_missing():
    assert keys({}) == ["brains"]
    assert keys({"start": "a"}) == ["folding.end_week"]
    assert keys({"folding": {"end_week": 24}}) == ["brains", "start"]
    assert load(study(mesh=None)).mesh == MeshSettings()


def test_a_mistake_in_a_run_names_the_run_and_one_in_folding_is_said_once():
    found = problems(
        study(
            folding={"end_week": 24, "step_s": 0},
            runs={"x": {"poison_ratio": 0.4}, "y": {}},
        )
    )
    assert found == [
        Facts("folding.step_s:", 0),
        Facts("runs.x.poison_ratio:", "poisson_ratio"),
    ]


def test_a_run_folds_the_brains_that_it_names():
    runs = {
        "one": {"start": "b"},
        "some": {"start": ["b", "a"]},
        "every": {"start": "all"},
        "default": None,
    }
    found = resolved(runs=runs)
    pairs = [
        ("one", "b"),
        ("some", "a"),
        ("some", "b"),
        ("every", "a"),
        ("every", "b"),
        ("default", "a"),
    ]
    assert found.pairs == pairs
    assert found.simulations["some", "b"].weeks == (22.5, 23.5, 24)
    assert resolved(start="all").pairs == [("reference", "a"), ("reference", "b")]
    without = study(runs={"one": {"start": "b"}})
    del without["start"]
    assert resolve(load(without)).pairs == [("one", "b")]


def test_starts_that_cannot_be_are_all_named():
    runs = {
        "x": {"start": ["a", "phantom"], "end_week": 22},
        "y": {"start": [], "thickness_mm": {"map": __file__, "surface": __file__}},
        "z": {"start": ["b", "b"]},
        "w": {"thickness_mm": {"map": __file__, "surface": __file__}},
        "X": {},
    }
    assert problems(
        study(
            start=["a", "B"], brains=[*labelled(21, 22.5), *labelled(23, names=["all"])]
        )
    ) == [
        Facts("brains:", "all"),
        Facts("start:", "B", "a, b, all"),
    ]
    assert problems(study(start="all", runs=runs)) == [
        Facts("runs.X:", "x"),
        Facts("runs.x.start:", "phantom", "a, b"),
        Facts("runs.y.start:"),
        Facts("runs.z.start:", "b"),
        Facts("runs.w.thickness_mm:", "a, b"),
    ]
    far = study(
        start="all", folding={"end_week": 22}, runs={"x": {}, "y": {"start": "a"}}
    )
    assert problems(far) == [Facts("folding.end_week:", 22, 22.5, "b")]


@pytest.mark.parametrize(
    ("end", "every", "weeks"),
    [
        (24, 1, [21, 22, 23, 24]),
        (23.5, 1, [21, 22, 23, 23.5]),
        (21.3, 0.1, [21, 21.1, 21.2, 21.3]),
        (22, 5, [21, 22]),
    ],
)
def test_output_weeks_hold_the_start_and_the_end(end, every, weeks):
    assert output_weeks(21, end, every) == pytest.approx(weeks)


def test_parameters_of_a_run_are_what_the_folding_program_reads():
    (one,) = resolved(
        folding={"end_week": 24, "stress_memory_gw": "infinite", "ranks": 7}
    ).run_simulations
    known = {"start_week": one.weeks[0], "output_weeks": one.weeks, "fissure_x_mm": 0.0}
    plain = plain_settings(one.settings)
    read = parameters_from(known | plain)
    assert read.stress_memory_gw == math.inf
    assert plain["stress_memory_gw"] == "infinite"
    assert read.output_weeks == (21.0, 22.0, 23.0, 24.0)
    assert not {"ranks", "start"} & set(plain)
    given = one.settings.model_dump(exclude={"ranks", "start"})
    assert (
        read.model_dump(exclude={"ranks", "side", "targets", "stops", *known}) == given
    )


CONFIG = Path(__file__).parents[3] / "config"
EXAMPLES = sorted([CONFIG / "config.yaml", *(CONFIG / "examples").glob("*.yaml")])
SCHEMA = Config.model_json_schema()


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
    sections = {
        *SCHEMA["$defs"],
        *Atlas.model_json_schema()["$defs"],
        "Atlas",
        "ComparisonSettings",
    }
    # runs have the keys of folding
    assert sorted(listed) == sorted(sections - {"Run"})


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_editors_find_the_schema_of_each_example_and_it_holds(path):
    named = (
        path.read_text()
        .split("\n", 1)[0]
        .removeprefix("# yaml-language-server: $schema=")
    )
    assert (path.parent / named).resolve() == CONFIG / "schema.json"
    content = json.loads(json.dumps(read_yaml(path)))  # keys of JSON are texts
    jsonschema.validate(content, SCHEMA)
