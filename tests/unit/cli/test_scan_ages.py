"""Ages of scans: of a named column, or else of the file's name; all others are
refused, with what was found."""

import re

import pytest
from facts import Facts
from scan_trees import make_tree

from gyriflow.cli.recognition import UNSET, recognise
from gyriflow.errors import InputError

LONE = "sub-01/lh.pial"
FIRST, SECOND = BOTH = [f"sub-01/ses-{session}/lh.pial" for session in (1, 2)]
TABLE = "participants.tsv"
SESSIONS = "sub-01/sub-01_sessions.tsv"
SIDECAR = "participants.json"


def ages(folder, **options):
    """Return for each scan its age, or why it has none, by id."""
    found = {}
    for brain in recognise(folder, **options).brains:
        week = brain.entry["week"]
        found[brain.entry["id"]] = " ".join(brain.causes) if week == UNSET else week
    return found


def tree(folder, files, tables, sidecar=None):
    """Write a data set with tables of rows, separated by |, and the description of
    columns, by name."""
    rows = {path: text.split(" | ") for path, text in tables.items()}
    described = {SIDECAR: sidecar} if sidecar else {}
    return make_tree(folder, surfaces=files, tables=rows, json=described)


def age_of_row(folder, columns, cells, sidecar=None):
    """Return the age of a scan that has a row in a table of participants."""
    table = f"participant_id {columns} | sub-01 {cells}"
    (found,) = ages(tree(folder, [LONE], {TABLE: table}, sidecar)).values()
    return found


@pytest.mark.parametrize("column", ["age_at_mri", "PMA", "AgeAtScan"])
def test_an_age_at_the_scan_comes_before_others_which_are_said(tmp_path, column):
    rows = f"participant_id gestational_age age {column} | sub-01 33.1 31 29.4"
    (brain,) = recognise(tree(tmp_path, [LONE], {TABLE: rows})).brains
    assert brain.entry["week"] == 29.4
    assert brain.age_source == Facts(TABLE, column, "gestational_age 33.1", "age 31")


@pytest.mark.parametrize(
    ("column", "text", "units", "week"),
    [
        ("Gestational-Weeks", "24", None, 24.0),
        ("ga", "24.3GW", None, 24.3),
        ("ga", "24", "completed weeks", 24.0),
        ("ga", "170", "day", 24.29),
        ("scan_age_days", "170", None, 24.29),
        ("ga_days", "170", "weeks", Facts("ga_days", "days and weeks", SIDECAR)),
        ("ga", "24", "months", Facts("ga", "months", SIDECAR, "row 2")),
        ("ga", "n/a", None, Facts("ga", "n/a", f"{TABLE} row 2")),
    ],
)
def test_ages_have_their_unit_from_the_name_or_the_sidecar(
    tmp_path, column, text, units, week
):
    sidecar = {column: {"Units": units}} if units else None
    assert age_of_row(tmp_path, column, text, sidecar) == week


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("Description", "gestational age at birth"),
        ("Description", "weeks since conception"),
        ("AgeReference", "of the mother"),
    ],
)
def test_a_column_that_is_described_as_another_age_is_refused(tmp_path, key, text):
    found = age_of_row(tmp_path, "scan_age", "24", {"scan_age": {key: text}})
    assert found == Facts("scan_age", text, SIDECAR, f"{TABLE} row 2")


@pytest.mark.parametrize(
    ("columns", "cells", "found"),
    [
        # not named as a gestational age at the scan
        ("age", "24", ["age 24"]),
        ("postnatal_age_weeks", "24", ["postnatal_age_weeks 24"]),
        # beside one that may be at birth
        ("ga age", "33.1 29.4", ["ga 33.1", "age 29.4"]),
        ("ga age_at_fetal_mri", "33.1 29.4", ["age_at_fetal_mri", "scan_age"]),
        ("week age_reference", "24 DOB", ["week 24", "age_reference DOB"]),
        # two that differ
        ("ga week", "22 28", ["ga 22", "week 28"]),
        ("pma weeks_at_scan", "22 28", ["weeks_at_scan", "scan_age"]),
        # days of a week in a column of their own
        ("ga days", "24 3", ["days", "3 in days"]),
    ],
)
def test_other_ages_are_refused_by_cell(tmp_path, columns, cells, found):
    assert age_of_row(tmp_path, columns, cells) == Facts(*found, f"{TABLE} row 2")


def test_an_age_of_the_mother_or_at_birth_is_not_one_of_the_scan(tmp_path):
    columns = "maternal_age ga_at_birth birth_age ga GA"
    assert age_of_row(tmp_path, columns, "31 39.1 39.1 24 24") == 24.0


