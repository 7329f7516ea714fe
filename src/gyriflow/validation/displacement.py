"""Whether the surface moves as in real brains: displacement of vertices against that of a registration."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..errors import InputError
from ..geometry.motion import rigid_fit, without_rigid_motion
from ..geometry.triangles import Floats, Ints, TriangleMesh, face_components, signed_volume, vertex_areas

COLUMNS = [
    *("from_week", "to_week", "displacement_r", "displacement_slope", "displacement_r_scaling"),
    *("displacement_slope_scaling", "rms_mm", "measured_rms_mm"),
]


def vector_agreement(one: Floats, measured: Floats, weights: Floats) -> tuple[float, float]:
    """Returns correlation and slope of (n, 3) vectors against measured ones.

    r = Σ w u·v/√(Σ w u² Σ w v²) and slope Σ w u·v/Σ w v²: 1 and 1 where they are equal. NaN where nothing moves.
    """
    both, own, other = (
        float(np.einsum("i,ij,ij->", weights, *pair)) for pair in ((one, measured), (one, one), (measured, measured))
    )
    if own <= 0 or other <= 0:
        return float("nan"), float("nan")
    return both / np.sqrt(own * other), both / other


def displacement_table(weeks: Sequence[float], simulated: Floats, measured: Floats, faces: Ints) -> pd.DataFrame:
    """Returns how the displacement of the pial vertices agrees with the measured one, a row per interval of weeks.

    The rigid part of each interval is removed from both, and the simulated vectors are turned as the simulated brain
    lies to the measured one. Beside it stands uniform scaling: all vertices of the measured surface moved away from its
    centroid so that the volume grows as measured. All this is done piece by piece where the surface has several:
    nothing joins hemispheres that are bodies of their own, so that growth does not say how they lie to each other.

    Parameters
    ----------
    weeks
        (w,) gestational weeks, ascending.
    simulated, measured
        (w, n, 3) positions in mm of the same vertices: of the run, and carried along the registration.
    faces
        (m, 3) triangles of the closed surface.

    Returns
    -------
    DataFrame
        from_week, to_week, displacement_r, displacement_slope, displacement_r_scaling, displacement_slope_scaling,
        rms_mm, measured_rms_mm (root mean square by area, of the interval).
    """
    if len(weeks) < 2 or simulated.shape != measured.shape or len(simulated) != len(weeks):
        raise InputError(
            "displacements are those of the same vertices in the same weeks",
            found=f"{len(weeks)} weeks, positions {simulated.shape} and {measured.shape}",
            expected="two or more weeks, equal shapes",
        )
    component = face_components(TriangleMesh(measured[0], faces))
    pieces = [np.unique(faces[component == number]) for number in range(component.max() + 1)]
    rows = []
    for number in range(len(weeks) - 1):
        shape = TriangleMesh(measured[number], faces)
        weights = vertex_areas(shape)
        grown = signed_volume(TriangleMesh(measured[number + 1], faces)) / signed_volume(shape)
        own, real, scaling = (np.zeros_like(shape.vertices) for _ in range(3))
        for piece in pieces:
            (first, then), (was, became) = (
                (places[number, piece], places[number + 1, piece]) for places in (simulated, measured)
            )
            turn = rigid_fit(first, was, weights[piece])[:3, :3]
            own[piece] = without_rigid_motion(first, then, weights[piece]) @ turn.T
            real[piece] = without_rigid_motion(was, became, weights[piece])
            scaling[piece] = (np.cbrt(grown) - 1) * (was - np.average(was, axis=0, weights=weights[piece]))
        r, slope = vector_agreement(own, real, weights)
        r_scaling, slope_scaling = vector_agreement(scaling, real, weights)
        sizes = [float(np.sqrt(np.average((vectors**2).sum(axis=1), weights=weights))) for vectors in (own, real)]
        rows.append((weeks[number], weeks[number + 1], r, slope, r_scaling, slope_scaling, *sizes))
    return pd.DataFrame(rows, columns=COLUMNS)
