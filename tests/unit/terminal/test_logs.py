"""What is taken from the logs of jobs: warnings, weeks, and the cause of a failure."""

import pytest

from gyriflow.terminal.logs import FoldingStep, GrowingLog, cause, ended_by_slurm, last_step, warnings_in

STEPS = """53301 elements, 37038 unknowns, 2 ranks, about 713 MiB
warning: fewer than two elements through the cortex (0.98): folds may be mesh noise
GW 21.071/23  step    1  newton 6  krylov  69  max|u| 0.138 mm  min J 0.987  5.24 s  left 2:22
GW 21.143/23  step    2  newton 4  krylov  50  max|u| 0.113 mm  min J 0.992  2.19 s  left 1:37
"""


def test_the_last_step_tells_the_week():
    assert last_step(STEPS) == FoldingStep(21.143, 23.0, "1:37")
    assert last_step("53301 elements\n") is None


def test_warnings_are_those_of_gyriflow():
    text = STEPS + (
        "2026-11-22 00:54:57,955 WARNING gyriflow.surface.pial: the cortex is thin\n"
        "2026-11-22 00:54:58,955 WARNING gyriflow.surface.pial: the cortex is thin\n"
        "2026-11-22 00:54:59,000 WARNING py.warnings: /lib/numpy.py:1: RuntimeWarning: divide by zero\n"
        "2026-11-22 00:54:59,000 INFO gyriflow.surface.pial: a warning: none\n"
    )
    assert warnings_in(text) == [
        "fewer than two elements through the cortex (0.98): folds may be mesh noise",
        "the cortex is thin",
    ]


@pytest.mark.parametrize(
    ("log", "expected"),
    [
        (
            "2026-11-22 00:54:57,955 INFO gyriflow.io: read\n2026-11-22 00:54:58,001 ERROR root: a.nii: is no image;\n"
            "  found text\n2026-11-22 00:54:59,000 INFO gyriflow.io: end\n",
            "a.nii: is no image;\n  found text",
        ),
        (STEPS + "gyriflow: the step could not be halved further. Use smaller steps\n", "the step could not be halved "
         "further. Use smaller steps"),
        (
            "2026-11-22 00:54:58,001 ERROR root: unexpected error\nTraceback (most recent call last):\n"
            '  File "a.py", line 1, in <module>\n    1 / 0\nZeroDivisionError: division by zero\n',
            "unexpected ZeroDivisionError: division by zero",
        ),
        (
            "ValueError: no such week\nsnakemake_interface_common.exceptions.WorkflowError: At least one job did not "
            "complete successfully.\nWorkflowError:\nAt least one job did not complete successfully.\n",
            "unexpected ValueError: no such week",
        ),
        ("mpiexec: one\n\ntwo\n", "mpiexec: one\ntwo"),
        ("", ""),
    ],
)  # fmt: skip
def test_the_cause_is_gyriflows_own_message_or_else_the_exception_or_the_end(log, expected):
    assert cause(log) == expected


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        ("CANCELLED", "Slurm job 12: it was cancelled"),
        ("OUT_OF_MEMORY", "Slurm job 12: its memory ran out: more is given by --set-resources measure:mem_mb=MIB"),
        # the log says why
        ("FAILED", ""),
    ],
)
def test_what_slurm_has_done_to_a_job_is_told(state, expected):
    # as snakemake-executor-plugin-slurm 2.8 puts it
    message = f"SLURM-job '12' failed, SLURM status is: '{state}'. Reason: Unknown."
    assert ended_by_slurm(message, "measure") == expected
    lost = "SLURM-job '12' failed due to a node failure, SLURM status is: 'NODE_FAIL'. Failed nodes will be excluded"
    assert ended_by_slurm(lost, "measure") == "Slurm job 12: its node was lost"
    assert ended_by_slurm("", "measure") == ""


def test_a_growing_log_gives_each_whole_line_once(tmp_path):
    log = GrowingLog(tmp_path / "log")
    assert log.new_text() == ""
    log.path.write_text("one\ntw")
    assert log.new_text() == "one\n"
    with log.path.open("a") as file:
        file.write("o\nthree\n")
    assert log.new_text() == "two\nthree\n"
    assert log.new_text() == ""
    # the job is tried again
    log.path.write_text("new\n")
    assert log.new_text() == "new\n"
