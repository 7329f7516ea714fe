"""Charts hold what the tables say: metrics, norms, growth and scores."""

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from pictures import words

from gyriflow.errors import InputError
from gyriflow.metrics.atlas_curves import CURVES, DIFFERENCES
from gyriflow.metrics.norms import cohort_norms, measured_scores, norm_curves
from gyriflow.report.growth import growth_figure
from gyriflow.report.labels import SIMPLER_PREDICTIONS
from gyriflow.report.pictures import region_colours
from gyriflow.report.scores import calibration_figure, nearest_figure, validation_figure
from gyriflow.report.tables import brain_table
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
from gyriflow.settings.terms import SPREAD_UNKNOWN

COLUMNS = ["subject", "run", "week", "hemisphere", "region", "metric", "value", "unit"]
REGIONS = pd.DataFrame(
    [
        (
            subject,
            run,
            week,
            side,
            region,
            metric,
            factor * size + (1.0 if side == "left" else 0.0),
            unit,
        )
        for subject, run, week, size in (
            ("a", "observed", 21.0, 10.0),
            ("b", "observed", 22.0, 12.0),
            ("a", "r", 22.0, 11.0),
        )
        for side in ("left", "right")
        for region, factor in (("front", 1), ("back", 2))
        for metric, unit in (("area", "cm2"), ("mean_sulcal_depth", "mm"))
    ],
    columns=COLUMNS,
)
ASYMMETRY = pd.DataFrame(
    [("a", "observed", 21.0, "area", region, 0.1) for region in ("front", "back")]
    + [("a", "observed", 21.0, "area", "", 0.5)],
    columns=["subject", "run", "week", "metric", "region", "asymmetry_index"],
)
WEEKS = np.arange(21.0, 31.0)
REFERENCE = [f"s{i}" for i in range(len(WEEKS))]
NOISE = np.array([0.5, -0.5, 0.2, -0.1, -0.4, 0.3, 0.3, -0.5, 0.4, -0.2])


def metric_rows(
    run: str, hemisphere: str, metric: str, values: dict[float, float], unit: str
) -> pd.DataFrame:
    columns = {
        "subject": "s",
        "run": run,
        "week": list(values),
        "hemisphere": hemisphere,
        "metric": metric,
    }
    return pd.DataFrame({**columns, "value": list(values.values()), "unit": unit})


def spectrum_rows(
    run: str, week: float, power: dict[int, float], *, complete: bool = True
) -> list[pd.DataFrame]:
    of_all = {"subject": "s", "run": run, "week": week, "resolved": True}
    of_all |= {"complete": complete, "denominator_complete": complete}
    bands, powers = list(power), np.array(list(power.values()))
    return [
        pd.DataFrame(
            {
                **of_all,
                "hemisphere": side,
                "proxy": proxy,
                "band": bands,
                "relative_power": factor * share * powers,
            }
        )
        for side, factor in (("left", 1.0), ("right", 0.5))
        for proxy, share in (("mean_curvature", 1.0), ("shape_index", 0.8))
    ]


NO_ATLASES = pd.DataFrame(columns=CURVES)
NO_DIFFERENCES = pd.DataFrame(columns=DIFFERENCES)


def study_of(members: list[pd.DataFrame], real: list[pd.DataFrame]) -> Figure:
    """Draw the spectra of a study with one member at 28 GW."""
    values = {"thin": {"thickness_mm": 1.5}}
    return influence_spectra([pd.concat(members)], real, values=values, week=28.0)


