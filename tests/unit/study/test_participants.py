"""A cohort's table becomes brains; rows that can't be used are problems, or left out
with their cause."""

import pytest
from configurations import problems, refusal
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.study import resolve
from gyriflow.study.loading import load

FOLDING = {"end_week": 26}
RAW = {"participants": "bids/participants.tsv", "start": "sub-1", "folding": FOLDING}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "bids").mkdir()
    for name in ("a.nii.gz", "lh.surf.gii", "rh.surf.gii", "sub-9;T2_dseg.nii.gz"):
        (tmp_path / "bids" / name).touch()
    return tmp_path


def write(folder, *rows):
    text = "\n".join("\t".join(row) for row in rows)
    (folder / "bids" / "participants.tsv").write_text(text + "\n")


def config(folder, **more):
    return load(RAW, folder, **more)


def test_rows_are_brains_whatever_their_files_are_of(folder):
    write(
        folder,
        (
            "participant_id",
            "sex",
            "week",
            "files",
            "side",
            "scheme",
            "population",
            "white",
        ),
        ("sub-1", "F", "24.5", "a.nii.gz", "n/a", "feta-7", "n/a", "n/a"),
        (
            "sub-2",
            "M",
            "25",
            "rh.surf.gii; lh.surf.gii",
            "n/a",
            "n/a",
            "twins",
            "rh.surf.gii; lh.surf.gii",
        ),
        ("sub-3", "M", "25", "a.nii.gz", "left", "feta-7", "n/a", "n/a"),
    )
    brains = {brain.id: brain for brain in config(folder).brains}
    assert brains["sub-1"].labels == str(folder / "bids" / "a.nii.gz")
    assert (
        brains["sub-1"].week,
        brains["sub-1"].scheme,
        brains["sub-1"].population,
    ) == (24.5, "feta-7", None)
    assert brains["sub-2"].source == "hemispheres"
    assert brains["sub-2"].population == "twins"
    assert list(brains["sub-2"].white) == [
        str(folder / "bids" / f"{side}.surf.gii") for side in ("rh", "lh")
    ]
    assert brains["sub-1"].covariates == {"sex": "F"}
    assert brains["sub-3"].sides == ("left",)
    assert brains["sub-3"].labels == str(folder / "bids" / "a.nii.gz")


def test_values_for_all_rows_stand_in_the_configuration(folder):
    write(folder, ("id", "gestational_age"), ("sub-9", "24"))
    section = {
        "file": "bids/participants.tsv",
        # a semicolon in the name of a file that no other stands beside
        "columns": {"labels": "{id};T2_dseg.nii.gz", "scheme": "feta-7"},
    }
    (brain,) = load(
        {"participants": section, "start": "sub-9", "folding": FOLDING}, folder
    ).brains
    assert brain.labels == str(folder / "bids" / "sub-9;T2_dseg.nii.gz")


def test_rows_that_cannot_be_used_are_problems_or_left_out_with_their_cause(folder):
    head = ("participant_id", "gestational_age", "labels", "scheme")
    write(
        folder,
        head,
        ("sub-1", "24", "a.nii.gz", "feta-7"),
        ("sub-2", "n/a", "a.nii.gz", "feta-7"),
        ("sub-3", "170", "a.nii.gz", "feta-7"),
        ("sub-4", "24", "none.nii.gz", "feta-7"),
        ("sub-5", "24", "n/a", "feta-7"),
    )
    assert problems(RAW, folder) == [
        Facts("participants.tsv:", f"sub-{number}:") for number in range(2, 6)
    ]
    assert refusal(RAW, folder) == Facts("--keep-going")
    found = config(folder, keep_going=True)
    assert [brain.id for brain in found.brains] == ["sub-1"]
    causes = {name: row["cause"] for name, row in found.left_out.items()}
    assert causes == {
        "sub-2": Facts("gestational_age:", "n/a"),
        "sub-3": Facts("gestational_age:", 170, 15, 45),
        "sub-4": Facts("labels:", folder / "bids" / "none.nii.gz"),
        "sub-5": Facts("sub-5:", "labels, image, pial, white"),
    }
    write(folder, head, ("sub-1", "n/a", "a.nii.gz", "feta-7"))
    with pytest.raises(InputError, check=Facts("sub-1: gestational_age:", "n/a")):
        config(folder, keep_going=True)
    # the row says why there is no brain
    (problem,) = problems(RAW, folder)
    assert problem == Facts("sub-1:")


