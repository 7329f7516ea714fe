"""Tables of simulated and predicted brains against observed ones, with the simplest predictions for comparison."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.triangles import Floats, TriangleMesh, signed_volume
from .comparison import ObservedBrain, compare
from .placement import with_interval
from .shapes import scale_to_volume

FIRST_COLUMNS = ["run", "kind", "start", "start_week", "week", "observed", "horizon", "model"]
"""The labels of a row of `comparison_table`."""


def simple_predictions(
    start: TriangleMesh, target: TriangleMesh, registered: Mapping[str, TriangleMesh], atlas: TriangleMesh | None
) -> dict[str, TriangleMesh]:
    """Predict a week without mechanics: closed surfaces in mm by model.

    The model `scaled` is the start brain with the volume of the target, `target` the surface that the run grows towards
    in this week. `registered` has further models on the boundary of the start's mesh, among them `atlas`, the atlas
    interpolated to this week; its own surface of this week, if there is one, replaces it. Either is scaled to the
    volume of the target.
    """
    volume = signed_volume(target)
    atlas = registered["atlas"] if atlas is None else atlas
    models = {"scaled": scale_to_volume(start, volume), **registered}
    return models | {"atlas": scale_to_volume(atlas, volume), "target": target}


def comparison_table(
    labels: Mapping[str, Any],
    models: Mapping[float, Mapping[str, TriangleMesh]],
    observed: Mapping[float, ObservedBrain],
    *,
    radius_mm: float,
) -> pd.DataFrame:
    """Compare the predicted surfaces of each week with the observed brain: a row per week and model.

    Labels are run; kind ("explained" if growth was measured on the observed brains, else "predicted"); start (id of the
    start brain) and start_week. Models are by week closed surfaces in mm, that of the run as `run`; all others are
    baselines. `radius_mm` is that of the fitted curvature.

    Columns are the labels, week, observed (id of the observed brain), horizon (weeks since the start), model, those of
    `compare`, and those of `model_columns` where there are baselines.
    """
    rows = []
    for week in sorted(models):
        brain = observed[week]
        found = {model: compare(surface, brain, radius_mm=radius_mm) for model, surface in models[week].items()}
        samples = {model: drawn for model, (_, drawn) in found.items()}
        scores = model_columns(samples) if len(found) > 1 else {"run": {}}
        place = {"week": week, "observed": brain.id, "horizon": round(week - labels["start_week"], 6)}
        rows += [{**labels, **place, "model": model, **row, **scores[model]} for model, (row, _) in found.items()]
    table = pd.DataFrame(rows)
    return table[[*FIRST_COLUMNS, *table.columns.difference(FIRST_COLUMNS, sort=False)]]


def model_columns(samples: Mapping[str, Mapping[str, Floats]]) -> dict[str, dict[str, float]]:
    """Compare the models of a week with each other, by the `samples` of `compare` of each.

    Columns by model: skill = 1 − distance / distance of the best baseline (chosen anew in each sample, so the interval
    includes the uncertainty of that choice); r_less_atlas and distance_less_atlas_mm, the differences of r of the shape
    index and of distance_mm from those of the model `atlas`, if there is one. All have 95 % intervals …_low and …_high,
    of paired samples.
    """
    best = np.min([drawn["distance_mm"] for model, drawn in samples.items() if model != "run"], axis=0)
    columns: dict[str, dict[str, float]] = {}
    for model, drawn in samples.items():
        columns[model] = with_interval("skill", 1 - drawn["distance_mm"] / best)
        if atlas := samples.get("atlas"):
            for name, key in (("r_less_atlas", "r_shape_index"), ("distance_less_atlas_mm", "distance_mm")):
                columns[model] |= with_interval(name, drawn[key] - atlas[key])
    return columns


def add_curves(table: pd.DataFrame, sizes: Mapping[float, Mapping[str, float]]) -> pd.DataFrame:
    """Add the sizes by the curves that a run followed, and how far the run is off them.

    `sizes` are area_cm2 and volume_ml by week, none of a run that followed no curve. Columns curve_area_cm2 and
    curve_volume_ml, area_off_curve and volume_off_curve (fractions of the curve's); NaN without a curve.
    """
    for name in ("area_cm2", "volume_ml"):
        curve = np.array([sizes.get(week, {}).get(name, np.nan) for week in table["week"]])
        columns = {f"curve_{name}": curve, f"{name.split('_')[0]}_off_curve": table[name] / curve - 1}
        table = table.join(pd.DataFrame(columns, index=table.index))
    return table
