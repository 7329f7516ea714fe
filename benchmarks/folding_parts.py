"""What the folding solve spends its time on: processor seconds of each part, from the start or from a saved state.

    ./run mpiexec -n 1 python benchmarks/folding_parts.py MESH --weeks 9 --step-s 86400 --save folded.h5
    ./run mpiexec -n 1 python benchmarks/folding_parts.py MESH --state folded.h5 --weeks 0.4

MESH is any tetrahedral mesh in mm (XDMF). The first step, which compiles and sets up, is not counted. Processor
seconds depend less on what else a machine does than seconds by the clock; of several ranks they hold the waiting for
each other.
The last line is one JSON object.
"""

import argparse
import json
import time
from dataclasses import replace
from functools import wraps
from pathlib import Path

import h5py
import yaml
from mpi4py import MPI

from gyriflow.folding import checkpoint, ladder
from gyriflow.folding.checkpoint import State
from gyriflow.folding.contact import SelfContact
from gyriflow.folding.output import peak_memory_mib
from gyriflow.folding.problem import Problem
from gyriflow.folding.rates import RateProblem
from gyriflow.folding.simulation import Folding, advance
from gyriflow.folding.zones import zones_of_run
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.parameters.reading import parameters_from
from gyriflow.units import M_PER_MM, SECONDS_PER_GW

PARTS = {
    "linear solves": [(ladder._System, "run")],
    "elastic tangent": [(Problem, "_elastic_tangent"), (RateProblem, "linearise")],
    "elastic forces and energy": [(Problem, "_elastic_residual"), (Problem, "elastic_energy")],
    "layers": [(Folding, "_set_tissue")],
    "contact: pairs": [(SelfContact, "_state"), (SelfContact, "mesh_moved")],
    "contact: sweep": [(SelfContact, "largest_step")],
    "contact: forces, energy and stiffness": [*((SelfContact, name) for name in ("energy", "forces", "stiffness"))],
}
"""Methods by part; what one of them spends in another counts there alone."""


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--weeks", type=float, default=0.5, help="gestational weeks to fold")
    parser.add_argument("--step-s", type=float, default=43_200.0)
    parser.add_argument("--params", type=Path, help="parameters (YAML) that replace reference values")
    parser.add_argument("--state", type=Path, help="saved state to begin with")
    parser.add_argument("--save", type=Path, help="file for the state at the end")
    return parser.parse_args()


def measure(owner: type, name: str, part: str, spent: dict[str, float], inside: list[float]) -> None:
    """Has a method note its processor seconds under its part, less those that others note within it."""
    method = getattr(owner, name)

    @wraps(method)
    def measured(*given, **named):
        began = time.process_time()
        inside.append(0.0)
        try:
            return method(*given, **named)
        finally:
            took = time.process_time() - began
            spent[part] += took - inside.pop()
            if inside:
                inside[-1] += took

    setattr(owner, name, measured)


def saved_state(file: Path) -> State:
    """Returns the state in a file, whatever run it belongs to."""
    with h5py.File(file) as store:
        arrays = {name: store[name][:] for name in checkpoint.ARRAYS if name in store}
        values = json.loads(store["scalars"][:].tobytes().decode())
    values.pop("key")
    return State(**arrays, **(values | {"rows": tuple(values["rows"])}))


def main() -> None:
    arguments, comm = parse(), MPI.COMM_WORLD
    spent, inside = dict.fromkeys(PARTS, 0.0), []
    for part, methods in PARTS.items():
        for owner, name in methods:
            measure(owner, name, part, spent, inside)
    mesh = comm.bcast(read_tetrahedral_mesh(arguments.mesh) if comm.rank == 0 else None, root=0)
    x = mesh.vertices[:, 0]
    values = {"start_week": 21.0, "end_week": 36.0, "output_weeks": [21.0, 36.0], "step_s": arguments.step_s}
    values["fissure_x_mm"] = float(x.min() + x.max()) / 2
    p = parameters_from(values | (yaml.safe_load(arguments.params.read_text()) if arguments.params else {}))
    folding = Folding(comm, mesh, zones_of_run(mesh, p), p)
    state = saved_state(arguments.state) if arguments.state else State.at_start(mesh.vertices * M_PER_MM, p.step_s)
    state = replace(state, step_s=p.step_s)
    until = state.time_s + arguments.weeks * SECONDS_PER_GW
    state = advance(folding, state, until)
    spent.update(dict.fromkeys(PARTS, 0.0))
    first, began = len(state.rows), time.process_time()
    while state.time_s < until * (1 - 1e-12):
        state = advance(folding, state, until)
        if comm.rank == 0:
            print({name: state.rows[-1][name] for name in ("week", "newton", "krylov", "seconds")}, flush=True)
    whole = comm.allreduce(time.process_time() - began)
    parts = {part: round(comm.allreduce(seconds), 2) for part, seconds in spent.items()}
    memory = comm.allreduce(peak_memory_mib())
    if comm.rank == 0:
        if arguments.save:
            checkpoint.write_checkpoint(arguments.save, "", state)
        rows = state.rows[first:]
        counts = {name: sum(row[name] for row in rows) for name in ("newton", "krylov")}
        size = {"tets": len(mesh.tets), "unknowns": 3 * len(mesh.vertices), "ranks": comm.size, "steps": len(rows)}
        rest = {"other": round(whole - sum(parts.values()), 2)}
        print(json.dumps(size | counts | {"cpu_seconds": round(whole, 2), **parts, **rest, "peak_MiB": round(memory)}))


if __name__ == "__main__":
    main()
