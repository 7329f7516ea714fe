"""Convergence of growth towards shapes in the time step: stress rate, map of growth and shape.

    ./run python benchmarks/growth_in_time.py MESH PARAMS MAPS --end-week 26 --steps 7 14 28

MESH, PARAMS and MAPS are `mesh/brain.xdmf` of a brain, and `params.yaml` and `folding/maps.h5` of a run with growth
towards shapes from it. The run is made with each number of steps a week up to `--end-week`. Reported are the stress
rate of the last step (median of the elements, von Mises, Pa per week) and, from each number of steps to the
next, without rigid motion, relative differences (L2, weighted by volume) of the stress rate and of the logarithm of
growth, and the largest difference of positions. The last line is one JSON object.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from gyriflow.folding.checkpoint import State
from gyriflow.folding.simulation import Folding, advance
from gyriflow.folding.stress import unpacked
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.alignment import rigid_fit
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import TetrahedralMesh, linear_pieces, signed_volumes
from gyriflow.geometry.triangles import Floats
from gyriflow.io.tetmeshes import read_maps, read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.folding import FoldingParameters, parameters_from
from gyriflow.units import MM_PER_M, SECONDS_PER_GW


def relative_difference(first: Floats, second: Floats, sizes: Floats) -> float:
    """Return the norm of the difference of (n, ...) values over that of the second, weighted by (n,) sizes."""
    squares = [(values.reshape(len(sizes), -1) ** 2).sum(axis=1) for values in (second - first, second)]
    return float(np.sqrt(np.dot(sizes, squares[0]) / np.dot(sizes, squares[1])))


def fold(mesh: TetrahedralMesh, parameters: FoldingParameters, maps: dict[str, Floats], steps: int) -> dict[str, Any]:
    """Run to the end with a number of steps a week; return growth, stress rate, positions in mm and iterations."""
    p = parameters.model_copy(update={"step_s": SECONDS_PER_GW / steps, "fields": ("stress",)})
    folding = Folding(MPI.COMM_SELF, mesh, zones_of_run(mesh, p), p, maps)
    state, until = State.at_start(folding.start, p.step_s), (p.end_week - p.start_week) * SECONDS_PER_GW
    while state.time_s < until * (1 - 1e-12):
        state = advance(folding, state, until)
    fields = folding.fields.elements(p.fields, folding.solved)
    stress = next(values for name, values in fields.items() if name.startswith("von_mises"))
    return {
        "growth": unpacked(state.log_growth.T),
        "stress": stress,
        "positions": state.positions * MM_PER_M,
        "newton": [row["newton"] for row in state.rows],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("params", type=Path)
    parser.add_argument("maps", type=Path)
    parser.add_argument("--end-week", type=float, required=True)
    parser.add_argument("--steps", type=int, nargs="+", default=[7, 14, 28])
    arguments = parser.parse_args()
    mesh, maps, values = read_tetrahedral_mesh(arguments.mesh), read_maps(arguments.maps), read_yaml(arguments.params)
    ends = {"end_week": arguments.end_week, "output_weeks": [values["start_week"], arguments.end_week]}
    parameters = parameters_from(values | ends)
    pieces = linear_pieces(mesh)
    rows: list[dict[str, Any]] = []
    before: dict[str, Any] | None = None
    for steps in arguments.steps:
        found = fold(mesh, parameters, maps, steps)
        row = {"steps_per_week": steps, "stress_pa_per_week": float(np.median(found["stress"]))}
        row |= {"newton": sum(found["newton"]), "share_up_to_3": float(np.mean(np.array(found["newton"]) <= 3))}
        if before is not None:
            end = TetrahedralMesh(found["positions"], mesh.tets)
            sizes = {"growth": vertex_sizes(end.vertices, pieces), "stress": signed_volumes(end)}
            # an unsupported body may turn as a whole
            motion = rigid_fit(before["positions"], found["positions"], sizes["growth"])
            places, turn = transform_points(before["positions"], motion), motion[:3, :3]
            turned = before | {"growth": turn @ before["growth"] @ turn.T}
            row |= {f"{name}_difference": relative_difference(turned[name], found[name], sizes[name]) for name in sizes}
            row["position_difference_mm"] = float(np.linalg.norm(found["positions"] - places, axis=1).max())
        rows.append(row)
        print(row, flush=True)
        before = found
    print(json.dumps({"tets": len(mesh.tets), "end_week": arguments.end_week, "rows": rows}))


if __name__ == "__main__":
    main()
