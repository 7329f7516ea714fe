"""What a run that follows real brains is given: curves of its size, and maps of where growth is fast or slow."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError
from .curves import Curve, Fit, fitted, tabulated, value

Floats = NDArray[np.float64]

QUANTITIES = ("area_cm2", "volume_ml")
"""Sizes that growth follows, as columns of the table of areas."""
SPACING_GW = 0.25
"""Of the weeks that a run knows a curve at."""
SLOWEST, FASTEST = -1.0, 3.0
"""Bounds of local growth as a multiple of the whole brain's."""


def fits_of_series(areas: pd.DataFrame, *, may_shrink: bool = False) -> dict[str, dict[str, Fit]]:
    """Returns the curves through the measured sizes of each series of brains, by series and quantity.

    Parameters
    ----------
    areas
        Columns series, week, area_cm2, volume_ml; series of two weeks or more.
    """
    return {
        str(name): {
            quantity: fitted(brains["week"].tolist(), brains[quantity].tolist(), name=quantity, may_shrink=may_shrink)
            for quantity in QUANTITIES
        }
        for name, brains in areas.groupby("series", sort=False)
    }


def followed_sizes(
    follow: Mapping[str, Any], curves: pd.DataFrame | None, series: str | None, weeks: Sequence[float], shrink: bool
) -> dict[str, dict[float, float]]:
    """Returns the sizes that a run is to have, {quantity: {week: value}}, every quarter of a week.

    Parameters
    ----------
    follow
        The settings: for each quantity `measured`, or a table of values by week.
    curves
        Columns series, quantity, week, value of the curves through measured brains; needed where one is `measured`.
    series
        Name of the start brain's series.
    weeks
        Output weeks of the run.
    shrink
        Whether a given table may shrink.

    Raises
    ------
    InputError
        Where the start brain is in no series.
    """
    at = np.arange(weeks[0], weeks[-1] + 1e-9 + SPACING_GW, SPACING_GW)
    tables = {}
    for quantity in QUANTITIES:
        given = follow[quantity]
        if given == "measured":
            curve = _measured(curves, series, quantity)
        else:
            known = {float(week): number for week, number in given.items()}
            curve = tabulated(list(known), list(known.values()), name=quantity, may_shrink=shrink)
        sizes = value(curve, at)
        tables[quantity] = {round(float(week), 6): float(size) for week, size in zip(at, sizes, strict=True)}
    return tables


def curves_of_run(follow: Mapping[str, Any] | None, curves: pd.DataFrame | None, series: str | None) -> list[Curve]:
    """Returns the curves of `QUANTITIES` that a run followed, or those through the measured brains.

    There are none without either.

    Parameters
    ----------
    follow
        The sizes in the run's parameters; None where its growth was prescribed.
    curves, series
        As for `followed_sizes`.
    """
    if follow is not None:
        return [tabulated(list(follow[name]), list(follow[name].values()), may_shrink=True) for name in QUANTITIES]
    return [] if curves is None else [_measured(curves, series, name) for name in QUANTITIES]


def stretch_of_surface(curves: pd.DataFrame, series: str | None, week: float, end_week: float) -> float:
    """Returns by how much lengths on the measured brains' surface grow between two weeks, on average; at least 1.

    Parameters
    ----------
    curves, series
        As for `followed_sizes`.
    """
    first, last = value(_measured(curves, series, "area_cm2"), [week, end_week])
    return max(1.0, float(np.sqrt(last / first)))


def _measured(curves: pd.DataFrame | None, series: str | None, quantity: str) -> Curve:
    """Returns the curve through the measured brains of a series; InputError where there is none."""
    table = pd.DataFrame(columns=["series", "quantity", "week", "value"]) if curves is None else curves
    rows = table[(table["series"] == series) & (table["quantity"] == quantity)]
    if not len(rows):
        raise InputError(
            f"no measured curve of {quantity} can be followed",
            found="the start brain is in no series of brains of two weeks or more",
            remedy="List brains of other weeks, or give follow a table such as {area_cm2: {21: 99, 30: 252}}",
        )
    weeks, values = (rows[name].to_numpy(dtype=float) for name in ("week", "value"))
    return Curve(weeks, values, np.zeros(len(rows)))


def regional_map(week: float) -> str:
    """Returns the name of the map of relative growth from a week on."""
    return f"regional_growth_{week:05.2f}"


def relative_growth(rates: Floats, weights: Floats, amplitude: float) -> Floats:
    """Returns (w, n) local growth as a multiple of the whole's: 1 where all grows alike.

    Parameters
    ----------
    rates
        (w, n) local log growth per week in each interval.
    weights
        (n,) sizes that belong to the vertices.
    amplitude
        0 for uniform growth, 1 for differences as measured.

    Raises
    ------
    InputError
        Where the whole does not grow in an interval, so that there is nothing to be a multiple of.
    """
    whole = np.average(rates, axis=1, weights=weights)[:, None]
    if (whole <= 0).any():
        raise InputError(
            "the brain does not grow between two of the weeks, so that local growth has no measure",
            found=f"log growth per week {whole.ravel().round(3).tolist()}",
            remedy="Leave the brain that does not fit out of growth.brains, or set follow.regional to 0.",
        )
    return np.clip(1 + amplitude * (rates / whole - 1), SLOWEST, FASTEST)
