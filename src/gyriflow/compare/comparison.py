"""Comparison of predicted surfaces with observed brains: rows with all columns, and
tables with simple predictions."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import igl
import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from ..geometry.alignment import align
from ..geometry.matching import (
    faces_that_cross,
    nearest_on,
    surface_distance,
    values_at,
)
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    area_cm2,
    vertex_areas,
    vertex_normals,
    volume_ml,
)
from ..quantities import COMPARED_MAPS
from ..settings.terms import CURVATURE_RADIUS_MM
from .placement import (
    PATCH_EDGE_MM,
    RESAMPLED,
    Resampling,
    correlation,
    draw_units,
    gain_columns,
    make_resampling,
    number_patches,
    with_interval,
)
from .shapes import (
    PreparedSurface,
    cortex_dice,
    curvature_differences,
    interpolate_measures,
    prepare_for_comparison,
    scale_to_volume,
)

type VertexDistances = tuple[TriangleMesh, Floats]
"""A surface, and the (n,) distances of its vertices from another one in mm."""
type Group = Literal["size", "distance", "folds", "quality", "intervals"]
GROUPS: tuple[Group, ...] = ("size", "distance", "folds", "quality", "intervals")
"""Groups of columns of `compare`. Columns of the others are computed alike if some are
left out."""
FIRST_COLUMNS = [
    "run",
    "kind",
    "start",
    "start_week",
    "week",
    "observed",
    "horizon",
    "model",
]
"""The labels of a row of `comparison_table`."""


@dataclass(frozen=True, eq=False)
class ObservedBrain:
    """An observed brain that predicted surfaces are compared with.

    `surface` is its closed pial surface in mm as it is, `prepared` the same prepared
    for comparison. `baselines` are `COMPARED_MAPS` of other brains, interpolated at the
    (n,) vertices of `prepared`, which are needed for the intervals: of `start`, the
    start brain scaled to its volume, which has no new folds, and of `adjacent`, the
    observed brain of the week before.
    """

    id: str
    surface: TriangleMesh
    prepared: PreparedSurface
    baselines: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)

    @cached_property
    def resampling(self) -> Resampling:
        """The modes and patches of the surface that are drawn in bootstraps."""
        return make_resampling(self.prepared)

    @cached_property
    def patch(self) -> tuple[Ints, Floats]:
        """The (n,) patch of each vertex for bootstraps of distances, and how often each
        patch is drawn.

        If the brain is symmetric, a patch and its mirror image have the same number.
        """
        points = self.prepared.mesh.vertices
        if self.resampling.is_symmetric:
            left, right = (values_at(side, points) for side in self.resampling.sides)
            on_left = number_patches(left, self.resampling.side_areas, PATCH_EDGE_MM)
            nearest = cKDTree(np.concatenate([left, right])).query(points)[1]
            numbers = np.tile(on_left, 2)[nearest]
        else:
            numbers = number_patches(points, self.prepared.areas, PATCH_EDGE_MM)
        return numbers, draw_units([int(numbers.max()) + 1])

    @cached_property
    def _baseline_correlations(self) -> dict[tuple[str, str], Floats]:
        """The correlation of each baseline and map, and that in each bootstrap
        sample."""
        found = {}
        for name, measures in self.baselines.items():
            for measure, values in measures.items():
                own = getattr(self.prepared, measure)
                found[name, measure] = self.resampling.correlations(own, values)
        return found


def observed_brain(
    name: str,
    surface: TriangleMesh,
    radius_mm: float,
) -> ObservedBrain:
    """Prepare a closed surface in mm as an observed brain without baselines."""
    return ObservedBrain(
        name, surface, prepare_for_comparison(surface, surface, radius_mm)
    )


def compare(
    predicted: TriangleMesh,
    observed: ObservedBrain,
    *,
    radius_mm: float = CURVATURE_RADIUS_MM,
    groups: Collection[Group] = GROUPS,
) -> tuple[dict[str, Any], dict[str, Floats]]:
    """Compare a predicted closed surface in mm with the observed brain.

    `radius_mm` is that of the fitted curvature. Sizes and distances are of the surfaces
    as they are, aligned rigidly; folds are compared after scaling to the observed
    volume.

    Returns a row with the columns of each group, and with intervals the bootstrap
    samples of distance_mm and r_… after their values, (1 + N_DRAWS,) each, drawn alike
    for all surfaces that are compared with this observed brain.

    - size: area_cm2, volume_ml, relative_area (A/V^⅔), the same of the observed brain
      (observed_…), and area_difference and volume_difference from it, as fractions of
      its own;
    - distance: `surface_distances` and cortex_dice;
    - folds: r_… of each of `COMPARED_MAPS`, matched_share (share of the observed area
      with a matching point) and `shapes.curvature_differences`;
    - quality: crossing_faces, and roughness_ratio to the observed surface;
    - intervals: distance_mm_low and …_high, and with baselines `placement.gain_columns`
      of each map (gain_…, gain_low_…); asymmetry_mm of the observed brain, is_symmetric
      and resampled.
    """
    row: dict[str, Any] = {}
    samples: dict[str, Floats] = {}
    if "size" in groups:
        row |= size_columns(predicted, observed.surface)
    if {"distance", "intervals"} & set(groups):
        aligned = align(predicted, observed.surface)
        pair = _pairwise_distances(aligned, observed.surface, observed.prepared.mesh)
        if "distance" in groups:
            row |= surface_distances(pair) | {
                "cortex_dice": cortex_dice(aligned, observed.surface)
            }
        if "intervals" in groups:
            samples["distance_mm"] = bootstrap_distances(
                pair, observed.prepared.mesh.vertices, *observed.patch
            )
            row |= with_interval("distance_mm", samples["distance_mm"])
    if set(groups) <= {"size", "distance"}:
        return row, samples
    prepared = prepare_for_comparison(predicted, observed.surface, radius_mm)
    if "quality" in groups:
        row["crossing_faces"] = float(len(faces_that_cross(predicted)))
        row["roughness_ratio"] = roughness_mm(prepared.mesh) / roughness_mm(
            observed.prepared.mesh
        )
    return row | _fold_columns(prepared, observed, samples, groups), samples


def _fold_columns(
    prepared: PreparedSurface,
    observed: ObservedBrain,
    samples: dict[str, Floats],
    groups: Collection[Group],
) -> dict[str, Any]:
    """Return the columns of folds and of their intervals of a surface that is prepared
    for comparison."""
    values, matched_share = interpolate_measures(prepared, observed.prepared)
    row: dict[str, Any] = {}
    if "folds" in groups:
        row = {"matched_share": matched_share} | curvature_differences(
            prepared, observed.prepared
        )
        for name in COMPARED_MAPS:
            truth = getattr(observed.prepared, name)
            row[f"r_{name}"] = correlation(
                truth,
                values[name],
                observed.prepared.areas,
            )
    if "intervals" in groups:
        sampling, known = observed.resampling, observed._baseline_correlations
        row |= {
            "asymmetry_mm": sampling.asymmetry_mm,
            "is_symmetric": sampling.is_symmetric,
            "resampled": RESAMPLED,
        }
        for name in COMPARED_MAPS:
            samples[f"r_{name}"] = sampling.correlations(
                getattr(observed.prepared, name), values[name]
            )
            if known:
                scores = gain_columns(
                    samples[f"r_{name}"], known["start", name], known["adjacent", name]
                )
                row |= {f"{score}_{name}": value for score, value in scores.items()}
    return row


def size_columns(predicted: TriangleMesh, observed: TriangleMesh) -> dict[str, float]:
    """Return the sizes of two closed surfaces in mm and their differences, the columns
    of the group size."""
    row: dict[str, float] = {}
    for prefix, mesh in (("", predicted), ("observed_", observed)):
        size, volume = area_cm2(mesh), volume_ml(mesh)
        values = {
            "area_cm2": size,
            "volume_ml": volume,
            "relative_area": size / volume ** (2 / 3),
        }
        row |= {prefix + name: value for name, value in values.items()}
    for name, unit in (("area", "cm2"), ("volume", "ml")):
        row[f"{name}_difference"] = (
            row[f"{name}_{unit}"] / row[f"observed_{name}_{unit}"] - 1
        )
    return row


def _pairwise_distances(
    surface: TriangleMesh,
    observed: TriangleMesh,
    even: TriangleMesh | None = None,
) -> list[VertexDistances]:
    """Measure how far the vertices of each of two aligned surfaces are from the other
    one, in mm.

    `even` is the observed surface with even triangles. If given, distances are measured
    at its vertices instead of those of `observed`.
    """
    pairs = (surface, observed), (observed if even is None else even, surface)
    return [(mesh, nearest_on(mesh.vertices, target)[0]) for mesh, target in pairs]


def surface_distances(pair: list[VertexDistances]) -> dict[str, float]:
    """Summarise the distances of `_pairwise_distances` in mm.

    distance_mm is the mean of the two area-weighted means, distance95_mm the larger of
    the two 95 % quantiles (a robust Hausdorff distance); distance_left_mm and
    distance_right_mm are distance_mm of the parts left and right of x = 0, NaN where a
    surface has none there.
    """
    mean, quantile = surface_distance(
        (distances, vertex_areas(mesh)) for mesh, distances in pair
    )
    by_side = []
    for on_side in (np.less, np.greater_equal):
        parts = [
            (
                distances,
                vertex_areas(mesh)
                * on_side(
                    mesh.vertices[:, 0],
                    0,
                ),
            )
            for mesh, distances in pair
        ]
        has_both = all(areas.any() for _, areas in parts)
        by_side.append(surface_distance(parts)[0] if has_both else float("nan"))
    left, right = by_side
    return {
        "distance_mm": mean,
        "distance_left_mm": left,
        "distance_right_mm": right,
        "distance95_mm": quantile,
    }


def aligned_distances(
    surface: TriangleMesh, observed: TriangleMesh
) -> dict[str, float]:
    """Align a surface rigidly with the observed one, and return their
    `surface_distances`."""
    return surface_distances(_pairwise_distances(align(surface, observed), observed))


def bootstrap_distances(
    pair: list[VertexDistances],
    points: Floats,
    patch: Ints,
    drawn: Floats,
) -> Floats:
    """Return the (k,) mean distances in mm in k bootstrap samples of patches.

    `drawn` (k, p) counts how often each of p patches is in a sample; `patch` (n,) is
    the patch of each of `points` (n, 3). Every vertex belongs to the patch of the
    nearest point.
    """
    tree, means = cKDTree(points), []
    for mesh, distances in pair:
        vertex_patch, areas = patch[tree.query(mesh.vertices)[1]], vertex_areas(mesh)
        sums, total = (
            np.bincount(vertex_patch, weights, minlength=drawn.shape[1])
            for weights in (areas * distances, areas)
        )
        means.append((drawn @ sums) / (drawn @ total))
    return np.asarray(np.mean(means, axis=0))


def roughness_mm(mesh: TriangleMesh) -> float:
    """Return the distance of the vertices from the mean of their neighbours along the
    normals, RMS by area, in mm.

    On surfaces with the same even triangles it measures wrinkles as small as a
    triangle.
    """
    links = igl.adjacency_matrix(mesh.faces)
    n_neighbours = np.asarray(links.sum(axis=1))
    means = links @ mesh.vertices / n_neighbours
    normals = vertex_normals(mesh)
    offsets: Floats = ((means - mesh.vertices) * normals).sum(axis=1)
    mean_square = np.average(offsets**2, weights=vertex_areas(mesh))
    return math.sqrt(mean_square)


def simple_predictions(
    start: TriangleMesh,
    target: TriangleMesh,
    registered: Mapping[str, TriangleMesh],
    atlas: TriangleMesh | None,
) -> dict[str, TriangleMesh]:
    """Predict a week without mechanics: closed surfaces in mm by model.

    The model `scaled` is the start brain with the volume of the target, `target` the
    surface that the run grows towards in this week. `registered` has further models on
    the boundary of the start's mesh, among them `atlas`, the atlas interpolated to this
    week; its own surface of this week, if there is one, replaces it. Either is scaled
    to the volume of the target.
    """
    atlas = registered["atlas"] if atlas is None else atlas
    models = {"scaled": scale_to_volume(start, target), **registered}
    return models | {"atlas": scale_to_volume(atlas, target), "target": target}


def comparison_table(
    labels: Mapping[str, Any],
    models: Mapping[float, Mapping[str, TriangleMesh]],
    observed: Mapping[float, ObservedBrain],
    *,
    radius_mm: float,
) -> pd.DataFrame:
    """Compare the predicted surfaces of each week with the observed brain: a row per
    week and model.

    Labels are run; kind ("explained" if growth was measured on the observed brains,
    else "predicted"); start (id of the start brain) and start_week. Models are by week
    closed surfaces in mm, that of the run as `run`; all others are baselines.
    `radius_mm` is that of the fitted curvature.

    Columns are the labels, week, observed (id of the observed brain), horizon (weeks
    since the start), model, those of `compare`, and those of `model_columns` where
    there are baselines.
    """
    rows = []
    for week in sorted(models):
        brain = observed[week]
        found = {
            model: compare(surface, brain, radius_mm=radius_mm)
            for model, surface in models[week].items()
        }
        samples = {model: drawn for model, (_, drawn) in found.items()}
        scores = model_columns(samples) if len(found) > 1 else {"run": {}}
        place = {
            "week": week,
            "observed": brain.id,
            "horizon": round(week - labels["start_week"], 6),
        }
        rows += [
            {
                **labels,
                **place,
                "model": model,
                **row,
                **scores[model],
            }
            for model, (row, _) in found.items()
        ]
    table = pd.DataFrame(rows)
    return table[[*FIRST_COLUMNS, *table.columns.difference(FIRST_COLUMNS, sort=False)]]


def model_columns(
    samples: Mapping[str, Mapping[str, Floats]],
) -> dict[str, dict[str, float]]:
    """Compare the models of a week with each other, by the `samples` of `compare` of
    each.

    Columns by model: skill = 1 − distance / distance of the best baseline (chosen anew
    in each sample, so the interval includes the uncertainty of that choice);
    r_less_atlas and distance_less_atlas_mm, the differences of r of the shape index and
    of distance_mm from those of the model `atlas`, if there is one. All have 95 %
    intervals …_low and …_high, of paired samples.
    """
    best = np.min(
        [drawn["distance_mm"] for model, drawn in samples.items() if model != "run"],
        axis=0,
    )
    columns: dict[str, dict[str, float]] = {}
    for model, drawn in samples.items():
        # no skill is known against a baseline that is the observed brain itself
        ratio = np.full(len(best), np.nan)
        np.divide(
            drawn["distance_mm"],
            best,
            out=ratio,
            where=best > 0,
        )
        columns[model] = with_interval("skill", 1 - ratio)
        if atlas := samples.get("atlas"):
            for name, key in (
                ("r_less_atlas", "r_shape_index"),
                ("distance_less_atlas_mm", "distance_mm"),
            ):
                columns[model] |= with_interval(
                    name,
                    drawn[key] - atlas[key],
                )
    return columns


def add_curves(
    table: pd.DataFrame, sizes: Mapping[float, Mapping[str, float]]
) -> pd.DataFrame:
    """Add the sizes by the curves that a run followed, and how far the run is off them.

    `sizes` are area_cm2 and volume_ml by week, none of a run that followed no curve.
    Columns curve_area_cm2 and curve_volume_ml, area_off_curve and volume_off_curve
    (fractions of the curve's); NaN without a curve.
    """
    for name in ("area_cm2", "volume_ml"):
        curve = np.array(
            [sizes.get(week, {}).get(name, np.nan) for week in table["week"]]
        )
        columns = {
            f"curve_{name}": curve,
            f"{name.split('_')[0]}_off_curve": table[name] / curve - 1,
        }
        table = table.join(pd.DataFrame(columns, index=table.index))
    return table
