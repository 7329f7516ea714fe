"""Errors of curvature on surfaces where it is known, at three densities, clean and noisy, beside other estimators.

    ./run python benchmarks/curvature.py --docs docs/metrics.md --surface results/brains/week29/surface/pial.surf.gii

The tables are printed; `--docs` puts them between the markers of that page. `--surface` adds a table of a closed real
surface remeshed at several densities. The last line is one JSON object.
"""

import argparse
import json
import time
from pathlib import Path

import igl
import numpy as np
from curvature_estimators import ESTIMATORS, gyriflow
from curved_surfaces import Ellipsoid, Folded, Torus, meshed, noisy

from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import Floats, TriangleMesh, mean_edge_length, vertex_areas
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.curvature import Curvature, curvature
from gyriflow.parameters.metrics import CURVATURE_RADIUS_MM

SURFACES = {
    "sphere": Ellipsoid((20.0, 20.0, 20.0)),
    "torus": Torus(18.0, 7.0),
    "ellipsoid": Ellipsoid((30.0, 22.0, 16.0)),
    "folded": Folded(20.0, 1.0, 10.0),
}
EDGES_MM = (0.5, 0.8, 1.2)
NOISE_MM = 0.05
REAL_EDGES_MM = (0.6, 1.0, 1.5)
RADII_MM = (2.0, 2.5, 3.0, 4.0)
MARKERS = ("<!-- benchmarks/curvature.py: begin -->", "<!-- benchmarks/curvature.py: end -->")


def relative_rms(found: Floats, expected: Floats) -> float:
    """Returns the root mean square of the difference in per cent of that of the expected values."""
    return float(100.0 * np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2)))


def moved(mesh: TriangleMesh, values: Floats, onto: TriangleMesh) -> Floats:
    """Returns (k, n) values at the vertices of a mesh, interpolated to the vertices of another on the same surface."""
    _, faces, feet = igl.point_mesh_squared_distance(onto.vertices, mesh.vertices, mesh.faces)
    corners = mesh.faces[faces]
    shares = igl.barycentric_coordinates(feet, *(np.ascontiguousarray(mesh.vertices[corners[:, k]]) for k in range(3)))
    return np.einsum("knc,nc->kn", values[:, corners], shares)


def row(name: str, values: list[float]) -> str:
    return f"| {name} | " + " | ".join(f"{value:.3g}" if value < 1000 else "> 1000" for value in values) + " |"


