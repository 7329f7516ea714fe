"""What each factor of a finished study's runs is worth, one at a time around one of them.

    ./run python benchmarks/ablation.py STUDY_FOLDER --base measured --weeks 27 29

STUDY_FOLDER is where the study ran, with `results/` in it. A run's factors are the parameters in which its
`params.yaml` differs from that of `--base`. Gains (correlation of a curvature with the real brain's, less that of the
scaled start) are means over the compared weeks between `--weeks`, with that of their bootstrap intervals; so are the
displacement's correlation and slope. The last line is one JSON object, by run.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import pandas as pd

from gyriflow.io.files import read_table
from gyriflow.io.yaml_files import read_yaml

NOT_FACTORS = ("output_weeks", "end_week", "preset", "fields", "regional_growth", "regional_growth_of_cortex")
COLUMNS = [
    *(
        f"{kind}_{measure}"
        for measure in ("shape_index", "mean_curvature")
        for kind in ("gain", "gain_low", "gain_high")
    ),
    *("skill_shape_index", "skill_mean_curvature", "curvature_rms_ratio", "area_error", "volume_error"),
]


def flat(values: dict[str, Any], above: str = "") -> dict[str, Any]:
    """Returns nested settings by their dotted names."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict) and value and all(isinstance(key, str) for key in value):
            found |= flat(value, f"{above}{name}.")
        else:
            found[above + name] = value
    return found


def factors(own: dict[str, Any], base: dict[str, Any]) -> str:
    """Returns in which parameters a run differs from the base, curves left out."""
    one, other = flat(own), flat(base)
    names = [name for name in sorted(set(one) | set(other)) if one.get(name) != other.get(name)]
    kept = [name for name in names if name not in NOT_FACTORS and not isinstance(one.get(name), dict)]
    return ", ".join(f"{name} {one.get(name)}" for name in kept) or "-"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    parser.add_argument("--base", default="measured")
    parser.add_argument("--weeks", type=float, nargs=2, default=(0.0, 99.0))
    options = parser.parse_args()
    first, last = options.weeks
    folders = {path.parent.parent.name: path.parent for path in options.study.glob("results/runs/*/*/params.yaml")}
    base = read_yaml(folders[options.base] / "params.yaml")
    rows = {}
    for run, folder in sorted(folders.items()):
        if not (folder / "metrics" / "validation.csv").is_file():
            continue
        table = read_table(folder / "metrics" / "validation.csv")
        table = table[table["week"].between(first, last)]
        moves = folder / "metrics" / "displacement_agreement.csv"
        row = {
            name: float(table[name].abs().max() if name.endswith("error") else table[name].mean()) for name in COLUMNS
        }
        if moves.is_file():
            agreement = read_table(moves)
            agreement = agreement[agreement["to_week"].between(first, last)]
            row |= {name: float(agreement[name].mean()) for name in ("displacement_r", "displacement_slope")}
        rows[run] = {"factors": factors(read_yaml(folder / "params.yaml"), base)} | row
    shown = pd.DataFrame(rows).T.sort_values("gain_shape_index", ascending=False)
    print(shown.to_string(float_format="%.3f"))
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
