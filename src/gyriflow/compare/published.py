"""Comparison with what the FetalFoldSim paper reports; its numbers are in `workflow/published/fetalfoldsim.yaml`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.alignment import MIRROR
from ..geometry.triangles import Floats, Ints, TriangleMesh, area, convex_hull, transformed
from ..settings.terms import FOLD_BANDS
from .comparison import aligned_distances
from .sweeps import CROSSING_FACES, WEYL_NUMBER

AGREEMENT_TOL = 0.1
"""Largest relative difference at which displacements, or numbers of modes, agree with those of the paper."""
MAX_WEAK_SHARE = 0.05
"""Share of the spectrum's power below which a band counts as very weak."""
SHARE_TOL = 0.01
"""Difference of a band's share between the hemispheres up to which they count as equal."""
MAX_MIRROR_MM = 0.2
"""Mean distance of one hemisphere from the other's mirror image up to which a brain counts as symmetric. The shipped
atlas has 0.06 to 0.09 mm."""
MAX_OCCIPITAL_SHARE = 0.25
"""Share of the brain's length, from the back, that counts as the occipital lobe."""
NOT_RUN, AGREES = "not run", "as in the paper"
NO_BANDS = "the bands are cut off or not resolved"
NOT_TESTABLE, NOT_TESTED = "not testable", "not tested"
MISSING = "–"
OBSERVED = "observed "
"""Prefix of observed brains among the brains of a table."""
type Found = tuple[str, str] | None
"""The result here and the verdict on it; None if it was not run."""
type Row = tuple[str, str, str, Found]
"""Result, place, the paper's number, and what was found here."""


@dataclass(frozen=True, eq=False)
class SweepTables:
    """The varied keys and the week of a sweep, and its tables `members.csv`, `comparison.csv` and `nearest.csv`."""

    varied: Sequence[str]
    week: float
    members: pd.DataFrame
    comparison: pd.DataFrame
    nearest: pd.DataFrame

    def repeats(self, entry: Mapping[str, Any]) -> bool:
        """Return whether this sweep varies only the parameter of a published entry, and is compared at its week."""
        return list(self.varied) == [entry["parameter"]] and self.week == entry["week"]


def comparison_caption(sweep: str, week: float, comparison: pd.DataFrame) -> str:
    """Describe the observed brains that a sweep is compared with, and note any of another population.

    The comparison has the columns observed, observed_population, same_population.
    """
    observed = comparison.drop_duplicates("observed")
    if observed.empty:
        return f"No run of the sweep {sweep} has reached {week:g} GW."
    names = ", ".join(f"{row.observed} ({row.observed_population})" for row in observed.itertuples())
    text = f"The sweep {sweep} at {week:g} GW, compared with {names}."
    populations = sorted(set(observed.loc[~observed["same_population"].astype(bool), "observed_population"]))
    if populations:
        text += f" Note that {' and '.join(populations)} is another population than that of the start brain."
    return text


def published_nearest(published: Mapping[str, Any], sweeps: Mapping[str, SweepTables]) -> pd.DataFrame:
    """Return the nearest runs by each measure for which the paper also reports a nearest value.

    The paper compares with other brains (a normal atlas). Its spectra are of the shape index, cut at Weyl's number.
    Columns study (name of the sweep), subject, observed, hemisphere, measure, parameter, nearest (value of the nearest
    run), run, distance, flag, paper (value that the paper reports), place (in the paper).
    """
    columns = ["study", "subject", "observed", "hemisphere", "measure", "parameter", "nearest", "run"]
    columns += ["distance", "flag", "paper", "place"]
    tables = [pd.DataFrame(columns=columns)]
    for entry in published["nearest"]:
        parameter = entry["parameter"]
        for name, sweep in sweeps.items():
            if sweep.repeats(entry):
                rows = sweep.nearest[sweep.nearest["measure"].str.removesuffix("_weyl") == entry["measure"]]
                rows = rows.assign(study=name, parameter=parameter, nearest=rows[parameter])
                tables.append(rows.assign(paper=entry["value"], place=entry["place"])[columns])
    return pd.concat(tables[1:] or tables, ignore_index=True)


