"""Checks across keys, on raw values so that they are made even where another key is wrong."""

from collections import Counter
from typing import Any

from .brains import SOURCES
from .folding import FoldingSettings

PHANTOM_WEEKS = (21, 36)
"""Gestational weeks of which synthetic brains can be made."""
RESERVED_BRAINS = ("study", "report")
"""Folders of results that belong to no brain."""
RESERVED_RUNS = ("real",)
"""What stands for the run in tables of measured brains."""


def brain_problems(raw: Any, where: str) -> list[str]:
    """Returns what is wrong with one entry of `brains` beyond its single keys."""
    if not isinstance(raw, dict):
        return []
    given = [key for key in SOURCES if raw.get(key) is not None]
    problems = []
    if len(given) != 1:
        found = " and ".join(given) or "none"
        problems.append(f"{where}: found {found} as its source; expected exactly one of {', '.join(SOURCES)}")
    if "labels" in given and raw.get("scheme") is None:
        problems.append(f"{where}.scheme: is missing; it says what the labels of {where}.labels mean")
    for key, sources in {"scheme": ("labels",), "affine_from": ("labels",), "coordinates": SOURCES[1:3]}.items():
        if key in raw and len(given) == 1 and given[0] not in sources:
            problems.append(f"{where}.{key}: has no meaning with {given[0]}; only with {' or '.join(sources)}")
    week = _number(raw.get("week"))
    if "phantom" in given and week is not None and not PHANTOM_WEEKS[0] <= week <= PHANTOM_WEEKS[1]:
        problems.append(f"{where}.week: found {week:g}; a phantom's should be {PHANTOM_WEEKS[0]} to {PHANTOM_WEEKS[1]}")
    return problems


def study_problems(brains: Any, start: Any, runs: dict[str, dict[str, Any]]) -> list[str]:
    """Returns what is wrong between the brains, the start and the runs (each run's whole settings, raw)."""
    entries = [entry for entry in brains if isinstance(entry, dict)] if isinstance(brains, list) else []
    names = Counter(entry.get("id") for entry in entries if isinstance(entry.get("id"), str))
    problems = [
        f"brains: {count} brains have the id {name}; ids are unique" for name, count in names.items() if count > 1
    ]
    problems += [f"brains: the id {name} is reserved; choose another" for name in names if name in RESERVED_BRAINS]
    if isinstance(start, str) and names and start not in names:
        problems.append(f"start: found {start!r}; expected the id of a brain: {', '.join(map(str, names))}")
    start_week = next((_number(entry.get("week")) for entry in entries if entry.get("id") == start), None)
    said = set()
    for name, settings in runs.items():
        problems += _name_problems(name)
        for key, problem in _run_problems(settings, start_week):
            if (key, problem) not in said:
                said.add((key, problem))
                problems.append(f"{_where(name, key, runs)}: {problem}")
    return problems


def _name_problems(name: str) -> list[str]:
    if name in RESERVED_RUNS:
        return [f"runs.{name}: the name is reserved; choose another"]
    if not name or not all(char.isalnum() or char in "-_." for char in name) or not name[0].isalnum():
        return [f"runs.{name}: a run's name has letters, digits, - _ . only and begins with a letter or digit"]
    return []


def _where(run: str, key: str, runs: dict[str, dict[str, Any]]) -> str:
    """Returns the path of a key: that of `folding` where all runs share the value."""
    values = [settings.get(key) for settings in runs.values()]
    return f"folding.{key}" if all(value == values[0] for value in values) else f"runs.{run}.{key}"


def _run_problems(settings: dict[str, Any], start_week: float | None) -> list[tuple[str, str]]:
    problems = []
    end_week = _number(settings.get("end_week"))
    if start_week is not None and end_week is not None and end_week <= start_week:
        problems.append(("end_week", f"found {end_week:g}; it should be above the start brain's week, {start_week:g}"))
    if settings.get("allow_negative_growth") not in (True, "true"):
        for key in ("growth_rate_per_s", "radial_growth_rate_per_s"):
            rate = _number(settings.get(key, FoldingSettings.model_fields[key].default))
            if rate is not None and rate < 0:
                problems.append((key, f"found {rate:g}; it should be 0 or more unless allow_negative_growth is true"))
    return problems


def _number(value: Any) -> float | None:
    try:
        return float(value)
    except (TypeError, ValueError):
        return None
