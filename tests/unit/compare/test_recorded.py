"""All numbers of comparisons of uneven brains, and of tests of predictions."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from recording import answer_of
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
    baselines = {
        name: shapes.prepare_for_comparison(mesh, brain.surface, 2.0)
        for name, mesh in (("start", body(0.8, 0.2)), ("adjacent", body(0.95, 0.8)))
    }
    return replace(brain, baselines=baselines)


def test_numbers_of_a_comparison(recorded, observed):
    moved = transformed(body(1.05, 1.3), rigid(2.0, -1.0, 3.0, shift=(1.0, 2.0, -1.0)))
    columns, _ = comparison.compare(moved, observed, radius_mm=2.0)
    prepared = shapes.prepare_for_comparison(moved, observed.surface, 2.0)
    pair = comparison.pairwise_distances(moved, observed.surface)
    recorded(
        {
            "columns": columns,
            "aligned": comparison.aligned_distances(moved, observed.surface),
            "distances": comparison.surface_distances(pair),
            "roughness": comparison.roughness_mm(moved),
            "scaled": shapes.scale_to_volume(moved, observed.surface),
            "rms": prepared.curvature_rms,
            "curvature": shapes.curvature_differences(prepared, observed.prepared),
            "dice": shapes.cortex_dice(moved, observed.surface),
            "baselines": observed.baseline_correlations,
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
            "mirror": placement.mirror_image(observed.prepared)[1],
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
            "interpolated": placement.interpolate_measures(
                shapes.prepare_for_comparison(body(0.9, 0.5), observed.surface, 2.0),
                observed.prepared,
            ),
        },
        rtol=5e-2,
        atol=5e-2,
    )


def test_numbers_of_simple_predictions(recorded):
    start, target = body(0.8, 0.3), body()
    found = comparison.simple_predictions(
        start, target, {"series": body(0.97, 0.7), "atlas": body(1.1, 0.9)}, body(0.9)
    )
    brains = {
        week: comparison.observed_brain(f"b{week}", body(1 + 0.02 * week), 2.0)
        for week in (22.0, 24.0)
    }
    models = dict.fromkeys(brains, found)
    table = comparison.comparison_table(
        {"run": "r", "kind": "predicted", "start": "a", "start_week": 21.0},
        models,
        brains,
        radius_mm=2.0,
    )
    sizes = {week: {"area_cm2": 40.0 + week, "volume_ml": 30.0} for week in brains}
    recorded(
        {
            "predictions": found,
            "table": comparison.add_curves(table, sizes),
        },
        rtol=5e-2,
        atol=5e-2,
    )


def tests_of_predictions():
    """Return tests of five starts over three horizons, of three models."""
    random = np.random.default_rng(4)
    rows = []
    for number, start in enumerate("abcde"):
        for horizon in (2.0, 4.0, 7.0):
            for model in ("run", "atlas", "scaled"):
                row = {"start": start, "start_week": 22.0 + number, "model": model}
                row |= {"horizon": horizon, "protocol": "default", "run": model}
                row["r_shape_index"] = 0.9 - 0.03 * horizon - 0.1 * random.random()
                for size in ("area", "volume", "folding"):
                    row[f"{size}_difference"] = 0.03 * horizon * random.normal() + 0.02
                rows.append(row)
    return rows


def metrics_of(weeks, factor):
    """Return metrics of a brain in some weeks."""
    rows = []
    for week in weeks:
        for side, share in (("whole", 1.0), ("left", 0.52)):
            for metric, size in (("area", 9.0), ("gyrification_index", 0.06)):
                row = {"week": week, "hemisphere": side, "metric": metric}
                rows.append(row | {"value": factor * share * size * week, "unit": "u"})
    return pd.DataFrame(rows)


def test_numbers_of_errors_in_tests(recorded):
    tests = tests_of_predictions()
    results = {}
    for metric in ("area", "volume", "gyrification_index"):
        errors = accuracy.log_errors(tests, metric)
        for week, horizon in ((24.0, 2.0), (27.5, 3.0), (33.0, 9.0)):
            found = accuracy.error_in_tests(errors, week, horizon)
            name = f"{metric} {week} {horizon}"
            results[name] = {
                "error": found,
                "words": accuracy.error_words(metric, found),
            }
    members = [metrics_of((24.0, 26.0), factor) for factor in (0.95, 1.0, 1.07)]
    surfaces = [body(factor) for factor in (0.95, 1.0, 1.08)]
    recorded(
        {
            **results,
            "advantage": [accuracy.atlas_advantage(tests, at) for at in (2.0, 5.0)],
            "facts": accuracy.prediction_facts(tests, 23.0, 27.0),
            "spread": accuracy.spread_of_members(np.array([1.0, 1.2, 0.7, 1.1]), 0.9),
            "intervals": accuracy.interval_table(
                metrics_of((24.0, 26.0, 29.0), 1.01),
                pd.concat(members),
                metrics_of((24.0, 26.0), 1.2),
                tests,
            ),
            "maps": accuracy.ensemble_maps(
                surfaces[1],
                surfaces,
                [smooth_field(mesh.vertices) - 1.5 for mesh in surfaces],
            ),
        },
        rtol=1e-3,
    )


def test_numbers_of_a_calibration(recorded, observed):
    design = calibration.first_round(BOUNDS, 6, seed=2)
    score = (design["thickness_mm"] - 1.9) ** 2 + 1e12 * design[
        "growth_rate_per_s"
    ] ** 2
    runs = design.assign(score=score, run=[f"r{n}" for n in range(6)], cause="")
    base = {"thickness_mm": 2.0, "start_week": 21.0, "shear_modulus_core_pa": 300.0}
    base["growth"] = {"area_cm2": {21.0: 90.0, 24.0: 150.0}}
    weights = {"size": 2.0, "surface_distance": 1.0}
    pairs = [(body(1.04), observed), (body(0.9), observed)]
    recorded(
        {
            "first": design,
            "optimum": calibration.find_optimum(runs, BOUNDS),
            "parameters": calibration.calibrated_parameters(
                base,
                {"thickness_mm": 1.5, "growth.area_cm2": 1.1},
                23.0,
            ),
            "spectra": calibration.spectral_scores(folded(1.5), folded(2.1)),
            "scores": [
                answer_of(
                    calibration.brain_scores,
                    mesh,
                    observed,
                    list(calibration.SURFACE_SCORES),
                    radius_mm=2.0,
                )
                for mesh, _ in pairs
            ],
            "run": calibration.run_score(pairs, weights, [], radius_mm=2.0),
            "diverged": calibration.run_score(
                pairs, weights, ["too large"], radius_mm=2.0
            ),
        },
        rtol=5e-2,
        atol=5e-2,
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
    tables = []
    for number in range(12):
        week = 24.0 + 0.5 * (number // 2)
        brain = table.assign(subject=f"s{number}", start=f"s{number}", week=week)
        tables.append(brain.assign(value=brain["value"] * (1 + 0.1 * np.sin(number))))
    brains = pd.concat(tables)
    recorded(
        {
            "maps": maps,
            "table": table,
            "scores": deviation.deviation_scores(brains, individuals=True),
            "averages": deviation.deviation_scores(brains, individuals=False),
        },
        rtol=5e-2,
        atol=5e-2,
    )


def test_numbers_of_sweeps(recorded):
    random = np.random.default_rng(6)
    tables = []
    for run, size in (("thin", 1.5), ("thick", 2.0), ("thicker", 2.6)):
        spectra, metrics = [], []
        for name, subject, factor in (
            (run, "a", size),
            ("observed", "b", 1.8),
            ("observed", "c", 2.2),
        ):
            spectra.append(folded(factor).assign(run=name, subject=subject, week=28.0))
            value = {"hemisphere": "left", "metric": "area", "unit": "cm2"}
            metrics.append(
                {"run": name, "subject": subject, "value": 50 * factor} | value
            )
        parts = {"left": body(0.9 + 0.05 * size)}
        tables.append(
            sweeps.member_comparison(
                run,
                "a",
                {"a": "p", "b": "p", "c": "q"},
                pd.DataFrame(metrics),
                pd.concat(spectra),
                parts,
                {"b": {"left": body()}, "c": {"left": body(1.1)}},
            )
        )
    joined = sweeps.joined_comparisons(tables)
    members = pd.DataFrame(
        {
            "run": ["thin", "thick", "thicker"],
            "subject": "a",
            "thickness_mm": [1.5, 2.0, 2.6],
            "resolution": ["ok", "ok", "coarse"],
            "rate": random.random(3),
        }
    )
    recorded(
        {
            "joined": joined,
            "nearest": answer_of(
                sweeps.nearest_runs, joined, members, ["thickness_mm", "rate"]
            ),
        },
        rtol=5e-2,
        atol=5e-2,
    )
