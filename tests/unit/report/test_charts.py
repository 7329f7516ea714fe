"""Charts hold what the tables say: metrics, norms, growth and scores."""

import os
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from pictures import contents
from text_tables import frame

from gyriflow.errors import InputError
from gyriflow.metrics.atlas_curves import CURVES
from gyriflow.metrics.norms import cohort_norms, norm_curves
from gyriflow.report.growth import growth_figure
from gyriflow.report.scores import calibration_figure, nearest_figure, validation_figure
from gyriflow.report.weeks import (
    displacement_figure,
    influence_spectra,
    intervals_figure,
    metrics_figure,
    norms_figure,
    prediction_figure,
    regions_chart,
    spectra_figure,
)

REGIONS = frame(
    """
    subject run      week size
    a       observed 21   10
    b       observed 22   12
    a       r        22   11
    """
)
PARTS = frame(
    """
    hemisphere more region factor metric            unit
    left       1    front  1      area              cm2
    left       1    front  1      mean_sulcal_depth mm
    left       1    back   2      area              cm2
    left       1    back   2      mean_sulcal_depth mm
    right      0    front  1      area              cm2
    right      0    front  1      mean_sulcal_depth mm
    right      0    back   2      area              cm2
    right      0    back   2      mean_sulcal_depth mm
    """
)
REGIONS = REGIONS.merge(PARTS, how="cross")
REGIONS["value"] = REGIONS["factor"] * REGIONS["size"] + REGIONS["more"]
ASYMMETRY = frame(
    """
    subject run      week metric region asymmetry_index
    a       observed 21   area   front  0.1
    a       observed 21   area   back   0.1
    a       observed 21   area   -      0.5
    """
)
WEEKS = np.arange(21.0, 31.0)
REFERENCE = [f"s{i}" for i in range(len(WEEKS))]
NOISE = np.array([0.5, -0.5, 0.2, -0.1, -0.4, 0.3, 0.3, -0.5, 0.4, -0.2])


def metric_rows(
    run: str, hemisphere: str, metric: str, values: dict[float, float], unit: str
) -> pd.DataFrame:
    table = pd.DataFrame({"week": list(values), "value": list(values.values())})
    which = {"run": run, "hemisphere": hemisphere, "metric": metric}
    return table.assign(subject="s", unit=unit, **which)


def spectrum_rows(
    run: str, week: float, power: dict[int, float], *, complete: bool = True
) -> list[pd.DataFrame]:
    bands = pd.DataFrame({"band": list(power), "power": list(power.values())})
    bands = bands.assign(subject="s", run=run, week=week, resolved=True)
    bands = bands.assign(complete=complete, denominator_complete=complete)
    tables = []
    for side, factor in (("left", 1.0), ("right", 0.5)):
        for proxy, share in (("mean_curvature", 1.0), ("shape_index", 0.8)):
            table = bands.assign(hemisphere=side, proxy=proxy)
            table["relative_power"] = factor * share * table["power"]
            tables.append(table)
    return tables


NO_ATLASES = pd.DataFrame(columns=CURVES)


def metrics_with_norms() -> pd.DataFrame:
    """Return metrics of brains of a norm, of one beside it, and of a run."""
    brains = {"subject": REFERENCE, "week": WEEKS, "value": 10 * WEEKS + NOISE}
    further = frame(
        """
        subject run      week value
        case    observed 25   252
        s0      r        24   240
        """
    )
    table = pd.concat([pd.DataFrame(brains).assign(run="observed"), further])
    return table.assign(hemisphere="whole", metric="area", unit="cm2")


def subjects_by_marker_and_groups_by_colour():
    """Scans of two subjects, and of one of none."""
    metrics = frame(
        """
        subject week value
        a2      26   140
        a1      22   100
        b1      24   120
        none    23   110
        """,
        run="observed",
        hemisphere="whole",
        metric="area",
        unit="cm2",
    )
    subjects = {"a1": "sub-a", "a2": "sub-a", "b1": "sub-b"}
    groups = {"a1": "sex: F", "a2": "sex: F", "b1": "sex: M"}
    return metrics_figure(metrics, NO_ATLASES, subjects=subjects, groups=groups)


def more_subjects_than_a_legend_holds():
    """They share the star."""
    row = metric_rows("observed", "whole", "area", {26.0: 140.0}, "cm2")
    metrics = pd.concat([row.assign(subject=f"s{number}") for number in range(9)])
    subjects = {f"s{number}": f"sub-{number}" for number in range(9)}
    return metrics_figure(metrics, NO_ATLASES, subjects=subjects)


