"""All numbers of comparisons of uneven brains, and of tests of predictions."""

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from shapes import FAR, rigid, smooth_field, uneven_surface

from gyriflow.compare import (
    accuracy,
    calibration,
    comparison,
    deviation,
    placement,
    shapes,
    sweeps,
)
from gyriflow.geometry.triangles import TriangleMesh, submesh, transformed

from .made_spectra import folded

BOUNDS = {"thickness_mm": (1.0, 3.0), "growth_rate_per_s": (1e-7, 5e-7)}


def body(scale=1.0, waves=1.0, subdivisions=3):
    """Return an uneven body, with waves of another height, that lies elsewhere."""
    mesh = uneven_surface(subdivisions)
    centre = mesh.vertices.mean(axis=0)
    offset = mesh.vertices - centre
    height = 1.0 + 0.02 * waves * np.sin(offset[:, [0]] / 2.0 + offset[:, [1]] / 3.0)
    # small, as comparisons remesh it to a millimetre
    points = centre + 0.4 * scale * height * offset
    return TriangleMesh(points, mesh.faces)


@pytest.fixture(scope="module")
def observed():
    """Return an observed brain with what was known before of it."""
    brain = comparison.observed_brain("b", body(), 2.0)
    baselines = {}
    for name, mesh in (("start", body(0.8, 0.2)), ("adjacent", body(0.95, 0.8))):
        prepared = shapes.prepare_for_comparison(mesh, brain.surface, 2.0)
        baselines[name], _ = shapes.interpolate_measures(prepared, brain.prepared)
    return replace(brain, baselines=baselines)


def test_numbers_of_a_comparison(recorded, observed):
    moved = transformed(body(1.05, 1.3), rigid(2.0, -1.0, 3.0, shift=(1.0, 2.0, -1.0)))
    columns, _ = comparison.compare(moved, observed, radius_mm=2.0)
    recorded(
        {
            "columns": columns,
            "aligned": comparison.aligned_distances(moved, observed.surface),
            "roughness": comparison.roughness_mm(moved),
            "scaled": shapes.scale_to_volume(moved, observed.surface),
        },
        rtol=5e-2,
        atol=5e-2,
    )


def test_numbers_of_resamplings(recorded, observed):
    found = placement.make_resampling(observed.prepared)
    truth = smooth_field(observed.prepared.mesh.vertices)
    values = truth + smooth_field(observed.prepared.mesh.vertices[::-1])
    areas = observed.prepared.areas
    draws = placement.draw_units([5, 9])
    recorded(
        {
            "asymmetry": found.asymmetry_mm,
            "correlations": found.correlations(truth, values),
            "correlation": placement.correlation(truth, values, areas),
            "patches": placement.number_patches(
                uneven_surface(2).vertices, np.linspace(1.0, 2.0, 162), 9.0
            ),
            "draws": draws,
            "gain": placement.gain_columns(
                0.6 + 0.1 * smooth_field(FAR[0][:3, :3]),
                0.4 + 0.2 * smooth_field(FAR[1][:3, :3]),
                0.8 - 0.1 * smooth_field(FAR[1][:3, :3]),
            ),
            "interval": placement.with_interval("r", np.linspace(0.1, 0.9, 41) ** 2),
            "interpolated": shapes.interpolate_measures(
                shapes.prepare_for_comparison(body(0.9, 0.5), observed.surface, 2.0),
                observed.prepared,
            ),
        },
        rtol=5e-2,
        atol=5e-2,
    )


def test_numbers_of_simple_predictions(recorded):
    start, target = body(0.8, 0.3), body()
    registered = {"series": body(0.97, 0.7), "atlas": body(1.1, 0.9)}
    found = comparison.simple_predictions(start, target, registered, body(0.9))
    brain = comparison.observed_brain("b22", body(1.02), 2.0)
    labels = {"run": "r", "kind": "predicted", "start": "a", "start_week": 21.0}
    table = comparison.comparison_table(
        labels, {22.0: found}, {22.0: brain}, radius_mm=2.0
    )
    sizes = {22.0: {"area_cm2": 62.0, "volume_ml": 30.0}}
    table = comparison.add_curves(table, sizes)
    recorded({"predictions": found, "table": table}, rtol=5e-2, atol=5e-2)


def trials_of_predictions():
    """Return tests of five starts over three horizons, of three models."""
    random = np.random.default_rng(4)
    rows = []
    for number, horizon, model in product(range(5), (2.0, 4.0, 7.0), ("run", "atlas")):
        row = {"start": "abcde"[number], "start_week": 22.0 + number, "model": model}
        row |= {"horizon": horizon, "protocol": "default"}
        row["r_shape_index"] = 0.9 - 0.03 * horizon - 0.1 * random.random()
        for size in ("area", "volume", "folding"):
            row[f"{size}_difference"] = 0.03 * horizon * random.normal() + 0.02
        rows.append(row)
    return rows