def replication_table(
    published: Mapping[str, Any],
    displacement: pd.DataFrame,
    sweeps: Sequence[SweepTables],
    *,
    rates: pd.DataFrame | None = None,
    used_rate: Any = None,
    from_back: float | None = None,
    mirror_mm: float | None = None,
    surfaces: Mapping[str, TriangleMesh] | None = None,
) -> pd.DataFrame:
    """Compare each result of the paper with the same result here: result, place, paper, here, verdict.

    `published` is the content of `fetalfoldsim.yaml`; the verdict on a result whose sweep is not among `sweeps` is
    `NOT_RUN`. Of one run are `displacement` (from_week, to_week, nodes, max_mm, mean_mm) and the
    growth rate that it used; `rates` are those from surface areas (from_week, to_week, rate_per_s). `from_back` is
    `place_of_largest` of the displacement from 24 to 25 GW, `mirror_mm` the `mirror_distance` of the start brain's
    hemispheres, `surfaces` the whole pial surfaces of observed brains by id.

    Spectra are of the shape index and, as in the paper, cut at the largest Weyl number of all surfaces compared, per
    side. Values of whole bands are listed in addition.
    """
    modes, largest, index = (published[name] for name in ("weyl_number", "largest", "gyrification_index"))
    at_back: Found = None
    if from_back is not None:
        verdict = _verdict(pd.Series([from_back <= MAX_OCCIPITAL_SHARE]))
        at_back = f"at {from_back:.0%} of the brain's length from the back", verdict
    rows: list[Row] = [
        *_displacements(published["displacement"], displacement),
        (largest["finding"], largest["place"], "stated", at_back),
        _growth_rate(published["growth_rate"], rates, used_rate),
        *_modes(modes, _sweep_of(modes, sweeps)),
        (index["finding"], index["place"], index["paper"], _gyrification(surfaces or {})),
    ]
    for entry in published["nearest"]:
        sweep = _sweep_of(entry, sweeps)
        result = f"nearest {entry['parameter']} by {entry['measure']}, {entry['week']} GW"
        rows.append((result, entry["place"], f"{entry['value']:g}", _nearest(entry, sweep.nearest) if sweep else None))
    for entry in published["findings"]:
        sweep = _sweep_of(entry, sweeps)
        found = _finding(entry["check"], sweep, mirror_mm) if sweep else None
        rows.append((entry["finding"], entry["place"], "stated", found))
    for entry in published["untested"]:
        rows.append((entry["finding"], entry["place"], "stated", (entry["reason"], NOT_TESTED)))
    table = [(*row, *(found or (MISSING, NOT_RUN))) for *row, found in rows]
    return pd.DataFrame(table, columns=["result", "place", "paper", "here", "verdict"])


def place_of_largest(before: Floats, after: Floats, pial: Ints) -> float:
    """Return the place of the pial node with the largest displacement: 0 at the back of the brain, 1 at its front."""
    y = before[pial, 1]
    largest = np.linalg.norm((after - before)[pial], axis=1).argmax()
    return float((y[largest] - y.min()) / np.ptp(y))


def mirror_distance(left: TriangleMesh, right: TriangleMesh) -> float:
    """Return the mean distance in mm of the right hemisphere from the mirror image of the left one."""
    return aligned_distances(transformed(left, MIRROR), right)["distance_mm"]


def _sweep_of(entry: Mapping[str, Any], sweeps: Sequence[SweepTables]) -> SweepTables | None:
    return next((sweep for sweep in sweeps if sweep.repeats(entry)), None)


def _displacements(published: Mapping[str, Any], displacement: pd.DataFrame) -> Iterator[Row]:
    table = displacement.set_index(["nodes", "from_week"])
    for source in published["rows"]:
        for column, name in (("max_mm", "largest"), ("mean_mm", "mean")):
            for week, paper in zip(published["from_weeks"], source[column], strict=True):
                value, pial = (float(table[column].get((nodes, float(week)), "nan")) for nodes in ("all", "pial"))
                here = f"all nodes {value:.2f} (surface {pial:.2f})", _agreement(value / paper - 1)
                result = f"{name} displacement, {week}-{week + 1} GW (mm), {source['source']}"
                yield result, published["place"], f"{paper:.2f}", here if np.isfinite(value) else None


def _growth_rate(published: Mapping[str, Any], rates: pd.DataFrame | None, used: Any) -> Row:
    (first, last), found = published["weeks"], None
    if rates is not None:
        within = rates.loc[(rates["from_week"] >= first) & (rates["to_week"] <= last), "rate_per_s"]
        if len(within):
            here = f"{within.min():.2g} to {within.max():.2g} by areas; {used} used"
            found = here, _verdict(within >= published["min_per_s"])
    paper = f"at least {published['min_per_s']:g} by areas; {published['used_per_s']:g} used, twice as much"
    return f"growth rate of the cortex, {first}-{last} GW (1/s)", published["place"], paper, found


def _gyrification(surfaces: Mapping[str, TriangleMesh]) -> Found:
    """Give the paper's index: pial area over that of one convex hull of both hemispheres, the fissure included."""
    ratios = {brain: area(mesh) / area(convex_hull(mesh)) for brain, mesh in surfaces.items()}
    return ("; ".join(f"{brain}: {ratio:.2f}" for brain, ratio in ratios.items()), NOT_TESTABLE) if ratios else None


