"""A calibration recovers the growth rate of a simulated brain."""

import numpy as np
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
TRUTH = {"growth_rate_per_s": 2.3e-7}
BOUNDS = {"growth_rate_per_s": (1e-7, 4e-7)}


def folded(mesh, values, out):
    """Return the surface of a brain after half a week with some parameters."""
    parameters = parameters_from(calibrated_parameters(BASE, values, 21.5))
    run(
        MPI.COMM_SELF,
        mesh,
        zones_of_run(mesh, parameters),
        parameters,
        {},
        out,
        may_diverge=True,
    )
    positions = read_positions(out / "frames.h5", 21.5)
    return boundary_surface(TetrahedralMesh(positions, mesh.tets))[0]


def test_the_rate_of_a_simulated_brain_is_recovered(tmp_path):
    mesh = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
    real = folded(mesh, TRUTH, tmp_path / "truth")

    def scored(design):
        surfaces = [
            folded(mesh, values, tmp_path / f"run-{values['growth_rate_per_s']:.6g}")
            for values in design.to_dict("records")
        ]
        scores = [
            SURFACE_SCORES["size"][1](size_columns(surface, real))
            for surface in surfaces
        ]
        return design.assign(score=scores, run="", cause="")

    runs = scored(first_round(BOUNDS, 4, seed=0))
    for _ in range(3):
        runs = pd.concat(
            [runs, scored(next_round(runs, BOUNDS, 4, seed=0))], ignore_index=True
        )
    best = find_optimum(runs, BOUNDS).set_index("parameter")
    for name, truth in TRUTH.items():
        # the stated error: a fiftieth of the range
        assert best.loc[name, "value"] == pytest.approx(
            truth, abs=0.02 * np.ptp(BOUNDS[name])
        ), best.to_string()
