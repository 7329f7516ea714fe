"""Tables of metrics: by region; and of a study: all metrics, asymmetry, and change
between scans and weeks."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import Floats, Ints, TriangleMesh, area, vertex_areas
from ..names import column_part
from ..quantities import METRICS, VERTEX_MAPS
from ..settings.terms import NO_REGION, OBSERVED, SIDES
from ..units import CM2_PER_MM2

BRAIN = ["subject", "run", "week"]
"""The columns that name a brain."""


def long_table(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Return tables of metrics, of whole hemispheres and of regions, as one, a row per
    number.

    Columns subject, run, week, hemisphere, region ("" for whole hemispheres), metric,
    value, unit.
    """
    with_region = []
    for table in tables:
        region = table.get("region", "")
        with_region.append(table.assign(region=region))
    rows = pd.concat(with_region, ignore_index=True)
    columns = [*BRAIN, "hemisphere", "region", "metric", "value", "unit"]
    return rows[columns]


def _wide_names(table: pd.DataFrame) -> list[str]:
    """Return the column of the wide table that each row of one as of `long_table`
    belongs in.

    They are named by hemisphere, region, metric and unit, such as
    `left_frontal_area_cm2`; numbers without a unit have none in their name. InputError
    where two regions would have one column.
    """
    unit = (
        table["unit"]
        .astype(str)
        .replace({"1": "", "nan": ""})
        .str.replace("/", "_per_")
    )
    parts = [
        table["hemisphere"],
        table["region"].fillna(""),
        table["metric"],
        unit,
    ]
    columns = []
    meanings: dict[str, tuple[str, ...]] = {}
    for row in zip(*parts, strict=True):
        column = "_".join(column_part(part) for part in row if part)
        first = meanings.setdefault(column, row)
        if first != row:
            raise InputError(
                f"two regions have the same column {column} of metrics_wide",
                found=f"{first[2]} of {first[1]!r} and {row[2]} of {row[1]!r}",
                expected="names of regions that differ not only in spaces and hyphens",
                remedy=(
                    "Rename one of them in the labels, or under names in"
                    " metrics.regions."
                ),
            )
        columns.append(column)
    return columns


def described_columns(table: pd.DataFrame) -> dict[str, tuple[str, str]]:
    """Return what each of the `_wide_names` of a table as of `long_table` means, and
    its unit."""
    rows = (
        table[["hemisphere", "region", "metric", "unit"]]
        .fillna("")
        .itertuples(index=False, name=None)
    )
    columns = {}
    for name, (hemisphere, region, metric, unit) in zip(
        _wide_names(table), rows, strict=True
    ):
        place = (
            f"{hemisphere} hemisphere" if hemisphere in SIDES else "both hemispheres"
        )
        columns[name] = (
            f"{METRICS[metric].label}, {f'region {region}, ' if region else ''}{place}",
            unit,
        )
    return columns


def wide_table(
    table: pd.DataFrame, covariates: Mapping[str, Mapping[str, str]]
) -> pd.DataFrame:
    """Return a table as of `long_table` with a row per brain, run and week, and the
    columns of `_wide_names`.

    Before these stand the covariates of each brain, by its id; of a simulated one, its
    start's.
    """
    names = _wide_names(table)
    wide = table.assign(column=names).pivot_table(
        "value", BRAIN, "column", aggfunc="first"
    )
    brains = pd.MultiIndex.from_frame(table[BRAIN].drop_duplicates())
    wide = (
        wide.reindex(
            index=brains,
            columns=list(dict.fromkeys(names)),
        )
        .reset_index()
        .rename_axis(columns=None)
    )
    columns = dict.fromkeys(
        name for values in covariates.values() for name in values if name not in wide
    )
    for place, name in enumerate(columns, start=len(BRAIN)):
        wide.insert(
            place,
            name,
            [covariates.get(brain, {}).get(name) for brain in wide["subject"]],
        )
    return wide


