"""Which files are recognised as brains: names of atlases, sides, ages, label schemes,
participants."""

import errno
import os
from functools import cache
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
from gyriflow.cli.recognition import UNSET, recognise, scheme_fits
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


@cache
def shipped_labels(path):
    """Return every second voxel along each axis of a volume, which shows the same."""
    return read_label_volume(path, cropped=True).labels[::2, ::2, ::2]


LEFT_AND_RIGHT = {
    1: (5, 6),
    2: (7, 8),
    3: (11, 12),
    4: (1, 2),
    5: (3, 4),
    6: (14, 15),
    7: (10, 10),
    8: (9, 9),
}


def sided(labels):
    """Return labels of the spina bifida atlas as those of dHCP's, left and right of the
    middle."""
    hemispheres = np.isin(labels, (1, 2, 5, 6, 8))
    is_left = np.indices(labels.shape)[0] < np.argwhere(hemispheres)[:, 0].mean()
    found = np.zeros_like(labels)
    for label, (left, right) in LEFT_AND_RIGHT.items():
        found[labels == label] = np.where(is_left, left, right)[labels == label]
    return found


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


def of_two_schemes(labels):
    """Return white matter and cortex, which FeTA and DrawEM call the same."""
    return np.array([0, 3, 3, 0, 0, 2, 3, 0, 3])[labels]


def fitting(labels):
    return [name for name, against in scheme_fits(labels).items() if not against]


@pytest.mark.parametrize("scheme", NUMBERS)
def test_a_scheme_is_found_by_where_labels_lie(scheme):
    labels = shipped_labels(LABELS)
    assert fitting(renumbered(labels, scheme)) == [scheme]
    without_surroundings = np.where(np.isin(labels, (3, 4, 7)), 0, labels)
    assert fitting(renumbered(without_surroundings, scheme)) == [scheme]


def test_schemes_with_the_same_labels_are_told_apart_by_sides():
    labels = shipped_labels(LABELS)
    assert fitting(sided(labels)) == ["dhcp-19"]
    # operated brains' cerebellum and CSF were taken for two hemispheres of cortex
    operated = shipped_labels(
        ATLAS / "fetal_SB_atlas_GA28_operated" / "parcellation.nii.gz"
    )
    assert fitting(operated) == ["spina-bifida-atlas"]
    against = scheme_fits(operated)["dhcp-19"]
    assert "outer CSF" in against or "cortex" in against


def found_schemes(folder, volumes, **options):
    """Return the scheme and the notes of each scan of a folder, by id."""
    for name, labels in volumes.items():
        path = folder / f"{name.replace('_', '/', 1)}_week21_dseg.nii.gz"
        path.parent.mkdir(parents=True, exist_ok=True)
        affine = np.diag([1.6, 1.6, 1.6, 1])
        write_label_volume(path, LabelVolume(labels.astype(np.int32), affine))
    found = sorted(recognise(folder, **options).brains, key=lambda b: b.entry["id"])
    return [(brain.entry["scheme"], brain.notes) for brain in found]


def test_a_volume_without_a_label_is_refused_and_asks_for_no_scheme(tmp_path):
    found_schemes(tmp_path, {"empty": np.zeros((20, 20, 20))})
    (brain,) = recognise(tmp_path).brains
    assert brain.problem == Facts("has no label", "empty_week21_dseg.nii.gz")
    assert brain.notes == []


def test_a_scheme_is_that_of_the_data_set_or_asked_for(tmp_path):
    labels = shipped_labels(LABELS)
    either = of_two_schemes(labels)
    # one volume alone could be of two, with another one it cannot
    volumes = {"a": either, "b": renumbered(labels, "feta-7")}
    assert found_schemes(tmp_path / "both", volumes) == [("feta-7", [])] * 2
    note = Facts("scheme:", "drawem-9", "feta-7")
    assert found_schemes(tmp_path / "one", {"a": either}) == [(UNSET, [note])]
    found = found_schemes(tmp_path / "one", {}, scheme="feta-7")
    assert found == [("feta-7", [])]


def test_a_folder_may_hold_two_data_sets_but_a_subject_is_of_one(tmp_path):
    labels = shipped_labels(LABELS)
    note = Facts("scheme:", "sub-01", "dhcp-19", "spina-bifida-atlas")
    assert found_schemes(
        tmp_path,
        {
            "sub-01_ses-1": labels,
            "sub-01_ses-2": sided(labels),
            "sub-02_ses-1": labels,
        },
    ) == [(UNSET, [note]), (UNSET, [note]), ("spina-bifida-atlas", [])]


