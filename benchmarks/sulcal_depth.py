"""Compares measures of sulcal depth on phantoms of known depth, and over the weeks of real brains: one JSON line.

    ./run python benchmarks/sulcal_depth.py
    ./run python benchmarks/sulcal_depth.py --surfaces week21.left.surf.gii week22.left.surf.gii ...

The phantoms are an ellipsoid of 30, 22 and 18 mm with one fissure, 8 mm deep, across its side. `open`: a valley whose
mouth is 4 to 25 mm wide. `closing`: a fissure 12 mm wide at its bottom whose lips close over it, as the Sylvian
fissure's do, from 16 to 3 mm. `smooth`: the ellipsoid bent
like a banana, with a hollow side but no sulcus. The true depth of a
vertex is its distance from the surface without the fissure; for `smooth` it is 0.

For each measure: `error`, RMS over the vertices (by area, all widths) in per cent of the depth of the fissure; `jump`,
the largest change of the deepest vertex's depth between successive widths in per cent of the fissure's depth (the true
one does not change); `smooth`, the mean depth in mm that is found where there is none; `seconds` for all phantoms.
With `--surfaces`, the mean depth of each in mm.
"""

import argparse
import json
import time
from collections.abc import Callable

import igl
import numpy as np
import trimesh

from gyriflow.geometry.triangles import Floats, TriangleMesh, vertex_areas
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.depth import convex_hull, sulcal_depth
from gyriflow.metrics.gyrification import cap, envelope

DEPTH_MM = 8.0
SEMI_AXES_MM = np.array([30.0, 22.0, 18.0])
OPEN_MM = (4.0, 6.0, 8.0, 9.0, 10.0, 11.0, 12.0, 14.0, 17.0, 20.0, 25.0)
CLOSING_MM = (16.0, 14.0, 12.0, 11.0, 10.0, 9.0, 8.0, 6.0, 4.5, 3.0)
BOTTOM_MM = 12.0
BEND_MM = 18.0
"""How far the ends of the smooth phantom are bent aside: its inner side is hollow by about 2 mm."""


def ellipsoid() -> TriangleMesh:
    shape = trimesh.creation.icosphere(subdivisions=6, radius=1.0)
    return TriangleMesh(shape.vertices * SEMI_AXES_MM, shape.faces)


def with_fissure(mouth_mm: float, bottom_mm: float | None) -> TriangleMesh:
    """Returns the ellipsoid with a fissure along its length on the side y > 0, straight-sided where there is a bottom.

    Across the fissure a vertex lies at z; with a bottom, the lips are pulled over the fissure by moving vertices along
    z: those at the mouth from half the bottom's width to half the mouth's, others the less the further off they are.
    """
    base = ellipsoid()
    x, y, z = base.vertices.T
    width = mouth_mm if bottom_mm is None else bottom_mm
    along = np.clip(1.0 - (x / 18.0) ** 2, 0.0, None)
    side = (y > 0) & (along > 0)
    profile = np.exp(-((z / (0.5 * width)) ** (2 if bottom_mm is None else 8)) * 2)
    fall = np.where(side, DEPTH_MM * np.minimum(1.0, 2 * along) * profile, 0.0)
    inward = -base.vertices / SEMI_AXES_MM**2
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    moved = base.vertices + fall[:, None] * inward
    if bottom_mm is not None:
        high = 1.0 - fall / DEPTH_MM
        lips = 0.5 * (mouth_mm - bottom_mm) * np.tanh(z / (0.25 * bottom_mm)) * np.exp(-((z / 14.0) ** 4))
        moved[:, 2] += np.where(side, high**2 * lips * np.minimum(1.0, 2 * along), 0.0)
    return TriangleMesh(moved, base.faces)


def banana() -> TriangleMesh:
    mesh = ellipsoid()
    bent = mesh.vertices.copy()
    bent[:, 1] -= BEND_MM * (bent[:, 0] / 30.0) ** 2
    return TriangleMesh(bent, mesh.faces)


def to(outside: TriangleMesh, mesh: TriangleMesh) -> Floats:
    return sulcal_depth(mesh, outside)


def straight(radius_mm: float) -> Callable[[TriangleMesh], Floats]:
    return lambda mesh: to(envelope(mesh, radius_mm=radius_mm), mesh)


def to_hull(mesh: TriangleMesh) -> Floats:
    return to(convex_hull(mesh), mesh)


def graded(mesh: TriangleMesh) -> Floats:
    """Returns the mean of the straight depths below envelopes of 5, 10 and 20 mm radius and the hull."""
    return np.mean([*(straight(radius)(mesh) for radius in (5.0, 10.0, 20.0)), to_hull(mesh)], axis=0)


def geodesic(mesh: TriangleMesh) -> Floats:
    """Returns the distance along the surface from what touches the hull (within 0.5 mm), by the heat method."""
    data = igl.HeatGeodesicsData()
    igl.heat_geodesics_precompute(mesh.vertices, mesh.faces, data)
    # its smooth distance dips below 0 among the sources
    return np.maximum(igl.heat_geodesics_solve(data, np.flatnonzero(to_hull(mesh) < 0.5).astype(np.int32)), 0.0)


MEASURES: dict[str, Callable[[TriangleMesh], Floats]] = {
    "envelope 5 mm": straight(5.0),
    "envelope 10 mm": straight(10.0),
    "envelope 20 mm": straight(20.0),
    "hull": to_hull,
    "graded": graded,
    "geodesic": geodesic,
}


def phantom_scores(measure: Callable[[TriangleMesh], Floats]) -> dict[str, float]:
    base, squares, areas, jumps = ellipsoid(), [], [], []
    clock = time.perf_counter()
    for widths, bottom in ((OPEN_MM, None), (CLOSING_MM, BOTTOM_MM)):
        deepest = []
        for width in widths:
            mesh = with_fissure(width, bottom)
            true, found = to(base, mesh), measure(mesh)
            squares.append((found - true) ** 2)
            areas.append(vertex_areas(mesh))
            deepest.append(found[true.argmax()])
        jumps.append(np.abs(np.diff(deepest)).max())
    bent = banana()
    false = float(np.average(measure(bent), weights=vertex_areas(bent)))
    seconds = time.perf_counter() - clock
    error = np.sqrt(np.average(np.concatenate(squares), weights=np.concatenate(areas)))
    return {
        "error_percent": round(100 * float(error) / DEPTH_MM, 1),
        "jump_open_percent": round(100 * float(jumps[0]) / DEPTH_MM, 1),
        "jump_closing_percent": round(100 * float(jumps[1]) / DEPTH_MM, 1),
        "smooth_mm": round(false, 2),
        "seconds": round(seconds, 1),
    }


def mean_depths(measure: Callable[[TriangleMesh], Floats], surfaces: list[str]) -> list[float]:
    means = []
    for path in surfaces:
        mesh = read_surface(path)
        # the caps' centres come last and have no part in the mean
        depth = measure(cap(mesh))[: len(mesh.vertices)]
        means.append(round(float(np.average(depth, weights=vertex_areas(mesh))), 2))
    return means


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--surfaces", nargs="*", default=[], help="real hemispheres in mm, by age")
    options = parser.parse_args()
    result: dict[str, dict] = {}
    for name, measure in MEASURES.items():
        result[name] = phantom_scores(measure)
        if options.surfaces:
            result[name]["mean_depths_mm"] = mean_depths(measure, options.surfaces)
        print(name, result[name], flush=True)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