@pytest.mark.parametrize(
    ("table", "age"),
    [
        ("timepoint ga | sub-01 2 24", 24.0),
        ("visit ga | sub-01 1 22 | sub-01 2 28", ["row 2", "row 3", "session_id"]),
        # whole ids only
        ("ga | SUB-01 22", ["SUB-01"]),
        ("ga | 1 22", ["01", "1 (participants.tsv row 2)"]),
        # given twice
        ("ga | sub-01 22 | sub-01 28", [22, "row 2", 28, "row 3", "session_id"]),
        ("sex ga | sub-01 F 22 | sub-01 M 22", ["sex", "F", "M"]),
    ],
)
def test_an_age_is_that_of_exactly_this_subject(tmp_path, table, age):
    found = ages(tree(tmp_path, [LONE], {TABLE: f"participant_id {table}"}))
    assert found == {"sub-01": Facts(*age) if isinstance(age, list) else age}


@pytest.mark.parametrize(
    ("participants", "sessions", "age"),
    [
        (None, "session_id ga | 2 24", ["2 (sub-01_sessions.tsv row 2)"]),
        ("sub-01 24", "session_id sex | 1 F | 2 F", ["row 2", "session_id 1"]),
        (None, "participant_id session_id ga | sub-02 1 22", ["sub-02", "sub-01"]),
        # given twice
        (
            "sub-01 33",
            "session_id ga | 1 22",
            ["ga 33", TABLE, "ga 22", "sub-01_sessions.tsv"],
        ),
        # a data set that has ages at scans has others at birth
        ("sub-01 33", "session_id scan_age | 1 29.4", 29.4),
    ],
)
def test_an_age_is_that_of_exactly_this_session(tmp_path, participants, sessions, age):
    tables = {SESSIONS: sessions}
    if participants:
        tables[TABLE] = f"participant_id ga | {participants}"
    found = ages(tree(tmp_path, [FIRST], tables))
    assert found == {"sub-01_ses-1": Facts(*age) if isinstance(age, list) else age}


@pytest.mark.parametrize(
    ("name", "column"),
    [(TABLE, "session_id"), (TABLE, "Visit"), ("sessions.tsv", "ses")],
)
def test_a_table_may_have_a_row_for_each_session(tmp_path, name, column):
    table = f"participant_id {column} ga | sub-01 1 22 | 01 ses-2 28"
    found = ages(tree(tmp_path, BOTH, {name: table}))
    assert found == {"sub-01_ses-1": 22.0, "sub-01_ses-2": 28.0}


SCANS = "sub-01/ses-1/sub-01_ses-1_scans.tsv"


@pytest.mark.parametrize(
    ("files", "tables", "expected"),
    [
        # one age of a subject with two sessions is of neither
        (BOTH, {TABLE: "ga | sub-01 22"}, [["ga 22", f"{TABLE} row 2", "session_id"]]),
        # ids without sub-
        (["case01.lh.pial"], {TABLE: "ga | case1 22"}, [["case1", "row 2"]]),
        (
            ["a/case7.lh.pial", "a/case7_b.lh.pial", "a/x/case8.lh.pial"],
            {TABLE: "ga | case7 22 | case7_b 23 | a 24 | x 25"},
            [22.0, 23.0, ["a, x"]],
        ),
        (["sub-01-A/lh.pial"], {TABLE: "ga | sub-01 22 | sub-01-A 28"}, [28.0]),
        # tables of one data set, wherever they lie
        (
            ["derivatives/seg/" + FIRST],
            {TABLE: "sex | sub-01 F", "rawdata/" + SESSIONS: "session_id ga | 1 22"},
            [22.0],
        ),
        (
            [FIRST],
            {TABLE: "ga | sub-01 33", SCANS: "filename scan_age | a 24 | b 24"},
            [24.0],
        ),
        # ages of other scans say what those of a column are
        (
            ["sub-01/lh.pial", "sub-02/lh.pial"],
            {TABLE: "ga scan_age | sub-01 33.1 29.4 | sub-02 35 n/a"},
            [29.4, ["scan_age", "n/a", "row 3"]],
        ),
        (
            [FIRST, "sub-02/lh.pial"],
            {TABLE: "ga | sub-01 33 | sub-02 39", SESSIONS: "session_id pma | 1 29.4"},
            [29.4, ["ga 39", "row 3", "scan_age"]],
        ),
        (
            ["sub-01/lh.pial", "sub-02/lh.pial"],
            {TABLE: "ga pna | sub-01 33.1 4 | sub-02 35 n/a"},
            [["ga 33.1", "pna 4"], ["ga 35", "row 3", "pna 4", "row 2"]],
        ),
        # the name of the file beside a table
        (["sub-01_GA-26.lh.pial"], {TABLE: "ga | sub-01 26.4"}, [26.4]),
        (["sub-01_GA-26.lh.pial"], {TABLE: "ga | sub-01 28"}, [[28, "26", TABLE]]),
        (["sub-01_GA-26.lh.pial"], {TABLE: "age | sub-01 n/a"}, [["age", "n/a"]]),
        (
            ["sub-01_GA-26.lh.pial", "sub-02/lh.pial"],
            {TABLE: "sex | sub-01 F | sub-02 F"},
            [26.0, [TABLE, "sex", "scan_age"]],
        ),
        # a table of another data set is not of this file
        (["a/case7_week24.lh.pial"], {f"b/{TABLE}": "ga | case7 28"}, [24.0]),
    ],
)
def test_an_age_is_that_of_exactly_this_file(tmp_path, files, tables, expected):
    for path in tables:
        if path.endswith(TABLE):
            tables = tables | {path: f"participant_id {tables[path]}"}
    found = ages(tree(tmp_path, files, tables))
    in_order = [found[name] for name in sorted(found)]
    weeks = [Facts(*age) if isinstance(age, list) else age for age in expected]
    assert in_order == (weeks * 2 if files is BOTH else weeks)