def test_scans_of_a_subject_are_joined_and_subjects_told_apart():
    parts = [
        metric_rows("observed", "whole", "area", {week: value}, "cm2").assign(
            subject=brain
        )
        for brain, week, value in (
            ("a2", 26.0, 140.0),
            ("a1", 22.0, 100.0),
            ("b1", 24.0, 120.0),
            ("none", 23.0, 110.0),
        )
    ]
    subjects = {"a1": "sub-a", "a2": "sub-a", "b1": "sub-b"}
    figure = metrics_figure(pd.concat(parts), NO_ATLASES, subjects=subjects)
    drawn = [
        (line.get_marker(), line.get_linestyle(), line.get_xdata().tolist())
        for line in figure.axes[0].lines
    ]
    assert ("None", "-", [22, 26]) in drawn
    assert sum(linestyle == "-" for _, linestyle, _ in drawn) == 1
    assert {marker: weeks for marker, _, weeks in drawn if marker != "None"} == {
        "s": [22, 26],
        "^": [24],
        "*": [23],
    }
    assert {"sub-a", "sub-b", "observed brain"} <= words(figure)
    # a covariate has colours beside the markers
    figure = metrics_figure(
        pd.concat(parts),
        NO_ATLASES,
        subjects=subjects,
        groups={"a1": "sex: F", "a2": "sex: F", "b1": "sex: M"},
    )
    colours = {
        line.get_marker(): line.get_color()
        for line in figure.axes[0].lines
        if line.get_linestyle() != "-"
    }
    assert len(set(colours.values())) == 3
    assert {"sex: F", "sex: M", "sub-a", "observed brain"} <= words(figure)
    # more than a legend holds share the star
    many = pd.concat([parts[0].assign(subject=f"s{number}") for number in range(9)])
    figure = metrics_figure(
        many,
        NO_ATLASES,
        subjects={f"s{number}": f"sub-{number}" for number in range(9)},
    )
    assert {line.get_marker() for line in figure.axes[0].lines} == {"*"}
    assert "sub-1" not in words(figure)


def test_metrics_of_runs_are_lines_and_measured_ones_stars():
    metrics = pd.concat(
        [
            metric_rows("thin", "whole", "area", {22.0: 110.0, 21.0: 100.0}, "cm2"),
            metric_rows("observed", "whole", "area", {21.0: 99.0, 22.0: 120.0}, "cm2"),
            metric_rows("thin", "left", "area", {21.0: 50.0}, "cm2"),
            metric_rows(
                "thin", "whole", "mean_curvedness", {21.0: 0.1, 22.0: 0.2}, "1/mm"
            ),
        ]
    )
    figure = metrics_figure(metrics, NO_ATLASES)
    area, curvedness = figure.axes
    assert area.get_title() == "pial area (cm²)"
    drawn = {line.get_marker(): line.get_xydata().tolist() for line in area.lines}
    assert drawn == {"o": [[21, 100], [22, 110]], "*": [[21, 99], [22, 120]]}
    assert [line.get_ydata().tolist() for line in curvedness.lines] == [[0.1, 0.2]]
    assert {"thin", "observed brain"} <= words(figure)


def test_a_table_without_metrics_is_refused():
    with pytest.raises(InputError, check=Facts("spam")):
        metrics_figure(
            metric_rows("thin", "whole", "spam", {21.0: 1.0}, ""), NO_ATLASES
        )


def test_atlases_are_thin_lines_near_the_weeks_of_the_brains():
    metrics = metric_rows(
        "observed", "whole", "area", {25.0: 100.0, 26.0: 110.0}, "cm2"
    )
    rows = [
        (atlas, side, metric, week, factor * week)
        for atlas, factor in (("one", 4.0), ("two", 5.0))
        for side in ("whole", "left")
        for metric in ("area", "volume")
        for week in np.arange(20.0, 39.0)
    ]
    rows += [("late", "whole", "area", week, 300.0) for week in (36.0, 37.0)]
    figure = metrics_figure(metrics, pd.DataFrame(rows, columns=CURVES))
    (area,) = figure.axes
    lines = [line.get_xydata() for line in area.lines if line.get_linestyle() != "None"]
    weeks = np.arange(23.0, 29.0)
    assert [line[:, 0].tolist() for line in lines] == [weeks.tolist()] * 2
    assert [line[:, 1].tolist() for line in lines] == [
        (4 * weeks).tolist(),
        (5 * weeks).tolist(),
    ]
    names = " ".join(words(figure))
    assert ("one" in names, "two" in names, "late" in names) == (True, True, False)


