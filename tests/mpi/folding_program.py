"""How tests start the folding program, and how they break it off."""

import sys

import processes
import yaml

from gyriflow.folding.linear_solver import NotConvergedError
from gyriflow.folding.simulation import Folding
from gyriflow.io.frames import read_positions

TIGHT = {"newton_tolerance": 1e-12}
WEEK = {
    "start_week": 21.0,
    "end_week": 21.5,
    "output_weeks": [21.0, 21.25, 21.5],
    "fissure_x_mm": 0.0,
    "thickness_mm": 3.0,
}


PROGRAM = ["-m", "gyriflow.folding"]
IMPATIENT = [
    "-c",
    (
        "import functools, runpy; from gyriflow.folding import newton, simulation;"
        " simulation.NewtonSettings = functools.partial(newton.NewtonSettings,"
        " max_newton=1); runpy.run_module('gyriflow.folding', run_name='__main__')"
    ),
]
"""The program, and the program with steps that fail after one Newton iteration without
progress."""


def command(mesh, out, ranks=1, program=PROGRAM, **changes):
    params = out.parent / f"{out.name}.yaml"
    params.write_text(yaml.safe_dump(WEEK | changes))
    files = [mesh, "--params", params, "--out", out, "--log", out.with_suffix(".log")]
    ranks = ["mpiexec", "-n", str(ranks)]
    return [*ranks, sys.executable, *program, *map(str, files)]


def fold(mesh, out, ranks=1, code=0, **changes):
    """Return what the program printed, which has ended in a code."""
    done = processes.ran(*command(mesh, out, ranks, **changes))
    assert done.returncode == code, done.stdout + done.stderr
    return done


def end_of(out):
    """Return the positions in mm at the end of a run."""
    return read_positions(out / "frames.h5", WEEK["end_week"])


def failing_after(steps):
    """Return a step of the folding that fails once a number of steps has been done."""
    honest = Folding.step

    def step(self, state, step_s):
        if len(state.rows) == steps:
            raise NotConvergedError("no way on")
        return honest(self, state, step_s)

    return step


def kill(process):
    """Kill a program with its ranks, which mpiexec puts into groups of their own."""
    processes.kill([process.pid, *processes.below(process.pid)])
