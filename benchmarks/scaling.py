"""Time per step and memory of the folding solve against the size of the mesh, on one rank and on two.

    ./run python benchmarks/scaling.py

The meshes are of one synthetic brain (`graded_brain.py`), so that they differ by their resolution only; the model is
the reference model with a cortex that the coarsest mesh resolves. Size by size, the same steps are done on each number
of ranks in turn, and that `--repeats` times. The first step of a run, which compiles and sets up, is not counted; of
each other step the least time of all repeats is kept. The last line is one JSON object.
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

THICKNESS_MM = 3.0
CONTACT_GAP_MM = 5.6
"""Sets the contact planes just off the walls of the fissure, so that they meet in the step that is not counted."""
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
COLUMNS = (
    ("   tets", "tets", "d"),
    ("unknowns", "unknowns", "d"),
    ("ranks", "ranks", "d"),
    (" s/step", "seconds", ".3f"),
    ("s/Newton", "seconds_per_newton", ".3f"),
    ("ms/Krylov", "ms_per_krylov", ".2f"),
    ("Newton/step", "newton_per_step", ".2f"),
    ("Krylov/Newton", "krylov_per_newton", ".1f"),
    ("us/unknown/Newton", "us_per_unknown_newton", ".2f"),
    ("  MiB", "memory_MiB", ".0f"),
)
"""Heading, which is as wide as the column, value and its format."""


def positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("at least 1 is needed")
    return number


def size(text: str) -> int:
    number = int(text)
    if number < FEWEST_TETS:
        raise argparse.ArgumentTypeError(f"at least {FEWEST_TETS} are needed")
    return number


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    sizes = [60_000, 125_000, 250_000, 500_000, 1_000_000]
    parser.add_argument("--sizes", type=size, nargs="+", default=sizes, help="about so many elements")
    parser.add_argument("--steps", type=positive, default=6, help="counted steps")
    parser.add_argument("--ranks", type=positive, nargs="+", default=[1, 2], help="numbers of MPI ranks")
    parser.add_argument("--repeats", type=positive, default=2, help="runs of each size on each number of ranks")
    parser.add_argument("--inside-mpi", type=Path, metavar="MESH", help=argparse.SUPPRESS)
    return parser.parse_args()


def reference_parameters():
    """Returns the paper's parameters for the synthetic brain."""
    from gyriflow.parameters.folding import parameters_from

    values = {"start_week": 21.0, "end_week": 36.0, "output_weeks": [21.0, 36.0], "fissure_x_mm": 0.0}
    contact = {"kind": "planes", "gap_mm": CONTACT_GAP_MM}
    return parameters_from(values | {"thickness_mm": THICKNESS_MM, "contact": contact})


def do_steps(mesh_file: Path, steps: int) -> None:
    """Does the steps on the ranks of this run and prints what they took, as JSON."""
    from mpi4py import MPI

    from gyriflow.folding.checkpoint import State
    from gyriflow.folding.output import peak_memory_mib
    from gyriflow.folding.simulation import Folding
    from gyriflow.folding.zones import zones_of_run
    from gyriflow.io.tetmeshes import read_tetrahedral_mesh
    from gyriflow.units import M_PER_MM

    comm = MPI.COMM_WORLD
    mesh = comm.bcast(read_tetrahedral_mesh(mesh_file) if comm.rank == 0 else None, root=0)
    p = reference_parameters()
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
    """Returns what a run of its own took."""
    program = [sys.executable, __file__, "--inside-mpi", str(mesh_file), "--steps", str(steps)]
    command = ["mpiexec", "-n", str(ranks), *program]
    done = subprocess.run(command, env=os.environ | ONE_THREAD, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])


