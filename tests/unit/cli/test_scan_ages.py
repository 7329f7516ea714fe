"""Ages of scans: of a named column, or else of the file's name; all others are
refused, with what was found."""

import re

import pytest
from facts import Facts
from scan_trees import make_tree

from gyriflow.cli.recognition import UNSET, recognise
from gyriflow.errors import InputError
from gyriflow.study.ages import AT_SCAN

LONE = "sub-01/lh.pial"
FIRST, SECOND = (f"sub-01/ses-{session}/lh.pial" for session in (1, 2))
BOTH = [FIRST, SECOND]
TWO = {"sub-01_ses-1": 22.0, "sub-01_ses-2": 28.0}
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


@pytest.mark.parametrize("column", [*sorted(AT_SCAN), "PMA", "AgeAtScan"])
def test_an_age_at_the_scan_comes_before_others_which_are_said(tmp_path, column):
    rows = f"participant_id gestational_age age {column} | sub-01 33.1 31 29.4"
    (brain,) = recognise(tree(tmp_path, [LONE], {TABLE: rows})).brains
    assert brain.entry["week"] == 29.4
    assert brain.age_source == Facts(TABLE, column, "gestational_age 33.1", "age 31")


@pytest.mark.parametrize(
    ("column", "text", "units", "week"),
    [
        ("Gestational-Weeks", "24", None, 24.0),
        ("week", "24w", None, 24.0),
        ("ga", "22wks1day", None, 22.14),
        ("ga", "24.3GW", None, 24.3),
        ("ga", "24+3weeks", None, 24.43),
        ("ga", "24+3/7", None, 24.43),
        ("ga", "24", "completed weeks", 24.0),
        ("ga", "170", "day", 24.29),
        ("scan_age_days", "170", None, 24.29),
        ("ga_days", "170", "weeks", Facts("ga_days", "days and weeks", SIDECAR)),
        ("ga", "24", "months", Facts("ga", "months", SIDECAR, "row 2")),
        ("ga_days", "24", None, Facts("ga_days", "24 in days", "row 2")),
        ("ga", "NaN", None, Facts("ga", "NaN", f"{TABLE} row 2")),
        ("ga", "n/a", None, Facts("ga", "n/a", f"{TABLE} row 2")),
    ],
)
def test_ages_have_their_unit_from_the_name_or_the_sidecar(
    tmp_path, column, text, units, week
):
    rows = f"participant_id {column} | sub-01 {text}"
    sidecar = {column: {"Units": units}} if units else None
    assert ages(tree(tmp_path, [LONE], {TABLE: rows}, sidecar)) == {"sub-01": week}


@pytest.mark.parametrize(
    "description",
    [
        "gestational age at birth",
        "GA (months)",
        "corrected age",
        "weeks since conception",
        "chronological age",
        "of the mother",
    ],
)
@pytest.mark.parametrize("key", ["Description", "AgeReference"])
def test_a_column_that_is_described_as_another_age_is_refused(
    tmp_path, description, key
):
    tree(
        tmp_path,
        [LONE],
        {TABLE: "participant_id scan_age | sub-01 24"},
        {"scan_age": {key: description}},
    )
    facts = Facts("scan_age", description, SIDECAR, f"{TABLE} row 2")
    assert ages(tmp_path) == {"sub-01": facts}


@pytest.mark.parametrize(
    ("columns", "cells", "found"),
    [
        # not named as a gestational age at the scan
        ("age", "24", ["age 24"]),
        ("age age_unit", "170 days", ["age 170"]),
        ("age_months", "6", ["age_months 6"]),
        ("postnatal_age_weeks", "24", ["postnatal_age_weeks 24"]),
        # beside one that may be at birth
        ("ga age", "33.1 29.4", ["ga 33.1", "age 29.4"]),
        ("ga age_at_fetal_mri", "33.1 29.4", ["age_at_fetal_mri", "scan_age"]),
        ("ga pna", "33.1 4", ["ga 33.1", "pna 4"]),
        ("ga age_since_birth", "33.1 4", ["ga 33.1", "age_since_birth 4"]),
        ("week age_reference", "24 DOB", ["week 24", "age_reference DOB"]),
        ("scan_age age_type", "24 postnatal", ["scan_age 24", "age_type postnatal"]),
        # two that differ
        ("ga week", "22 28", ["ga 22", "week 28"]),
        ("scan_age pma", "22 28", ["scan_age 22", "pma 28"]),
        ("pma weeks_at_scan", "22 28", ["weeks_at_scan", "scan_age"]),
        # days of a week in a column of their own
        ("ga days", "24 3", ["days", "3 in days"]),
    ],
)
def test_other_ages_are_refused_by_cell(tmp_path, columns, cells, found):
    tree(tmp_path, [LONE], {TABLE: f"participant_id {columns} | sub-01 {cells}"})
    assert ages(tmp_path) == {"sub-01": Facts(*found, f"{TABLE} row 2")}