def asymmetry(metrics: pd.DataFrame) -> pd.DataFrame:
    """Return the asymmetry of each metric, by region if there are regions.

    Columns difference (left − right) with its unit, and asymmetry_index 2 (left −
    right)/(left + right), between −2 and 2; NaN if both are 0, one is unknown or the
    metric may be negative. Metrics have the columns hemisphere, metric, value, unit,
    and others that rows of both sides share, such as region; these are kept.
    """
    keys = metrics.columns.drop(["hemisphere", "value"]).tolist()
    sides = metrics[metrics["hemisphere"].isin(SIDES)]
    wide = sides.pivot_table("value", keys, "hemisphere", aggfunc="first")
    # a single hemisphere has no asymmetry
    wide = wide.reindex(columns=list(SIDES))
    in_order = sides[keys].drop_duplicates()
    wide = wide.reindex(pd.MultiIndex.from_frame(in_order)).reset_index()
    left = wide["left"]
    right = wide["right"]
    difference = left - right
    total = left + right
    signed = [name for name, metric in METRICS.items() if metric.is_signed]
    has_index = (total > 0) & ~wide["metric"].isin(signed)
    index = 2.0 * difference / total.where(has_index)
    return wide[keys].assign(difference=difference, asymmetry_index=index)


def change_between_scans(
    metrics: pd.DataFrame, scans: Mapping[str, Sequence[str]]
) -> pd.DataFrame:
    """Return how metrics change between successive scans of a subject, and between the
    same weeks of simulations.

    Metrics have the columns subject (the brain), run, week, hemisphere, metric, value,
    unit, and region where they are of regions; scans are the brains of each subject, by
    week.

    Columns subject, run (observed, or one that began at the earlier scan), from_brain,
    to_brain, from_week, to_week, hemisphere, region ("" for whole hemispheres), metric,
    unit, from_value, to_value, change, change_per_week, relative_change
    (change/abs(from_value)), measured_change (between the scans), difference (to_value
    less that of the later scan; 0 for the scans themselves).
    """
    table = metrics.assign(
        region=metrics["region"].fillna("") if "region" in metrics else ""
    )
    what = ["hemisphere", "region", "metric", "unit"]
    columns = [
        "subject",
        "run",
        "from_brain",
        "to_brain",
        "from_week",
        "to_week",
        *what,
        "from_value",
        "to_value",
    ]
    columns += [
        "change",
        "change_per_week",
        "relative_change",
        "measured_change",
        "difference",
    ]
    parts = [pd.DataFrame(columns=columns)]
    for subject, brains in scans.items():
        for first, second in pairwise(brains):
            later = table[(table["subject"] == second) & (table["run"] == OBSERVED)]
            began = table[table["subject"] == first]
            from_week = float(began.loc[began["run"] == OBSERVED, "week"].iloc[0])
            to_week = float(later["week"].iloc[0])
            starts = began[began["week"] == from_week]
            ends = began[(began["run"] != OBSERVED) & (began["week"] == to_week)]
            part, start = (
                rows[["run", *what, "value"]].rename(columns={"value": name})
                for name, rows in (
                    ("to_value", pd.concat([later, ends])),
                    ("from_value", starts),
                )
            )
            part = part.merge(
                start,
                on=["run", *what],
            ).dropna(subset=["from_value", "to_value"])
            keys = pd.MultiIndex.from_frame(part[what])
            observed = [
                rows.set_index(what)["value"]
                for rows in (later, starts[starts["run"] == OBSERVED])
            ]
            part["change"] = part["to_value"] - part["from_value"]
            part["change_per_week"] = part["change"] / (to_week - from_week)
            part["relative_change"] = part["change"] / part["from_value"].abs().replace(
                0.0, np.nan
            )
            part["measured_change"] = (
                (observed[0] - observed[1]).reindex(keys).to_numpy()
            )
            part["difference"] = part["to_value"] - observed[0].reindex(keys).to_numpy()
            part = part.assign(
                subject=subject,
                from_brain=first,
                to_brain=second,
            )
            parts.append(part.assign(from_week=from_week, to_week=to_week)[columns])
    return pd.concat(parts[1:] or parts, ignore_index=True)


