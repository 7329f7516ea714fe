"""Shapes of an unfinished fit are read again if they are whole and everything they
depend on is as before."""

import h5py
import numpy as np
import pytest

from gyriflow.io.unfinished import FILE, unfinished_series

WEEKS, STOPS = [22.0, 22.5, 23.0], [22.5]
POSITIONS = np.random.default_rng(3).standard_normal((3, 5, 3))


@pytest.fixture
def inputs(tmp_path):
    files = [tmp_path / name for name in ("mesh.h5", "registration.h5")]
    for file in files:
        file.write_bytes(file.name.encode())
    return files


def test_what_was_written_is_read_in_full_precision_for_the_same_inputs_only(
    tmp_path, inputs
):
    result = tmp_path / "brain" / "targets.h5"
    assert unfinished_series(result, inputs, [1]).read() is None
    before = unfinished_series(result, inputs, [1])
    before.write(WEEKS, POSITIONS, STOPS)
    weeks, positions, stops = unfinished_series(result, inputs, [1]).read()
    assert (weeks, stops) == (WEEKS, STOPS)
    assert np.array_equal(positions, POSITIONS)
    for files, settings in ((inputs[::-1], [1]), (inputs, [2])):
        before.write(WEEKS, POSITIONS, STOPS)
        assert unfinished_series(result, files, settings).read() is None
        assert not before.folder.exists()
    inputs[1].write_bytes(b"another")
    assert unfinished_series(result, inputs, [1]).folder != before.folder


@pytest.mark.parametrize("damage", ["truncated", "changed"])
def test_corrupt_shapes_are_not_used(tmp_path, inputs, caplog, damage):
    unfinished = unfinished_series(tmp_path / "targets.h5", inputs, [])
    unfinished.write(WEEKS, POSITIONS, STOPS)
    file = unfinished.folder / FILE
    if damage == "truncated":
        file.write_bytes(file.read_bytes()[:1000])
    else:
        with h5py.File(file, "r+") as opened:
            opened["positions"][1, 2, 0] += 1.0
    assert unfinished.read() is None
    assert str(file) in caplog.text
    unfinished.remove()
    assert not unfinished.folder.exists()
