"""The solver's own tests, run by pytest under mpiexec on 1, 2 and 3 ranks."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize(
    "cases",
    [
        *("solver_cases.py", "growth_cases.py", "memory_cases.py", "ladder_cases.py", "consistency_cases.py"),
        *("manufactured_cases.py", "symmetry_cases.py", "bilayer_cases.py", "contact_cases.py"),
        *("leak_cases.py", "rate_cases.py", "quadratic_cases.py", "following_cases.py", "kept_cases.py"),
    ],
)
def test_cases_hold_on(ranks, cases):
    path = Path(__file__).with_name(cases)
    command = [
        "mpiexec",
        "-n",
        str(ranks),
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "no:cacheprovider",
        str(path),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert done.stdout.count(" passed") == ranks, done.stdout