def runs_as_lines_brains_as_stars_and_atlases_near_their_weeks():
    """An atlas that is later than all brains is not drawn."""
    area = {26.0: 110.0, 25.0: 100.0}
    metrics = [
        metric_rows("thin", "whole", "area", area, "cm2"),
        metric_rows("observed", "whole", "area", {25.0: 99.0, 26.0: 120.0}, "cm2"),
        metric_rows("thin", "left", "area", {25.0: 50.0}, "cm2"),
        metric_rows("thin", "whole", "mean_curvedness", {25.0: 0.1, 26.0: 0.2}, "1/mm"),
    ]
    rows = [("late", "whole", "area", week, 300.0) for week in (36.0, 37.0)]
    for atlas, factor in (("one", 4.0), ("two", 5.0)):
        for side, metric in product(("whole", "left"), ("area", "volume")):
            for week in np.arange(20.0, 39.0):
                rows.append((atlas, side, metric, week, factor * week))
    return metrics_figure(pd.concat(metrics), pd.DataFrame(rows, columns=CURVES))


def spectra_of_a_sweep():
    """A band of the run is cut off."""
    thin = [
        *spectrum_rows("thin", 28.0, {4: 0.2, 5: 0.3}),
        *spectrum_rows("thin", 28.0, {6: 0.1}, complete=False),
        *spectrum_rows("thin", 27.0, {4: 0.9}),
    ]
    observed = spectrum_rows("observed", 28.0, {4: 0.25, 5: 0.15})
    values = {"thin": {"thickness_mm": 1.5}}
    return influence_spectra([pd.concat(thin)], observed, values=values, week=28.0)


def spectra_over_weeks():
    """By side and band, and open where a band is cut off, of the run or a brain."""
    thin = spectrum_rows("thin", 28.0, {4: 0.2, 5: 0.3})
    thin += spectrum_rows("thin", 26.5, {4: 0.1, 5: 0.2}, complete=False)
    scans = []
    for brain, week, power in (("a1", 26.0, {4: 0.25}), ("a2", 27.5, {4: 0.15})):
        parts = spectrum_rows("observed", week, power, complete=brain == "a1")
        scans += [part.assign(subject=brain) for part in parts]
    metric = "spangy_B4_relative_power"
    rows = [("one", "left", metric, week, 0.01 * week) for week in (26.0, 27.0)]
    atlases = pd.DataFrame(rows, columns=CURVES)
    subjects = {"a1": "a", "a2": "a"}
    return spectra_figure(pd.concat([*thin, *scans]), atlases, subjects=subjects)


def sums_of_areas_and_means_of_depths_of_regions():
    return regions_chart(REGIONS, ASYMMETRY)


NORM_BRAINS = {"reference": REFERENCE, "brains": [*REFERENCE, "case"]}


def a_norm_with_its_reference_and_others():
    """Half a brain is not compared with whole ones."""
    metrics = metrics_with_norms()
    curves = norm_curves(cohort_norms(metrics, REFERENCE))
    curves = pd.concat([curves.assign(hemisphere="left", expected=1.0), curves])
    half = metrics[:1].assign(subject="half", value=5.0)
    return norms_figure(pd.concat([metrics, half]), curves, **NORM_BRAINS)


def a_norm_of_averages():
    """It has a curve without a band."""
    metrics = metrics_with_norms()
    curves = norm_curves(cohort_norms(metrics, REFERENCE, individuals=False))
    return norms_figure(metrics, curves, **NORM_BRAINS, groups={"case": "sex: F"})


def intervals_around_a_run():
    """A metric without intervals is not drawn."""
    rows = frame(
        """
        week observed_value low  high run unit
        22   -              9    10.5 10  1
        27.5 18.5           14.5 19   16  1
        24   12             11   14   12.5 1
        """
    )
    parts = [rows.assign(metric="area"), rows.assign(metric="folding_index")]
    return intervals_figure(pd.concat(parts))


AREAS = frame(
    """
    series week area_cm2 volume_ml
    volume 21   100      50
    volume 23   130      70
    volume 22   115      60
    """
)
RATES = frame(
    """
    series from_week to_week rate_per_s
    volume 21        22      1.2e-7
    volume 22        23      -0.3e-7
    """
)


def rates_of_growth():
    return growth_figure(AREAS, RATES, folding_rate_per_s={0.0: 2e-7})


def rates_of_one_of_two_series():
    return growth_figure(pd.concat([AREAS.assign(series="others"), AREAS]), RATES)


def rates_of_many_subjects():
    """They share a panel, and no legend."""
    names = [f"sub-{number}" for number in range(9)]
    areas = pd.concat([AREAS.assign(series=name) for name in names])
    return growth_figure(areas, pd.concat([RATES.assign(series=n) for n in names]))


def a_folding_rate_that_changes():
    """Over the bars of weeks 21-22 and 22-23, at 0 and 1 and one wide, it is constant
    up to 21.5, and linear from there on."""
    curve = {21.5: 1e-7, 22.5: 2e-7, 25.0: 4.5e-7}
    return growth_figure(AREAS, RATES, folding_rate_per_s=curve)


