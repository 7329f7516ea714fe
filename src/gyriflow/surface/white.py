"""Cortical thickness between a pial surface and the white surfaces that are given beside it."""

from collections.abc import Mapping
from typing import Any

import igl
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.layers import layer_thickness, nearest_on
from ..geometry.triangles import TriangleMesh, merged, transformed, vertex_areas
from ..parameters.terms import SIDES
from .thickness import Thickness, summary

Floats = NDArray[np.float64]

# on the medial wall, where there is no cortex, white and pial surfaces meet
LEAST_MM = 0.3
# the white surface crosses the pial one where so much of its area is so far outside
OUTSIDE_MM, MOST_OUTSIDE = 0.5, 0.01


def thickness_from_white(
    surface: TriangleMesh, report: Mapping[str, Any], whites: Mapping[str, TriangleMesh]
) -> Thickness:
    """Returns the cortical thickness on a pial surface: its distance from the white surface, as `cortical_thickness`.

    `surface` is the whole pial surface and `report` what was found when it was made, with its pose. `whites` are the
    white surfaces in the coordinates of the files that the pial one was made from, by side: "left", "right", or
    "whole". InputError where that of a side lies on the other one, and where a white surface crosses the pial one.
    """
    for side, white in _posed(report, whites).items():
        _require_own_side(white, side, report["fissure_x_mm"])
        _require_inside(white, surface, side)
    inner = merged(*_posed(report, whites).values())
    values = layer_thickness(surface, inner)
    measured = values >= LEAST_MM
    if not measured.any():
        raise InputError(
            "the white surface is the pial one",
            found=f"{values.max():.2f} mm between them at most",
            expected=f"{LEAST_MM} mm and more",
            remedy="Give the white surfaces under white.",
        )
    return Thickness(values, measured, summary(values, measured, vertex_areas(surface)))


def posed_whites(report: Mapping[str, Any], whites: Mapping[str, TriangleMesh]) -> TriangleMesh | None:
    """Returns the white surfaces as one, moved as the pial ones were; None where there are none."""
    return merged(*_posed(report, whites).values()) if whites else None


def _posed(report: Mapping[str, Any], whites: Mapping[str, TriangleMesh]) -> dict[str, TriangleMesh]:
    motions = report.get("motions", {})
    return {side: transformed(mesh, np.array(motions.get(side, report["pose"]))) for side, mesh in whites.items()}


def _require_own_side(white: TriangleMesh, side: str, fissure_x_mm: float) -> None:
    """Raises InputError where the middle of a side's white surface is beyond the fissure."""
    middle = float(np.average(white.vertices[:, 0], weights=vertex_areas(white)))
    if side in SIDES and (middle < fissure_x_mm) != (side == "left"):
        raise InputError(
            f"the white surface ({side}) lies in the other hemisphere",
            found=f"its middle at x = {middle:.1f} mm, the fissure at {fissure_x_mm:.1f} mm",
            expected=f"{'<' if side == 'left' else '>'} {fissure_x_mm:.1f} mm (RAS+)",
            remedy="Give each side its own white surface: they are swapped, or both are of one side.",
        )


def _require_inside(white: TriangleMesh, pial: TriangleMesh, side: str) -> None:
    outside = igl.fast_winding_number(pial.vertices, pial.faces, white.vertices) < 0.5
    distance, _ = nearest_on(white.vertices, pial)
    crossing = outside & (distance > OUTSIDE_MM)
    areas = vertex_areas(white)
    share = float(areas[crossing].sum() / areas.sum())
    if share > MOST_OUTSIDE:
        raise InputError(
            f"the white surface ({side}) crosses the pial one",
            found=f"{100 * share:.0f} % of its area outside, by up to {distance[crossing].max():.1f} mm",
            expected=f"at most {100 * MOST_OUTSIDE:.0f} % by more than {OUTSIDE_MM} mm",
            remedy="Give white and pial surfaces of one subject in the same coordinates.",
        )