def test_an_age_of_the_mother_or_at_birth_is_not_one_of_the_scan(tmp_path):
    columns = "participant_id maternal_age ga_at_birth birth_age ga GA"
    tree(tmp_path, [LONE], {TABLE: f"{columns} | sub-01 31 39.1 39.1 24 24"})
    assert ages(tmp_path) == {"sub-01": 24.0}


@pytest.mark.parametrize(
    ("files", "tables", "expected"),
    [
        # a row for each session, under several names of the column
        *(
            (
                BOTH,
                {TABLE: f"participant_id {column} ga | sub-01 1 22 | 01 ses-2 28"},
                TWO,
            )
            for column in ("session_id", "session", "ses", "Visit")
        ),
        (
            BOTH,
            {"sessions.tsv": "participant_id session_id ga | 01 1 22 | 01 2 28"},
            TWO,
        ),
        (
            [LONE],
            {TABLE: "participant_id visit ga | sub-01 1 22 | sub-01 2 28"},
            {"sub-01": Facts("row 2", "row 3", "session_id")},
        ),
        ([LONE], {TABLE: "participant_id timepoint ga | sub-01 2 24"}, {"sub-01": 24}),
        (
            [FIRST],
            {SESSIONS: "session_id ga | 2 24"},
            {"sub-01_ses-1": Facts("2 (sub-01_sessions.tsv row 2)")},
        ),
        # one age of a subject with two sessions is of neither
        (
            BOTH,
            {TABLE: "participant_id ga | sub-01 22"},
            dict.fromkeys(TWO, Facts("ga 22", f"{TABLE} row 2", "session_id")),
        ),
        (
            [FIRST],
            {
                TABLE: "participant_id ga | sub-01 24",
                SESSIONS: "session_id sex | 1 F | 2 F",
            },
            {"sub-01_ses-1": Facts("ga 24", "row 2", "session_id 1")},
        ),
        # whole ids only
        ([LONE], {TABLE: "participant_id ga | SUB-01 22"}, {"sub-01": Facts("SUB-01")}),
        (
            [LONE],
            {TABLE: "participant_id ga | 1 22"},
            {"sub-01": Facts("01", "1 (participants.tsv row 2)")},
        ),
        (
            ["case01.lh.pial"],
            {TABLE: "participant_id ga | case1 22"},
            {"case01": Facts("case1", "row 2")},
        ),
        (
            ["a/case7.lh.pial", "a/case7_b.lh.pial", "a/x/case8.lh.pial"],
            {TABLE: "participant_id ga | case7 22 | case7_b 23 | a 24 | x 25"},
            {"case7": 22.0, "case7_b": 23.0, "case8": Facts("a, x")},
        ),
        (
            ["sub-01-A/lh.pial"],
            {TABLE: "participant_id ga | sub-01 22 | sub-01-A 28"},
            {"sub-01-A": 28.0},
        ),
        (
            [FIRST],
            {SESSIONS: "participant_id session_id ga | sub-02 1 22"},
            {"sub-01_ses-1": Facts("sub-02", "sub-01")},
        ),
        # given twice
        (
            [LONE],
            {TABLE: "participant_id ga | sub-01 22 | sub-01 28"},
            {"sub-01": Facts(22, "row 2", 28, "row 3", "session_id")},
        ),
        (
            [LONE],
            {TABLE: "participant_id sex ga | sub-01 F 22 | sub-01 M 22"},
            {"sub-01": Facts("sex", "F", "M")},
        ),
        (
            [FIRST],
            {
                TABLE: "participant_id ga | sub-01 33",
                SESSIONS: "session_id ga | 1 22",
            },
            {"sub-01_ses-1": Facts("ga 33", TABLE, "ga 22", "sub-01_sessions.tsv")},
        ),
        # tables of one data set, wherever they lie
        (
            ["derivatives/seg/" + FIRST],
            {
                TABLE: "participant_id sex | sub-01 F",
                "rawdata/" + SESSIONS: "session_id ga | 1 22",
            },
            {"sub-01_ses-1": 22.0},
        ),
        (
            [FIRST],
            {
                TABLE: "participant_id ga | sub-01 33",
                "sub-01/ses-1/sub-01_ses-1_scans.tsv": (
                    "filename scan_age | a.nii.gz 24 | b.nii.gz 24"
                ),
            },
            {"sub-01_ses-1": 24.0},
        ),
        # a data set that has ages at scans has others at birth
        (
            ["sub-01/lh.pial", "sub-02/lh.pial"],
            {TABLE: "participant_id ga scan_age | sub-01 33.1 29.4 | sub-02 35 n/a"},
            {"sub-01": 29.4, "sub-02": Facts("scan_age", "n/a", "row 3")},
        ),
        (
            [FIRST, "sub-02/lh.pial"],
            {
                TABLE: "participant_id ga | sub-01 33.1 | sub-02 39",
                SESSIONS: "session_id scan_age | 1 29.4",
            },
            {"sub-01_ses-1": 29.4, "sub-02": Facts("ga 39", "row 3", "scan_age")},
        ),
        (
            ["sub-01/lh.pial", "sub-02/lh.pial"],
            {TABLE: "participant_id ga pna | sub-01 33.1 4 | sub-02 35 n/a"},
            {
                "sub-01": Facts("ga 33.1", "pna 4"),
                "sub-02": Facts("ga 35", "row 3", "pna 4", "row 2"),
            },
        ),
        # the name of the file beside a table
        (
            ["sub-01_GA-26.lh.pial"],
            {TABLE: "participant_id ga | sub-01 26.4"},
            {"sub-01": 26.4},
        ),
        (
            ["sub-01_GA-26.lh.pial"],
            {TABLE: "participant_id ga | sub-01 28"},
            {"sub-01": Facts(28, "26", TABLE)},
        ),
        (
            ["sub-01_ses-1_GA24.lh.pial", "sub-01_ses-2_GA26.lh.pial"],
            {TABLE: "participant_id ga | sub-01 n/a"},
            dict.fromkeys(TWO, Facts("ga", "n/a", f"{TABLE} row 2")),
        ),
        (
            ["sub-01_GA-26.lh.pial"],
            {TABLE: "participant_id age | sub-01 n/a"},
            {"sub-01": Facts("age", "n/a", f"{TABLE} row 2")},
        ),
        # a table of another data set is not of this file
        (
            ["a/case7_week24.lh.pial"],
            {"b/participants.tsv": "participant_id ga | case7 28"},
            {"case7_week24": 24.0},
        ),
        (
            ["sub-01_GA-26.lh.pial", "sub-02/lh.pial"],
            {TABLE: "participant_id sex | sub-01 F | sub-02 F"},
            {"sub-01": 26.0, "sub-02": Facts(TABLE, "sex", "scan_age")},
        ),
    ],
)
def test_an_age_is_that_of_exactly_this_scan(tmp_path, files, tables, expected):
    assert ages(tree(tmp_path, files, tables)) == expected


