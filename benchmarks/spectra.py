"""Print spectra of folds of one wavelength for both proxies, and the share of its
curvature that a wave keeps.

    ./run python benchmarks/spectra.py [--surface NAME.surf.gii ...] \\
        [--per-wavelength 8 6 5 4.5] [--evenness 0.1 0.001] [--last B5]

The folds are radial waves of degree 8 on a sphere of 25 mm radius: 18.5 mm long, in the
middle of B3; the power in B4 is of harmonics. `isotropic` waves run in all directions,
`parallel` folds from pole to pole. The shallow waves of the second table are on a
plane; `closed form` is `gyriflow.metrics.curvature.kept_curvature`.

With surfaces, these are compared instead: spectra of a hemisphere on copies with fewer
vertices and triangles of another evenness (`remeshing.EVENNESS`), against those on all
of its own vertices, which should have at least ten for the shortest wave. Of both
proxies, the errors of the powers of B1 to the last band and the share of the area with
the same dominant band; and, against the consistent mass matrix, the numbers of modes.
"""

import argparse
import time
from itertools import product
from pathlib import Path
from unittest.mock import patch

import numpy as np
from scipy.spatial import Delaunay
from scipy.special import sph_harm_y
from trimesh.creation import icosphere

from gyriflow.geometry import remeshing
from gyriflow.geometry.triangles import TriangleMesh, vertex_areas
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics import spangy
from gyriflow.metrics.curvature import curvature, kept_curvature
from gyriflow.metrics.measure import hemisphere_spectra
from gyriflow.settings.terms import PROXIES

DEGREE, RADIUS_MM, FITTED_MM = 8, 25.0, 2.6
MODES = 23**2
"""All modes up to degree 22: B3 has the degrees 6 to 10, B4 11 to 22."""


def folded_sphere(kind: str, rms_mm: float) -> TriangleMesh:
    """Return a sphere with radial waves of one degree."""
    ball = icosphere(subdivisions=5)
    x, y, z = np.asarray(ball.vertices).T
    orders = range(DEGREE + 1) if kind == "isotropic" else [DEGREE]
    weights = np.random.default_rng(1).standard_normal((len(orders), 2)) @ [1, 1j]
    waves = sum(
        w * sph_harm_y(DEGREE, m, np.arccos(z), np.arctan2(y, x))
        for w, m in zip(weights, orders, strict=True)
    )
    height = np.real(waves)
    height *= rms_mm / np.sqrt(
        np.average(
            height**2, weights=vertex_areas(TriangleMesh(ball.vertices, ball.faces))
        )
    )
    return TriangleMesh((RADIUS_MM + height)[:, None] * ball.vertices, ball.faces)


def kept_share(wavelength_radii: float, edges_per_radius: float) -> tuple[float, float]:
    """Return the share of its curvature that a shallow wave keeps on a plane, and the
    radius of the fit."""
    edge, wavelength = 1.0 / edges_per_radius, wavelength_radii
    size = int(max(4 * wavelength, 8.0) / edge)
    i, j = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    points = edge * np.stack([i + 0.5 * (j % 2), 0.866 * j], axis=-1).reshape(-1, 2)
    points += np.random.default_rng(1).normal(0.0, 0.12 * edge, points.shape)
    wave = np.cos(2 * np.pi / wavelength * points[:, 0])
    faces = Delaunay(points).simplices
    found = curvature(
        TriangleMesh(np.column_stack([points, 0.01 * wavelength * wave]), faces),
        radius_mm=1.0,
    )
    true = 0.5 * 0.01 * wavelength * (2 * np.pi / wavelength) ** 2 * wave
    inside = found.reliable
    return float(found.mean[inside] @ true[inside] / np.sum(true[inside] ** 2)), float(
        found.radius_mm.mean()
    )


