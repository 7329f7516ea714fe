"""A dozen configurations, each with columns of the tables that are planned for it.

In a configuration a brain without a source has labels. In a table a cell of several
values has spaces between them, and `-` is an empty cell.
"""

import re
from pathlib import Path

import pytest
import yaml
from configurations import LABELLED

from gyriflow.errors import InputError
from gyriflow.settings.brains import SOURCES
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import TABLES, read_plan, write_plan

ROOT = Path(__file__).parents[3]
ATLASES = ROOT / "atlases"
PLANS = sorted((Path(__file__).parent / "plans").glob("*.yaml"))
FILE = __file__
VOLUME = str(
    ATLASES / "spina-bifida/fetal_SB_atlas_GA21_notoperated/parcellation.nii.gz"
)


def planned(plan):
    """Return the study of a plan of this folder."""
    configuration = plan["configuration"]
    for brain in configuration["brains"]:
        if not any(source in brain for source in SOURCES):
            brain.update(LABELLED)
    text = yaml.safe_dump(configuration).replace("FILE", FILE).replace("VOLUME", VOLUME)
    refused = dict.fromkeys(plan.get("refused", ()), "not read")
    return resolve(load(yaml.safe_load(text)), refused)


def cell(value):
    """Return a value of a table as in the tables of this folder."""
    if value is None or value in ((), {}, ""):
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return " ".join(cell(item) for item in value)
    if isinstance(value, dict):
        return " ".join(f"{key}={cell(item)}" for key, item in value.items())
    return f"{value:g}" if isinstance(value, float) else str(value)


def rows_of(text):
    """Return the cells of a table's lines, the heading first."""
    return [re.split(r" {2,}", line.strip()) for line in text.strip().splitlines()]


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_a_configuration_is_planned(path):
    plan = yaml.safe_load(path.read_text())
    study = planned(plan)
    for name, text in plan["tables"].items():
        columns, *expected = rows_of(text)
        found = []
        for row in getattr(study, name).values():
            found.append([cell(getattr(row, column)) for column in columns])
        assert found == expected, name


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_all_columns_of_a_plan(path, recorded):
    study = planned(yaml.safe_load(path.read_text()))
    tables = {}
    for name in TABLES:
        rows = []
        for row in getattr(study, name).values():
            cells = [f"{key}={cell(value)}" for key, value in vars(row).items()]
            # defaults of settings change, and are in tests of their own
            told = [
                text
                for text in cells
                if not text.endswith("=-") and not text.startswith("settings=")
            ]
            rows.append(" ".join(told).replace(str(ROOT), ""))
        tables[name] = dict(enumerate(rows))
    recorded(tables)


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_a_plan_is_read_as_it_was_written(path, tmp_path):
    study = planned(yaml.safe_load(path.read_text()))
    write_plan(study, tmp_path)
    read = read_plan(tmp_path)
    assert read.config == study.config
    for name in TABLES:
        # in this order
        rows = list(getattr(study, name).values())
        assert list(getattr(read, name).values()) == rows, name


def test_a_missing_plan_is_named(tmp_path):
    with pytest.raises(InputError, match=r"brains\.csv"):
        read_plan(tmp_path)
