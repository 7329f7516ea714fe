"""First rounds fill their bounds, scores grow with differences, and later rounds find a
known minimum."""

import numpy as np
import pandas as pd
import pytest
from facts import Facts

from gyriflow.compare.calibration import (
    brain_scores,
    calibrated_parameters,
    find_optimum,
    first_round,
    next_round,
    require_bands,
    run_score,
    spectral_scores,
)
from gyriflow.compare.comparison import ObservedBrain, compare, observed_brain
from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.metrics.spangy import PART_POWERS

from .bumpy import PREPARED, RADIUS, REAL, bumpy
from .made_spectra import folded

BOUNDS = {"thickness_mm": (1.0, 3.0), "growth_rate_per_s": (1e-7, 5e-7)}
TRUTH = {"thickness_mm": 1.7, "growth_rate_per_s": 3.2e-7}
OBSERVED = ObservedBrain("b", REAL, PREPARED)


def in_unit_box(values):
    """Return the distance of each value from its lower bound, as a share of the
    range."""
    columns = [
        (values[name] - low) / (high - low) for name, (low, high) in BOUNDS.items()
    ]
    return np.column_stack(columns)


def scored(design):
    """Return a design with the score of a bowl around the truth, steeper along the
    rate."""
    away = in_unit_box(design) - in_unit_box(pd.DataFrame([TRUTH]))
    names = [f"run-{thickness:g}" for thickness in design["thickness_mm"]]
    return design.assign(
        run=names, score=0.1 + 0.3 * away[:, 0] ** 2 + 2.0 * away[:, 1] ** 2, cause=""
    )


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
        runs = pd.concat(
            [runs, scored(next_round(runs, BOUNDS, 4, seed=0))], ignore_index=True
        )
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


def test_an_optimum_near_a_bound_is_marked():
    runs = pd.DataFrame(
        {
            "thickness_mm": [1.01, 2.0],
            "growth_rate_per_s": [2e-7, 2e-7],
            "score": [0.1, 0.2],
        }
    )
    found = find_optimum(runs.assign(run=["a", "b"], cause=""), BOUNDS)
    assert found["at_bound"].tolist() == [True, False]


@pytest.mark.parametrize("name", ["relative_power_b5", "spectral_distance"])
def test_the_score_of_a_spectrum_is_least_at_the_thickness_of_the_brain(name):
    scores = [
        run_score(
            [(REAL, OBSERVED)],
            {name: 1.0},
            [],
            radius_mm=3.0,
            spectra=[(folded(thickness), folded(1.7))],
        )["score"]
        for thickness in (1.0, 1.4, 1.7, 2.1, 3.0)
    ]
    assert scores[2] == pytest.approx(0.0, abs=1e-12)
    assert min(scores[:2] + scores[3:]) > 0.01


def test_spectral_scores_are_of_mean_curvature_and_0_for_the_same_spectrum():
    other = folded(1.5).assign(proxy="shape_index")
    both = [pd.concat([folded(thickness), other]) for thickness in (1.7, 2.4)]
    assert spectral_scores(both[0], both[0]) == pytest.approx(
        dict.fromkeys(spectral_scores(*both), 0.0)
    )
    share = [folded(thickness)["relative_power"][4] for thickness in (1.7, 2.4)]
    assert spectral_scores(*both)["relative_power_b5"] == pytest.approx(
        abs(share[0] - share[1])
    )


def test_sides_that_differ_in_opposite_directions_do_not_cancel():
    def brain(left, right):
        sides = [
            folded(1.7).assign(hemisphere=side, relative_power=x)
            for side, x in (("left", left), ("right", right))
        ]
        return pd.concat(sides)

    # the share is 0.1 larger on the left and 0.05 smaller on the right
    assert spectral_scores(brain(0.4, 0.25), brain(0.3, 0.3))[
        "relative_power_b4"
    ] == pytest.approx(0.075)


def test_a_spectral_distance_reaches_to_the_last_complete_band():
    one, other = folded(1.7), folded(1.7)
    last = other["band"] == 6
    other.loc[last, ["power", "relative_power", *PART_POWERS]] *= 1.5
    assert spectral_scores(one, other)["spectral_distance"] > 0.01


@pytest.mark.parametrize("side", ["left", "right"])
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
    side, flag, band, name, remedy
):
    spectra = pd.concat(
        [folded(1.7).assign(hemisphere=each) for each in ("left", "right")],
        ignore_index=True,
    )
    require_bands(spectra, [name, "size"])
    at = (spectra["hemisphere"] == side) & (spectra["band"] == band)
    spectra.loc[at, flag] = False
    with pytest.raises(
        InputError, check=Facts("spectra.csv", name, f"B{band}", "mm", remedy)
    ):
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