def compare_copies(
    path: Path, per_wavelength: list[float], evenness: list[float], last: str
) -> None:
    """Print a row for the surface as it is, with both mass matrices, and for each
    copy."""
    mesh = read_surface(path)
    bend, areas = curvature(mesh), vertex_areas(mesh)
    reference: dict = {}

    def row(name: str, mass: str = "mean", **settings: float) -> None:
        start = time.process_time()
        with patch.multiple(spangy, **({"WORTHWHILE": 0.0} | settings)):
            basis = spangy.spectral_basis(mesh, last, mass)
            found = [
                spangy.spectrum(values, basis, radius_mm=float(bend.radius_mm.mean()))
                for values in (bend.mean, bend.shape_index)
            ]
        seconds, cells = time.process_time() - start, []
        for proxy, part in zip(PROXIES, found, strict=True):
            exact = reference.setdefault(proxy, part)
            errors = (
                100
                * (part.bands["power"] / exact.bands["power"] - 1)[1 : int(last[1]) + 1]
            )
            same = 100 * np.average(
                part.dominant_band == exact.dominant_band, weights=areas
            )
            cells += [" ".join(f"{error:+.1f}" for error in errors), f"{same:.1f} %"]
        modes = " ".join(map(str, found[0].bands["modes"][1 : int(last[1]) + 1]))
        print(
            f"| {name} | {basis.places.shape[1]} | {seconds:.1f} | {modes} |"
            f" {' | '.join(cells)} |",
            flush=True,
        )

    print(
        f"\n{path}\n\n"
        "| edges per wave; evenness | vertices | CPU s | modes |"
        " H, % | same | shape index, % | same |"
    )
    print("| --- | ---: | ---: | --- | --- | ---: | --- | ---: |")
    row("as it is")
    for edges, even in product(per_wavelength, evenness):
        with patch.object(remeshing, "EVENNESS", even):
            name = f"{edges:g}; {even:g}"
            row(name, VERTICES_PER_WAVELENGTH=edges, WORTHWHILE=np.inf)
    row("as it is, consistent", "consistent")


def print_waves() -> None:
    """Print the tables of waves of known length."""
    print(
        "| folds | rms, mm | proxy | B2 | B3 | B4 |\n"
        "| --- | --- | --- | --- | --- | --- |"
    )
    for kind in ("isotropic", "parallel"):
        for rms_mm in (0.4, 1.0):
            mesh = folded_sphere(kind, rms_mm)
            for proxy, found in hemisphere_spectra(
                mesh, curvature(mesh, radius_mm=FITTED_MM), MODES
            ).items():
                shares = " | ".join(
                    f"{100 * found.bands['relative_power'][band]:.1f} %"
                    for band in (2, 3, 4)
                )
                print(f"| {kind} | {rms_mm:g} | {proxy} | {shares} |", flush=True)
    print(
        "\n| wavelength / radius | edges / radius | kept | closed form |\n"
        "| --- | --- | --- | --- |"
    )
    for wavelength in (2.0, 3.0, 4.0, 6.0):
        for edges_per_radius in (2.0, 3.0, 4.0):
            share, radius = kept_share(wavelength, edges_per_radius)
            closed = float(kept_curvature(np.array(wavelength), radius))
            print(
                f"| {wavelength / radius:.2f} | {radius * edges_per_radius:.1f} |"
                f" {share:.2f} | {closed:.2f} |"
            )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--surface", type=Path, nargs="+", default=[], help="surfaces of hemispheres"
    )
    parser.add_argument(
        "--per-wavelength", type=float, nargs="+", default=[10.0, 8.0, 6.0, 5.0, 4.5]
    )
    parser.add_argument(
        "--evenness", type=float, nargs="+", default=[remeshing.EVENNESS, 0.001]
    )
    parser.add_argument("--last", choices=["B4", "B5", "B6"], default="B5")
    arguments = parser.parse_args()
    for path in arguments.surface:
        compare_copies(
            path, arguments.per_wavelength, arguments.evenness, arguments.last
        )
    if not arguments.surface:
        print_waves()


if __name__ == "__main__":
    main()
