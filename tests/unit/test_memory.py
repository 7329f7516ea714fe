"""The end of programs that do not look for memory that they do not need any more."""

import subprocess
import sys

PROGRAM = """
import igl

from gyriflow.memory import collect_rarely

collect_rarely()
raise SystemExit(CODE)
"""


def ending(code: str) -> subprocess.CompletedProcess:
    """Run a program that ends with an exit code or a message, in Python."""
    return subprocess.run(
        [sys.executable, "-c", PROGRAM.replace("CODE", code)],
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_program_with_bindings_ends_without_a_report_of_leaks():
    outcome = ending("3")
    assert (outcome.returncode, outcome.stderr) == (3, "")


def test_what_a_program_says_last_is_shown():
    outcome = ending("'the last words'")
    assert (outcome.returncode, outcome.stderr) == (1, "the last words\n")
