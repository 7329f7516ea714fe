"""What the commands hand on to Snakemake, what they tell to type next, and in which
code they end."""

import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from atlas_brains import atlas_brain, atlas_halves
from click.testing import CliRunner
from configurations import touched
from facts import Facts
from scan_trees import make_tree
from shapes import sphere

from gyriflow.cli import check as checking
from gyriflow.cli.commands import main
from gyriflow.errors import InputError
from gyriflow.io.surfaces import write_surface
from gyriflow.io.yaml_files import read_keys
from gyriflow.messages import Message
from gyriflow.running import launch
from gyriflow.running.machine import available_cores
from gyriflow.running.snakemake_internals import max_jobs
from gyriflow.settings.runs import GrowthSettings
from gyriflow.shipped import SHIPPED
from gyriflow.study import resolve
from gyriflow.study.loading import load


def refused(*arguments):
    """Return what a command says that ends with the code of a mistake in its input."""
    done = CliRunner().invoke(main, list(map(str, arguments)))
    assert done.exit_code == 2, done.output
    return done.output


@pytest.fixture
def handed_on(monkeypatch, tmp_path):
    """Return the arguments that Snakemake gets for those of `gyriflow run`, beside a
    configuration."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gyriflow.yaml").touch()

    def arguments(*given, config="gyriflow.yaml"):
        got = []
        monkeypatch.setattr(launch, "main", lambda asked: got.extend(asked) or 0)
        assert CliRunner().invoke(main, ["run", *given]).exit_code == 0
        assert got[:2] == ["--configfile", str(tmp_path / config)]
        return got[2:]

    return arguments


SLURM = ["--profile", "profiles/slurm"]
ALL = str(available_cores())


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ([], ["--cores", ALL]),
        (["--cores", "all"], ["--cores", ALL]),
        (["--cores", "3"], ["--cores", "3"]),
        # the cores of this machine are no limit to a cluster, only those asked for
        (SLURM, SLURM),
        (["--executor=slurm"], ["--executor=slurm"]),
        (["--cores", "200", *SLURM], ["--cores", "200", *SLURM]),
    ],
)
def test_a_run_gets_the_cores_of_this_machine_or_those_asked_for(
    handed_on, tmp_path, given, expected
):
    got = handed_on(*given)
    place = got.index("--directory")
    assert got[:place] + got[place + 2 :] == expected


@pytest.mark.parametrize("name", ["C.YAML", "study"])
def test_any_file_may_be_the_configuration_but_results_are_targets(
    handed_on, tmp_path, name
):
    result = "results/study/metrics.csv"
    touched(tmp_path, name, result)
    assert handed_on(result)[-1] == result
    assert handed_on(name, "--until", "mesh", config=name)[-2:] == ["--until", "mesh"]


@pytest.mark.parametrize(
    ("arguments", "facts"),
    [
        (["check"], ["{}/gyriflow.yaml:", "gyriflow init"]),
        (["run"], ["{}/gyriflow.yaml:", "gyriflow init"]),
        (["run", "no.yaml"], ["{}/no.yaml:", "gyriflow init"]),
        (["run", "--cores", "two"], ["--cores", "two", "run --help`"]),
        # a data set in a folder that is called as a command
        (["bids", "out", "participant"], ["bids:", "0 files", ".nii.gz"]),
        (["bids", "bids", "out", "group"], ["bids:", "0 files", ".nii.gz"]),
    ],
)
def test_a_mistake_in_a_call_is_named(monkeypatch, tmp_path, arguments, facts):
    (tmp_path / "bids").mkdir()
    monkeypatch.chdir(tmp_path)
    places = [fact.format(tmp_path) for fact in facts]
    assert refused(*arguments) == Facts("gyriflow:", *places)


def test_a_current_folder_that_was_deleted_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tmp_path.rmdir()
    assert refused("check") == Facts("the current folder no longer exists")


def test_an_unknown_option_is_refused_with_the_nearest_one(tmp_path):
    with pytest.raises(InputError, check=Facts("--corse", "--cores")):
        launch.main(["--directory", str(tmp_path), "--corse", "2"])
    assert not list(tmp_path.iterdir())


def test_an_executor_of_an_option_is_to_be_installed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, check=lambda end: end.code == 2):
        launch.main(["-n", "-e", "moon"])
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "moon" in line]
    assert line == Facts("gyriflow:", "snakemake-executor-plugin-moon", "cluster.md")


def test_a_profile_names_the_number_of_jobs_and_an_executor_to_be_installed(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("executor: moon\n")
    profile = ["--profile", str(tmp_path)]
    assert launch.main(["-n", *profile]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "moon" in line]
    assert line == Facts("gyriflow:", "snakemake-executor-plugin-moon", "cluster.md")
    # a forecast is for the jobs that run at once
    (tmp_path / "config.yaml").write_text("jobs: 70\n")
    assert max_jobs(profile) == 70
    assert max_jobs([*profile, "--jobs", "90"]) == 90
    assert max_jobs(["--retries", "2"]) is None


ATLAS = SHIPPED / "atlases" / "spina-bifida"
FOUND = "fetal_SB_atlas_GA22_notoperated"
"""The id of the brain that is predicted, by the folder of its labels."""
LABELS = str(ATLAS / FOUND / "parcellation.nii.gz")


def configured(folder):
    """Return the configuration in a folder, as it is written and as a study."""
    section = yaml.safe_load((folder / "gyriflow.yaml").read_text())
    return section, resolve(load(section))


@pytest.fixture
def predicted(monkeypatch, tmp_path):
    """Return what `gyriflow predict` says, of the shipped brain of 22 GW by default,
    and note the run's arguments."""

    def note(asked):
        (tmp_path / "asked.txt").write_text(" ".join(asked))
        return 0

    monkeypatch.setattr(launch, "main", note)

    def said(*given, files=(LABELS,), code=0):
        place = ["--directory", str(tmp_path), "--cores", "3"]
        done = CliRunner().invoke(main, ["predict", *files, *place, *given])
        assert done.exit_code == code, done.output
        return done.output

    return said


