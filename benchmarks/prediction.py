"""What the brains that a finished study has foretold are worth, beside simpler ways to foretell them.

    ./run python benchmarks/prediction.py STUDY_FOLDER

STUDY_FOLDER is as for benchmarks/validation.py. The last line is one JSON object: `predictions`, a list with columns
of prediction.csv for each run, start, horizon and week, and the same for each simpler way under its name; and `better`,
by run, start and simpler way: in how many weeks the run is nearer to the real brain, in how many its shape index
correlates better, and of how many.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from gyriflow.errors import InputError
from gyriflow.io.files import read_table

COLUMNS = ["r_shape_index", "distance_mm", "distance95_mm", "area_error", "volume_error"]
COLUMNS += ["crossing_faces", "roughness_ratio", "skill"]
FURTHER = ["r_shape_index_low", "r_shape_index_high", "distance_mm_low", "distance_mm_high", "skill_low", "skill_high"]
FURTHER += ["distance_left_mm", "distance_right_mm", "cortex_dice", "curvature_rms_ratio"]
KEYS = ["run", "start", "horizon", "week"]


def better(table: pd.DataFrame) -> dict[str, dict[str, dict[str, int]]]:
    """Returns by run and start, and by simpler way, the weeks in which the run is nearer and placed better, and all."""
    found: dict[str, dict[str, dict[str, int]]] = {}
    runs = table[table["model"] == "run"]
    ways = table[table["model"] != "run"].drop_duplicates(["start", "week", "model"])
    pairs = runs.merge(ways, on=["start", "week"], suffixes=("", "_of"))
    for (run, start, way), rows in pairs.groupby(["run", "start", "model_of"]):
        found.setdefault(f"{run} {start}", {})[str(way)] = {
            "nearer": int((rows["distance_mm"] < rows["distance_mm_of"]).sum()),
            "better_placed": int((rows["r_shape_index"] > rows["r_shape_index_of"]).sum()),
            "weeks": len(rows),
        }
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    study = parser.parse_args().study
    places = [folder / "prediction.csv" for folder in (study / "results" / "study", study / "study", study)]
    path = next((place for place in places if place.is_file()), None)
    if path is None:
        raise InputError("has no prediction.csv", path=study, remedy="Run a study with the preset expected first.")
    table = read_table(path)
    for shown in (COLUMNS, FURTHER):
        print(table[[*KEYS, "model", *shown]].to_string(index=False, float_format="%.3f"))
    found = []
    for keys, rows in table.groupby(KEYS):
        models = json.loads(rows.set_index("model")[COLUMNS + FURTHER].to_json(orient="index"))
        found.append(dict(zip(KEYS, keys, strict=True)) | models.pop("run") | models)
    wins = better(table)
    for pair, ways in wins.items():
        for way, count in ways.items():
            nearer, placed, weeks = count.values()
            print(f"{pair}: nearer than {way} in {nearer}, better placed in {placed} of {weeks}")
    print(json.dumps({"predictions": found, "better": wins}))


if __name__ == "__main__":
    main()
