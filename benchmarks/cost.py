"""Fits what a study takes to finished ones: `./run python benchmarks/cost.py STUDY ...` (working directories).

Writes `src/gyriflow/cost/measured.json`, which the terminal and `gyriflow check` read.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from gyriflow.cost import MEASURED
from gyriflow.io.benchmarks import read_benchmarks
from gyriflow.io.files import write_json
from gyriflow.report.resources import busy_seconds


def jobs_of(study: Path) -> pd.DataFrame:
    """Returns what the jobs of a study took: rule, path, busy seconds, memory."""
    files = sorted(study.glob("results/**/benchmarks/*.tsv"))
    rows = []
    for path in files:
        name = path.relative_to(study).as_posix()
        rule = "register" if "/registration/" in name else path.name.split(".")[0]
        measured = read_benchmarks(study, {rule: name.replace(".", r"\.")})
        rows.append(measured.assign(study=str(study), path=name))
    table = pd.concat(rows, ignore_index=True)
    table["busy_s"] = busy_seconds(table["wall_s"], table["cpu_s"])
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="+", type=Path, help="working directories of finished studies")
    arguments = parser.parse_args()
    jobs = pd.concat([jobs_of(study) for study in arguments.studies], ignore_index=True)
    rules = {
        str(rule): {"jobs": len(rows), "typical_s": round(float(rows["busy_s"].median()), 2)}
        for rule, rows in jobs.groupby("rule")
    }
    write_json(MEASURED, {"rules": rules})
    print(json.dumps({"studies": len(arguments.studies), "jobs": len(jobs), "rules": len(rules)}))


if __name__ == "__main__":
    main()
