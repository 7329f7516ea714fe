"""Validation: simulated brains of later weeks compared with the observed brains, and with simple baselines."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.alignment import align
from ..geometry.triangles import TriangleMesh, area, area_cm2, signed_volume, volume_ml
from .distances import pairwise_distances, surface_distances
from .placement import score_placement
from .shapes import PreparedSurface, cortex_dice, curvature_differences, prepare_for_comparison


@dataclass(frozen=True, eq=False)
class ObservedWeek:
    """The observed brain of a week, and the baselines that a simulated one is compared with.

    Attributes
    ----------
    brain
        Id of the observed brain.
    surface
        Its closed pial surface in mm, as it is.
    prepared
        The same, prepared for comparison.
    start, adjacent
        The start brain, and the observed brain of the week before, prepared for comparison with it.
    """

    brain: str
    surface: TriangleMesh
    prepared: PreparedSurface
    start: PreparedSurface
    adjacent: PreparedSurface


def validation_table(
    labels: Mapping[str, Any],
    simulated: Mapping[float, TriangleMesh],
    observed: Mapping[float, ObservedWeek],
    sizes: Mapping[float, Mapping[str, float]],
    *,
    radius_mm: float,
) -> pd.DataFrame:
    """Compare the simulated brain of each week with the observed one: a row of `validation_row` per week.

    Parameters
    ----------
    labels
        run; kind ("explained" if growth was measured on the observed brains, else "predicted"); start (id of the start
        brain) and start_week.
    simulated
        Closed surfaces in mm by week, in the pose of the start.
    sizes
        By week, area_cm2 and volume_ml of the curves that the run followed; empty if it followed none.
    radius_mm
        Radius of the fitted curvature.
    """
    rows = []
    for week in sorted(simulated):
        brain = observed[week]
        prepared = prepare_for_comparison(simulated[week], brain.surface, radius_mm)
        row = {**labels, "week": week, "real": brain.brain, "horizon": week - labels["start_week"]}
        rows.append(row | validation_row(simulated[week], prepared, brain, sizes.get(week, {})))
    table = pd.DataFrame(rows)
    first = ["run", "kind", "start", "start_week", "week", "real", "horizon"]
    first += ["distance_mm", "distance95_mm", "cortex_dice"]
    return table[[*first, *table.columns.difference(first, sort=False)]]


def validation_row(
    simulated: TriangleMesh, prepared: PreparedSurface, observed: ObservedWeek, sizes: Mapping[str, float]
) -> dict[str, Any]:
    """Compare a simulated brain, as it is and `prepared`, with the observed one.

    Returns
    -------
    dict
        `distances.surface_distances` and cortex_dice of the surfaces as they are, aligned rigidly; area_cm2,
        volume_ml and relative_area (A/V^⅔), the same of the observed brain (real_…), and the sizes by the curves that
        the run followed (curve_…, NaN if none); area_error and volume_error against the curve, area_difference and
        volume_difference from the observed brain, as fractions; `placement.score_placement` and
        `shapes.curvature_differences`.
    """
    aligned = align(simulated, observed.surface)
    row: dict[str, Any] = {}
    row |= surface_distances(pairwise_distances(aligned, observed.surface, observed.prepared.mesh))
    row["cortex_dice"] = cortex_dice(aligned, observed.surface)
    row |= _sizes(simulated) | {f"real_{name}": size for name, size in _sizes(observed.surface).items()}
    for name in ("area_cm2", "volume_ml"):
        row[f"curve_{name}"] = sizes.get(name, np.nan)
        quantity, _ = name.split("_")
        row[f"{quantity}_error"] = row[name] / row[f"curve_{name}"] - 1
        row[f"{quantity}_difference"] = row[name] / row[f"real_{name}"] - 1
    row |= score_placement(prepared, observed.prepared, observed.start, observed.adjacent)
    return row | curvature_differences(prepared, observed.prepared)


def _sizes(mesh: TriangleMesh) -> dict[str, float]:
    relative_area = area(mesh) / signed_volume(mesh) ** (2 / 3)
    return {"area_cm2": area_cm2(mesh), "volume_ml": volume_ml(mesh), "relative_area": relative_area}