def test_spectra_bars_are_the_relative_powers_of_each_side():
    thin = [
        *spectrum_rows("thin", 28.0, {4: 0.2, 5: 0.3, 6: 0.1}),
        *spectrum_rows("thin", 27.0, {4: 0.9}),
    ]
    figure = study_of(thin, spectrum_rows("observed", 28.0, {4: 0.25, 5: 0.15}))
    assert {"1.5 mm", "observed brain"} <= words(figure)
    left, right, shape_index, _ = figure.axes
    assert "mean curvature" in left.get_title()
    assert "shape index" in shape_index.get_title()
    assert [bar.get_height() for bar in left.patches] == pytest.approx([0.2, 0.3, 0.1])
    assert [bar.get_height() for bar in shape_index.patches] == pytest.approx(
        [0.16, 0.24, 0.08]
    )
    assert [bar.get_height() for bar in right.patches] == pytest.approx(
        [0.1, 0.15, 0.05]
    )
    assert [line.get_xydata()[0].tolist() for line in left.lines] == [
        [0, 0.25],
        [1, 0.15],
    ]
    assert not any(bar.get_hatch() for bar in left.patches)


def hatches_and_open_stars(figure: Figure) -> tuple[bool, bool]:
    """Return whether the legend of a figure has a hatched patch, and whether it has an
    open star."""
    handles = figure.legends[0].legend_handles
    hatched = any(handle.get_hatch() for handle in handles if isinstance(handle, Patch))
    stars = [
        mark
        for mark in handles
        if isinstance(mark, Line2D) and mark.get_marker() == "*"
    ]
    return hatched, any(mark.get_markerfacecolor() == "white" for mark in stars)


@pytest.mark.parametrize(
    ("run", "shown"), [("thin", (True, False)), ("observed", (False, True))]
)
def test_bands_that_are_cut_off_are_marked_and_keyed(run, shown):
    good = {name: spectrum_rows(name, 28.0, {4: 0.2}) for name in ("thin", "observed")}
    cut = good | {
        run: [*good[run], *spectrum_rows(run, 28.0, {5: 0.1}, complete=False)]
    }
    figure = study_of(*cut.values())
    assert hatches_and_open_stars(figure) == shown
    assert [bool(bar.get_hatch()) for bar in figure.axes[0].patches] == [False, True][
        : 1 + shown[0]
    ]
    assert hatches_and_open_stars(study_of(*good.values())) == (False, False)
    spectra = pd.concat([*cut["thin"], *cut["observed"]])
    assert hatches_and_open_stars(spectra_figure(spectra)) == (
        False,
        run == "observed",
    )


def test_regions_chart_sums_areas_and_averages_depths():
    area, depth, asymmetry = regions_chart(REGIONS, ASYMMETRY).axes[:3]
    assert "area" in area.get_title()
    assert "(mm)" in depth.get_title()
    colours = region_colours(REGIONS["region"])

    def points(axes, region, marker):
        lines = [line for line in axes.lines if line.get_marker() == marker]
        return [
            point
            for line in lines
            if same_color(line.get_color(), colours[region])
            for point in map(tuple, line.get_xydata().tolist())
        ]

    assert points(area, "front", "*") == [(21, 21), (22, 25)]
    assert points(depth, "back", "*") == [(21, 20.5), (22, 24.5)]
    assert points(depth, "back", "None") == [(22, 22.5)]
    # that of the hemispheres is no region
    assert points(asymmetry, "front", "*") == [(21, 0.1)]


@pytest.fixture(scope="module")
def metrics_with_norms() -> pd.DataFrame:
    rows = [
        (name, "observed", week, "whole", "area", 10 * week + noise, "cm2")
        for name, week, noise in zip(REFERENCE, WEEKS, NOISE, strict=True)
    ]
    rows += [
        ("case", "observed", 25.0, "whole", "area", 252.0, "cm2"),
        ("s0", "r", 24.0, "whole", "area", 240.0, "cm2"),
    ]
    return pd.DataFrame(
        rows,
        columns=["subject", "run", "week", "hemisphere", "metric", "value", "unit"],
    )


