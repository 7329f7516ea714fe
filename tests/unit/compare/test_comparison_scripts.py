"""What the script that compares a run with observed brains writes of several weeks."""

from types import SimpleNamespace

import numpy as np
import pytest
from scripts import run_script
from shapes import ellipsoid

from gyriflow.geometry.triangles import area
from gyriflow.io.files import read_table
from gyriflow.io.surfaces import write_surface, write_vertex_maps


def test_a_run_is_compared_with_the_observed_brain_of_each_week(tmp_path):
    """The run is the observed brain of each week; the start has the opposite folds, the
    brain before equal ones."""
    weeks = (22.0, 24.0)
    observed = [ellipsoid((20.0, 24.0, 22.0)), ellipsoid((26.0, 26.0, 26.0))]
    inputs = {
        name: ["22.0.gii", "24.0.gii"]
        for name in ("whole", "simulated", "observed", "start", "adjacent")
    }
    for name, sign in {"observed": 1, "start": -1, "adjacent": 1}.items():
        inputs[f"{name}_maps"] = [f"{name}-{week}.gii" for week in weeks]
        for week, surface in zip(weeks, observed, strict=True):
            write_surface(tmp_path / f"{week}.gii", surface)
            pattern = sign * np.random.default_rng(0).normal(size=len(surface.vertices))
            maps = {"mean_curvature": 0.1 * pattern, "shape_index": np.tanh(pattern)}
            write_vertex_maps(tmp_path / f"{name}-{week}.gii", maps)
    params = {
        "run": "thin",
        "kind": "explained",
        "start_week": 21.0,
        "curvature_radius_mm": 3.0,
    }
    params |= {"weeks": weeks, "observed": ["b22", "b24"]}
    job = {"params": params, "wildcards": SimpleNamespace(brain="b21")}
    run_script("validation.py", tmp_path, inputs, {"table": "validation.csv"}, **job)
    table = read_table(tmp_path / "validation.csv")
    assert table[
        ["run", "kind", "start", "observed", "week", "horizon"]
    ].to_numpy().tolist() == [
        ["thin", "explained", "b21", f"b{week:g}", week, week - 21] for week in weeks
    ]
    assert table["observed_area_cm2"].tolist() == pytest.approx(
        [area(surface) / 100 for surface in observed]
    )
    assert (
        table["distance_mm"].max() < 0.1,
        table["volume_difference"].abs().max() < 1e-6,
    ) == (True, True)
    assert table["r_start_shape_index"].tolist() == pytest.approx([-1, -1])
    assert table["r_adjacent_mean_curvature"].tolist() == pytest.approx([1, 1])