def test_a_prediction_is_configured_with_the_weeks_of_an_atlas_and_run(
    predicted, tmp_path
):
    path, asked = tmp_path / "gyriflow.yaml", ("--week", "22.4", "--until", "24.5")
    assert predicted(*asked) == Facts("spina bifida aperta")
    _, study = configured(tmp_path)
    brains = study.config.brains
    assert [brain.week for brain in brains] == [22.4, 22, 23, 24, 25]
    (simulation,) = study.run_simulations
    growth = simulation.settings.growth
    assert (simulation.brain, growth.shapes) == (FOUND, "atlas")
    later = [brain.id for brain in brains[1:]]
    assert list(study.chains[FOUND, "atlas"].later) == later
    call = f"--configfile {path} --cores 3 --directory {tmp_path} all export"
    assert (tmp_path / "asked.txt").read_text() == call
    # with the mesh with which benchmarks/horizon.py measured the errors of predictions
    mesh = study.config.mesh
    tested = read_keys(SHIPPED / "norms" / "predictions.yaml")["mesh"]
    assert mesh.mesher == "tetgen"
    for key in ("order", "surface_edge_mm"):
        assert getattr(mesh, key) == tested[key]


def test_the_same_prediction_goes_on_and_another_one_replaces_nothing(
    predicted, tmp_path
):
    for _ in range(2):
        predicted("--week", "22.4", "--until", "24.5")
    other = ("--week", "22.4", "--until", "24")
    assert predicted(*other, code=2) == Facts(tmp_path / "gyriflow.yaml", "--force")
    predicted(*other, "--force", "--ensemble", "5")
    run = configured(tmp_path)[1].config.runs["predicted"]
    assert (run.end_week, run.ensemble) == (24, 5)


