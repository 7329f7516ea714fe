"""Maps of growth on the pial surface, from the growth that a simulation wrote to its frames."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ..geometry.triangles import Floats, TriangleMesh
from ..units import SECONDS_PER_GW


def growth_sd(members: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Return the standard deviation (n − 1) of the growth of area and thickness in maps of `growth_per_week`."""
    names = [name for name in members[0] if not name.startswith("growth_direction")]
    return {name: np.std([maps[name] for maps in members], axis=0, ddof=1) for name in names}


def growth_per_week(
    frames: Mapping[float, tuple[TriangleMesh, Mapping[str, Floats]]], step_s: float
) -> dict[tuple[float, float], dict[str, Floats]]:
    """Return maps of the mean growth between output weeks, by interval, at the vertices of the surface at its end.

    Parameters
    ----------
    frames
        {week: (surface, fields)} with the logarithms of the growth in a step, the mean since the last output week:
        `tangential_growth_per_step` and `radial_growth_per_step` (n,), and `growth_direction_per_step` (n, 3), the
        tangential direction of largest growth, as long as the difference to the growth across it.
    step_s
        Length of that step in s.

    Returns
    -------
    dict
        area_growth_percent_per_gw and thickness_growth_percent_per_gw (n,), and growth_direction_x, _y, _z, the
        vectors of the frames as logarithms per week.
    """
    steps = SECONDS_PER_GW / step_s
    return {
        (before, week): {
            "area_growth_percent_per_gw": 100 * np.expm1(2 * steps * frames[week][1]["tangential_growth_per_step"]),
            "thickness_growth_percent_per_gw": 100 * np.expm1(steps * frames[week][1]["radial_growth_per_step"]),
            **{
                f"growth_direction_{axis}": steps * values
                for axis, values in zip("xyz", frames[week][1]["growth_direction_per_step"].T, strict=True)
            },
        }
        for before, week in pairwise(sorted(frames))
    }
