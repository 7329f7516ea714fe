"""The folding program as users start it: outputs, ranks, interruptions, and how it ends."""

import re
import shutil
import subprocess
import sys
from collections import namedtuple
from contextlib import suppress

import numpy as np
import pandas as pd
import psutil
import pytest
import yaml
from mpi4py import MPI
from shapes import ellipsoid_mesh
from trimesh.creation import icosphere
from written_frames import element_field

from gyriflow.errors import SolverError, StorageError
from gyriflow.folding.__main__ import require_space
from gyriflow.folding.checkpoint import read_checkpoint, run_key
from gyriflow.folding.ladder import NotConvergedError
from gyriflow.folding.run import run
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, is_closed
from gyriflow.io.files import read_json
from gyriflow.io.frames import read_field, read_positions, read_tets, read_weeks
from gyriflow.io.maps import write_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_tetrahedral_mesh
from gyriflow.mesh.curving import curve_edges
from gyriflow.parameters.reading import parameters_from

pytestmark = pytest.mark.slow

TIGHT = {"newton_tolerance": 1e-12, "krylov_tolerance": 1e-10}
WEEK = {
    "start_week": 21.0,
    "end_week": 21.5,
    "output_weeks": [21.0, 21.25, 21.5],
    "fissure_x_mm": 0.0,
    "thickness_mm": 3.0,
}

MANY_STEPS = 4000.0


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "brain.xdmf"
    write_tetrahedral_mesh(path, ellipsoid_mesh(8, (20.0, 26.0, 18.0)))
    return path


def command(mesh, out, ranks=1, **changes):
    params = out.parent / f"{out.name}.yaml"
    params.write_text(yaml.safe_dump(WEEK | changes))
    program = [sys.executable, "-m", "gyriflow.folding", str(mesh), "--params", str(params), "--out", str(out)]
    return ["mpiexec", "-n", str(ranks), *program]


def fold(mesh, out, ranks=1, **changes):
    return subprocess.run(
        command(mesh, out, ranks, **changes), capture_output=True, text=True, timeout=300, check=False
    )


def failing_after(steps):
    """Returns a step of the folding that fails once a number of steps has been done."""
    honest = Folding.step

    def step(self, state, step_s):
        if len(state.rows) == steps:
            raise NotConvergedError("no way on")
        return honest(self, state, step_s)

    return step


@pytest.fixture(scope="module")
def tight_run(mesh, tmp_path_factory):
    out = tmp_path_factory.mktemp("tight") / "out"
    done = fold(mesh, out, solver=TIGHT)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


@pytest.fixture(scope="module")
def default_run(mesh, tmp_path_factory):
    """A run on two ranks at default tolerances: its folder and what it printed."""
    out = tmp_path_factory.mktemp("default") / "out"
    done = fold(mesh, out, 2)
    assert done.returncode == 0, done.stdout + done.stderr
    return out, done.stdout


def test_a_run_leaves_every_file_and_nothing_else(tight_run):
    assert {p.name for p in tight_run.iterdir()} == {
        ".lock", "frames.h5", "frames.xdmf", "steps.csv", "summary.json", "zones.json"
    }  # fmt: skip
    assert read_weeks(tight_run / "frames.h5") == [21.0, 21.25, 21.5]
    steps = pd.read_csv(tight_run / "steps.csv")
    assert steps["week"].iloc[-1] == pytest.approx(21.5)
    assert (steps["min_J"] > 0).all()
    moved = read_positions(tight_run / "frames.h5", 21.5) - read_positions(tight_run / "frames.h5", 21.0)
    np.testing.assert_allclose(moved, read_field(tight_run / "frames.h5", 21.5, "displacement_mm"), atol=1e-12)
    assert read_json(tight_run / "summary.json")["steps"] == len(steps)


def curved_brain(path):
    """Writes an ellipsoid of quadratic elements that follow it."""
    ball = icosphere(subdivisions=4)
    surface = TriangleMesh(ball.vertices * [20.0, 26.0, 18.0], ball.faces)
    write_tetrahedral_mesh(path, curve_edges(ellipsoid_mesh(4, (20.0, 26.0, 18.0)), surface))
    return path


