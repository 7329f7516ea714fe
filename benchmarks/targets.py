"""Are targets, and the path through them, shapes of a body? Inverted elements and crossing faces of a run's targets.

    ./run python benchmarks/targets.py MESH PARAMS MAPS [--parts 4]

MESH, PARAMS and MAPS are `mesh/brain.xdmf` of a brain, and `params.yaml` and `folding/maps.h5` of a run with growth
towards shapes from it. Each interval between two targets is divided into `--parts`. For each week, the elements (linear
pieces) that are inverted, the smallest and largest ratio of an element's volume to its own at the start, and the
crossing faces of the boundary. The last line is one JSON object.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from gyriflow.folding.targets import path_through, shapes_of_run
from gyriflow.geometry.matching import crossing_faces
from gyriflow.geometry.tetrahedra import boundary_surface, linear_pieces, volumes_between
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.tetmeshes import read_maps, read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.folding import parameters_from


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("params", type=Path)
    parser.add_argument("maps", type=Path)
    parser.add_argument("--parts", type=int, default=4, help="parts of an interval between two targets")
    arguments = parser.parse_args()
    mesh, maps = read_tetrahedral_mesh(arguments.mesh), read_maps(arguments.maps)
    parameters = parameters_from(read_yaml(arguments.params))
    pieces, (boundary, used) = linear_pieces(mesh), boundary_surface(mesh)
    weeks, shapes = shapes_of_run(parameters, maps, mesh.vertices)
    path = path_through(weeks, shapes, pieces)
    volumes = volumes_between(mesh.vertices, pieces)
    rows: list[dict[str, Any]] = []
    for part in np.arange(1, (len(weeks) - 1) * arguments.parts + 1) / arguments.parts:
        week = float(np.interp(part, np.arange(len(weeks)), weeks))
        places = path(week)
        ratios = volumes_between(places, pieces) / volumes
        row = {"week": week, "target": bool(part == round(part)), "inverted": int((ratios <= 0).sum())}
        row |= {"least_ratio": round(float(ratios.min()), 4), "largest_ratio": round(float(ratios.max()), 2)}
        row["crossing_faces"] = crossing_faces(TriangleMesh(places[used], boundary.faces))
        rows.append(row)
        print(row, flush=True)
    worst = {name: max(row[name] for row in rows) for name in ("inverted", "crossing_faces")}
    print(json.dumps({"elements": len(pieces), **worst, "rows": rows}))


if __name__ == "__main__":
    main()
