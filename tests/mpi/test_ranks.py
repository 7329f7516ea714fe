"""The solver's own tests, run by pytest under mpiexec on 1, 2 and 3 ranks."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

CASES = sorted(str(path) for path in Path(__file__).parent.glob("*_cases.py"))
PARTS = 4
"""Starting the ranks takes as long as the cases of some files: so many files share a start."""


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("part", range(PARTS))
def test_cases_hold_on(ranks, part):
    cases = CASES[part::PARTS]
    program = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", *cases]
    command = ["mpiexec", "-n", str(ranks), *program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert done.stdout.count(" passed") == ranks, done.stdout