@pytest.mark.fault(33, 35)
@pytest.mark.promise(11)
def test_quadratic_elements_go_through_interruptions_and_any_number_of_ranks(tmp_path, monkeypatch):
    path = curved_brain(tmp_path / "curved.xdmf")
    settings = {
        "solver": TIGHT,
        "stress_memory_gw": 1.0,
        "fields": ["displacement", "cortex_weight", "stress", "strain"],
    }
    assert fold(path, tmp_path / "three", 3, **settings).returncode == 0
    mesh, p = read_tetrahedral_mesh(path), parameters_from(WEEK | settings)
    zones = zones_of_run(mesh, p)
    with monkeypatch.context() as patch:
        patch.setattr(Folding, "step", failing_after(3))
        with pytest.raises(SolverError):
            run(MPI.COMM_SELF, mesh, zones, p, {}, tmp_path / "one")
    run(MPI.COMM_SELF, mesh, zones, p, {}, tmp_path / "one")
    assert read_json(tmp_path / "one" / "summary.json")["resumed_after_step"] == 3
    one, three = (tmp_path / name / "frames.h5" for name in ("one", "three"))
    assert read_tets(one).shape == (len(mesh.tets), 10)
    moved = np.abs(read_positions(one, 21.5) - mesh.vertices).max()
    assert np.abs(read_positions(one, 21.5) - read_positions(three, 21.5)).max() <= 1e-8 * moved
    for field in ("von_mises_pa", "elastic_strain"):
        values = element_field(one, 21.5, field)
        assert values.shape == (len(mesh.tets),)
        np.testing.assert_allclose(values, element_field(three, 21.5, field), rtol=1e-4, atol=1e-4 * values.max())
    surface, _ = boundary_surface(TetrahedralMesh(read_positions(one, 21.5), read_tets(one)))
    assert is_closed(surface)


def test_every_output_week_is_hit_although_steps_do_not_divide_it(tight_run):
    weeks = pd.read_csv(tight_run / "steps.csv")["week"].to_numpy()
    for week in (21.25, 21.5):
        assert np.abs(weeks - week).min() < 1e-12


@pytest.mark.promise(11)
@pytest.mark.parametrize("ranks", [2, 3])
def test_the_result_does_not_depend_on_the_number_of_ranks(mesh, tight_run, tmp_path, ranks):
    assert fold(mesh, tmp_path / "out", ranks, solver=TIGHT).returncode == 0
    one, more = (read_positions(out / "frames.h5", 21.5) for out in (tight_run, tmp_path / "out"))
    largest = np.linalg.norm(one - read_positions(tight_run / "frames.h5", 21.0), axis=1).max()
    assert np.linalg.norm(more - one, axis=1).max() <= 1e-8 * largest


def test_default_tolerances_are_good_to_a_thousandth_of_a_millimetre(tight_run, default_run):
    one, other = (read_positions(out / "frames.h5", 21.5) for out in (tight_run, default_run[0]))
    assert np.linalg.norm(other - one, axis=1).max() <= 1e-3


@pytest.mark.fault(30, 38)
def test_memory_and_a_shortened_step_are_said_before_the_solve(default_run):
    before, _, _ = default_run[1].partition("step    1")
    assert "3072 elements, 2187 unknowns, 2 ranks, about 516 MiB" in before
    assert "step_s 43200 does not divide the time from GW 21 to 21.25: the last step there is shortened" in before


@pytest.fixture(scope="module")
def long_run(mesh, tmp_path_factory):
    """A run of so many steps that it does not end before it is killed, uninterrupted."""
    out = tmp_path_factory.mktemp("long") / "out"
    done = fold(mesh, out, solver=TIGHT, step_s=MANY_STEPS)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def kill(process):
    """Kills a program with its ranks, which Open MPI's daemon puts into groups of their own."""
    ranks = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    for rank in ranks:
        with suppress(psutil.NoSuchProcess):
            rank.kill()
    psutil.wait_procs(ranks, timeout=10)


