"""Measure how often 95 % intervals of r and gain hold, in random maps with a brain's
spectrum, on three sizes.

    ./run python benchmarks/intervals.py FOLDER

The surface is that of the shipped atlas' brain of 29 GW, scaled to each area; its
spectrum is that of its shape index by wavelength. Truth, run and start are random maps
with this spectrum, down to 7 mm, and noise that is finer; run and start have the same
correlation of 0.4 with the truth, so that the gain is 0. Maps of an `individual` have
two sides; those of a `symmetric` brain are their own mirror images. The last line is
one JSON object: for each area and kind of brain, the share of intervals that hold r and
gain, and of those that lie above a gain of 0.
"""

import argparse
from itertools import product
from pathlib import Path
from unittest.mock import patch

import numpy as np
from common import print_rows, run_workflow

from gyriflow.compare import placement
from gyriflow.compare.placement import (
    Resampling,
    make_resampling,
    mirror_image,
    with_interval,
)
from gyriflow.compare.shapes import PreparedSurface, prepare_for_comparison
from gyriflow.geometry.matching import match_surface, values_at
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import Floats, TriangleMesh, area_cm2, transformed
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.laplace_beltrami import Modes, laplacian, modes_below
from gyriflow.study.paths import PIAL

BRAIN = "spina-bifida-operated-29"
CONFIG = {"atlas": {"name": "spina-bifida", "series": "operated", "weeks": [29]}}
EDGE_MM, FINEST_MM = 1.5, 7.0
R = 0.4


def modes_of(mesh: TriangleMesh) -> tuple[Modes, Floats]:
    """Return the modes of a surface down to `FINEST_MM` but the constant one, and their
    (k,) wavelengths in mm."""
    modes = modes_below(*laplacian(mesh), (2 * np.pi / FINEST_MM) ** 2)
    values = modes.eigenvalues[1:]
    return Modes(values, modes.functions[:, 1:]), 2 * np.pi / np.sqrt(values)


def mean_spectrum(surface: PreparedSurface) -> tuple[Floats, Floats, float]:
    """Return wavelengths in mm, the power of the shape index per mode there, and the
    share of finer waves."""
    modes, wavelengths = modes_of(surface.mesh)
    values = surface.shape_index - np.average(
        surface.shape_index, weights=surface.areas
    )
    power = (modes.functions.T @ (surface.areas * values)) ** 2
    ends = np.geomspace(FINEST_MM, wavelengths.max() * 1.001, 16)
    number = np.digitize(wavelengths, ends)
    used = [place for place in range(1, len(ends)) if (number == place).any()]
    finer = 1 - power.sum() / (values @ (surface.areas * values))
    means = [
        np.array([column[number == place].mean() for place in used])
        for column in (wavelengths, power)
    ]
    return means[0], means[1], float(finer)


class RandomMaps:
    """Random maps over a surface with a brain's spectrum, and of those its mirror
    images if they are `symmetric`."""

    def __init__(
        self,
        surface: PreparedSurface,
        spectrum: tuple[Floats, Floats, float],
        *,
        symmetric: bool,
    ) -> None:
        lengths, power, self.finer = spectrum
        self.modes, wavelengths = modes_of(surface.mesh)
        self.scale = np.sqrt(np.interp(np.log(wavelengths), np.log(lengths), power))
        self.match = (
            match_surface(mirror_image(surface)[0], surface.mesh) if symmetric else None
        )
        self.areas, self.random = surface.areas, np.random.default_rng(1)

    def draw(self) -> Floats:
        """Return a map (n,) with mean square 1 over the area."""
        values = self.modes.functions @ (
            self.scale * self.random.normal(size=len(self.scale))
        )
        noise = self.random.normal(size=len(values))
        parts = [
            part / np.sqrt(np.average(part**2, weights=self.areas))
            for part in (values, noise)
        ]
        values = np.sqrt(1 - self.finer) * parts[0] + np.sqrt(self.finer) * parts[1]
        if self.match is not None:
            values = values + values_at(self.match, values)
        return values / np.sqrt(np.average(values**2, weights=self.areas))


def coverage(sampling: Resampling, maps: RandomMaps, count: int) -> dict[str, float]:
    """Return the shares of intervals that hold r and gain, and that lie above a gain of
    0."""
    found = []
    for _ in range(count):
        truth, *independent = (maps.draw() for _ in range(3))
        run, start = (
            sampling.correlations(truth, R * truth + np.sqrt(1 - R**2) * values)
            for values in independent
        )
        (_, low, high), (_, gain_low, gain_high) = (
            with_interval("", x).values() for x in (run, run - start)
        )
        found.append((low <= R <= high, gain_low <= 0 <= gain_high, gain_low > 0))
    shares = np.mean(found, axis=0).round(3)
    return dict(
        zip(("r_held", "gain_held", "gain_above_0"), map(float, shares), strict=True)
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--areas", type=float, nargs="+", default=[130.0, 220.0, 350.0], help="in cm²"
    )
    parser.add_argument("--maps", type=int, default=500)
    parser.add_argument("--cores", type=int, default=2)
    arguments = parser.parse_args()
    folder, file = arguments.folder.resolve(), PIAL["whole"].format(brain=BRAIN)
    run_workflow(folder, CONFIG, arguments.cores, file)
    brain = read_surface(folder / file)
    spectrum, rows = mean_spectrum(prepare_for_comparison(brain, brain)), []
    for area, kind in product(arguments.areas, ("individual", "symmetric")):
        scaled = transformed(
            brain, np.diag([np.sqrt(area / area_cm2(brain))] * 3 + [1.0])
        )
        mesh, symmetric = remesh(scaled, EDGE_MM), kind == "symmetric"
        surface = PreparedSurface(
            mesh, np.zeros(len(mesh.vertices)), np.zeros(len(mesh.vertices))
        )
        # the shipped brain is symmetric
        with patch.object(placement, "SYMMETRY_TOL_MM", np.inf if symmetric else 0.0):
            sampling = make_resampling(surface)
        maps = RandomMaps(surface, spectrum, symmetric=symmetric)
        rows.append(
            {"area_cm2": area, "brain": kind} | coverage(sampling, maps, arguments.maps)
        )
        print(rows[-1], flush=True)
    print_rows(rows, maps=arguments.maps, finer_share=spectrum[2])


if __name__ == "__main__":
    main()
