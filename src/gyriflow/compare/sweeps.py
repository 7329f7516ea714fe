"""Sweeps: how far each run is from the observed brains of a week, and which run is
nearest by each measure."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.triangles import TriangleMesh
from ..metrics.spangy import spectral_distances
from ..quantities import Shown, metrics_shown
from ..settings.growth import GROWTH_MODELS
from ..settings.terms import FOLD_BANDS, OBSERVED, SPECTRUM_PREFIXES, is_too_coarse
from .comparison import aligned_distances

WEYL_NUMBER = "weyl_number"
"""The metric whose largest value among the compared brains is the number of modes in
cut spectra."""
CROSSING_FACES = "crossing_faces"
"""The metric that counts collisions."""
NOT_RESOLVED = "not resolved"
"""Flag of a band that is too fine for the edges or the curvature radius: it has no
distance."""
NO_NEAREST = (
    "no nearest run: the band is not resolved; use shorter edges and a smaller"
    " metrics.curvature_radius_mm"
)
"""Flag of a measure that no run resolves."""
COEFFICIENTS = [
    "subject",
    "run",
    "hemisphere",
    "mode",
    "band",
    "coefficient_shape_index",
]
"""Columns of the coefficients that spectra are cut with."""
WITHIN_NOISE = "within noise of the next"
"""Flag of a nearest run that is nearer than the next one by less than a brain is from
itself, measured again."""
WITHOUT_DISTANCE = (WEYL_NUMBER, CROSSING_FACES)
"""Metrics that are compared, but are not measures of similarity."""
_VALUES = ("value", "observed_value")
PARAMETERS = (
    "thickness_mm",
    "shear_modulus_cortex_pa",
    "shear_modulus_core_pa",
    "poisson_ratio",
    "growth_rate_per_s",
    "step_s",
    "start_week",
    "end_week",
)
"""Parameters of each run in `members.csv`, as in the tables of the FetalFoldSim
paper."""
COMPARISON_COLUMNS = [
    *("subject", "run", "observed", "observed_population", "same_population"),
    *("hemisphere", "measure", *_VALUES, "distance", "unit", "flag"),
]

Parts = Mapping[str, TriangleMesh]
"""Surfaces of a brain in mm: the "whole" and its hemispheres."""


def member_comparison(
    run: str,
    subject: str,
    populations: Mapping[str, str],
    metrics: pd.DataFrame,
    spectra: pd.DataFrame,
    simulated: Parts,
    observed: Mapping[str, Parts],
) -> pd.DataFrame:
    """Measure how far a simulated brain is from each observed one.

    `run` and `subject` name the run and its start brain; `populations` are those of the
    start brain and of the observed brains, by id. Metrics and spectra have the rows of
    the simulated brain and of the observed ones, whose `run` is so named. The observed
    surfaces by id have the same parts as the simulated ones.

    Columns are `COMPARISON_COLUMNS`; flag is "ok" or the reason why the value is not
    reliable. Measures are `relative_power_B4` to `B6`, the share of a band in the power
    of the spectrum of mean curvature, and `shape_index_relative_power_B4` to `B6`
    (distance: absolute difference); `area`, `volume`, `gyrification_index` (distance:
    absolute relative difference); `weyl_number` and `crossing_faces` (no distance);
    `spectral_distance_…`; `surface_distance` and `surface_distance95` (distance_mm and
    distance95_mm of `comparison.compare`).
    """
    bands = _pairs(
        spectra[spectra["band"].isin(FOLD_BANDS)], ["hemisphere", "proxy", "band"]
    )
    measure = (
        bands["proxy"].map(SPECTRUM_PREFIXES)
        + "relative_power_B"
        + bands["band"].astype(str)
    )
    complete, resolved = (
        bands[name].astype(bool) & bands[f"{name}_observed"].astype(bool)
        for name in ("complete", "resolved")
    )
    values = (
        bands[name].where(complete)
        for name in ("relative_power", "relative_power_observed")
    )
    bands = _with_distance(
        bands.assign(
            **dict(zip(_VALUES, values, strict=True)),
            measure=measure,
        ),
        resolved,
    )

    sizes = _pairs(
        metrics[
            metrics["metric"].isin([*metrics_shown(Shown.SIZE), *WITHOUT_DISTANCE])
        ],
        ["hemisphere", "metric"],
    )
    sizes = sizes.rename(
        columns={"metric": "measure", "value_observed": "observed_value"}
    ).assign(flag="ok")
    distance = (sizes["value"] / sizes["observed_value"] - 1).abs()
    sizes["distance"] = distance.where(~sizes["measure"].isin(WITHOUT_DISTANCE))

    spectral = spectral_distances(spectra)
    spectral = spectral[
        (spectral["run"] != OBSERVED) & spectral["observed"].isin(observed)
    ]
    spectral = spectral.rename(
        columns={"metric": "measure", "value": "distance"}
    ).assign(unit="1")

    surfaces = []
    for brain, parts in observed.items():
        for part, mesh in parts.items():
            found = aligned_distances(simulated[part], mesh)
            for name in ("distance", "distance95"):
                row = {"observed": brain, "hemisphere": part}
                row["measure"] = f"surface_{name}"
                surfaces.append({**row, "distance": found[f"{name}_mm"]})
    tables = [
        bands,
        sizes,
        spectral,
        pd.DataFrame(surfaces).assign(unit="mm", flag="ok"),
    ]
    table = pd.concat(
        [
            table.reindex(columns=COMPARISON_COLUMNS).dropna(axis=1, how="all")
            for table in tables
        ]
    )
    population = table["observed"].map(populations)
    table = table.assign(
        subject=subject,
        run=run,
        observed_population=population,
    )
    table["same_population"] = population == populations[subject]
    return table.reindex(columns=COMPARISON_COLUMNS).sort_values(
        "observed", kind="stable", ignore_index=True
    )


def joined_comparisons(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Join tables of comparisons. Without any rows, return an empty table with their
    columns."""
    tables = [table for table in tables if len(table)]
    return (
        pd.concat(tables, ignore_index=True)
        if tables
        else pd.DataFrame(columns=COMPARISON_COLUMNS)
    )


