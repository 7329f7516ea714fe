"""Compare a finished study with the results of the FetalFoldSim paper, as a table in
Markdown.

    ./run gyriflow run config/examples/paper.yaml -d paper --stage paper
    ./run python benchmarks/replication.py paper

The study has the run `reference` and the sweeps `thickness` and `stiffness`, as
config/examples/paper.yaml. A row that it cannot answer is left out: a week that was not
reached, bands that are cut off or not resolved by the mesh, sides of a brain that is
its own mirror image. The last line is one JSON object: `rows` with `result`, `paper`,
`here`, `verdict`.

Spectra are of the shape index and, as in the paper, cut at the largest Weyl number of
all surfaces compared, per side.
"""

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from gyriflow.compare.comparison import aligned_distances
from gyriflow.compare.sweeps import CROSSING_FACES, WEYL_NUMBER
from gyriflow.geometry.alignment import MIRROR
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import area, convex_hull, transformed
from gyriflow.io.files import read_table
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.surfaces import read_surface
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.terms import FOLD_BANDS
from gyriflow.study.paths import (
    FOLDING,
    GROWTH,
    PARAMETERS,
    PIAL,
    PUBLISHED,
    STUDY,
    SWEEP,
)

RUN = "reference"
SIMULATED = "FetalFoldSim (simulated)"
"""Source of the paper's own displacements in `workflow/published/fetalfoldsim.yaml`."""
AGREEMENT_TOL = 0.1
"""Largest relative difference at which displacements, or numbers of modes, agree with
those of the paper."""
MAX_WEAK_SHARE = 0.05
"""Share of the spectrum's power below which a band counts as very weak."""
SHARE_TOL = 0.01
"""Difference of a band's share between the hemispheres up to which they count as
equal."""
MAX_MIRROR_MM = 0.2
"""Mean distance of one hemisphere from the other's mirror image up to which a brain
counts as symmetric. The shipped atlas has 0.06 to 0.09 mm."""
MAX_OCCIPITAL_SHARE = 0.25
"""Share of the brain's length, from the back, that counts as the occipital lobe."""
GROWTH_WEEKS, MIN_RATE_PER_S = (21, 29), 1e-7
"""Weeks and lower limit of the paper's growth rates by areas (section 2.5)."""
MODES = {"right": 1970, "left": 1833}
"""The paper's numbers of modes, the largest Weyl number of all surfaces (section
4.1.3)."""
AGREES = "as in the paper"
IN_PART = "in part"
DIFFERS = "not as in the paper"
NOT_TESTABLE = "not testable"


@dataclass(frozen=True)
class Row:
    """A result of the paper, its number, the one here, and whether they agree."""

    result: str
    paper: str
    here: str
    verdict: str


def agreement(here: float, paper: float) -> str:
    """Return the verdict on a number: that it agrees, or its difference in percent."""
    difference = here / paper - 1
    if abs(difference) <= AGREEMENT_TOL:
        return AGREES
    return f"{difference:+.0%}"


def verdict_on(holds: pd.Series) -> str:
    """Return the verdict on a statement that holds in some cases."""
    if holds.all():
        return AGREES
    return IN_PART if holds.any() else DIFFERS


def displacement_rows(folder: Path, brain: str) -> list[Row]:
    """Compare the largest and mean displacements of a week; the paper's are taken to be
    of all nodes."""
    published = read_yaml(PUBLISHED)["displacement"]
    (paper,) = (source for source in published["rows"] if source["source"] == SIMULATED)
    table = read_table(folder / STUDY / "displacement.csv")
    table = table[(table["run"] == RUN) & (table["subject"] == brain)]
    by_nodes = table.set_index(["nodes", "from_week"])
    rows = []
    for column, name in (("max_mm", "largest"), ("mean_mm", "mean")):
        for week, number in zip(published["from_weeks"], paper[column], strict=True):
            if ("all", week) not in by_nodes.index:
                continue
            every = by_nodes.loc[("all", week), column]
            pial = by_nodes.loc[("pial", week), column]
            result = f"{name} displacement, {week}-{week + 1} GW (mm)"
            here = f"all nodes {every:.2f} (surface {pial:.2f})"
            rows.append(Row(result, f"{number:.2f}", here, agreement(every, number)))
    return rows