@pytest.mark.parametrize(
    ("name", "age"),
    [
        ("week24+3", 24.43),
        ("GA24w3d", 24.43),
        ("week21_T2", 21.0),
        ("week24_5", Facts("week24_5")),
        ("week99", Facts(99, 15, 45)),
        ("GA24,3", 24.3),
        ("week24to26", Facts("week24to26")),
        ("week24_0.5mm", 24.0),
        ("GA24/week26", Facts("24", "26")),
        ("sub-21", Facts("week24.3")),
        ("AGA23", Facts("week24.3")),
    ],
)
def test_names_give_ages_or_are_refused_as_ambiguous(tmp_path, name, age):
    make_tree(tmp_path, surfaces=[f"a/{name}_hemi-L_pial.surf.gii"])
    assert list(ages(tmp_path).values()) == [age]


@pytest.mark.parametrize(
    ("text", "age"),
    [
        ("Participant ID;Gestational age (weeks)\nsub-01;24,5", 24.5),
        ('"participant_id", GA \r\n"sub-01" , 24+3\r\n', 24.43),
        ("participant_id,ga,ga\nsub-01,22,28", Facts("ga", 22, 28, "row 2")),
        ("participant_id,ga\nsub-01,24,5", Facts("row 2", 3, 2)),
        ("name,ga\nsub-01,24", Facts("participants.csv", "participant_id")),
    ],
)
def test_tables_are_read_with_their_separators(tmp_path, text, age):
    make_tree(tmp_path, surfaces=[LONE], text={"participants.csv": text})
    assert ages(tmp_path) == {"sub-01": age}


def test_tables_whose_content_is_not_here_are_not_passed_over(tmp_path):
    tree(tmp_path, [FIRST], {TABLE: "participant_id ga | sub-01 22"})
    make_tree(tmp_path, lost=[SESSIONS])
    assert ages(tmp_path) == {"sub-01_ses-1": Facts(tmp_path / SESSIONS)}


@pytest.mark.parametrize("place", ["table", "names"])
def test_decimals_that_may_be_days_are_asked_for_once(tmp_path, place):
    texts = ("24.3", "25.1", "26.6")
    names = [f"week{text}" for text in texts]
    if place == "table":
        names = ["sub-00", "sub-01", "sub-02"]
        rows = [f"{name} {text}" for name, text in zip(names, texts, strict=True)]
        make_tree(tmp_path, tables={TABLE: ["participant_id ga", *rows]})
    make_tree(tmp_path, surfaces=[f"{name}_hemi-L_pial.surf.gii" for name in names])
    facts = Facts("24.3", "--decimal-weeks", "--weeks-days")
    with pytest.raises(InputError, check=facts):
        ages(tmp_path)
    assert list(ages(tmp_path, notation="decimal").values()) == [24.3, 25.1, 26.6]
    assert list(ages(tmp_path, notation="days").values()) == [24.43, 25.14, 26.86]


@pytest.mark.parametrize("texts", [("24.5", "25.0", "26.5"), ("24.3", "25.1", "26.9")])
def test_halves_and_tenths_above_6_are_decimals(tmp_path, texts):
    names = [f"week{text}_hemi-L_pial.surf.gii" for text in texts]
    make_tree(tmp_path, surfaces=names)
    assert list(ages(tmp_path).values()) == [float(text) for text in texts]


def test_a_scan_without_an_age_is_told_with_a_name_that_gives_one(tmp_path):
    cause = ages(tree(tmp_path / "none", ["fetus1.pial"], {}))["fetus1"]
    assert cause == Facts("week24.3", TABLE)
    name = f"fetus1_{re.search(r'week[0-9.]+[0-9]', cause)[0]}.pial"
    assert list(ages(tree(tmp_path / "named", [name], {})).values()) == [24.3]
