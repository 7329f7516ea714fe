"""A calibration recovers the growth rate of a simulated brain."""

import pandas as pd
import pytest
from mpi4py import MPI
from shapes import ellipsoid_mesh

from gyriflow.compare.calibration import (
    SURFACE_SCORES,
    calibrated_parameters,
    find_optimum,
    first_round,
    next_round,
)
from gyriflow.compare.comparison import size_columns
from gyriflow.folding.run import run
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.io.frames import read_positions
from gyriflow.settings.folding import parameters_from

pytestmark = pytest.mark.slow

BASE = {
    "start_week": 21.0,
    "end_week": 22.0,
    "output_weeks": [21.0, 22.0],
    "fissure_x_mm": 0.0,
    "thickness_mm": 3.0,
    "step_s": 151200.0,
    "contact": "planes",
}
# sizes alone do not tell the rate from the thickness: a thinner cortex that grows
# faster comes to the same
TRUTH_PER_S = 2.3e-7
BOUNDS = {"growth_rate_per_s": (1e-7, 4e-7)}


def folded(mesh, rate_per_s, out):
    """Return the surface of a brain after half a week of growth."""
    values = {"growth_rate_per_s": rate_per_s}
    parameters = parameters_from(calibrated_parameters(BASE, values, 21.5))
    zones = zones_of_run(mesh, parameters)
    run(MPI.COMM_SELF, mesh, zones, parameters, {}, out, may_diverge=True)
    positions = read_positions(out / "frames.h5", 21.5)
    return boundary_surface(TetrahedralMesh(positions, mesh.tets))[0]


def test_the_rate_of_a_simulated_brain_is_recovered(tmp_path):
    mesh = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
    real = folded(mesh, TRUTH_PER_S, tmp_path / "truth")

    def scored(design):
        scores = []
        for rate in design["growth_rate_per_s"]:
            surface = folded(mesh, rate, tmp_path / f"run-{rate:.6g}")
            score = SURFACE_SCORES["size"][1](size_columns(surface, real))
            scores.append(score)
        return design.assign(score=scores, run="", cause="")

    runs = scored(first_round(BOUNDS, 4, seed=0))
    for _ in range(3):
        design = next_round(runs, BOUNDS, 4, seed=0)
        runs = pd.concat([runs, scored(design)], ignore_index=True)
    best = find_optimum(runs, BOUNDS)
    # the stated error: a fiftieth of the range
    assert best["value"].item() == pytest.approx(TRUTH_PER_S, abs=0.02 * 3e-7)
