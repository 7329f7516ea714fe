"""Where growth is fast or slow: maps of relative growth for a run, from the local growth between brains."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.matching import spins, spun
from ..geometry.triangles import Floats
from ..parameters.folding import AXES
from ..parameters.folding import STRAIN as PARTS

SLOWEST, FASTEST = -1.0, 3.0
"""Bounds of local growth as a multiple of the whole brain's."""
CORTEX, STRAIN = "cortex", "strain"
"""In the names of a map that is the cortex's alone, and of those of strain."""


def regional_map(week: float, part: str = "") -> str:
    """Returns the name of the map of relative growth from a week on, of all tissue or of a part such as `cortex`."""
    return "_".join(filter(None, ("regional_growth", part, f"{week:05.2f}")))


def target_map(week: float) -> str:
    """Returns what the names of the maps of positions that a mesh is to have at a week begin with."""
    return f"target_{week:05.2f}"


def target_maps(weeks: Sequence[float], positions: Floats) -> dict[str, Floats]:
    """Returns the (n,) maps by name of the (w, n, 3) positions that a mesh is to have at w weeks."""
    return {
        f"{target_map(week)}_{axis}": values
        for week, places in zip(weeks, positions, strict=True)
        for axis, values in zip(AXES, places.T, strict=True)
    }


def map_names(weeks: Sequence[float], follow: Mapping[str, Any], unmatched: str | None) -> dict[str, dict[float, str]]:
    """Returns the parameters that name the maps of regional growth, by the week from which each map holds.

    Parameters
    ----------
    weeks
        Of the brains between which growth is known.
    follow
        The settings.
    unmatched
        Why surfaces did not tell of growth.
    """
    known = known_weeks(weeks, follow["known_until_gw"], unmatched)
    parts = {"regional_growth": ""}
    if follow["directional"] > 0:
        parts["regional_strain"] = STRAIN
    if follow["cortex"] == "area":
        parts["regional_growth_of_cortex"] = CORTEX
    return {name: {week: regional_map(week, part) for week in known} for name, part in parts.items()}


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
        The settings. Maps are `rotated`, and multiplied by normal `noise` cut at three standard deviations, where these
        ask for it.
    """
    first = known_weeks(weeks, follow["known_until_gw"])

    def smooth(rates: Floats) -> Floats:
        return smoothed_over_weeks(rates[: len(first)], list(weeks)[: len(first) + 1], follow["smoothing_gw"])

    local = {"": relative_growth(smooth(growth["volume"]), sizes["volume"], follow["regional"])}
    if follow["cortex"] == "area":
        pial = np.flatnonzero(sizes["area"] > 0)
        of_pial = relative_growth(smooth(growth["area"][:, pial]), sizes["area"][pial], follow["regional"])
        # the area of a place inside the cortex is that of the pial surface over it
        local[CORTEX] = of_pial[:, cKDTree(points[pial]).query(points)[1]]
    found: dict[str, Floats] = {}
    if follow["directional"] > 0:
        strain = growth["strain"]
        parts = smooth(strain.reshape(len(strain), -1)).reshape(len(first), *strain.shape[1:])
        for week, values in zip(first, parts, strict=True):
            name = regional_map(week, STRAIN)
            found |= {f"{name}_{part}": follow["directional"] * values[:, i] for i, part in enumerate(PARTS)}
    # null models, the same for all weeks and parts: maps rotated over the hemispheres, and noise
    noise = np.clip(np.random.default_rng(follow["seed"]).standard_normal(len(points)), -3, 3)
    for part, maps in local.items():
        if follow["rotated"]:
            maps = spun(points, maps.T, spins(1, follow["seed"])[0], right).T
        drawn = maps * (1 + follow["noise"] * noise)
        found |= {regional_map(week, part): values for week, values in zip(first, drawn, strict=True)}
    return found


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


def relative_growth(rates: Floats, weights: Floats, amplitude: float) -> Floats:
    """Returns (w, n) local growth as a multiple of the whole's: 1 where all grows alike.

    Rates are (w, n) local log growth per week, weights the (n,) sizes of the vertices; the amplitude is 0 for uniform
    growth, 1 for differences as measured. InputError where the whole does not grow in an interval, so that there is
    nothing to be a multiple of.
    """
    whole = np.average(rates, axis=1, weights=weights)[:, None]
    if (whole <= 0).any():
        raise InputError(
            "the brain does not grow between two of the weeks, so that local growth has no measure",
            found=f"log growth per week {whole.ravel().round(3).tolist()}",
            remedy="Leave the brain that does not fit out of growth.brains, or set follow.regional to 0.",
        )
    return np.clip(1 + amplitude * (rates / whole - 1), SLOWEST, FASTEST)
