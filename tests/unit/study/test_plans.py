"""A dozen configurations, each with columns of the tables that are planned for it.

In a configuration a brain without a source has labels. In a table a cell of several
values has spaces between them, and `-` is an empty cell.
"""

import re
from functools import cache
from pathlib import Path

import pytest
import yaml
from configurations import LABELLED, brain, from_yaml, resolved

from gyriflow.errors import InputError
from gyriflow.settings.brains import SOURCES
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import TABLES, read_plan, write_plan

ROOT = Path(__file__).parents[3]
ATLASES = ROOT / "atlases"
PLANS = sorted((Path(__file__).parent / "plans").glob("*.yaml"))
VOLUME = str(
    ATLASES / "spina-bifida/fetal_SB_atlas_GA21_notoperated/parcellation.nii.gz"
)


@cache
def planned(path):
    """Return the content of a file of this folder, and the study that it plans."""
    plan = from_yaml(path.read_text())
    configuration = plan["configuration"]
    for entry in configuration["brains"]:
        if not any(source in entry for source in SOURCES):
            entry.update(LABELLED)
    # sorts the keys
    text = yaml.dump(configuration, Dumper=yaml.CSafeDumper)
    raw = from_yaml(text.replace("FILE", __file__).replace("VOLUME", VOLUME))
    refused = dict.fromkeys(plan.get("refused", ()), "not read")
    return plan, resolve(load(raw), refused)


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
    plan, study = planned(path)
    for name, text in plan["tables"].items():
        columns, *expected = rows_of(text)
        found = []
        for row in getattr(study, name).values():
            found.append([cell(getattr(row, column)) for column in columns])
        assert found == expected, name


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_all_columns_of_a_plan(path, recorded, tmp_path):
    _, study = planned(path)
    write_plan(study, tmp_path)
    read = read_plan(tmp_path)
    assert read == study
    tables = {}
    for name in TABLES:
        rows = []
        # in this order
        for row in getattr(read, name).values():
            # defaults of settings change, and are in tests of their own
            cells = [
                f"{key}={cell(value)}"
                for key, value in vars(row).items()
                if key != "settings" and cell(value) != "-"
            ]
            rows.append(" ".join(cells).replace(str(ROOT), ""))
        tables[name] = dict(enumerate(rows))
    recorded(tables)


def test_ids_and_odd_texts_stay_and_a_table_is_only_written_if_it_changed(tmp_path):
    brains = [
        brain("021", 21, population="NA", covariates={"a": "1", "b": 'q"u,\nü'}),
        brain("true", 22, "right", subject="null"),
        {"id": "1e3", "week": "24+2", "shape": {}},
    ]
    study = resolved(brains, start=None, folding=None)
    write_plan(study, tmp_path)
    read = read_plan(tmp_path)
    assert read == study
    # no default becomes a value that was given
    assert read.brains["1e3"].shape.model_fields_set == set()
    written = {file: file.stat().st_ino for file in tmp_path.iterdir()}
    write_plan(study, tmp_path)
    assert {file: file.stat().st_ino for file in tmp_path.iterdir()} == written
    changed = resolved(brains[:2], start=None, folding=None)
    write_plan(changed, tmp_path)
    assert read_plan(tmp_path) == changed


def test_a_missing_plan_is_named(tmp_path):
    with pytest.raises(InputError, match=r"brains\.csv"):
        read_plan(tmp_path)