def test_norms_show_the_reference_the_band_and_the_others(metrics_with_norms):
    curves = norm_curves(cohort_norms(metrics_with_norms, REFERENCE))
    # half a brain, which is not compared with whole ones
    half = metrics_with_norms[:1].assign(subject="half", value=5.0)
    brains = {"reference": REFERENCE, "brains": [*REFERENCE, "case"]}
    figure = norms_figure(pd.concat([metrics_with_norms, half]), curves, **brains)
    axes = figure.axes[0]
    stars = {
        point: line.get_color()
        for line in axes.lines
        if line.get_marker() == "*"
        for point in map(tuple, line.get_xydata().tolist())
    }
    assert len(stars) == 11
    assert stars[21.0, 210.5] != stars[25.0, 252.0]
    names = [text.get_text() for text in figure.legends[0].texts]
    # of the run, real brains, others than the reference, and the band
    assert (len(names), names[-1]) == (4, Facts(5, 25, 50, 75, 95))


def test_norms_of_averages_have_a_curve_without_a_band(metrics_with_norms):
    curves = norm_curves(cohort_norms(metrics_with_norms, REFERENCE, individuals=False))
    brains = {"reference": REFERENCE, "brains": [*REFERENCE, "case"]}
    figure = norms_figure(
        metrics_with_norms, curves, **brains, groups={"case": "sex: F"}
    )
    curve = next(line for line in figure.axes[0].lines if len(line.get_xdata()) > 20)
    assert curve.get_ydata()[[0, -1]] == pytest.approx([210, 300], abs=1)
    (band,) = (part.get_paths() for part in figure.axes[0].collections[:1])
    assert not band or np.isnan(band[0].vertices).any()
    names = [text.get_text() for text in figure.legends[0].texts]
    assert (len(names), names[2]) == (4, "sex: F")
    assert Facts(5, 95) not in names


def test_a_brain_has_its_numbers_with_where_they_stand(metrics_with_norms):
    own = metrics_with_norms[metrics_with_norms["subject"] == "case"]
    cohort = cohort_norms(metrics_with_norms, REFERENCE)
    scores = measured_scores(metrics_with_norms, REFERENCE, cohort)
    row = brain_table(own, scores, NO_DIFFERENCES).loc["pial area (cm²)"]
    assert (row["whole"], row["note"], row.iloc[-2]) == (
        252.0,
        "few brains",
        "95 (95 to 95), +1.6",
    )
    averages = cohort_norms(metrics_with_norms, REFERENCE, individuals=False)
    scores = measured_scores(metrics_with_norms, REFERENCE, averages)
    row = brain_table(own, scores, NO_DIFFERENCES).loc["pial area (cm²)"]
    assert row["norm"] == pytest.approx(250, abs=0.5)
    assert row.iloc[-2] in ("+0.8 %", "+0.9 %", "+0.7 %")
    assert row["note"] == SPREAD_UNKNOWN
    scores = measured_scores(own, [], cohort_norms(own, []))
    assert list(brain_table(own, scores, NO_DIFFERENCES)) == ["whole"]


def test_a_brain_has_its_differences_from_atlases_beside_the_noise(metrics_with_norms):
    own = metrics_with_norms[metrics_with_norms["subject"] == "case"]
    differences = pd.DataFrame(
        {
            "subject": ["case", "case", "case", "case", "s1"],
            "run": ["observed", "observed", "observed", "predicted", "observed"],
            "hemisphere": "whole",
            "metric": "area",
            "atlas": ["one", "two", "three", "one", "one"],
            "difference": 1.0,
            "relative_difference": [-0.031, 0.001, np.nan, 0.5, 0.5],
            "times_noise": [-22.2, 1.9, 3.0, 9.0, 9.0],
        }
    )
    scores = measured_scores(own, [], cohort_norms(own, []))
    row = brain_table(own, scores, differences).loc["pial area (cm²)"]
    assert row["difference from one"] == Facts("−3.1 %", 22)
    assert row["difference from two"] == Facts("+0.1 %", "within noise")
    assert row["difference from three"] == Facts("+1", 3)