def test_a_quick_prediction_is_coarse_and_finds_files_from_the_working_directory(
    monkeypatch, predicted, tmp_path
):
    monkeypatch.chdir(ATLAS.parent)
    place = ("--atlas", f"{ATLAS.name}/atlas.yaml", "--folder", ATLAS.name)
    predicted("--week", "25", "--until", "32", "--quick", *place)
    monkeypatch.chdir(tmp_path)
    section, study = configured(tmp_path)
    named = section["atlas"]["name"], section["atlas"]["folder"]
    assert named == (str(ATLAS / "atlas.yaml"), str(ATLAS))
    for brain in study.brains.values():
        assert all(Path(file).is_file() for file in brain.files)
    assert study.run_simulations[0].settings.step_s == 7 * 86400
    assert study.config.mesh.order == 1
    # every third week up to the end
    assert study.config.atlas[0].weeks == (25, 28, 31, 34)
    # a path of the atlas has a quarter as many nodes on the surface
    assert study.config.growth.path_edge_mm == 2 * GrowthSettings().path_edge_mm


@pytest.fixture
def planned(monkeypatch):
    """The configurations of dry runs, whose plans are empty."""
    found = []
    monkeypatch.setattr(
        checking, "_plan", lambda path, *_, **__: found.append(read_keys(path)) or []
    )
    return found


def test_a_dry_prediction_leaves_nothing_behind(planned, predicted, tmp_path):
    asked, before = ("--week", "22", "--until", "24", "-n"), set(tmp_path.rglob("*"))
    predicted(*asked, "--directory", str(tmp_path / "new"))
    assert (len(planned), set(tmp_path.rglob("*"))) == (1, before)
    # what it would not replace, it says then
    path = touched(tmp_path, "gyriflow.yaml") / "gyriflow.yaml"
    assert predicted(*asked, code=2) == Facts(path, "--force")
    assert path.read_text() == ""


@pytest.fixture
def data_set(monkeypatch, tmp_path):
    """A BIDS data set of two participants in the current folder, data."""
    monkeypatch.chdir(tmp_path)
    # set in this process, and removed after the test
    monkeypatch.setenv(launch.MEASURE_ONLY_VAR, "")
    rows = ["participant_id scan_age", "sub-01 24.1", "sub-02 25.3"]
    names = [f"sub-0{number}/anat/sub-0{number}_dseg.nii.gz" for number in (1, 2)]
    make_tree(tmp_path / "data", labels=names, tables={"participants.tsv": rows})
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "directory", "option"),
    [
        (["data", "out", "participant"], "out/work", "--work-dir"),
        (["measure", "data", "-d", "study"], "study", "--directory"),
    ],
)
def test_beside_a_live_run_a_command_writes_nothing_and_names_its_option(
    monkeypatch, data_set, arguments, directory, option
):
    monkeypatch.setattr(launch, "LOCK_WAIT_S", 0.0)
    with launch.hold_lock(data_set / directory):
        before = {path: path.stat().st_mtime_ns for path in data_set.rglob("*")}
        done = CliRunner().invoke(main, [*arguments, "--cores", "1"])
        assert done.exit_code == 5
        assert done.output == Facts(data_set / directory, option)
        assert before == {path: path.stat().st_mtime_ns for path in data_set.rglob("*")}


@pytest.mark.parametrize(
    ("fold", "is_named"), [((), True), (("--no-fold",), False), (("--fold",), False)]
)
def test_a_dry_call_for_a_bids_data_set_names_settings_that_only_matter_to_fold(
    planned, data_set, fold, is_named
):
    settings = "start: all\nfolding: {end_week: 30}\nmetrics: {spangy_modes: B4}\n"
    (data_set / "my.yaml").write_text(settings)
    before = set(data_set.rglob("*"))
    options = ("--settings", "my.yaml", "--participant-label", "02", "-n", *fold)
    done = CliRunner().invoke(main, ["data", "out", "participant", *options])
    assert done.exit_code == 0
    assert [brain["id"] for brain in planned[0]["brains"]] == ["sub-02"]
    assert set(data_set.rglob("*")) == before
    # a section that measuring uses is not among them
    named = [line for line in done.stderr.splitlines() if "--settings" in line]
    assert named == [Facts("--fold", "start, folding")] * is_named
    assert "metrics" not in done.stderr


