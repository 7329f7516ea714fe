"""Ages of scans: from the one place that names exactly this scan, or refused with all
that was found."""

import pytest
from facts import Facts
from scan_trees import make_tree

from gyriflow.cli.recognition import UNSET, recognise
from gyriflow.errors import InputError

FIRST, SECOND = (
    f"sub-01/ses-{session}/anat/sub-01_ses-{session}_dseg.nii.gz" for session in (1, 2)
)
TABLE = "participants.tsv"
SESSIONS = "sub-01/sub-01_sessions.tsv"
SIDECAR = "participants.json"
LONE = "sub-01/anat/sub-01_dseg.nii.gz"


def ages(folder, **options):
    """Return for each scan its age, or why it has none, by id."""
    found = recognise(folder, **options).brains
    return {
        brain.entry["id"]: (
            brain.contradiction if brain.entry["week"] == UNSET else brain.entry["week"]
        )
        for brain in found
    }


TWO = {"sub-01_ses-1": 22.0, "sub-01_ses-2": 28.0}
BOTH = [FIRST, SECOND]


def tree(folder, labels, tables, sidecar=None):
    """Write a data set with tables of rows, separated by |, and the description of
    columns, by name."""
    rows = {path: text.split(" | ") for path, text in tables.items()}
    return make_tree(
        folder, labels=labels, tables=rows, json={SIDECAR: sidecar} if sidecar else {}
    )


