"""Whether folds are where they are in the real brain: correlation of curvature, and skill over no folding at all."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.alignment import MIRROR, align
from ..geometry.matching import match_surface, nearest_on, values_at
from ..geometry.triangles import Floats, Ints, TriangleMesh, transformed
from .shapes import PreparedSurface

MEASURES = ("shape_index", "mean_curvature")

PATCH_MM = 20.0
"""Edge of the patches that the bootstrap draws: wider than a gyrus with its sulcus."""

SYMMETRIC_MM = 0.4
"""Mean distance of a brain from its mirror image below which its sides are one observation: half a voxel of atlases."""

SKILLED_FROM = 1.5
"""Weeks: before, the adjacent brain is the start itself."""

DRAWS = 2000
INTERVAL = (0.025, 0.975)


def correlation(one: Floats, other: Floats, weights: Floats) -> float:
    """Return the weighted Pearson correlation of (n,) values; NaN where one of them is constant."""
    return float(_correlations(_products(one, other, weights).sum(axis=0)[None])[0])


def skill(r: float, r_start: float, r_adjacent: float, horizon: float) -> float:
    """Return (r − r_start)/(r_adjacent − r_start): 1 is as good as the real brain of the week before, 0 as the start.

    NaN within two weeks of the start, and where the adjacent week is no better than the start.
    """
    room = r_adjacent - r_start
    return float((r - r_start) / room) if horizon > SKILLED_FROM and room > 0 else float("nan")


def values_on(real: PreparedSurface, other: PreparedSurface) -> tuple[dict[str, Floats], float]:
    """Take the measures of another shape at the vertices of the real one, both laid onto each other.

    To each vertex belongs the nearest point of the other whose normal agrees. Returns (n,) values by measure, and the
    part of the real area for which there is such a point.
    """
    match = match_surface(real.mesh, other.mesh)
    values = {measure: values_at(match, getattr(other, measure)) for measure in MEASURES}
    return values, float(np.average(match.agrees, weights=real.areas))


def placement(
    real: PreparedSurface, run: PreparedSurface, start: PreparedSurface, adjacent: PreparedSurface, *, horizon: float
) -> dict[str, float | bool]:
    """Tell how well the folds of a run are placed in a week, all shapes ready and laid onto the real brain.

    Correlations are those of `values_on`, weighted by area over the whole surface. For each of `MEASURES`: r_…,
    r_start_…, r_adjacent_…, gain_… (r − r_start) with its 95 % interval gain_low_…, gain_high_… from patches drawn with
    replacement (Efron and Tibshirani 1993), and skill_…. matched_share is the part of the real surface's area for which
    an agreeing point of the run was found. asymmetry_mm and mirrored_patches are those of `drawn_patches`.

    `start` is the start brain scaled up: no folding at all; `adjacent` the real brain of the week before. The horizon
    is in weeks since the start.
    """
    on_run, share = values_on(real, run)
    (on_start, _), (on_adjacent, _) = values_on(real, start), values_on(real, adjacent)
    patch, drawn = drawn_patches(real)
    row = {"matched_share": share} | drawn
    areas = real.areas
    for measure in MEASURES:
        truth = getattr(real, measure)
        r = correlation(truth, on_run[measure], areas)
        r_start = correlation(truth, on_start[measure], areas)
        r_adjacent = correlation(truth, on_adjacent[measure], areas)
        low, high = gain_interval(truth, on_run[measure], on_start[measure], areas, patch)
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


def drawn_patches(real: PreparedSurface, *, mirrored: bool = False) -> tuple[Ints, dict[str, float | bool]]:
    """Return for each vertex the number of the patch that is drawn with it, and how patches were made.

    asymmetry_mm is the mean distance of the brain from its mirror image. Where it is below `SYMMETRIC_MM`, or where
    `mirrored` asks for it, a patch is drawn together with its mirror image: mirrored_patches is true.
    """
    image, asymmetry_mm = mirror_places(real.mesh, real.areas)
    together = mirrored or asymmetry_mm < SYMMETRIC_MM
    patch = patches(real.mesh.vertices, real.areas, PATCH_MM, image if together else None)
    return patch, {"asymmetry_mm": asymmetry_mm, "mirrored_patches": together}


def mirror_places(mesh: TriangleMesh, areas: Floats) -> tuple[Floats, float]:
    """Return where the mirror image of each vertex lies, (n, 3), and the mean distance of the two surfaces in mm.

    The image, mirrored along x (left to right), is laid onto the surface rigidly.
    """
    image = transformed(mesh, MIRROR)
    aligned = align(image, mesh)
    return aligned.vertices, float(np.average(nearest_on(aligned.vertices, mesh)[0], weights=areas))


def patches(points: Floats, areas: Floats, edge_mm: float, mirrored: Floats | None = None) -> Ints:
    """Number the patches, about `edge_mm` wide, of (n,) vertices; the same in every call.

    Patches are nearest to seeds that are spread by farthest points. With the (n, 3) places of the vertices' mirror
    images, a patch and its mirror image have one number.
    """
    sides = 1
    if mirrored is not None:
        sides, points = 2, np.where((points[:, 0] < mirrored[:, 0])[:, None], points, mirrored)
    count = max(2, round(float(areas.sum()) / edge_mm**2 / sides))
    seeds = [0]
    away = np.linalg.norm(points - points[0], axis=1)
    for _ in range(count - 1):
        seeds.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(points - points[seeds[-1]], axis=1))
    return np.asarray(cKDTree(points[seeds]).query(points)[1], dtype=np.int64)


def gain_interval(
    truth: Floats, run: Floats, start: Floats, areas: Floats, patch: NDArray[np.integer]
) -> tuple[float, float]:
    """Return the 95 % interval of r(run) − r(start) when whole patches of the surface are drawn with replacement."""
    drawn = draw_patches(patch)
    r_run, r_start = (drawn_correlations(truth, values, areas, patch, drawn) for values in (run, start))
    low, high = np.nanquantile(r_run - r_start, INTERVAL)
    return float(low), float(high)


def draw_patches(patch: NDArray[np.integer]) -> Ints:
    """Draw patches with replacement: how often each of p is drawn, (DRAWS, p)."""
    count = int(patch.max()) + 1
    return np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=DRAWS)


def drawn_correlations(
    truth: Floats, other: Floats, areas: Floats, patch: NDArray[np.integer], drawn: NDArray[np.integer]
) -> Floats:
    """Return the (DRAWS,) correlations of values at vertices over the patches that are drawn."""
    columns = _products(truth, other, areas).T
    sums: Floats = np.stack([np.bincount(patch, column) for column in columns], axis=1)
    return _correlations(np.asarray(drawn @ sums, dtype=float))


def _products(one: Floats, other: Floats, weights: Floats) -> Floats:
    return weights[:, None] * np.stack([np.ones_like(one), one, other, one * one, other * other, one * other], axis=1)


def _correlations(sums: Floats) -> Floats:
    """Correlate by the (k, 6) sums of `_products`; NaN where values are constant to rounding."""
    weight, x, y, xx, yy, xy = sums.T
    spread_x, spread_y = xx * weight - x * x, yy * weight - y * y
    valid = (spread_x > 1e-12 * xx * weight) & (spread_y > 1e-12 * yy * weight)
    return np.where(valid, (xy * weight - x * y) / np.sqrt(np.where(valid, spread_x * spread_y, 1.0)), np.nan)
