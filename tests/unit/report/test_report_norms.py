"""The chart of norms and the table of centiles."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from gyriflow.errors import InputError
from gyriflow.metrics.norms import measured_norms, measured_scores, norm_curves
from gyriflow.report.norms import centiles_table, norms_chart

WEEKS = np.arange(21.0, 31.0)
REFERENCE = [f"s{i}" for i in range(len(WEEKS))]
NOISE = np.array([0.5, -0.5, 0.2, -0.1, -0.4, 0.3, 0.3, -0.5, 0.4, -0.2])


@pytest.fixture(scope="module")
def metrics() -> pd.DataFrame:
    rows = [
        (name, "real", week, "whole", "area", 10 * week + noise, "cm2")
        for name, week, noise in zip(REFERENCE, WEEKS, NOISE, strict=True)
    ]
    rows += [("case", "real", 25.0, "whole", "area", 252.0, "cm2"), ("s0", "r", 24.0, "whole", "area", 240.0, "cm2")]
    return pd.DataFrame(rows, columns=["subject", "run", "week", "hemisphere", "metric", "value", "unit"])


def test_chart_shows_the_reference_the_band_and_the_others(metrics):
    curves = norm_curves(metrics, REFERENCE)
    figure = norms_chart(metrics, curves, measured_norms(metrics, REFERENCE), REFERENCE)
    axes = figure.axes[0]
    stars = {
        (float(x), float(y)): line.get_color()
        for line in axes.lines
        if line.get_marker() == "*"
        for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)
    }
    assert len(stars) == 11
    assert mpl.colors.same_color(stars[21.0, 210.5], "black")
    assert not mpl.colors.same_color(stars[25.0, 252.0], "black")
    band = axes.collections[0].get_paths()[0].vertices
    low, high = band[:, 1].min(), band[:, 1].max()
    assert low < 210 < 300 < high
    names = [text.get_text() for text in figure.legends[0].texts]
    assert "other measured brains" in names
    assert "90 % of further brains" in names


def test_the_band_holds_ninety_per_cent_of_further_brains():
    # of 400 draws of ten brains and one further brain, in the band of the ten
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(400):
        values = 10 * WEEKS + rng.normal(size=len(WEEKS))
        table = pd.DataFrame({"subject": REFERENCE, "run": "real", "week": WEEKS, "value": values})
        table = table.assign(hemisphere="whole", metric="area", unit="cm2")
        curve = norm_curves(table, REFERENCE, points=10).set_index("week").loc[25.0]
        inside += curve["low"] < 250 + rng.normal() < curve["high"]
    assert 0.86 < inside / 400 < 0.94


def test_table_of_centiles_says_of_how_many_brains(metrics):
    table = centiles_table(measured_scores(metrics, REFERENCE))
    case = table.loc[("case", "real", 25.0)]
    assert case["brains"] == 10
    assert case["of the week"] == 1
    assert case["note"] == "one brain a week"
    centile, z = case["pial area"].rstrip(")").split(" (")
    assert float(centile) > 95
    assert float(z) > 3
    # a brain of the reference is compared with the others
    assert table.loc[("s3", "real", 24.0), "brains"] == 9


def test_nothing_to_show_is_refused(metrics):
    with pytest.raises(InputError, match="no metric"):
        norms_chart(metrics.iloc[:0], pd.DataFrame(), pd.DataFrame(), REFERENCE)