def killed_after(step, arguments):
    """Starts the program, kills it when it has printed a step, and returns what it printed."""
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        printed = []
        for line in process.stdout:
            printed.append(line)
            if f"step {step:4d}" in line:
                kill(process)
                break
    return "".join(printed)


@pytest.mark.fault(33, 35)
@pytest.mark.promise(3)
@pytest.mark.parametrize(("first", "then"), [(1, 1), (2, 3)])
def test_a_killed_run_goes_on_and_ends_where_an_uninterrupted_one_does(mesh, long_run, tmp_path, first, then):
    out = tmp_path / "out"
    printed = killed_after(3, command(mesh, out, first, solver=TIGHT, step_s=MANY_STEPS))
    assert not (out / "frames.h5").exists(), printed
    again = fold(mesh, out, then, solver=TIGHT, step_s=MANY_STEPS)
    assert again.returncode == 0, again.stderr
    assert "going on from the checkpoint after step" in again.stdout
    assert read_json(out / "summary.json")["resumed_after_step"] >= 3
    one, more = (read_positions(folder / "frames.h5", 21.5) for folder in (long_run, out))
    largest = np.linalg.norm(one - read_positions(out / "frames.h5", 21.0), axis=1).max()
    assert np.linalg.norm(more - one, axis=1).max() <= 1e-8 * largest
    assert len(pd.read_csv(out / "steps.csv")) == len(pd.read_csv(long_run / "steps.csv"))


@pytest.mark.fault(34)
@pytest.mark.promise(4)
def test_a_checkpoint_of_other_parameters_waits_for_their_return(mesh, long_run, tmp_path):
    out = tmp_path / "out"
    killed_after(2, command(mesh, out, step_s=MANY_STEPS))
    done = fold(mesh, out, thickness_mm=2.5)
    assert done.returncode == 0
    assert "another mesh or other parameters: not used, kept for a return" in done.stdout
    assert "going on" not in done.stdout
    again = fold(mesh, out, step_s=MANY_STEPS)
    assert again.returncode == 0
    assert "going on from the checkpoint after step" in again.stdout
    assert not list(out.glob("checkpoint-*"))
    one, resumed = (read_positions(folder / "frames.h5", 21.5) for folder in (long_run, out))
    assert np.linalg.norm(resumed - one, axis=1).max() <= 1e-3


@pytest.mark.fault(29)
def test_without_growth_nothing_moves_at_all(mesh, tmp_path):
    done = fold(mesh, tmp_path / "out", 2, growth_rate_per_s=0.0)
    assert done.returncode == 0
    frames = tmp_path / "out" / "frames.h5"
    assert (read_field(frames, 21.5, "displacement_mm") == 0).all()


@pytest.mark.fault(32)
def test_a_step_that_is_far_too_long_is_halved_and_the_run_goes_on(mesh, tmp_path):
    done = fold(mesh, tmp_path / "out", step_s=302400.0, growth_rate_per_s=3e-6, solver={"max_newton": 1})
    assert done.returncode == 0, done.stdout + done.stderr
    assert "trying" in done.stdout
    steps = pd.read_csv(tmp_path / "out" / "steps.csv")
    assert steps["dt_s"].min() < 302400
    assert (steps["min_J"] > 0).all()


@pytest.mark.fault(32)
def test_at_the_smallest_step_the_run_ends_in_code_four(mesh, tmp_path):
    hard = {"growth_rate_per_s": 1e-5, "step_s": 86400.0, "solver": {"max_halvings": 0, "max_newton": 1}}
    done = fold(mesh, tmp_path / "out", 2, **hard)
    assert done.returncode == 4, done.stdout + done.stderr
    assert "fails even with 86400 s" in done.stderr
    assert re.search(r"smallest det F \S+ in element \d+ at \[.*\] mm, largest residual .* at vertex \d+", done.stderr)
    assert not (tmp_path / "out" / "frames.h5").exists()


