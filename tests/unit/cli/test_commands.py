"""What the commands hand on to Snakemake, what they tell to type next, and in which
code they end."""

import os
import shutil
from contextlib import chdir
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from atlas_brains import atlas_brain, atlas_halves
from click.testing import CliRunner
from facts import Facts
from scan_trees import make_tree
from shapes import sphere

from gyriflow.cli import check as checking
from gyriflow.cli.check import coarse_cortices, deep_curved_folds
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


def test_a_run_on_this_machine_gets_its_cores(handed_on):
    assert "--cores" in handed_on()
    assert handed_on("--cores", "3")[:2] == ["--cores", "3"]
    assert handed_on("--cores", "all")[:2] == ["--cores", str(available_cores())]


@pytest.mark.parametrize("name", ["my.conf", "C.YAML", "study"])
def test_any_file_may_be_the_configuration_but_results_are_targets(
    handed_on, tmp_path, name
):
    result = tmp_path / "results" / "study" / "metrics.csv"
    result.parent.mkdir(parents=True)
    for path in (result, tmp_path / name):
        path.touch()
    assert handed_on("results/study/metrics.csv")[-1] == "results/study/metrics.csv"
    assert handed_on(name, "--until", "mesh", config=name)[-2:] == ["--until", "mesh"]


def test_the_cores_of_this_machine_are_no_limit_to_a_cluster(handed_on):
    assert "--cores" not in handed_on("--profile", "profiles/slurm")
    assert "--cores" not in handed_on("--executor=slurm")
    # but a limit that is asked for is one
    assert handed_on("--cores", "200", "--profile", "profiles/slurm")[:2] == [
        "--cores",
        "200",
    ]


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_missing_configuration_is_reported_in_one_line_where_it_is_named(
    monkeypatch, tmp_path, command
):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, [command, "no.yaml"])
    assert (done.exit_code, done.output.count("\n")) == (2, 1)
    assert done.output == Facts(f"{tmp_path / 'no.yaml'}:", "gyriflow init")
    done = CliRunner().invoke(main, [command])
    assert (done.exit_code, done.output) == (
        2,
        Facts(f"{tmp_path / 'gyriflow.yaml'}:", "gyriflow init"),
    )


def test_a_mistake_in_an_argument_is_one_line():
    done = CliRunner().invoke(main, ["run", "--cores", "two"], prog_name="gyriflow")
    assert (done.exit_code, done.output.count("\n")) == (2, 1)
    assert done.output == Facts("gyriflow:", "--cores", "two", "`gyriflow run --help`")


def test_an_unknown_option_is_refused_with_the_nearest_one(tmp_path):
    with pytest.raises(InputError, check=Facts("--corse", "--cores")):
        launch.main(["--directory", str(tmp_path), "--corse", "2"])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("in_profile", [False, True])
def test_an_executor_that_is_not_installed_is_one_line_with_its_package(
    tmp_path, capsys, in_profile
):
    profile = tmp_path / "profile"
    profile.mkdir()
    (profile / "config.yaml").write_text("executor: moon\njobs: 70\n")
    place = ["-n", "--directory", str(tmp_path)]
    arguments = ["--profile", str(profile)] if in_profile else ["-e", "moon"]
    with chdir(tmp_path):
        try:
            code = launch.main([*place, *arguments])
        except SystemExit as end:
            code = end.code
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "moon" in line]
    assert code == 2
    assert line == Facts("gyriflow:", "snakemake-executor-plugin-moon", "cluster.md")


def test_a_forecast_for_a_cluster_is_for_the_jobs_that_its_profile_runs_at_once(
    tmp_path,
):
    (tmp_path / "config.yaml").write_text("jobs: 70\n")
    profile = ["--profile", str(tmp_path)]
    assert max_jobs(profile) == 70
    assert max_jobs([*profile, "--jobs", "90"]) == 90
    assert max_jobs(["--retries", "2"]) is None


@pytest.mark.parametrize("folder", ["bids", "run", "data"])
def test_a_data_set_may_lie_in_a_folder_that_is_called_as_a_command(
    monkeypatch, tmp_path, folder
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / folder).mkdir()
    done = CliRunner().invoke(main, [folder, "out", "participant"])
    assert (done.exit_code, done.output) == (2, Facts(f"{folder}:", 0, ".nii.gz"))
    # the command by its own name
    assert (
        CliRunner().invoke(main, ["bids", folder, "out", "group"]).output == done.output
    )


