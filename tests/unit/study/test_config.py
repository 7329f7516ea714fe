"""A configuration is used as a whole or refused as a whole, with every problem named."""

import json
import math
import re
from pathlib import Path

import jsonschema
import pytest
from configurations import keys, labelled, problems, refusal, study

from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.atlas import Atlas
from gyriflow.settings.folding import output_weeks, parameters_from
from gyriflow.settings.root import Config
from gyriflow.settings.stages import MeshSettings
from gyriflow.study import resolve
from gyriflow.study.loading import load


def test_defaults_are_the_reference_values():
    config = load(study())
    run = config.runs["reference"]
    assert (run.thickness_mm, run.poisson_ratio, run.growth_rate_per_s, run.step_s) == (1.5, 0.45, 2e-7, 43200)
    (one,) = resolve(config).folded
    assert (one.run, one.start.id, one.weeks) == ("reference", "a", (21, 22, 23, 24))
    assert [brain.source for brain in config.brains] == ["labels", "labels"]


@pytest.mark.fault(27)
def test_all_mistakes_are_named_at_once():
    wrong = study(folding={"end_week": 20, "poisson_ratio": 0.5, "thicknes_mm": 2}, metric={}, start="a")
    assert problems(wrong) == [
        "folding.poisson_ratio: Input should be less than 0.5; found 0.5",
        "folding.thicknes_mm: unknown key; did you mean thickness_mm?",
        "metric: unknown key; did you mean metrics?",
    ]
    assert refusal(wrong).endswith("; once each key is valid, they are checked against each other")
    across = study(folding={"end_week": 20, "step_s": 6e5, "growth_rate_per_s": 2e-6}, start=["a", "a"])
    assert problems(across) == [
        "start: found a more than once",
        "folding.end_week: found 20; it should be above 21, the week of the start brain a",
        "folding.step_s: found 600000; tissue would grow by 1.2 in a step, beyond 1",
    ]
    assert refusal(across).endswith("all keys are described")


@pytest.mark.fault(28, 29)
@pytest.mark.parametrize(
    ("folding", "wrong"),
    [
        ({"poisson_ratio": 0.5}, "poisson_ratio: Input should be less than 0.5; found 0.5"),
        ({"thickness_mm": 0}, "thickness_mm: should be greater than 0; found 0"),
        ({"thickness_mm": {"weeks": {21: True}}}, "thickness_mm.weeks: should hold numbers, not true or false"),
        ({"thickness_mm": {"map": "x.shape.gii"}}, "thickness_mm.map: no such file"),
        ({"step_s": "fast"}, "step_s: Input should be a valid number"),
        ({"step_s": True}, "step_s: should be a number or text, not true or false; found True"),
        ({"stress_memory_gw": "forever"}, "stress_memory_gw: should be 0 or more, or 'infinite'"),
        ({"growth_rate_per_s": float("nan")}, "growth_rate_per_s: Input should be a finite number"),
        ({"fields": ["tension"]}, "fields[0]: Input should be 'displacement'"),
        ({"contact": {"kind": "walls"}}, "contact.kind: Input should be 'global', 'planes' or 'none'"),
        ({"end_week": 21}, "end_week: found 21; it should be above 21, the week of the start brain a"),
        ({"growth_rate_per_s": -1e-8}, "growth_rate_per_s: should be greater than or equal to 0; found -1e-08"),
        # what would fail later in the run
        ({"growth_rate_per_s": 1e-5, "step_s": 604800}, "step_s: found 604800; tissue would grow by 6.05 in a step"),
    ],
)
def test_an_impossible_value_is_refused_with_its_key_and_the_bound(folding, wrong):
    (line,) = problems(study(folding={"end_week": 24} | folding))
    assert line.startswith(f"folding.{wrong}")


def test_what_is_allowed_by_name_or_missing():
    assert keys({}) == ["brains"]
    assert problems({"start": "a"}) == ["folding.end_week: Field required"]
    assert keys({"folding": {"end_week": 24}}) == ["brains", "start"]
    assert load(study(mesh=None)).mesh == MeshSettings()


