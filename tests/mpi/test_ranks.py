"""The solver's own tests, run by pytest under mpiexec on 1, 2 and 3 ranks."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("cases", sorted(path.name for path in Path(__file__).parent.glob("*_cases.py")))
def test_cases_hold_on(ranks, cases):
    path = Path(__file__).with_name(cases)
    program = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", str(path)]
    command = ["mpiexec", "-n", str(ranks), *program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert done.stdout.count(" passed") == ranks, done.stdout
