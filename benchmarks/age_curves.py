"""Compares monotone curves by which ages are read from metrics: one JSON line.

    ./run python benchmarks/age_curves.py

Metrics that rise with age, straight, bent upwards, and levelling off, are given noise worth half a week, a whole one
and two of the mean slope, on nine weeks with a brain each. The age of a further brain, of each week between and with
the same noise, is read from the curve. Per kind of curve: RMS error in weeks (`error_gw`) over all, and seconds.

`spline`: `age_curve`, a monotone quadratic spline. `isotonic`: scikit-learn's isotonic regression, joined by straight
lines. `isotonic, pchip`: joined by SciPy's monotone cubics through the middles of its steps. `line`: least squares.
"""

import json
import time
from collections.abc import Callable

import numpy as np
from scipy.interpolate import PchipInterpolator
from sklearn.isotonic import IsotonicRegression

from gyriflow.metrics.age_curve import AgeCurve, age_curve, estimate_age

WEEKS = np.arange(21.0, 30.0)
SHAPES: dict[str, Callable] = {
    "straight": lambda week: week - 21.0,
    "upwards": lambda week: 8.0 * ((week - 21.0) / 8.0) ** 2,
    "levelling": lambda week: 8.0 * np.sqrt((week - 20.9) / 8.1),
}
NOISES = (0.5, 1.0, 2.0)
REPEATS = 60
GRID = np.linspace(WEEKS[0], WEEKS[-1], 801)


def isotonic(weeks: np.ndarray, values: np.ndarray) -> AgeCurve:
    fitted = IsotonicRegression().fit(weeks, values).predict(weeks)
    return AgeCurve(GRID, np.interp(GRID, weeks, fitted), 1.0)


def isotonic_pchip(weeks: np.ndarray, values: np.ndarray) -> AgeCurve:
    fitted = IsotonicRegression().fit(weeks, values).predict(weeks)
    levels, inverse = np.unique(fitted, return_inverse=True)
    middles = np.array([weeks[inverse == k].mean() for k in range(len(levels))])
    if len(levels) < 2:
        return AgeCurve(GRID, np.full(len(GRID), levels[0]), 1.0)
    curve = PchipInterpolator(middles, levels)(np.clip(GRID, middles[0], middles[-1]))
    return AgeCurve(GRID, np.maximum.accumulate(curve), 1.0)


def line(weeks: np.ndarray, values: np.ndarray) -> AgeCurve:
    slope, start = np.polyfit(weeks, values, 1)
    return AgeCurve(GRID, np.sign(slope) * (start + slope * GRID), float(np.sign(slope)))


CURVES = {"spline": age_curve, "isotonic": isotonic, "isotonic, pchip": isotonic_pchip, "line": line}


def main() -> None:
    result = {}
    for name, fit in CURVES.items():
        random, errors = np.random.default_rng(0), {shape: [] for shape in SHAPES}
        clock = time.perf_counter()
        for shape, metric in SHAPES.items():
            for noise in NOISES:
                for _ in range(REPEATS):
                    curve = fit(WEEKS, metric(WEEKS) + noise * random.standard_normal(len(WEEKS)))
                    for week in WEEKS[1:-1]:
                        value = float(metric(week) + noise * random.standard_normal())
                        errors[shape].append(estimate_age(curve, value, 0.0).week - week)
        every = np.concatenate(list(errors.values()))
        result[name] = {
            "error_gw": round(float(np.sqrt(np.mean(every**2))), 3),
            **{shape: round(float(np.sqrt(np.mean(np.square(found)))), 3) for shape, found in errors.items()},
            "seconds": round(time.perf_counter() - clock, 2),
        }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
