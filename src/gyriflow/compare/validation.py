"""What a study's simulations are worth, a row per run and week, and how their surfaces move beside the real brain's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError
from ..geometry.alignment import align, rigid_fit, without_rigid_motion
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    area,
    face_components,
    signed_volume,
    vertex_areas,
)
from ..units import CM2_PER_MM2, ML_PER_MM3
from .distances import pairwise_distances, surface_distances
from .placement import placement
from .shapes import PreparedSurface, cortex_dice, curvature_differences


def validation_row(
    labels: Mapping[str, Any],
    *,
    simulated: TriangleMesh,
    real_brain: TriangleMesh,
    aims: Mapping[str, float],
    run: PreparedSurface,
    real: PreparedSurface,
    start: PreparedSurface,
    adjacent: PreparedSurface,
) -> dict[str, Any]:
    """Return a row of validation.csv.

    Columns: the labels, horizon (weeks since the start); those of `distances.surface_distances` and `cortex_dice`, of
    the surfaces as they are, aligned rigidly; area_cm2, volume_ml and the same with real_ and curve_ in front;
    area_error and volume_error against the curve and area_difference and volume_difference from the real brain, as
    fractions; relative_area, real_relative_area (A/V^⅔ as they are, before remeshing); those of `placement.placement`
    and `shapes.curvature_differences`.

    The labels are run, kind ("explained" where growth came from the weeks that are compared, "predicted" where
    from another brain, atlas or only earlier weeks), start and real (ids of the brains), start_week and week.
    `simulated` and `real_brain` are closed surfaces in mm as they are; `aims` the area_cm2 and volume_ml that
    the run was to have in this week, if any; the shapes are ready and laid onto the real brain, as for
    `placement`.
    """
    horizon = labels["week"] - labels["start_week"]
    aligned = align(simulated, real_brain)
    row: dict[str, Any] = dict(labels) | {"horizon": horizon}
    row |= surface_distances(pairwise_distances(aligned, real_brain, real.mesh))
    row["cortex_dice"] = cortex_dice(aligned, real_brain)
    row |= _sizes(simulated) | {f"real_{name}": size for name, size in _sizes(real_brain).items()}
    for name in ("area_cm2", "volume_ml"):
        row[f"curve_{name}"] = aims.get(name, np.nan)
        quantity, _ = name.split("_")
        row[f"{quantity}_error"] = row[name] / row[f"curve_{name}"] - 1
        row[f"{quantity}_difference"] = row[name] / row[f"real_{name}"] - 1
    row |= placement(real, run, start, adjacent, horizon=horizon)
    return row | curvature_differences(run, real)


def ordered(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Make a table of rows of `validation_row`, what is compared first, by run, start and week."""
    first = ["run", "kind", "start", "start_week", "week", "real", "horizon"]
    first += ["distance_mm", "distance95_mm", "cortex_dice"]
    table = pd.DataFrame(rows).sort_values(["run", "start_week", "week"], ignore_index=True)
    return table[[*first, *table.columns.difference(first, sort=False)]]


def _sizes(mesh: TriangleMesh) -> dict[str, float]:
    surface, volume = area(mesh), signed_volume(mesh)
    return {
        "area_cm2": surface * CM2_PER_MM2,
        "volume_ml": volume * ML_PER_MM3,
        "relative_area": surface / volume ** (2 / 3),
    }


def vector_agreement(one: Floats, measured: Floats, weights: Floats) -> tuple[float, float]:
    """Return correlation and slope of (n, 3) vectors against measured ones.

    r = Σ w u·v/√(Σ w u² Σ w v²) and slope Σ w u·v/Σ w v²: 1 and 1 where they are equal. NaN where nothing moves.
    """
    product, square, measured_square = (
        float(weights @ (u * v).sum(axis=1)) for u, v in ((one, measured), (one, one), (measured, measured))
    )
    if square <= 0 or measured_square <= 0:
        return float("nan"), float("nan")
    return product / np.sqrt(square * measured_square), product / measured_square


def displacement_table(
    weeks: Sequence[float], simulated: Floats, measured: Floats, faces: Ints, *, registered: bool = False
) -> pd.DataFrame:
    """Tell how the displacement of the pial vertices agrees with the measured one, a row per interval of weeks.

    The rigid part of each interval is removed from both, and the simulated vectors are turned as the simulated brain
    lies to the measured one. Beside it stands uniform scaling: all vertices of the measured surface moved away from its
    centroid so that the volume grows as measured. All this is done piece by piece where the surface has several:
    nothing joins hemispheres that are bodies of their own, so that growth does not say how they lie to each other.

    Weeks ascend; simulated and measured are (w, n, 3) positions in mm of the same vertices, of the run and carried
    along the registration; faces the (m, 3) triangles. Growth that came from that very registration (`registered`)
    tests the solver's consistency, not the model.

    Returns
    -------
    DataFrame
        from_week, to_week, test (consistency or comparison), displacement_r, displacement_slope,
        displacement_r_scaling, displacement_slope_scaling, rms_mm, measured_rms_mm (root mean square by area, of the
        interval).
    """
    if len(weeks) < 2:
        raise InputError(
            "no displacement to compare", found=f"{len(weeks)} weeks that both have", expected="two or more weeks"
        )
    component = face_components(TriangleMesh(measured[0], faces))
    pieces = [np.unique(faces[component == number]) for number in range(component.max() + 1)]
    rows = []
    for number in range(len(weeks) - 1):
        shape, later = (TriangleMesh(measured[index], faces) for index in (number, number + 1))
        weights = vertex_areas(shape)
        scale = np.cbrt(signed_volume(later) / signed_volume(shape)) - 1
        moved, moved_really, scaled = (np.zeros_like(shape.vertices) for _ in range(3))
        for piece in pieces:
            first, then = simulated[number : number + 2, piece]
            real_first, real_then = measured[number : number + 2, piece]
            by_area = weights[piece]
            turn = rigid_fit(first, real_first, by_area)[:3, :3]
            moved[piece] = without_rigid_motion(first, then, by_area) @ turn.T
            moved_really[piece] = without_rigid_motion(real_first, real_then, by_area)
            scaled[piece] = scale * (real_first - np.average(real_first, axis=0, weights=by_area))
        row: dict[str, Any] = {"from_week": weeks[number], "to_week": weeks[number + 1]}
        row["test"] = "consistency" if registered else "comparison"
        for end, vectors in (("", moved), ("_scaling", scaled)):
            agreement = vector_agreement(vectors, moved_really, weights)
            row[f"displacement_r{end}"], row[f"displacement_slope{end}"] = agreement
        for name, vectors in (("rms_mm", moved), ("measured_rms_mm", moved_really)):
            row[name] = float(np.sqrt(np.average((vectors**2).sum(axis=1), weights=weights)))
        rows.append(row)
    return pd.DataFrame(rows)
