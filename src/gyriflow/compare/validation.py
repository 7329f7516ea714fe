"""What a study's simulations are worth: a row per run and week.

Beside them how the surface moves and how much it is folded, each against the real brain.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd

from ..errors import InputError
from ..geometry.alignment import fit_onto, rigid_fit, without_rigid_motion
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    area,
    face_components,
    signed_volume,
    transformed,
    vertex_areas,
)
from ..units import CM2_PER_MM2, ML_PER_MM3
from .placement import placement
from .prediction import apart, distances
from .shapes import Shape, against_real, cortex_dice

type Kind = Literal["explained", "predicted"]
"""Whether growth came from the weeks that are compared, or from another brain, atlas or only earlier weeks."""

AGREEMENT = ("gyrification_index", "gyrification_index_envelope", "mean_sulcal_depth", "mean_curvedness")
"""What is compared of the table of metrics."""
BAND = "spangy_share_B"
"""What the names of the spectrum's shares begin with: relative power of a band."""


@dataclass(frozen=True)
class Comparison:
    """Which simulated brain is compared: weeks are those that the run began at, and that is compared."""

    run: str
    kind: Kind
    start_week: float
    week: float

    @property
    def horizon(self) -> float:
        """Weeks from the start to the one compared."""
        return self.week - self.start_week


def validation_row(
    comparison: Comparison,
    *,
    simulated: TriangleMesh,
    real_brain: TriangleMesh,
    curve: tuple[float, float] | None,
    run: Shape,
    real: Shape,
    start: Shape,
    adjacent: Shape | None,
) -> dict[str, Any]:
    """Returns a row of validation.csv.

    Columns: run, kind, start_week, week, horizon; distance_mm and distance95_mm of `prediction.distances` and
    `cortex_dice`, both of the surfaces as they are, laid onto each other rigidly; area_cm2, volume_ml and the same with
    real_ and curve_ in front; area_error and volume_error against the curve and area_difference and volume_difference
    from the real brain, as fractions; relative_area, real_relative_area (A/V^⅔ as they are, before remeshing); those of
    `placement.placement` and `shapes.against_real`.

    `simulated` and `real_brain` are closed surfaces in mm as they are; `curve` the area (mm²) and volume (mm³) that the
    run was to follow in this week, if any; the shapes are ready and laid onto the real brain, as for `placement`.
    """
    sizes = {"": _sizes(simulated), "real_": _sizes(real_brain)}
    wanted = (np.nan, np.nan) if curve is None else (curve[0] * CM2_PER_MM2, curve[1] * ML_PER_MM3)
    row: dict[str, Any] = asdict(comparison) | {"horizon": comparison.horizon}
    placed = transformed(simulated, fit_onto(simulated, real_brain))
    row |= distances(apart(placed, real_brain, real.mesh)) | {"cortex_dice": cortex_dice(placed, real_brain)}
    row |= {f"{who}{name}": value for who, size in sizes.items() for name, value in size.items()}
    row |= {"curve_area_cm2": wanted[0], "curve_volume_ml": wanted[1]}
    for name, unit, aim in (("area", "cm2", wanted[0]), ("volume", "ml", wanted[1])):
        row[f"{name}_error"] = row[f"{name}_{unit}"] / aim - 1
        row[f"{name}_difference"] = row[f"{name}_{unit}"] / row[f"real_{name}_{unit}"] - 1
    row |= placement(real, run, start, adjacent, horizon=comparison.horizon, seed=0)
    return row | against_real(run, real)


def ordered(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Returns rows of `validation_row` as a table, what is compared first, by run, start and week."""
    first = ["run", "kind", "start_week", "week", "horizon", "distance_mm", "distance95_mm", "cortex_dice"]
    table = pd.DataFrame(rows)
    return table[[*first, *table.columns.difference(first, sort=False)]].sort_values(
        ["run", "start_week", "week"], ignore_index=True
    )


def _sizes(mesh: TriangleMesh) -> dict[str, float]:
    surface, volume = area(mesh), signed_volume(mesh)
    return {
        "area_cm2": surface * CM2_PER_MM2,
        "volume_ml": volume * ML_PER_MM3,
        "relative_area": surface / volume ** (2 / 3),
    }


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


def displacement_table(
    weeks: Sequence[float], simulated: Floats, measured: Floats, faces: Ints, *, registered: bool = False
) -> pd.DataFrame:
    """Returns how the displacement of the pial vertices agrees with the measured one, a row per interval of weeks.

    The rigid part of each interval is removed from both, and the simulated vectors are turned as the simulated brain
    lies to the measured one. Beside it stands uniform scaling: all vertices of the measured surface moved away from its
    centroid so that the volume grows as measured. All this is done piece by piece where the surface has several:
    nothing joins hemispheres that are bodies of their own, so that growth does not say how they lie to each other.

    Weeks ascend; simulated and measured are (w, n, 3) positions in mm of the same vertices, of the run and carried
    along the registration; faces the (m, 3) triangles of the closed surface. Growth that came
    from that very registration (`registered`) tests the solver's consistency, not the model.

    Returns
    -------
    DataFrame
        from_week, to_week, test (consistency or comparison), displacement_r, displacement_slope,
        displacement_r_scaling, displacement_slope_scaling, rms_mm, measured_rms_mm (root mean square by area, of the
        interval).
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
        test = "consistency" if registered else "comparison"
        rows.append((weeks[number], weeks[number + 1], test, r, slope, r_scaling, slope_scaling, *sizes))
    columns = ["displacement_r", "displacement_slope", "displacement_r_scaling", "displacement_slope_scaling"]
    return pd.DataFrame(rows, columns=["from_week", "to_week", "test", *columns, "rms_mm", "measured_rms_mm"])


def folding_agreement(
    metrics: pd.DataFrame, spectra: pd.DataFrame, pairs: Sequence[tuple[str, str, float, str]]
) -> pd.DataFrame:
    """Returns metrics of simulated brains beside those of the real ones, a row per brain, week, hemisphere and metric.

    Metrics have the columns subject, run ("real" for real brains), week, hemisphere, metric, value; spectra subject,
    run, week, hemisphere, band, relative_power; pairs are (run, start brain, week, real brain). Columns run, subject,
    week, real, hemisphere, metric (of `AGREEMENT`, and `BAND` with a number), value, real_value, difference (value less
    real_value). Metrics that one of the two lacks are left out.
    """
    shares = spectra.dropna(subset="relative_power")
    shares = shares.assign(metric=BAND + shares["band"].astype(str), value=shares["relative_power"])
    keys = ["run", "subject", "week", "hemisphere", "metric", "value"]
    both = pd.concat([table[keys] for table in (metrics[metrics["metric"].isin(AGREEMENT)], shares)])
    wanted = pd.DataFrame(pairs, columns=["run", "subject", "week", "real"])
    real = both[both["run"] == "real"].drop(columns=["run", "week"])
    real = real.rename(columns={"subject": "real", "value": "real_value"})
    table = wanted.merge(both, on=["run", "subject", "week"]).merge(real, on=["real", "hemisphere", "metric"])
    table = table.assign(difference=table["value"] - table["real_value"])
    return table[["run", "subject", "week", "real", "hemisphere", "metric", "value", "real_value", "difference"]]
