"""What a folding run loses when it is killed: SIGKILL to all its processes at a random step, again and again.

    ./run python benchmarks/interruptions.py results/brains/phantom-21/mesh/brain.xdmf \\
        results/runs/reference/phantom-21/params.yaml --runs 10 --ranks 2

One run goes through. Each of the others is killed within a random step (seeded) and started again by the same command.
Counted are the steps that had been reported before the kill and were done again, and the largest distance of a vertex
from where the undisturbed run left it. The last line is one JSON object.
"""

import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

STEP = re.compile(r"step\s+(\d+)\s+newton")
RESUMED = re.compile(r"going on from the checkpoint after step (\d+)")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("params", type=Path, help="params.yaml of a run")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


def start(arguments: argparse.Namespace, out: Path) -> subprocess.Popen:
    program = [sys.executable, "-m", "gyriflow.folding", str(arguments.mesh), "--params", str(arguments.params)]
    command = ["mpiexec", "-n", str(arguments.ranks), *program, "--out", str(out)]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    # a group of its own, so that one signal reaches mpiexec and all ranks
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment, start_new_session=True
    )


def kill_at(process: subprocess.Popen, step: int, delay: float) -> int:
    """Kills all processes of a run a while after it has reported a step; returns the last step that it reported."""
    reported = 0
    for line in process.stdout:
        found = STEP.search(line)
        reported = int(found.group(1)) if found else reported
        if reported >= step:
            time.sleep(delay)
            break
    pids = subprocess.run(["pgrep", "-s", str(process.pid)], capture_output=True, text=True, check=False).stdout.split()
    # Open MPI gives each rank a group of its own in the same session
    for pid in map(int, pids):
        os.kill(pid, signal.SIGKILL)
    for line in process.stdout:
        found = STEP.search(line)
        reported = int(found.group(1)) if found else reported
    process.wait()
    return reported


def finish(process: subprocess.Popen) -> str:
    said, _ = process.communicate()
    if process.returncode:
        raise SystemExit(f"a run failed:\n{said}")
    return said


def main() -> None:
    from gyriflow.io.frames import read_positions

    arguments, chance = parse(), random.Random(parse().seed)
    end = float(yaml.safe_load(arguments.params.read_text())["end_week"])
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder, "whole")
        began = time.perf_counter()
        steps = [int(number) for number in STEP.findall(finish(start(arguments, whole)))]
        step_s = (time.perf_counter() - began) / len(steps)
        expected = read_positions(whole / "frames.h5", end)
        lost, distances, killed = [], [], []
        while len(killed) < arguments.runs:
            out = Path(folder, "killed")
            step = chance.randrange(1, len(steps))
            reported = kill_at(start(arguments, out), step, chance.uniform(0, step_s))
            if (out / "summary.json").exists():  # it had ended before
                shutil.rmtree(out)
                continue
            resumed = RESUMED.search(finish(start(arguments, out)))
            after = int(resumed.group(1)) if resumed else 0
            killed.append(reported)
            lost.append(reported - after)
            positions = read_positions(out / "frames.h5", end)
            distances.append(float(np.linalg.norm(positions - expected, axis=1).max()))
            print(f"killed after step {reported}: went on after {after}, {distances[-1]:.1e} mm off", flush=True)
            shutil.rmtree(out)
    result = {
        "runs": arguments.runs,
        "ranks": arguments.ranks,
        "steps": len(steps),
        "killed_after_step": killed,
        "reported_steps_lost": lost,
        "most_lost": max(lost),
        "max_difference_mm": float(f"{max(distances):.3g}"),
    }
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