@pytest.mark.parametrize(
    ("name", "age"),
    [
        ("week24+3", 24.43),
        ("GA24w3d", 24.43),
        ("ga-26.4", 26.4),
        ("week21_T2", 21.0),
        ("week24_1mm", 24.0),
        ("week24_5", Facts("week24_5")),
        ("week24-26", Facts("week24-26")),
        ("week24_ga26", Facts("24", "26")),
        ("week99", Facts(99, 15, 45)),
        ("GA24,3", 24.3),
        ("GA24w3", 24.43),
        ("week24to26", Facts("week24to26")),
        ("week24_0.5mm", 24.0),
        ("week24_1_5T", 24.0),
        ("GA24/week26", Facts("24", "26")),
    ],
)
def test_names_give_ages_or_are_refused_as_ambiguous(tmp_path, name, age):
    make_tree(tmp_path, surfaces=[f"a/{name}_hemi-L_pial.surf.gii"])
    assert list(ages(tmp_path).values()) == [age]


@pytest.mark.parametrize(
    ("text", "age"),
    [
        ("Participant ID;Gestational age (weeks)\nsub-01;24,5", 24.5),
        ('"participant_id","GA"\n"sub-01","24.5"', 24.5),
        ("participant_id, GA \r\nsub-01 , 24+3\r\n", 24.43),
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
    if place == "table":
        names = ["sub-00", "sub-01", "sub-02"]
        rows = [f"{name} {text}" for name, text in zip(names, texts, strict=True)]
        make_tree(tmp_path, tables={TABLE: ["participant_id ga", *rows]})
    else:
        names = [f"week{text}" for text in texts]
    make_tree(tmp_path, surfaces=[f"{name}_hemi-L_pial.surf.gii" for name in names])
    with pytest.raises(
        InputError, check=Facts("24.3", "--decimal-weeks", "--weeks-days")
    ):
        ages(tmp_path)
    assert list(ages(tmp_path, notation="decimal").values()) == [24.3, 25.1, 26.6]
    assert list(ages(tmp_path, notation="days").values()) == [24.43, 25.14, 26.86]


@pytest.mark.parametrize("texts", [("24.5", "25.0", "26.5"), ("24.3", "25.1", "26.9")])
def test_halves_and_tenths_above_6_are_decimals(tmp_path, texts):
    names = [f"week{text}_hemi-L_pial.surf.gii" for text in texts]
    make_tree(tmp_path, surfaces=names)
    assert list(ages(tmp_path).values()) == [float(text) for text in texts]


def test_a_participant_that_is_not_there_is_refused(tmp_path):
    make_tree(tmp_path, surfaces=[LONE])
    with pytest.raises(InputError, check=Facts("sub-1", "sub-01")):
        recognise(tmp_path, participants=["1"])


def test_a_scan_without_an_age_is_told_with_a_name_that_gives_one(tmp_path):
    cause = ages(tree(tmp_path / "none", ["fetus1.pial"], {}))["fetus1"]
    assert cause == Facts("week24.3", TABLE)
    name = f"fetus1_{re.search(r'week[0-9.]+[0-9]', cause)[0]}.pial"
    assert list(ages(tree(tmp_path / "named", [name], {})).values()) == [24.3]