@pytest.mark.fault(32)
@pytest.mark.promise(5)
def test_the_last_good_state_of_a_failed_run_serves_an_earlier_end(mesh, tmp_path, monkeypatch, capsys):
    brain = read_tetrahedral_mesh(mesh)
    weeks = WEEK | {"output_weeks": [21.0, 21.25, 21.5], "ranks": 1}
    parameters = parameters_from(weeks)
    monkeypatch.setattr(Folding, "step", failing_after(5))
    zones = zones_of_run(brain, parameters)
    with pytest.raises(SolverError, match="The last good state is kept"):
        run(MPI.COMM_SELF, brain, zones, parameters, {}, tmp_path)
    key = run_key(brain, parameters, {})
    state, _ = read_checkpoint(tmp_path / f"checkpoint-{key}" / "state.h5", key)
    assert len(state.rows) == 5
    earlier = parameters_from(weeks | {"end_week": 21.25, "output_weeks": [21.0, 21.25]})
    run(MPI.COMM_SELF, brain, zones, earlier, {}, tmp_path)
    assert "going on from the checkpoint after step 5" in capsys.readouterr().out
    assert read_weeks(tmp_path / "frames.h5") == [21.0, 21.25]
    assert pd.read_csv(tmp_path / "steps.csv")["week"].iloc[-1] == pytest.approx(21.25)


@pytest.mark.fault(55)
def test_a_run_that_may_diverge_ends_with_the_weeks_that_it_has_reached(mesh, tmp_path, monkeypatch):
    brain = read_tetrahedral_mesh(mesh)
    parameters = parameters_from(WEEK)
    monkeypatch.setattr(Folding, "step", failing_after(5))
    zones = zones_of_run(brain, parameters)
    run(MPI.COMM_SELF, brain, zones, parameters, {}, tmp_path, may_diverge=True)
    summary = read_json(tmp_path / "summary.json")
    assert read_weeks(tmp_path / "frames.h5") == summary["weeks"] == [21.0, 21.25]
    assert "no way on" in summary["diverged"]
    assert summary["reached_week"] == pytest.approx(21.25 + 1 / 14)
    assert not list(tmp_path.glob("checkpoint-*"))
    # one that cannot take a single step has its start
    monkeypatch.setattr(Folding, "step", failing_after(0))
    run(MPI.COMM_SELF, brain, zones, parameters, {}, tmp_path, may_diverge=True)
    summary = read_json(tmp_path / "summary.json")
    assert (summary["steps"], summary["weeks"], summary["reached_week"]) == (0, [21.0], 21.0)


@pytest.mark.fault(33)
def test_stress_is_remembered_across_an_interruption(mesh, tmp_path, monkeypatch, capsys):
    brain = read_tetrahedral_mesh(mesh)
    parameters = parameters_from(WEEK | {"stress_memory_gw": 0.5, "solver": TIGHT})
    zones = zones_of_run(brain, parameters)
    run(MPI.COMM_SELF, brain, zones, parameters, {}, tmp_path / "whole")
    monkeypatch.setattr(Folding, "step", failing_after(4))
    with pytest.raises(SolverError):
        run(MPI.COMM_SELF, brain, zones, parameters, {}, tmp_path / "cut")
    monkeypatch.undo()
    run(MPI.COMM_SELF, brain, zones, parameters, {}, tmp_path / "cut")
    assert "going on from the checkpoint after step 4" in capsys.readouterr().out
    whole, cut = (read_positions(tmp_path / name / "frames.h5", 21.5) for name in ("whole", "cut"))
    forgetful = parameters_from(WEEK | {"solver": TIGHT})
    run(MPI.COMM_SELF, brain, zones, forgetful, {}, tmp_path / "forgetful")
    other = read_positions(tmp_path / "forgetful" / "frames.h5", 21.5)
    assert np.abs(cut - whole).max() <= 1e-8 * np.abs(whole - brain.vertices).max()
    assert np.abs(other - whole).max() > 1e-3


