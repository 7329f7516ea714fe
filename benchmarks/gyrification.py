"""Measure gyrification indices of half spheres whose cuts lie in pits or on necks, and of surfaces.

    ./run python benchmarks/gyrification.py results/brains/*/surface/*.pial.surf.gii

Printed are the index by hulls, that by envelopes, and `true`, the index by hulls of the half sphere, or of a surface
that of the body closed by the smallest area that its cut may have, over its whole hull: it is known without a decision
about what lies over the cut, and a little too small. The last line is one JSON object.
"""

import argparse
import json
from pathlib import Path

import igl
import numpy as np
import trimesh

from gyriflow.geometry.triangles import TriangleMesh, area, convex_hull
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.gyrification import envelope, gyrification_index, pieces_over

RADIUS, CUT = 25.0, 8.0
PITS_MM = (0.0, 1.0, 3.0, 6.0, -1.0, -3.0, -6.0)


def half_sphere(pit_mm: float) -> tuple[TriangleMesh, float]:
    """Return half a sphere, open at a round cut in a pit so deep or on a neck so high, and its index."""
    down = np.linspace(0.0, 0.5 * np.pi, 40)
    flat, wall = np.linspace(RADIUS, CUT, 25)[1:], np.linspace(0.0, pit_mm, 5)[1:] if pit_mm else np.zeros(0)
    profile = np.concatenate(
        [
            RADIUS * np.column_stack([np.sin(down), np.cos(down)]),
            np.column_stack([flat, 0 * flat]),
            np.column_stack([np.full(len(wall), CUT), wall]),
        ]
    )
    shape = trimesh.creation.revolve(profile, sections=160)
    mesh = TriangleMesh(shape.vertices, shape.faces)
    dome, ring, tube = 2 * RADIUS**2, RADIUS**2 - CUT**2, 2 * CUT * abs(pit_mm)
    bridge = (RADIUS + CUT) * np.hypot(RADIUS - CUT, min(pit_mm, 0.0))
    return mesh, (dome + ring + tube) / (dome + bridge)


def closed_index(mesh: TriangleMesh) -> float:
    """Return the index of a surface that is closed by the smallest area that its cut may have."""
    rim = mesh.vertices[np.asarray(igl.boundary_loop(mesh.faces))]
    cut = 0.5 * np.linalg.norm(np.cross(rim, np.roll(rim, -1, axis=0)).sum(axis=0))
    return float((area(mesh) + cut) / area(convex_hull(mesh)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("surfaces", type=Path, nargs="*", help="open surfaces of hemispheres")
    options = parser.parse_args()
    bodies = {f"pit of {pit:g} mm": half_sphere(pit) for pit in PITS_MM}
    for path in options.surfaces:
        mesh = read_surface(path)
        bodies[str(path)] = mesh, closed_index(mesh)
    result = {}
    for name, (mesh, true) in bodies.items():
        around = {"hull": convex_hull(mesh), "envelope": envelope(mesh)}
        found = {key: gyrification_index([mesh], [pieces_over(surface, mesh)]) for key, surface in around.items()}
        result[name] = {key: round(value, 4) for key, value in (found | {"true": float(true)}).items()}
        print(name, result[name], flush=True)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
