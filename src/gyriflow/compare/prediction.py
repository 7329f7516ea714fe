"""What a brain foretold is worth: its distance from the real one, its size and folds, beside simpler ways to do so."""

from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from ..geometry.alignment import fit_onto
from ..geometry.matching import crossing_faces, match_points, nearest_on, values_at
from ..geometry.remeshing import remesh
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    area,
    edges,
    signed_volume,
    transformed,
    vertex_areas,
    vertex_normals,
)
from .placement import INTERVAL, MEASURES, correlation, draw_patches, drawn_correlations
from .shapes import EDGE_MM, Shape, cortex_dice

FAR = 0.95
"""Quantile of the distance that stands for its largest values."""


def apart(found: TriangleMesh, real: TriangleMesh, real_even: TriangleMesh) -> list[tuple[TriangleMesh, Floats]]:
    """Returns two surfaces with even triangles, and how far their vertices are from the other in mm, as they lie.

    `real_even` is the real one made `ready`.
    """
    both = ((remesh(found, EDGE_MM), real), (real_even, found))
    return [(even, nearest_on(even.vertices, other)[0]) for even, other in both]


def distances(pair: list[tuple[TriangleMesh, Floats]]) -> dict[str, float]:
    """Returns the symmetric distances in mm of two surfaces that are `apart`.

    distance_mm is the mean over both surfaces, weighted by area, and distance95_mm the larger of their 95 % quantiles;
    distance_left_mm and distance_right_mm are means over what lies left and right of x = 0, NaN where nothing does.
    """
    means, far = [], []
    for even, away in pair:
        areas, left = vertex_areas(even), even.vertices[:, 0] < 0
        parts = [areas, areas * left, areas * ~left]
        means.append([np.average(away, weights=part) if part.any() else np.nan for part in parts])
        far.append(float(np.quantile(away, FAR, weights=areas, method="inverted_cdf")))
    names = ("distance_mm", "distance_left_mm", "distance_right_mm")
    return dict(zip(names, map(float, np.mean(np.array(means), axis=0)), strict=True)) | {"distance95_mm": max(far)}


def drawn_distances(pair: list[tuple[TriangleMesh, Floats]], points: Floats, patch: Ints, drawn: Ints) -> Floats:
    """Returns the mean distances in mm over drawn patches (k, p); vertices have that of their nearest point."""
    near, means = cKDTree(points), []
    for even, away in pair:
        at, areas = patch[near.query(even.vertices)[1]], vertex_areas(even)
        sums = (np.bincount(at, weights, minlength=drawn.shape[1]) for weights in (areas * away, areas))
        means.append(np.divide(*(drawn @ part for part in sums)))
    return np.asarray(np.mean(means, axis=0))


def roughness_mm(mesh: TriangleMesh) -> float:
    """Returns how far vertices lie from the mean of their neighbours along their normals, root mean square by area.

    Of surfaces with the same even triangles it tells wrinkles of the size of a triangle.
    """
    pairs = edges(mesh)[0]
    sums, count = np.zeros_like(mesh.vertices), np.zeros(len(mesh.vertices))
    for one, other in (pairs.T, pairs.T[::-1]):
        np.add.at(sums, one, mesh.vertices[other])
        np.add.at(count, one, 1)
    away = ((sums / count[:, None] - mesh.vertices) * vertex_normals(mesh)).sum(axis=1)
    return float(np.sqrt(np.average(away**2, weights=vertex_areas(mesh))))


def endpoints(found: TriangleMesh, real: TriangleMesh, shape: Shape, real_shape: Shape, patch: Ints) -> dict[str, Any]:
    """Returns what a foretold surface is worth against the real one.

    Columns: those of `distances` and cortex_dice, laid onto each other rigidly, neither scaled; area_error and
    volume_error as fractions of the real; r_… of each of `MEASURES`; crossing_faces; roughness_ratio and
    curvature_rms_ratio, to the real surface's; …_low and …_high, the 95 % intervals of distance_mm and r_shape_index
    when patches are drawn with replacement; drawn_mm, the mean distances of these draws, for `with_skill`.

    Parameters
    ----------
    found, real
        Closed surfaces in mm as they are, the middle of the real one at x = 0.
    shape, real_shape
        The same made ready for comparison.
    patch
        Of each vertex of the real shape, as of `drawn_patches`.
    """
    placed = transformed(found, fit_onto(found, real))
    pair, points, areas = apart(placed, real, real_shape.mesh), real_shape.mesh.vertices, real_shape.areas
    match = match_points(points, vertex_normals(real_shape.mesh), shape.mesh)
    values = {name: values_at(match, getattr(shape, name)) for name in MEASURES}
    drawn = draw_patches(patch, seed=0)
    away = drawn_distances(pair, points, patch, drawn)
    r = drawn_correlations(real_shape.shape_index, values["shape_index"], areas, patch, drawn)
    limits = {"distance_mm": away, "r_shape_index": r}
    return {
        **distances(pair),
        "cortex_dice": cortex_dice(placed, real),
        "area_error": area(found) / area(real) - 1,
        "volume_error": signed_volume(found) / signed_volume(real) - 1,
        **{f"r_{name}": correlation(getattr(real_shape, name), values[name], areas) for name in MEASURES},
        "crossing_faces": float(crossing_faces(found)),
        "roughness_ratio": roughness_mm(shape.mesh) / roughness_mm(real_shape.mesh),
        "curvature_rms_ratio": shape.curvature_rms / real_shape.curvature_rms,
        **{
            f"{name}_{end}": float(np.nanquantile(of, share))
            for name, of in limits.items()
            for end, share in zip(("low", "high"), INTERVAL, strict=True)
        },
        "drawn_mm": away,
    }


def scaled_to(mesh: TriangleMesh, volume_mm3: float) -> TriangleMesh:
    """Returns a closed surface scaled to a volume."""
    factor = (volume_mm3 / signed_volume(mesh)) ** (1 / 3)
    return transformed(mesh, np.diag([factor] * 3 + [1.0]))


def with_skill(rows: pd.DataFrame) -> pd.DataFrame:
    """Returns the rows of a prediction with skill = 1 − distance / distance of the best baseline of the week.

    The surface that the run grows towards is not among these baselines. skill_low and skill_high are its 95 % interval.

    Parameters
    ----------
    rows
        Columns week, model (`run`, or a simpler way), distance_mm, and drawn_mm of the same draws; it is left out.
    """
    simple = rows[~rows["model"].isin(["run", "target"])]
    best = simple.loc[simple.groupby("week")["distance_mm"].idxmin()].set_index("week")
    skill, drawn = (1 - rows[name] / rows["week"].map(best[name]) for name in ("distance_mm", "drawn_mm"))
    low, high = np.array([np.quantile(values, INTERVAL) for values in drawn]).T
    return rows.drop(columns="drawn_mm").assign(skill=skill, skill_low=low, skill_high=high)
