"""Measure the average brains of two normal atlases, with the default settings.

    ./run python benchmarks/atlas_curves.py FOLDER --crl CRL --chinese CHINESE \\
        --write norms/atlases.yaml

CRL and CHINESE are the folders with the labels of these atlases, which are not part of
gyriflow. FOLDER is for the study; the same command continues after an interruption.
The last line is one JSON object with the rows of the table; `--write` also writes the
metrics by atlas, hemisphere and week.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from common import print_rows, run_workflow

from gyriflow.io.files import read_table, write_text
from gyriflow.io.yaml_files import read_keys
from gyriflow.quantities import METRICS
from gyriflow.settings.terms import SIDES
from gyriflow.shipped import ATLASES
from gyriflow.study.checks import norm_settings
from gyriflow.study.loading import load

# a study may have any release and label scheme
NOT_COMPARED = ("version", "schemes")
HEAD = """\
# Metrics of the average brains of two normal atlases by gestational week, measured by
# gyriflow with its default settings: numbers only, the atlases are not part of it. Each
# brain is the average of many fetuses, and folds less than each of them. By
# benchmarks/atlas_curves.py.
"""


def curves(metrics: pd.DataFrame, atlas: str) -> dict[str, Any]:
    """Return the weeks of an atlas, and by hemisphere and metric the values at them."""
    brains = metrics[metrics["subject"].str.startswith(f"{atlas}-")]
    weeks = sorted(brains["week"].unique())
    values: dict[str, dict[str, list[float]]] = {}
    for hemisphere in ("whole", *SIDES):
        rows = brains[brains["hemisphere"] == hemisphere]
        wide = rows.pivot_table("value", "week", "metric", sort=False)
        shown = [
            name
            for name in wide
            if METRICS[name].has_norm
            and METRICS[name].is_reported
            and wide[name].notna().all()
        ]
        values[hemisphere] = {name: rounded(wide.loc[weeks, name]) for name in shown}
    described = read_keys(ATLASES / atlas / "atlas.yaml")
    return {
        "title": described["title"],
        "reference": described["reference"],
        "weeks": [float(week) for week in weeks],
        "values": values,
    }


def rounded(values: pd.Series) -> list[float]:
    """Return values with five significant digits, well below the noise of
    measuring."""
    return [float(f"{value:.5g}") for value in np.asarray(values)]


def as_yaml(made_with: dict[str, Any], atlases: dict[str, Any]) -> str:
    """Return the file, a line for each metric."""
    lines = [f"made_with: {made_with}".replace("'", "").replace("False", "false")]
    lines.append("atlases:")
    for name, facts in atlases.items():
        lines.append(f"  {name}:")
        lines += [f'    {key}: "{facts[key]}"' for key in ("title", "reference")]
        lines += [f"    weeks: {facts['weeks']}", "    values:"]
        for hemisphere, metrics in facts["values"].items():
            lines.append(f"      {hemisphere}:")
            lines += [f"        {key}: {values}" for key, values in metrics.items()]
    return HEAD + "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--crl", required=True)
    parser.add_argument("--chinese", required=True)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--write", type=Path)
    arguments = parser.parse_args()
    config = {
        "atlas": [
            {"name": name, "folder": folder, "accept_licence": True}
            for name, folder in (
                ("crl", str(Path(arguments.crl).resolve())),
                ("chinese", str(Path(arguments.chinese).resolve())),
            )
        ]
    }
    run_workflow(arguments.folder, config, arguments.cores, "metrics")
    metrics = read_table(arguments.folder / "results" / "study" / "metrics.csv")
    atlases = {name: curves(metrics, name) for name in ("crl", "chinese")}
    made_with = norm_settings(load(config, arguments.folder))
    for name in NOT_COMPARED:
        del made_with[name]
    if arguments.write:
        write_text(arguments.write, as_yaml(made_with, atlases))
    rows = []
    for name, facts in atlases.items():
        whole = facts["values"]["whole"]
        for number, week in enumerate(facts["weeks"]):
            shown = ("volume", "area", "gyrification_index", "mean_sulcal_depth")
            numbers = {metric: whole[metric][number] for metric in shown}
            rows.append({"atlas": name, "week": week, **numbers})
    print_rows(rows)


if __name__ == "__main__":
    main()