@pytest.mark.parametrize(
    ("head", "facts"),
    [
        (("subject", "week", "labels"), ["subject, week, labels", "participant_id"]),
        (("id", "months", "labels"), ["id, months, labels", "gestational_age"]),
        (("id", "week", "label", "scheme"), ["label", "labels"]),
    ],
)
def test_tables_without_what_is_needed_are_refused(folder, head, facts):
    write(folder, head, ["x"] * len(head))
    with pytest.raises(
        InputError, check=Facts(folder / "bids" / "participants.tsv", *facts)
    ):
        config(folder)


@pytest.mark.parametrize(
    ("column", "text", "week"),
    [
        ("week", "24.3", 24.3),
        ("gestational_age", "24+3", 24.43),
        ("scan_age_weeks", "25w2d", 25.29),
        ("gestational_age_days", "170", 24.29),
    ],
)
def test_ages_are_read_as_they_are_written(folder, column, text, week):
    write(
        folder,
        ("id", "maternal_age", column, "labels", "scheme"),
        ("sub-1", "31", text, "a.nii.gz", "feta-7"),
    )
    assert config(folder).brains[0].week == week


def test_an_age_has_its_unit_in_the_sidecar_of_its_data_set(folder):
    write(
        folder,
        ("id", "ga", "labels", "scheme"),
        ("sub-1", "170", "a.nii.gz", "feta-7"),
    )
    outside = folder / "participants.json"
    outside.write_text('{"ga": {"Units": "days"}}')
    assert refusal(RAW, folder) == Facts("participants.tsv: sub-1: ga:", 170)
    outside.rename(folder / "bids" / "participants.json")
    assert config(folder).brains[0].week == 24.29


def test_ages_of_a_table_follow_the_rules_of_a_data_set(folder):
    head = (
        "participant_id",
        "visit",
        "gestational_age",
        "scan_age",
        "labels",
        "scheme",
    )
    for number in (1, 2):
        (folder / "bids" / f"{number}.nii.gz").touch()
    visits = (("1", "22.3"), ("2", "28.1"))
    rows = [
        ("sub-1", visit, "33.1", age, f"{visit}.nii.gz", "feta-7")
        for visit, age in visits
    ]
    write(folder, head, *rows)
    found = load(RAW | {"start": "first"}, folder)
    assert [(brain.id, brain.week) for brain in found.brains] == [
        ("sub-1_ses-1", 22.3),
        ("sub-1_ses-2", 28.1),
    ]
    assert found.age_sources["sub-1_ses-1"] == Facts(
        "participants.tsv", "scan_age", "gestational_age", 33.1
    )
    same = [(*row[:4], "a.nii.gz", row[-1]) for row in rows]
    write(folder, head, *same)
    assert refusal(RAW, folder) == Facts("sub-1_ses-1", "sub-1_ses-2", "same files")
    write(folder, head, *rows, ("sub-1", "1", "33.1", "22.8", "a.nii.gz", "feta-7"))
    assert refusal(RAW, folder) == Facts(
        "sub-1_ses-1", "scan_age", 22.3, 22.8, "row 2", "row 4"
    )
    write(folder, head, *rows, ("sub-2", "1", "33.1", "26.6", "a.nii.gz", "feta-7"))
    assert refusal(RAW, folder) == Facts("participants.ages", "decimal", "days")
    days = {"file": "bids/participants.tsv", "ages": "days"}
    found = load(RAW | {"participants": days, "start": "first"}, folder)
    assert [brain.week for brain in found.brains] == [22.43, 28.14, 26.86]
    (folder / "bids" / "sub-2").mkdir()
    (folder / "bids" / "sub-2" / "sub-2_sessions.tsv").symlink_to("nowhere")
    assert refusal(RAW | {"participants": days}, folder) == Facts(
        "sub-2_ses-1", "sub-2_sessions.tsv"
    )


