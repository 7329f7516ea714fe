"""Predictions of later weeks: distance of a run, and of simple baselines, from the observed brain."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.alignment import align
from ..geometry.matching import crossing_faces
from ..geometry.triangles import Floats, Ints, TriangleMesh, area, edges, signed_volume, vertex_areas, vertex_normals
from ..quantities import COMPARED_MAPS
from .distances import bootstrap_distances, pairwise_distances, surface_distances
from .placement import (
    RESAMPLED,
    bootstrap_correlations,
    correlation,
    draw_patches,
    interpolate_measures,
    interval_of,
    make_patches,
)
from .shapes import PreparedSurface, cortex_dice, prepare_for_comparison, scale_to_volume


def simple_predictions(
    start: TriangleMesh, target: TriangleMesh, registered: Mapping[str, TriangleMesh], atlas: TriangleMesh | None
) -> dict[str, TriangleMesh]:
    """Predict a week without mechanics: closed surfaces in mm by model.

    Parameters
    ----------
    start
        The start brain; the model `scaled` is this brain with the volume of the target.
    target
        The surface that the run grows towards in this week, itself the model `target`.
    registered
        Further models on the boundary of the start's mesh, among them `atlas`, the atlas interpolated to this week.
    atlas
        The atlas' own surface of this week, if there is one; it then replaces the registered model `atlas`. Either is
        scaled to the volume of the target.
    """
    volume = signed_volume(target)
    atlas = registered["atlas"] if atlas is None else atlas
    models = {"scaled": scale_to_volume(start, volume), **registered}
    return models | {"atlas": scale_to_volume(atlas, volume), "target": target}


def prediction_table(
    labels: Mapping[str, Any],
    models: Mapping[float, Mapping[str, TriangleMesh]],
    observed: Mapping[float, TriangleMesh],
    prepared: Mapping[float, PreparedSurface],
    *,
    radius_mm: float,
) -> pd.DataFrame:
    """Compare the predictions of each week with the observed brain, and add their skill.

    Parameters
    ----------
    labels
        run, start (id of the start brain) and start_week.
    models
        By week and model the predicted closed surface in mm, that of the run as `run`.
    observed, prepared
        The observed pial surface of each week in mm, with its midline at x = 0, and the same prepared for comparison.
    radius_mm
        Radius of the fitted curvature.

    Returns
    -------
    DataFrame
        The labels, week, horizon (weeks since the start), model, the columns of `prediction_row`, skill with skill_low
        and skill_high of `add_skill`, and resampled.
    """
    rows = []
    for week, surfaces in models.items():
        patch, _ = make_patches(prepared[week], mirrored=True)
        horizon = round(week - labels["start_week"], 6)
        for model, surface in surfaces.items():
            predicted = prepare_for_comparison(surface, observed[week], radius_mm)
            row = prediction_row(surface, predicted, observed[week], prepared[week], patch)
            rows.append({**labels, "week": week, "horizon": horizon, "model": model, **row})
    return add_skill(pd.DataFrame(rows)).assign(resampled=RESAMPLED)


def prediction_row(
    predicted: TriangleMesh,
    predicted_prepared: PreparedSurface,
    observed: TriangleMesh,
    prepared: PreparedSurface,
    patch: Ints,
) -> dict[str, Any]:
    """Compare a predicted closed surface in mm with the observed one; `patch` (n,) is that of each prepared vertex.

    Returns
    -------
    dict
        `distances.surface_distances` and cortex_dice, aligned rigidly and not scaled; area_error and volume_error as
        fractions of the observed; r_… of each of `COMPARED_MAPS`; crossing_faces; roughness_ratio and
        curvature_rms_ratio to the observed surface; …_low and …_high, the 95 % intervals of distance_mm and
        r_shape_index by a bootstrap over patches; drawn_mm, the mean distance in each of `draw_patches`, for
        `add_skill`.
    """
    aligned = align(predicted, observed)
    pair, areas = pairwise_distances(aligned, observed, prepared.mesh), prepared.areas
    values, _ = interpolate_measures(predicted_prepared, prepared)
    drawn = draw_patches(patch)
    drawn_mm = bootstrap_distances(pair, prepared.mesh.vertices, patch, drawn)
    drawn_r = bootstrap_correlations(prepared.shape_index, values["shape_index"], areas, patch, drawn)
    row: dict[str, Any] = surface_distances(pair) | {
        "cortex_dice": cortex_dice(aligned, observed),
        "area_error": area(predicted) / area(observed) - 1,
        "volume_error": signed_volume(predicted) / signed_volume(observed) - 1,
        **{f"r_{name}": correlation(getattr(prepared, name), values[name], areas) for name in COMPARED_MAPS},
        "crossing_faces": float(crossing_faces(predicted)),
        "roughness_ratio": roughness_mm(predicted_prepared.mesh) / roughness_mm(prepared.mesh),
        "curvature_rms_ratio": predicted_prepared.curvature_rms / prepared.curvature_rms,
    }
    for name, draws in (("distance_mm", drawn_mm), ("r_shape_index", drawn_r)):
        _, row[f"{name}_low"], row[f"{name}_high"] = interval_of(draws)
    return row | {"drawn_mm": drawn_mm}


def roughness_mm(mesh: TriangleMesh) -> float:
    """Return the distance of the vertices from the mean of their neighbours along the normals, RMS by area, in mm.

    On surfaces with the same even triangles it measures wrinkles as small as a triangle.
    """
    first, second = edges(mesh)[0].T
    sums = np.zeros_like(mesh.vertices)
    np.add.at(sums, first, mesh.vertices[second])
    np.add.at(sums, second, mesh.vertices[first])
    count = np.bincount(np.concatenate([first, second]), minlength=len(sums))
    offsets: Floats = ((sums / count[:, None] - mesh.vertices) * vertex_normals(mesh)).sum(axis=1)
    return float(np.sqrt(np.average(offsets**2, weights=vertex_areas(mesh))))


def add_skill(rows: pd.DataFrame) -> pd.DataFrame:
    """Add skill = 1 − distance / distance of the best baseline of the week, with its 95 % interval.

    The best baseline is chosen anew in each bootstrap sample, so the interval includes the uncertainty of that choice.

    Parameters
    ----------
    rows
        Columns week, model and drawn_mm, which is dropped. All rows of a week have the same samples. Baselines are all
        models but `run`; without baselines, skill, skill_low and skill_high are NaN.
    """
    baselines = rows[rows["model"] != "run"]
    best = {week: np.min(list(drawn), axis=0) for week, drawn in baselines.groupby("week")["drawn_mm"]}
    skills = [
        interval_of(1 - drawn / best.get(week, np.nan))
        for week, drawn in zip(rows["week"], rows["drawn_mm"], strict=True)
    ]
    columns = dict(zip(("skill", "skill_low", "skill_high"), np.transpose(skills), strict=True))
    return rows.drop(columns="drawn_mm").assign(**columns)