def edges(axes, number: int) -> list[list[float]]:
    """Return the lower and the upper edge of a band by week: week, low, high."""
    points = axes.collections[number].get_paths()[0].vertices
    return [
        [week, *sorted(set(points[points[:, 0] == week, 1]))]
        for week in np.unique(points[:, 0])
    ]


def test_bands_of_a_norm_lie_between_its_outer_and_its_inner_centiles():
    centiles = {
        "expected": [100.0, 130.0, 200.0],
        "q05": [90.0, 110.0, 160.0],
        "q25": [95.0, 122.0, 185.0],
    }
    centiles |= {"q75": [106.0, 141.0, 220.0], "q95": [118.0, 160.0, 270.0]}
    curves = pd.DataFrame(
        {
            "hemisphere": "whole",
            "metric": "area",
            "week": [22.0, 23.0, 25.5],
            **centiles,
        }
    )
    other = curves.assign(hemisphere="left", expected=1.0, q05=0.0, q95=2.0)
    brain = metric_rows("observed", "whole", "area", {24.0: 150.0}, "cm2")
    axes = norms_figure(
        brain, pd.concat([other, curves]), reference=["s"], brains=["s"]
    ).axes[0]
    assert edges(axes, 0) == [
        [22.0, 90.0, 118.0],
        [23.0, 110.0, 160.0],
        [25.5, 160.0, 270.0],
    ]
    assert edges(axes, 1) == [
        [22.0, 95.0, 106.0],
        [23.0, 122.0, 141.0],
        [25.5, 185.0, 220.0],
    ]
    median = max(
        axes.lines, key=lambda line: (len(line.get_xdata()), line.get_linewidth())
    )
    assert median.get_xydata().tolist() == [[22.0, 100.0], [23.0, 130.0], [25.5, 200.0]]


def test_intervals_are_around_the_run_and_observed_brains_are_stars():
    ends = {
        "low": [9.0, 14.5, 11.0],
        "high": [10.5, 19.0, 14.0],
        "run": [10.0, 16.0, 12.5],
    }
    rows = pd.DataFrame(
        {
            "week": [22.0, 27.5, 24.0],
            "unit": "1",
            "observed_value": [np.nan, 18.5, 12.0],
            **ends,
        }
    )
    figure = intervals_figure(
        pd.concat([rows.assign(metric="area"), rows.assign(metric="folding_index")])
    )
    # a metric without intervals is not drawn
    (axes,) = figure.axes
    assert axes.get_title() == "pial area (cm²)"
    assert edges(axes, 0) == [[22.0, 9.0, 10.5], [24.0, 11.0, 14.0], [27.5, 14.5, 19.0]]
    run, stars = axes.lines
    assert run.get_xydata().tolist() == [[22.0, 10.0], [24.0, 12.5], [27.5, 16.0]]
    assert (stars.get_marker(), stars.get_xydata()[1:].tolist()) == (
        "*",
        [[24.0, 12.0], [27.5, 18.5]],
    )
    assert {"run", "interval", "observed brain"} <= words(figure)


def test_spectra_over_weeks_are_by_side_and_band_and_open_where_a_band_is_cut_off():
    thin = spectrum_rows("thin", 28.0, {4: 0.2, 5: 0.3})
    thin += spectrum_rows("thin", 26.5, {4: 0.1, 5: 0.2}, complete=False)
    scans = [
        part.assign(subject=brain)
        for brain, week, power in (("a1", 26.0, {4: 0.25}), ("a2", 27.5, {4: 0.15}))
        for part in spectrum_rows("observed", week, power)
    ]
    figure = spectra_figure(pd.concat([*thin, *scans]), subjects={"a1": "a", "a2": "a"})
    left4, left5, right4, _ = figure.axes

    def drawn(axes):
        lines = [
            (line.get_marker(), line.get_linestyle(), line.get_markerfacecolor())
            for line in axes.lines
        ]
        return {
            kind: line.get_xydata().round(3).tolist()
            for kind, line in zip(lines, axes.lines, strict=True)
        }

    colour = next(line.get_color() for line in left5.lines)
    assert drawn(left5) == {
        ("o", "-", colour): [[26.5, 0.2], [28.0, 0.3]],
        ("o", "None", "white"): [[26.5, 0.2]],
    }
    # the right side has half the power
    assert drawn(right4)["o", "-", colour] == [[26.5, 0.05], [28.0, 0.1]]
    joined = [line for line in left4.lines if line.get_marker() == "None"]
    assert [line.get_xydata().round(3).tolist() for line in joined] == [
        [[26.0, 0.25], [27.5, 0.15]]
    ]
    assert drawn(left4)["*", "None", "#000000"] == [[26.0, 0.25], [27.5, 0.15]]
    assert [axes.get_title() for axes in figure.axes] == [
        "B4, primary folds",
        "B5, secondary folds",
        "",
        "",
    ]


