"""Where growth is fast or slow: maps of relative growth for a run, from the local growth between brains."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.spins import spins, spun
from ..geometry.triangles import Floats
from ..parameters.folding import STRAIN as PARTS

SLOWEST, FASTEST = -1.0, 3.0
"""Bounds of local growth as a multiple of the whole brain's."""
CORTEX, STRAIN = "cortex", "strain"
"""In the names of a map that is the cortex's alone, and of those of strain."""


def regional_map(week: float, part: str = "") -> str:
    """Returns the name of the map of relative growth from a week on, of all tissue or of a part such as `cortex`."""
    return "_".join(filter(None, ("regional_growth", part, f"{week:05.2f}")))


def known_weeks(weeks: Sequence[float], until: float | None, unmatched: str | None = None) -> list[float]:
    """Returns the first weeks of the intervals between successive weeks that end by the week `until`, if given.

    InputError where there is none; `unmatched` is then why surfaces did not tell of growth.
    """
    known = [first for first, second in pairwise(weeks) if until is None or second <= until]
    if not known and unmatched is not None:
        raise InputError(
            "the brains' surfaces do not tell of regional growth",
            found=unmatched,
            expected="the same vertices and triangles in all brains of the growth series, or label volumes",
            remedy="Name the brains that have them under growth.brains, or set follow.regional and directional to 0.",
        )
    if not known:
        raise InputError(
            "no two brains tell of regional growth",
            found=f"brains of {', '.join(f'{week:g}' for week in weeks)} GW, known until {until} GW",
            expected="two or more with label volumes, or with matched surfaces, up to that week",
            remedy="Raise follow.known_until_gw, add brains of earlier weeks, or set follow.regional to 0.",
        )
    return known


def regional_maps(
    weeks: Sequence[float],
    growth: Mapping[str, Floats],
    sizes: Mapping[str, Floats],
    points: Floats,
    right: NDArray[np.bool_],
    follow: Mapping[str, Any],
) -> dict[str, Floats]:
    """Returns the (n,) maps of relative growth of a run by name, those of the cortex among them where they are others.

    Parameters
    ----------
    weeks
        (w + 1,) of the brains, ascending.
    growth
        (w, n) local log growth per week between them: of `volume`, and of `area`, known at pial vertices only; and
        the (w, n, 6) `strain` per week where directions are asked for.
    sizes
        (n,) volumes and areas that belong to the vertices, 0 for the area of those inside.
    points, right
        (n, 3) vertices, and (n,) whether they are on the right.
    follow
        The settings.
    """
    first = known_weeks(weeks, follow["known_until_gw"])
    local = {"": regional_growth(weeks, growth["volume"], sizes["volume"], follow)}
    if follow["cortex"] == "area":
        pial = np.flatnonzero(sizes["area"] > 0)
        of_pial = regional_growth(weeks, growth["area"][:, pial], sizes["area"][pial], follow)
        # the area of a place inside the cortex is that of the pial surface over it
        local[CORTEX] = of_pial[:, cKDTree(points[pial]).query(points)[1]]
    found: dict[str, Floats] = {}
    if follow["directional"] > 0:
        strain = growth["strain"][: len(first)]
        smooth = smoothed_over_weeks(
            strain.reshape(len(strain), -1), list(weeks)[: len(first) + 1], follow["smoothing_gw"]
        )
        for week, values in zip(first, smooth.reshape(strain.shape), strict=True):
            name = regional_map(week, STRAIN)
            found |= {f"{name}_{part}": follow["directional"] * values[:, i] for i, part in enumerate(PARTS)}
    for part, maps in local.items():
        drawn = as_null_model(maps, points, right, follow)
        found |= {regional_map(week, part): values for week, values in zip(first, drawn, strict=True)}
    return found


def regional_growth(weeks: Sequence[float], rates: Floats, weights: Floats, follow: Mapping[str, Any]) -> Floats:
    """Returns the (k, n) maps of relative growth that a run knows, one for each of its `known_weeks`.

    Parameters
    ----------
    weeks
        (w + 1,) of the brains, ascending.
    rates
        (w, n) local log growth per week between them.
    weights
        (n,) sizes that belong to the vertices.
    follow
        The settings: regional, smoothing_gw, known_until_gw.
    """
    known = len(known_weeks(weeks, follow["known_until_gw"]))
    smooth = smoothed_over_weeks(rates[:known], list(weeks)[: known + 1], follow["smoothing_gw"])
    return relative_growth(smooth, weights, follow["regional"])


def smoothed_over_weeks(rates: Floats, weeks: Sequence[float], sigma_gw: float) -> Floats:
    """Returns (w, n) rates of successive intervals smoothed by a Gaussian over the weeks, from middle to middle.

    Intervals count by their length, and those beyond the ends not at all; 0 returns the rates as they are.
    """
    if sigma_gw == 0:
        return rates
    edges = np.asarray(weeks, dtype=float)
    middles = (edges[1:] + edges[:-1]) / 2
    kernel = np.exp(-0.5 * ((middles[:, None] - middles) / sigma_gw) ** 2) * np.diff(edges)
    return np.asarray(kernel / kernel.sum(axis=1, keepdims=True) @ rates)


def as_null_model(maps: Floats, points: Floats, right: NDArray[np.bool_], follow: Mapping[str, Any]) -> Floats:
    """Returns (k, n) maps of relative growth rotated over the hemispheres and with noise, where settings ask for it.

    Both are the same for all k maps. The noise is normal, cut at three standard deviations.

    Parameters
    ----------
    points, right
        (n, 3) vertices, and (n,) whether they are on the right.
    follow
        The settings: rotated, noise, seed.
    """
    if follow["rotated"]:
        maps = spun(points, maps.T, spins(1, follow["seed"])[0], right).T
    noise = np.random.default_rng(follow["seed"]).standard_normal(maps.shape[1])
    return np.asarray(maps * (1 + follow["noise"] * np.clip(noise, -3, 3)))


def relative_growth(rates: Floats, weights: Floats, amplitude: float) -> Floats:
    """Returns (w, n) local growth as a multiple of the whole's: 1 where all grows alike.

    Parameters
    ----------
    rates
        (w, n) local log growth per week in each interval.
    weights
        (n,) sizes that belong to the vertices.
    amplitude
        0 for uniform growth, 1 for differences as measured.

    InputError where the whole does not grow in an interval, so that there is nothing to be a multiple of.
    """
    whole = np.average(rates, axis=1, weights=weights)[:, None]
    if (whole <= 0).any():
        raise InputError(
            "the brain does not grow between two of the weeks, so that local growth has no measure",
            found=f"log growth per week {whole.ravel().round(3).tolist()}",
            remedy="Leave the brain that does not fit out of growth.brains, or set follow.regional to 0.",
        )
    return np.clip(1 + amplitude * (rates / whole - 1), SLOWEST, FASTEST)