def metrics_of(weeks, factor):
    """Return metrics of a brain in some weeks."""
    rows = []
    for week, side, metric in product(weeks, ("whole", "left"), METRICS):
        row = {"week": week, "hemisphere": side, "metric": metric, "unit": "u"}
        rows.append(row | {"value": factor * METRICS[metric] * week})
    return pd.DataFrame(rows)


METRICS = {"area": 9.0, "gyrification_index": 0.06}


def test_numbers_of_errors_in_tests(recorded):
    tests = trials_of_predictions()
    weeks = (22.0, 24.0), (23.0, 27.0), (24.5, 27.5), (24.0, 33.0)
    members = [metrics_of((24.0, 26.0), factor) for factor in (0.95, 1.0, 1.07)]
    run, observed = metrics_of((24.0, 26.0, 29.0), 1.01), metrics_of((24.0, 26.0), 1.2)
    surfaces = [body(factor) for factor in (0.95, 1.0, 1.08)]
    values = [smooth_field(mesh.vertices) - 1.5 for mesh in surfaces]
    members = pd.concat(members)
    recorded(
        {
            "facts": [accuracy.prediction_facts(tests, *pair) for pair in weeks],
            "intervals": accuracy.interval_table(run, members, observed, tests),
            "maps": accuracy.ensemble_maps(surfaces[1], surfaces, values),
        },
        rtol=1e-3,
    )


def test_numbers_of_a_calibration(recorded, observed):
    design = calibration.first_round(BOUNDS, 6, seed=2)
    thickness, rate = design["thickness_mm"], design["growth_rate_per_s"]
    score = (thickness - 1.9) ** 2 + 1e12 * rate**2
    runs = design.assign(score=score, run=[f"r{n}" for n in range(6)], cause="")
    base = {"thickness_mm": 2.0, "start_week": 21.0, "shear_modulus_core_pa": 300.0}
    base["growth"] = {"area_cm2": {21.0: 90.0, 24.0: 150.0}}
    changes = {"thickness_mm": 1.5, "growth.area_cm2": 1.1}
    pairs = [(body(1.04, 0.2), observed), (body(0.9, -0.5), observed)]
    names = (*calibration.SURFACE_SCORES, "spectral_distance")
    weights = dict(zip(names, (2.0, 1.0, 0.5, 3.0, 9.0, 0.7), strict=True))
    spectra = [(folded(1.5), folded(2.1)), (folded(1.8), folded(2.0))]
    recorded(
        {
            "first": design,
            "optimum": calibration.find_optimum(runs, BOUNDS),
            "parameters": calibration.calibrated_parameters(base, changes, 23.0),
            "run": calibration.run_score(
                pairs, weights, [], radius_mm=2.0, spectra=spectra
            ),
            "diverged": calibration.run_score(
                pairs, weights, ["too large", "no step"], radius_mm=2.0
            ),
        },
        rtol=5e-2,
        atol=2e-3,
    )


def test_numbers_of_deviations(recorded):
    expected, fitted = body(), body(1.05, 1.4)
    maps = deviation.deviation_maps(expected, fitted)
    x = expected.vertices[expected.faces][:, :, 0].mean(axis=1)
    sides = {
        "left": submesh(expected, x < np.median(x))[0],
        "right": submesh(expected, x >= np.quantile(x, 0.6))[0],
    }
    regions = {
        side: ((mesh.vertices[:, 1] > mesh.vertices[:, 1].mean()) + 1, {1: "a", 2: "b"})
        for side, mesh in sides.items()
    }
    table = deviation.deviation_table({"run": "r"}, expected, maps, sides, regions)
    recorded({"maps": maps, "table": table}, rtol=1e-3)


def test_numbers_of_sweeps(recorded):
    observed_parts = {"b": {"left": body()}, "c": {"left": body(1.1)}}
    size = {"hemisphere": "left", "metric": "area", "unit": "cm2"}
    tables = []
    for run, thickness in (("thin", 1.5), ("thick", 2.0), ("thicker", 2.6)):
        spectra, metrics = [], []
        brains = (run, "a", thickness), ("observed", "b", 1.8), ("observed", "c", 2.2)
        for name, subject, factor in brains:
            labels = {"run": name, "subject": subject}
            spectra.append(folded(factor).assign(**labels, week=28.0))
            metrics.append(labels | size | {"value": 50 * factor})
        table = sweeps.member_comparison(
            run,
            "a",
            {"a": "p", "b": "p", "c": "q"},
            pd.DataFrame(metrics),
            pd.concat(spectra),
            {"left": body(0.9 + 0.05 * thickness)},
            observed_parts,
        )
        tables.append(table)
    joined = sweeps.joined_comparisons(tables)
    members = pd.DataFrame({"run": ["thin", "thick", "thicker"], "subject": "a"})
    members = members.assign(
        thickness_mm=[1.5, 2.0, 2.6],
        resolution=["ok", "ok", "coarse"],
        rate=[0.2, 0.9, 0.4],
    )
    nearest = sweeps.nearest_runs(joined, members, ["thickness_mm", "rate"])
    recorded({"joined": joined, "nearest": nearest}, rtol=5e-2, atol=5e-2)
