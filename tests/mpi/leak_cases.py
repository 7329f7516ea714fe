"""PETSc's objects do not add up over steps, whatever holds the body and whatever solves
it."""

import gc
import re

import pytest
from boxes import COMM
from contact_bodies import closing_sulcus
from petsc4py import PETSc

pytestmark = pytest.mark.slow
PETSc.Log.begin()
COUNTED = ("Vector", "Matrix", "Matrix Null Space", "Index Set")
SPARE = 2
"""Objects that are there between two iterations or not."""


def alive(folding, path):
    """Return how many objects of each class PETSc has made and not destroyed, so
    far."""
    # what was let go of waits for the next clean-up, and how much that is differs from
    # step to step
    gc.collect()
    folding.problem.tangent(folding.problem.residual(folding.problem.rest()))
    viewer = PETSc.Viewer().createASCII(str(path), comm=COMM)
    PETSc.Log.view(viewer)
    viewer.destroy()
    COMM.barrier()
    rows = re.findall(
        r"^\s*([A-Z][\w ]+?)\s+(\d+)\s+(\d+)\s*$", path.read_text(), flags=re.MULTILINE
    )
    found = {name: int(made) - int(gone) for name, made, gone in rows}
    # a log of another format would leave nothing to compare
    assert {"Vector", "Matrix"} <= found.keys(), path.read_text()
    return [found[name] for name in COUNTED if name in found]


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("global", {}),
        # the tangent has to be raised in every step
        pytest.param(
            "none", {"stress_memory_gw": "infinite"}, marks=pytest.mark.one_rank
        ),
    ],
)
def test_objects_do_not_add_up(kind, changes, tmp_path_factory):
    folding, state = closing_sulcus(kind, **changes)
    path = COMM.bcast(tmp_path_factory.mktemp("log") / "log.txt")
    counts = []
    for _ in range(12):
        state = folding.step(state, state.step_s)
        counts.append(alive(folding, path))
    if "stress_memory_gw" in changes:
        assert sum("shifted" in row["rung"] for row in state.rows) >= 2
    assert sum(row["newton"] for row in state.rows[6:]) >= 6
    # what leaks is there in all later steps
    for early, late in zip(least(counts[2:6]), least(counts[-4:]), strict=True):
        assert late <= early + SPARE


def least(counts):
    return [min(numbers) for numbers in zip(*counts, strict=True)]