FOUND = "fetal_SB_atlas_GA22_notoperated"
"""The id of the brain that is predicted, by the folder of its labels."""
LABELS = str(SHIPPED / "atlases" / "spina-bifida" / FOUND / "parcellation.nii.gz")


@pytest.fixture
def predicted(monkeypatch, tmp_path):
    """Return what `gyriflow predict` says, of the shipped brain of 22 GW by default,
    and note the run's arguments."""
    monkeypatch.setattr(
        launch,
        "main",
        lambda asked: (tmp_path / "asked.txt").write_text(" ".join(asked)) and 0,
    )

    def said(*given, files=(LABELS,)):
        arguments = [
            "predict",
            *files,
            "--directory",
            str(tmp_path),
            "--cores",
            "3",
            *given,
        ]
        return CliRunner().invoke(main, arguments)

    return said


def test_a_prediction_is_configured_with_the_weeks_of_an_atlas_and_run(
    predicted, tmp_path
):
    done = predicted("--week", "22.4", "--until", "24.5")
    assert done.exit_code == 0
    assert done.output == Facts("spina bifida aperta")
    config = load(yaml.safe_load((tmp_path / "gyriflow.yaml").read_text()))
    assert [brain.week for brain in config.brains] == [22.4, 22, 23, 24, 25]
    study = resolve(config)
    assert [
        (simulation.brain, simulation.shapes) for simulation in study.run_simulations
    ] == [(FOUND, "atlas")]
    assert list(study.chains[FOUND, "atlas"].later) == [
        brain.id for brain in config.brains[1:]
    ]
    asked = (tmp_path / "asked.txt").read_text()
    assert (
        asked
        == f"--configfile {tmp_path / 'gyriflow.yaml'} --cores 3 --directory {tmp_path}"
        " all export"
    )
    # the same call goes on, another one replaces nothing
    assert predicted("--week", "22.4", "--until", "24.5").exit_code == 0
    other = predicted("--week", "22.4", "--until", "24")
    assert (other.exit_code, other.output) == (
        2,
        Facts(tmp_path / "gyriflow.yaml", "--force"),
    )
    assert predicted("--week", "22.4", "--until", "24", "--force").exit_code == 0
    assert (
        load(yaml.safe_load((tmp_path / "gyriflow.yaml").read_text()))
        .runs["predicted"]
        .end_week
        == 24
    )
    assert (
        predicted(
            "--week", "22.4", "--until", "24", "--force", "--ensemble", "5"
        ).exit_code
        == 0
    )
    run = load(yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())).runs[
        "predicted"
    ]
    assert run.ensemble == 5


def test_a_prediction_has_the_mesh_that_its_errors_were_measured_with(
    predicted, tmp_path
):
    assert predicted("--week", "22.4", "--until", "24").exit_code == 0
    mesh = load(yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())).mesh
    tested = read_keys(SHIPPED / "norms" / "predictions.yaml")["mesh"]
    assert (mesh.order, mesh.surface_edge_mm) == (
        tested["order"],
        tested["surface_edge_mm"],
    )
    # the mesher of benchmarks/horizon.py, with which they were measured
    assert mesh.mesher == "tetgen"


def test_quadratic_elements_are_warned_of_on_the_way_to_deep_folds(predicted, tmp_path):
    asked = ("--week", "25", "--until", "34", "--atlas", "spina-bifida")
    assert predicted(*asked).exit_code == 0
    section = yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())
    assert list(deep_curved_folds(resolve(load(section)))) == []
    section["mesh"] = {"order": 2}
    (line,) = deep_curved_folds(resolve(load(section)))
    assert line == Facts("run predicted", "mesh.order: 1")
    section["folding"]["end_week"] = 30
    assert list(deep_curved_folds(resolve(load(section)))) == []


