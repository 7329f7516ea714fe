"""Verify the folding solver on cases with known answers; makes the numbers of
docs/verification.md.

    ./run python benchmarks/verification.py --figures docs/images

The solver runs on two MPI ranks; part `ranks` compares one, two and three. Each part
prints its results; the last line is one JSON object with all of them.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

ORDERS = {1: "linear", 2: "quadratic"}
MANUFACTURED_CELLS = {1: (6, 12, 24), 2: (3, 6, 12)}
"""Cells along a side by element order: both orders have the same number of unknowns."""
ELEMENTS = {1: (2, 4, 8), 2: (1, 2, 4)}
"""Cells per cortical thickness by element order; their error and cost are compared."""
POISSON_RATIOS = (0.45, 0.48, 0.49, 0.499)
CONTRASTS = (5.0, 20.0, 50.0)
SLAB_CELLS = (2, 4, 8, 16)
"""Cells per cortical thickness."""
RATE_GROWTH = 1e-3
"""Growth of the step that gives the rates."""
MEMORY_CONTRAST, MEMORY_GROWTH, MEMORY_STEPS = 20.0, 0.004, 12
MEMORIES = (0.0, 0.05, np.inf)
TWO_WEEKS = 2e-7 * 2 * 604_800
"""Growth of the reference model in two weeks."""
STEPS_IN_TWO_WEEKS = {"2 days": 7, "1 day": 14, "half a day": 28, "a quarter": 56}
DEEP_CELLS: dict[int, tuple[float, ...]] = {1: (2, 3, 4, 6), 2: (1, 1.25, 1.5, 2)}
"""Cells per cortical thickness by element order."""
DEEP_GROWTH = (0.04, 0.02)
"""Growth of a step."""
DEEP_AREA_RATIOS = (1.6, 2.0)
DEEP_MEMORIES_GW = (0.0, 1.0)
CONTACT_DISTANCES = ((0.05, 0.1), (0.1, 0.2), (0.2, 0.4), (0.4, 0.8))
"""Contact distance as a multiple of the mean edge, at most of a short edge."""
CONTACT_CELLS: dict[int, tuple[float, ...]] = {1: (2, 3, 4), 2: (1, 1.5, 2)}
MAPS = {
    "box of 30 mm": (30.0, 37.7, (10, 16, 24)),
    "folds of 10 mm": (20.0, 10.0, (10, 16, 20, 24, 30)),
}
"""Side of a box and mean length of its waves in mm, and numbers of intervals between
nodes along a side."""
RANKS = (1, 2, 3)
SERIAL = ("theory", "elements", "deep", "contact_distance", "maps")
"""Parts that run on one rank."""
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def consistency() -> dict:
    from verification_cases.consistency import patch_residual, slopes_of_remainders

    return {
        name: {
            "patch_residual": patch_residual(order=order),
            "slopes": slopes_of_remainders(order=order),
        }
        for order, name in ORDERS.items()
    }


def manufactured() -> dict:
    from verification_cases.manufactured import CASES, rates, solved

    found: dict = {name: {} for name in ORDERS.values()}
    for order, name in ORDERS.items():
        for case in CASES:
            errors = [
                solved(case, cells, order=order) for cells in MANUFACTURED_CELLS[order]
            ]
            found[name][case] = {
                "displacement_errors": [error.displacement for error in errors],
                "gradient_errors": [error.gradient for error in errors],
                "orders": rates(errors),
            }
    return found


def elements() -> list[dict]:
    """Measure error and cost of the fastest wave by element, mesh and Poisson's ratio,
    at the reference contrast."""
    from verification_cases.slab import Waved, fastest_wave

    found = []
    for order, counts in ELEMENTS.items():
        for cells in counts:
            # nearly incompressible tissue on the coarsest meshes only
            for poisson_ratio in POISSON_RATIOS[: 4 if cells == counts[0] else 2]:
                case = Waved(
                    CONTRASTS[0],
                    RATE_GROWTH,
                    1,
                    poisson_ratio=poisson_ratio,
                    order=order,
                )
                found.append(fastest_wave(case, cells))
    return found


def symmetry() -> dict:
    from verification_cases.mirrored import block, folded, hemisphere, rounded

    runs = {
        "forgotten": (hemisphere(8), {}),
        "remembered": (hemisphere(8), {"stress_memory_gw": 1.0}),
        "forgotten_with_ties": (block(6), {}),
        "quadratic_remembered": (rounded(hemisphere(4)), {"stress_memory_gw": 1.0}),
    }
    return {
        name: asdict(folded(half, 6, **changes)[1])
        for name, (half, changes) in runs.items()
    }


def ranks() -> dict:
    """Return the displacement of all vertices (m) after four steps, with tight
    tolerances and with those of a run."""
    from verification_cases.mirrored import (
        folded,
        hemisphere,
        reflected_and_merged,
        rounded,
    )

    linear, quadratic = hemisphere(8), rounded(hemisphere(4))
    runs = {
        "tight": (linear, {}),
        "usual": (linear, {"newton_tolerance": 1e-4}),
        "quadratic_tight": (quadratic, {}),
        "quadratic_usual": (quadratic, {"newton_tolerance": 1e-4}),
    }
    return {
        name: folded(half, 4, stress_memory_gw=1.0, **changes)[0].positions
        - 1e-3 * reflected_and_merged(half).vertices
        for name, (half, changes) in runs.items()
    }


def theory() -> dict:
    """Compare the linearised theory with limits known in closed form, and measure the
    effect of longer steps."""
    from scipy.optimize import minimize_scalar
    from verification_cases.closed_forms import BIOT_STRETCH, short_wave_rate, thin_film
    from verification_cases.modes import (
        Slab,
        amplifications,
        critical_growth,
        growth_rates,
    )

    cortex = Slab(1.0, depth=8.0, thickness=np.inf)
    rates = growth_rates(cortex, 2 * np.pi / np.array([0.5, 1.0, 2.0]))
    found: dict = {"cortex_alone": {"known": short_wave_rate(0.45), "found": rates}}
    for contrast in (1e2, 1e3, 1e4):
        slab = Slab(contrast, depth=40 * (contrast / 3) ** (1 / 3))
        film = thin_film(slab)
        start = [0.8 * film.wavelength, 1.2 * film.wavelength]
        best = minimize_scalar(
            lambda length, slab=slab: (
                -growth_rates(slab, np.array([2 * np.pi / length]))[0]
            ),
            start,
        )
        found[f"thin_film_{contrast:g}"] = {
            "known_wavelength": film.wavelength,
            "found_wavelength": best.x,
            "known_rate": film.growth_rate,
            "found_rate": -best.fun,
        }
    film, slab = thin_film(Slab(1e3)), Slab(1e3, depth=200.0, memory=np.inf)
    critical = critical_growth(
        slab, 2 * np.pi / np.array([film.wavelength]), film.critical_growth / 100, 1.0
    )
    found["critical_growth_1000"] = {
        "known": film.critical_growth,
        "found": critical[0],
    }
    half_space = Slab(
        1.0, 0.4999, depth=6.0, memory=np.inf, thickness=np.inf, finest=0.04
    )
    critical = critical_growth(half_space, 2 * np.pi / np.array([1.0]), 0.002, 1.0)
    found["half_space_stretch"] = {
        "known": BIOT_STRETCH,
        "found": 1 / (1 + critical[0]),
    }

    def log_height(steps: int) -> float:
        waves = np.array([2 * np.pi / 7.07])
        slab = Slab(CONTRASTS[0])
        heights = amplifications(slab, waves, TWO_WEEKS / steps, steps)
        return float(np.log(heights[-1, 0]))

    exact = 2 * log_height(448) - log_height(224)
    found["steps"] = {
        name: log_height(steps) / exact - 1
        for name, steps in STEPS_IN_TWO_WEEKS.items()
    }
    return found


def rates() -> dict:
    found = {}
    for contrast in CONTRASTS:
        lengths, *heights = waves_on_slab(SLAB_CELLS, contrast, RATE_GROWTH, 1)
        expected, *simulated = (np.log(height[1]) / RATE_GROWTH for height in heights)
        found[f"{contrast:g}"] = {
            "lengths": lengths,
            "expected": expected,
            "measured": simulated,
        }
    return found


def memory() -> dict:
    found = {}
    for tau in MEMORIES:
        cells = SLAB_CELLS if np.isinf(tau) else SLAB_CELLS[2:3]
        lengths, expected, *simulated = waves_on_slab(
            cells, MEMORY_CONTRAST, MEMORY_GROWTH, MEMORY_STEPS, tau
        )
        found[f"{tau:g}"] = {
            "lengths": lengths,
            "expected": expected,
            "measured": simulated,
        }
    return found


def waves_on_slab(counts: tuple[int, ...], *case: float) -> list[np.ndarray]:
    """Return wavelengths in mm, and relative heights after each step by theory and by
    meshes of these cells."""
    from verification_cases.slab import Waved, amplified

    waved = Waved(*case)
    return [
        waved.lengths_mm,
        waved.expected(),
        *(amplified(waved, cells) for cells in counts),
    ]


def deep() -> list[dict]:
    """Fold a slab until its banks press on each other: growth, depth and pressure at
    area ratios, and crossings."""
    return deep_folds(DEEP_CELLS)


def deep_folds(cells_of_order: dict[int, tuple[float, ...]]) -> list[dict]:
    """Fold slabs of some meshes with each step and memory of stress."""
    found = []
    for memory_gw in DEEP_MEMORIES_GW:
        for order, counts in cells_of_order.items():
            for growth in DEEP_GROWTH:
                found += [
                    deep_fold(cells, order, growth, memory_gw) for cells in counts
                ]
    return found


def deep_fold(
    cells: float, order: int, growth_of_step: float, memory_gw: float
) -> dict:
    """Return what a slab has at each area ratio, and the CPU seconds of its run."""
    from verification_cases.deep_folds import Slab, at_ratio, folded

    slab = Slab(cells, order, growth_of_step, memory_gw=memory_gw)
    began = time.process_time()
    folds = folded(slab, max(DEEP_AREA_RATIOS))
    row = {
        "order": slab.order,
        "cells": slab.cells,
        "growth_of_step": slab.growth,
        "memory_gw": slab.memory_gw,
        "steps": len(folds),
        "crossing": sum(fold.crossing for fold in folds),
        "cpu_s": time.process_time() - began,
    }
    for area_ratio in DEEP_AREA_RATIOS:
        growth, depth_mm, pressure_pa = at_ratio(folds, area_ratio)
        row[f"at_{area_ratio:g}"] = {
            "growth": growth,
            "depth_mm": depth_mm,
            "pressure_pa": pressure_pa,
        }
    return row


def contact_distance() -> list[dict]:
    """Fold slabs with other contact distances than the default: it is to be so small
    that it does not matter."""
    from gyriflow.folding import contact

    found = []
    for per_mean_edge, per_short_edge in CONTACT_DISTANCES:
        contact.DISTANCE_PER_MEAN_EDGE = per_mean_edge
        contact.DISTANCE_PER_SHORT_EDGE = per_short_edge
        distances = {"per_mean_edge": per_mean_edge, "per_short_edge": per_short_edge}
        found += [distances | row for row in deep_folds(CONTACT_CELLS)]
    return found


def maps() -> dict:
    """Compare maps of growth towards shapes, on meshes of both orders, with the growth
    of the continuous shape."""
    from verification_cases.growth_maps import WavyBox, errors_of_map

    found: dict = {}
    for name, (side_mm, wave_mm, counts) in MAPS.items():
        for order, elements in ORDERS.items():
            boxes = [WavyBox(side_mm, wave_mm, nodes, order) for nodes in counts]
            found[f"{name}, {elements}"] = [errors_of_map(box) for box in boxes]
    return found


PARTS = {
    part.__name__: part
    for part in (
        consistency,
        manufactured,
        elements,
        symmetry,
        ranks,
        theory,
        rates,
        memory,
        deep,
        contact_distance,
        maps,
    )
}


def run(part: str, ranks: int) -> dict:
    """Run a part as a separate MPI program and return its results."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "found.json"
        program = [sys.executable, __file__, "--inside-mpi", part, "--into", str(file)]
        command = ["mpiexec", "-n", str(ranks), *program]
        done = subprocess.run(
            command,
            env=os.environ | ONE_THREAD,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise SystemExit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
        return json.loads(file.read_text())


def inside_mpi(part: str, into: Path) -> None:
    from mpi4py import MPI
    from verification_cases.summary import plain

    found = PARTS[part]()
    if MPI.COMM_WORLD.rank == 0:
        into.write_text(json.dumps(plain(found, digits=16)))


def differences_between_ranks() -> dict:
    """Return the largest difference of a vertex between two numbers of ranks, over the
    largest displacement."""
    runs = [run("ranks", count) for count in RANKS]
    found = {}
    for name in runs[0]:
        serial, *parallel = (np.array(result[name]) for result in runs)
        largest = np.linalg.norm(serial, axis=1).max()
        found[name] = [
            float(np.linalg.norm(moved - serial, axis=1).max() / largest)
            for moved in parallel
        ]
    return found


def main(only: list[str], figures: Path | None) -> None:
    from verification_cases.summary import draw, memory_of, plain, rates_of

    found: dict = {}
    for part in only:
        found[part] = (
            differences_between_ranks()
            if part == "ranks"
            else run(part, 1 if part in SERIAL else 2)
        )
        print(json.dumps(plain({part: found[part]})), flush=True)
    if figures and "rates" in found:
        figures.mkdir(parents=True, exist_ok=True)
        draw(found["rates"], SLAB_CELLS, figures)
    if "rates" in found:
        found["rates"] = {
            contrast: rates_of(float(contrast), case)
            for contrast, case in found["rates"].items()
        }
    if "memory" in found:
        found["memory"] = {
            tau: memory_of(case) for tau, case in found["memory"].items()
        }
    print(json.dumps(plain(found)), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figures", type=Path, help="folder for the picture (PNG)")
    parser.add_argument(
        "--only",
        nargs="+",
        choices=PARTS,
        default=list(PARTS),
        help="parts to run instead of all",
    )
    parser.add_argument("--inside-mpi", choices=PARTS, help=argparse.SUPPRESS)
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inside_mpi:
        inside_mpi(arguments.inside_mpi, arguments.into)
    else:
        main(arguments.only, arguments.figures)
