"""State and checkpoint."""

import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from facts import Facts
from fuzzing import BOUNDED, damaged
from hypothesis import given
from hypothesis import strategies as st
from shapes import box_mesh

from gyriflow.code_hash import modules_behind
from gyriflow.folding import checkpoint
from gyriflow.folding.checkpoint import (
    State,
    read_checkpoint,
    run_key,
    write_checkpoint,
)
from gyriflow.folding.run import _delete_old_checkpoints, _load_state
from gyriflow.settings.folding import parameters_from
from gyriflow.units import SECONDS_PER_GW, week_tag

VALUES = {
    "start_week": 21.0,
    "end_week": 22.0,
    "fissure_x_mm": 0.0,
    "output_weeks": [21.0, 22.0],
}


def some_state(steps=3):
    state = State.at_start(np.zeros((4, 3)), 100.0)
    growth = np.full((4, 3, 3), 0.1)
    for displacement in np.random.default_rng(1).normal(size=(steps, 4, 3)):
        row = {"step": len(state.rows) + 1, "week": 21.5, "rung": "cg"}
        state = state.after(displacement, 100.0, row, growth=growth)
    return state


def test_the_first_guess_continues_a_displacement_whose_rate_changes_linearly():
    # exact for positions that are quadratic in time, whatever the steps
    def at(t):
        return np.full((2, 3), 3.0 * t + 0.5 * t**2)

    times = [0.0, 1.0, 1.5, 3.0]
    state = State.at_start(at(0.0), 1.0)
    for before, after in pairwise(times[:3]):
        state = state.after(at(after) - at(before), after - before, {})
    found = state.initial_guesses(1.5)
    np.testing.assert_allclose(found[0], at(3.0) - at(1.5), rtol=1e-13)
    # the second repeats the rate of the last step, of half a second
    np.testing.assert_allclose(found[1], 3.0 * (at(1.5) - at(1.0)), rtol=1e-13)


@BOUNDED
@given(data=st.data())
def test_a_checkpoint_comes_back_as_it_was_or_is_not_used(tmp_path, data):
    path = tmp_path / "state.h5"
    state = replace(some_state(), correction=(0.25, -0.5))
    write_checkpoint(path, "key", state)
    assert read_checkpoint(path, "key")[1] == Facts(3)
    whole = path.read_bytes()
    path.write_bytes(data.draw(st.just(whole) | damaged(whole, 200)))
    read, message = read_checkpoint(path, "key")
    assert message
    # the damage may lie between what is kept
    if read is not None:
        for name, value in vars(state).items():
            np.testing.assert_array_equal(getattr(read, name), value)


MESH = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("change", "is_same"),
    [
        ({}, True),
        ({"ranks": 7}, True),
        ({"end_week": 23.0, "output_weeks": [21.0, 23.0]}, True),
        ({"max_halvings": 2}, True),
        ({"step_s": 7e4}, False),
        ({"newton_tolerance": 1e-3}, False),
        ({"thickness_mm": 2.0}, False),
    ],
)
def test_the_key_depends_on_parameters_that_decide_a_state(change, is_same):
    keys = {run_key(MESH, parameters_from(VALUES | more), {}) for more in ({}, change)}
    assert (len(keys) == 1) == is_same


def test_the_key_depends_on_the_mesh_and_on_maps():
    base = parameters_from(VALUES)
    other = box_mesh((1, 1, 1), (1.0, 1.0, 1.1))
    assert run_key(MESH, base, {}) != run_key(other, base, {})
    mapped = parameters_from(VALUES | {"thickness_mm": {"map": "thickness_mm"}})
    thin, thick = ({"thickness_mm": np.full(8, h)} for h in (1.0, 2.0))
    assert run_key(MESH, mapped, thin) != run_key(MESH, mapped, thick)


def test_a_checkpoint_is_not_used_after_the_source_has_changed(tmp_path, monkeypatch):
    source, path = tmp_path / "newton.py", tmp_path / "state.h5"
    monkeypatch.setattr(checkpoint, "modules_behind", lambda program: {source})
    monkeypatch.setattr(checkpoint, "subpackage_of", lambda module: "folding")
    keys = []
    for text in ("tolerance = 1e-4", "tolerance = 1e-3", "tolerance = 1e-4"):
        source.write_text(text)
        keys.append(run_key(MESH, parameters_from(VALUES), {}))
    assert keys[0] == keys[2] != keys[1]
    write_checkpoint(path, keys[0], some_state())
    assert read_checkpoint(path, keys[1]) == (None, Facts(path))
    assert len(read_checkpoint(path, keys[2])[0].rows) == 3


def test_the_key_of_a_run_does_not_depend_on_how_labels_are_read():
    folder = Path(checkpoint.__file__).parent
    behind = {path.name for path in modules_behind(folder / "__main__.py")}
    assert {"run.py", "varying.py", "tetrahedra.py", "materials.py"} <= behind
    assert not {"labels.py", "extraction.py", "brains.py"} & behind
    c_files = {path.name for path in folder.glob("*.c")}
    assert {"products.c"} < c_files <= behind


def test_a_run_is_resumed_with_the_frames_it_has_and_the_steps_before_its_end(tmp_path):
    weeks = [21.0, 22.0, 23.0]
    values = VALUES | {"end_week": 23.0, "output_weeks": weeks}
    step_s = SECONDS_PER_GW / 2
    state = State.at_start(np.zeros((4, 3)), step_s)
    for week in (21.5, 22.0, 22.5):
        state = state.after(np.ones((4, 3)), step_s, {"week": week})
    state = replace(state, growth_s=step_s)
    write_checkpoint(tmp_path / "state.h5", "key", state)
    run = parameters_from(values)
    for week in weeks[:2]:
        assert _load_state(tmp_path, "key", run)[0] is None
        (tmp_path / f"frame-{week_tag(week)}.h5").touch()
    resumed, message = _load_state(tmp_path, "key", run)
    assert message == Facts(3)
    assert [row["week"] for row in resumed.rows] == [21.5, 22.0, 22.5]
    # an earlier end leaves out later steps
    earlier = parameters_from(values | {"end_week": 22.0, "output_weeks": weeks[:2]})
    resumed, _ = _load_state(tmp_path, "key", earlier)
    assert [row["week"] for row in resumed.rows] == [21.5, 22.0]
    # growth towards shapes is recorded since the last output week
    sizes = {"area_cm2": {21: 90, 23: 99}, "volume_ml": {21: 40, 23: 46}}
    towards = {"growth": {"model": "shapes", **sizes}, "targets": {23.0: "target"}}
    assert _load_state(tmp_path, "key", parameters_from(values | towards))[0]
    others = {"output_weeks": [21.0, 22.25, 23.0]}
    (tmp_path / f"frame-{week_tag(22.25)}.h5").touch()
    other = parameters_from(values | towards | others)
    found, message = _load_state(tmp_path, "key", other)
    assert found is None
    assert message == Facts(tmp_path, "output weeks")


def test_of_checkpoints_of_other_runs_the_last_two_are_kept(tmp_path):
    folders = [tmp_path / f"checkpoint-{letter}" for letter in "dabc"]
    for age, folder in enumerate(folders):
        folder.mkdir()
        os.utime(folder, (1e9 - age, 1e9 - age))
    last, second, own, oldest = folders
    assert _delete_old_checkpoints(tmp_path, own) == [Facts(last), Facts(second)]
    assert not oldest.exists()
    assert own.exists()
