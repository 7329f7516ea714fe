"""What a finished study's runs are worth beside the real brains, and predictions beside simpler ones.

    ./run python benchmarks/study.py STUDY_FOLDER

STUDY_FOLDER is where the study ran, with `results/study/` in it. Of the tables there `validation.csv`,
`displacement_agreement.csv` and `prediction.csv` are read, as far as they exist. The last line is one JSON object:

- `runs`: by run `kind`, `last_week`, `worst_area_error`, `worst_volume_error` of all weeks; `skill_shape_index`,
  `skill_mean_curvature`, `curvature_rms_ratio`, `displacement_r`, `displacement_slope` of the last week or interval
- `predictions`: numbers of `prediction.csv` for each run, start and week, and those of each simpler way under its name
- `better`: by run, start and simpler way in how many weeks the run is nearer to the real brain, in how many its shape
  index correlates better, and of how many
"""

import argparse
import json
from pathlib import Path
from typing import Any

import pandas as pd

from gyriflow.errors import InputError
from gyriflow.io.files import read_table

VALIDATION = ["run", "kind", "start_week", "week", "seed", "distance_mm", "distance95_mm", "cortex_dice"]
VALIDATION += ["area_error", "volume_error", "r_shape_index", "r_start_shape_index", "r_adjacent_shape_index"]
VALIDATION += ["gain_low_shape_index", "gain_high_shape_index"]
WORTH = ["skill_shape_index", "skill_mean_curvature", "curvature_rms_ratio"]
MOVES = ["displacement_r", "displacement_slope"]
PREDICTION = ["r_shape_index", "distance_mm", "distance95_mm", "area_error", "volume_error", "crossing_faces"]
PREDICTION += ["roughness_ratio", "skill", "r_shape_index_low", "r_shape_index_high", "distance_mm_low"]
PREDICTION += ["distance_mm_high", "skill_low", "skill_high", "distance_left_mm", "distance_right_mm"]
PREDICTION += ["cortex_dice", "curvature_rms_ratio"]
KEYS = ["run", "start", "horizon", "week"]


def summary(rows: pd.DataFrame, moves: pd.DataFrame) -> dict[str, Any]:
    """Sum up one run's rows of validation and displacement; None where there is no number."""
    last = rows[rows["week"] == rows["week"].max()]
    numbers = {f"worst_{name}": rows[name].abs().max() for name in ("area_error", "volume_error")}
    numbers |= last[WORTH].mean().to_dict()
    numbers |= moves[moves["to_week"] == moves["to_week"].max()][MOVES].mean().to_dict()
    row: dict[str, Any] = {"kind": str(rows["kind"].iloc[0]), "last_week": float(last["week"].iloc[0])}
    return row | {name: float(value) if pd.notna(value) else None for name, value in numbers.items()}


def better(table: pd.DataFrame) -> dict[str, dict[str, dict[str, int]]]:
    """Count by run and start, and by simpler way, the weeks in which the run is nearer and placed better, and all."""
    counts: dict[str, dict[str, dict[str, int]]] = {}
    runs = table[table["model"] == "run"]
    simpler = table[table["model"] != "run"].drop_duplicates(["start", "week", "model"])
    pairs = runs.merge(simpler, on=["start", "week"], suffixes=("", "_of"))
    for (run, start, model), rows in pairs.groupby(["run", "start", "model_of"]):
        counts.setdefault(f"{run} {start}", {})[str(model)] = {
            "nearer": int((rows["distance_mm"] < rows["distance_mm_of"]).sum()),
            "better_placed": int((rows["r_shape_index"] > rows["r_shape_index_of"]).sum()),
            "weeks": len(rows),
        }
    return counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    folder = parser.parse_args().study / "results" / "study"
    names = ("validation", "displacement_agreement", "prediction")
    tables = {name: read_table(folder / f"{name}.csv") for name in names if (folder / f"{name}.csv").exists()}
    if not {"validation", "prediction"} & set(tables):
        raise InputError("has neither validation.csv nor prediction.csv", path=folder)
    result: dict[str, Any] = {}
    if "validation" in tables:
        validation = tables["validation"]
        print(validation.reindex(columns=[*VALIDATION, *WORTH]).to_string(index=False, float_format="%.3f"))
        moves = tables.get("displacement_agreement", pd.DataFrame(columns=["run", "to_week", *MOVES]))
        result["runs"] = {
            str(run): summary(rows, moves[moves["run"] == run]) for run, rows in validation.groupby("run", sort=False)
        }
    if "prediction" in tables:
        prediction = tables["prediction"]
        print(prediction[[*KEYS, "model", *PREDICTION]].to_string(index=False, float_format="%.3f"))
        result["predictions"] = []
        for keys, rows in prediction.groupby(KEYS):
            models = json.loads(rows.set_index("model")[PREDICTION].to_json(orient="index"))
            result["predictions"].append(dict(zip(KEYS, keys, strict=True)) | models.pop("run") | models)
        result["better"] = better(prediction)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
