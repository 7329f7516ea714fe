"""Two results folders side by side: configuration, versions, inputs, and every number of their tables."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..errors import InputError
from ..io.files import read_json, read_table
from ..io.yaml_files import read_yaml

KEYS = ("week", "from_week", "to_week", "start_week", "real_week", "seed", "step", "band", "horizon", "ranks")
"""Numeric columns that say what a row is of."""
OF_THE_MACHINE = ("seconds", "wall_s", "cpu_s", "cpu_seconds", "seconds_per_step", "peak_memory_MiB")
"""Columns that differ between two runs of the same."""
LEFT_OUT = ("resources.csv",)
PROVENANCE = Path("study", "provenance.json")
CONFIGURATION = Path("report", "config.yaml")


class Comparison(NamedTuple):
    """What two results folders have in common: settings that differ, how many tables and numbers were compared.

    `differences` are pairs of a table, relative to the results, and what differs in it, in words.
    """

    settings: list[str]
    tables: int
    numbers: int
    differences: list[tuple[str, str]]


def compare_results(first: Path, second: Path, tolerance: float) -> Comparison:
    """Returns what two results folders (or working directories) differ in.

    Numbers count as equal where they differ by at most `tolerance` of the larger one. InputError where one of the
    folders holds no results.
    """
    folders = [results_in(first), results_in(second)]
    files = [{path.relative_to(folder).as_posix(): path for path in _tables(folder)} for folder in folders]
    differences = [
        (name, f"only in {where}")
        for name in sorted(files[0].keys() ^ files[1].keys())
        for where in [first if name in files[0] else second]
    ]
    numbers, common = 0, sorted(files[0].keys() & files[1].keys())
    for name in common:
        count, found = compare_tables(read_table(files[0][name]), read_table(files[1][name]), tolerance)
        numbers += count
        differences += [(name, text) for text in found]
    return Comparison(list(_settings(*folders)), len(common), numbers, differences)


def results_in(folder: Path) -> Path:
    """Returns the results folder that is meant: the folder itself, or `results` in it."""
    for candidate in (folder / "results", folder):
        if any((candidate / name).is_dir() for name in ("brains", "runs", "study")):
            return candidate
    raise InputError("holds no results", path=folder, expected="a working directory of gyriflow, or its results/")


def compare_tables(first: pd.DataFrame, second: pd.DataFrame, tolerance: float) -> tuple[int, list[str]]:
    """Returns how many numbers two tables share, and what differs: columns, rows, numbers, texts.

    Rows belong together that have the same texts and keys; values of a long table are told by metric.
    """
    found = []
    for table, other, where in ((first, second, "first"), (second, first, "second")):
        if len(names := table.columns.difference(other.columns)):
            found.append(f"columns only in the {where}: {', '.join(names)}")
    shared = [name for name in first.columns if name in second.columns and name not in OF_THE_MACHINE]
    numeric = [
        name
        for name in shared
        if name not in KEYS and all(pd.api.types.is_numeric_dtype(table[name].dtype) for table in (first, second))
    ]
    keys = [name for name in shared if name not in numeric]
    sides = []
    for table in (first, second):
        side = table[shared].copy()
        side[keys] = side[keys].astype(str)
        # rows that nothing tells apart keep their order
        side["__row"] = side.groupby(keys).cumcount() if keys else np.arange(len(side))
        sides.append(side)
    both = sides[0].merge(sides[1], on=[*keys, "__row"], how="outer", suffixes=("", "__second"), indicator="__in")
    for value, where in (("left_only", "first"), ("right_only", "second")):
        alone = int((both["__in"] == value).sum())
        if alone:
            found.append(f"{alone} row{'s' if alone > 1 else ''} only in the {where}")
    both = both[both["__in"] == "both"]
    for name in numeric:
        found += _differing(both, name, "metric" if "metric" in keys else None, tolerance)
    return len(both) * len(numeric), found


def _differing(both: pd.DataFrame, name: str, by: str | None, tolerance: float) -> Iterator[str]:
    a, b = both[name].to_numpy(dtype=float), both[f"{name}__second"].to_numpy(dtype=float)
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.where(a == b, 0.0, np.abs(a - b) / np.maximum(np.abs(a), np.abs(b)))
    # a number against none differs wholly, none against none does not
    relative = np.where(np.isnan(a) & np.isnan(b), 0.0, np.where(np.isnan(relative), 1.0, relative))
    groups = both[by].to_numpy() if by else np.full(len(both), name)
    for group in dict.fromkeys(groups):
        chosen = groups == group
        worst = np.flatnonzero(chosen)[np.argmax(relative[chosen])]
        beyond = int((relative[chosen] > tolerance).sum())
        if beyond:
            yield (
                f"{group}: {beyond} of {int(chosen.sum())} differ, at most by {100 * relative[worst]:.3g} % "
                f"({a[worst]:.6g} and {b[worst]:.6g})"
            )


def _tables(folder: Path) -> list[Path]:
    places = ("study/*.csv", "study/growth/*.csv", "brains/*/metrics/metrics.csv", "runs/*/*/folding/steps.csv")
    return [path for place in places for path in sorted(folder.glob(place)) if path.name not in LEFT_OUT]


def _settings(first: Path, second: Path) -> Iterator[str]:
    """Yields what differs in configuration and provenance."""
    for file, read in ((CONFIGURATION, read_yaml), (PROVENANCE, read_json)):
        contents = [dict(_flat(read(folder / file))) for folder in (first, second) if (folder / file).is_file()]
        if len(contents) == 1:
            yield f"{file} is only in {first if (first / file).is_file() else second}"
        if len(contents) < 2:
            continue
        for key in sorted(contents[0].keys() | contents[1].keys()):
            values = [content.get(key, "default" if file == CONFIGURATION else "none") for content in contents]
            if values[0] != values[1] and not key.startswith(("recorded", "results")):
                yield f"{key}: {values[0]} and {values[1]}"


def _flat(content: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(content, Mapping) and content:
        for key, value in content.items():
            yield from _flat(value, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(content, list) and any(isinstance(item, Mapping) for item in content):
        for index, item in enumerate(content):
            name = item.get("id", index) if isinstance(item, Mapping) else index
            yield from _flat(item, f"{prefix}[{name}]")
    else:
        yield prefix, content
