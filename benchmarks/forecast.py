"""Compare the forecast of `gyriflow check` with the time that the steps of a finished
study took.

    ./run python benchmarks/forecast.py CONFIG [FOLDER]

CONFIG is the study's configuration, FOLDER its working directory (by default that of
CONFIG). For each stage: jobs, and the processor time of all of them as forecast and as
the steps have recorded it (s), with child processes and all ranks. The last line is one
JSON object, with `ratio`: the forecast of all steps over what they took.
"""

import argparse
import json
import re
from collections.abc import Iterator
from contextlib import chdir
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from gyriflow.io.yaml_files import read_keys
from gyriflow.messages import read_events
from gyriflow.running.cost import job_seconds
from gyriflow.settings.base import folder_of
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import Study

PLACE = re.compile(
    r"results/(?:brains/(?P<brain>[^/]+)|runs/(?P<run>[^/]+)/(?P<start>[^/]+)|study|report)/"
    r"(?:metrics/)?(?:week-(?P<week>[^/]+)/)?(?:.*/)?logs/(?P<name>.+)\.jsonl"
)
"""The record of a step: the brain, or the run and its start brain, the week, and the
rule with further wildcards."""


class Step(NamedTuple):
    """A finished step, and the processor time that it took."""

    rule: str
    wildcards: dict[str, str]
    cpu_s: float


def finished_steps(study: Study) -> Iterator[Step]:
    """Yield the steps of which there are records in the working directory."""
    for path in sorted(Path("results").glob("**/logs/**/*.jsonl")):
        place = PLACE.fullmatch(path.as_posix())
        if place is None:
            continue
        rule, _, names = place["name"].partition(".")
        wildcards = {"brain": place["brain"] or place["start"] or ""}
        if place["run"]:
            wildcards["run"] = place["run"]
        if place["week"]:
            wildcards["week"] = place["week"]
        if rule.startswith(("register", "match_surfaces")):
            wildcards |= pair_in(names, study)
        if rule == "targets":
            wildcards["origin"] = names
            rule = (
                "predicted_targets"
                if study.chains[wildcards["brain"], names].path
                else rule
            )
        for row in read_events(path):
            if row.get("event") == "usage":
                yield Step(rule, wildcards, row["cpu_s"])


def pair_in(names: str, study: Study) -> dict[str, str]:
    """Return the two brains that the record of a registration names."""
    for earlier, later in permutations(study.brains, 2):
        pair = f"{earlier},{later}"
        if names == pair or names.startswith(f"{pair}."):
            return {"earlier": earlier, "later": later}
    return {}


def main() -> None:
    """Print the table and the JSON object."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("config", type=Path)
    parser.add_argument("folder", type=Path, nargs="?")
    arguments = parser.parse_args()
    config = arguments.config.resolve()
    with chdir(arguments.folder or config.parent):
        study = resolve(load(read_keys(config), folder_of(config)))
        rows = []
        for step in finished_steps(study):
            forecast_s = job_seconds(study, step.rule, step.wildcards)
            rows.append(
                {
                    "stage": step.rule,
                    "jobs": 1,
                    "forecast_s": forecast_s,
                    "taken_s": step.cpu_s,
                }
            )
    table = pd.DataFrame(rows).groupby("stage", as_index=False).sum()
    table["ratio"] = table["forecast_s"] / table["taken_s"]
    table = table.sort_values("taken_s", ascending=False)
    whole = table[["jobs", "forecast_s", "taken_s"]].sum()
    ratio = whole["forecast_s"] / whole["taken_s"]
    print(table.to_string(index=False, float_format="%.3g"))
    print(
        json.dumps(
            {"stages": table.to_dict("records"), **whole.to_dict(), "ratio": ratio}
        )
    )


if __name__ == "__main__":
    main()