def _modes(published: Mapping[str, Any], sweep: SweepTables | None) -> Iterator[Row]:
    for side in ("right", "left"):
        found = None
        if sweep:
            is_number = (sweep.comparison["measure"] == WEYL_NUMBER) & (sweep.comparison["hemisphere"] == side)
            numbers = sweep.comparison.loc[is_number, ["value", "observed_value"]].to_numpy(dtype=float)
            if numbers.size:
                here = f"{numbers.max():.0f}, the largest of {numbers.min():.0f} to {numbers.max():.0f}"
                found = here, _agreement(numbers.max() / published[side] - 1)
        paper = f"{published[side]}, the largest of all surfaces"
        yield f"modes of the spectra, {side}", published["place"], paper, found


def _nearest(entry: Mapping[str, Any], nearest: pd.DataFrame) -> Found:
    texts, equal = [], []
    for measure, bands in ((f"{entry['measure']}_weyl", "cut"), (entry["measure"], "whole bands")):
        for row in nearest[nearest["measure"] == measure].to_dict("records"):
            flag = "" if row["flag"] == "ok" else f" ({row['flag']})"
            nearest_value = f"{row[entry['parameter']]:g}" if pd.notna(row["run"]) else "none"
            texts.append(f"{row['hemisphere']}, {bands}: {nearest_value}{flag}")
            # the paper's bands are cut
            if bands == "cut" and pd.notna(row["run"]):
                equal.append(row["flag"] == "ok" and row[entry["parameter"]] == entry["value"])
    return ("; ".join(texts), _verdict(pd.Series(equal)) if equal else NOT_TESTABLE) if texts else None


def _finding(check: str, sweep: SweepTables, mirror_mm: float | None) -> tuple[str, str]:
    if check.startswith("all_"):
        holds, text = sweep.members["outcome"].eq("finished"), ""
        if check == "all_without_collisions":
            is_count = (sweep.comparison["measure"] == CROSSING_FACES) & (sweep.comparison["hemisphere"] == "whole")
            crossing = sweep.comparison[is_count].groupby("run")["value"].max()
            text = f"; crossing faces: {', '.join(f'{count:.0f}' for count in crossing)}"
            holds &= sweep.members["run"].map(crossing).eq(0)
        return f"{holds.sum()} of {len(holds)} runs{text}", _verdict(holds)
    shares = _cut_shares(sweep.comparison)
    if check == "most_B4":
        margin = shares["B4"] - shares[["B5", "B6"]].max(axis=1)
    elif check == "little_B6":
        margin = MAX_WEAK_SHARE - shares["B6"]
    elif check in ("right_B4", "left_B5_B6"):
        if mirror_mm is None or mirror_mm <= MAX_MIRROR_MM:
            found = "one hemisphere" if mirror_mm is None else f"hemispheres are mirror images to {mirror_mm:.2f} mm"
            return found, NOT_TESTABLE
        if not {"right", "left"} <= set(shares.index.get_level_values("hemisphere")):
            return NO_BANDS, NOT_TESTABLE
        right, left = (shares.xs(side, level="hemisphere") for side in ("right", "left"))
        fine = [left[band] - right[band] for band in ("B5", "B6")]
        margin = pd.concat([right["B4"] - left["B4"]] if check == "right_B4" else fine) - SHARE_TOL
    else:
        is_observed = shares.index.get_level_values("brain").str.startswith(OBSERVED)
        smallest = shares.loc[is_observed, "B5"].groupby("hemisphere").min()
        margin = smallest - shares.loc[~is_observed, "B5"].groupby("hemisphere").max()
    holds = margin.dropna() > 0
    if holds.empty:
        return NO_BANDS, NOT_TESTABLE
    text = f"{holds.sum()} of {len(holds)} cases"
    unknown = [str(band) for band in shares if shares[band].isna().all()]
    if check == "most_B4" and unknown:
        text += f", without {' and '.join(unknown)}: cut off or not resolved"
        return text, "in part" if holds.all() else _verdict(holds)
    return text, _verdict(holds)


def _cut_shares(comparison: pd.DataFrame) -> pd.DataFrame:
    """Return the share of each band in the cut spectra, a row per brain (simulated or observed) and hemisphere."""
    bands = {f"shape_index_relative_power_B{band}_weyl": f"B{band}" for band in FOLD_BANDS}
    rows = comparison[comparison["measure"].isin(bands) & (comparison["flag"] == "ok")]
    observed = rows.assign(brain=OBSERVED + rows["observed"], value=rows["observed_value"])
    both = pd.concat([rows.assign(brain=rows["run"]), observed]).replace({"measure": bands})
    table = both.pivot_table("value", ["brain", "hemisphere"], "measure", aggfunc="first")
    return table.reindex(columns=list(bands.values()))


def _agreement(error: float) -> str:
    return AGREES if abs(error) <= AGREEMENT_TOL else f"{error:+.0%}"


def _verdict(holds: pd.Series) -> str:
    return AGREES if holds.all() else "in part" if holds.any() else "not as in the paper"