def test_check_takes_a_folder_as_measure_does_and_writes_nothing(
    tmp_path, planned, monkeypatch
):
    numbers = range(2, 8)
    rows = ["participant_id ga", "sub-1 24.1", *(f"sub-{n} n/a" for n in numbers)]
    names = [f"sub-{n}_dseg.nii.gz" for n in (1, *numbers)]
    make_tree(tmp_path, labels=names, tables={"participants.tsv": rows})
    # set in this process, and removed after the test
    monkeypatch.setenv(launch.MEASURE_ONLY_VAR, "")
    before = set(tmp_path.rglob("*"))
    options = ("--scheme", "spina-bifida-atlas", "-d", tmp_path / "new")
    output = refused("check", tmp_path, *options)
    assert set(tmp_path.rglob("*")) == before
    assert [brain["id"] for brain in planned[0]["brains"]] == ["sub-1"]
    assert output == Facts(f"{tmp_path}: 1 brain, measured only", "6 problems")
    # where the age is from
    assert output == Facts("participants.tsv row 2")
    # six scans with one fault: three lines and a number
    assert (output.count("n/a"), output) == (3, Facts("3 more"))
    # the options are those of measure
    (tmp_path / "gyriflow.yaml").write_text("brains: []")
    for command in ("check", "measure"):
        output = refused(command, tmp_path, "--files", "*x*")
        assert output == Facts("--files", "init FOLDER")


@pytest.mark.parametrize(
    ("until", "more", "facts"),
    [
        ("30", [], ["spina-bifida", 22.4, "30 GW", "unoperated", 21, "25 GW"]),
        ("22", [], ["--until", "--week"]),
        ("30", ["--atlas", "crl"], ["For non-commercial education and research only"]),
        ("30", ["--atlas", "crk"], ["crk", "crl"]),
        ("25", ["--scheme", "feta"], ["--scheme:", "'feta'", "feta-7"]),
        ("25", ["--scheme", "feta-7"], ["spina-bifida-atlas", "feta-7"]),
        ("25", ["--folder", "nowhere"], ["--folder", "nowhere"]),
    ],
)
def test_a_prediction_that_no_atlas_allows_is_refused(
    predicted, tmp_path, until, more, facts
):
    asked = ("--week", "22.4", "--until", until, *more)
    assert predicted(*asked, code=2) == Facts(*facts)
    assert not (tmp_path / "gyriflow.yaml").exists()


LH, RH, LH_WHITE, RH_WHITE = (
    f"{side}.{layer}.surf.gii" for layer in ("pial", "white") for side in ("lh", "rh")
)


@pytest.fixture(scope="module")
def surfaces(tmp_path_factory):
    """Surface files of the shipped brain of 24 GW and of a ball, by name."""
    folder, (left, right) = tmp_path_factory.mktemp("surfaces"), atlas_halves()
    for name, mesh in {
        "brain.stl": atlas_brain(),
        "half.stl": left,
        "ball.stl": sphere(5.0),
        LH: left,
        RH: right,
        LH_WHITE: left,
        RH_WHITE: right,
    }.items():
        write_surface(folder / name, mesh)
    return touched(folder, "notes.txt")


@pytest.fixture
def predicted_from(monkeypatch, predicted, surfaces):
    """Return what `gyriflow predict` says of files of that folder, in which it
    stands."""
    monkeypatch.chdir(surfaces)
    asked = ("--week", "23.4", "--until", "24.8")
    return lambda *given, code=0: predicted(*asked, files=given, code=code)


def whites(*names):
    """Return the options for white surfaces."""
    return [word for name in names for word in ("--white", name)]


