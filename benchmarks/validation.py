"""What a finished study's simulations are worth, run by run.

    ./run python benchmarks/validation.py STUDY_FOLDER

STUDY_FOLDER is where the study ran (with `results/study/` in it), its `results`, or `results/study` itself. The tables
`validation.csv` and `displacement_agreement.csv` there are read. The last line is one JSON object: for each run by its
name `worst_area_error`, `worst_volume_error` of all weeks, `skill_shape_index`, `skill_mean_curvature`,
`curvature_rms_ratio`, `displacement_r`, `displacement_slope` of the last week or interval, and under `horizon` gain and
skill by weeks since the start, explained and predicted weeks apart;
where the metrics are there too, `largest_difference` of either hemisphere from the real one in the last week, by
metric.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import pandas as pd

from gyriflow.errors import InputError
from gyriflow.io.files import read_table

MOVES = ["displacement_r", "displacement_slope"]


def tables(folder: Path) -> Path:
    """Returns the folder that holds the tables of a study."""
    for place in (folder / "results" / "study", folder / "study", folder):
        if (place / "validation.csv").is_file():
            return place
    raise InputError(
        "has no validation.csv",
        path=folder,
        expected="results/study/validation.csv",
        remedy="Run the study with its validation first.",
    )


def summary(rows: pd.DataFrame, moves: pd.DataFrame) -> dict[str, Any]:
    """Returns what the rows of one run's validation and displacement say; None where there is no number."""
    last = rows[rows["week"] == rows["week"].max()]
    final = moves[moves["to_week"] == moves["to_week"].max()] if len(moves) else pd.DataFrame(columns=MOVES)
    numbers = {f"worst_{name}": rows[name].abs().max() for name in ("area_error", "volume_error")}
    numbers |= last[["skill_shape_index", "skill_mean_curvature", "curvature_rms_ratio"]].mean().to_dict()
    numbers |= final[MOVES].mean().to_dict()
    found: dict[str, Any] = {name: float(value) if pd.notna(value) else None for name, value in numbers.items()}
    worth = [f"{name}_{measure}" for name in ("gain", "skill") for measure in ("shape_index", "mean_curvature")]
    horizons = {
        str(kind): json.loads(part.groupby("horizon")[worth].mean().to_json(orient="index"))
        for kind, part in rows.groupby("kind")
    }
    return {"kind": str(rows["kind"].iloc[0]), "last_week": float(last["week"].iloc[0])} | found | {"horizon": horizons}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    folder = tables(parser.parse_args().study)
    validation = read_table(folder / "validation.csv")
    moves = folder / "displacement_agreement.csv"
    displacement = read_table(moves) if moves.exists() else pd.DataFrame()
    shown = ["run", "kind", "start_week", "week", "distance_mm", "distance95_mm", "cortex_dice"]
    shown += ["area_error", "volume_error", "r_shape_index"]
    shown += ["r_start_shape_index", "r_adjacent_shape_index", "gain_low_shape_index", "gain_high_shape_index"]
    shown += ["skill_shape_index", "skill_mean_curvature", "curvature_rms_ratio"]
    print(validation[[name for name in shown if name in validation]].to_string(index=False, float_format="%.3f"))
    found = {
        str(run): summary(rows, displacement[displacement["run"] == run] if len(displacement) else displacement)
        for run, rows in validation.groupby("run", sort=False)
    }
    agreement = folder / "folding_agreement.csv"
    if agreement.exists():
        table = read_table(agreement)
        for run, rows in table.groupby("run"):
            last = rows[rows["week"] == rows["week"].max()]
            worst = last["difference"].abs().groupby(last["metric"]).max()
            found[str(run)]["largest_difference"] = {str(name): float(value) for name, value in worst.items()}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