def test_a_mistake_in_a_run_names_the_run_and_one_in_folding_is_said_once():
    found = problems(study(folding={"end_week": 24, "step_s": 0}, runs={"x": {"poison_ratio": 0.4}, "y": {}}))
    assert found == [
        "folding.step_s: Input should be greater than 0; found 0",
        "runs.x.poison_ratio: unknown key; did you mean poisson_ratio?",
    ]


def test_a_run_folds_the_brains_that_it_names():
    runs = {"one": {"start": "b"}, "some": {"start": ["b", "a"]}, "every": {"start": "all"}, "default": None}
    found = resolve(load(study(runs=runs)))
    pairs = [("one", "b"), ("some", "a"), ("some", "b"), ("every", "a"), ("every", "b"), ("default", "a")]
    assert found.pairs == pairs
    assert found.simulations["some", "b"].weeks == (22.5, 23.5, 24)
    assert resolve(load(study(start="all"))).pairs == [("reference", "a"), ("reference", "b")]
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
    assert problems(study(start=["a", "B"], brains=[*labelled(21, 22.5), *labelled(23, names=["all"])])) == [
        "brains: the id all is reserved; choose another",
        "start: found 'B', which is no brain; known are a, b, all",
    ]
    assert problems(study(start="all", runs=runs)) == [
        "runs.X: is the same folder as that of the run x on some disks; rename one",
        "runs.x.start: found 'phantom', which is no brain; known are a, b",
        "runs.y.start: found no ids; expected one or more",
        "runs.z.start: found b more than once",
        "runs.w.thickness_mm: has a map on a surface, which belongs to one brain; the run starts from a, b",
    ]
    far = study(start="all", folding={"end_week": 22}, runs={"x": {}, "y": {"start": "a"}})
    assert problems(far) == ["folding.end_week: found 22; it should be above 22.5, the week of the start brain b"]


@pytest.mark.parametrize(
    ("end", "every", "weeks"),
    [(24, 1, [21, 22, 23, 24]), (23.5, 1, [21, 22, 23, 23.5]), (21.3, 0.1, [21, 21.1, 21.2, 21.3]), (22, 5, [21, 22])],
)
def test_output_weeks_hold_the_start_and_the_end(end, every, weeks):
    assert output_weeks(21, end, every) == pytest.approx(weeks)


def test_parameters_of_a_run_are_what_the_folding_program_reads():
    (one,) = resolve(load(study(folding={"end_week": 24, "stress_memory_gw": "infinite", "ranks": 7}))).folded
    known = {"start_week": one.weeks[0], "output_weeks": one.weeks, "fissure_x_mm": 0.0}
    read = parameters_from(known | one.parameters)
    assert read.stress_memory_gw == math.inf
    assert one.parameters["stress_memory_gw"] == "infinite"
    assert read.output_weeks == (21.0, 22.0, 23.0, 24.0)
    assert not {"ranks", "start"} & set(one.parameters)
    given = one.settings.model_dump(exclude={"ranks", "start"})
    assert read.model_dump(exclude={"ranks", "side", "targets", *known}) == given


CONFIG = Path(__file__).parents[3] / "config"
EXAMPLES = sorted([CONFIG / "config.yaml", *(CONFIG / "examples").glob("*.yaml")])
SCHEMA = Config.model_json_schema()


def test_the_schema_of_all_keys_is_current():
    assert json.loads((CONFIG / "schema.json").read_text()) == SCHEMA, (
        "run python -m gyriflow.settings > config/schema.json"
    )


def test_the_page_of_keys_has_every_section():
    listed = re.findall(r"^::: gyriflow\.\S+\.(\w+)$", (CONFIG.parent / "docs" / "keys.md").read_text(), re.MULTILINE)
    sections = {*SCHEMA["$defs"], *Atlas.model_json_schema()["$defs"], "Atlas", "Compared"}
    # runs have the keys of folding
    assert sorted(listed) == sorted(sections - {"Run"})


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_editors_find_the_schema_of_each_example_and_it_holds(path):
    named = path.read_text().split("\n", 1)[0].removeprefix("# yaml-language-server: $schema=")
    assert (path.parent / named).resolve() == CONFIG / "schema.json"
    content = json.loads(json.dumps(read_yaml(path)))  # keys of JSON are texts
    jsonschema.validate(content, SCHEMA)