@pytest.mark.parametrize(
    ("first", "second", "id"),
    [
        ("case 1", "case-1", "case-1"),
        ("李1", "王1", "1"),
    ],
)
def test_files_whose_ids_would_be_one_are_refused_with_both_names(
    tmp_path, first, second, id
):
    touched(tmp_path, *(f"{name}_dseg.nii.gz" for name in (first, second)))
    brains = recognise(tmp_path).brains
    assert [brain.problem for brain in brains] == [Facts(id, first, second)] * 2


def called(*arguments, code=0):
    """Return what a command says that ends with a code."""
    done = CliRunner().invoke(main, list(map(str, arguments)))
    assert done.exit_code == code, done.output
    return done.output


def configured(folder):
    """Return the configuration in a folder."""
    return load(yaml.safe_load((folder / "gyriflow.yaml").read_text()), folder)


def test_a_configuration_is_written_that_is_valid(tmp_path):
    weeks = (21, 22)
    make_tree(tmp_path, labels=[f"GA{week}/parcellation.nii.gz" for week in weeks])
    output = called("init", tmp_path)
    scheme, volume = "spina-bifida-atlas", "parcellation.nii.gz"
    assert [line for line in output.splitlines() if line.startswith("GA")] == [
        Facts(f"GA{week}", week, f"name ({week})", volume, scheme, "ok")
        for week in weeks
    ]
    assert output == Facts("2 scans")
    config = configured(tmp_path)
    found = {brain.id: brain.week for brain in config.brains}
    assert found == {"GA21": 21.0, "GA22": 22.0}
    assert (config.start, config.mesh.order) == ("GA21", 2)
    assert list(config.runs) == ["reference", "measured"]
    (tmp_path / "gyriflow.yaml").write_text("mine")
    with pytest.raises(InputError, check=Facts("gyriflow.yaml", "--force")):
        write_configuration(recognise(tmp_path), tmp_path, tmp_path / "gyriflow.yaml")
    # what contradicts a scheme that is asked for
    output = called("init", tmp_path, "--force", "--scheme", "drawem-9")
    assert output.count("scheme drawem-9: ") == 2
    assert {brain.scheme for brain in configured(tmp_path).brains} == {"drawem-9"}


def test_a_configuration_that_is_replaced_is_kept(tmp_path):
    make_tree(tmp_path, labels=["week24_dseg.nii.gz"])
    path, scheme = tmp_path / "gyriflow.yaml", ("--scheme", "spina-bifida-atlas")
    called("init", tmp_path, *scheme)
    for number in (1, 2):
        path.write_text(f"mine: {number}")
        assert called("init", tmp_path, *scheme, "--force") == Facts(f"{path}.{number}")
        assert Path(f"{path}.{number}").read_text() == f"mine: {number}"
    # an equal one is not another one
    called("init", tmp_path, *scheme, "--force")
    assert len(list(tmp_path.glob("gyriflow.yaml*"))) == 3


@pytest.mark.parametrize(
    ("finer", "runs"), [(0, ["reference", "measured"]), (1, ["reference"])]
)
def test_a_run_grows_towards_surfaces_only_where_their_vertices_match(
    tmp_path, finer, runs
):
    for week, levels in ((21, 2), (22, 2 + finer)):
        for side, x in (("left", -12.0), ("right", 12.0)):
            path = tmp_path / f"week{week}.{side}.pial.surf.gii"
            write_surface(path, sphere(week / 2, levels, (x, 0, 0)))
    write_configuration(recognise(tmp_path), tmp_path, tmp_path / "gyriflow.yaml")
    config = configured(tmp_path)
    assert list(config.runs) == runs
    # what `check` asks for first
    assert {run for run, _ in resolve(config).simulations} == set(runs)


def bids_folder(folder, second="sub-01"):
    """Write a data set of two sessions, the second of a subject, with ages of four."""
    labels = [
        f"derivatives/seg/{scan.replace('_', '/')}/anat/{scan}_desc-brain_dseg.nii.gz"
        for scan in ("sub-01_ses-1", f"{second}_ses-2")
    ]
    tables = {"participants.tsv": ["participant_id sex", "sub-01 F", "sub-02 M"]}
    for subject, ages in (("sub-01", ("21w2d", "24+3")), ("sub-02", ("22.1", "25"))):
        rows = [f"ses-{number} {age} 3.0" for number, age in enumerate(ages, 1)]
        name = f"{subject}/{subject}_sessions.tsv"
        tables[name] = ["session_id gestational_age tesla", *rows]
    return make_tree(folder, labels=labels, tables=tables)