def occipital_row(folder: Path, brain: str) -> list[Row]:
    """Find where on the surface the largest displacement from 24 to 25 GW is: 0 % at
    the back of the brain."""
    frames = folder / FOLDING["frames"].format(run=RUN, brain=brain)
    if not {24.0, 25.0} <= set(read_weeks(frames)):
        return []
    before, after = read_positions(frames, 24.0), read_positions(frames, 25.0)
    _, pial = boundary_surface(TetrahedralMesh(before, read_tets(frames)))
    y = before[pial, 1]
    largest = np.linalg.norm((after - before)[pial], axis=1).argmax()
    from_back = (y[largest] - y.min()) / np.ptp(y)
    here = f"at {from_back:.0%} of the brain's length from the back"
    verdict = AGREES if from_back <= MAX_OCCIPITAL_SHARE else DIFFERS
    return [
        Row(
            "the largest displacement, 24-25 GW, is in the occipital lobe",
            "stated",
            here,
            verdict,
        )
    ]


def growth_rate_row(folder: Path, brain: str) -> list[Row]:
    """Compare growth rates by the areas of observed brains with those of the paper."""
    first, last = GROWTH_WEEKS
    rates = read_table(folder / GROWTH["rates"])
    within = rates.loc[
        (rates["from_week"] >= first) & (rates["to_week"] <= last), "rate_per_s"
    ]
    used = read_yaml(folder / PARAMETERS.format(run=RUN, brain=brain))[
        "growth_rate_per_s"
    ]
    result = f"growth rate of the cortex, {first}-{last} GW (1/s)"
    paper = f"at least {MIN_RATE_PER_S:g} by areas; 2e-07 used, twice as much"
    here = f"{within.min():.2g} to {within.max():.2g} by areas; {used} used"
    return [Row(result, paper, here, verdict_on(within >= MIN_RATE_PER_S))]


def mode_rows(comparison: pd.DataFrame) -> list[Row]:
    """Compare the numbers of modes of the spectra at 28 GW."""
    rows = []
    for side, paper in MODES.items():
        is_number = (comparison["measure"] == WEYL_NUMBER) & (
            comparison["hemisphere"] == side
        )
        numbers = comparison.loc[is_number, ["value", "observed_value"]]
        lowest, largest = numbers.min(axis=None), numbers.max(axis=None)
        here = f"{largest:.0f}, the largest of {lowest:.0f} to {largest:.0f}"
        text = f"{paper}, the largest of all surfaces"
        rows.append(
            Row(f"modes of the spectra, {side}", text, here, agreement(largest, paper))
        )
    return rows


def gyrification_row(folder: Path) -> list[Row]:
    """Give the paper's index: pial area over that of one convex hull of both
    hemispheres, the fissure included."""
    texts = []
    for path in sorted(folder.glob(PIAL["whole"].format(brain="*"))):
        mesh = read_surface(path)
        texts.append(
            f"{path.parents[1].name}: {area(mesh) / area(convex_hull(mesh)):.2f}"
        )
    result = "gyrification index, one hull of both hemispheres"
    return [Row(result, "defined, without values", "; ".join(texts), NOT_TESTABLE)]


def nearest_rows(folder: Path) -> list[Row]:
    """Compare the values of the nearest runs, by cut spectra; the paper has the same
    value on both sides."""
    nearest = read_table(folder / SWEEP.format(sweep="thickness") / "nearest.csv")
    rows = []
    for entry in read_yaml(PUBLISHED)["nearest"]:
        parameter, measure = entry["parameter"], entry["measure"]
        found = nearest[
            (nearest["measure"] == f"{measure}_weyl") & nearest["run"].notna()
        ]
        if found.empty:
            continue
        texts = []
        for row in found.to_dict("records"):
            flag = "" if row["flag"] == "ok" else f" ({row['flag']})"
            texts.append(f"{row['hemisphere']}, cut: {row[parameter]:g}{flag}")
        result = f"nearest {parameter} by {measure}, {entry['week']} GW"
        is_equal = (found["flag"] == "ok") & (found[parameter] == entry["value"])
        rows.append(
            Row(result, f"{entry['value']:g}", "; ".join(texts), verdict_on(is_equal))
        )
    return rows


def collision_row(members: pd.DataFrame, comparison: pd.DataFrame) -> Row:
    """Count the runs that reach 28 GW without faces that cross."""
    is_count = (comparison["measure"] == CROSSING_FACES) & (
        comparison["hemisphere"] == "whole"
    )
    crossing = comparison[is_count].groupby("run")["value"].max()
    holds = (members["outcome"] == "finished") & (members["run"].map(crossing) == 0)
    counts = ", ".join(f"{count:.0f}" for count in crossing)
    here = f"{holds.sum()} of {len(holds)} runs; crossing faces: {counts}"
    return Row(
        "all thicknesses reach 28 GW without collisions",
        "stated",
        here,
        verdict_on(holds),
    )


