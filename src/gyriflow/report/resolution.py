"""How well the mesh of a run resolved the cortex, from the start to the end."""

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from ..parameters.terms import ELEMENTS_NEEDED
from .style import week_label


def resolution_over_steps(order: int, steps: pd.DataFrame) -> dict[str, float]:
    """Returns how well the steps of a run resolved the cortex, as the table of runs has it.

    Parameters
    ----------
    order
        Of the elements.
    steps : columns week, elements_through_cortex
        One row per step; no number where no element has its centre in the cortex, which counts as none.

    Returns
    -------
    dict
        `order`, `least_elements_through_cortex`, and `unresolved_from_week`, the first week with fewer elements than
        `ELEMENTS_NEEDED` (NaN: there is none).
    """
    through = steps["elements_through_cortex"].fillna(0.0)
    return {
        "order": order,
        "least_elements_through_cortex": float(through.min()),
        "unresolved_from_week": float(steps.loc[through < ELEMENTS_NEEDED[order], "week"].min()),
    }


def resolution_verdict(run: Mapping[str, Any] | pd.Series) -> str:
    """Returns what is to be said of a run whose mesh is too coarse, at the start or later; empty where it is not.

    Parameters
    ----------
    run : elements_through_cortex (before the first step), and what `resolution_over_steps` returns
    """
    needed = ELEMENTS_NEEDED[int(run["order"])]
    at_start, week = run["elements_through_cortex"], run["unresolved_from_week"]
    if not at_start >= needed:  # not a number: no element lies in the cortex
        return f"cortex not resolved ({at_start:.3g} elements through it, {needed:g} needed): folds are the mesh's"
    if math.isnan(week):
        return ""
    return (
        f"cortex not resolved from {week_label(round(week, 2))} on "
        f"(down to {run['least_elements_through_cortex']:.3g} elements through it, {needed:g} needed): "
        "folds may be the mesh's from then on"
    )
