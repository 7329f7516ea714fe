"""The solver's cases under mpiexec: on one rank pytest runs them itself, as all other
tests."""

import sys
from itertools import batched
from pathlib import Path

import pytest
from processes import ran

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parent
CASES = sorted(map(str, FOLDER.glob("*_cases.py")))
OF_PARTS = [
    str(FOLDER / f"{name}_cases.py")
    for name in ("growth", "linear_solver", "shared_contact", "targets")
]
"""Whose answers hang on how many neighbours a rank's part of the mesh has: with three
there are two of them."""

# a process for several, as it takes seconds to start; not for all, since MPICH has at
# most 2048 communicators in a process, and what cases leave behind has some
RUNS = [(2, cases) for cases in batched(CASES, 3)]
# more ranks than this machine may have cores take long
RUNS += [pytest.param(3, [case], marks=pytest.mark.extended) for case in OF_PARTS]


PYTEST = "-m pytest -q -x -n 0 -p no:cacheprovider"


def names(value):
    """Return the names of files of cases, for the id of a test."""
    if isinstance(value, int):
        return None
    return "+".join(Path(case).stem for case in value)


@pytest.mark.parametrize(("ranks", "cases"), RUNS, ids=names)
def test_cases_hold_on(ranks, cases):
    program = [sys.executable, *PYTEST.split(), "-m", "not one_rank", *cases]
    done = ran("mpiexec", "-n", str(ranks), *program, timeout_s=1200)
    # 5: all cases are for one rank
    assert done.returncode in (0, 5), done.stdout[-6000:] + done.stderr[-2000:]
    assert done.stdout.count(" passed") == (ranks if done.returncode == 0 else 0), (
        done.stdout
    )