def finished_row(members: pd.DataFrame) -> Row:
    """Count the ratios of stiffness that reach 29 GW."""
    holds = members["outcome"] == "finished"
    result = (
        "the figures show ratios of 1 to 20 at 29 GW; the discussion says that the"
        " model cannot go below 5"
    )
    return Row(
        result, "stated", f"{holds.sum()} of {len(holds)} runs", verdict_on(holds)
    )


def cut_shares(comparison: pd.DataFrame) -> pd.DataFrame:
    """Return the share of each band in the cut spectra, by brain (`observed` or not)
    and hemisphere."""
    bands = {
        f"shape_index_relative_power_B{band}_weyl": f"B{band}" for band in FOLD_BANDS
    }
    rows = comparison[comparison["measure"].isin(bands) & (comparison["flag"] == "ok")]
    simulated = rows.assign(brain=rows["run"], observed=False)
    observed = rows.assign(
        brain=rows["observed"], value=rows["observed_value"], observed=True
    )
    both = pd.concat([simulated, observed]).replace({"measure": bands})
    table = both.pivot_table(
        "value", ["observed", "brain", "hemisphere"], "measure", aggfunc="first"
    )
    return table.reindex(columns=list(bands.values()))


def share_rows(shares: pd.DataFrame, mirror_mm: float | None) -> list[Row]:
    """Compare statements on the shares of bands at 28 GW; `mirror_mm` is how asymmetric
    the start brain is."""
    is_observed = shares.index.get_level_values("observed").astype(bool)
    smallest = shares.loc[is_observed, "B5"].groupby("hemisphere").min()
    largest = shares.loc[~is_observed, "B5"].groupby("hemisphere").max()
    margins = {
        "B4 is above B5 and B6, in real and simulated brains": (
            shares["B4"] - shares[["B5", "B6"]].max(axis=1)
        ),
        "B6 is very weak, in real and simulated brains": MAX_WEAK_SHARE - shares["B6"],
        "B5 of the real brain is above that of any simulation": smallest - largest,
    }
    has_both = {"left", "right"} <= set(shares.index.get_level_values("hemisphere"))
    if has_both and mirror_mm is not None and mirror_mm > MAX_MIRROR_MM:
        right = shares.xs("right", level="hemisphere")
        left = shares.xs("left", level="hemisphere")
        fine = pd.concat([left["B5"] - right["B5"], left["B6"] - right["B6"]])
        margins["B4 is higher on the right, in real and simulated brains"] = (
            right["B4"] - left["B4"] - SHARE_TOL
        )
        margins["B5 and B6 are higher on the left, in real and simulated brains"] = (
            fine - SHARE_TOL
        )
    rows = []
    for result, margin in margins.items():
        holds = margin.dropna() > 0
        if holds.empty:
            continue
        here, verdict = f"{holds.sum()} of {len(holds)} cases", verdict_on(holds)
        unknown = [band for band in shares if shares[band].isna().all()]
        if result.startswith("B4 is above") and unknown:
            here += f", without {' and '.join(unknown)}: cut off or not resolved"
            verdict = IN_PART if holds.all() else verdict
        rows.append(Row(result, "stated", here, verdict))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="working directory of the study")
    folder = parser.parse_args().folder

    (frames,) = folder.glob(FOLDING["frames"].format(run=RUN, brain="*"))
    brain = frames.parents[1].name
    sides = [folder / PIAL[side].format(brain=brain) for side in ("left", "right")]
    mirror_mm = None
    if all(path.exists() for path in sides):
        left, right = map(read_surface, sides)
        mirror_mm = aligned_distances(transformed(left, MIRROR), right)["distance_mm"]

    thickness, stiffness = (
        folder / SWEEP.format(sweep=name) for name in ("thickness", "stiffness")
    )
    comparison = read_table(thickness / "comparison.csv")
    rows = [
        *displacement_rows(folder, brain),
        *occipital_row(folder, brain),
        *growth_rate_row(folder, brain),
        *mode_rows(comparison),
        *gyrification_row(folder),
        *nearest_rows(folder),
        collision_row(read_table(thickness / "members.csv"), comparison),
        *share_rows(cut_shares(comparison), mirror_mm),
        finished_row(read_table(stiffness / "members.csv")),
    ]

    print("| result | the paper | here | verdict |\n| --- | --- | --- | --- |")
    for row in rows:
        print(f"| {row.result} | {row.paper} | {row.here} | {row.verdict} |")
    print(json.dumps({"rows": [asdict(row) for row in rows]}))


if __name__ == "__main__":
    main()