@pytest.mark.parametrize(
    ("rows", "sidecar", "age"),
    [
        # a file without a session, of a subject with several
        (
            "participant_id visit ga | sub-01 1 22 | sub-01 2 28",
            {},
            Facts("row 2", "row 3", "session_id"),
        ),
        # at the scan comes before at birth
        *(
            (f"participant_id gestational_age {column} | sub-01 33.1 29.4", {}, 29.4)
            for column in (
                "scan_age",
                "pma",
                "ga_at_scan",
                "age_at_mri",
                "PMA",
                "postmenstrual_age_at_scan",
                "scan_ga_weeks",
                "week_at_scan",
                "AgeAtScan",
                "age_at_fetal_mri",
                "ga_first_scan",
            )
        ),
        (
            "participant_id birth_age scan_age | sub-01 33.1 n/a",
            {},
            Facts("scan_age", "n/a"),
        ),
        # postnatal ages
        (
            "participant_id age | sub-01 24",
            {"age": {"Units": "weeks", "AgeReference": "birth"}},
            Facts("age", "birth", SIDECAR),
        ),
        (
            "participant_id age age_type | sub-01 24 postnatal",
            {"age": {"Units": "weeks"}},
            Facts("age", "age_type", "postnatal"),
        ),
        (
            "participant_id gestational_age | sub-01 39.4",
            {
                "gestational_age": {
                    "Units": "weeks",
                    "Description": "gestational age at birth",
                }
            },
            Facts("at birth"),
        ),
        (
            "participant_id postnatal_age_weeks | sub-01 24",
            {},
            Facts("postnatal_age_weeks", "scan_age"),
        ),
        *(
            (
                f"participant_id gestational_age {column} | sub-01 33.1 4",
                {},
                Facts("gestational_age 33.1", f"{column} 4"),
            )
            for column in ("postnatal_age", "chronological_age_days", "pna")
        ),
        ("participant_id week age_reference | sub-01 24 DOB", {}, Facts("week", "DOB")),
        ("participant_id week age_type | sub-01 24 prenatal", {}, 24.0),
        (
            "participant_id ga | sub-01 39.4",
            {"ga": {"Description": "GA at birth, see scan_age for that at the scan"}},
            Facts("at birth"),
        ),
        (
            "participant_id pma | sub-01 39.4",
            {"pma": {"Description": "age at birth plus chronological age"}},
            39.4,
        ),
        (
            "participant_id ga | sub-01 24.4",
            {"ga": {"Description": "antenatal age, corrected by ultrasound"}},
            24.4,
        ),
        # units
        *(
            ("participant_id ga | sub-01 24", {"ga": facts}, Facts("ga", "months"))
            for facts in ({"units": "months"}, {"LongName": "GA (months)"}, "in months")
        ),
        ("participant_id ga | sub-01 24", {"ga": {"Units": "completed weeks"}}, 24.0),
        ("participant_id age age_unit | sub-01 170 days", {}, 24.29),
        ("participant_id ga days | sub-01 24 3", {}, 24.43),
        ("participant_id ga | sub-01 22wks1day", {}, 22.14),
        *(
            (f"participant_id ga | sub-01 {text}", {}, week)
            for text, week in (
                ("24w", 24.0),
                ("24.3GW", 24.3),
                ("24+3weeks", 24.43),
                ("24+3/7", 24.43),
                ("NaN", Facts("n/a")),
            )
        ),
        ("participant_id Gestational-Weeks | sub-01 24", {}, 24.0),
        ("participant_id timepoint ga | sub-01 2 24", {}, 24.0),
        (
            "participant_id gestational_age | sub-01 24",
            {"gestational_age": {"Units": "months"}},
            Facts("gestational_age", "months", SIDECAR),
        ),
        ("participant_id age | sub-01 170", {"age": {"Units": "day"}}, 24.29),
        ("participant_id age_months | sub-01 6", {}, Facts("age_months", "months")),
        (
            "participant_id ga_days | sub-01 170",
            {"ga_days": {"Units": "weeks"}},
            Facts("days", "weeks"),
        ),
        # whole ids only
        ("participant_id ga | SUB-01 22", {}, Facts("SUB-01")),
        # given twice
        (
            "participant_id ga | sub-01 22 | sub-01 28",
            {},
            Facts(22, "row 2", 28, "row 3", "session_id"),
        ),
        ("participant_id ga week | sub-01 22 28", {}, Facts("ga", 22, "week", 28)),
        ("participant_id ga ga | sub-01 22 28", {}, Facts("ga", 22, 28)),
        ("participant_id ga GA | sub-01 22 22", {}, 22.0),
        (
            "participant_id sex ga | sub-01 F 22 | sub-01 M 22",
            {},
            Facts("sex", "F", "M"),
        ),
    ],
)
def test_the_age_of_a_lone_scan_is_read_from_the_table_or_refused(
    tmp_path, rows, sidecar, age
):
    assert ages(tree(tmp_path, [LONE], {TABLE: rows}, sidecar)) == {"sub-01": age}