def test_a_map_of_the_thickness_acts_where_it_says_on_any_ranks(mesh, tmp_path):
    brain = read_tetrahedral_mesh(mesh)
    y = brain.vertices[:, 1]
    write_maps(tmp_path / "maps.h5", {"thickness_mm": np.where(y > 0, 4.0, 2.0)})
    ends = []
    for ranks in (1, 2):
        out = tmp_path / f"out{ranks}"
        settings = {"thickness_mm": {"map": "thickness_mm"}, "solver": TIGHT, "fields": ["cortex_weight"]}
        call = [*command(mesh, out, ranks, **settings), "--maps", str(tmp_path / "maps.h5")]
        done = subprocess.run(call, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        ends.append(read_positions(out / "frames.h5", 21.5))
    assert np.abs(ends[0] - ends[1]).max() <= 1e-8 * np.abs(ends[0] - brain.vertices).max()
    weight = read_field(tmp_path / "out1" / "frames.h5", 21.0, "cortex_weight")
    inside = np.abs(weight - 0.5) < 0.499
    assert weight[inside & (y > 0)].mean() > weight[inside & (y < 0)].mean()

    write_maps(tmp_path / "short.h5", {"thickness_mm": np.ones(7)})
    call[-1] = str(tmp_path / "short.h5")
    done = subprocess.run(call, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 2
    assert done.stderr.count("the map thickness_mm does not fit the mesh") == 1


@pytest.mark.fault(37)
def test_a_second_run_in_the_same_folder_is_refused(mesh, tmp_path):
    out = tmp_path / "out"
    slow = command(mesh, out, end_week=30.0, output_weeks=[21.0, 30.0])
    with subprocess.Popen(slow, stdout=subprocess.PIPE, text=True) as first:
        next(line for line in first.stdout if "step" in line)
        second = fold(mesh, out)
        kill(first)
    assert second.returncode == 5
    assert "another folding run works in this folder" in second.stderr


# the limit stands for the disk's end, set after MPI has made its own files
FULL_DISK = """
import resource, runpy
from mpi4py import MPI
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
runpy.run_module("gyriflow.folding", run_name="__main__")
"""


@pytest.mark.fault(36)
@pytest.mark.promise(2)
def test_a_disk_that_fills_ends_in_code_five_and_earlier_files_stay(mesh, default_run, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(default_run[0], out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    program = [sys.executable, "-c", FULL_DISK, *command(mesh, out)[6:]]
    done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 5, done.stdout + done.stderr
    assert "cannot be written" in done.stderr
    assert "Free disk space" in done.stderr
    assert {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()} == before
    assert not [path for path in out.rglob("*") if path.is_file() and path.parent != out]


@pytest.mark.fault(36)
def test_a_folder_that_cannot_be_made_ends_in_code_five(mesh, tmp_path):
    (tmp_path / "file").touch()
    arguments = command(mesh, tmp_path / "out")
    done = subprocess.run(
        [*arguments[:-1], str(tmp_path / "file" / "out")], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 5, done.stdout + done.stderr
    assert "file/out: cannot be written" in done.stderr


@pytest.mark.fault(36)
def test_a_disk_without_room_is_refused_before_the_solve(tmp_path, monkeypatch):
    brain, parameters = ellipsoid_mesh(4, (20.0, 26.0, 18.0)), parameters_from(WEEK)
    room = namedtuple("usage", "total used free")
    monkeypatch.setattr("shutil.disk_usage", lambda path: room(10**9, 0, 10**9))
    require_space(tmp_path, brain, parameters)
    monkeypatch.setattr("shutil.disk_usage", lambda path: room(10**9, 10**9, 1000))
    with pytest.raises(StorageError, match="no room for this run"):
        require_space(tmp_path, brain, parameters)


@pytest.mark.fault(28)
def test_bad_parameters_end_in_code_two(mesh, tmp_path):
    done = fold(mesh, tmp_path / "out", 2, thicknes_mm=1.0)
    assert done.returncode == 2
    assert "thicknes_mm" in done.stderr
    missing = fold(tmp_path / "none.xdmf", tmp_path / "out")
    assert missing.returncode == 2
    assert "none.xdmf" in missing.stderr
