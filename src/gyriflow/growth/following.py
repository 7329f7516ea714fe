"""Curves of area, volume and cortical thickness through series of brains, and those that a run follows."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError
from ..settings.folding import target_map
from ..settings.growth import SIZES
from .curves import Curve, CurveFit, fitted, tabulated, value

THICKNESS = "thickness_mm"
"""Column of the table of areas with the mean cortical thickness, if known. Thickness may decrease."""
SPACING_GW = 0.25
"""Spacing of the weeks at which a run stores a curve."""


def fits_of_series(areas: pd.DataFrame) -> dict[str, dict[str, CurveFit]]:
    """Fit curves to the measured sizes of each series of brains; return them by series and quantity.

    `areas` has the columns series, week, area_cm2, volume_ml and, if known, `THICKNESS`; each series has two weeks or
    more. A curve of thickness needs brains of two weeks with a thickness.
    """
    fits: dict[str, dict[str, CurveFit]] = {}
    for name, brains in areas.groupby("series", sort=False):
        fits[str(name)] = {}
        for quantity in (*SIZES, *([THICKNESS] if THICKNESS in brains else [])):
            complete = brains.dropna(subset=quantity)
            if quantity in SIZES or len(complete["week"].unique()) > 1:
                fits[str(name)][quantity] = fitted(
                    *complete[["week", quantity]].to_numpy().T, name=quantity, may_shrink=quantity == THICKNESS
                )
    return fits


def followed_sizes(
    growth: Mapping[str, Any], curves: pd.DataFrame | None, series: str | None, weeks: Sequence[float], shrink: bool
) -> dict[str, dict[float, float]]:
    """Return the sizes that a run follows, {quantity: {week: value}}, every quarter of a week.

    For each of `SIZES` and the thickness that the run follows, `growth` has `measured` or a table of values by week,
    which may decrease if `shrink`. `curves`, with the columns series, quantity, week and value, are needed for
    `measured`; InputError if the start brain's `series` is not in them. `weeks` are the output weeks of the run.
    """
    at = np.arange(weeks[0], weeks[-1] + 1e-9 + SPACING_GW, SPACING_GW)
    tables = {}
    for quantity in [name for name in (*SIZES, THICKNESS) if growth.get(name) is not None]:
        source = growth[quantity]
        if source == "measured":
            curve = _measured_curve(curves, series, quantity)
        else:
            by_week = {float(week): number for week, number in source.items()}
            shrinks = shrink or quantity == THICKNESS
            curve = tabulated(list(by_week), list(by_week.values()), name=quantity, may_shrink=shrinks)
        sizes = value(curve, at)
        tables[quantity] = {round(float(week), 6): float(size) for week, size in zip(at, sizes, strict=True)}
    return tables


def run_parameters(
    settings: Mapping[str, Any],
    weeks: Sequence[float],
    surface: Mapping[str, Any],
    target_sizes: Mapping[str, Mapping[float, float]],
    stops: Sequence[float],
    curves: pd.DataFrame | None,
    series: str | None,
) -> dict[str, Any]:
    """Return the parameters of a run as its `params.yaml` has them, with measured sizes as numbers by week.

    `settings` are its own, `weeks` its output weeks, `surface` is the report of the start brain's surface, and
    `target_sizes` are those of the shapes that it grows towards, by week, the start first; empty where there are none.
    `stops` are those of the weeks without an observed brain. Curves and series are as for `followed_sizes`.
    """
    growth = {**settings["growth"], **target_sizes}
    targets = list(next(iter(target_sizes.values()), ()))[1:]
    shapes = {"targets": {week: target_map(week) for week in targets}, "stops": list(stops)} if target_sizes else {}
    sizes = followed_sizes(growth, curves, series, weeks, shrink=bool(target_sizes))
    thickness = {THICKNESS: {"weeks": sizes[THICKNESS]}} if THICKNESS in sizes else {}
    start = {"start_week": weeks[0], "output_weeks": list(weeks), "fissure_x_mm": surface["fissure_x_mm"]}
    return {**start, "side": surface.get("side"), **settings, **shapes, "growth": growth | sizes, **thickness}


def sizes_on_curves(
    growth: Mapping[str, Any], curves: pd.DataFrame | None, series: str | None, weeks: Sequence[float]
) -> dict[float, dict[str, float]]:
    """Return by week the `SIZES` that a run should have had, or those of the observed brains; empty if unknown.

    `growth` is the section of the run's parameters, with tables of the sizes if it followed any. `curves` has the
    columns series, quantity, week and value; InputError where it is given without the start brain's `series`.
    """
    if SIZES[0] in growth:
        found = [tabulated(list(growth[name]), list(growth[name].values()), may_shrink=True) for name in SIZES]
    elif curves is not None:
        found = [_measured_curve(curves, series, name) for name in SIZES]
    else:
        found = []
    by_name = dict(zip(SIZES, found, strict=False))
    return {week: {name: float(value(curve, week)) for name, curve in by_name.items()} for week in weeks}


def _measured_curve(curves: pd.DataFrame | None, series: str | None, quantity: str) -> Curve:
    table = pd.DataFrame(columns=["series", "quantity", "week", "value"]) if curves is None else curves
    series_rows = table[table["series"] == series]
    rows = series_rows[series_rows["quantity"] == quantity]
    if not len(rows):
        reason = (
            f"its brains have no {quantity} in two weeks or more"
            if len(series_rows)
            else "the start brain is in no series of brains of two weeks or more"
        )
        remedy = "List brains of other weeks, or give growth a table such as {area_cm2: {21: 99, 30: 252}}"
        raise InputError(f"no measured curve of {quantity} to follow", found=reason, remedy=remedy)
    weeks, values = (rows[name].to_numpy(dtype=float) for name in ("week", "value"))
    return Curve(weeks, values, np.zeros(len(rows)))
