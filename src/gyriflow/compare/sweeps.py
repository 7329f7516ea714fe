"""Sweeps: how far each run is from the observed brains of a week, and which run is nearest by each measure."""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.triangles import TriangleMesh
from ..metrics.spangy import spectral_distances
from ..quantities import Shown, metrics_shown
from ..settings.terms import ELEMENTS_NEEDED, FOLD_BANDS, MEASURED, SPECTRUM_PREFIXES
from .distances import aligned_distances

WEYL_NUMBER = "weyl_number"
"""The metric whose largest value among the compared brains is the number of modes in cut spectra."""
CROSSING_FACES = "crossing_faces"
"""The metric that counts collisions."""
NOT_RESOLVED = "not resolved"
"""Flag of a band that is too fine for the edges or the curvature radius: it has no distance."""
NO_NEAREST = "no nearest run: the band is not resolved; use shorter edges and a smaller metrics.curvature_radius_mm"
"""Flag of a measure that no run resolves."""
COEFFICIENTS = ["subject", "run", "hemisphere", "mode", "band", "coefficient_shape_index"]
"""Columns of the coefficients that spectra are cut with."""
WITHOUT_DISTANCE = (WEYL_NUMBER, CROSSING_FACES)
"""Metrics that are compared, but are not measures of similarity."""
DISTANCE_COLUMNS = ("hemisphere", "measure", "value", "real_value", "distance", "unit", "flag")
"""Columns of `distances_to`."""
PARAMETERS = (
    *("thickness_mm", "shear_modulus_cortex_pa", "shear_modulus_core_pa", "poisson_ratio"),
    *("growth_rate_per_s", "radial_growth_rate_per_s", "step_s", "start_week", "end_week"),
)
"""Parameters of each run in `members.csv`, as in the tables of the FetalFoldSim paper."""
LABELS = ("subject", "run", "real", "real_population", "same_population")
COMPARISON_COLUMNS = [*LABELS, *DISTANCE_COLUMNS]

Parts = Mapping[str, TriangleMesh]
"""Surfaces of a brain in mm: the "whole" and its hemispheres."""


def comparison_table(
    run: str,
    subject: str,
    populations: Mapping[str, str],
    metrics: pd.DataFrame,
    spectra: pd.DataFrame,
    simulated: Parts,
    observed: Mapping[str, Parts],
) -> pd.DataFrame:
    """Measure how far a simulated brain is from each observed one.

    Parameters
    ----------
    run, subject
        Names of the run and of its start brain.
    populations
        Populations of the start brain and of the observed brains, by id.
    metrics, spectra
        Rows of the simulated brain and of the observed ones, whose `run` is "real".
    simulated, observed
        Surfaces of the simulated brain, and of the observed ones by id, in the same order of parts.

    Returns
    -------
    DataFrame
        The columns `COMPARISON_COLUMNS`: those of `distances_to`, after subject, run, observed brain and population.
    """
    spectral = spectral_distances(spectra)
    spectral = spectral[spectral["run"] != MEASURED]
    tables = []
    for brain, parts in observed.items():
        surfaces = {part: aligned_distances(simulated[part], mesh) for part, mesh in parts.items()}
        same = populations[brain] == populations[subject]
        labels: dict[str, Any] = dict(zip(LABELS, (subject, run, brain, populations[brain], same), strict=True))
        tables.append(distances_to(brain, metrics, spectra, spectral, surfaces).assign(**labels)[COMPARISON_COLUMNS])
    return joined_comparisons(tables)


