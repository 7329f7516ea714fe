"""Whether folds are where they are in the real brain: correlation of curvature, and skill over no folding at all."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.alignment import fit_onto
from ..geometry.matching import MIRROR, match_points, nearest_on, values_at
from ..geometry.triangles import Floats, Ints, TriangleMesh, transformed, vertex_normals
from .shapes import Shape

MEASURES = ("shape_index", "mean_curvature")

PATCH_MM = 20.0
"""Edge of the patches that the bootstrap draws: wider than a gyrus with its sulcus."""

SYMMETRIC_MM = 0.4
"""Mean distance of a brain from its mirror image below which its sides are one observation: half a voxel of atlases."""

DRAWS = 2000
INTERVAL = (0.025, 0.975)


def correlation(one: Floats, other: Floats, weights: Floats) -> float:
    """Returns the weighted Pearson correlation of (n,) values; NaN where one of them is constant."""
    return float(_correlations(_products(one, other, weights).sum(axis=0)[None])[0])


SKILLED_FROM = 1.5
"""Weeks: before, the adjacent brain is the start itself."""


def skill(r: float, r_start: float, r_adjacent: float, horizon: float) -> float:
    """Returns (r − r_start)/(r_adjacent − r_start) from two weeks after the start on; NaN before.

    1 is as good as the real brain of the week before, 0 as the start brain scaled up. After one week the adjacent brain
    is the start itself. NaN also where the adjacent week is no better than the start.
    """
    room = r_adjacent - r_start
    return float((r - r_start) / room) if horizon > SKILLED_FROM and room > 0 else float("nan")


def placement(
    real: Shape,
    run: Shape,
    start: Shape,
    adjacent: Shape | None,
    *,
    horizon: float,
    seed: int,
) -> dict[str, float | bool]:
    """Returns how well the folds of a run are placed in a week, all shapes ready and laid onto the real brain.

    To each vertex of the real surface belongs the nearest point of the other whose normal agrees; correlations are
    weighted by area, over the whole surface. For each of `MEASURES`: r_…, r_start_…, r_adjacent_…, gain_… (r − r_start)
    with its 95 % interval gain_low_…, gain_high_… from patches drawn with replacement (Efron and Tibshirani 1993), and
    skill_…. matched_share is the part of the real surface's area for which an agreeing point of the run was found.
    asymmetry_mm and mirrored_patches are those of `drawn_patches`.

    `start` is the start brain scaled up: no folding at all; `adjacent` the real brain of the week before, if there is
    one. The horizon is in weeks since the start, the seed that of the bootstrap.
    """
    others = {"run": run, "start": start} | ({"adjacent": adjacent} if adjacent is not None else {})
    normals, areas = vertex_normals(real.mesh), real.areas
    values: dict[str, dict[str, Floats]] = {}
    row: dict[str, float | bool] = {}
    for name, shape in others.items():
        match = match_points(real.mesh.vertices, normals, shape.mesh)
        values[name] = {measure: values_at(match, getattr(shape, measure)) for measure in MEASURES}
        if name == "run":
            row["matched_share"] = float(np.average(match.agrees, weights=areas))
    patch, drawn = drawn_patches(real)
    row |= drawn
    for measure in MEASURES:
        truth = getattr(real, measure)
        found = {name: correlation(truth, value[measure], areas) for name, value in values.items()}
        low, high = gain_interval(truth, values["run"][measure], values["start"][measure], areas, patch, seed=seed)
        r, r_start, r_adjacent = found["run"], found["start"], found.get("adjacent", np.nan)
        numbers = {"r": r, "r_start": r_start, "r_adjacent": r_adjacent, "gain": r - r_start, "gain_low": low}
        numbers |= {"gain_high": high, "skill": skill(r, r_start, r_adjacent, horizon)}
        row |= {f"{name}_{measure}": number for name, number in numbers.items()}
    return row


def drawn_patches(real: Shape, *, mirrored: bool = False) -> tuple[Ints, dict[str, float | bool]]:
    """Returns for each vertex the number of the patch that is drawn with it, and how patches were made.

    asymmetry_mm is the mean distance of the brain from its mirror image. Where it is below `SYMMETRIC_MM`, or where
    `mirrored` asks for it, a patch is drawn together with its mirror image: mirrored_patches is true.
    """
    there, asymmetry_mm = mirror_places(real.mesh, real.areas)
    together = mirrored or asymmetry_mm < SYMMETRIC_MM
    patch = patches(real.mesh.vertices, real.areas, PATCH_MM, there if together else None)
    return patch, {"asymmetry_mm": asymmetry_mm, "mirrored_patches": together}


def mirror_places(mesh: TriangleMesh, areas: Floats) -> tuple[Floats, float]:
    """Returns where the mirror image of each vertex lies, (n, 3), and the mean distance of the two surfaces in mm.

    The image, mirrored along x (left to right), is laid onto the surface rigidly.
    """
    image = transformed(mesh, np.pad(MIRROR, (0, 1)) + np.diag([0.0, 0.0, 0.0, 1.0]))
    laid = transformed(image, fit_onto(image, mesh))
    return laid.vertices, float(np.average(nearest_on(laid.vertices, mesh)[0], weights=areas))


def patches(points: Floats, areas: Floats, edge_mm: float, mirrored: Floats | None = None) -> Ints:
    """Returns for each of (n,) vertices the number of its patch, about `edge_mm` wide, the same in every call.

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
    truth: Floats, run: Floats, start: Floats, areas: Floats, patch: NDArray[np.integer], *, seed: int
) -> tuple[float, float]:
    """Returns the 95 % interval of r(run) − r(start) when whole patches of the surface are drawn with replacement."""
    drawn = draw_patches(patch, seed=seed)
    gains = np.subtract(*(drawn_correlations(truth, other, areas, patch, drawn) for other in (run, start)))
    low, high = np.nanquantile(gains, INTERVAL)
    return float(low), float(high)


def draw_patches(patch: NDArray[np.integer], *, seed: int) -> Ints:
    """Returns how often each of p patches is drawn, (DRAWS, p), with replacement."""
    count = int(patch.max()) + 1
    return np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), size=DRAWS)


def drawn_correlations(
    truth: Floats, other: Floats, areas: Floats, patch: NDArray[np.integer], drawn: NDArray[np.integer]
) -> Floats:
    """Returns the (DRAWS,) correlations of values at vertices over the patches that are drawn."""
    return _correlations(drawn @ _patch_sums(truth, other, areas, patch))


def _products(one: Floats, other: Floats, weights: Floats) -> Floats:
    return weights[:, None] * np.stack([np.ones_like(one), one, other, one * one, other * other, one * other], axis=1)


def _patch_sums(one: Floats, other: Floats, weights: Floats, patch: NDArray[np.integer]) -> Floats:
    """Returns the (p, 6) sums of each patch that a correlation is made of."""
    columns = _products(one, other, weights).T
    return np.stack([np.bincount(patch, column) for column in columns], axis=1)


def _correlations(sums: Floats) -> Floats:
    weight, x, y, xx, yy, xy = sums.T
    spreads = [(square * weight - mean * mean, square * weight) for mean, square in ((x, xx), (y, yy))]
    valid = np.logical_and(*(spread > 1e-12 * size for spread, size in spreads))
    product = np.where(valid, spreads[0][0] * spreads[1][0], 1.0)
    return np.where(valid, (xy * weight - x * y) / np.sqrt(product), np.nan)
