"""The tables of a study's validation: a row per run and week, and what they say in short."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd

from ..errors import InputError
from ..geometry.triangles import TriangleMesh, area, signed_volume
from ..units import CM2_PER_MM2, ML_PER_MM3
from .folds import against_real, fold_measures
from .horizon import by_kind
from .placement import MEASURES, SKILLED_FROM, placement
from .shapes import Shape

Kind = Literal["explained", "predicted"]
"""Whether growth came from the weeks that are compared, or from another brain, atlas or only earlier weeks."""


@dataclass(frozen=True)
class Comparison:
    """Which simulated brain is compared.

    Attributes
    ----------
    run
        Name of the run.
    kind
        explained or predicted.
    start_week, week
        Gestational weeks that the run began at, and that is compared.
    seed
        Of the noise of the run's start, and of the bootstrap.
    """

    run: str
    kind: Kind
    start_week: float
    week: float
    seed: int = 0

    @property
    def horizon(self) -> float:
        """Weeks from the start to the one compared."""
        return self.week - self.start_week


def validation_row(
    comparison: Comparison,
    *,
    simulated: TriangleMesh,
    real_brain: TriangleMesh,
    curve: tuple[float, float] | None,
    run: Shape,
    real: Shape,
    start: Shape,
    adjacent: Shape | None,
) -> dict[str, Any]:
    """Returns a row of validation.csv.

    Columns: run, kind, start_week, week, horizon, seed; area_cm2, volume_ml and the same with real_ and curve_ in
    front; area_error and volume_error against the curve and area_difference and volume_difference from the real brain,
    as fractions; relative_area, real_relative_area (A/V^⅔ as they are, before remeshing); those of
    `placement.placement`, `folds.against_real` and `folds.fold_measures`, the latter for the real brain with real_ in
    front.

    Parameters
    ----------
    simulated, real_brain
        Closed surfaces in mm as they are.
    curve
        Area (mm²) and volume (mm³) that the run was to follow in this week; None where it followed none.
    run, real, start, adjacent
        Shapes that are ready and laid onto the real brain, as for `placement`.
    """
    sizes = {"": _sizes(simulated), "real_": _sizes(real_brain)}
    wanted = (np.nan, np.nan) if curve is None else (curve[0] * CM2_PER_MM2, curve[1] * ML_PER_MM3)
    row: dict[str, Any] = {
        "run": comparison.run,
        "kind": comparison.kind,
        "start_week": comparison.start_week,
        "week": comparison.week,
        "horizon": comparison.horizon,
        "seed": comparison.seed,
    }
    row |= {f"{who}{name}": value for who, size in sizes.items() for name, value in size.items()}
    row |= {"curve_area_cm2": wanted[0], "curve_volume_ml": wanted[1]}
    for name, unit, aim in (("area", "cm2", wanted[0]), ("volume", "ml", wanted[1])):
        row[f"{name}_error"] = row[f"{name}_{unit}"] / aim - 1
        row[f"{name}_difference"] = row[f"{name}_{unit}"] / row[f"real_{name}_{unit}"] - 1
    row |= placement(real, run, start, adjacent, horizon=comparison.horizon, seed=comparison.seed)
    row |= against_real(run, real)
    measures = {"": fold_measures(run), "real_": fold_measures(real)}
    # relative area is that of the surfaces as they are
    return {f"{who}{name}": value for who, found in measures.items() for name, value in found.items()} | row


def ordered(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Returns rows of `validation_row` as a table, what is compared first, by run, start, seed and week."""
    first = ["run", "kind", "start_week", "week", "horizon", "seed"]
    table = pd.DataFrame(rows)
    return table[[*first, *table.columns.difference(first, sort=False)]].sort_values(
        ["run", "start_week", "seed", "week"], ignore_index=True
    )


def summary(validation: pd.DataFrame, displacement: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Returns what the tables say of each run, by its name.

    Parameters
    ----------
    validation
        Rows of `validation_row`.
    displacement
        Rows of `displacement.displacement_table` with the columns run, start_week and seed; may be empty.

    Returns
    -------
    dict
        For each run: kind; worst_area_error and worst_volume_error (largest fractions against the curve, of all weeks);
        skill_shape_index, skill_mean_curvature, curvature_rms_ratio, last_week (the last week compared, means over
        seeds and starts); displacement_r, displacement_slope (of the last interval up to that week);
        skill_by_horizon for each measure, {weeks since the start: mean}, with the gain r − r(start) at horizon 1, where
        there is no skill; gain_by_horizon; horizon, the same by kind, so that explained and predicted weeks of several
        starts are not mixed (`horizon.by_kind`). None where there is no number.

    InputError where a column is missing.
    """
    _require(validation, ["run", "kind", "week", "horizon", "area_error", *_of_measures("skill", "gain")], "validation")
    if len(displacement):
        _require(displacement, ["run", "to_week", "displacement_r", "displacement_slope"], "displacement")
    found = {}
    for name, rows in validation.groupby("run", sort=False):
        last_week = rows["week"].max()
        last = rows[rows["week"] == last_week]
        moves = displacement[displacement["run"] == name] if len(displacement) else displacement
        final = moves[moves["to_week"] == moves["to_week"].max()] if len(moves) else None
        run: dict[str, Any] = {
            "kind": str(rows["kind"].iloc[0]),
            "last_week": float(last_week),
            "worst_area_error": _number(rows["area_error"].abs().max()),
            "worst_volume_error": _number(rows["volume_error"].abs().max()),
        }
        run |= {column: _number(last[column].mean()) for column in [*_of_measures("skill"), "curvature_rms_ratio"]}
        for column in ("displacement_r", "displacement_slope"):
            run[column] = None if final is None else _number(final[column].mean())
        skills, gains = ({m: _by_horizon(rows, f"{kind}_{m}") for m in MEASURES} for kind in ("skill", "gain"))
        for measure, by_horizon in skills.items():
            by_horizon |= {horizon: gain for horizon, gain in gains[measure].items() if float(horizon) <= SKILLED_FROM}
        run |= {"skill_by_horizon": skills, "gain_by_horizon": gains, "horizon": by_kind(rows)}
        found[str(name)] = run
    return found


def _sizes(mesh: TriangleMesh) -> dict[str, float]:
    surface, volume = area(mesh), signed_volume(mesh)
    return {
        "area_cm2": surface * CM2_PER_MM2,
        "volume_ml": volume * ML_PER_MM3,
        "relative_area": surface / volume ** (2 / 3),
    }


def _of_measures(*prefixes: str) -> list[str]:
    return [f"{prefix}_{measure}" for prefix in prefixes for measure in MEASURES]


def _by_horizon(rows: pd.DataFrame, column: str) -> dict[str, float | None]:
    return {f"{horizon:g}": _number(value) for horizon, value in rows.groupby("horizon")[column].mean().items()}


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _require(table: pd.DataFrame, columns: list[str], name: str) -> None:
    missing = [column for column in columns if column not in table.columns]
    if missing:
        raise InputError(
            f"the {name} table lacks columns",
            found=", ".join(map(str, table.columns)),
            expected=", ".join(missing),
            remedy="It was written by another version: make it again.",
        )
