"""The solver's cases under mpiexec: on one rank pytest runs them itself, as all other tests."""

import sys
from pathlib import Path

import pytest
from processes import ran

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parent
CASES = sorted(map(str, FOLDER.glob("*_cases.py")))
OF_PARTS = [str(FOLDER / f"{name}_cases.py") for name in ("growth", "linear_solver", "shared_contact", "targets")]
"""Whose answers hang on how many neighbours a rank's part of the mesh has: with three there are two of them."""


# more ranks than this machine may have cores take long
THREE = pytest.param(3, OF_PARTS, marks=pytest.mark.extended)


@pytest.mark.parametrize(("ranks", "cases"), [(2, CASES), THREE], ids=["2", "3"])
def test_cases_hold_on(ranks, cases):
    program = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"]
    command = ["mpiexec", "-n", str(ranks), *program, "-m", "not one_rank", *cases]
    done = ran(*command, timeout_s=1200)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert done.stdout.count(" passed") == ranks, done.stdout
