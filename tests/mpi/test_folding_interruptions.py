"""The folding program when it is broken off: it goes on from its checkpoint, or keeps
what it has reached."""

import subprocess

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from folding_program import TIGHT, WEEK, command, end_of, failing_after, fold, kill
from mpi4py import MPI
from shapes import ellipsoid, ellipsoid_mesh

from gyriflow.errors import SolverError
from gyriflow.folding.checkpoint import read_checkpoint, run_key
from gyriflow.folding.run import run
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import zones_of_run
from gyriflow.io.files import read_json
from gyriflow.io.frames import read_field, read_tets, read_weeks
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_tetrahedral_mesh
from gyriflow.mesh.nodes import curve_edges
from gyriflow.settings.folding import parameters_from

pytestmark = pytest.mark.slow

MANY_STEPS = 4000.0


def test_quadratic_elements_go_through_interruptions_and_any_number_of_ranks(
    tmp_path, monkeypatch
):
    path, axes = tmp_path / "curved.xdmf", (20.0, 26.0, 18.0)
    write_tetrahedral_mesh(path, curve_edges(ellipsoid_mesh(4, axes), ellipsoid(axes)))
    fields = ["displacement", "cortex_weight", "stress", "strain"]
    settings = {**TIGHT, "stress_memory_gw": 1.0, "fields": fields}
    fold(path, tmp_path / "three", 3, **settings)
    mesh, p = read_tetrahedral_mesh(path), parameters_from(WEEK | settings)
    zones = zones_of_run(mesh, p)
    with monkeypatch.context() as patch:
        patch.setattr(Folding, "step", failing_after(3))
        with pytest.raises(SolverError):
            run(MPI.COMM_SELF, mesh, zones, p, {}, tmp_path / "one")
    run(MPI.COMM_SELF, mesh, zones, p, {}, tmp_path / "one")
    assert read_json(tmp_path / "one" / "summary.json")["resumed_after_step"] == 3
    one, three = tmp_path / "one", tmp_path / "three"
    assert read_tets(one / "frames.h5").shape == (len(mesh.tets), 10)
    moved = np.abs(end_of(one) - mesh.vertices).max()
    assert np.abs(end_of(one) - end_of(three)).max() <= 1e-8 * moved
    for field in ("von_mises_pa", "elastic_strain"):
        values, expected = (
            read_field(out / "frames.h5", 21.5, field) for out in (one, three)
        )
        assert values.shape == (len(mesh.tets),)
        largest = values.max()
        np.testing.assert_allclose(values, expected, rtol=1e-4, atol=1e-4 * largest)


@pytest.fixture(scope="module")
def long_run(mesh, tmp_path_factory):
    """A run of so many steps that it does not end before it is killed,
    uninterrupted."""
    out = tmp_path_factory.mktemp("long") / "out"
    fold(mesh, out, **TIGHT, step_s=MANY_STEPS)
    return out


def killed_after(step, arguments):
    """Start the program, kill it when it has printed a step, and return what it
    printed."""
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        printed = []
        for line in process.stdout:
            printed.append(line)
            if f"step {step:4d}" in line:
                kill(process)
                break
    return "".join(printed)


def test_a_killed_run_resumes_on_fewer_ranks_and_ends_like_an_uninterrupted_one(
    mesh, long_run, tmp_path
):
    out = tmp_path / "out"
    printed = killed_after(3, command(mesh, out, 2, **TIGHT, step_s=MANY_STEPS))
    assert not (out / "frames.h5").exists(), printed
    again = fold(mesh, out, 1, **TIGHT, step_s=MANY_STEPS)
    resumed = read_json(out / "summary.json")["resumed_after_step"]
    assert resumed >= 3
    assert again.stdout == Facts("checkpoint", resumed)
    expected = end_of(long_run)
    moved = np.abs(expected - read_tetrahedral_mesh(mesh).vertices).max()
    assert np.abs(end_of(out) - expected).max() <= 1e-8 * moved
    found, whole = (pd.read_csv(folder / "steps.csv") for folder in (out, long_run))
    assert len(found) == len(whole)


def test_a_checkpoint_of_other_parameters_waits_for_their_return(
    mesh, long_run, tmp_path
):
    out = tmp_path / "out"
    killed_after(2, command(mesh, out, step_s=MANY_STEPS))
    done = fold(mesh, out, thickness_mm=2.5)
    assert f"{out}/checkpoint-" in done.stdout
    assert read_json(out / "summary.json")["resumed_after_step"] == 0
    fold(mesh, out, step_s=MANY_STEPS)
    assert read_json(out / "summary.json")["resumed_after_step"] > 0
    assert not list(out.glob("checkpoint-*"))
    assert np.linalg.norm(end_of(out) - end_of(long_run), axis=1).max() <= 1e-3


def test_the_last_good_state_of_a_failed_run_serves_an_earlier_end(
    mesh, tmp_path, monkeypatch, capsys
):
    brain = read_tetrahedral_mesh(mesh)
    parameters = parameters_from(WEEK)
    monkeypatch.setattr(Folding, "step", failing_after(5))
    zones = zones_of_run(brain, parameters)
    facts = Facts("no way on", "folding.end_week", "folding.max_halvings")
    with pytest.raises(SolverError, check=facts):
        run(MPI.COMM_SELF, brain, zones, parameters, {}, tmp_path)
    key = run_key(brain, parameters, {})
    state, _ = read_checkpoint(tmp_path / f"checkpoint-{key}" / "state.h5", key)
    assert len(state.rows) == 5
    end = {"end_week": 21.25, "output_weeks": [21.0, 21.25]}
    earlier = parameters_from(WEEK | end)
    run(MPI.COMM_SELF, brain, zones, earlier, {}, tmp_path)
    assert Facts("checkpoint", 5) in capsys.readouterr().out.splitlines()
    assert read_weeks(tmp_path / "frames.h5") == [21.0, 21.25]
    assert pd.read_csv(tmp_path / "steps.csv")["week"].iloc[-1] == pytest.approx(21.25)


def test_a_run_that_may_diverge_ends_with_the_weeks_that_it_has_reached(
    mesh, tmp_path, monkeypatch
):
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
    assert (summary["steps"], summary["weeks"]) == (0, [21.0])
    assert summary["reached_week"] == 21.0