def weekly_norms(
    weeks: Sequence[float],
    positions: Sequence[Floats],
    pial: Ints,
) -> pd.DataFrame:
    """Return the largest and the mean length of the displacement between successive
    weeks, as in the paper's table.

    Positions in mm are (n, 3) of the same nodes in each of the ascending weeks, `pial`
    the (k,) indices of the nodes on the pial surface. Columns from_week, to_week, nodes
    ("all" or "pial"), max_mm, mean_mm; two rows per pair of weeks.
    """
    rows = []
    shapes = zip(weeks, positions, strict=True)
    for (week, before), (next_week, after) in pairwise(shapes):
        displacement = np.asarray(after) - np.asarray(before)
        lengths = np.linalg.norm(displacement, axis=1)
        for nodes, of in (("all", lengths), ("pial", lengths[pial])):
            rows.append(
                (
                    week,
                    next_week,
                    nodes,
                    of.max(),
                    of.mean(),
                )
            )
    columns = ["from_week", "to_week", "nodes", "max_mm", "mean_mm"]
    return pd.DataFrame(rows, columns=columns)


def region_metrics(
    sides: Mapping[str, TriangleMesh],
    maps: Mapping[str, Mapping[str, NDArray]],
    labels: Mapping[str, Ints],
    names: Mapping[int, str],
) -> pd.DataFrame:
    """Return area and means of maps by region of each hemisphere, weighted by area.

    Sides are the pial surfaces of "left" and "right", or of the only hemisphere. Per
    hemisphere there are maps, as `measure.BrainMetrics.maps`, and the (n,) label of
    each vertex, 0 for none; names are those of the regions by label. NaN is left out of
    means, and so is what lies near a cut where `reliable` is 0.

    Columns hemisphere, region, metric, value, unit. Metrics are area (cm2), area_share
    (of the hemisphere) and the mean of each map that is averaged
    (`VertexMap.mean_name`); a region that is all NaN or near a cut has NaN. InputError
    for labels that have no name, or are not as many as vertices.
    """
    rows = []
    for side, mesh in sides.items():
        label = np.asarray(labels[side])
        unknown = sorted(
            {int(number) for number in np.unique(label)} - {NO_REGION, *names}
        )
        if unknown or len(label) != len(mesh.vertices):
            summary = (
                f"{len(label)} labels, without a name:"
                f" {', '.join(map(str, unknown)) or 'none'}"
            )
            expected = f"{len(mesh.vertices)} labels, each named"
            raise InputError(
                f"regions of the {side} hemisphere do not fit",
                found=summary,
                expected=expected,
            )
        areas, total = vertex_areas(mesh), area(mesh)
        everywhere = np.ones(len(label))
        reliable = np.asarray(maps[side].get("reliable", everywhere), dtype=bool)
        for number, name in names.items():
            inside = label == number
            covered = float(areas[inside].sum())
            rows.append((side, name, "area", covered * CM2_PER_MM2, "cm2"))
            rows.append((side, name, "area_share", covered / total, "1"))
            for key, vertex_values in maps[side].items():
                record = VERTEX_MAPS[key]
                if not record.is_averaged:
                    continue
                values = np.asarray(vertex_values, dtype=float)
                used = inside & np.isfinite(values) & reliable
                mean = np.nan
                if areas[used].any():
                    mean = float(np.average(values[used], weights=areas[used]))
                rows.append(
                    (
                        side,
                        name,
                        record.mean_name,
                        mean,
                        record.unit,
                    )
                )
    return pd.DataFrame(
        rows, columns=["hemisphere", "region", "metric", "value", "unit"]
    )
