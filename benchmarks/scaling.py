"""Time per step and memory of the folding solve against the size of the mesh, on one rank and on two.

    ./run python benchmarks/scaling.py

The meshes are of one synthetic brain (`graded_brain.py`), so that they differ by their resolution only; the model is
the reference model with a cortex that the coarsest mesh resolves. Size by size, the same steps are done on each number
of ranks in turn, and that `--repeats` times. The first step of a run, which compiles and sets up, is not counted; of
each other step the least time of all repeats is kept. The last line is one JSON object:
`rows`, `cost_per_unknown_growth` from the smallest to the largest mesh and `speedup` over one rank.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from graded_brain import FEWEST_TETS, brain_mesh

PARAMETERS = {
    "start_week": 21.0,
    "end_week": 36.0,
    "output_weeks": [21.0, 36.0],
    "fissure_x_mm": 0.0,
    "thickness_mm": 3.0,
    # planes just off the walls of the fissure, so that they meet in the step that is not counted
    "contact": {"kind": "planes", "gap_mm": 5.6},
}
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    sizes = [60_000, 125_000, 250_000, 500_000, 1_000_000]
    parser.add_argument("--sizes", type=int, nargs="+", default=sizes, help=f"elements, {FEWEST_TETS} or more")
    parser.add_argument("--steps", type=int, default=6, help="counted steps")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2], help="numbers of MPI ranks")
    parser.add_argument("--repeats", type=int, default=2, help="runs of each size on each number of ranks")
    parser.add_argument("--inside-mpi", type=Path, metavar="MESH", help=argparse.SUPPRESS)
    return parser.parse_args()


def do_steps(mesh_file: Path, steps: int) -> None:
    """Do the steps on the ranks of this run and print what they took, as JSON."""
    from mpi4py import MPI

    from gyriflow.folding.checkpoint import State
    from gyriflow.folding.output import peak_memory_mib
    from gyriflow.folding.simulation import Folding
    from gyriflow.folding.zones import zones_of_run
    from gyriflow.io.tetmeshes import read_tetrahedral_mesh
    from gyriflow.parameters.folding import parameters_from
    from gyriflow.units import M_PER_MM

    comm = MPI.COMM_WORLD
    mesh = comm.bcast(read_tetrahedral_mesh(mesh_file) if comm.rank == 0 else None, root=0)
    p = parameters_from(PARAMETERS)
    zones = comm.bcast(zones_of_run(mesh, p) if comm.rank == 0 else None, root=0)
    folding = Folding(comm, mesh, zones, p)
    state, seconds = State.at_start(mesh.vertices * M_PER_MM, p.step_s), []
    for _ in range(steps + 1):
        comm.barrier()
        began = MPI.Wtime()
        state = folding.step(state, p.step_s)
        seconds.append(comm.allreduce(MPI.Wtime() - began, op=MPI.MAX))
    memory = comm.reduce(peak_memory_mib(), op=MPI.SUM, root=0)
    if comm.rank == 0:
        counted = state.rows[1:]
        took = {name: [row[name] for row in counted] for name in ("newton", "krylov")}
        print(json.dumps({"seconds": seconds[1:], **took, "memory_MiB": memory}))


def run(mesh_file: Path, steps: int, ranks: int) -> dict:
    """Tell what a run of its own took."""
    program = [sys.executable, __file__, "--inside-mpi", str(mesh_file), "--steps", str(steps)]
    command = ["mpiexec", "-n", str(ranks), *program]
    done = subprocess.run(command, env=os.environ | ONE_THREAD, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])


def summary(runs: list[dict], mesh: dict, ranks: int) -> dict:
    """Sum up the runs of one mesh on one number of ranks."""
    seconds = np.min([one["seconds"] for one in runs], axis=0)
    # the same in all runs but for rounding in the order of sums
    newton, krylov = sum(runs[0]["newton"]), sum(runs[0]["krylov"])
    return mesh | {
        "ranks": ranks,
        "seconds": round(float(np.median(seconds)), 3),
        "newton_per_step": round(newton / len(seconds), 2),
        "krylov_per_newton": round(krylov / newton, 1),
        "us_per_unknown_newton": round(1e6 * seconds.sum() / newton / mesh["unknowns"], 2),
        "memory_MiB": round(min(one["memory_MiB"] for one in runs)),
    }


def rows_of_size(tets: int, arguments: argparse.Namespace) -> list[dict]:
    """Run on a mesh of about `tets` elements; a row for each number of ranks."""
    from gyriflow.io.tetmeshes import write_tetrahedral_mesh

    mesh = brain_mesh(tets)
    size = {"tets": len(mesh.tets), "unknowns": 3 * len(mesh.vertices)}
    runs: dict[int, list[dict]] = {ranks: [] for ranks in arguments.ranks}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "brain.xdmf"
        write_tetrahedral_mesh(file, mesh)
        del mesh
        for _ in range(arguments.repeats):
            for ranks in arguments.ranks:
                runs[ranks].append(run(file, arguments.steps, ranks))
    return [summary(of_ranks, size, ranks) for ranks, of_ranks in runs.items()]


def main(arguments: argparse.Namespace) -> None:
    rows: list[dict] = []
    for tets in sorted(arguments.sizes):
        rows += rows_of_size(tets, arguments)
        for row in rows[-len(arguments.ranks) :]:
            print(json.dumps(row), flush=True)
    cost = {
        ranks: [row["seconds"] / row["unknowns"] for row in rows if row["ranks"] == ranks] for ranks in arguments.ranks
    }
    result = {"rows": rows, "cost_per_unknown_growth": {n: round(costs[-1] / costs[0], 2) for n, costs in cost.items()}}
    if 1 in cost:
        result["speedup"] = {
            n: [round(one / more, 2) for one, more in zip(cost[1], cost[n], strict=True)] for n in cost if n > 1
        }
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    arguments = parse()
    if arguments.inside_mpi:
        do_steps(arguments.inside_mpi, arguments.steps)
    else:
        main(arguments)