@pytest.mark.parametrize(
    ("labels", "tables", "expected"),
    [
        # a row for each session, under several names of the column
        *(
            (
                BOTH,
                {
                    TABLE: (
                        f"participant_id {column} gestational_age | sub-01 1 22 |"
                        " sub-01 ses-2 28"
                    )
                },
                TWO,
            )
            for column in ("session_id", "session", "ses", "visit", "Visit")
        ),
        # one age of a subject with two scans is of neither
        (
            BOTH,
            {TABLE: "participant_id ga | sub-01 22"},
            dict.fromkeys(TWO, Facts("ga 22", "row 2", "session_id")),
        ),
        # also where only one of two sessions that have no ages is on disk
        (
            [FIRST],
            {
                TABLE: "participant_id ga | sub-01 24",
                SESSIONS: "session_id sex | 1 F | 2 F",
            },
            {"sub-01_ses-1": Facts("ga 24", "row 2", "session_id 1")},
        ),
        # at the scan comes before at birth, in two tables
        (
            [FIRST],
            {
                TABLE: "participant_id gestational_age | sub-01 33.1",
                SESSIONS: "session_id scan_age | ses-1 29.4",
            },
            {"sub-01_ses-1": 29.4},
        ),
        # whole ids only
        (
            [f"sub-0{n}/ses-1/sub-0{n}_ses-1_dseg.nii.gz" for n in (1, 2)],
            {TABLE: "participant_id ga | 1 22 | 2 28"},
            {f"sub-0{n}_ses-1": Facts(f"0{n}", str(n), "row") for n in (1, 2)},
        ),
        (
            ["a/case7_dseg.nii.gz", "a/case7_b_dseg.nii.gz", "a/x/case8_dseg.nii.gz"],
            {TABLE: "participant_id ga | case7 22 | case7_b 23 | a 24 | x 25"},
            {"case7": 22.0, "case7_b": 23.0, "case8": Facts("a, x")},
        ),
        # given twice
        (
            [FIRST],
            {SESSIONS: "session_id ga | ses-1 22 | 1 28"},
            {"sub-01_ses-1": Facts(22, 28, "row 2", "row 3")},
        ),
        # tables of sessions
        (
            [FIRST],
            {
                TABLE: "participant_id ga | sub-01 22",
                SESSIONS: "session_id age | ses-1 24",
            },
            {"sub-01_ses-1": Facts("age", "no unit", "sub-01_sessions.json")},
        ),
        (
            ["derivatives/seg/" + FIRST],
            {
                TABLE: "participant_id ga | sub-01 22",
                "derivatives/seg/" + SESSIONS: "session_id ga | 1 24",
            },
            {"sub-01_ses-1": 24.0},
        ),
        (
            BOTH,
            {
                "sessions.tsv": (
                    "participant_id session_id ga | 01 1 22 | sub-01 ses-2 28"
                )
            },
            TWO,
        ),
        (
            [FIRST],
            {
                SESSIONS: "session_id scan_age | 1 22",
                "sessions.tsv": "participant_id session_id scan_age | 01 1 28",
            },
            {"sub-01_ses-1": Facts(22, 28, "sub-01_sessions.tsv", "sessions.tsv")},
        ),
        # formats
        (
            [LONE],
            {"participants.csv": "participant_id;Sex;Age | sub-01;F;24"},
            {"sub-01": Facts("Age", "no unit")},
        ),
        # a data set that has ages at the scan has others at birth
        (
            ["sub-01_dseg.nii.gz", "sub-02_dseg.nii.gz"],
            {TABLE: "participant_id ga scan_age | sub-01 33.1 29.4 | sub-02 35 n/a"},
            {"sub-01": 29.4, "sub-02": Facts("ga 35", "scan_age")},
        ),
        (
            ["sub-01/ses-1/sub-01_ses-1_dseg.nii.gz", "sub-02/sub-02_dseg.nii.gz"],
            {
                TABLE: "participant_id ga | sub-01 33.1 | sub-02 39",
                SESSIONS: "session_id scan_age | 1 29.4",
            },
            {"sub-01_ses-1": 29.4, "sub-02": Facts("ga 39", "scan_age")},
        ),
        # ids end where the next part begins
        (
            ["sub-01-A_dseg.nii.gz"],
            {TABLE: "participant_id ga | sub-01 22 | sub-01-A 28"},
            {"sub-01-A": 28.0},
        ),
        (
            ["case01_dseg.nii.gz"],
            {TABLE: "participant_id ga | case1 22"},
            {"case01": Facts("case1", "row 2")},
        ),
        # tables of the same data set, wherever they lie
        (
            ["derivatives/seg/" + FIRST],
            {
                TABLE: "participant_id ga | sub-01 33",
                "rawdata/" + SESSIONS: "session_id ga | 1 22",
            },
            {"sub-01_ses-1": 22.0},
        ),
        (
            [FIRST],
            {
                TABLE: "participant_id ga | sub-01 33",
                "sub-01/ses-1/sub-01_ses-1_scans.tsv": (
                    "filename scan_age | anat/a.nii.gz 24 | anat/b.nii.gz 24"
                ),
            },
            {"sub-01_ses-1": 24.0},
        ),
        (
            [FIRST],
            {
                TABLE: "participant_id ga | sub-01 33",
                SESSIONS: "participant_id session_id ga | sub-02 1 22",
            },
            {"sub-01_ses-1": Facts("sub-02", "sub-01")},
        ),
        # the name of the file and the table
        (
            ["sub-01_GA-26_dseg.nii.gz"],
            {TABLE: "participant_id ga | sub-01 26.4"},
            {"sub-01": 26.4},
        ),
        (
            ["sub-01_GA-26_dseg.nii.gz"],
            {TABLE: "participant_id ga | sub-01 28"},
            {"sub-01": Facts(28, "26", "participants.tsv")},
        ),
    ],
)
def test_an_age_is_that_of_exactly_this_scan(tmp_path, labels, tables, expected):
    assert ages(tree(tmp_path, labels, tables)) == expected


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
    (found,) = ages(make_tree(tmp_path, labels=[f"a/{name}_dseg.nii.gz"])).values()
    assert found == age