def joined_comparisons(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Join tables of comparisons. Without any rows, return an empty table with their columns."""
    tables = [table for table in tables if len(table)]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=COMPARISON_COLUMNS)


def distances_to(
    observed: str,
    metrics: pd.DataFrame,
    spectra: pd.DataFrame,
    spectral: pd.DataFrame,
    surfaces: Mapping[str, Mapping[str, float]],
) -> pd.DataFrame:
    """Return the distances of one simulated brain from an observed one, a row per hemisphere and measure.

    Parameters
    ----------
    observed
        Id of the observed brain.
    metrics, spectra
        Rows of the simulated brain and of the observed one, whose `run` is "real".
    spectral
        Rows of `metrics.spangy.spectral_distances` of the simulated brain, with the column `real`.
    surfaces
        `distances.aligned_distances` by hemisphere.

    Returns
    -------
    DataFrame
        The columns `DISTANCE_COLUMNS`; flag is "ok" or the reason why the value is not reliable. Measures are
        `relative_power_B4` to `B6`, the share of a band in the power of the spectrum of mean curvature, and
        `shape_index_relative_power_B4` to `B6` (distance: absolute difference); `spectral_distance_…`;
        `surface_distance` and `surface_distance95` (distance_mm and distance95_mm of the surfaces); `area`, `volume`,
        `gyrification_index` (distance: absolute relative difference); `weyl_number` and `crossing_faces` (no distance).
    """
    rows = [*_band_rows(observed, spectra), *_size_rows(observed, metrics)]
    for row in spectral[spectral["real"] == observed].itertuples():
        rows.append((row.hemisphere, row.metric, np.nan, np.nan, row.value, "1", row.flag))
    for hemisphere, distances in surfaces.items():
        for name in ("distance", "distance95"):
            rows.append((hemisphere, f"surface_{name}", np.nan, np.nan, distances[f"{name}_mm"], "mm", "ok"))
    return pd.DataFrame(rows, columns=list(DISTANCE_COLUMNS))


def _band_rows(observed: str, spectra: pd.DataFrame) -> Iterator[tuple]:
    pairs = _pairs(spectra[spectra["band"].isin(FOLD_BANDS)], observed, ["hemisphere", "proxy", "band"])
    for pair in pairs.sort_values("band", kind="stable").to_dict("records"):
        values = pair["relative_power"], pair["relative_power_real"]
        if not (pair["complete"] and pair["complete_real"]):
            values = np.nan, np.nan
        measure = f"{SPECTRUM_PREFIXES[pair['proxy']]}relative_power_B{pair['band']}"
        yield _band_row(pair["hemisphere"], measure, *values, resolved=pair["resolved"] and pair["resolved_real"])


def _band_row(hemisphere: str, measure: str, value: float, real_value: float, *, resolved: bool) -> tuple:
    flag = NOT_RESOLVED if not resolved else "cut off" if np.isnan(value + real_value) else "ok"
    return hemisphere, measure, value, real_value, abs(value - real_value) if flag == "ok" else np.nan, "1", flag


def with_common_cut(comparison: pd.DataFrame, coefficients: pd.DataFrame) -> pd.DataFrame:
    """Add the shares of spectra that are all cut at one number of modes per side, as in the FetalFoldSim paper.

    The number is the largest Weyl number of the compared surfaces, simulated and observed. The measures are
    `shape_index_relative_power_B4_weyl` to `B6_weyl`, with the flag "cut off" if fewer modes were computed or the band
    begins beyond the cut.

    Parameters
    ----------
    comparison
        The columns `COMPARISON_COLUMNS` of all runs of a sweep.
    coefficients
        Columns subject, run ("real" for observed brains), hemisphere, mode, band, coefficient_shape_index of all
        simulated and observed brains in the comparison.
    """
    numbers = comparison[comparison["measure"] == WEYL_NUMBER]
    cuts = numbers.groupby("hemisphere")[["value", "real_value"]].max().max(axis=1).to_dict()
    shares = {}
    for (run, subject, side), modes in coefficients.groupby(["run", "subject", "hemisphere"]):
        cut = cuts.get(side, np.inf)
        powers = modes[modes["mode"] < cut].set_index("band")["coefficient_shape_index"] ** 2
        power = powers.groupby("band").sum().reindex(range(1, max(FOLD_BANDS) + 1))
        shares[run, subject, side] = power / power.sum() if len(modes) >= cut else power * np.nan
    rows = []
    flags = comparison.set_index(["run", "subject", "real", "hemisphere", "measure"])["flag"]
    for row in numbers.to_dict("records"):
        labels, side = [row[name] for name in LABELS], row["hemisphere"]
        simulated, observed = shares[row["run"], row["subject"], side], shares[MEASURED, row["real"], side]
        for band in FOLD_BANDS:
            name = f"shape_index_relative_power_B{band}"
            resolved = flags[row["run"], row["subject"], row["real"], side, name] != NOT_RESOLVED
            values = simulated[band], observed[band]
            rows.append([*labels, *_band_row(side, f"{name}_weyl", *values, resolved=resolved)])
    return joined_comparisons([comparison, pd.DataFrame(rows, columns=COMPARISON_COLUMNS)])


def _size_rows(observed: str, metrics: pd.DataFrame) -> Iterator[tuple]:
    rows = metrics[metrics["metric"].isin([*metrics_shown(Shown.SIZE), *WITHOUT_DISTANCE])]
    for pair in _pairs(rows, observed, ["hemisphere", "metric"]).to_dict("records"):
        has_distance = pair["metric"] not in WITHOUT_DISTANCE
        distance = abs(pair["value"] / pair["value_real"] - 1) if has_distance else np.nan
        yield pair["hemisphere"], pair["metric"], pair["value"], pair["value_real"], distance, str(pair["unit"]), "ok"


def _pairs(table: pd.DataFrame, observed: str, keys: list[str]) -> pd.DataFrame:
    is_real = table["run"] == MEASURED
    observed_rows = table[is_real & (table["subject"] == observed)]
    return table[~is_real].merge(observed_rows, on=keys, suffixes=("", "_real"))


def member_row(
    labels: Mapping[str, object], values: Mapping[str, object], params: Mapping, zones: Mapping, summary: Mapping
) -> dict[str, object]:
    """Return the row of a run in `members.csv`: its varied values, its outcome and its cost.

    `labels` are study, run, subject and compare_week; `values` are the varied values by key; `params`, `zones` and
    `summary` are the contents of the run's files.
    """
    elements = zones["elements_through_cortex"]
    is_resolved = elements is not None and elements >= ELEMENTS_NEEDED[zones["order"]]
    return {
        **labels,
        **values,
        **{key: params.get(key) for key in PARAMETERS},
        "contact.penalty_pa_per_m": params.get("contact", {}).get("penalty_pa_per_m"),
        "elements_through_cortex": elements,
        "resolution": "ok" if is_resolved else "not resolved by the mesh",
        "outcome": "finished" if summary.get("diverged") is None else "diverged",
        "reached_week": summary.get("reached_week", params["end_week"]),
        "cause": summary.get("diverged") or "",
        "steps": summary["steps"],
        "cpu_s": summary["cpu_seconds"],
    }


def nearest_runs(comparison: pd.DataFrame, members: pd.DataFrame, varied: Sequence[str]) -> pd.DataFrame:
    """Find the run that is nearest to each observed brain by each measure, per hemisphere.

    Parameters
    ----------
    comparison
        The columns subject, run, real and `DISTANCE_COLUMNS`.
    members
        Rows of `member_row`.
    varied
        Columns of members with the varied values.

    Returns
    -------
    DataFrame
        subject, real, hemisphere, measure, the varied values of the nearest run, run, distance, the values and the
        distance of the second nearest (`next_…`), and flag: "ok", or what makes the choice doubtful (a value at the end
        of the range, or not resolved). If no run resolves the band, there is no run and the flag is `NO_NEAREST`.
    """
    keys, varied = ["subject", "real", "hemisphere", "measure"], list(varied)
    columns = [*keys, *varied, "run", "distance", *(f"next_{name}" for name in varied), "next_distance", "flag"]
    table = comparison[comparison["distance"].notna() | (comparison["flag"] == NOT_RESOLVED)].merge(
        members[["subject", "run", *varied, "resolution"]], on=["subject", "run"]
    )
    rows = []
    for names, group in table.groupby(keys, sort=False):
        ordered = group.dropna(subset=["distance"]).sort_values("distance", kind="stable").to_dict("records")
        if not ordered:
            rows.append(dict(zip(keys, names, strict=True)) | {"flag": NO_NEAREST})
            continue
        best, *further = ordered
        row = {name: best[name] for name in (*keys, *varied, "run", "distance")}
        if further:
            row |= {f"next_{name}": further[0][name] for name in (*varied, "distance")}
        rows.append(row | {"flag": _flags(best, members[members["subject"] == best["subject"]], varied)})
    return pd.DataFrame(rows).reindex(columns=columns)


def _flags(best: Mapping[Hashable, Any], members: pd.DataFrame, varied: Sequence[str]) -> str:
    flags = [] if best["flag"] == "ok" else [f"band {best['flag']}"]
    if best["resolution"] != "ok":
        flags.append(str(best["resolution"]))
    for name in varied:
        values = pd.to_numeric(members[name], errors="coerce")
        if values.min() < values.max() and best[name] in (values.min(), values.max()):
            flags.append("at the end of the range")
    return "; ".join(dict.fromkeys(flags)) or "ok"