def test_without_a_finished_run_the_causes_are_given():
    runs = scored(first_round(BOUNDS, 12, seed=0)).assign(
        score=np.nan, cause="det F of an element is 0"
    )
    message = Facts(
        "0 of 12 runs",
        "det F of an element is 0",
        "calibrate.parameters",
        "calibrate.rounds",
    )
    with pytest.raises(InputError, check=message):
        next_round(runs, BOUNDS, 2, seed=0)
    with pytest.raises(InputError, check=message):
        find_optimum(runs, BOUNDS)


def test_values_take_their_places_in_the_parameters():
    base = {
        "start_week": 21.0,
        "thickness_mm": 1.5,
        "shear_modulus_cortex_pa": 1500.0,
        "shear_modulus_core_pa": 300.0,
        "contact": {"gap_mm": 2.5},
    }
    values = {
        "thickness_mm": 2.0,
        "shear_modulus_cortex_pa": 1200.0,
        "contact.gap_mm": 3.0,
    }
    found = calibrated_parameters(base, values, 25.0)
    assert (
        found["thickness_mm"],
        found["shear_modulus_cortex_pa"],
        found["contact"]["gap_mm"],
    ) == (2.0, 1200.0, 3.0)
    assert (found["end_week"], found["output_weeks"]) == (25.0, [21.0, 25.0])
    assert base["contact"]["gap_mm"] == 2.5


def scores(surface, *names):
    return brain_scores(surface, OBSERVED, names, radius_mm=3.0)


def test_other_folds_of_the_same_height_differ_in_place_and_not_in_distribution():
    near, far = (
        scores(mesh, "shape_index", "mean_curvature")
        for mesh in (bumpy(1, height=1.05), bumpy(2))
    )
    row, _ = compare(bumpy(2), OBSERVED, radius_mm=3.0, groups=["folds"])
    assert far == pytest.approx({name: 1 - row[f"r_{name}"] for name in far})
    assert abs(far["shape_index"] - far["mean_curvature"]) > 0.001
    assert near["shape_index"] < 0.1 < far["shape_index"]
    assert near["mean_curvature"] < 0.1 < far["mean_curvature"]
    flat, other = (
        scores(mesh, "curvature_distribution")
        for mesh in (bumpy(1, height=0.05), bumpy(2))
    )
    assert flat["curvature_distribution"] > 3 * other["curvature_distribution"]


def test_a_brain_has_the_scores_that_are_asked_for():
    larger = TriangleMesh(1.05 * REAL.vertices, REAL.faces)
    assert scores(larger, "size") == {
        "size": pytest.approx(np.hypot(1.05**2 - 1, 1.05**3 - 1))
    }
    found = scores(larger, "surface_distance", "shape_index", "curvature_distribution")
    assert list(found) == ["surface_distance", "shape_index", "curvature_distribution"]
    assert found["surface_distance"] == pytest.approx(0.05 * RADIUS, rel=0.05)
    # folds are compared after scaling
    assert found["shape_index"] == pytest.approx(0, abs=0.05)
    assert found["curvature_distribution"] == pytest.approx(0, abs=0.002)
    observed = observed_brain("b", REAL, 3.0)
    assert (
        brain_scores(bumpy(2), observed, ["shape_index"], radius_mm=3.0)["shape_index"]
        > 0.5
    )


def test_a_run_has_the_weighted_sum_of_the_means_over_its_pairs():
    first, second = (
        TriangleMesh(factor * REAL.vertices, REAL.faces) for factor in (1.05, 1.15)
    )
    weights = {"size": 2.0, "surface_distance": 0.5}
    found = run_score(
        [(first, OBSERVED), (second, OBSERVED)], weights, [], radius_mm=3.0
    )
    size = np.mean([np.hypot(factor**2 - 1, factor**3 - 1) for factor in (1.05, 1.15)])
    assert found["size"] == pytest.approx(size)
    assert found["surface_distance"] == pytest.approx(0.1 * RADIUS, rel=0.05)
    assert found["score"] == pytest.approx(2 * size + 0.5 * found["surface_distance"])
    assert (found["outcome"], found["cause"]) == ("finished", "")


def test_a_run_that_has_diverged_has_no_score_whatever_its_other_brains_are():
    found = run_score(
        [(REAL, OBSERVED)], {"size": 1.0}, ["det F", "no step"], radius_mm=3.0
    )
    assert np.isnan([found["score"], found["size"]]).all()
    assert (found["outcome"], found["cause"]) == ("diverged", "det F; no step")
