"""Placement of folds: correlation of curvature with the observed brain, and skill over a brain without new folds."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.alignment import MIRROR, align
from ..geometry.matching import match_surface, nearest_on, values_at
from ..geometry.triangles import Floats, Ints, TriangleMesh, transformed
from ..quantities import COMPARED_MAPS
from .shapes import PreparedSurface

PATCH_EDGE_MM = 20.0
"""Width of the patches that are resampled in the bootstrap: wider than a gyrus with its sulcus."""

SYMMETRY_TOL_MM = 0.4
"""Mean distance to the mirror image below which both sides count as one observation: half a voxel of atlases."""

N_DRAWS = 2000
"""Bootstrap samples."""
INTERVAL = (0.025, 0.975)
"""Quantiles of the bootstrap samples at the ends of a 95 % interval."""
RESAMPLED = "patches of one brain, not subjects"
"""Note in tables with bootstrap intervals, which do not include differences between subjects."""
NO_ROOM = "no room"
"""Flag of a skill that is not computed, since its baseline may be no better than the start."""


def correlation(x: Floats, y: Floats, weights: Floats) -> float:
    """Return the weighted Pearson correlation of (n,) values; NaN where one of them is constant."""
    return float(_correlations(_products(x, y, weights).sum(axis=0)[None])[0])


def interpolate_measures(surface: PreparedSurface, observed: PreparedSurface) -> tuple[dict[str, Floats], float]:
    """Interpolate the measures of a surface at the n vertices of the observed one, both aligned.

    Each vertex takes the value at the nearest point whose normal agrees. Returns (n,) values by measure, and the share
    of the observed area for which there is such a point.
    """
    match = match_surface(observed.mesh, surface.mesh)
    values = {measure: values_at(match, getattr(surface, measure)) for measure in COMPARED_MAPS}
    return values, float(np.average(match.agrees, weights=observed.areas))


def score_placement(
    simulated: PreparedSurface, observed: PreparedSurface, start: PreparedSurface, adjacent: PreparedSurface
) -> dict[str, float | bool | str]:
    """Score how well the positions of a simulated brain's folds agree with those of the observed brain.

    The result has the `correlation_scores` of each of `COMPARED_MAPS`; matched_share, the share of the observed area
    with a matching point on the simulated brain; asymmetry_mm and mirrored_patches of `make_patches`; and resampled.

    Parameters
    ----------
    simulated, observed
        Prepared for comparison and aligned, as are the baselines.
    start
        The start brain scaled to the observed volume, which has no new folds.
    adjacent
        The observed brain of the week before.
    """
    (run_maps, matched_share), (start_maps, _), (adjacent_maps, _) = (
        interpolate_measures(surface, observed) for surface in (simulated, start, adjacent)
    )
    patch, symmetry = make_patches(observed)
    row = {"matched_share": matched_share} | symmetry | {"resampled": RESAMPLED}
    for name in COMPARED_MAPS:
        maps = (getattr(observed, name), run_maps[name], start_maps[name], adjacent_maps[name])
        scores = correlation_scores(*maps, observed.areas, patch)
        row |= {f"{score}_{name}": value for score, value in scores.items()}
    return row


def correlation_scores(
    truth: Floats, simulated: Floats, start: Floats, adjacent: Floats, areas: Floats, patch: Ints
) -> dict[str, float | str]:
    """Correlate (n,) simulated values with the observed `truth`, and compare r with that of the baselines.

    Returns
    -------
    dict
        r, r_start and r_adjacent, weighted by area; gain = r − r_start; room = r_adjacent − r_start, the gain of the
        baseline; skill = gain/room and skill_flag: "ok", or NaN and `NO_ROOM` unless the interval of room lies above 0.
        r, gain, room and skill have 95 % intervals …_low, …_high: percentiles of a bootstrap over patches (Efron and
        Tibshirani 1993).
    """
    drawn = draw_patches(patch)
    r, r_start, r_adjacent = (
        bootstrap_correlations(truth, values, areas, patch, drawn) for values in (simulated, start, adjacent)
    )
    gain, room = r - r_start, r_adjacent - r_start
    has_room = interval_of(room)[1] > 0
    skill = gain / room if has_room else np.full_like(gain, np.nan)
    row: dict[str, float | str] = {"r_start": float(r_start[0]), "r_adjacent": float(r_adjacent[0])}
    for name, draws in (("r", r), ("gain", gain), ("room", room), ("skill", skill)):
        row |= dict(zip((name, f"{name}_low", f"{name}_high"), interval_of(draws), strict=True))
    return row | {"skill_flag": "ok" if has_room else NO_ROOM}


def interval_of(draws: Floats) -> tuple[float, float, float]:
    """Return a statistic, the first of (1 + k,) draws, and its 95 % interval, from the other k."""
    low, high = (float("nan"),) * 2 if np.isnan(draws).all() else np.nanquantile(draws[1:], INTERVAL)
    return float(draws[0]), float(low), float(high)


def make_patches(surface: PreparedSurface, *, mirrored: bool = False) -> tuple[Ints, dict[str, float | bool]]:
    """Return the (n,) patch number of each vertex, and how symmetric the brain is.

    asymmetry_mm is the mean distance of the brain from its mirror image. mirrored_patches is true if a patch and its
    mirror image count as one patch: if that distance is below `SYMMETRY_TOL_MM`, or on request (`mirrored`).
    """
    image, asymmetry_mm = mirror_image(surface.mesh, surface.areas)
    together = mirrored or asymmetry_mm < SYMMETRY_TOL_MM
    patch = number_patches(surface.mesh.vertices, surface.areas, PATCH_EDGE_MM, image if together else None)
    return patch, {"asymmetry_mm": asymmetry_mm, "mirrored_patches": together}


def mirror_image(mesh: TriangleMesh, areas: Floats) -> tuple[Floats, float]:
    """Return the (n, 3) mirror images of the vertices, and the mean distance in mm of the image from the surface.

    The surface is mirrored along x (left to right) and aligned with itself.
    """
    image = transformed(mesh, MIRROR)
    aligned = align(image, mesh)
    return aligned.vertices, float(np.average(nearest_on(aligned.vertices, mesh)[0], weights=areas))


def number_patches(points: Floats, areas: Floats, edge_mm: float, mirrored: Floats | None = None) -> Ints:
    """Divide (n, 3) points into patches about `edge_mm` wide and return the (n,) number of each point's patch.

    Patches are the Voronoi cells of seeds chosen by farthest-point sampling, which is deterministic. With
    `mirrored`, the (n, 3) mirror images of the points, a patch and its mirror image have the same number.
    """
    sides = 1
    if mirrored is not None:
        sides, points = 2, np.where((points[:, 0] < mirrored[:, 0])[:, None], points, mirrored)
    count = max(2, round(float(areas.sum()) / edge_mm**2 / sides))
    seeds = [0]
    distances = np.linalg.norm(points - points[0], axis=1)
    for _ in range(count - 1):
        seeds.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points - points[seeds[-1]], axis=1))
    return np.asarray(cKDTree(points[seeds]).query(points)[1], dtype=np.int64)


def draw_patches(patch: NDArray[np.integer]) -> Ints:
    """Return how often each of p patches is in the surface (once) and in each bootstrap sample, (1 + N_DRAWS, p)."""
    count = int(patch.max()) + 1
    drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=N_DRAWS)
    return np.concatenate([np.ones((1, count), np.int64), drawn])


def bootstrap_correlations(
    truth: Floats, values: Floats, areas: Floats, patch: NDArray[np.integer], drawn: NDArray[np.integer]
) -> Floats:
    """Return the (k,) area-weighted correlations of (n,) values in each of k samples of `draw_patches`."""
    columns = _products(truth, values, areas).T
    sums: Floats = np.stack([np.bincount(patch, column) for column in columns], axis=1)
    return _correlations(np.asarray(drawn @ sums, dtype=float))


def _products(x: Floats, y: Floats, weights: Floats) -> Floats:
    return weights[:, None] * np.stack([np.ones_like(x), x, y, x * x, y * y, x * y], axis=1)


def _correlations(sums: Floats) -> Floats:
    """Correlate by the (k, 6) sums of `_products`; NaN where values are constant to rounding."""
    weight, x, y, xx, yy, xy = sums.T
    spread_x, spread_y = xx * weight - x * x, yy * weight - y * y
    valid = (spread_x > 1e-12 * xx * weight) & (spread_y > 1e-12 * yy * weight)
    return np.where(valid, (xy * weight - x * y) / np.sqrt(np.where(valid, spread_x * spread_y, 1.0)), np.nan)
