"""Charts hold what the tables say."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from gyriflow.errors import InputError
from gyriflow.parameters.terms import ELEMENTS_NEEDED
from gyriflow.report.charts import metrics_chart, quality_histogram, steps_chart
from gyriflow.report.growth import growth_chart
from gyriflow.report.spectra import spectra_chart, spectra_weeks_chart

AREAS = pd.DataFrame(
    {"subject": ["a", "c", "b"], "week": [21.0, 23.0, 22.0], "area_cm2": [100, 130, 115], "volume_ml": [50, 70, 60]}
).assign(series="volume")
RATES = pd.DataFrame({"from_week": [21.0, 22.0], "to_week": [22.0, 23.0], "rate_per_s": [1.2e-7, -0.3e-7]}).assign(
    series="volume"
)


def words(figure: Figure) -> list[str]:
    """Returns all texts that a figure shows."""
    return [text.get_text() for text in figure.findobj(mpl.text.Text) if text.get_visible() and text.get_text()]


def line_of(axes, colour) -> np.ndarray:
    """Returns the (n, 2) data of the lines of a colour."""
    return np.concatenate([line.get_xydata() for line in axes.lines if mpl.colors.same_color(line.get_color(), colour)])


def metric_rows(run: str, hemisphere: str, metric: str, values: dict[float, float], unit: str) -> pd.DataFrame:
    columns = {"subject": "s", "run": run, "week": list(values), "hemisphere": hemisphere, "metric": metric}
    return pd.DataFrame({**columns, "value": list(values.values()), "unit": unit})


def spectrum_rows(run: str, week: float, power: dict[int, float], *, complete: bool = True) -> list[pd.DataFrame]:
    return [
        pd.DataFrame(
            {
                "run": run,
                "week": week,
                "hemisphere": side,
                "band": list(power),
                "relative_power": [factor * value for value in power.values()],
                "complete": complete,
                "denominator_complete": complete,
                "resolved": True,
            }
        )
        for side, factor in (("left", 1.0), ("right", 0.5))
    ]


def test_growth_bars_are_the_rates_in_units_of_1e_7_per_second():
    figure = growth_chart(AREAS, RATES, folding_rate_per_s=2e-7)
    area_axes, volume_axes, rate_axes = figure.axes
    assert [axes.texts[-1].get_text() for axes in figure.axes] == ["a", "b", "c"]
    assert [bar.get_height() for bar in rate_axes.patches] == pytest.approx([1.2, -0.3])
    assert "10⁻⁷ s⁻¹" in rate_axes.get_ylabel()
    assert [label.get_text() for label in rate_axes.get_xticklabels()] == ["21–22", "22–23"]
    assert line_of(rate_axes, "#D55E00")[:, 1] == pytest.approx([2.0, 2.0])
    assert area_axes.lines[0].get_xydata().tolist() == [[21, 100], [22, 115], [23, 130]]
    assert volume_axes.lines[0].get_ydata().tolist() == [50, 60, 70]


def test_series_have_bars_on_one_scale_and_their_differences_a_panel():
    areas = pd.concat([AREAS.assign(series="surface"), AREAS.assign(area_cm2=2 * AREAS["area_cm2"])])
    rates = pd.concat([RATES.assign(series="surface", rate_per_s=[3e-7, 1e-7]), RATES])
    agreement = RATES.assign(reference="surface", difference_per_s=[-1.8e-7, 0.4e-7])
    figure = growth_chart(areas, rates, agreement, folding_rate_per_s=2e-7)
    area_axes, _, surface_axes, volume_axes, difference_axes = figure.axes
    assert [line_of(area_axes, colour)[:, 1].tolist() for colour in ("#0072B2", "#009E73")] == [
        [100, 115, 130],
        [200, 230, 260],
    ]
    assert [bar.get_height() for bar in difference_axes.patches] == pytest.approx([-1.8, 0.4])
    assert "volume − surface: mean −0.70, mean size 1.10" in words(figure)
    assert [bar.get_height() for bar in surface_axes.patches] == pytest.approx([3.0, 1.0])
    assert [bar.get_height() for bar in volume_axes.patches] == pytest.approx([1.2, -0.3])
    assert surface_axes.get_ylim() == volume_axes.get_ylim()
    assert {"tangential growth rate:\nsurface", "tangential growth rate:\nvolume"} <= set(words(figure))
    assert [text.get_text() for text in area_axes.get_legend().get_texts()] == ["surface", "volume"]
    # a series is of one colour in all panels, and not that of the folding
    for axes, colour in ((surface_axes, "#0072B2"), (volume_axes, "#009E73"), (difference_axes, "#009E73")):
        assert all(mpl.colors.same_color(bar.get_facecolor(), colour) for bar in axes.patches)


def test_series_without_common_weeks_have_no_panel_of_differences():
    other = RATES.assign(series="surface", from_week=[30.0, 31.0], to_week=[31.0, 32.0])
    areas = pd.concat([AREAS, AREAS.assign(series="surface", week=AREAS["week"] + 9)])
    figure = growth_chart(areas, pd.concat([RATES, other]), RATES.iloc[:0])
    assert not any("difference" in text for text in words(figure))
    assert len([axes for axes in figure.axes if axes.patches]) == 2


def test_a_folding_rate_that_changes_is_drawn_over_the_intervals_of_the_bars():
    curve = {21.5: 1e-7, 22.5: 2e-7, 25.0: 4.5e-7}
    figure = growth_chart(AREAS, RATES, folding_rate_per_s=curve)
    # the bars of weeks 21-22 and 22-23 stand at 0 and 1, one wide: constant up to 21.5, linear from there on
    assert line_of(figure.axes[2], "#D55E00") == pytest.approx(
        np.array([[-0.5, 1.0], [0.0, 1.0], [0.5, 1.5], [1.0, 2.0], [1.5, 2.5]])
    )
    assert "folding" in words(figure)


def test_a_curve_of_one_week_is_a_constant_rate():
    figure = growth_chart(AREAS, RATES, folding_rate_per_s={30.0: 2e-7})
    assert line_of(figure.axes[2], "#D55E00")[:, 1] == pytest.approx([2.0, 2.0, 2.0])


def test_growth_chart_without_a_folding_has_no_line_of_it():
    assert not any("folding" in text for text in words(growth_chart(AREAS, RATES)))


def test_phantom_is_called_synthetic_and_never_real():
    metrics = metric_rows("real", "whole", "area", {21.0: 100.0}, "cm2")
    phantom = {"measured": "phantom", "synthetic": True}
    for figure in (growth_chart(AREAS, RATES, **phantom), metrics_chart(metrics, **phantom)):
        shown = words(figure)
        assert any("synthetic phantom" in text for text in shown)
        assert "real brain" not in shown
    assert not any("synthetic" in text for text in words(growth_chart(AREAS, RATES)))


def test_a_phantom_beside_real_brains_is_synthetic_and_they_are_not():
    metrics = metric_rows("real", "whole", "area", {21.0: 100.0}, "cm2")
    shown = words(metrics_chart(metrics, measured="real brain", synthetic=True))
    assert {"simulated from a synthetic phantom", "real brain"} <= set(shown)
    assert not any("not a real brain" in text for text in shown)


def test_settings_outside_stay_and_fonts_inside_are_the_same_when_saved(tmp_path):
    before = dict(mpl.rcParams)
    figure = growth_chart(AREAS, RATES)
    assert dict(mpl.rcParams) == before
    figure.savefig(tmp_path / "chart.png")
    assert {label.get_fontsize() for axes in figure.axes for label in axes.get_xticklabels()} == {7.0}


def test_metrics_of_runs_are_lines_and_measured_ones_black_stars():
    metrics = pd.concat(
        [
            metric_rows("thin", "whole", "area", {22.0: 110.0, 21.0: 100.0}, "cm2"),
            metric_rows("real", "whole", "area", {21.0: 99.0, 22.0: 120.0}, "cm2"),
            metric_rows("thin", "left", "area", {21.0: 50.0}, "cm2"),
        ]
    )
    figure = metrics_chart(metrics)
    (axes,) = figure.axes
    assert axes.get_title() == "pial area (cm²)"
    assert line_of(axes, "#0072B2").tolist() == [[21, 100], [22, 110]]
    (stars,) = [line for line in axes.lines if line.get_marker() == "*"]
    assert stars.get_color() == "#000000"
    assert stars.get_linestyle() == "None"
    assert stars.get_xydata().tolist() == [[21, 99], [22, 120]]
    assert {"thin", "real brain"} <= set(words(figure))


def test_a_metric_of_hemispheres_only_is_drawn_for_both():
    metrics = pd.concat(
        [
            metric_rows("thin", "left", "mean_curvedness", {21.0: 0.1, 22.0: 0.2}, "1/mm"),
            metric_rows("thin", "right", "mean_curvedness", {21.0: 0.3, 22.0: 0.4}, "1/mm"),
        ]
    )
    figure = metrics_chart(metrics)
    assert {line.get_linestyle(): line.get_ydata().tolist() for line in figure.axes[0].lines} == {
        "--": [0.1, 0.2],
        ":": [0.3, 0.4],
    }
    assert {"left hemisphere", "right hemisphere"} <= set(words(figure))


def test_metrics_chart_refuses_a_table_without_its_metrics():
    with pytest.raises(InputError, match=r"no metric to draw.*spam"):
        metrics_chart(metric_rows("thin", "whole", "spam", {21.0: 1.0}, ""))


def test_many_runs_have_distinct_colours_and_a_legend_within_the_figure():
    runs = [f"thickness_{i}_with_a_long_name" for i in range(12)]
    figure = metrics_chart(
        pd.concat([metric_rows(run, "whole", "area", {21.0: 1.0, 22.0: 2.0}, "cm2") for run in runs])
    )
    (axes,) = figure.axes
    assert len({str(line.get_color()) for line in axes.lines}) == 12
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width


def test_steps_are_drawn_and_unusual_rungs_marked():
    count = 6
    steps = pd.DataFrame(
        {
            "week": 21 + np.arange(count) / 14,
            "newton": [2, 1, 1, 3, 1, 1],
            "krylov": [20, 10, 11, 60, 12, 12],
            "min_J": np.linspace(0.99, 0.7, count),
            "max_u_mm": 0.3,
            "mean_u_mm": 0.05,
            "rung": ["cg", "cg", "cg", "minres", "cg", "cg"],
            "elements_through_cortex": np.linspace(2.3, 1.7, count),
            "radius_ratio_01": np.linspace(0.4, 0.3, count),
            "seconds": np.arange(1.0, count + 1),
        }
    )
    figure = steps_chart(steps, order=1)
    newton, krylov, jacobian, displacement, through, quality, seconds = figure.axes
    assert newton.lines[0].get_ydata().tolist() == [2, 1, 1, 3, 1, 1]
    assert newton.lines[1].get_xydata().tolist() == [[steps["week"][3], 3]]
    assert newton.lines[1].get_label() == "rung: minres"
    assert krylov.lines[0].get_ydata().tolist() == steps["krylov"].tolist()
    assert jacobian.lines[0].get_ydata().min() == pytest.approx(0.7)
    assert [line.get_label() for line in displacement.lines] == ["max", "mean"]
    assert through.lines[0].get_ydata()[[0, -1]].tolist() == [2.3, 1.7]
    assert through.lines[1].get_ydata()[0] == 2.0
    assert steps_chart(steps, order=2).axes[4].lines[1].get_ydata()[0] == ELEMENTS_NEEDED[2]
    assert quality.lines[0].get_ydata()[-1] == 0.3
    assert seconds.lines[0].get_ydata().sum() == 21
    assert "(s)" in seconds.get_ylabel()


def test_quality_histogram_counts_every_element_once():
    quality = pd.DataFrame(
        {
            "radius_ratio": [0.05, 0.5, 0.9],
            "min_dihedral_deg": [3, 40, 60],
            "max_dihedral_deg": [90, 100, 170],
            "volume_mm3": [1e-3, 0.2, 1.0],
        }
    )
    gates = {"min_radius_ratio": 0.1, "min_dihedral_deg": 2.0, "max_dihedral_deg": 175.0, "min_volume_mm3": 1e-6}
    figure = quality_histogram(quality, gates=gates, surface="0 faces cross")
    for axes in figure.axes:
        assert axes.patches[0].get_data().values.sum() == 3
    lines = [[line.get_xdata()[0] for line in axes.lines] for axes in figure.axes]
    assert lines == [[0.1], [2.0], [175.0], []]
    assert figure.axes[3].get_title() == "0.001 to 1, limit 10$^{-6}$"
    assert "0 faces cross" in words(figure)


def test_quality_histogram_takes_ready_classes():
    classes = {"edges": [0.1, 0.5, 1.0], "counts": [1, 7]}
    columns = ("radius_ratio", "min_dihedral_deg", "max_dihedral_deg", "volume_mm3")
    figure = quality_histogram(dict.fromkeys(columns, classes))
    assert figure.axes[1].patches[0].get_data().values.tolist() == [1, 7]
    assert figure.axes[0].get_title() == "0.1 to 1"
    assert "of 8" in figure.axes[0].get_ylabel()


def test_spectra_bars_are_the_relative_powers_of_each_side():
    rows = [*spectrum_rows("thin", 28.0, {4: 0.2, 5: 0.3, 6: 0.1}), *spectrum_rows("real", 28.0, {4: 0.25, 5: 0.15})]
    spectra = pd.concat([*rows, *spectrum_rows("thin", 27.0, {4: 0.9})])
    left, right = spectra_chart(spectra, week=28.0).axes
    assert [bar.get_height() for bar in left.patches] == pytest.approx([0.2, 0.3, 0.1])
    assert [bar.get_height() for bar in right.patches] == pytest.approx([0.1, 0.15, 0.05])
    assert [line.get_xydata()[0].tolist() for line in left.lines] == [[0, 0.25], [1, 0.15]]
    assert not any(bar.get_hatch() for bar in left.patches)


def test_bands_that_are_cut_off_are_hatched_and_written_as_b6_too():
    rows = [*spectrum_rows("thin", 28.0, {5: 0.2}), *spectrum_rows("thin", 28.0, {6: 0.1}, complete=False)]
    spectra = pd.concat(rows)
    spectra["band"] = "B" + spectra["band"].astype(str)
    figure = spectra_chart(spectra, week=28.0)
    assert [bool(bar.get_hatch()) for bar in figure.axes[0].patches] == [False, True]
    assert any("cut off" in text for text in words(figure))


def hatches_and_open_stars(figure: Figure) -> tuple[bool, bool]:
    """Returns whether the legend of a figure has a hatched patch, and whether it has an open star."""
    handles = figure.legends[0].legend_handles
    patches = [handle for handle in handles if isinstance(handle, mpl.patches.Patch)]
    marks = [handle for handle in handles if isinstance(handle, mpl.lines.Line2D) and handle.get_marker() == "*"]
    hatched = any(patch.get_hatch() for patch in patches)
    return hatched, any(mark.get_markerfacecolor() == "white" for mark in marks)


@pytest.mark.parametrize(("run", "shown"), [("thin", (True, False)), ("real", (False, True))])
def test_the_legend_names_only_the_marks_that_are_drawn(run, shown):
    good = [*spectrum_rows("thin", 28.0, {4: 0.2}), *spectrum_rows("real", 28.0, {4: 0.2})]
    spectra = pd.concat([*good, *spectrum_rows(run, 28.0, {5: 0.1}, complete=False)])
    assert hatches_and_open_stars(spectra_chart(spectra, week=28.0)) == shown
    assert hatches_and_open_stars(spectra_chart(pd.concat(good), week=28.0)) == (False, False)
    assert hatches_and_open_stars(spectra_weeks_chart(spectra)) == (False, run == "real")


def test_bands_without_modes_are_said_to_be_beyond_them():
    rows = [*spectrum_rows("thin", 28.0, {4: 0.2}), *spectrum_rows("thin", 28.0, {6: np.nan}, complete=False)]
    figure = spectra_chart(pd.concat(rows), week=28.0, bands=(4, 6))
    said = [text for text in figure.axes[0].texts if "modes computed" in text.get_text()]
    assert [text.get_position()[0] for text in said] == [1]
    # nothing is drawn of it, so the legend has no mark for it
    assert hatches_and_open_stars(figure) == (False, False)


def test_spectra_chart_refuses_a_week_without_spectra():
    with pytest.raises(InputError, match=r"no spectrum at 30 GW; found \[28.0\]"):
        spectra_chart(pd.concat(spectrum_rows("thin", 28.0, {4: 0.2})), week=30.0)


def test_spectra_over_weeks_have_a_row_per_side_and_a_column_per_band():
    kinds = [("thin", 22.0), ("thin", 21.0), ("real", 22.0), ("real", 21.0)]
    rows = [frame for run, week in kinds for frame in spectrum_rows(run, week, {4: week / 100})]
    figure = spectra_weeks_chart(pd.concat(rows), bands=(4, 5))
    assert len(figure.axes) == 4
    assert figure.axes[0].lines[0].get_xydata().tolist() == [[21, 0.21], [22, 0.22]]
    assert figure.axes[2].lines[0].get_ydata().tolist() == pytest.approx([0.105, 0.11])
    assert {line.get_marker() for line in figure.axes[0].lines} == {"None", "o", "*"}
    assert all(axes.get_ylim()[0] == 0 and axes.get_ylim()[1] > 0.22 for axes in figure.axes)


def test_a_run_keeps_its_colour_in_charts_of_other_runs():
    rows = metric_rows("thick", "whole", "area", {21.0: 1.0, 22.0: 2.0}, "cm2")
    (axes,) = metrics_chart(rows, runs=["thin", "thick"]).axes
    assert axes.lines[0].get_color() == "#D55E00"
    spectra = pd.concat(spectrum_rows("thick", 28.0, {4: 0.2}))
    bars = spectra_chart(spectra, week=28.0, runs=["thin", "thick"]).axes[0].patches
    assert all(mpl.colors.same_color(bar.get_facecolor(), "#D55E00") for bar in bars)


def test_bars_are_keyed_as_bars_and_lines_as_lines():
    spectra = pd.concat([*spectrum_rows("thin", 28.0, {4: 0.2}), *spectrum_rows("thin", 27.0, {4: 0.2})])
    (bars,) = spectra_chart(spectra, week=28.0).legends[0].legend_handles
    (lines,) = spectra_weeks_chart(spectra).legends[0].legend_handles
    assert isinstance(bars, mpl.patches.Patch)
    assert isinstance(lines, mpl.lines.Line2D)
