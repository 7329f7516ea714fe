"""First rounds fill their bounds, scores grow with differences, and later rounds find a
known minimum."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from facts import Facts

from gyriflow.compare.calibration import (
    find_optimum,
    first_round,
    next_round,
    require_bands,
    run_score,
)
from gyriflow.compare.comparison import ObservedBrain
from gyriflow.errors import InputError

from .bumpy import PREPARED, REAL
from .made_spectra import folded

BOUNDS = {"thickness_mm": (1.0, 3.0), "growth_rate_per_s": (1e-7, 5e-7)}
TRUTH = {"thickness_mm": 1.7, "growth_rate_per_s": 3.2e-7}


def in_unit_box(values):
    """Return the distance of each value from its lower bound, as a share of the
    range."""
    low, high = np.transpose(list(BOUNDS.values()))
    return (values[list(BOUNDS)].to_numpy() - low) / (high - low)


def scored(design):
    """Return a design with the score of a bowl around the truth, steeper along the
    rate."""
    away = in_unit_box(design) - in_unit_box(pd.DataFrame([TRUTH]))
    names = [f"run-{thickness:g}" for thickness in design["thickness_mm"]]
    score = 0.1 + away**2 @ [0.3, 2.0]
    return design.assign(run=names, score=score, cause="")


def test_the_first_round_fills_every_part_of_the_bounds_and_is_the_same_again():
    design = first_round(BOUNDS, 16, seed=3)
    pd.testing.assert_frame_equal(design, first_round(BOUNDS, 16, seed=3))
    assert not design.equals(first_round(BOUNDS, 16, seed=4))
    points = in_unit_box(design)
    assert ((points >= 0) & (points <= 1)).all()
    # a Sobol sequence has one point in each of 16 slices of each axis
    for axis in points.T:
        assert sorted(np.minimum((16 * axis).astype(int), 15)) == list(range(16))


def test_later_rounds_find_the_optimum():
    runs = scored(first_round(BOUNDS, 12, seed=0))
    for _ in range(7):
        further = scored(next_round(runs, BOUNDS, 4, seed=0))
        runs = pd.concat([runs, further], ignore_index=True)
    best = find_optimum(runs, BOUNDS).set_index("parameter")
    for name, truth in TRUTH.items():
        width = BOUNDS[name][1] - BOUNDS[name][0]
        assert best.loc[name, "value"] == pytest.approx(truth, abs=0.1 * width)
    # the rate, to which the score is steeper, is found more exactly
    assert best.loc["growth_rate_per_s", "value"] == pytest.approx(
        TRUTH["growth_rate_per_s"], rel=0.05
    )
    assert not best["at_bound"].any()
    assert (best["score"] == runs["score"].min()).all()
    assert (best["run"] == f"run-{best.loc['thickness_mm', 'value']:g}").all()


def test_a_round_has_distinct_runs_within_the_bounds_and_is_the_same_again():
    bounds = {
        "thickness_mm": (1.23456789, 1.23456999),
        "growth_rate_per_s": (1e-7, 5e-7),
    }
    runs = first_round(bounds, 4, seed=0).assign(score=[4.0, 3.0, 2.0, 1.0], cause="")
    found = next_round(runs, bounds, 6, seed=0)
    pd.testing.assert_frame_equal(found, next_round(runs, bounds, 6, seed=0))
    assert len(set(found["growth_rate_per_s"])) == 6
    for name, (low, high) in bounds.items():
        assert found[name].between(low, high).all()


@pytest.mark.parametrize(("best", "is_at_bound"), [(1.01, True), (1.03, False)])
def test_an_optimum_near_a_bound_is_marked(best, is_at_bound):
    values = {"thickness_mm": [best, 2.0], "growth_rate_per_s": [2e-7, 2e-7]}
    runs = pd.DataFrame(values | {"score": [0.1, 0.2], "run": ["a", "b"]})
    found = find_optimum(runs, BOUNDS)
    assert found["at_bound"].tolist() == [is_at_bound, False]


def spectral_score(name, simulated, observed):
    """Return the score of a run whose brain and observed brain have these spectra."""
    pairs = [(REAL, ObservedBrain("b", REAL, PREPARED))]
    spectra = [(simulated, observed)]
    return run_score(pairs, {name: 1.0}, [], radius_mm=3.0, spectra=spectra)["score"]


def test_sides_that_differ_in_opposite_directions_do_not_cancel():
    def brain(left, right):
        sides = {"left": left, "right": right}
        tables = [
            folded(1.7).assign(hemisphere=side, relative_power=share)
            for side, share in sides.items()
        ]
        return pd.concat(tables)

    # the share is 0.1 larger on the left and 0.05 smaller on the right
    score = spectral_score("relative_power_b4", brain(0.4, 0.25), brain(0.3, 0.3))
    assert score == pytest.approx(0.075)


@pytest.mark.parametrize(
    ("flag", "band", "name", "remedy"),
    [
        ("resolved", 5, "relative_power_b5", "metrics.curvature_radius_mm"),
        ("resolved", 4, "spectral_distance", "metrics.curvature_radius_mm"),
        ("resolved", 6, "spectral_distance", "metrics.curvature_radius_mm"),
        ("complete", 6, "relative_power_b6", "metrics.spangy_modes: B6"),
        ("complete", 5, "spectral_distance", "metrics.spangy_modes: B5"),
    ],
)
def test_scores_of_a_band_that_is_cut_off_or_not_resolved_on_a_side_are_refused(
    flag, band, name, remedy
):
    sides = [folded(1.7).assign(hemisphere=side) for side in ("left", "right")]
    spectra = pd.concat(sides, ignore_index=True)
    require_bands(spectra, [name, "size"])
    at = (spectra["hemisphere"] == "right") & (spectra["band"] == band)
    spectra.loc[at, flag] = False
    facts = Facts("spectra.csv", name, f"B{band}", "mm", remedy)
    with pytest.raises(InputError, check=facts):
        require_bands(spectra, [name, "size"], "spectra.csv")
    # another score does not need this band
    require_bands(spectra, [f"relative_power_b{4 if band != 4 else 5}", "size"])


def test_diverged_runs_keep_others_away():
    runs = scored(first_round(BOUNDS, 16, seed=0))
    diverged = runs["thickness_mm"] > 2.0
    runs.loc[diverged, "score"] = np.nan
    found = next_round(runs, BOUNDS, 8, seed=0)
    assert (found["thickness_mm"] < 2.0).sum() >= 6
    assert find_optimum(runs, BOUNDS)["score"][0] == runs["score"].min()


@pytest.mark.parametrize("choose", [find_optimum, partial(next_round, count=2, seed=0)])
def test_without_a_finished_run_the_causes_are_given(choose):
    runs = scored(first_round(BOUNDS, 12, seed=0))
    runs = runs.assign(score=np.nan, cause="det F is 0")
    keys = "calibrate.parameters", "calibrate.rounds"
    with pytest.raises(InputError, check=Facts("0 of 12 runs", "det F is 0", *keys)):
        choose(runs, bounds=BOUNDS)