AREAS = pd.DataFrame(
    {
        "series": "volume",
        "week": [21.0, 23.0, 22.0],
        "area_cm2": [100, 130, 115],
        "volume_ml": [50, 70, 60],
    }
)
RATES = pd.DataFrame(
    {
        "series": "volume",
        "from_week": [21.0, 22.0],
        "to_week": [22.0, 23.0],
        "rate_per_s": [1.2e-7, -0.3e-7],
    }
)


def line_of(axes, label):
    """Return the (n, 2) data of the line whose label begins so."""
    (line,) = [line for line in axes.lines if str(line.get_label()).startswith(label)]
    return np.array(line.get_xydata())


def test_growth_bars_are_the_rates_in_units_of_1e_7_per_second():
    figure = growth_figure(AREAS, RATES, folding_rate_per_s=2e-7)
    area_axes, volume_axes, rate_axes = figure.axes
    assert {"a", "b", "c"} <= words(figure)
    assert [bar.get_height() for bar in rate_axes.patches] == pytest.approx([1.2, -0.3])
    assert "10⁻⁷ s⁻¹" in rate_axes.get_ylabel()
    assert [label.get_text() for label in rate_axes.get_xticklabels()] == [
        "21–22",
        "22–23",
    ]
    assert line_of(rate_axes, "folding")[:, 1] == pytest.approx([2.0, 2.0])
    assert area_axes.lines[0].get_xydata().tolist() == [[21, 100], [22, 115], [23, 130]]
    assert volume_axes.lines[0].get_ydata().tolist() == [50, 60, 70]


def test_brains_without_rates_have_areas_and_volumes_only():
    assert len(growth_figure(AREAS, RATES[:0]).axes) == 2
    figure = growth_figure(pd.concat([AREAS.assign(series="others"), AREAS]), RATES)
    area_axes, _, rate_axes = figure.axes
    assert len(area_axes.lines) == 2
    assert [bar.get_height() for bar in rate_axes.patches] == pytest.approx([1.2, -0.3])


def test_the_rates_of_many_subjects_share_a_panel():
    names = [f"sub-{number}" for number in range(9)]
    figure = growth_figure(
        pd.concat([AREAS.assign(series=name) for name in names]),
        pd.concat([RATES.assign(series=name) for name in names]),
    )
    *_, rates = figure.axes
    assert len(figure.axes) == 3
    # two intervals of each, and zero
    assert len(rates.lines) == 19
    assert rates.lines[0].get_xydata().tolist() == [
        [21, pytest.approx(1.2)],
        [22, pytest.approx(1.2)],
    ]
    assert "sub-1" not in words(figure)


def test_a_folding_rate_that_changes_is_drawn_over_the_intervals_of_the_bars():
    curve = {21.5: 1e-7, 22.5: 2e-7, 25.0: 4.5e-7}
    figure = growth_figure(AREAS, RATES, folding_rate_per_s=curve)
    # the bars of weeks 21-22 and 22-23 stand at 0 and 1, one wide: constant up to 21.5,
    # linear from there on
    assert line_of(figure.axes[2], "folding") == pytest.approx(
        np.array([[-0.5, 1.0], [0.0, 1.0], [0.5, 1.5], [1.0, 2.0], [1.5, 2.5]])
    )
    assert "folding" in words(figure)


