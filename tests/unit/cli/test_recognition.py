"""Which files are recognised as brains: names of atlases, sides, ages, label schemes,
participants."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from configurations import touched
from facts import Facts
from scan_trees import make_tree
from shapes import sphere

from gyriflow.cli.commands import main
from gyriflow.cli.init import write_configuration
from gyriflow.cli.recognition import (
    UNSET,
    FoundBrain,
    recognise,
    scheme_fits,
    scheme_reasons,
)
from gyriflow.errors import InputError
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import write_surface
from gyriflow.io.volumes import LabelVolume, read_label_volume, write_label_volume
from gyriflow.running import launch
from gyriflow.shipped import SHIPPED
from gyriflow.study import resolve
from gyriflow.study.loading import load

ATLAS = SHIPPED / "atlases" / "spina-bifida"
LABELS = ATLAS / "fetal_SB_atlas_GA21_notoperated" / "parcellation.nii.gz"


def sided(labels):
    """Return labels of the spina bifida atlas as those of dHCP's, left and right of the
    middle."""
    left = (
        np.indices(labels.shape)[0]
        < np.argwhere(np.isin(labels, (1, 2, 5, 6, 8)))[:, 0].mean()
    )
    pairs = {
        1: (5, 6),
        2: (7, 8),
        3: (11, 12),
        4: (1, 2),
        5: (3, 4),
        6: (14, 15),
        7: (10, 10),
        8: (9, 9),
    }
    return sum(
        np.where(labels == own, np.where(left, *pair), 0) for own, pair in pairs.items()
    )


# the numbers of each scheme for white matter, ventricles, cerebellum, outer CSF,
# cortex, deep grey, brainstem, callosum
NUMBERS = {
    "feta-7": (3, 4, 5, 1, 2, 6, 7, 3),
    "drawem-9": (3, 5, 6, 1, 2, 7, 8, 9),
    "freesurfer": (2, 4, 8, 24, 3, 10, 16, 251),
    "crl": (120, 92, 100, 124, 112, 77, 94, 91),
    "multi-bounti-43": (13, 39, 28, 37, 1, 35, 27, 25),
    "spina-bifida-atlas": (1, 2, 3, 4, 5, 6, 7, 8),
    "binary": (1, 1, 0, 0, 1, 1, 0, 1),
}


def renumbered(labels, scheme):
    return np.array([0, *NUMBERS[scheme]])[labels]


def fitting(labels):
    return [name for name, against in scheme_fits(labels).items() if not against]


def test_the_scheme_is_found_by_where_labels_lie():
    labels = read_label_volume(LABELS, cropped=True).labels
    for scheme in NUMBERS:
        assert fitting(renumbered(labels, scheme)) == [scheme]
        # a brain without its surroundings
        assert fitting(
            renumbered(np.where(np.isin(labels, (3, 4, 7)), 0, labels), scheme)
        ) == [scheme]
    assert fitting(sided(labels)) == ["dhcp-19"]
    # operated brains' cerebellum and CSF were taken for two hemispheres of cortex
    operated = read_label_volume(
        ATLAS / "fetal_SB_atlas_GA28_operated" / "parcellation.nii.gz"
    ).labels
    assert fitting(operated) == ["spina-bifida-atlas"]
    assert (
        "outer CSF" in scheme_fits(operated)["dhcp-19"]
        or "cortex" in scheme_fits(operated)["dhcp-19"]
    )
    assert scheme_fits(labels + 200 * (labels > 0)) == {}
    # FeTA and DrawEM call these the same
    assert fitting(np.array([0, 3, 3, 0, 0, 2, 3, 0, 3])[labels]) == [
        "drawem-9",
        "feta-7",
    ]


def saved(folder, **volumes):
    for name, labels in volumes.items():
        path = folder / f"{name.replace('_', '/', 1)}_week21_dseg.nii.gz"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_label_volume(
            path, LabelVolume(labels.astype(np.int32), np.diag([0.8, 0.8, 0.8, 1]))
        )


def test_a_volume_without_a_label_is_refused_and_asks_for_no_scheme(tmp_path):
    saved(tmp_path, empty=np.zeros((20, 20, 20)))
    (brain,) = recognise(tmp_path).brains
    assert brain.problem == Facts("has no label", "empty_week21_dseg.nii.gz")
    assert brain.notes == []


def test_a_scheme_is_that_of_the_data_set_or_asked_for(tmp_path):
    labels = read_label_volume(LABELS, cropped=True).labels
    either = np.array([0, 3, 3, 0, 0, 2, 3, 0, 3])[labels]
    # one volume alone could be of two, with another one it cannot
    saved(tmp_path / "whole", a=either, b=renumbered(labels, "feta-7"))
    assert {
        brain.entry["scheme"] for brain in recognise(tmp_path / "whole").brains
    } == {"feta-7"}
    saved(tmp_path / "two", a=either)
    (brain,) = recognise(tmp_path / "two").brains
    assert brain.entry["scheme"] == UNSET
    assert brain.notes == [Facts("scheme:", "drawem-9", "feta-7")]
    (brain,) = recognise(tmp_path / "two", scheme="feta-7").brains
    assert (brain.entry["scheme"], brain.notes) == ("feta-7", [])
    # a folder may hold two data sets, but a subject is of one
    mixed = {
        "sub-01_ses-1": labels,
        "sub-01_ses-2": sided(labels),
        "sub-02_ses-1": labels,
    }
    saved(tmp_path / "mixed", **mixed)
    first, second, other = sorted(
        recognise(tmp_path / "mixed").brains, key=lambda brain: brain.entry["id"]
    )
    assert (
        first.notes
        == second.notes
        == [Facts("scheme:", "sub-01", "dhcp-19", "spina-bifida-atlas")]
    )
    assert (first.entry["scheme"], other.entry["scheme"], other.notes) == (
        UNSET,
        "spina-bifida-atlas",
        [],
    )


def configured(folder):
    """Return the configuration that is written for a folder, in it."""
    path = folder / "gyriflow.yaml"
    write_configuration(recognise(folder), folder, path)
    return load(yaml.safe_load(path.read_text()), folder)


def test_hemispheres_are_paired_with_their_white_surfaces(tmp_path):
    kinds = ("pial", "wm", "sphere", "midthickness")
    surfaces = [
        f"fetal.week22.{side}.{kind}.surf.gii"
        for side in ("left", "right")
        for kind in kinds
    ]
    surfaces += [
        f"sub-07/surf/{side}.{kind}"
        for side in ("lh", "rh")
        for kind in ("pial", "white", "pial.T1")
    ]
    make_tree(tmp_path, surfaces=[*surfaces, "fetal.week23.left.pial.surf.gii"])
    (tmp_path / "participants.tsv").write_text(
        "participant_id\tsex\tweek\nsub-07\tF\t27.3\nsub-08\tM\tn/a\n"
    )
    first, alone, second = (brain.entry for brain in recognise(tmp_path).brains)
    assert first == {
        "id": "fetal.week22",
        "week": 22.0,
        "hemispheres": {
            "left": "fetal.week22.left.pial.surf.gii",
            "right": "fetal.week22.right.pial.surf.gii",
        },
        "white": ["fetal.week22.left.wm.surf.gii", "fetal.week22.right.wm.surf.gii"],
    }
    assert (alone["pial"], alone["side"]) == (
        "fetal.week23.left.pial.surf.gii",
        "left",
    )
    assert (second["id"], second["week"], second["covariates"]) == (
        "sub-07",
        27.3,
        {"sex": "F"},
    )
    assert second["white"] == ["sub-07/surf/lh.white", "sub-07/surf/rh.white"]


@pytest.mark.parametrize(
    ("first", "second", "id"),
    [
        ("case 1", "case-1", "case-1"),
        ("müller1", "möller1", "m-ller1"),
        ("李1", "王1", "1"),
    ],
)
def test_files_whose_ids_would_be_one_are_refused_with_both_names(
    tmp_path, first, second, id
):
    touched(tmp_path, *(f"{name}_dseg.nii.gz" for name in (first, second)))
    brains = recognise(tmp_path).brains
    assert [brain.problem for brain in brains] == [Facts(id, first, second)] * 2


def test_two_surfaces_of_one_side_are_named_both(tmp_path):
    touched(tmp_path, "a/left/lh.pial.gii", "a/right/lh.pial.gii", "a/rh.pial.gii")
    (brain,) = recognise(tmp_path).brains
    assert brain.problem == Facts("left", "a/left/lh.pial.gii", "a/right/lh.pial.gii")


def test_an_age_is_read_from_a_name_that_says_week_or_ga(tmp_path):
    names = (
        "week21_dseg",
        "sub-01_ga-26.4_dseg",
        "sub-21_dseg",
        "image24_dseg",
        "AGA23_dseg",
    )
    for name in names:
        (tmp_path / f"{name}.nii.gz").write_bytes(LABELS.read_bytes())
    brains = recognise(tmp_path).brains
    weeks = {
        Path(brain.entry["labels"]).name.split(".nii")[0]: brain.entry["week"]
        for brain in brains
    }
    assert weeks == {
        **dict.fromkeys(names, UNSET),
        "week21_dseg": 21.0,
        "sub-01_ga-26.4_dseg": 26.4,
    }


def test_a_configuration_is_written_that_is_valid(tmp_path):
    for name in ("GA21", "GA22"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "parcellation.nii.gz").write_bytes(LABELS.read_bytes())
    path = tmp_path / "gyriflow.yaml"
    done = CliRunner().invoke(main, ["init", str(tmp_path)])
    assert done.exit_code == 0
    assert [line for line in done.output.splitlines() if line.startswith("GA")] == [
        Facts(
            f"GA{week}",
            week,
            f"name ({week})",
            "parcellation.nii.gz",
            "spina-bifida-atlas",
            "ok",
        )
        for week in (21, 22)
    ]
    assert done.output == Facts("spina-bifida-atlas: 2", "2 scans")
    config = load(yaml.safe_load(path.read_text()), tmp_path)
    assert [(brain.id, brain.week) for brain in config.brains] == [
        ("GA21", 21.0),
        ("GA22", 22.0),
    ]
    assert config.start == "GA21"
    assert list(config.runs) == ["reference", "measured"]
    assert config.mesh.order == 2
    with pytest.raises(InputError, check=Facts(path, "--force")):
        write_configuration(recognise(tmp_path), tmp_path, path)
    done = CliRunner().invoke(
        main, ["init", str(tmp_path), "--force", "--scheme", "feta-7"]
    )
    assert Facts("feta-7", 2) in done.output.splitlines()
    written = yaml.safe_load(path.read_text())
    assert ([brain["scheme"] for brain in written["brains"]], written["start"]) == (
        ["feta-7"] * 2,
        "GA21",
    )


@pytest.mark.parametrize(
    ("finer", "runs"), [(0, ["reference", "measured"]), (1, ["reference"])]
)
def test_a_run_grows_towards_surfaces_only_where_their_vertices_match(
    tmp_path, finer, runs
):
    for week, levels in ((21, 2), (22, 2 + finer)):
        for side, x in (("left", -12.0), ("right", 12.0)):
            write_surface(
                tmp_path / f"week{week}.{side}.pial.surf.gii",
                sphere(week / 2, levels, (x, 0, 0)),
            )
    config = configured(tmp_path)
    assert list(config.runs) == runs
    # what `check` asks for first
    assert {run for run, _ in resolve(config).simulations} == set(runs)


def test_a_folder_without_brains_says_what_is_expected(tmp_path):
    touched(tmp_path, "notes.txt")
    with pytest.raises(InputError, check=Facts(tmp_path, 1, ".nii.gz")):
        recognise(tmp_path)


def bids_folder(folder, second="sub-01"):
    for subject, session in (("sub-01", "ses-1"), (second, "ses-2")):
        place = folder / "derivatives" / "seg" / subject / session / "anat"
        place.mkdir(parents=True)
        (place / f"{subject}_{session}_desc-brain_dseg.nii.gz").write_bytes(
            LABELS.read_bytes()
        )
    (folder / "participants.tsv").write_text(
        "participant_id\tsex\nsub-01\tF\nsub-02\tM\n"
    )
    (folder / "sub-01").mkdir()
    (folder / "sub-02").mkdir()
    for name, ages in (("sub-01", ("21w2d", "24+3")), ("sub-02", ("22.1", "25"))):
        rows = "".join(
            f"ses-{number}\t{age}\t3.0\n" for number, age in enumerate(ages, 1)
        )
        (folder / name / f"{name}_sessions.tsv").write_text(
            "session_id\tgestational_age\ttesla\n" + rows
        )


def test_sessions_of_bids_are_scans_of_their_subject(tmp_path):
    bids_folder(tmp_path)
    own = tmp_path / "derivatives" / "gyriflow"
    (own / "sub-01").mkdir(parents=True)
    (own / "sub-01" / "sub-01_desc-x_dseg.nii.gz").write_bytes(LABELS.read_bytes())
    (own / "dataset_description.json").write_text(
        '{"GeneratedBy": [{"Name": "gyriflow"}]}'
    )
    first, second = (brain.entry for brain in recognise(tmp_path).brains)
    assert (first["id"], first["week"], first["subject"]) == (
        "sub-01_ses-1",
        21.29,
        "sub-01",
    )
    assert (second["id"], second["week"], second["subject"]) == (
        "sub-01_ses-2",
        24.43,
        "sub-01",
    )
    assert first["covariates"] == {"sex": "F", "tesla": "3.0"}
    assert [brain.subject for brain in configured(tmp_path).brains] == [
        "sub-01",
        "sub-01",
    ]


def test_only_scans_of_one_subject_grow_towards_each_other(tmp_path):
    bids_folder(tmp_path, second="sub-02")
    config = configured(tmp_path)
    assert [brain.subject for brain in config.brains] == ["sub-01", "sub-02"]
    assert list(config.runs) == ["reference"]
    assert not resolve(config).growth_brains


@pytest.fixture
def app(monkeypatch, tmp_path):
    """Calls gyriflow as a BIDS app with some arguments, and returns what Snakemake gets
    and the configuration."""
    data, out, got = tmp_path / "data", tmp_path / "out", []
    data.mkdir()
    bids_folder(data)
    monkeypatch.setattr(launch, "main", lambda asked: got.extend(asked) or 0)

    def call(level, *more, code=0):
        got.clear()
        done = CliRunner().invoke(main, [str(data), str(out), level, *more])
        assert done.exit_code == code, done.output
        path = out / "work" / "gyriflow.yaml"
        return done.output if code else (got, yaml.safe_load(path.read_text()))

    return call


def test_a_bids_app_measures_and_on_request_folds_the_first_of_several_scans(
    app, tmp_path
):
    arguments, written = app("participant")
    assert arguments[-2:] == ["quality", "export"]
    assert "--keep-going" in arguments
    assert list(written) == ["brains", "metrics"]
    assert resolve(load(written, tmp_path)).run_simulations == []
    _, written = app("participant", "--fold")
    assert (written["start"], written["folding"]["end_week"]) == (
        ["sub-01_ses-1"],
        24.43,
    )
    assert list(written["runs"]) == ["reference", "measured"]
    assert [brain.id for brain in load(written, tmp_path).brains] == [
        "sub-01_ses-1",
        "sub-01_ses-2",
    ]
    arguments, again = app("group")
    assert arguments[-2:] == ["all", "export"]
    assert again == written
    assert "start" not in app("group", "--no-fold")[1]


def test_a_bids_app_says_which_scans_it_folds_and_none_without_a_series(app, tmp_path):
    arguments = [str(tmp_path / "data"), str(tmp_path / "out"), "participant", "--fold"]
    done = CliRunner().invoke(main, arguments)
    assert "1 of them to fold: sub-01_ses-1\n" in done.output
    alone = ("--session-label", "1")
    _, written = app("participant", "--fold", *alone)
    assert list(written) == ["brains", "metrics"]
    done = CliRunner().invoke(main, [*arguments, *alone])
    assert done.output == Facts("none is folded", "folding.end_week", "--settings")
    # what to fold may be named, but not without its end
    settings = tmp_path / "own.yaml"
    settings.write_text("{start: all}")
    _, written = app("participant", "--fold", *alone, "--settings", str(settings))
    with pytest.raises(InputError, check=Facts("folding.end_week")):
        load(written, tmp_path)


def test_a_bids_app_takes_labels_and_settings(app, tmp_path):
    (tmp_path / "own.yaml").write_text(
        "{start: first, mesh: {order: 1}, runs: {mine: {}},"
        " folding: {end_week: 26, poisson_ratio: 0.4}}"
    )
    options = (
        "--participant-label",
        "01",
        "sub-01",
        "--session-label",
        "ses-2",
        "--settings",
        str(tmp_path / "own.yaml"),
    )
    _, written = app("participant", *options, "--fold")
    assert [brain["id"] for brain in written["brains"]] == ["sub-01_ses-2"]
    assert (written["start"], written["runs"], written["mesh"]) == (
        "first",
        {"mine": {}},
        {"order": 1},
    )
    assert written["folding"] == {"end_week": 26, "poisson_ratio": 0.4}
    assert app("participant", "--participant-label", "07", code=2) == Facts(
        tmp_path / "data", "sub-07"
    )
    # all that participants had is known to the group
    assert app("group")[1] == written
    app("participant", "--session-label", "1")
    _, both = app("group")
    assert [brain["id"] for brain in both["brains"]] == ["sub-01_ses-1", "sub-01_ses-2"]
    assert "start" not in both
    assert not (tmp_path / "out" / "work" / "results").exists()
    app("participant", "--scheme", "feta-7")
    assert {brain["scheme"] for brain in app("group")[1]["brains"]} == {"feta-7"}


def test_scans_that_cannot_be_used_are_counted_and_the_others_go_on(app, tmp_path):
    make_tree(
        tmp_path / "data",
        text={"sub-02/sub-02_dseg.nii.gz": "torn", "seg/week24_dseg.nii.gz": "torn"},
        labels=["sub-03/sub-03_dseg.nii.gz"],
        tables={"sub-03/sub-03_sessions.tsv": ["session_id ga week", "1 22 28"]},
    )
    output = app("participant", code=2)
    assert output == Facts(
        "2 of 4 scans", "1 could not be read", "1 cannot be used", "sub-02_dseg.nii.gz"
    )
    assert output == Facts("not used: seg/week24_dseg.nii.gz", "ga", 22, "week", 28)
    written = yaml.safe_load((tmp_path / "out" / "work" / "gyriflow.yaml").read_text())
    assert [brain["id"] for brain in written["brains"]] == [
        "sub-01_ses-1",
        "sub-01_ses-2",
    ]
    assert app("participant", "--participant-label", "02", code=2) == Facts(
        "sub-02_dseg.nii.gz", "no scan"
    )
    assert app("participant", "--participant-label", "1", code=2) == Facts(
        "sub-1", "sub-01, sub-02, sub-03"
    )
    done = CliRunner().invoke(
        main, ["measure", str(tmp_path / "data"), "-d", str(tmp_path)]
    )
    assert (done.exit_code, done.output) == (2, Facts("2 of 5 scans"))
    written = yaml.safe_load((tmp_path / "data" / "gyriflow.yaml").read_text())
    assert [brain["id"] for brain in written["brains"]] == [
        "sub-01_ses-1",
        "sub-01_ses-2",
    ]


def test_folders_that_cannot_be_read_are_named(app, tmp_path, monkeypatch):
    make_tree(
        tmp_path / "data",
        labels=["sub-02/anat/sub-02_dseg.nii.gz", "case-7/week23_dseg.nii.gz"],
    )
    scandir = os.scandir

    def refuse(path="."):
        if str(path).endswith(("sub-02/anat", "case-7")):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    assert app("participant", code=2) == Facts(
        "sub-02", "cannot be read", "not used: case-7", "2 of 3 scans"
    )
    done = CliRunner().invoke(main, ["init", str(tmp_path / "data")])
    assert (done.exit_code, done.output) == (
        2,
        Facts("case-7", "sub-02", "2 of 4 scans", "cannot be read"),
    )


def test_a_file_in_a_folder_that_cannot_be_read_is_a_mistake_of_its_key(
    tmp_path, monkeypatch
):
    is_file = Path.is_file

    def refuse(path):
        if path.parent.name == "closed":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return is_file(path)

    monkeypatch.setattr(Path, "is_file", refuse)
    with pytest.raises(
        InputError,
        check=Facts("brains[0].pial", tmp_path / "closed" / "a.stl", "cannot be read"),
    ):
        load({"brains": [{"id": "a", "week": 23, "pial": "closed/a.stl"}]}, tmp_path)


def test_what_others_keep_is_not_replaced_by_a_bids_app(app, tmp_path):
    out = tmp_path / "out"
    write_json(out / "dataset_description.json", {"GeneratedBy": [{"Name": "dHCP"}]})
    assert app("participant", code=2) == Facts(out / "dataset_description.json", "OUT")
    assert [path.name for path in out.iterdir()] == ["dataset_description.json"]
    (out / "dataset_description.json").unlink()
    (out / "work").mkdir()
    (out / "work" / "gyriflow.yaml").write_text("brains: [mine]\n")
    assert app("participant", code=2) == Facts(
        out / "work" / "gyriflow.yaml", "--work-dir"
    )
    assert (out / "work" / "gyriflow.yaml").read_text() == "brains: [mine]\n"


def test_a_configuration_that_is_replaced_is_kept(tmp_path):
    bids_folder(tmp_path)
    assert CliRunner().invoke(main, ["init", str(tmp_path)]).exit_code == 0
    path = tmp_path / "gyriflow.yaml"
    for number in (1, 2):
        path.write_text(f"mine: {number}")
        done = CliRunner().invoke(main, ["init", str(tmp_path), "--force"])
        assert (done.exit_code, done.output) == (0, Facts(f"{path}.{number}"))
        assert Path(f"{path}.{number}").read_text() == f"mine: {number}"
    # an equal one is not another one
    CliRunner().invoke(main, ["init", str(tmp_path), "--force"])
    assert len(list(tmp_path.glob("gyriflow.yaml*"))) == 3


def test_a_folder_is_measured_without_a_start(monkeypatch, tmp_path):
    bids_folder(tmp_path)
    told = {}
    monkeypatch.setattr(
        launch, "main", lambda asked: told.update(os.environ, asked=asked) or 0
    )
    monkeypatch.setenv(launch.MEASURE_ONLY_VAR, "")
    done = CliRunner().invoke(main, ["measure", str(tmp_path), "-d", str(tmp_path)])
    assert (done.exit_code, told[launch.MEASURE_ONLY_VAR], told["asked"][-1]) == (
        0,
        "1",
        "all",
    )
    written = yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())
    assert list(written) == ["brains"]
    study = resolve(load(written, tmp_path))
    assert (len(study.brains), study.run_simulations, study.norm_reference) == (
        2,
        [],
        ["sub-01_ses-1", "sub-01_ses-2"],
    )
    # of a configuration with runs, nothing is folded either
    runs = {"start": "first", "folding": {"end_week": 24}}
    folded = load(written | runs, tmp_path)
    assert (
        len(resolve(folded).run_simulations),
        resolve(folded.measured_only).run_simulations,
    ) == (1, [])


def test_the_chosen_scheme_has_its_contradiction_and_others_their_names_only():
    fits = {"a": "", "b": "cortex is missing", "c": "too little cortex"}
    brains = [
        FoundBrain(Path(f"{number}.nii"), {"scheme": "a"}, fits=fits)
        for number in range(2)
    ]
    head, others = scheme_reasons(brains)
    assert head == Facts("a", 2)
    assert others == Facts("b, c")
    assert "cortex" not in others
    given = FoundBrain(Path("x.nii"), {"scheme": "b"}, fits=fits)
    head, contradiction, others = scheme_reasons([given])
    assert (head, contradiction) == (Facts("b", 1), Facts("cortex is missing"))
    assert others.endswith(": c")
