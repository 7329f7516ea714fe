"""Time per step of the folding solve against the paper's set-up, on the same mesh in one run.

    ./run python benchmarks/folding_step.py MESH --steps 6 --ranks 2

MESH is any tetrahedral mesh in mm (XDMF), untagged. The paper's set-up: MUMPS LU, relaxation 0.8, start from the
last displacement, residual 1e-6 relative or 1e-9 absolute, quadrature degree 3; field updates and BLAS are ours.
Both start from the same shape and do the same steps. The first step of either, which compiles and sets up, is not
counted. The last line is one JSON object.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--steps", type=int, default=6, help="counted steps of ours")
    parser.add_argument("--paper-steps", type=int, default=2, help="counted steps of the paper's set-up")
    parser.add_argument("--ranks", type=int, default=2, help="MPI ranks of both")
    parser.add_argument("--params", type=Path, help="parameters (YAML) instead of the paper's reference values")
    parser.add_argument("--inside-mpi", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args()


def relaxed_lu_step(problem, krylov, residual, direction, start: np.ndarray) -> int:
    """Do a step as the paper's prototype does; the number of iterations."""
    from petsc4py import PETSc

    problem.set_displacement(start)
    first = norm = problem.residual(residual)
    for iteration in range(1, 51):
        krylov.setOperators(problem.tangent().elastic.matrix.products)
        krylov.solve(residual, direction)
        problem.vector.axpy(-0.8, direction)
        problem.vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        norm = problem.residual(residual)
        if norm <= max(1e-6 * first, 1e-9):
            return iteration
    raise SystemExit(f"the paper's set-up did not converge: residual {norm:.1e} of {first:.1e}")


def measure(arguments: argparse.Namespace) -> None:
    from mpi4py import MPI
    from petsc4py import PETSc

    from gyriflow.folding.checkpoint import State
    from gyriflow.folding.checks import refuse_impossible
    from gyriflow.folding.output import peak_memory_mib
    from gyriflow.folding.simulation import Folding
    from gyriflow.folding.zones import zones_of_run
    from gyriflow.io.tetmeshes import read_tetrahedral_mesh
    from gyriflow.parameters.folding import parameters_from
    from gyriflow.units import M_PER_MM, MM_PER_M

    comm = MPI.COMM_WORLD
    mesh = comm.bcast(read_tetrahedral_mesh(arguments.mesh) if comm.rank == 0 else None, root=0)
    middle = float(mesh.vertices[:, 0].min() + mesh.vertices[:, 0].max()) / 2
    values = {"start_week": 21.0, "end_week": 36.0, "fissure_x_mm": middle, "output_weeks": [21.0, 36.0]}
    values["contact"] = {"kind": "planes"}  # as the prototype has it
    values |= yaml.safe_load(arguments.params.read_text()) if arguments.params else {}
    p = parameters_from(values)
    zones = zones_of_run(mesh, p)
    refuse_impossible(mesh, zones)
    ours = Folding(comm, mesh, zones, p)
    states, seconds, newton, krylov = [State.at_start(mesh.vertices * M_PER_MM, p.step_s)], [], [], []
    for _ in range(arguments.steps + 1):
        comm.barrier()
        began = time.perf_counter()
        state = ours.step(states[-1], p.step_s)
        seconds.append(time.perf_counter() - began)
        newton.append(state.rows[-1]["newton"])
        krylov.append(state.rows[-1]["krylov"])
        states.append(state)
    memory = comm.reduce(peak_memory_mib(), op=MPI.SUM, root=0)

    paper = Folding(comm, mesh, zones, p, quadrature_degree=3)
    solver = PETSc.KSP().create(comm)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    residual, direction = paper.problem.new_vector(), paper.problem.new_vector()
    domain, start = paper.domain, np.zeros_like(paper.problem.displacement)
    paper_seconds, paper_newton = [], []
    for _ in range(min(arguments.paper_steps, arguments.steps) + 1):
        comm.barrier()
        began = time.perf_counter()
        paper.begin(replace(states[len(paper_seconds)], positions=domain.positions), p.step_s)
        iterations = relaxed_lu_step(paper.problem, solver, residual, direction, start)
        start = paper.problem.displacement.copy()
        domain.place(domain.positions + domain.gathered(start[: domain.owned]))
        paper_seconds.append(time.perf_counter() - began)
        paper_newton.append(iterations)
    difference = np.linalg.norm(domain.positions - states[len(paper_seconds)].positions, axis=1).max() * MM_PER_M
    if comm.rank == 0:
        mine, theirs = float(np.median(seconds[1:])), float(np.median(paper_seconds[1:]))
        result = {
            "tets": len(mesh.tets),
            "dofs": 3 * len(mesh.vertices),
            "ranks": comm.size,
            "blas_threads": int(os.environ["OPENBLAS_NUM_THREADS"]),
            "seconds_per_step": round(mine, 3),
            "paper_seconds_per_step": round(theirs, 2),
            "ratio": round(theirs / mine, 1),
            "newton_per_step": float(np.mean(newton[1:])),
            "paper_newton_per_step": float(np.mean(paper_newton[1:])),
            "krylov_per_newton": round(sum(krylov[1:]) / max(sum(newton[1:]), 1), 1),
            "max_difference_mm": float(f"{difference:.3g}"),
            "peak_memory_MiB": round(memory),
        }
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    arguments = parse()
    if arguments.inside_mpi:
        measure(arguments)
    else:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        command = ["mpiexec", "-n", str(arguments.ranks), sys.executable, __file__, *sys.argv[1:], "--inside-mpi"]
        sys.exit(subprocess.run(command, check=False).returncode)