def summary(runs: list[dict], mesh: dict, ranks: int) -> dict:
    """Returns a row of the table from the runs of one mesh on one number of ranks."""
    seconds = np.min([one["seconds"] for one in runs], axis=0)
    # the same in all runs but for rounding in the order of sums
    newton, krylov = sum(runs[0]["newton"]), sum(runs[0]["krylov"])
    return mesh | {
        "ranks": ranks,
        "seconds": float(np.median(seconds)),
        "seconds_per_newton": seconds.sum() / newton,
        "ms_per_krylov": 1e3 * seconds.sum() / krylov,
        "newton_per_step": newton / len(seconds),
        "krylov_per_newton": krylov / newton,
        "us_per_unknown_newton": 1e6 * seconds.sum() / newton / mesh["unknowns"],
        "memory_MiB": min(one["memory_MiB"] for one in runs),
    }


def rows_of_size(tets: int, arguments: argparse.Namespace) -> list[dict]:
    """Returns a row of the table for each number of ranks, after the runs on a mesh of about `tets` elements."""
    from gyriflow.folding.checks import refuse_impossible, zone_report
    from gyriflow.folding.zones import zones_of_run
    from gyriflow.io.tetmeshes import write_tetrahedral_mesh
    from gyriflow.mesh.quality import radius_ratios

    mesh = brain_mesh(tets)
    zones = zones_of_run(mesh, reference_parameters())
    refuse_impossible(mesh, zones)
    known = {
        "tets": len(mesh.tets),
        "unknowns": 3 * len(mesh.vertices),
        "min_radius_ratio": float(radius_ratios(mesh).min()),
        "elements_through_cortex": zone_report(mesh, zones, THICKNESS_MM)["elements_through_cortex"],
    }
    runs: dict[int, list[dict]] = {ranks: [] for ranks in arguments.ranks}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "brain.xdmf"
        write_tetrahedral_mesh(file, mesh)
        del mesh, zones
        for _ in range(arguments.repeats):
            for ranks in arguments.ranks:
                runs[ranks].append(run(file, arguments.steps, ranks))
    return [summary(of_ranks, known, ranks) for ranks, of_ranks in runs.items()]


def result(rows: list[dict], arguments: argparse.Namespace) -> dict:
    """Returns the content of the last line: lists in the order of the sizes, per number of ranks where it matters."""
    ranks = arguments.ranks
    by_ranks = {count: [row for row in rows if row["ranks"] == count] for count in ranks}

    def values(name: str, count: int, digits: int | None = 3) -> list[float]:
        return [round(row[name], digits) for row in by_ranks[count]]

    def cost(row: dict) -> float:
        return row["seconds"] / row["unknowns"]

    found: dict = {
        "sizes": values("tets", ranks[0]),
        "unknowns": values("unknowns", ranks[0]),
        "min_radius_ratio": values("min_radius_ratio", ranks[0]),
        "elements_through_cortex": values("elements_through_cortex", ranks[0], 2),
        "steps": arguments.steps,
        "repeats": arguments.repeats,
    }
    for count in ranks:
        found[f"seconds_{count}"] = values("seconds", count)
    for count in ranks:
        if count > 1 and 1 in ranks:
            pairs = zip(by_ranks[1], by_ranks[count], strict=True)
            found[f"speedup_{count}_ranks"] = [round(one["seconds"] / more["seconds"], 2) for one, more in pairs]
    found["cost_per_unknown_growth"] = {
        str(count): round(cost(by_ranks[count][-1]) / cost(by_ranks[count][0]), 2) for count in ranks
    }
    for name in ("memory_MiB", "newton_per_step", "krylov_per_newton", "us_per_unknown_newton"):
        digits = None if name == "memory_MiB" else 2
        found[name] = {str(count): values(name, count, digits) for count in ranks}
    return found


def main(arguments: argparse.Namespace) -> None:
    print("  ".join(heading for heading, _, _ in COLUMNS), flush=True)
    rows: list[dict] = []
    for tets in sorted(arguments.sizes):
        rows += (new := rows_of_size(tets, arguments))
        for row in new:
            print("  ".join(f"{row[name]:{len(heading)}{form}}" for heading, name, form in COLUMNS), flush=True)
    print(json.dumps(result(rows, arguments)), flush=True)


if __name__ == "__main__":
    arguments = parse()
    if arguments.inside_mpi:
        do_steps(arguments.inside_mpi, arguments.steps)
    else:
        main(arguments)