def test_a_quick_prediction_is_coarse_and_finds_files_from_the_working_directory(
    monkeypatch, predicted, tmp_path
):
    atlas = SHIPPED / "atlases" / "spina-bifida"
    monkeypatch.chdir(atlas.parent)
    asked = (
        "--week",
        "22",
        "--until",
        "24",
        "--quick",
        "--atlas",
        f"{atlas.name}/atlas.yaml",
        "--folder",
        atlas.name,
    )
    assert predicted(*asked).exit_code == 0
    monkeypatch.chdir(tmp_path)
    section = yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())
    assert (section["atlas"]["name"], section["atlas"]["folder"]) == (
        str(atlas / "atlas.yaml"),
        str(atlas),
    )
    study = resolve(load(section))
    assert all(
        Path(file).is_file() for brain in study.brains.values() for file in brain.files
    )
    # growth towards shapes is not by layers
    assert list(coarse_cortices(study)) == []
    assert study.run_simulations[0].settings.step_s == 7 * 86400
    assert study.config.mesh.order == 1
    # a path of the atlas has a quarter as many nodes on the surface
    assert study.config.growth.path_edge_mm == 2 * GrowthSettings().path_edge_mm


@pytest.mark.parametrize(
    ("end", "weeks"), [("30", [25, 28, 31]), ("32", [25, 28, 31, 34])]
)
def test_a_quick_prediction_uses_every_third_week_up_to_its_end(
    predicted, tmp_path, end, weeks
):
    asked = ("--week", "25", "--until", end, "--atlas", "spina-bifida")
    assert predicted(*asked, "--quick").exit_code == 0
    assert load(yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())).atlas[
        0
    ].weeks == tuple(weeks)
    assert predicted(*asked, "--force").exit_code == 0
    assert load(yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())).atlas[
        0
    ].weeks == tuple(range(25, 35))


def test_a_dry_prediction_leaves_nothing_behind(monkeypatch, predicted, tmp_path):
    seen = []
    monkeypatch.setattr(
        checking, "plan", lambda config, *_, **__: seen.append(config.is_file()) or []
    )
    before = set(tmp_path.rglob("*"))
    dry = (
        "--week",
        "22",
        "--until",
        "24",
        "--directory",
        str(tmp_path / "new"),
        "--dry-run",
    )
    assert predicted(*dry).exit_code == 0
    assert (seen, set(tmp_path.rglob("*"))) == ([True], before)
    # what it would not replace, it says then
    (tmp_path / "gyriflow.yaml").write_text("start: mine")
    assert predicted("--week", "22", "--until", "24", "-n").output == Facts(
        tmp_path / "gyriflow.yaml", "--force"
    )
    assert (tmp_path / "gyriflow.yaml").read_text() == "start: mine"


