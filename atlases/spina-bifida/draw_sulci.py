"""Draw the named sulci of `sulci.yaml` on their brain: one JSON line.

    ./run python atlases/spina-bifida/draw_sulci.py [--write]

With `--write` the label volume is written anew. The JSON has for each hemisphere and sulcus the length of its line, its
area, its mean curvature (1/mm, below 0 in a valley) and its mean depth below the hull.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from gyriflow.anatomy.pial import from_labels
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.triangles import Floats, Ints, TriangleMesh, convex_hull, edges, vertex_areas
from gyriflow.io.volumes import LabelVolume, read_label_volume, write_label_volume
from gyriflow.io.yaml_files import SCHEMES, read_yaml
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.gyrification import sulcal_depth

FOLDER = Path(__file__).parent
SEEN_MM = 1.5
"""How far from a point of a line, as seen from the side, its place on the surface may be."""
STEEPNESS = 20.0
"""How strongly, in mm, concave ways are preferred."""
DEEP_MM = 2.0
NEAR_MM = 3.0
"""How far from the surface voxels take its sulcus."""


def drawn_line(mesh: TriangleMesh, bend: Floats, line: dict[str, Any], outwards: float) -> tuple[Ints, float]:
    """Return the vertices along the most concave way through the points of a line, and its length in mm.

    `outwards` is the sign of x on the hemisphere's lateral side.
    """
    towards = mesh.vertices[:, 0] * outwards * (1 if line["seen"] == "lateral" else -1)
    stops = []
    for point in line["through"]:
        near = np.flatnonzero(np.linalg.norm(mesh.vertices[:, 1:] - point, axis=1) < SEEN_MM)
        nearest = near[towards[near] > towards[near].max() - SEEN_MM]
        stops.append(int(nearest[np.argmin(bend[nearest])]))
    cost = _ways(mesh, np.exp(STEEPNESS * np.clip(bend, -0.1, 0.1)))
    _, before = dijkstra(cost, directed=False, indices=stops[:-1], return_predecessors=True)
    path = [stops[0]]
    for row, stop in enumerate(stops[1:]):
        way = [stop]
        while way[-1] != stops[row]:
            way.append(int(before[row, way[-1]]))
        path += way[-2::-1]
    return np.array(path), float(np.linalg.norm(np.diff(mesh.vertices[path], axis=0), axis=1).sum())


def draw(mesh: TriangleMesh, drawing: dict[str, Any]) -> tuple[Ints, list[dict[str, Any]]]:
    """Return the (n,) number of the sulcus at each vertex of a hemisphere, 0 for none, and a row about each sulcus."""
    bend = curvature(mesh, radius_mm=drawing["radius_mm"]).mean
    depth, areas = sulcal_depth(mesh, convex_hull(mesh)), vertex_areas(mesh)
    outwards = 1.0 if mesh.vertices[:, 0].mean() > 0 else -1.0
    valley = (bend < 0) | (depth > DEEP_MM)
    labels, nearest, rows = np.zeros(len(bend), dtype=np.int64), np.full(len(bend), np.inf), []
    lengths = _ways(mesh, np.ones(len(bend)))
    for number, line in enumerate(drawing["sulci"], start=1):
        along, length = drawn_line(mesh, bend, line, outwards)
        away = dijkstra(lengths, directed=False, indices=along, min_only=True, limit=line["reach_mm"])
        inside = np.flatnonzero((valley & np.isfinite(away)) | (away == 0))
        _, part = connected_components(lengths[inside][:, inside], directed=False)
        # what is connected with the line; where sulci meet, with the nearer line
        inside = inside[(part == part[np.searchsorted(inside, along[0])]) & (away[inside] < nearest[inside])]
        labels[inside], nearest[inside] = number, away[inside]
        rows.append({"name": line["name"], "length_mm": length})
    fine = curvature(mesh).mean
    for number, row in enumerate(rows, start=1):
        inside = labels == number
        row |= {"area_mm2": areas[inside].sum()}
        row |= {
            name: np.average(of[inside], weights=areas[inside]) for name, of in (("curvature", fine), ("depth", depth))
        }
    return labels, rows


def _ways(mesh: TriangleMesh, cost: Floats) -> sparse.csr_array:
    """Make a graph of the edges: their lengths times the mean cost of their ends."""
    pairs, _ = edges(mesh)
    first, second = pairs.T
    weights = np.linalg.norm(mesh.vertices[first] - mesh.vertices[second], axis=1) * (cost[first] + cost[second]) / 2
    return sparse.csr_array((weights, (first, second)), shape=(len(cost), len(cost)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    drawing = read_yaml(FOLDER / "sulci.yaml")
    volume = read_label_volume(FOLDER / drawing["labels"])
    surface = from_labels(volume.labels, volume.affine, SCHEMES[drawing["scheme"]], week=drawing["week"])
    sides = {"left": surface.left, "right": surface.right}
    drawn = {side: draw(mesh, drawing) for side, mesh in sides.items()}
    if arguments.write:
        points = np.concatenate([mesh.vertices for mesh in sides.values()])
        # the surface is posed as the volume is
        points = transform_points(points, np.linalg.inv(surface.report["pose"]["world"]))
        labels = np.concatenate([labels for labels, _ in drawn.values()])
        index = np.indices(volume.labels.shape).reshape(3, -1).T
        centres = transform_points(index, volume.affine)
        near = cKDTree(points).query(centres, distance_upper_bound=NEAR_MM)[1]
        sulci = np.append(labels, 0)[near].reshape(volume.labels.shape).astype(np.int32)
        write_label_volume(FOLDER / drawing["volume"], LabelVolume(sulci, volume.affine))
    print(json.dumps({side: rows for side, (_, rows) in drawn.items()}))


if __name__ == "__main__":
    main()