def test_a_participant_has_a_brain_for_each_session(folder):
    write(folder, ("participant_id", "sex"), ("sub-1", "F"), ("sub-2", "M"))
    for name, ages in (("sub-1", ("21.5", "24.5")), ("sub-2", ("22.5", "23.5"))):
        place = folder / "bids" / name
        place.mkdir()
        rows = "".join(f"ses-{number}\t{age}\n" for number, age in enumerate(ages, 1))
        (place / f"{name}_sessions.tsv").write_text(
            f"session_id\tgestational_age\n{rows}"
        )
        for number in (1, 2):
            (place / f"ses-{number}").mkdir()
            (place / f"ses-{number}" / f"{name}_ses-{number}_dseg.nii.gz").touch()
    section = {
        "file": "bids/participants.tsv",
        "columns": {
            "labels": "{subject}/{session}/{id}_dseg.nii.gz",
            "scheme": "feta-7",
        },
    }
    found = load(
        {"participants": section, "start": "sub-1_ses-1", "folding": FOLDING}, folder
    )
    assert [(brain.id, brain.week, brain.subject) for brain in found.brains] == [
        ("sub-1_ses-1", 21.5, "sub-1"),
        ("sub-1_ses-2", 24.5, "sub-1"),
        ("sub-2_ses-1", 22.5, "sub-2"),
        ("sub-2_ses-2", 23.5, "sub-2"),
    ]
    assert resolve(found).scans == {
        "sub-1": ["sub-1_ses-1", "sub-1_ses-2"],
        "sub-2": ["sub-2_ses-1", "sub-2_ses-2"],
    }


@pytest.mark.parametrize("place", ["sub-x", "sub-x/study", "sub-x/a/b"])
def test_a_table_of_participants_in_a_folder_of_one_subject_has_any_participants(
    tmp_path, place
):
    (tmp_path / place / "bids").mkdir(parents=True)
    (tmp_path / place / "bids" / "a.nii.gz").touch()
    head = ("participant_id", "scan_age", "files", "scheme")
    write(
        tmp_path / place,
        head,
        ("sub-1", "24.5", "a.nii.gz", "feta-7"),
        ("sub-2", "25", "a.nii.gz", "feta-7"),
    )
    assert {brain.id: brain.week for brain in config(tmp_path / place).brains} == {
        "sub-1": 24.5,
        "sub-2": 25,
    }


def test_ids_and_values_of_a_table_keep_their_text(folder):
    names = ["021", "7", "1e5", "NA", "None", "true", "1.0", "2024-01-01"]
    rows = [
        (name, str(22 + number), name, "a.nii.gz", "feta-7")
        for number, name in enumerate(names)
    ]
    write(folder, ("participant_id", "week", "code", "files", "scheme"), *rows)
    brains = load(RAW | {"start": "021", "folding": {"end_week": 24}}, folder).brains
    assert [(brain.id, brain.subject, brain.week) for brain in brains] == [
        (name, name, 22 + number) for number, name in enumerate(names)
    ]
    # these are missing values of BIDS, R and Python
    assert {brain.id: brain.covariates.get("code") for brain in brains} == {
        name: None if name in ("NA", "None") else name for name in names
    }


def test_one_participant_with_two_names_is_refused_with_both(folder):
    rows = (
        ("sub-01", "21", "a.nii.gz", "feta-7"),
        ("01", "22", "lh.surf.gii; rh.surf.gii", "n/a"),
    )
    write(folder, ("participant_id", "week", "files", "scheme"), *rows)
    with pytest.raises(InputError, check=Facts("participants.tsv:", "sub-01 and 01")):
        config(folder)


@pytest.mark.parametrize(
    "columns", [("participant_id", "Participant ID"), ("session_id", "Session-ID")]
)
def test_two_columns_of_ids_with_one_name_are_refused(folder, columns):
    further = {"id": "x", "week": "21", "files": "a.nii.gz", "scheme": "feta-7"}
    write(folder, (*columns, *further), ("1", "1", *further.values()))
    with pytest.raises(InputError, check=Facts("participants.tsv:", *columns)):
        config(folder)


def test_scans_of_a_subject_are_in_the_order_of_their_weeks_not_of_their_names(folder):
    rows = [
        ("sub-1", session, week, "a.nii.gz")
        for session, week in (("b", "23.4"), ("c", "21.5"), ("a", "24+6"))
    ]
    write(folder, ("participant_id", "session_id", "scan_age", "labels"), *rows)
    section = {
        "file": "bids/participants.tsv",
        "columns": {"scheme": "feta-7", "image": "{id}.nii.gz"},
    }
    for session in "abc":
        (folder / "bids" / f"sub-1_ses-{session}.nii.gz").touch()
    assert refusal(RAW | {"participants": section, "start": "first"}, folder) == Facts(
        "the same files"
    )
    write(
        folder, ("participant_id", "session_id", "scan_age"), *(row[:3] for row in rows)
    )
    section["columns"] = {"labels": "{id}.nii.gz", "scheme": "feta-7"}
    found = load(
        {"participants": section, "start": "first", "folding": FOLDING}, folder
    )
    assert resolve(found).scans == {
        "sub-1": ["sub-1_ses-c", "sub-1_ses-b", "sub-1_ses-a"]
    }
