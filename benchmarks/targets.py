"""Does a run arrive at its targets? A run towards shapes, made anew, against the shapes that it is to have.

    ./run python benchmarks/targets.py MESH PARAMS MAPS [--steps 7 14] [--filter 0.4] [--end-week 29]

MESH, PARAMS and MAPS are `mesh/brain.xdmf` of a brain, and `params.yaml` and `folding/maps.h5` of a run with growth
towards shapes from it. For each number of steps a week and each week: the elements that the path inverts on the way
there, and of the run: area and volume against the target (%), distance of the boundary from it without rigid motion
(root mean square, mm), elements inverted, faces that cross, the least det F of a step, Newton iterations, CPU seconds,
the median von Mises stress of the last step (Pa per week), and the change of the logarithm of growth since the run with
the number of steps before (L2). With `--filter` growth is smoothed over that length from element to element, which
makes it incompatible; gyriflow does not. The last line is one JSON object.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import cg

from gyriflow.folding.checkpoint import State
from gyriflow.folding.simulation import Folding, advance
from gyriflow.folding.step_fields import von_mises
from gyriflow.folding.stretches import log_stretch, packed, unpacked
from gyriflow.folding.targets import TargetGrowth, shapes_of_run
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.alignment import rigid_fit
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.matching import crossing_faces
from gyriflow.geometry.tetrahedra import FACES, TetrahedralMesh, boundary_surface, linear_pieces, volumes_between
from gyriflow.geometry.triangles import Floats, TriangleMesh, area, signed_volume
from gyriflow.io.tetmeshes import read_maps, read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.folding import FoldingParameters, parameters_from
from gyriflow.units import MM_PER_M, SECONDS_PER_GW


class ElementFilter:
    """Smoothing of tensors from element to element: (V + l²/2 Σ A/d) g = V logs over the faces between them."""

    def __init__(self, mesh: TetrahedralMesh, length_mm: float) -> None:
        self.tets, self.length_mm = mesh.tets, length_mm
        faces = np.sort(mesh.tets[:, FACES].reshape(-1, 3), axis=1)
        order = np.lexsort(faces.T[::-1])
        shared = np.flatnonzero((faces[order][1:] == faces[order][:-1]).all(axis=1))
        self.first, self.second = order[shared] // 4, order[shared + 1] // 4
        self.between = faces[order[shared]]

    def smooth(self, places: Floats, logs: Floats) -> Floats:
        volumes, centres = volumes_between(places, self.tets), places[self.tets].mean(axis=1)
        corners = places[self.between]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        weights = areas / np.linalg.norm(centres[self.first] - centres[self.second], axis=1) * self.length_mm**2 / 2
        ends = np.concatenate([self.first, self.second]), np.concatenate([self.second, self.first])
        links = sparse.coo_matrix((np.tile(weights, 2), ends), (len(volumes),) * 2).tocsr()
        matrix = sparse.diags(volumes + np.asarray(links.sum(axis=1)).ravel()) - links
        scale = sparse.diags(1 / matrix.diagonal())
        return np.stack([cg(matrix, volumes * column, x0=column, rtol=1e-3, M=scale)[0] for column in logs.T], axis=1)


def filter_growth(folding: Folding, mesh: TetrahedralMesh, length_mm: float) -> None:
    """Make growth of a run on one rank and linear elements that of elements smoothed over a length."""
    smoothing, number = ElementFilter(mesh, length_mm), folding.domain.tet_of_cell

    def inverse(self: TargetGrowth, tissue: Any) -> Floats:
        logs = np.empty((len(number), 6))
        logs[number] = packed(log_stretch(self.deformation(tissue.elements)[:, 0]))
        values, axes = np.linalg.eigh(unpacked(smoothing.smooth(self.start.positions_mm, logs)[number]))
        return ((axes * np.exp(-values)[..., None, :]) @ axes.swapaxes(-1, -2))[:, None]

    TargetGrowth.inverse = inverse  # type: ignore[method-assign]


def follow(
    mesh: TetrahedralMesh, p: FoldingParameters, maps: dict[str, Floats], filter_mm: float
) -> tuple[list[dict[str, Any]], Floats]:
    """Run to the end; return a row for each target, and the logarithm (m, 6) of growth of all elements."""
    folding = Folding(MPI.COMM_SELF, mesh, zones_of_run(mesh, p), p, maps)
    if filter_mm:
        filter_growth(folding, mesh, filter_mm)
    boundary, used = boundary_surface(mesh)
    pieces, state = linear_pieces(mesh), State.at_start(folding.start, p.step_s)
    weeks, shapes = shapes_of_run(p, maps, mesh.vertices)
    path = folding.model.__self__.path  # type: ignore[attr-defined]
    rows, began = [], time.process_time()
    for number, (week, shape) in enumerate(zip(weeks[1:], shapes[1:], strict=True)):
        if week > p.end_week + 1e-9:
            break
        until, first = (week - p.start_week) * SECONDS_PER_GW, len(state.rows)
        while state.time_s < until * (1 - 1e-12):
            state = advance(folding, state, until)
        places = state.positions * MM_PER_M
        goal = transform_points(shape, rigid_fit(shape, places, vertex_sizes(places, pieces)))
        found, target = (TriangleMesh(x[used], boundary.faces) for x in (places, goal))
        stress = folding.problem.evaluate("stress", folding.solved.displacement).reshape(-1, 3, 3)
        steps = state.rows[first:]
        row = {"week": week, "steps": len(steps), "inverted_by_path": len(path.inverted[number])}
        row["area_percent"] = 100 * (area(found) / area(target) - 1)
        row["volume_percent"] = 100 * (signed_volume(found) / signed_volume(target) - 1)
        row["distance_mm"] = float(np.sqrt(((places - goal)[used] ** 2).sum(axis=1).mean()))
        row["inverted"] = int((volumes_between(places, pieces) <= 0).sum())
        row["crossing_faces"] = crossing_faces(found)
        row |= {"least_J": min(step["min_J"] for step in steps), "newton": sum(step["newton"] for step in steps)}
        row |= {name: max(step[name] for step in steps) for name in ("held_elements", "shrinking_elements")}
        row["stress_pa_per_gw"] = float(np.median(von_mises(stress))) * SECONDS_PER_GW / folding.solved.step_s
        row["cpu_seconds"] = time.process_time() - began
        rows.append({name: round(value, 4) for name, value in row.items()})
        print(rows[-1], flush=True)
    return rows, packed(log_stretch(state.growth, left=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("params", type=Path)
    parser.add_argument("maps", type=Path)
    parser.add_argument("--steps", type=int, nargs="+", default=[7], help="steps a week")
    parser.add_argument("--filter", type=float, metavar="MM", default=0.0, help="length over which growth is smoothed")
    parser.add_argument("--end-week", type=float)
    arguments = parser.parse_args()
    mesh, maps = read_tetrahedral_mesh(arguments.mesh), read_maps(arguments.maps)
    values = read_yaml(arguments.params)
    if (end := arguments.end_week) is not None:
        values |= {"end_week": end, "output_weeks": [values["start_week"], end]}
    parameters = parameters_from(values)
    volumes, result, before = volumes_between(mesh.vertices, mesh.tets), [], None
    for steps in arguments.steps:
        rows, growth = follow(
            mesh, parameters.model_copy(update={"step_s": SECONDS_PER_GW / steps}), maps, arguments.filter
        )
        run: dict[str, Any] = {"steps_per_week": steps, "rows": rows}
        if before is not None:
            change, size = (float(((x**2).sum(axis=1) * volumes).sum()) for x in (growth - before, growth))
            run["growth_change"] = round((change / size) ** 0.5, 5)
            print("change of growth", run["growth_change"], flush=True)
        result.append(run)
        before = growth
    print(json.dumps({"elements": len(mesh.tets), "filter_mm": arguments.filter, "runs": result}))


if __name__ == "__main__":
    main()
