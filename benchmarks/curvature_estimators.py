"""Set this package's curvature beside the estimator of slam, with what it does to spectra: one JSON line.

    ./run python benchmarks/curvature_estimators.py LEFT.surf.gii RIGHT.surf.gii [--last B6]

slam takes curvature as Rusinkiewicz 2004 (doi 10.1109/TDPVT.2004.1335277): a tensor in each face from how the normals
change along its edges, averaged at the vertices. It is written here from that publication. For each hemisphere the JSON
has `r_mean_curvature` and `r_shape_index` between both estimators, `rms_ratio` of mean curvature (theirs to ours), and
the relative powers of B4, B5 and B6 of the shape index by `ours` and `theirs`.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from gyriflow.compare.placement import correlation
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    corners,
    face_normals,
    mean_edge_length,
    vertex_areas,
    vertex_normals,
)
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.laplace_beltrami import laplacian
from gyriflow.metrics.spangy import first_eigenvalue, modes_of, spectrum

BANDS = ("B4", "B5", "B6")


def tensor_curvature(mesh: TriangleMesh) -> tuple[Floats, Floats]:
    """Return the (n,) principal curvatures κ1 ≥ κ2 in 1/mm at the vertices, positive on a ball (Rusinkiewicz 2004)."""
    points, normals, facing = corners(mesh), vertex_normals(mesh), face_normals(mesh)
    sides = points[:, [2, 0, 1]] - points[:, [1, 2, 0]]
    first = sides[:, 0] / np.linalg.norm(sides[:, 0], axis=1)[:, None]
    second = np.cross(facing, first)
    at = normals[mesh.faces]
    turns = at[:, [2, 0, 1]] - at[:, [1, 2, 0]]
    # the tensor (a, b; b, c) of a face takes each side to the change of the normals along it: least squares
    along, across = (np.einsum("fij,fj->fi", sides, axis) for axis in (first, second))
    zero = np.zeros_like(along)
    rows = np.concatenate([np.stack([along, across, zero], -1), np.stack([zero, along, across], -1)], axis=1)
    changes = [np.einsum("fij,fj->fi", turns, axis) for axis in (first, second)]
    tensor = np.einsum("fij,fj->fi", np.linalg.pinv(rows), np.concatenate(changes, axis=1))
    # rotated into the tangent plane of each corner, weighted with the part of the face that is nearest to it
    weights = corner_areas(points, sides)
    sums, total = np.zeros((len(normals), 3)), np.zeros(len(normals))
    across_vertex = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, across_vertex)
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(normals, u)
    for corner in range(3):
        vertex = mesh.faces[:, corner]
        in_face = [turned_into(axes[vertex], facing, normals[vertex]) for axes in (u, v)]
        uf, us, vf, vs = (np.einsum("fi,fi->f", axis, own) for axis in in_face for own in (first, second))
        a, b, c = tensor.T
        own = np.stack(
            [
                a * uf * uf + 2 * b * uf * us + c * us * us,
                a * uf * vf + b * (uf * vs + us * vf) + c * us * vs,
                a * vf * vf + 2 * b * vf * vs + c * vs * vs,
            ],
            axis=1,
        )
        np.add.at(sums, vertex, weights[:, [corner]] * own)
        np.add.at(total, vertex, weights[:, corner])
    a, b, c = (sums / total[:, None]).T
    mean, spread = (a + c) / 2, np.sqrt(((a - c) / 2) ** 2 + b**2)
    return mean + spread, mean - spread


def turned_into(axes: Floats, facing: Floats, normals: Floats) -> Floats:
    """Return tangent axes (m, 3) at vertices rotated, about the line where both planes meet, into those of faces."""
    cosine = np.einsum("fi,fi->f", normals, facing)[:, None]
    # of the part along the tilt of the normals, the rotation keeps the length
    tilt = facing - cosine * normals
    away = np.einsum("fi,fi->f", tilt, axes)[:, None]
    return axes - (normals + facing) * away / (1 + cosine)


def corner_areas(points: Floats, sides: Floats) -> Floats:
    """Return the (m, 3) areas of faces that belong to their corners: Voronoi's, or halves where a face is obtuse."""
    squared = (sides**2).sum(axis=2)
    whole = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    # the angle at a corner is opposite its side
    dots = -np.einsum("fij,fij->fi", sides[:, [1, 2, 0]], sides[:, [2, 0, 1]])
    cotangent = dots / (2 * whole[:, None])
    parts = (squared * cotangent)[:, [1, 2, 0]] + (squared * cotangent)[:, [2, 0, 1]]
    parts /= 8
    obtuse = dots < 0
    blunt = obtuse.any(axis=1)
    parts[blunt] = np.where(obtuse[blunt], 0.5, 0.25) * whole[blunt, None]
    return parts


def compared(mesh: TriangleMesh, last: str) -> dict[str, object]:
    """Return what both estimators say of a hemisphere."""
    ours = curvature(mesh, radius_mm=3.0)
    high, low = tensor_curvature(mesh)
    theirs, index = (high + low) / 2, 2 / np.pi * np.arctan2(high + low, high - low)
    areas, (stiffness, mass) = vertex_areas(mesh), laplacian(mesh)
    modes, reach = modes_of(last, stiffness, mass, first_eigenvalue(stiffness, mass))
    rms = [np.sqrt(np.average(mean**2, weights=areas)) for mean in (theirs, ours.mean)]
    found: dict[str, object] = {
        "vertices": len(mesh.vertices),
        "edge_mm": round(mean_edge_length(mesh), 3),
        "r_mean_curvature": round(correlation(ours.mean, theirs, areas), 4),
        "r_shape_index": round(correlation(ours.shape_index, index, areas), 4),
        "rms_ratio": round(float(rms[0] / rms[1]), 4),
    }
    for name, proxy in (("ours", ours.shape_index), ("theirs", index)):
        bands = spectrum(proxy, modes, mass, edge_length_mm=mean_edge_length(mesh), reach=reach).bands
        shares = bands.set_index("band")["relative_power"].dropna()
        found[name] = {band: round(float(shares[int(band[1])]), 4) for band in BANDS if int(band[1]) in shares}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("left", type=Path)
    parser.add_argument("right", type=Path)
    parser.add_argument("--last", choices=BANDS, default="B6", help="the last band whose modes are all taken")
    options = parser.parse_args()
    sides = {"left": options.left, "right": options.right}
    found = {name: compared(read_surface(path), options.last) for name, path in sides.items()}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
