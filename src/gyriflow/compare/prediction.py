"""What a predicted brain is worth beside simpler predictions, and how the real brain deviates from the expected one."""

from typing import Any

import numpy as np
import pandas as pd

from ..geometry.alignment import align
from ..geometry.diffusion import diffuse
from ..geometry.matching import crossing_faces
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    area,
    edges,
    signed_volume,
    vertex_areas,
    vertex_normals,
)
from .distances import drawn_distances, pairwise_distances, surface_distances
from .placement import INTERVAL, MEASURES, correlation, draw_patches, drawn_correlations, interpolate_measures
from .shapes import PreparedSurface, cortex_dice

SMOOTHING_MM = 3.0
"""Standard deviation that areas are smoothed with before they are compared."""


def roughness_mm(mesh: TriangleMesh) -> float:
    """Return how far vertices lie from the mean of their neighbours along their normals, root mean square by area.

    Of surfaces with the same even triangles it tells wrinkles of the size of a triangle.
    """
    first, second = edges(mesh)[0].T
    sums = np.zeros_like(mesh.vertices)
    np.add.at(sums, first, mesh.vertices[second])
    np.add.at(sums, second, mesh.vertices[first])
    count = np.bincount(np.concatenate([first, second]), minlength=len(sums))
    away = ((sums / count[:, None] - mesh.vertices) * vertex_normals(mesh)).sum(axis=1)
    return float(np.sqrt(np.average(away**2, weights=vertex_areas(mesh))))


def endpoints(
    predicted: TriangleMesh, real: TriangleMesh, shape: PreparedSurface, real_shape: PreparedSurface, patch: Ints
) -> dict[str, Any]:
    """Tell what a predicted surface is worth against the real one.

    Columns: those of `distances.surface_distances` and cortex_dice, laid onto each other rigidly, neither scaled;
    area_error and volume_error as fractions of the real; r_… of each of `MEASURES`; crossing_faces; roughness_ratio and
    curvature_rms_ratio, to the real surface's; …_low and …_high, the 95 % intervals of distance_mm and r_shape_index
    when patches are drawn with replacement; drawn_mm, the mean distances of these draws, for `with_skill`.

    Parameters
    ----------
    predicted, real
        Closed surfaces in mm as they are, the middle of the real one at x = 0.
    shape, real_shape
        The same made ready for comparison.
    patch
        Of each vertex of the real shape, as of `drawn_patches`.
    """
    aligned = align(predicted, real)
    pair, areas = pairwise_distances(aligned, real, real_shape.mesh), real_shape.areas
    values, _ = interpolate_measures(shape, real_shape)
    drawn = draw_patches(patch)
    away = drawn_distances(pair, real_shape.mesh.vertices, patch, drawn)
    r = drawn_correlations(real_shape.shape_index, values["shape_index"], areas, patch, drawn)
    row: dict[str, Any] = surface_distances(pair) | {
        "cortex_dice": cortex_dice(aligned, real),
        "area_error": area(predicted) / area(real) - 1,
        "volume_error": signed_volume(predicted) / signed_volume(real) - 1,
        **{f"r_{name}": correlation(getattr(real_shape, name), values[name], areas) for name in MEASURES},
        "crossing_faces": float(crossing_faces(predicted)),
        "roughness_ratio": roughness_mm(shape.mesh) / roughness_mm(real_shape.mesh),
        "curvature_rms_ratio": shape.curvature_rms / real_shape.curvature_rms,
    }
    for name, draws in (("distance_mm", away), ("r_shape_index", r)):
        row[f"{name}_low"], row[f"{name}_high"] = map(float, np.nanquantile(draws, INTERVAL))
    return row | {"drawn_mm": away}


def with_skill(rows: pd.DataFrame) -> pd.DataFrame:
    """Add skill = 1 − distance / distance of the best baseline of the week, with its 95 % interval, to a prediction.

    The surface that the run grows towards is not among these baselines.

    Parameters
    ----------
    rows
        Columns week, model (`run`, or a simpler prediction), distance_mm, and drawn_mm of the same draws, which is left
        out of the result; added are skill, skill_low and skill_high.
    """
    simple = rows[~rows["model"].isin(["run", "target"])]
    best = simple.loc[simple.groupby("week")["distance_mm"].idxmin()].set_index("week")
    skill, drawn = (1 - rows[name] / rows["week"].map(best[name]) for name in ("distance_mm", "drawn_mm"))
    low, high = np.array([np.quantile(values, INTERVAL) for values in drawn]).T
    return rows.drop(columns="drawn_mm").assign(skill=skill, skill_low=low, skill_high=high)


def deviation_maps(expected: TriangleMesh, real: TriangleMesh) -> dict[str, Floats]:
    """Return distance_mm and log_area at the (n,) vertices of the expected surface.

    The distance is along the normal, positive where the real brain lies outside; the other is the logarithm of the real
    over the expected area.

    Parameters
    ----------
    expected, real
        The expected surface in the pose of the real one, and the same moved onto that.
    """
    ratio = vertex_areas(real) / vertex_areas(expected)
    return {
        "distance_mm": ((real.vertices - expected.vertices) * vertex_normals(expected)).sum(axis=1),
        "log_area": np.log(diffuse(expected.vertices, expected.faces, ratio, SMOOTHING_MM)),
    }
