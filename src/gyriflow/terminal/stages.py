"""What a job is about, in the words of a reader: its stage, and the brain or run that it works on."""

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

FILES = {
    "input": "inputs",
    "retrieve": "download",
    "validation": "validation",
    "onset": "validation",
    "validation_figures": "figures",
    "influence_figures": "figures",
    "study": "metrics",
    "regions": "metrics",
    "run_figures": "figures",
    "study_figures": "figures",
}
"""Stages of rule files that are not named after theirs."""
ORDER = (
    *("download", "inputs", "surface", "quality", "mesh", "growth", "registration", "folding", "metrics", "validation"),
    *("studies", "calibration", "figures", "report"),
)
"""Stages in the order in which data flow."""
RULE = re.compile(r"^(?:checkpoint|(?:use )?rule) (?:\w+ as )?(\w+)(?::| with:)", flags=re.MULTILINE)
"""The line on which a rule or a checkpoint begins."""


@cache
def stages(rules: Path) -> dict[str, str]:
    """Returns the stage of each rule in a folder of rule files: the file's, but a rule `…_figure` is of the figures."""
    found = {}
    for file in sorted(rules.glob("*.smk")):
        stage = FILES.get(file.stem, file.stem)
        for name in RULE.findall(file.read_text()):
            found[name] = "figures" if name.endswith("_figure") else stage
    return found


def subject(wildcards: Mapping[str, str]) -> str:
    """Returns the brain or run that a job works on, by its wildcards; the study if they name none."""
    if where := wildcards.get("where"):
        kind, *names = where.split("/")
        wildcards = {"brain": names[0]} if kind == "brains" else {"run": names[0], "brain": names[1]}
    if {"earlier", "later"} <= set(wildcards):
        return f"brain {wildcards['earlier']} to {wildcards['later']}"
    if file := wildcards.get("file"):
        return Path(file).name
    parts = [f"{kind} {wildcards[kind]}" for kind in ("run", "brain") if kind in wildcards]
    return ", ".join(parts) or "study"
