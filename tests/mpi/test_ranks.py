"""The solver's cases under mpiexec: on one rank pytest runs them itself, as all other tests."""

import sys
from pathlib import Path

import pytest
from processes import ran

pytestmark = pytest.mark.slow

CASES = sorted(str(path) for path in Path(__file__).parent.glob("*_cases.py"))


@pytest.mark.parametrize("ranks", [2, 3])
def test_cases_hold_on(ranks):
    program = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"]
    command = ["mpiexec", "-n", str(ranks), *program, "-m", "not one_rank", *CASES]
    done = ran(*command, timeout_s=1200)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert done.stdout.count(" passed") == ranks, done.stdout