def test_sessions_of_bids_are_scans_of_their_subject(tmp_path):
    bids_folder(tmp_path)
    made_by = {"GeneratedBy": [{"Name": "gyriflow"}]}
    own = "derivatives/gyriflow"
    make_tree(
        tmp_path,
        labels=[f"{own}/sub-01/sub-01_desc-x_dseg.nii.gz"],
        json={f"{own}/dataset_description.json": made_by},
    )
    entries = [brain.entry for brain in recognise(tmp_path).brains]
    assert [(e["id"], e["week"], e["subject"]) for e in entries] == [
        ("sub-01_ses-1", 21.29, "sub-01"),
        ("sub-01_ses-2", 24.43, "sub-01"),
    ]
    assert entries[0]["covariates"] == {"sex": "F", "tesla": "3.0"}


def test_only_scans_of_one_subject_grow_towards_each_other(tmp_path):
    bids_folder(tmp_path, second="sub-02")
    called("init", tmp_path)
    config = configured(tmp_path)
    assert [brain.subject for brain in config.brains] == ["sub-01", "sub-02"]
    assert list(config.runs) == ["reference"]
    assert not resolve(config).growth_brains


BOTH = ["sub-01_ses-1", "sub-01_ses-2"]


def ids(written):
    return [brain["id"] for brain in written["brains"]]


@pytest.fixture
def asked(monkeypatch):
    """The arguments that Snakemake gets."""
    got = []
    monkeypatch.setattr(launch, "main", lambda given: got.extend(given) or 0)
    return got


@pytest.fixture
def app(asked, tmp_path):
    """Return the configuration that gyriflow writes as a BIDS app with some arguments,
    or with another exit code what it says."""
    data, out = bids_folder(tmp_path / "data"), tmp_path / "out"

    def call(level, *more, code=0):
        asked.clear()
        output = called(data, out, level, *more, code=code)
        path = out / "work" / "gyriflow.yaml"
        return output if code else yaml.safe_load(path.read_text())

    return call


def test_a_bids_app_measures_and_on_request_folds_the_first_of_several_scans(
    app, asked, tmp_path
):
    written = app("participant")
    assert asked[-2:] == ["quality", "export"]
    assert "--keep-going" in asked
    assert list(written) == ["brains", "metrics"]
    assert resolve(load(written, tmp_path)).run_simulations == []
    written = app("participant", "--fold")
    assert ids(written) == BOTH
    assert (written["start"], written["folding"]) == (BOTH[:1], {"end_week": 24.43})
    assert list(written["runs"]) == ["reference", "measured"]
    assert app("group") == written
    assert asked[-2:] == ["all", "export"]
    assert "start" not in app("group", "--no-fold")


def test_a_bids_app_says_which_scans_it_folds_and_none_without_a_series(
    app, asked, tmp_path
):
    call = [tmp_path / "data", tmp_path / "out", "participant", "--fold"]
    assert "1 of them to fold: sub-01_ses-1\n" in called(*call)
    output = called(*call, "--session-label", "1")
    assert output == Facts("none is folded", "folding.end_week", "--settings")
    # what to fold may be named, but not without its end
    settings = tmp_path / "own.yaml"
    settings.write_text("{start: all}")
    written = app(*call[2:], "--session-label", "1", "--settings", settings)
    with pytest.raises(InputError, check=Facts("folding.end_week")):
        load(written, tmp_path)


def test_a_bids_app_takes_labels_and_settings(app, tmp_path):
    settings = {"start": "first", "mesh": {"order": 1}, "runs": {"mine": {}}}
    folding = {"end_week": 26, "poisson_ratio": 0.4}
    write_json(tmp_path / "own.yaml", settings | {"folding": folding})
    labels = ("--participant-label", "01", "sub-01", "--session-label", "ses-2")
    options = (*labels, "--settings", tmp_path / "own.yaml", "--fold")
    written = app("participant", *options)
    assert ids(written) == ["sub-01_ses-2"]
    assert written == written | settings | {"folding": folding}
    output = app("participant", "--participant-label", "07", code=2)
    assert output == Facts(tmp_path / "data", "sub-07")
    # all that participants had is known to the group
    assert app("group") == written
    app("participant", "--session-label", "1")
    both = app("group")
    assert (ids(both), "start" in both) == (BOTH, False)
    assert not (tmp_path / "out" / "work" / "results").exists()
    app("participant", "--scheme", "feta-7")
    assert {brain["scheme"] for brain in app("group")["brains"]} == {"feta-7"}


