"""A cohort's table becomes brains; rows that can't be used are problems, or left out
with their cause. Ages are tested in `unit/cli/test_scan_ages.py`."""

from pathlib import Path

import pytest
from configurations import problems, refusal, touched
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.study import resolve
from gyriflow.study.loading import load

TABLE = "bids/participants.tsv"
RAW = {"participants": TABLE, "start": "first", "folding": {"end_week": 26}}


@pytest.fixture
def folder(tmp_path):
    names = ("a.nii.gz", "l.gii", "r.gii", "sub-9;T2_dseg.nii.gz")
    touched(tmp_path / "bids", *names)
    return tmp_path


def write(folder, *rows, file="participants.tsv"):
    """Write a table of rows, in which spaces are between cells."""
    path = folder / "bids" / file
    path.write_text("".join("\t".join(row.split()) + "\n" for row in rows))


def brains(folder, **columns):
    """Return the brains of the table, with columns for all rows."""
    section = {"file": TABLE, "columns": columns}
    return load(RAW | {"participants": section}, folder).brains


def test_rows_are_brains_whatever_their_files_are_of(folder):
    write(
        folder,
        "participant_id sex week files       side scheme population white",
        "sub-1          F   24.5 a.nii.gz    n/a  feta-7 n/a        n/a",
        "sub-2          M   25   r.gii;l.gii n/a  n/a    twins      r.gii;l.gii",
        "sub-3          M   25   a.nii.gz    left feta-7 n/a        n/a",
    )
    first, second, third = brains(folder)
    assert (first.id, first.week, first.scheme) == ("sub-1", 24.5, "feta-7")
    assert first.labels == str(folder / "bids" / "a.nii.gz")
    assert first.population is None
    assert first.covariates == {"sex": "F"}
    assert (second.source, second.population) == ("hemispheres", "twins")
    assert [Path(file).name for file in second.white] == ["r.gii", "l.gii"]
    assert third.sides == ("left",)
    assert third.labels == str(folder / "bids" / "a.nii.gz")


def test_values_for_all_rows_stand_in_the_configuration(folder):
    write(folder, "id gestational_age", "sub-9 24")
    # a semicolon in the name of a file that no other stands beside
    (brain,) = brains(folder, labels="{id};T2_dseg.nii.gz", scheme="feta-7")
    assert brain.labels == str(folder / "bids" / "sub-9;T2_dseg.nii.gz")


def test_rows_that_cannot_be_used_are_problems_or_left_out_with_their_cause(folder):
    write(
        folder,
        "participant_id gestational_age labels      scheme",
        "sub-1          24              a.nii.gz    feta-7",
        "sub-2          n/a             a.nii.gz    feta-7",
        "sub-3          170             a.nii.gz    feta-7",
        "sub-4          24              none.nii.gz feta-7",
        "sub-5          24              n/a         feta-7",
    )
    assert problems(RAW, folder) == [
        Facts("participants.tsv:", f"sub-{number}:") for number in range(2, 6)
    ]
    assert refusal(RAW, folder) == Facts("--keep-going")
    found = load(RAW, folder, keep_going=True)
    assert [brain.id for brain in found.brains] == ["sub-1"]
    causes = {name: row["cause"] for name, row in found.left_out.items()}
    assert causes == {
        "sub-2": Facts("gestational_age:", "n/a"),
        "sub-3": Facts("gestational_age:", 170, 15, 45),
        "sub-4": Facts("labels:", folder / "bids" / "none.nii.gz"),
        "sub-5": Facts("sub-5:", "labels, image, pial, white"),
    }


def test_a_table_without_any_usable_row_says_why(folder):
    write(folder, "id gestational_age labels scheme", "sub-1 n/a a.nii.gz feta-7")
    # the row says why there is no brain
    assert problems(RAW, folder) == [Facts("sub-1: gestational_age:", "n/a")]
    with pytest.raises(InputError, check=Facts("sub-1: gestational_age:", "n/a")):
        load(RAW, folder, keep_going=True)


@pytest.mark.parametrize(
    ("head", "facts"),
    [
        ("subject week labels", ["subject, week, labels", "participant_id"]),
        ("id months labels", ["id, months, labels", "gestational_age"]),
        ("id week label scheme", ["label", "labels"]),
        ("participant_id Participant-ID week", ["participant_id", "Participant-ID"]),
        ("id session_id Session-ID week", ["session_id", "Session-ID"]),
    ],
)
def test_a_table_with_wrong_columns_is_refused(folder, head, facts):
    write(folder, head, " ".join(["1"] * len(head.split())))
    assert refusal(RAW, folder) == Facts(folder / TABLE, *facts)


def test_an_age_has_its_unit_in_the_sidecar_of_its_data_set(folder):
    write(folder, "id ga labels scheme", "sub-1 170 a.nii.gz feta-7")
    outside = folder / "participants.json"
    outside.write_text('{"ga": {"Units": "days"}}')
    assert refusal(RAW, folder) == Facts("participants.tsv: sub-1: ga:", 170)
    outside.rename(folder / "bids" / "participants.json")
    assert brains(folder)[0].week == 24.29


