"""The folding program as users start it: outputs, ranks, and how it ends."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from folding_program import IMPATIENT, TIGHT, WEEK, command, end_of, fold, kill
from processes import ran
from shapes import ellipsoid_mesh

from gyriflow.errors import StorageError
from gyriflow.folding.__main__ import _require_space
from gyriflow.io.files import read_json
from gyriflow.io.frames import read_field, read_weeks
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_maps
from gyriflow.messages import read_events, read_messages
from gyriflow.settings.folding import parameters_from

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def tight_run(mesh, tmp_path_factory):
    out = tmp_path_factory.mktemp("tight") / "out"
    fold(mesh, out, **TIGHT)
    return out


@pytest.fixture(scope="module")
def default_run(mesh, tmp_path_factory):
    """A run on two ranks at default tolerances: its folder and what it printed."""
    out = tmp_path_factory.mktemp("default") / "out"
    return out, fold(mesh, out, 2).stdout


def test_a_run_leaves_every_file_and_nothing_else(tight_run):
    assert {p.name for p in tight_run.iterdir()} == {
        ".lock",
        "frames.h5",
        "frames.xdmf",
        "steps.csv",
        "summary.json",
        "zones.json",
    }
    frames = tight_run / "frames.h5"
    assert read_weeks(frames) == [21.0, 21.25, 21.5]
    steps = pd.read_csv(tight_run / "steps.csv")
    # every output week is hit, although steps do not divide it
    for week in (21.25, 21.5):
        assert np.abs(steps["week"] - week).min() < 1e-12
    assert (steps["min_J"] > 0).all()
    assert read_json(tight_run / "summary.json")["steps"] == len(steps)


def test_memory_is_printed_and_default_tolerances_are_good_to_a_micrometre(
    tight_run, default_run
):
    out, printed = default_run
    before, _, _ = printed.partition("step    1")
    assert Facts(3072, 2187, 2, "556 MiB") in before.splitlines()
    misfit_mm = np.linalg.norm(end_of(out) - end_of(tight_run), axis=1)
    assert misfit_mm.max() <= 1e-3


@pytest.mark.extended
def test_ziglang_compiles_forms_and_c_code_where_there_is_no_compiler(
    mesh, tight_run, tmp_path
):
    packages = tmp_path / "packages"
    install = ["-m", "pip", "install", "--quiet", "ziglang", "--target"]
    subprocess.run([sys.executable, *install, packages], check=True, timeout=600)
    environment = os.environ | {
        "PATH": str(Path(sys.executable).parent),
        "PYTHONPATH": f"{packages}:{os.environ['PYTHONPATH']}",
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
    }
    environment.pop("CC", None)
    program = command(mesh, tmp_path / "out", **TIGHT)
    done = ran(*program, env=environment, timeout_s=900)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "cache" / "zig").is_dir()
    assert end_of(tmp_path / "out") == pytest.approx(end_of(tight_run), abs=1e-5)


def test_too_little_shared_memory_is_named(mesh, tmp_path):
    on_small_disk = 'mount -t tmpfs -o size=1m tmpfs /dev/shm && exec "$@"'
    mounted = ["unshare", "--map-root-user", "--mount", "sh", "-c", on_small_disk, "sh"]
    done = ran(*mounted, *command(mesh, tmp_path / "out", 2))
    if "unshare" in done.stderr:
        pytest.skip("this machine allows no mounts")
    log = tmp_path / "simulate.log"
    ended = ran(sys.executable, "-m", "gyriflow.step", str(done.returncode), log)
    assert ended.returncode == StorageError.exit_code
    assert log.read_text() == Facts("/dev/shm", "6 MB", "--shm-size")
    assert read_messages(log)[0].text in log.read_text()


def test_warnings_and_progress_of_a_run_without_growth_are_printed_and_written(
    mesh, tmp_path
):
    # linear elements lock
    done = fold(mesh, tmp_path / "out", 2, growth_rate_per_s=0.0, poisson_ratio=0.48)
    # without growth nothing moves at all
    frames = tmp_path / "out" / "frames.h5"
    assert (read_field(frames, 21.5, "displacement_mm") == 0).all()
    messages = read_messages(tmp_path / "out.log")
    assert {message.level for message in messages} == {"warning"}
    assert "poisson_ratio is 0.48" in messages[0].text
    printed = done.stdout.splitlines()
    assert all(f"warning: {message.text}" in printed for message in messages)
    progress = [row for row in read_events(tmp_path / "out.log") if "event" in row]
    assert [row["event"] for row in progress[:2]] == ["size", "step"]
    assert (progress[0]["elements"], progress[0]["ranks"]) == (3072, 2)
    last, used = progress[-2:]
    assert last["week"] == pytest.approx(last["end_week"])
    assert used["event"] == "usage"


def test_at_the_smallest_step_the_run_ends_in_code_four(mesh, tmp_path):
    hard = {"growth_rate_per_s": 1e-5, "step_s": 86400.0, "max_halvings": 0}
    fold(mesh, tmp_path / "out", 2, code=4, program=IMPATIENT, **hard)
    assert not (tmp_path / "out" / "frames.h5").exists()
    # all ranks fail alike; what an aborted rank prints may be lost
    (message,) = read_messages(tmp_path / "out.log")
    # no step is halved: a whole one fails, or what is left before the first output
    assert re.search(r"\b(86400|64800) s", message.text)
    assert re.search(r"element \d+ at \[.*\] mm.* vertex \d+", message.text)
    assert message.exit_code == 4
    assert "element" in message.found
    assert "max_halvings" in message.remedy


def test_a_thickness_map_acts_at_its_vertices_on_any_number_of_ranks(mesh, tmp_path):
    brain = read_tetrahedral_mesh(mesh)
    y = brain.vertices[:, 1]
    write_maps(tmp_path / "maps.h5", {"thickness_mm": np.where(y > 0, 4.0, 2.0)})
    settings = TIGHT | {"thickness_mm": {"map": "thickness_mm"}}
    settings["fields"] = ["cortex_weight"]
    ends = []
    for ranks in (1, 2):
        out = tmp_path / f"out{ranks}"
        program = command(mesh, out, ranks, **settings)
        done = ran(*program, "--maps", str(tmp_path / "maps.h5"))
        assert done.returncode == 0, done.stdout + done.stderr
        ends.append(end_of(out))
    moved = np.abs(ends[0] - brain.vertices).max()
    assert np.abs(ends[0] - ends[1]).max() <= 1e-8 * moved
    weight = read_field(tmp_path / "out1" / "frames.h5", 21.0, "cortex_weight")
    inside = np.abs(weight - 0.5) < 0.499
    assert weight[inside & (y > 0)].mean() > weight[inside & (y < 0)].mean()


def test_a_second_run_in_the_same_folder_is_refused(mesh, tmp_path):
    out = tmp_path / "out"
    slow = command(mesh, out, end_week=30.0, output_weeks=[21.0, 30.0], step_s=3600)
    with subprocess.Popen(slow, stdout=subprocess.PIPE, text=True) as first:
        next(line for line in first.stdout if "step" in line)
        second = fold(mesh, out, code=5)
        kill(first)
    assert second.stderr == Facts(out)


# the limit stands for the disk's end, set after MPI has made its own files
FULL_DISK = """
import resource, runpy
from mpi4py import MPI
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
runpy.run_module("gyriflow.folding", run_name="__main__")
"""


def test_a_disk_that_fills_ends_in_code_five_and_earlier_files_stay(
    mesh, default_run, tmp_path
):
    out = tmp_path / "out"
    shutil.copytree(default_run[0], out)

    def files():
        return {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}

    before = files()
    done = fold(mesh, out, code=5, program=["-c", FULL_DISK])
    assert done.stderr == Facts(out, "--directory")
    assert files() == before


def test_a_disk_without_room_is_refused_before_the_solve(tmp_path, monkeypatch):
    brain, parameters = ellipsoid_mesh(4, (20.0, 26.0, 18.0)), parameters_from(WEEK)
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=10**9))
    _require_space(tmp_path, brain, parameters)
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=1000))
    with pytest.raises(StorageError, check=Facts(tmp_path, "0 MiB")):
        _require_space(tmp_path, brain, parameters)


def test_bad_parameters_end_in_code_two(mesh, tmp_path):
    done = fold(mesh, tmp_path / "out", 2, code=2, thicknes_mm=1.0)
    assert done.stderr == Facts("thicknes_mm", "thickness_mm")
    missing = fold(tmp_path / "none.xdmf", tmp_path / "out", code=2)
    assert missing.stderr == Facts(tmp_path / "none.h5")
