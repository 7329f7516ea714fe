"""What a finished study's simulations are worth, run by run.

    ./run python benchmarks/validation.py STUDY_FOLDER

STUDY_FOLDER is where the study ran (with `results/study/` in it), its `results`, or `results/study` itself. The tables
`validation.csv` and `displacement_agreement.csv` there are read. The last line is one JSON object: for each run by its
name `worst_area_error`, `worst_volume_error`, `skill_shape_index`, `skill_mean_curvature`, `curvature_rms_ratio`,
`displacement_r`, `displacement_slope` and the skill by horizon, explained and predicted weeks apart under `horizon`;
where the metrics are there too, `largest_difference` of either hemisphere from the real one in the last week, by
metric.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from gyriflow.comparison.validation import over_starts, summary
from gyriflow.errors import InputError
from gyriflow.io.files import read_table


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    folder = tables(parser.parse_args().study)
    validation = read_table(folder / "validation.csv")
    moves = folder / "displacement_agreement.csv"
    displacement = read_table(moves) if moves.exists() else pd.DataFrame()
    shown = ["run", "kind", "start_week", "week", "seed", "distance_mm", "distance95_mm", "cortex_dice"]
    shown += ["area_error", "volume_error", "r_shape_index"]
    shown += ["r_start_shape_index", "r_adjacent_shape_index", "gain_low_shape_index", "gain_high_shape_index"]
    shown += ["skill_shape_index", "skill_mean_curvature", "curvature_rms_ratio"]
    print(validation[[name for name in shown if name in validation]].to_string(index=False, float_format="%.3f"))
    found = summary(validation, displacement)
    horizons = folder / "horizon.csv"
    if horizons.exists():
        shown = ["model", "kind", "known_gw", "horizon", "starts", "gain_shape_index", "gain_mean_curvature"]
        shown += ["skill_shape_index", "skill_mean_curvature", "displacement_r", "displacement_r_scaling"]
        print("\nby horizon, over the starts:")
        print(over_starts(read_table(horizons))[shown].to_string(index=False, float_format="%.3f"))
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
