"""Maps of growth on the pial surface, from the growth that a simulation wrote to its frames."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ..geometry.triangles import Floats, TriangleMesh
from ..units import SECONDS_PER_GW


def growth_sd(run: Mapping[str, Floats], members: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Return the standard deviation (n − 1) of the growth of area and thickness over the members of a run's ensemble.

    All are maps of `growth_per_week`. The result is NaN for fewer than two members.
    """
    names = [name for name in run if not name.startswith("growth_direction")]
    if len(members) < 2:
        return {name: np.full_like(run[name], np.nan) for name in names}
    return {name: np.std([maps[name] for maps in members], axis=0, ddof=1) for name in names}


def growth_per_week(
    frames: Mapping[float, tuple[TriangleMesh, Mapping[str, Floats]]], step_s: float
) -> dict[tuple[float, float], dict[str, Floats]]:
    """Return maps of the mean growth between output weeks, by interval, at the vertices of the surface at its end.

    `frames` are by week the surface and its fields, of log growth per step averaged since the previous output week:
    `tangential_growth_per_step` and `radial_growth_per_step` (n,), and `growth_direction_per_step` (n, 3), the
    tangential direction of largest growth, as long as the difference of the two principal tangential log growths.
    `step_s` is the length of that step in s.

    Returns area_growth_percent_per_gw and thickness_growth_percent_per_gw (n,), and growth_direction_x, _y, _z, the
    vectors of the frames as logarithms per week.
    """
    steps = SECONDS_PER_GW / step_s
    # area grows with the square of the mean tangential stretch
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