def test_scans_that_cannot_be_used_are_counted_and_the_others_go_on(app, tmp_path):
    make_tree(
        tmp_path / "data",
        text={"sub-02/sub-02_dseg.nii.gz": "torn", "seg/week24_dseg.nii.gz": "torn"},
        labels=["sub-03/sub-03_dseg.nii.gz"],
        tables={"sub-03/sub-03_sessions.tsv": ["session_id ga week", "1 22 28"]},
    )
    counts = "2 of 4 scans", "1 could not be read", "1 cannot be used"
    output = app("participant", code=2)
    assert output == Facts(*counts, "sub-02_dseg.nii.gz", "ga", 22, "week", 28)
    assert output == Facts("not used: seg/week24_dseg.nii.gz")
    written = yaml.safe_load((tmp_path / "out/work/gyriflow.yaml").read_text())
    assert ids(written) == BOTH
    output = app("participant", "--participant-label", "02", code=2)
    assert output == Facts("sub-02_dseg.nii.gz", "no scan")
    # files of others are not read
    assert ids(app("participant", "--participant-label", "01")) == BOTH
    output = app("participant", "--participant-label", "1", code=2)
    assert output == Facts("sub-1", "sub-01, sub-02, sub-03")
    output = called("measure", tmp_path / "data", "-d", tmp_path, code=2)
    assert output == Facts("2 of 5 scans")
    written = yaml.safe_load((tmp_path / "data" / "gyriflow.yaml").read_text())
    assert ids(written) == BOTH


def test_folders_that_cannot_be_read_are_named(app, tmp_path, monkeypatch):
    names = ("sub-02/anat/sub-02_dseg.nii.gz", "case-7/week23_dseg.nii.gz")
    make_tree(tmp_path / "data", labels=names)
    scandir = os.scandir

    def refuse(path="."):
        if str(path).endswith(("sub-02/anat", "case-7")):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    facts = Facts("sub-02", "cannot be read", "not used: case-7", "2 of 3 scans")
    assert app("participant", code=2) == facts
    facts = Facts("case-7", "sub-02", "2 of 4 scans", "cannot be read")
    assert called("init", tmp_path / "data", code=2) == facts


def test_a_file_in_a_folder_that_cannot_be_read_is_a_mistake_of_its_key(
    tmp_path, monkeypatch
):
    is_file = Path.is_file

    def refuse(path):
        if path.parent.name == "closed":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return is_file(path)

    monkeypatch.setattr(Path, "is_file", refuse)
    brain = {"id": "a", "week": 23, "pial": "closed/a.stl"}
    facts = Facts("brains[0].pial", tmp_path / "closed" / "a.stl", "cannot be read")
    with pytest.raises(InputError, check=facts):
        load({"brains": [brain]}, tmp_path)


def test_what_others_keep_is_not_replaced_by_a_bids_app(app, tmp_path):
    description = tmp_path / "out" / "dataset_description.json"
    write_json(description, {"GeneratedBy": [{"Name": "dHCP"}]})
    assert app("participant", code=2) == Facts(description, "OUT")
    assert list(description.parent.iterdir()) == [description]
    description.unlink()
    config = make_tree(tmp_path / "out/work", text={"gyriflow.yaml": "brains: [mine]"})
    facts = Facts(config / "gyriflow.yaml", "--work-dir")
    assert app("participant", code=2) == facts
    assert (config / "gyriflow.yaml").read_text() == "brains: [mine]\n"


def test_a_folder_is_measured_without_a_start(asked, monkeypatch, tmp_path):
    bids_folder(tmp_path)
    monkeypatch.setenv(launch.MEASURE_ONLY_VAR, "")
    called("measure", tmp_path, "-d", tmp_path)
    assert os.environ[launch.MEASURE_ONLY_VAR] == "1"
    assert asked[-1] == "all"
    written = yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())
    assert list(written) == ["brains"]
    study = resolve(load(written, tmp_path))
    assert (len(study.brains), study.run_simulations) == (2, [])
    assert study.norm_reference == BOTH
    # of a configuration with runs, nothing is folded either
    config = load(written | {"start": "first", "folding": {"end_week": 24}}, tmp_path)
    assert len(resolve(config).run_simulations) == 1
    assert resolve(config.measured_only).run_simulations == []
