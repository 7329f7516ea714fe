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

MIN_SKILL_HORIZON_GW = 1.5
"""Longest horizon without skill: the observed brain of the week before is then the start brain itself."""

N_DRAWS = 2000
"""Bootstrap samples."""
INTERVAL = (0.025, 0.975)
"""Quantiles of the bootstrap samples at the ends of a 95 % interval."""


def correlation(x: Floats, y: Floats, weights: Floats) -> float:
    """Return the weighted Pearson correlation of (n,) values; NaN where one of them is constant."""
    return float(_correlations(_products(x, y, weights).sum(axis=0)[None])[0])


def skill(r: float, r_start: float, r_adjacent: float, horizon: float) -> float:
    """Return (r − r_start)/(r_adjacent − r_start): 0 is as good as the scaled start, 1 as the observed week before.

    NaN for horizons (GW) up to `MIN_SKILL_HORIZON_GW`, and where the adjacent week is not better than the start.
    """
    baseline_gain = r_adjacent - r_start
    has_baseline = horizon > MIN_SKILL_HORIZON_GW and baseline_gain > 0
    return float((r - r_start) / baseline_gain) if has_baseline else float("nan")


def interpolate_measures(surface: PreparedSurface, observed: PreparedSurface) -> tuple[dict[str, Floats], float]:
    """Interpolate the measures of a surface at the n vertices of the observed one, both aligned.

    Each vertex takes the value at the nearest point whose normal agrees. Returns (n,) values by measure, and the share
    of the observed area for which there is such a point.
    """
    match = match_surface(observed.mesh, surface.mesh)
    values = {measure: values_at(match, getattr(surface, measure)) for measure in COMPARED_MAPS}
    return values, float(np.average(match.agrees, weights=observed.areas))


def score_placement(
    simulated: PreparedSurface,
    observed: PreparedSurface,
    start: PreparedSurface,
    adjacent: PreparedSurface,
    *,
    horizon: float,
) -> dict[str, float | bool]:
    """Score how well the positions of a simulated brain's folds agree with those of the observed brain.

    Correlations r are weighted by area over the whole observed surface. For each of `COMPARED_MAPS`: r_…, r_start_…,
    r_adjacent_…, gain_… (r − r_start) with its 95 % interval gain_low_…, gain_high_… by a bootstrap over patches
    (Efron and Tibshirani 1993), and skill_…. In addition matched_share, the share of the observed area with a matching
    point on the simulated brain, and asymmetry_mm and mirrored_patches of `make_patches`.

    Parameters
    ----------
    simulated, observed
        Prepared for comparison and aligned, as are the baselines.
    start
        The start brain scaled to the observed volume, which has no new folds.
    adjacent
        The observed brain of the week before.
    horizon
        Weeks since the start.
    """
    simulated_values, matched_share = interpolate_measures(simulated, observed)
    start_values, adjacent_values = (interpolate_measures(surface, observed)[0] for surface in (start, adjacent))
    patch, symmetry = make_patches(observed)
    row = {"matched_share": matched_share} | symmetry
    areas = observed.areas
    for measure in COMPARED_MAPS:
        truth = getattr(observed, measure)
        r = correlation(truth, simulated_values[measure], areas)
        r_start = correlation(truth, start_values[measure], areas)
        r_adjacent = correlation(truth, adjacent_values[measure], areas)
        low, high = gain_interval(truth, simulated_values[measure], start_values[measure], areas, patch)
        row |= {
            f"r_{measure}": r,
            f"r_start_{measure}": r_start,
            f"r_adjacent_{measure}": r_adjacent,
            f"gain_{measure}": r - r_start,
            f"gain_low_{measure}": low,
            f"gain_high_{measure}": high,
            f"skill_{measure}": skill(r, r_start, r_adjacent, horizon),
        }
    return row


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


def gain_interval(
    truth: Floats, simulated: Floats, start: Floats, areas: Floats, patch: NDArray[np.integer]
) -> tuple[float, float]:
    """Return the 95 % interval of r(simulated) − r(start) by a bootstrap over patches."""
    drawn = draw_patches(patch)
    r_simulated, r_start = (bootstrap_correlations(truth, values, areas, patch, drawn) for values in (simulated, start))
    low, high = np.nanquantile(r_simulated - r_start, INTERVAL)
    return float(low), float(high)


def draw_patches(patch: NDArray[np.integer]) -> Ints:
    """Draw bootstrap samples of patches: return how often each of p patches is in each sample, (N_DRAWS, p)."""
    count = int(patch.max()) + 1
    return np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=N_DRAWS)


def bootstrap_correlations(
    truth: Floats, values: Floats, areas: Floats, patch: NDArray[np.integer], drawn: NDArray[np.integer]
) -> Floats:
    """Return the (N_DRAWS,) area-weighted correlations of (n,) values in each bootstrap sample."""
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