def test_displacement_is_that_of_all_nodes_per_week_at_the_middle_of_the_interval():
    weeks = {
        "from_week": [21.0, 21.0, 25.0],
        "to_week": [22.0, 22.0, 27.0],
        "nodes": ["all", "pial", "all"],
    }
    norms = pd.DataFrame(
        {
            "run": "thin",
            "subject": "s",
            **weeks,
            "max_mm": 3.0,
            "mean_mm": [0.57, 0.8, 0.5],
        }
    )
    largest, mean = displacement_figure(norms).axes
    lines = {line.get_label(): line.get_xydata().tolist() for line in mean.lines}
    assert lines == {"thin": [[21.5, 0.57], [26.0, 0.25]]}
    assert largest.get_ylabel() == Facts("mm", "week")
    published = {"source": "a paper", "max_mm": [2.5, 2.2], "mean_mm": [0.5, 0.4]}
    figure = displacement_figure(
        norms, published={"displacement": {"from_weeks": [21, 22], "rows": [published]}}
    )
    for axes, values in zip(figure.axes, ([2.5, 2.2], [0.5, 0.4]), strict=True):
        lines = {line.get_label(): line.get_xydata().tolist() for line in axes.lines}
        assert lines.pop("a paper") == [[21.5, values[0]], [22.5, values[1]]]
        assert list(lines) == ["thin"]
    assert {"thin", "a paper"} <= words(figure)


OF_THE_STUDY = {
    "varied": "thickness_mm",
    "subject": "s",
    "observed": ["r"],
    "week": 28.0,
}
TRIED = {
    "thickness_mm": [1.0, 2.0, 3.0, 2.2],
    "growth_rate_per_s": [1e-7, 2e-7, 3e-7, 2.2e-7],
}
RUNS = pd.DataFrame(TRIED | {"round": [0, 0, 0, 1], "score": [0.5, 0.2, np.nan, 0.1]})
OPTIMUM = pd.DataFrame(
    {"parameter": ["thickness_mm", "growth_rate_per_s"], "value": [2.1, 2.1e-7]}
)


def test_each_parameter_of_a_calibration_has_a_panel():
    figure = calibration_figure(RUNS, OPTIMUM, score=["size"])
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "cortical thickness (mm)",
        "growth rate (s⁻¹)",
    ]
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    np.testing.assert_array_equal(lines["round 0"].get_xdata(), [1.0, 2.0])
    np.testing.assert_array_equal(lines["round 1"].get_ydata(), [0.1])
    # a diverged run has no score: it stands at the worst of the others
    np.testing.assert_array_equal(lines["diverged"].get_xydata(), [[3.0, 0.5]])
    assert list(lines["optimum"].get_xdata()) == [2.1, 2.1]
    assert list(figure.axes[1].get_lines()[0].get_xdata()) == [2.1e-7, 2.1e-7]


def gains(runs, weeks=(22, 23, 24), start="a"):
    rows = []
    for number, run in enumerate(runs):
        for week in weeks:
            row = {
                "run": run,
                "start": start,
                "week": week,
                "kind": "predicted" if week > 23 else "explained",
            }
            for measure in ("shape_index", "mean_curvature"):
                gain = 0.01 * (number + week - 21)
                row |= {
                    f"gain_{measure}": gain,
                    f"gain_low_{measure}": gain - 0.02,
                    f"gain_high_{measure}": gain + 0.05,
                }
            rows.append(row)
    return pd.DataFrame(rows)


def test_gains_are_drawn_with_their_kind_and_interval():
    axes = validation_figure(gains(["reference", "measured"])).axes[0]
    dots = [line for line in axes.lines if line.get_marker() == "o"]
    assert [line.get_markerfacecolor() for line in dots].count("white") == 2
    assert sum(len(line.get_xdata()) for line in dots) == 6
    # the bars of the first run end where its interval does
    bars = np.array(axes.collections[0].get_segments())[:, :, 1]
    np.testing.assert_allclose(
        bars, [[value - 0.02, value + 0.05] for value in (0.01, 0.02, 0.03)]
    )


