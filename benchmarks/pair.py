"""Run a simulation with two checkouts in turn: processor time, iterations, memory and difference of positions.

    git worktree add ../before 864ee12
    ./run python benchmarks/pair.py ../before MESH PARAMS --maps MAPS --end-week 22 --out pair

MESH, PARAMS and MAPS are `mesh/brain.xdmf` of a brain, and `params.yaml` and `folding/maps.h5` of a run from it; MAPS
is left out if the run has none. The checkouts run in turn `--repeats` times; the fastest run of each is reported. The
last line is one JSON object.
"""

import argparse
import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from gyriflow.io.files import read_json
from gyriflow.io.frames import read_positions
from gyriflow.io.yaml_files import read_yaml, write_yaml

CHECKOUT = Path(__file__).parents[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="the other checkout")
    parser.add_argument("mesh", type=Path)
    parser.add_argument("params", type=Path)
    parser.add_argument("--maps", type=Path)
    parser.add_argument("--end-week", type=float, required=True)
    parser.add_argument("--ranks", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    values, end = read_yaml(arguments.params), arguments.end_week
    weeks = [week for week in values["output_weeks"] if week < end] + [end]
    arguments.out.mkdir(parents=True, exist_ok=True)
    params = arguments.out.resolve() / "params.yaml"
    write_yaml(params, values | {"end_week": end, "output_weeks": weeks})
    program = ["mpiexec", "-n", str(arguments.ranks), "python", "-m", "gyriflow.folding", str(arguments.mesh.resolve())]
    program += ["--params", str(params), *(["--maps", str(arguments.maps.resolve())] if arguments.maps else [])]
    fastest: dict[str, dict] = {}
    for _ in range(arguments.repeats):
        for name, checkout in (("before", arguments.before), ("now", CHECKOUT)):
            out = arguments.out.resolve() / name
            shutil.rmtree(out, ignore_errors=True)
            environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
            subprocess.run(["./run", *program, "--out", str(out)], cwd=checkout, env=environment, check=True)
            summary = read_json(out / "summary.json")
            fastest[name] = min(fastest.get(name, summary), summary, key=lambda summary: summary["cpu_seconds"])
    before, after = (read_positions(arguments.out / name / "frames.h5", end) for name in ("before", "now"))
    reported = ("dofs", "steps", "newton", "krylov", "cpu_seconds", "peak_memory_MiB")
    result = {name: {key: summary[key] for key in reported} for name, summary in fastest.items()}
    print(json.dumps(result | {"largest_difference_mm": float(np.linalg.norm(after - before, axis=1).max())}))


if __name__ == "__main__":
    main()