def displacement_beside_a_published_one():
    """The displacement of all nodes per week, at the middle of each interval."""
    norms = frame(
        """
        run  subject from_week to_week nodes max_mm mean_mm
        thin s       21        22      all   3      0.57
        thin s       21        22      pial  3      0.8
        thin s       25        27      all   3      0.5
        """
    )
    row = {"source": "a paper", "max_mm": [2.5, 2.2], "mean_mm": [0.5, 0.4]}
    published = {"displacement": {"from_weeks": [21, 22], "rows": [row]}}
    return displacement_figure(norms, published=published)


def parameters_of_a_calibration():
    """A diverged run has no score: it stands at the worst of the others."""
    tried = frame(
        """
        thickness_mm growth_rate_per_s round score
        1            1e-7              0     0.5
        2            2e-7              0     0.2
        3            3e-7              0     -
        2.2          2.2e-7            1     0.1
        """
    )
    optimum = frame("parameter value\nthickness_mm 2.1\ngrowth_rate_per_s 2.1e-7")
    return calibration_figure(tried, optimum, score=["size"])


def gains_with_their_kind_and_interval():
    """Two lines of a run beside each other, from two start brains."""
    rows = []
    lines = [("reference", "a"), ("measured", "a"), ("reference", "b")]
    for number, (run, start) in enumerate(lines):
        for week in (22, 23, 24):
            kind = "predicted" if week > 23 else "explained"
            row = {"run": run, "start": start, "week": week, "kind": kind}
            for measure in ("shape_index", "mean_curvature"):
                gain = 0.01 * (number + week - 21)
                row[f"gain_{measure}"] = gain
                row[f"gain_low_{measure}"] = gain - 0.02
                row[f"gain_high_{measure}"] = gain + 0.05
            rows.append(row)
    return validation_figure(pd.DataFrame(rows))


def runs_and_simpler_predictions():
    rows = []
    for start, level in (("a", 0.9), ("b", 0.8)):
        for run in ("expected", "stiff"):
            for model in ("run", "scaled", "new"):
                better = 0.02 if run == "stiff" and model == "run" else 0.0
                for horizon in (1.0, 2.0):
                    row = {"run": run, "start": start, "model": model}
                    row |= {"horizon": horizon, "distance_mm": 0.1 * horizon}
                    row["r_shape_index"] = level - 0.1 * horizon + better
                    rows.append(row)
    return prediction_figure(pd.DataFrame(rows), runs=["expected", "stiff"])


def the_nearest_member_and_a_published_one():
    """One that is not trusted is not the nearest. The published value is a line in the
    panel of its measure and week."""
    known = {"subject": "s", "observed": "r", "hemisphere": "whole", "unit": "mm"}
    rows = frame(
        """
        thickness_mm distance flag    measure
        0.8          3.0      ok      hausdorff95
        1.5          2.0      ok      hausdorff95
        2.25         1.0      ok      hausdorff95
        6.0          0.1      cut_off hausdorff95
        0.8          2.0      ok      area
        2.25         1.0      ok      shape_index_relative_power_B4_weyl
        """,
        resolution="ok",
        **known,
    )
    found = {"parameter": "thickness_mm", "week": 28, "value": 1.3}
    found["measure"] = "shape_index_relative_power_B4"
    later = found | {"week": 29, "value": 1.4}
    other = found | {"parameter": "step_s", "value": 1.5}
    sweep = {"varied": "thickness_mm", "subject": "s", "observed": ["r"], "week": 28.0}
    return nearest_figure(rows, **sweep, published={"nearest": [found, later, other]})


CHARTS = (
    subjects_by_marker_and_groups_by_colour,
    more_subjects_than_a_legend_holds,
    runs_as_lines_brains_as_stars_and_atlases_near_their_weeks,
    spectra_of_a_sweep,
    spectra_over_weeks,
    sums_of_areas_and_means_of_depths_of_regions,
    a_norm_with_its_reference_and_others,
    a_norm_of_averages,
    intervals_around_a_run,
    rates_of_growth,
    rates_of_one_of_two_series,
    rates_of_many_subjects,
    a_folding_rate_that_changes,
    displacement_beside_a_published_one,
    parameters_of_a_calibration,
    gains_with_their_kind_and_interval,
    runs_and_simpler_predictions,
    the_nearest_member_and_a_published_one,
)


@pytest.mark.parametrize("chart", CHARTS, ids=lambda chart: chart.__name__)
def test_a_chart_shows(chart, recorded):
    figure = chart()
    # to look at: the table has neither limits nor layout
    if folder := os.environ.get("CHARTS_TO"):
        figure.savefig(Path(folder) / f"{chart.__name__}.png")
    recorded(contents(figure))


def test_a_table_without_metrics_is_refused():
    with pytest.raises(InputError, check=Facts("spam")):
        metrics_figure(
            metric_rows("thin", "whole", "spam", {21.0: 1.0}, ""), NO_ATLASES
        )