VISITS = (
    "participant_id visit gestational_age scan_age labels   scheme",
    "sub-1          1     33.1            22.3     1.nii.gz feta-7",
    "sub-1          2     33.1            28.1     2.nii.gz feta-7",
)


@pytest.fixture
def visits(folder):
    touched(folder / "bids", "1.nii.gz", "2.nii.gz")
    return folder


def test_visits_are_brains_with_their_ages_at_the_scan(visits):
    write(visits, *VISITS)
    found = load(RAW, visits)
    assert [(brain.id, brain.week) for brain in found.brains] == [
        ("sub-1_ses-1", 22.3),
        ("sub-1_ses-2", 28.1),
    ]
    assert found.age_sources["sub-1_ses-1"] == Facts(
        "participants.tsv", "scan_age", "gestational_age", 33.1
    )


@pytest.mark.parametrize(
    ("row", "facts"),
    [
        ("sub-1 3 33.1 28.9 2.nii.gz", ["sub-1_ses-2", "sub-1_ses-3", "same files"]),
        ("sub-1 1 33.1 22.8 1.nii.gz", ["sub-1_ses-1", 22.3, 22.8, "row 2", "row 4"]),
        ("sub-2 1 33.1 26.6 1.nii.gz", ["participants.ages", "decimal", "days"]),
    ],
)
def test_visits_that_are_unclear_are_refused(visits, row, facts):
    write(visits, *VISITS, f"{row} feta-7")
    assert refusal(RAW, visits) == Facts(*facts)


def test_ages_are_weeks_and_days_if_the_configuration_says_so(visits):
    write(visits, *VISITS)
    days = RAW | {"participants": {"file": TABLE, "ages": "days"}}
    assert [brain.week for brain in load(days, visits).brains] == [22.43, 28.14]
    (visits / "bids" / "sub-1").mkdir()
    (visits / "bids" / "sub-1" / "sub-1_sessions.tsv").symlink_to("nowhere")
    assert refusal(days, visits) == Facts("sub-1_ses-1", "sub-1_sessions.tsv")


def test_a_participant_has_a_brain_for_each_session_in_the_order_of_weeks(folder):
    write(folder, "participant_id sex", "sub-1 F", "sub-2 M")
    for name, ages in (("sub-1", ("24.5", "21.5")), ("sub-2", ("22.5", "23.5"))):
        for number in (1, 2):
            scan = f"{name}/ses-{number}/{name}_ses-{number}_dseg.nii.gz"
            touched(folder / "bids", scan)
        rows = [f"ses-{number} {age}" for number, age in enumerate(ages, 1)]
        file = f"{name}/{name}_sessions.tsv"
        write(folder, "session_id gestational_age", *rows, file=file)
    labels = "{subject}/{session}/{id}_dseg.nii.gz"
    section = {"file": TABLE, "columns": {"labels": labels, "scheme": "feta-7"}}
    found = load(RAW | {"participants": section}, folder)
    assert [(brain.id, brain.week, brain.subject) for brain in found.brains] == [
        ("sub-1_ses-1", 24.5, "sub-1"),
        ("sub-1_ses-2", 21.5, "sub-1"),
        ("sub-2_ses-1", 22.5, "sub-2"),
        ("sub-2_ses-2", 23.5, "sub-2"),
    ]
    assert resolve(found).scans == {
        "sub-1": ["sub-1_ses-2", "sub-1_ses-1"],
        "sub-2": ["sub-2_ses-1", "sub-2_ses-2"],
    }


@pytest.mark.parametrize("place", ["sub-x", "sub-x/a/b"])
def test_a_table_of_participants_in_a_folder_of_one_subject_has_any_participants(
    tmp_path, place
):
    folder = tmp_path / place
    touched(folder / "bids", "a.nii.gz")
    rows = ("sub-1 24.5 a.nii.gz feta-7", "sub-2 25 a.nii.gz feta-7")
    write(folder, "participant_id scan_age files scheme", *rows)
    assert [brain.id for brain in brains(folder)] == ["sub-1", "sub-2"]


def test_ids_and_values_of_a_table_keep_their_text(folder):
    names = ["021", "7", "1e5", "NA", "None", "true", "1.0", "2024-01-01"]
    rows = [f"{name} 22 {name} a.nii.gz feta-7" for name in names]
    write(folder, "participant_id week code files scheme", *rows)
    found = brains(folder)
    assert [brain.id for brain in found] == [brain.subject for brain in found] == names
    # these are missing values of BIDS, R and Python
    assert {brain.id: brain.covariates.get("code") for brain in found} == {
        name: None if name in ("NA", "None") else name for name in names
    }


def test_one_participant_with_two_names_is_refused_with_both(folder):
    rows = ("sub-01 21 a.nii.gz", "01 22 l.gii;r.gii")
    write(folder, "participant_id week files", *rows)
    assert refusal(RAW, folder) == Facts("participants.tsv:", "sub-01 and 01")
