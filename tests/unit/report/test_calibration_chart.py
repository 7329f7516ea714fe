"""The chart of a calibration shows runs, surrogate, optimum and sensitivities."""

import numpy as np
import pandas as pd

from gyriflow.report.calibration import calibration_chart

NAMES = ["thickness_mm", "growth_rate_per_s"]
RUNS = pd.DataFrame(
    {
        "thickness_mm": [1.0, 2.0, 3.0, 2.2],
        "growth_rate_per_s": [1e-7, 2e-7, 3e-7, 2.2e-7],
        "round": [0, 0, 0, 1],
        "score": [0.5, 0.2, np.nan, 0.1],
    }
)
OPTIMUM = pd.DataFrame({"parameter": NAMES, "value": [2.1, 2.1e-7], "low": [1.8, 1.9e-7], "high": [2.4, 2.3e-7]})
SENSITIVITIES = pd.DataFrame({"parameter": NAMES, "first_order": [0.2, 0.7], "total": [0.3, 0.8]})
PROFILES = pd.DataFrame(
    {
        "parameter": np.repeat(NAMES, 3),
        "value": [1.0, 2.0, 3.0, 1e-7, 2e-7, 3e-7],
        "mean": [0.5, 0.1, 0.4, 0.4, 0.1, 0.6],
        "sd": 0.02,
    }
)


def test_each_parameter_has_a_panel_and_all_share_one_of_sensitivities():
    figure = calibration_chart(RUNS, OPTIMUM, SENSITIVITIES, PROFILES, score="size")
    first, second, last = figure.axes
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "thickness (mm)",
        "growth rate (1/s)",
        "part of the variance",
    ]
    lines = {line.get_label(): line for line in first.get_lines()}
    np.testing.assert_array_equal(lines["round 0"].get_xdata(), [1.0, 2.0])
    np.testing.assert_array_equal(lines["round 1"].get_ydata(), [0.1])
    # a diverged run has no score: it stands at the worst of the others
    np.testing.assert_array_equal(lines["diverged"].get_xydata(), [[3.0, 0.5]])
    np.testing.assert_array_equal(lines["surrogate"].get_ydata(), [0.5, 0.1, 0.4])
    assert list(lines["optimum"].get_xdata()) == [2.1, 2.1]
    assert {line.get_label() for line in second.get_lines()} == set(lines)
    assert sorted(bar.get_width() for bar in last.patches) == [0.2, 0.3, 0.7, 0.8]
    figure.canvas.draw()
