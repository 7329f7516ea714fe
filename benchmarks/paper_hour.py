"""How long the paper takes: its target from a clean folder of results, with the seconds of each stage.

    ./run python benchmarks/paper_hour.py [FOLDER] [--configfile config/examples/paper.yaml] [--cores 2]

FOLDER (default: `paper-hour`) must not hold results. The last line is one JSON object: `total` (wall seconds of the
whole command), `exit_code`, `jobs`, and `stages`, by rule: `jobs`, `wall_s` (summed over jobs that ran side by side),
`cpu_s`, `peak_memory_MiB`; `runs`, by run: how it ended, elements, steps and processor seconds; `nearest`: by study the
nearest value by each measure of the hemispheres.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd

from gyriflow.errors import InputError
from gyriflow.io.files import read_json, read_table

ROOT = Path(__file__).resolve().parents[1]


def command(arguments: argparse.Namespace) -> list[str]:
    """Returns the command that is measured, as `./run snakemake` runs it."""
    return [
        *(sys.executable, "-m", "gyriflow.cli.launch", "--cores", str(arguments.cores), arguments.target),
        *("--snakefile", str(ROOT / "Snakefile"), "--configfile", str(arguments.configfile.resolve())),
        *("--directory", str(arguments.folder)),
    ]


def runs_of(folder: Path) -> dict[str, dict]:
    """Returns what each run's summary says, by run."""
    found = {}
    for path in sorted(folder.glob("results/runs/*/*/folding/summary.json")):
        summary = read_json(path)
        names = ("diverged", "reached_week", "tets", "steps", "cpu_seconds", "seconds")
        found[path.parts[-4]] = {name: summary[name] for name in names}
    return found


def nearest_of(folder: Path) -> dict[str, list[dict]]:
    """Returns the nearest values by study, of the bands and the whole surface."""
    found = {}
    for path in sorted(folder.glob("results/study/*/nearest.csv")):
        table = read_table(path)
        kept = table[table["measure"].str.match("relative_power|spectral_distance|surface_symmetric")]
        rows = kept.drop(columns=["subject", "run"]).astype(object)
        found[path.parent.name] = rows.where(rows.notna(), None).to_dict("records")
    return found


def stages_of(folder: Path) -> pd.DataFrame:
    """Returns what the jobs of each stage took, the longest first: jobs, wall_s and cpu_s (sums), peak_memory_MiB."""
    found = sorted(folder.glob("results/**/benchmarks/*.tsv"))
    measured = ["s", "cpu_time", "max_rss"]
    table = pd.concat(
        [
            pd.DataFrame(columns=[*measured, "stage"], dtype=str),
            *(pd.read_csv(path, sep="\t", dtype=str).assign(stage=path.name.split(".")[0]) for path in found),
        ]
    )
    for name in measured:
        table[name] = pd.to_numeric(table[name], errors="coerce")
    stages = table.groupby("stage").agg(
        jobs=("s", "size"), wall_s=("s", "sum"), cpu_s=("cpu_time", "sum"), peak_memory_MiB=("max_rss", "max")
    )
    return stages.sort_values("cpu_s", ascending=False).reset_index()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("paper-hour"))
    parser.add_argument("--configfile", type=Path, default=ROOT / "config" / "examples" / "paper.yaml")
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--target", default="paper")
    arguments = parser.parse_args()
    if (arguments.folder / "results").exists():
        raise InputError("holds results already", path=arguments.folder, remedy="Choose another folder, or delete it.")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path = os.pathsep.join(filter(None, [str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]))
    began = time.monotonic()
    outcome = subprocess.run(command(arguments), env=os.environ | {"PYTHONPATH": path}, check=False)
    total = time.monotonic() - began
    stages = stages_of(arguments.folder)
    print(stages.to_string(index=False))
    result = {
        "total": round(total, 1),
        "exit_code": outcome.returncode,
        "cores": arguments.cores,
        "jobs": int(stages["jobs"].sum()),
        "stages": stages.set_index("stage").round(1).to_dict("index"),
        "runs": runs_of(arguments.folder),
        "nearest": nearest_of(arguments.folder),
    }
    print(json.dumps(result))
    sys.exit(outcome.returncode)


if __name__ == "__main__":
    main()