@pytest.mark.parametrize(
    ("text", "age"),
    [
        ("Participant ID;Gestational age (weeks)\nsub-01;24,5", 24.5),
        ('"participant_id","GA"\n"sub-01","24.5"', 24.5),
        ("participant_id, GA \r\nsub-01 , 24+3\r\n", 24.43),
        ("participant_id,ga\nsub-01,24,5", Facts("row 2", 3, 2)),
        ("name,ga\nsub-01,24", Facts("participants.csv", "participant_id")),
    ],
)
def test_tables_are_read_with_their_separators(tmp_path, text, age):
    assert ages(
        make_tree(tmp_path, labels=[LONE], text={"participants.csv": text})
    ) == {"sub-01": age}


def test_tables_whose_content_is_not_here_are_not_passed_over(tmp_path):
    make_tree(
        tmp_path,
        labels=[FIRST],
        tables={TABLE: ["participant_id ga", "sub-01 22"]},
        lost=[SESSIONS],
    )
    assert ages(tmp_path) == {"sub-01_ses-1": Facts(tmp_path / SESSIONS)}


@pytest.mark.parametrize("place", ["table", "names"])
def test_decimals_that_may_be_days_are_asked_for_once(tmp_path, place):
    texts = ("24.3", "25.1", "26.6")
    names = [
        f"sub-0{number}" if place == "table" else f"week{text}"
        for number, text in enumerate(texts)
    ]
    rows = [f"{name} {text}" for name, text in zip(names, texts, strict=True)]
    tables = {TABLE: ["participant_id ga", *rows]} if place == "table" else {}
    make_tree(tmp_path, labels=[f"{name}_dseg.nii.gz" for name in names], tables=tables)
    with pytest.raises(
        InputError, check=Facts("24.3", "--decimal-weeks", "--weeks-days")
    ):
        ages(tmp_path)
    assert list(ages(tmp_path, notation="decimal").values()) == [24.3, 25.1, 26.6]
    assert list(ages(tmp_path, notation="days").values()) == [24.43, 25.14, 26.86]
    if place == "table":
        (tmp_path / TABLE).write_text(
            "participant_id\tga\nsub-00\t24.5\nsub-01\t25.0\nsub-02\t26.5\n"
        )
        assert list(ages(tmp_path).values()) == [24.5, 25.0, 26.5]


def test_the_age_at_birth_is_said_beside_that_of_the_scan(tmp_path):
    make_tree(
        tmp_path,
        labels=[LONE],
        tables={TABLE: ["participant_id ga scan_age", "sub-01 33.1 29.4"]},
    )
    (brain,) = recognise(tmp_path).brains
    assert brain.age_source == Facts(TABLE, "scan_age", "ga", 33.1, "birth")


def test_a_participant_that_is_not_there_is_refused(tmp_path):
    make_tree(tmp_path, labels=[LONE])
    with pytest.raises(InputError, check=Facts("sub-1", "sub-01")):
        recognise(tmp_path, participants=["1"])