def _pairs(table: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """Join the rows of the simulated brain with those of each observed one
    (`observed`), whose columns end so."""
    is_observed = table["run"] == OBSERVED
    pairs = table[~is_observed].merge(
        table[is_observed], on=keys, suffixes=("", "_observed")
    )
    return pairs.assign(observed=pairs["subject_observed"])


def _with_distance(bands: pd.DataFrame, resolved: pd.Series) -> pd.DataFrame:
    """Add the distance of shares of bands, the unit, and the flag: "ok", "cut off"
    (NaN) or `NOT_RESOLVED`."""
    distance = (bands["value"] - bands["observed_value"]).abs()
    flag = pd.Series("ok", index=bands.index)
    flag[distance.isna()] = "cut off"
    flag[~resolved] = NOT_RESOLVED
    return bands.assign(
        distance=distance.where(resolved),
        unit="1",
        flag=flag,
    )


def with_common_cut(
    comparison: pd.DataFrame, coefficients: pd.DataFrame
) -> pd.DataFrame:
    """Add the shares of spectra that are all cut at one number of modes per side, as in
    the FetalFoldSim paper.

    The number is the largest Weyl number of the compared surfaces, simulated and
    observed, in the `comparison` of all runs of a sweep. The measures are
    `shape_index_relative_power_B4_weyl` to `B6_weyl`, with the flag "cut off" if fewer
    modes were computed or the band begins beyond the cut. Coefficients have the columns
    `COEFFICIENTS` of all brains compared.
    """
    numbers = comparison[comparison["measure"] == WEYL_NUMBER]
    cuts = numbers.groupby("hemisphere")[list(_VALUES)].max().max(axis=1).to_dict()
    shares = {}
    for (run, subject, side), modes in coefficients.groupby(
        ["run", "subject", "hemisphere"]
    ):
        cut = cuts.get(side, np.inf)
        powers = (
            modes[modes["mode"] < cut].set_index("band")["coefficient_shape_index"] ** 2
        )
        power = powers.groupby("band").sum().reindex(range(1, max(FOLD_BANDS) + 1))
        shares[run, subject, side] = (
            power / power.sum() if len(modes) >= cut else power * np.nan
        )
    bands = {f"shape_index_relative_power_B{band}": band for band in FOLD_BANDS}
    rows = comparison[comparison["measure"].isin(bands)]
    keys = rows[["run", "subject", "hemisphere"]].assign(
        band=rows["measure"].map(bands)
    )
    observed_keys = keys.assign(run=OBSERVED, subject=rows["observed"])
    values = (
        pd.concat(shares).loc[list(pairs.itertuples(index=False))].to_numpy()
        for pairs in (keys, observed_keys)
    )
    cut = rows.assign(
        measure=rows["measure"] + "_weyl", **dict(zip(_VALUES, values, strict=True))
    )
    return joined_comparisons(
        [comparison, _with_distance(cut, rows["flag"] != NOT_RESOLVED)]
    )


def member_row(
    labels: Mapping[str, object],
    values: Mapping[str, object],
    params: Mapping,
    zones: Mapping,
    summary: Mapping,
) -> dict[str, object]:
    """Return the row of a run in `members.csv`: its varied values, its outcome and its
    cost.

    Labels are study, run, subject and compare_week; `values` the varied values by key;
    the rest are the contents of the run's files.
    """
    elements = zones["elements_through_cortex"]
    has_layers = GROWTH_MODELS[params["growth"]["model"]].has_layers
    is_resolved = not has_layers or (
        elements is not None and not is_too_coarse(zones["order"], elements)
    )
    return {
        **labels,
        **values,
        **{key: params.get(key) for key in PARAMETERS},
        "elements_through_cortex": elements,
        "resolution": "ok" if is_resolved else "not resolved by the mesh",
        "outcome": "finished" if summary.get("diverged") is None else "diverged",
        "reached_week": summary.get("reached_week", params["end_week"]),
        "cause": summary.get("diverged") or "",
        "steps": summary["steps"],
        "cpu_s": summary["cpu_seconds"],
    }


def nearest_runs(
    comparison: pd.DataFrame,
    members: pd.DataFrame,
    varied: Sequence[str],
) -> pd.DataFrame:
    """Find the run that is nearest to each observed brain by each measure, per
    hemisphere.

    The comparison has the columns `COMPARISON_COLUMNS`; members are rows of
    `member_row`, whose columns `varied` have the varied values.

    Columns subject, observed, hemisphere, measure, the varied values of the nearest
    run, run, distance, the values and the distance of the second nearest (`next_…`),
    and flag: "ok", or what makes the choice doubtful (a value at the end of the range,
    or not resolved). If no run resolves the band, the run is empty and the flag is
    `NO_NEAREST`.
    """
    keys, varied = ["subject", "observed", "hemisphere", "measure"], list(varied)
    columns = [
        *keys,
        *varied,
        "run",
        "distance",
        *(f"next_{name}" for name in varied),
        "next_distance",
        "flag",
    ]
    table = comparison[
        comparison["distance"].notna() | (comparison["flag"] == NOT_RESOLVED)
    ].merge(members[["subject", "run", *varied, "resolution"]], on=["subject", "run"])
    rows = []
    for names, group in table.groupby(keys, sort=False):
        ordered = (
            group.dropna(subset=["distance"])
            .sort_values("distance", kind="stable")
            .to_dict("records")
        )
        if not ordered:
            rows.append(dict(zip(keys, names, strict=True)) | {"flag": NO_NEAREST})
            continue
        best, *further = ordered
        row = {name: best[name] for name in (*keys, *varied, "run", "distance")}
        if further:
            row |= {f"next_{name}": further[0][name] for name in (*varied, "distance")}
        flags = _flags(
            best,
            members[members["subject"] == best["subject"]],
            varied,
        )
        if further and further[0]["distance"] - best["distance"] < best.get(
            "noise", 0.0
        ):
            flags = f"{WITHIN_NOISE}; {flags}".removesuffix("; ok")
        rows.append(row | {"flag": flags})
    return pd.DataFrame(rows).reindex(columns=columns)


def _flags(
    best: Mapping[Hashable, Any],
    members: pd.DataFrame,
    varied: Sequence[str],
) -> str:
    flags = [] if best["flag"] == "ok" else [f"band {best['flag']}"]
    if best["resolution"] != "ok":
        flags.append(str(best["resolution"]))
    for name in varied:
        values = pd.to_numeric(members[name], errors="coerce")
        if values.min() < values.max() and best[name] in (values.min(), values.max()):
            flags.append("at the end of the range")
    return "; ".join(dict.fromkeys(flags)) or "ok"
