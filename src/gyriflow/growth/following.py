"""What a run that follows real brains is given of their size: curves of area and volume."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError
from .curves import Curve, Fit, fitted, tabulated, value

QUANTITIES = ("area_cm2", "volume_ml")
"""Sizes that growth follows, as columns of the table of areas."""
THICKNESS, VENTRICLES = "thickness_mm", "ventricles_ml"
"""Columns of that table with the mean cortical thickness, and with the volume of the ventricles, where it is known."""
MORE = (THICKNESS, VENTRICLES)
"""What may be followed beside the sizes; both may shrink."""
SPACING_GW = 0.25
"""Of the weeks that a run knows a curve at."""


def fits_of_series(
    areas: pd.DataFrame, *, until: float | None = None, may_shrink: bool = False
) -> dict[str, dict[str, Fit]]:
    """Returns the curves through the measured sizes of each series of brains, by series and quantity.

    Areas have the columns series, week, area_cm2, volume_ml, and of `MORE` what is known; series of two weeks or more.
    Where brains of less than two weeks have a thickness or ventricles, no curve of these is fitted; they may shrink.
    `until` is the last week whose brains count; series that then have less than two weeks are left out.
    """
    if until is not None:
        areas = areas[areas["week"] <= until]
        areas = areas[areas.groupby("series")["week"].transform("nunique") > 1]
    fits: dict[str, dict[str, Fit]] = {}
    for name, brains in areas.groupby("series", sort=False):
        fits[str(name)] = {}
        for quantity in (*QUANTITIES, *(name for name in MORE if name in brains)):
            known = brains.dropna(subset=quantity)
            if quantity == VENTRICLES:
                known = known[known[quantity] > 0]
            if quantity in QUANTITIES or len(known["week"].unique()) > 1:
                shrink = may_shrink or quantity in MORE
                fits[str(name)][quantity] = fitted(
                    *known[["week", quantity]].to_numpy().T, name=quantity, may_shrink=shrink
                )
    return fits


def followed_sizes(
    follow: Mapping[str, Any], curves: pd.DataFrame | None, series: str | None, weeks: Sequence[float], shrink: bool
) -> dict[str, dict[float, float]]:
    """Returns the sizes that a run is to have, {quantity: {week: value}}, every quarter of a week; `MORE` if given.

    Parameters
    ----------
    follow
        The settings: for each quantity `measured`, or a table of values by week.
    curves
        Columns series, known_until_gw (NaN for curves through all weeks), quantity, week, value of the curves through
        measured brains; needed where one is `measured`.
    series
        That of the start brain; InputError where it is in none.
    weeks
        Output weeks of the run.
    shrink
        Whether a given table may shrink.
    """
    at = np.arange(weeks[0], weeks[-1] + 1e-9 + SPACING_GW, SPACING_GW)
    tables = {}
    for quantity in (*QUANTITIES, *(name for name in MORE if follow.get(name) is not None)):
        given = follow[quantity]
        if given == "measured":
            curve = _measured(curves, series, quantity, follow["known_until_gw"])
        else:
            known = {float(week): number for week, number in given.items()}
            curve = tabulated(list(known), list(known.values()), name=quantity, may_shrink=shrink or quantity in MORE)
        sizes = value(curve, at)
        tables[quantity] = {round(float(week), 6): float(size) for week, size in zip(at, sizes, strict=True)}
    return tables


def curves_of_run(follow: Mapping[str, Any] | None, curves: pd.DataFrame | None, series: str | None) -> list[Curve]:
    """Returns the curves of `QUANTITIES` that a run followed, or those through the measured brains.

    There are none without either. `follow` holds the sizes in the run's parameters; None where growth was prescribed.
    """
    if follow is not None:
        return [tabulated(list(follow[name]), list(follow[name].values()), may_shrink=True) for name in QUANTITIES]
    return [] if curves is None else [_measured(curves, series, name) for name in QUANTITIES]


def _measured(curves: pd.DataFrame | None, series: str | None, quantity: str, until: float | None = None) -> Curve:
    """Returns the curve through the measured brains of a series up to a week; InputError where there is none."""
    columns = ["series", "known_until_gw", "quantity", "week", "value"]
    table = pd.DataFrame(columns=columns) if curves is None else curves
    known = table["known_until_gw"].isna() if until is None else table["known_until_gw"] == until
    rows = table[known & (table["series"] == series) & (table["quantity"] == quantity)]
    if not len(rows):
        remedy = "List brains of other weeks, or give follow a table such as {area_cm2: {21: 99, 30: 252}}"
        weeks_known = "two weeks or more" + ("" if until is None else f" up to {until:g} GW")
        in_series = (known & (table["series"] == series)).any()
        if quantity == VENTRICLES and in_series:
            found = f"the labels of its brains do not know ventricles in {weeks_known}"
            remedy = "Set follow.ventricles_ml to null, or give it a table such as {21: 3, 30: 6}"
        elif quantity == THICKNESS and in_series:
            found = f"its brains have no {quantity} in {weeks_known}"
        else:
            found = f"the start brain is in no series of brains of {weeks_known}"
        raise InputError(f"no measured curve of {quantity} can be followed", found=found, remedy=remedy)
    weeks, values = (rows[name].to_numpy(dtype=float) for name in ("week", "value"))
    return Curve(weeks, values, np.zeros(len(rows)))