def test_gains_of_two_start_brains_are_two_lines_beside_each_other():
    both = pd.concat([gains(["reference"]), gains(["reference"], start="b")])
    axes = validation_figure(both).axes[0]
    lines = [np.array(line.get_xdata(), float) for line in axes.lines]
    weeks = [line for line in lines if len(line) == 3]
    np.testing.assert_allclose(
        weeks, [[21.985, 22.985, 23.985], [22.015, 23.015, 24.015]]
    )


def test_runs_and_simpler_ways_are_lines_in_the_panels_of_their_start():
    rows = [
        {
            "run": run,
            "start": start,
            "horizon": horizon,
            "model": model,
            "distance_mm": 0.1 * horizon,
        }
        | {
            "r_shape_index": (
                level
                - 0.1 * horizon
                + (0.02 if run == "stiff" and model == "run" else 0)
            )
        }
        for start, level in (("a", 0.9), ("b", 0.8))
        for run in ("expected", "stiff")
        for model in ("run", "scaled", "new")
        for horizon in (1.0, 2.0)
    ]
    figure = prediction_figure(pd.DataFrame(rows), runs=["expected", "stiff"])
    first, away, second, _ = figure.axes
    assert [len(axes.lines) for axes in figure.axes] == [4] * 4
    full = [line.get_ydata() for line in second.lines if line.get_linestyle() == "-"]
    np.testing.assert_allclose(full, [[0.7, 0.6], [0.72, 0.62]])
    assert [line.get_linestyle() for line in first.lines].count("--") == 2
    assert all(
        list(line.get_ydata()) == pytest.approx([0.1, 0.2]) for line in away.lines
    )
    assert len({line.get_color() for line in first.lines}) == 4
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["expected", "stiff", SIMPLER_PREDICTIONS["scaled"], "new"]


def distances(
    values: dict[float, float], flag: str = "ok", **labels: str
) -> pd.DataFrame:
    table = pd.DataFrame(
        {"thickness_mm": list(values), "distance": list(values.values())}
    )
    table = table.assign(
        subject="s", observed="r", unit="mm", flag=flag, resolution="ok"
    )
    return table.assign(**({"hemisphere": "whole", "measure": "hausdorff95"} | labels))


def test_the_nearest_member_is_named_and_one_that_is_not_trusted_is_not_it():
    good = distances({0.8: 3.0, 1.5: 2.0, 2.25: 1.0})
    bad = distances({6.0: 0.1}, flag="not resolved by the mesh")
    figure = nearest_figure(pd.concat([good, bad]), **OF_THE_STUDY)
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == ["2.25"]
    assert axes.get_xlabel() == "cortical thickness (mm)"
    assert "hausdorff95 (mm)" in axes.get_title()
    marks = [
        line
        for line in axes.lines
        if line.get_marker() == "o" and line.get_markersize() == 4.5
    ]
    shown = {
        line.get_markerfacecolor() == "white": line.get_xdata().tolist()
        for line in marks
    }
    assert shown == {False: [0.8, 1.5, 2.25], True: [6.0]}


def test_a_published_nearest_value_is_a_line_in_the_panel_of_its_measure_and_week():
    names = ("area", "shape_index_relative_power_B4_weyl")
    rows = [distances({0.8: 2.0, 2.25: 1.0}).assign(measure=name) for name in names]
    found = {
        "parameter": "thickness_mm",
        "week": 28,
        "measure": "shape_index_relative_power_B4",
        "value": 1.3,
    }
    others = [
        found | {"week": 29, "value": 1.4},
        found | {"parameter": "step_s", "value": 1.5},
    ]
    figure = nearest_figure(
        pd.concat(rows), **OF_THE_STUDY, published={"nearest": [found, *others]}
    )
    dashed = [
        [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == "--"]
        for axes in figure.axes
    ]
    assert dashed == [[], [1.3]]
    # and in the legend
    assert (
        len(words(figure) - words(nearest_figure(pd.concat(rows), **OF_THE_STUDY))) == 1
    )