@pytest.mark.parametrize(
    ("files", "source"),
    [
        (["brain.stl"], {"pial": "brain.stl"}),
        ([RH, LH], {"hemispheres": {"left": LH, "right": RH}}),
        (
            [LH, RH, *whites(LH_WHITE, RH_WHITE)],
            {"hemispheres": {"left": LH, "right": RH}, "white": [LH_WHITE, RH_WHITE]},
        ),
    ],
)
def test_a_brain_is_predicted_from_its_surfaces(
    predicted_from, surfaces, tmp_path, files, source
):
    assert predicted_from(*files) == Facts("23.4", "24.8 GW")
    section, study = configured(tmp_path)
    (entry,) = section["brains"]
    keys = {"pial", "hemispheres", "white"} & set(entry)
    found = yaml.safe_dump({key: entry[key] for key in keys})
    assert yaml.safe_load(found.replace(f"{surfaces}/", "")) == source
    (simulation,) = study.run_simulations
    assert study.chains[simulation.brain, "atlas"].weeks[1:] == (23, 24, 25)
    assert [group["ids"] for group in study.filled] == [[entry["id"]]]


@pytest.mark.parametrize(
    ("files", "facts"),
    [
        ([LH], [LH, "LEFT", "RIGHT"]),
        (["half.stl"], ["half.stl", "0.5", "LEFT", "RIGHT"]),
        (["ball.stl"], ["ball.stl", "0.522 mL"]),
        ([LH, LH], [f"{LH}, {LH}"]),
        ([LH, RH, "brain.stl"], ["brain.stl"]),
        ([LH_WHITE, RH_WHITE], [LH_WHITE, "--white"]),
        (["brain.stl", *whites("brain.stl", "half.stl")], ["--white", 2, 1]),
        (["brain.stl", *whites(LH)], [LH, "white"]),
        (["notes.txt"], ["notes.txt", ".nii.gz", ".stl"]),
        (["brain.stl", "--scheme", "feta-7"], ["--scheme", "feta-7"]),
        (["brain.stl", "--image", "brain.stl"], ["--image"]),
        (["brain.stl", "--folder", "half.stl"], ["half.stl"]),
        # labels are alone
        ([LABELS, "brain.stl"], ["parcellation.nii.gz", "brain.stl"]),
        ([LABELS, *whites("brain.stl")], ["parcellation.nii.gz", "brain.stl"]),
        (["brain.nii"], ["brain.nii", "brain.stl"]),
    ],
)
def test_files_that_are_not_one_brain_to_predict_are_refused(
    predicted_from, tmp_path, files, facts
):
    assert predicted_from(*files, code=2) == Facts(*facts)
    assert not (tmp_path / "gyriflow.yaml").exists()


@pytest.mark.parametrize("home", ["", "/proc/nobody", "file"])
def test_caches_are_with_the_study_where_the_home_folder_cannot_be_written(
    monkeypatch, tmp_path, home
):
    (tmp_path / "file").touch()
    monkeypatch.setenv(
        "HOME",
        str(tmp_path / home) if home == "file" else home or str(tmp_path / "home"),
    )
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    launch._set_cache(tmp_path)
    expected = str(tmp_path / ".snakemake" / "cache") if home else ""
    assert os.environ["XDG_CACHE_HOME"] == expected


@pytest.mark.parametrize(
    ("codes", "free", "expected"),
    [
        ([None, 1], 2**20, 5),
        ([2, 1], 2**20, 2),
        ([], 2**30, 1),
        ([None, 3, 2], 2**30, 3),
    ],
)
def test_a_full_disk_is_the_cause_where_no_step_has_named_another(
    tmp_path, monkeypatch, capsys, codes, free, expected
):
    monkeypatch.setattr(
        shutil, "disk_usage", lambda path: SimpleNamespace(total=2**31, free=free)
    )
    failures = [Message("error", "x", exit_code=code) for code in codes]
    assert launch._exit_code(1, failures, tmp_path) == expected
    assert bool(capsys.readouterr().err) == (expected == 5)
