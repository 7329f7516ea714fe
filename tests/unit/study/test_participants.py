"""A cohort's table becomes brains; rows that can't be used are problems, or left out with their cause."""

import pytest

from gyriflow.errors import InputError
from gyriflow.study import resolve
from gyriflow.study.loading import load

FOLDING = {"end_week": 26}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "bids").mkdir()
    for name in ("a.nii.gz", "lh.surf.gii", "rh.surf.gii", "sub-9;T2_dseg.nii.gz"):
        (tmp_path / "bids" / name).touch()
    return tmp_path


def write(folder, *rows):
    text = "\n".join("\t".join(row) for row in rows)
    (folder / "bids" / "participants.tsv").write_text(text + "\n")


def config(folder, participants="bids/participants.tsv", **more):
    raw = {"participants": participants, "start": "sub-1", "folding": FOLDING}
    return load(raw, folder, **more)


def test_rows_are_brains_whatever_their_files_are_of(folder):
    write(
        folder,
        ("participant_id", "sex", "week", "files", "side", "scheme", "population", "white"),
        ("sub-1", "F", "24.5", "a.nii.gz", "n/a", "feta-7", "n/a", "n/a"),
        ("sub-2", "M", "25", "rh.surf.gii; lh.surf.gii", "n/a", "n/a", "twins", "rh.surf.gii; lh.surf.gii"),
        ("sub-3", "M", "25", "a.nii.gz", "left", "feta-7", "n/a", "n/a"),
    )
    brains = {brain.id: brain for brain in config(folder).brains}
    assert brains["sub-1"].labels == str(folder / "bids" / "a.nii.gz")
    assert (brains["sub-1"].week, brains["sub-1"].scheme, brains["sub-1"].population) == (24.5, "feta-7", None)
    assert brains["sub-2"].source == "hemispheres"
    assert brains["sub-2"].population == "twins"
    assert list(brains["sub-2"].white) == [str(folder / "bids" / f"{side}.surf.gii") for side in ("rh", "lh")]
    assert brains["sub-1"].covariates == {"sex": "F"}
    assert brains["sub-3"].sides == ("left",)
    assert brains["sub-3"].label_volume == str(folder / "bids" / "a.nii.gz")


def test_values_for_all_rows_stand_in_the_configuration(folder):
    write(folder, ("id", "gestational_age"), ("sub-9", "24"))
    section = {
        "file": "bids/participants.tsv",
        # a semicolon in the name of a file that no other stands beside
        "columns": {"labels": "{id};T2_dseg.nii.gz", "scheme": "feta-7"},
    }
    (brain,) = load({"participants": section, "start": "sub-9", "folding": FOLDING}, folder).brains
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
    with pytest.raises(InputError, match=r"4 problems(.|\n)*sub-2: gestational_age: found n/a(.|\n)*with --keep-going"):
        config(folder)
    found = config(folder, keep_going=True)
    assert [brain.id for brain in found.brains] == ["sub-1"]
    causes = {name: row["cause"] for name, row in found.left_out.items()}
    assert list(causes) == ["sub-2", "sub-3", "sub-4", "sub-5"]
    assert "found 170; expected gestational weeks" in causes["sub-3"]
    assert "no such file" in causes["sub-4"]
    assert "found no data" in causes["sub-5"]
    write(folder, head, ("sub-1", "n/a", "a.nii.gz", "feta-7"))
    with pytest.raises(InputError, match="found n/a"):
        config(folder, keep_going=True)


@pytest.mark.parametrize(
    ("head", "said"),
    [
        (("subject", "week", "labels"), "has no column of ids; found subject, week, labels"),
        (("id", "months", "labels"), "has no column of gestational ages"),
        (("id", "week", "label", "scheme"), "has a column that seems mistyped; found label; expected labels"),
    ],
)
def test_tables_without_what_is_needed_are_refused(folder, head, said):
    write(folder, head, ["x"] * len(head))
    with pytest.raises(InputError, match=said):
        config(folder)


@pytest.mark.parametrize(
    ("column", "text", "week"),
    [
        ("week", "24.3", 24.3),
        ("gestational_age", "24+3", 24.43),
        ("age_weeks", "25w2d", 25.29),
        ("gestational_age_days", "170", 24.29),
    ],
)
def test_ages_are_read_as_they_are_written(folder, column, text, week):
    # the mother's age, which names no unit, is none of the brain's
    write(folder, ("id", "age", column, "labels", "scheme"), ("sub-1", "31", text, "a.nii.gz", "feta-7"))
    assert config(folder).brains[0].week == week


def test_an_age_has_its_unit_in_the_sidecar_or_is_refused_by_file_and_column(folder):
    write(folder, ("id", "age", "labels", "scheme"), ("sub-1", "170", "a.nii.gz", "feta-7"))
    with pytest.raises(InputError, match=r"participants\.tsv: has no column of gestational ages(.|\n)*found id, age"):
        config(folder)
    sidecar = folder / "bids" / "participants.json"
    sidecar.write_text('{"age": {"Units": "days"}}')
    assert config(folder).brains[0].week == 24.29
    sidecar.write_text('{"age": {"Units": "years"}}')
    with pytest.raises(InputError, match="has no column of gestational ages"):
        config(folder)
    write(folder, ("id", "week", "labels", "scheme"), ("sub-1", "24 weeks", "a.nii.gz", "feta-7"))
    with pytest.raises(InputError, match=r"participants\.tsv: sub-1: week: found 24 weeks; expected the gestational"):
        config(folder)


def test_a_participant_has_a_brain_for_each_session(folder):
    write(folder, ("participant_id", "sex"), ("sub-1", "F"), ("sub-2", "M"))
    for name, ages in (("sub-1", ("21.5", "24.5")), ("sub-2", ("22.5", "23.5"))):
        place = folder / "bids" / name
        place.mkdir()
        rows = "".join(f"ses-{number}\t{age}\n" for number, age in enumerate(ages, 1))
        (place / f"{name}_sessions.tsv").write_text(f"session_id\tgestational_age\n{rows}")
        for number in (1, 2):
            (place / f"ses-{number}").mkdir()
            (place / f"ses-{number}" / f"{name}_ses-{number}_dseg.nii.gz").touch()
    section = {
        "file": "bids/participants.tsv",
        "columns": {"labels": "{subject}/{session}/{id}_dseg.nii.gz", "scheme": "feta-7"},
    }
    found = load({"participants": section, "start": "sub-1_ses-1", "folding": FOLDING}, folder)
    assert [(brain.id, brain.week, brain.subject) for brain in found.brains] == [
        ("sub-1_ses-1", 21.5, "sub-1"),
        ("sub-1_ses-2", 24.5, "sub-1"),
        ("sub-2_ses-1", 22.5, "sub-2"),
        ("sub-2_ses-2", 23.5, "sub-2"),
    ]
    assert resolve(found).scans == {"sub-1": ["sub-1_ses-1", "sub-1_ses-2"], "sub-2": ["sub-2_ses-1", "sub-2_ses-2"]}
