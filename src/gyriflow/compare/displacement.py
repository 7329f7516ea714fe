"""Displacement of the pial surface from week to week: that of a run compared with that measured by registration."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError
from ..geometry.alignment import rigid_fit, without_rigid_motion
from ..geometry.triangles import Floats, Ints, TriangleMesh, face_components, signed_volume, vertex_areas


def vector_agreement(vectors: Floats, measured: Floats, weights: Floats) -> tuple[float, float]:
    """Return correlation and slope of (n, 3) vectors against measured ones.

    r = Σ w u·v/√(Σ w u² Σ w v²) and slope Σ w u·v/Σ w v²: 1 and 1 where they are equal. NaN where nothing moves.
    """
    pairs = (vectors, measured), (vectors, vectors), (measured, measured)
    product, square, measured_square = (float(weights @ (u * v).sum(axis=1)) for u, v in pairs)
    if square <= 0 or measured_square <= 0:
        return float("nan"), float("nan")
    return product / np.sqrt(square * measured_square), product / measured_square


def displacement_table(
    weeks: Sequence[float],
    simulated: Sequence[Floats],
    measured: Sequence[Floats],
    faces: Ints,
    *,
    registered: bool = False,
) -> pd.DataFrame:
    """Compare the displacement of the pial vertices with the measured one, a row per interval of weeks.

    Positions (n, 3) by week in mm are of the same vertices in the run and carried along the registration; `faces` (m,
    3) are the triangles. `registered` growth came from this very registration: then the table tests the solver's
    consistency, not the model. InputError for fewer than two weeks.

    The rigid motion of each interval is removed from both, and the simulated vectors are rotated into the pose of the
    measured brain. The baseline is uniform scaling: all vertices move away from the centroid of the measured surface,
    so that the volume grows as measured. Connected components are treated one by one: where nothing joins the
    hemispheres, growth does not determine their relative position.

    Columns from_week, to_week, test (consistency or comparison), displacement_r, displacement_slope,
    displacement_r_scaling, displacement_slope_scaling, rms_mm, measured_rms_mm (root mean square by area).
    """
    if len(weeks) < 2:
        found = f"{len(weeks)} weeks shared by the run and the registration"
        raise InputError("no displacement to compare", found=found, expected="two or more weeks")
    component = face_components(TriangleMesh(measured[0], faces))
    parts = [np.unique(faces[component == number]) for number in range(component.max() + 1)]
    rows = []
    for number in range(len(weeks) - 1):
        surface, later = (TriangleMesh(measured[index], faces) for index in (number, number + 1))
        areas = vertex_areas(surface)
        scale = np.cbrt(signed_volume(later) / signed_volume(surface)) - 1
        simulated_move, measured_move, scaling = (np.zeros_like(surface.vertices) for _ in range(3))
        for part in parts:
            before, after = (positions[part] for positions in simulated[number : number + 2])
            measured_before, measured_after = (positions[part] for positions in measured[number : number + 2])
            weights = areas[part]
            rotation = rigid_fit(before, measured_before, weights)[:3, :3]
            simulated_move[part] = without_rigid_motion(before, after, weights) @ rotation.T
            measured_move[part] = without_rigid_motion(measured_before, measured_after, weights)
            scaling[part] = scale * (measured_before - np.average(measured_before, axis=0, weights=weights))
        row: dict[str, Any] = {"from_week": weeks[number], "to_week": weeks[number + 1]}
        row["test"] = "consistency" if registered else "comparison"
        for suffix, vectors in (("", simulated_move), ("_scaling", scaling)):
            agreement = vector_agreement(vectors, measured_move, areas)
            row[f"displacement_r{suffix}"], row[f"displacement_slope{suffix}"] = agreement
        for name, vectors in (("rms_mm", simulated_move), ("measured_rms_mm", measured_move)):
            row[name] = float(np.sqrt(np.average((vectors**2).sum(axis=1), weights=areas)))
        rows.append(row)
    return pd.DataFrame(rows)
