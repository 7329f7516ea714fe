"""Every row of the registry of figures names a function of the report that takes what the row gives it."""

import ast
import inspect
from importlib import import_module
from pathlib import Path

import pytest
from configurations import LABELLED

from gyriflow.config import load
from gyriflow.study import Plan

DRAW = Path(__file__).parents[3] / "workflow" / "scripts" / "draw.py"
BRAINS = [{"id": name, "week": week, **LABELLED} for name, week in (("a", 21), ("b", 22), ("c", 23))]
STUDY = {"brains": BRAINS, "start": "a", "folding": {"end_week": 22}, "runs": {"thin": {}, "thick": {}}}
PLAN = Plan(load(STUDY | {"report": {"figures": "all"}}))
PREPARING = {
    node.name: {argument.arg for argument in (*node.args.args, *node.args.kwonlyargs)}
    for node in ast.parse(DRAW.read_text()).body
    if isinstance(node, ast.FunctionDef)
}


@pytest.mark.parametrize("row", PLAN.figures.drawn, ids=lambda row: row.name)
def test_a_row_gives_its_function_what_that_takes(row):
    function = getattr(import_module(f"gyriflow.report.{row.module}"), row.function)
    for wildcards in row.of[:1]:
        given = {**row.inputs(**wildcards), **row.options(**wildcards)}
        if row.function in PREPARING:
            assert PREPARING[row.function] <= set(given)
        else:
            inspect.signature(function).bind(**given)


def test_captions_and_titles_name_runs_and_brains_and_leave_no_braces():
    entries = PLAN.figures.entries()
    assert len({entry["file"] for entry in entries}) == len(entries)
    quality = {entry["title"]: entry["caption"] for entry in entries if entry["title"].startswith("Quality of")}
    assert quality["Quality of the brain · b"].startswith("Quality of *b* before the solve")
    said = [entry["title"] + entry["caption"] for entry in entries]
    assert not [text for text in said if "{" in text or "}" in text]


def test_technical_figures_are_drawn_on_request_only():
    essential, every = (
        set(Plan(load(STUDY | more)).figures.target("figures")) for more in ({}, {"report": {"figures": "all"}})
    )
    assert essential < every
    study = "results/study/figures"
    assert {"results/runs/thin/a/figures/steps.png", f"{study}/curvedness.a.png"} <= every - essential
    assert {f"{study}/shape_index.a.png", f"{study}/metrics.png"} <= essential
    # runs that start alike have one figure of their start
    zones = {file for file in every if file.endswith("zones.png")}
    assert zones == {"results/runs/thin/a/figures/zones.png"}
    # those that other rules make are there anyway
    assert "results/study/runs.html" in {entry["file"] for entry in Plan(load(STUDY)).figures.entries()}