@pytest.fixture
def data_set(monkeypatch, tmp_path):
    """A BIDS data set of two participants in the current folder, data."""
    monkeypatch.chdir(tmp_path)
    # set in this process, and removed after the test
    monkeypatch.setenv(launch.MEASURE_ONLY_VAR, "")
    make_tree(
        tmp_path / "data",
        labels=[f"sub-0{number}/anat/sub-0{number}_dseg.nii.gz" for number in (1, 2)],
        tables={
            "participants.tsv": [
                "participant_id scan_age",
                "sub-01 24.1",
                "sub-02 25.3",
            ]
        },
    )
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "directory", "option"),
    [
        (
            ("data", "out", "participant", "--participant-label", "02"),
            "out/work",
            "--work-dir",
        ),
        (("measure", "data", "-d", "study"), "study", "--directory"),
        (
            ("predict", LABELS, "--week", "22", "--until", "24", "-d", "study"),
            "study",
            "--directory",
        ),
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


def test_a_dry_call_for_a_bids_data_set_leaves_the_configuration_of_a_run(
    monkeypatch, data_set
):
    seen = []
    monkeypatch.setattr(
        checking, "plan", lambda config, *_, **__: seen.append(read_keys(config)) or []
    )
    before = set(data_set.rglob("*"))
    dry = ("data", "out", "participant", "--participant-label", "02", "-n")
    assert CliRunner().invoke(main, dry).exit_code == 0
    assert [brain["id"] for brain in seen[0]["brains"]] == ["sub-02"]
    assert set(data_set.rglob("*")) == before


@pytest.mark.parametrize(
    ("fold", "is_told"), [((), True), (("--no-fold",), False), (("--fold",), False)]
)
def test_settings_that_only_matter_to_fold_are_named_if_nothing_is_asked_to_fold(
    monkeypatch, data_set, fold, is_told
):
    monkeypatch.setattr(checking, "plan", lambda *_, **__: [])
    settings = "start: all\nfolding: {end_week: 30}\nmetrics: {spangy_modes: B4}\n"
    (data_set / "my.yaml").write_text(settings)
    dry = ("data", "out", "participant", "--settings", "my.yaml", "-n", *fold)
    done = CliRunner().invoke(main, dry)
    assert done.exit_code == 0
    told = [line for line in done.stderr.splitlines() if "--settings" in line]
    assert told == [Facts("--fold", "start, folding")] * is_told
    # a section that measuring uses is not among them
    assert not any("metrics" in line for line in told)


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
    done = predicted("--week", "22.4", "--until", until, *more)
    assert (done.exit_code, done.output) == (2, Facts(*facts))
    assert not (tmp_path / "gyriflow.yaml").exists()


def test_check_takes_a_folder_as_measure_does_and_writes_nothing(tmp_path, monkeypatch):
    rows = [
        "participant_id gestational_age",
        "sub-01 24.1",
        *(f"sub-{number:02} n/a" for number in range(2, 8)),
    ]
    names = [f"sub-{number:02}_dseg.nii.gz" for number in range(1, 8)]
    make_tree(tmp_path, labels=names, tables={"participants.tsv": rows})
    planned = []

    def plan(config, *_, **__):
        planned.append(yaml.safe_load(config.read_text()))
        return []

    monkeypatch.setattr(checking, "plan", plan)
    # set in this process, and removed after the test
    monkeypatch.setenv(launch.MEASURE_ONLY_VAR, "")
    before = set(tmp_path.rglob("*"))
    options = ("--scheme", "spina-bifida-atlas", "-d", str(tmp_path / "new"))
    done = CliRunner().invoke(main, ["check", str(tmp_path), *options])
    assert (done.exit_code, set(tmp_path.rglob("*"))) == (2, before)
    assert [brain["id"] for brain in planned[0]["brains"]] == ["sub-01"]
    assert done.output == Facts(f"{tmp_path}: 1 brain, measured only", "6 problems")
    # where the age is from
    assert done.output == Facts("participants.tsv row 2")
    # six scans with one fault: three lines and a number
    assert done.output.count("n/a") == 3
    assert done.output == Facts("3 more")
    # the options are those of measure
    (tmp_path / "gyriflow.yaml").write_text("brains: []")
    for command in ("check", "measure"):
        done = CliRunner().invoke(main, [command, str(tmp_path), "--files", "*x*"])
        assert (done.exit_code, done.output) == (2, Facts("--files", "init FOLDER"))


def test_a_current_folder_that_was_deleted_is_named(tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    done = CliRunner().invoke(main, ["check"])
    assert (done.exit_code, done.output) == (
        2,
        Facts("the current folder no longer exists"),
    )


def test_a_file_that_is_not_there_is_answered_with_what_is(predicted_from):
    done = predicted_from("brain.nii", "--week", "23.4")
    assert (done.exit_code, done.output) == (
        2,
        Facts("brain.nii", "there is brain.stl"),
    )
    # of another kind than expected, and there
    done = predicted_from("brain.stl", "--week", "23.4", "--folder", "half.stl")
    assert (done.exit_code, "there is" in done.output) == (2, False)


@pytest.fixture(scope="module")
def surfaces(tmp_path_factory):
    """Surface files of the shipped brain of 24 GW and of a ball, by name."""
    folder, (left, right) = tmp_path_factory.mktemp("surfaces"), atlas_halves()
    meshes = {
        "brain": atlas_brain(),
        "half": left,
        "ball": sphere(5.0),
        "lh": left,
        "rh": right,
    }
    names = {
        name: f"{name}.pial.surf.gii" if name in ("lh", "rh") else f"{name}.stl"
        for name in meshes
    }
    for name, mesh in meshes.items():
        write_surface(folder / names[name], mesh)
    write_surface(folder / "lh.white.surf.gii", left)
    write_surface(folder / "rh.white.surf.gii", right)
    (folder / "notes.txt").write_text("none")
    return folder


@pytest.fixture
def predicted_from(monkeypatch, predicted, surfaces):
    """Return the outcome of `gyriflow predict` for files of that folder, in which it
    stands."""
    monkeypatch.chdir(surfaces)
    return lambda *given: predicted("--until", "24.8", files=given)


@pytest.mark.parametrize(
    ("files", "source"),
    [
        (["brain.stl"], {"pial": "brain.stl"}),
        (
            ["rh.pial.surf.gii", "lh.pial.surf.gii"],
            {"hemispheres": {"left": "lh.pial.surf.gii", "right": "rh.pial.surf.gii"}},
        ),
        (
            [
                "lh.pial.surf.gii",
                "rh.pial.surf.gii",
                "--white",
                "lh.white.surf.gii",
                "--white",
                "rh.white.surf.gii",
            ],
            {
                "hemispheres": {
                    "left": "lh.pial.surf.gii",
                    "right": "rh.pial.surf.gii",
                },
                "white": ["lh.white.surf.gii", "rh.white.surf.gii"],
            },
        ),
    ],
)
def test_a_brain_is_predicted_from_its_surfaces(
    predicted_from, surfaces, tmp_path, files, source
):
    done = predicted_from(*files, "--week", "23.4")
    assert (done.exit_code, done.output) == (0, Facts("23.4", "24.8 GW"))
    section = yaml.safe_load((tmp_path / "gyriflow.yaml").read_text())
    (entry,) = section["brains"]
    found = {
        key: entry[key] for key in entry if key in ("pial", "hemispheres", "white")
    }
    plain = yaml.safe_dump(found).replace(f"{surfaces}/", "")
    assert yaml.safe_load(plain) == source
    study = resolve(load(section))
    (simulation,) = study.run_simulations
    chain = study.chains[simulation.brain, "atlas"]
    assert chain.weeks[1:] == (23, 24, 25)
    assert [group["ids"] for group in study.filled] == [[entry["id"]]]


@pytest.mark.parametrize(
    ("given", "facts"),
    [
        (["brain.stl"], ["--week"]),
        (["lh.pial.surf.gii", "--week", "23"], ["lh.pial.surf.gii", "LEFT", "RIGHT"]),
        (["half.stl", "--week", "23"], ["half.stl", "0.5", "LEFT", "RIGHT"]),
        (["ball.stl", "--week", "23"], ["ball.stl", "0.522 mL"]),
        (
            ["lh.pial.surf.gii", "lh.pial.surf.gii", "--week", "23"],
            ["lh.pial.surf.gii, lh.pial.surf.gii"],
        ),
        (
            ["lh.pial.surf.gii", "rh.pial.surf.gii", "brain.stl", "--week", "23"],
            ["brain.stl"],
        ),
        (
            ["lh.white.surf.gii", "rh.white.surf.gii", "--week", "23"],
            ["lh.white.surf.gii", "--white"],
        ),
        (
            [
                "brain.stl",
                "--white",
                "brain.stl",
                "--white",
                "half.stl",
                "--week",
                "23",
            ],
            ["--white", 2, 1],
        ),
        (
            ["brain.stl", "--white", "lh.pial.surf.gii", "--week", "23"],
            ["lh.pial.surf.gii", "white"],
        ),
        (["notes.txt", "--week", "23"], ["notes.txt", ".nii.gz", ".stl"]),
        (["brain.stl", "--scheme", "feta-7", "--week", "23"], ["--scheme", "feta-7"]),
        (["brain.stl", "--image", "brain.stl", "--week", "23"], ["--image"]),
    ],
)
def test_files_that_are_not_one_brain_to_predict_are_refused(
    predicted_from, tmp_path, given, facts
):
    done = predicted_from(*given)
    assert (done.exit_code, done.output) == (2, Facts(*facts))
    assert not (tmp_path / "gyriflow.yaml").exists()


def test_labels_are_predicted_alone(predicted_from):
    for more in (["brain.stl"], ["--white", "brain.stl"]):
        done = predicted_from(LABELS, *more, "--week", "23")
        assert (done.exit_code, done.output) == (
            2,
            Facts("parcellation.nii.gz", "brain.stl"),
        )


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
    launch.set_cache(tmp_path)
    expected = str(tmp_path / ".snakemake" / "cache") if home else ""
    assert os.environ["XDG_CACHE_HOME"] == expected


@pytest.mark.parametrize(
    ("codes", "free", "expected"),
    [
        ([], 2**20, 5),
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
    assert launch.exit_code(1, failures, tmp_path) == expected
    assert bool(capsys.readouterr().err) == (expected == 5)