def heading(first: str, columns: list[str]) -> list[str]:
    return [f"| {first} | " + " | ".join(columns) + " |", "| --- |" + " ---: |" * len(columns)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--docs", type=Path, help="a page whose tables are renewed")
    parser.add_argument("--surface", type=Path, help="a closed surface that is remeshed at several densities")
    arguments = parser.parse_args()
    page = arguments.docs
    meshes = {name: {edge: meshed(surface, edge) for edge in EDGES_MM} for name, surface in SURFACES.items()}
    exact = {
        name: {edge: np.stack(SURFACES[name].curvature(mesh.vertices)) for edge, mesh in of_name.items()}
        for name, of_name in meshes.items()
    }
    errors, lines = error_tables(meshes, exact)
    spreads, more = density_table(meshes)
    lines += more + radius_table(meshes["folded"], exact["folded"]) + quantity_table(meshes, exact)
    if arguments.surface:
        lines += real_table(read_surface(arguments.surface))
    text = "\n".join([*lines, ""])
    print(text)
    if page:
        before, _, rest = page.read_text().partition(MARKERS[0])
        _, _, after = rest.partition(MARKERS[1])
        page.write_text(f"{before}{MARKERS[0]}\n{text}\n{MARKERS[1]}{after}")
    print(
        json.dumps(
            {
                "radius_mm": CURVATURE_RADIUS_MM,
                "noise_mm": NOISE_MM,
                "edges_mm": EDGES_MM,
                "clean_error_percent": errors["clean"],
                "noisy_error_percent": errors["noisy"],
                "difference_between_densities_percent": spreads,
                "cpu_seconds_per_40000_vertices": {edge: seconds(meshes["folded"][edge]) for edge in EDGES_MM},
            }
        )
    )


def seconds(mesh: TriangleMesh) -> float:
    """Returns the CPU time of curvature per 40 000 vertices of a mesh."""
    began = time.process_time()
    curvature(mesh)
    return round((time.process_time() - began) * 40000 / len(mesh.vertices), 2)


def error_tables(meshes: dict, exact: dict) -> tuple[dict, list[str]]:
    """Returns gyriflow's errors of κ1 and κ2 per surface, and the lines of a table per surface."""
    lines: list[str] = []
    errors: dict = {"clean": {}, "noisy": {}}
    for name, of_name in meshes.items():
        scale = np.sqrt(np.mean(exact[name][EDGES_MM[0]] ** 2))
        lines += [
            "",
            f"### Errors: {name}",
            "",
            f"RMS of κ₁ and κ₂: {scale:.3g} / mm. RMS errors in per cent of it.",
            "",
        ]
        lines += heading("", [f"{kind}, {edge:g} mm" for kind in ("clean", "noise") for edge in EDGES_MM])
        for estimator, function in ESTIMATORS.items():
            values = []
            for deviation in (0.0, NOISE_MM):
                for edge, mesh in of_name.items():
                    shown = noisy(mesh, deviation, seed=1) if deviation else mesh
                    values.append(relative_rms(np.stack(function(shown)), exact[name][edge]))
            lines.append(row(estimator, values))
            if function is gyriflow:
                errors["clean"][name] = [round(value, 2) for value in values[: len(EDGES_MM)]]
                errors["noisy"][name] = [round(value, 2) for value in values[len(EDGES_MM) :]]
    return errors, lines


def density_table(meshes: dict) -> tuple[dict, list[str]]:
    """Returns gyriflow's largest difference of κ1 and κ2 between densities, and the lines of the table."""
    lines = [
        *("", "### The same surface at other densities", ""),
        f"RMS difference of κ₁ and κ₂ to those on the mesh of {EDGES_MM[0]:g} mm, in per cent of their RMS; no noise.",
        "",
        *heading("", [f"{name}, {edge:g} mm" for name in meshes for edge in EDGES_MM[1:]]),
    ]
    spreads = {}
    for estimator, function in list(ESTIMATORS.items())[:5]:
        values = []
        for of_name in meshes.values():
            found = {edge: np.stack(function(mesh)) for edge, mesh in of_name.items()}
            dense = of_name[EDGES_MM[0]]
            for edge in EDGES_MM[1:]:
                values.append(relative_rms(found[edge], moved(dense, found[EDGES_MM[0]], of_name[edge])))
        lines.append(row(estimator, values))
        if function is gyriflow:
            spreads = dict(
                zip(meshes, [round(max(values[i : i + 2]), 2) for i in range(0, len(values), 2)], strict=True)
            )
    return spreads, lines


def radius_table(meshes: dict, exact: dict) -> list[str]:
    """Returns the lines of a table of errors on the folded surface against the radius."""
    lines = ["", "### Choice of the radius", "", "gyriflow on the folded surface, errors as above.", ""]
    lines += heading("radius", [f"{kind}, {edge:g} mm" for kind in ("clean", "noise") for edge in EDGES_MM])
    for radius in RADII_MM:
        values = []
        for deviation in (0.0, NOISE_MM):
            for edge, mesh in meshes.items():
                found = curvature(noisy(mesh, deviation, seed=1) if deviation else mesh, radius_mm=radius)
                values.append(relative_rms(np.stack([found.maximum, found.minimum]), exact[edge]))
        lines.append(row(f"{radius:g} mm", values))
    return lines


def quantity_table(meshes: dict, exact: dict) -> list[str]:
    """Returns the lines of a table of RMS errors of gyriflow's maps at the middle density."""
    edge = EDGES_MM[1]
    lines = [
        *("", "### Errors of each map", ""),
        f"gyriflow at edges of {edge:g} mm: RMS errors, of the shape index as it is, of the others in per cent.",
        "",
        *heading("", ["mean", "Gaussian", "curvedness", "shape index"]),
    ]
    for name, of_name in meshes.items():
        mesh = of_name[edge]
        known = np.ones(len(mesh.vertices), dtype=bool)
        right = Curvature(*exact[name][edge], reliable=known, radius_mm=np.zeros(len(known)))
        for label, deviation in (("", 0.0), (", noise", NOISE_MM)):
            found = curvature(noisy(mesh, deviation, seed=1) if deviation else mesh)
            values = [relative_rms(getattr(found, q), getattr(right, q)) for q in ("mean", "gaussian", "curvedness")]
            shape_error = float(np.sqrt(np.mean((found.shape_index - right.shape_index) ** 2)))
            lines.append(row(name + label, [*values, shape_error]))
    return lines


def real_table(surface: TriangleMesh) -> list[str]:
    """Returns the lines of a table of metrics of a closed surface as it is and remeshed."""
    lines = [
        "",
        "### A real brain at other densities",
        "",
        "The same surface remeshed; means are weighted by area.",
        "",
    ]
    lines += heading("mean edge", ["vertices", "shape index", "curvedness (1/mm)", "sulcal share"])
    for mesh in (surface, *(remesh(surface, edge) for edge in REAL_EDGES_MM)):
        found, weights = curvature(mesh), vertex_areas(mesh)
        means = [np.average(values, weights=weights) for values in (found.shape_index, found.curvedness)]
        values = [*means, np.average(found.shape_index < 0, weights=weights)]
        cells = " | ".join(f"{value:.4g}" for value in values)
        lines.append(f"| {mean_edge_length(mesh):.2f} mm | {len(mesh.vertices)} | {cells} |")
    return lines


if __name__ == "__main__":
    main()
