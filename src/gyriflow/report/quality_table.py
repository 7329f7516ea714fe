"""The table of quality control: a row for each brain of a study, with its verdict and what that rests on."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.alignment import angle_deg
from .quality import verdict_of

COLUMNS = (
    *("subject", "week", "population", "source", "sides", "verdict", "cause", "warning_count", "warnings"),
    *("area_cm2", "area_left_cm2", "area_right_cm2", "volume_ml", "share_of_expected_volume"),
    *("mean_thickness_mm", "thickness_measured_share", "pose_by", "rotation_deg", "asymmetry_mm", "page"),
)
"""The columns; the first three, `source` and `sides` are of the configuration, the others of the surface stage."""
SHOWN = ("subject", "week", "verdict", "cause", "warnings", "area_cm2", "volume_ml", "mean_thickness_mm", "page")
SEPARATOR = " | "
"""Between the warnings of a brain in its row."""


def quality_row(
    labels: Mapping[str, Any],
    report: Mapping[str, Any],
    thickness: Mapping[str, Any],
    warnings: Sequence[str],
    expected_ml: float,
) -> dict[str, Any]:
    """Returns the row of a brain whose surface was made; its verdict is "fine", or "look" where there are warnings.

    Parameters
    ----------
    labels
        subject, week, population, source, sides and page.
    report, thickness
        What the surface stage and the thickness say, as in `surface.json` and `thickness.json`.
    expected_ml
        The coarse volume of a cerebrum of the week; of one side alone half of it is expected.
    """
    area, sides = report["area_cm2"], str(labels["sides"]).split()
    return {
        **labels,
        "verdict": verdict_of(warnings),
        "cause": "",
        "warning_count": len(warnings),
        "warnings": SEPARATOR.join(warnings),
        "area_cm2": area["whole"],
        "area_left_cm2": area.get("left"),
        "area_right_cm2": area.get("right"),
        "volume_ml": report["volume_mL"],
        "share_of_expected_volume": report["volume_mL"] / expected_ml * 2 / len(sides),
        "mean_thickness_mm": thickness.get("mean_mm"),
        "thickness_measured_share": thickness.get("measured_area_share"),
        "pose_by": report.get("pose_by") or report.get("posing", {}).get("method") or "configuration",
        "rotation_deg": angle_deg(np.array(report["pose"])[:3, :3]),
        "asymmetry_mm": report.get("asymmetry_mm"),
    }


def quality_table(
    rows: Sequence[Mapping[str, Any]], refused: Sequence[Mapping[str, Any]], order: Sequence[str]
) -> pd.DataFrame:
    """Returns the rows of all brains in an order of their ids.

    Parameters
    ----------
    rows
        What `quality_row` returns.
    refused
        labels and cause of the brains that were refused.
    """
    every = [dict(row) for row in rows] + [{**row, "verdict": "refused", "warning_count": 0} for row in refused]
    table = pd.DataFrame(every, columns=list(COLUMNS))
    rank = {name: number for number, name in enumerate(order)}
    return table.sort_values("subject", key=lambda names: names.map(rank)).reset_index(drop=True)


def shown_table(table: pd.DataFrame) -> pd.DataFrame:
    """Returns the table as it is shown in pages: fewer columns, brains to look at first."""
    rank = table["verdict"].map({"refused": 0, "look": 1, "fine": 2})
    shown = table.loc[rank.sort_values(kind="stable").index, list(SHOWN)]
    return shown.rename(columns={name: name.replace("_", " ") for name in SHOWN})


def facts(row: Mapping[str, Any]) -> dict[str, str]:
    """Returns what stands in the head of a brain's page, by name."""
    both = " + ".join(f"{row[f'area_{side}_cm2']:.1f}" for side in str(row["sides"]).split())
    found = {
        "source": str(row["source"]),
        "hemispheres": str(row["sides"]),
        "area": f"{row['area_cm2']:.1f} cm² ({both})",
        "volume": f"{row['volume_ml']:.1f} mL ({100 * row['share_of_expected_volume']:.0f} % of that expected)",
        "pose": f"by {row['pose_by']}, turned by {row['rotation_deg']:.1f}°",
    }
    if _known(row["asymmetry_mm"]):
        found["asymmetry"] = f"{row['asymmetry_mm']:.1f} mm"
    if _known(row["mean_thickness_mm"]):
        share = 100 * row["thickness_measured_share"]
        found["thickness"] = f"{row['mean_thickness_mm']:.2f} mm (measured on {share:.0f} %)"
    return found


def _known(value: object) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value))
