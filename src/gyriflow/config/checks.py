"""Checks across keys, on raw values so that they are made even where another key is wrong."""

from collections import Counter
from collections.abc import Collection
from typing import Any

from .brains import KINDS, SHAPE_SIZES, SOURCES, ShapeSettings
from .folding import GROWTH_RATES, FoldingSettings
from .growth import estimated_from, growth_series
from .schemes import BUILT_IN_SCHEMES

VOLUMES = ("labels", "segmentation")
"""Sources that give a label volume."""
SURFACES = ("hemispheres", "hemisphere", "pial")
"""Sources that give surfaces whose coordinates may have other axes."""
VOLUME_SUFFIXES = (".nii", ".nii.gz", ".mgz", ".mgh")
"""How files with volumes are named."""
PLACEHOLDERS = ("{image}", "{labels}")
"""What stands for the two files in a command that segments."""
PHANTOM_WEEKS = (21, 36)
"""Gestational weeks of which synthetic brains can be made."""
MOST_UNEQUAL_AXES = 2.0
"""Longest over shortest semi-axis of a shape: beyond this its ends are too sharp for even triangles."""
MOST_NOISE = 0.02
"""Height of the bumps over the smallest size of a shape."""
RESERVED_BRAINS = ("study", "report")
"""Folders of results that belong to no brain."""
RESERVED_RUNS = ("real",)
"""What stands for the run in tables of measured brains."""


def brain_problems(raw: Any, where: str, schemes: Collection[str] = ()) -> list[str]:
    """Returns what is wrong with one entry of `brains` beyond its single keys.

    `schemes` are the names of the label schemes that the configuration adds.
    """
    if not isinstance(raw, dict):
        return []
    given = [key for key in SOURCES if raw.get(key) is not None]
    problems = []
    if not given and raw.get("image") is not None:
        problems.append(
            f"{where}.image: gyriflow does not segment images; give a label volume under labels, or under segmentation "
            "your own command that makes one from the image"
        )
    elif len(given) != 1:
        found = " and ".join(given) or "none"
        problems.append(f"{where}: found {found} as its source; expected exactly one of {', '.join(SOURCES)}")
    volumes = [key for key in VOLUMES if key in given]
    if volumes and raw.get("scheme") is None:
        problems.append(f"{where}.scheme: is missing; it says what the labels of {where}.{volumes[0]} mean")
    one = raw.get("hemisphere")
    if isinstance(one, dict) and str(one.get("file")).endswith(VOLUME_SUFFIXES) and raw.get("scheme") is None:
        problems.append(f"{where}.scheme: is missing; it says what the labels of {where}.hemisphere.file mean")
    scheme = raw.get("scheme")
    if isinstance(scheme, str) and scheme not in (known := dict.fromkeys([*BUILT_IN_SCHEMES, *schemes])):
        problems.append(f"{where}.scheme: found {scheme!r}; expected one of {', '.join(known)}, or a name of schemes")
    problems += _segmentation_problems(raw, where)
    meanings = {
        "scheme": (*VOLUMES, "hemisphere"),
        "image": VOLUMES,
        "affine_from": (*VOLUMES, "hemisphere"),
        "coordinates": SURFACES,
        "white": ("pial",),
    }
    for key, sources in meanings.items():
        if key in raw and len(given) == 1 and given[0] not in sources:
            problems.append(f"{where}.{key}: has no meaning with {given[0]}; only with {' or '.join(sources)}")
    week = _number(raw.get("week"))
    if "phantom" in given and week is not None and not PHANTOM_WEEKS[0] <= week <= PHANTOM_WEEKS[1]:
        problems.append(f"{where}.week: found {week:g}; a phantom's should be {PHANTOM_WEEKS[0]} to {PHANTOM_WEEKS[1]}")
    if isinstance(raw.get("shape"), dict):
        problems += [f"{where}.shape.{problem}" for problem in _shape_problems(raw["shape"])]
    return problems


def _segmentation_problems(raw: dict[str, Any], where: str) -> list[str]:
    """Returns what is wrong with the `segmentation` of one brain (raw)."""
    if not isinstance(raw.get("segmentation"), dict):
        return []
    where, problems = f"{where}.segmentation", []
    if raw.get("image") is None:
        problems.append(f"{where}: has no image to work on; give one under image")
    command = raw["segmentation"].get("command")
    missing = [place for place in PLACEHOLDERS if isinstance(command, str) and place not in command]
    if missing:
        problems.append(
            f"{where}.command: lacks {' and '.join(missing)}, which stand for the files it reads and writes"
        )
    return problems


def _shape_problems(shape: dict[str, Any]) -> list[str]:
    """Returns what is wrong between the keys of one shape, each with its key in front."""
    kind = shape.get("kind")
    if not isinstance(kind, str) or kind not in SHAPE_SIZES:
        return []
    key = SHAPE_SIZES[kind]
    problems = [
        f"{other}: has no meaning with kind {kind}, whose size is {key}"
        for other in dict.fromkeys(SHAPE_SIZES.values())
        if other in shape and other != key
    ]
    given = shape.get(key, ShapeSettings.model_fields[key].default)
    sizes = [_number(size) for size in (given if isinstance(given, list | tuple) else [given])]
    known = [size for size in sizes if size is not None and size > 0]
    if len(known) < len(sizes) or not known:
        return problems
    if key == "semi_axes_mm" and max(known) > MOST_UNEQUAL_AXES * min(known):
        expected = f"at most {MOST_UNEQUAL_AXES:g} times the shortest, {min(known):g}"
        problems.append(f"{key}: found {max(known):g} as the longest; it should be {expected}")
    noise = _number(shape.get("noise_mm"))
    if noise is not None and noise > MOST_NOISE * min(known):
        expected = f"at most {MOST_NOISE * min(known):g}, a fiftieth of the smallest size in {key}"
        problems.append(f"noise_mm: found {noise:g}; it should be {expected}")
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


def growth_problems(brains: Any, growth: Any, start: Any, runs: dict[str, dict[str, Any]]) -> list[str]:
    """Returns what is wrong between the brains, the series that growth rates are estimated from, and the runs (raw)."""
    entries = [entry for entry in brains if isinstance(entry, dict)] if isinstance(brains, list) else []
    entries = [entry for entry in entries if isinstance(entry.get("id"), str)]
    weeks = {entry["id"]: week for entry in entries if (week := _number(entry.get("week"))) is not None}
    kinds = {
        entry["id"]: next((kind for key, kind in KINDS.items() if entry.get(key) is not None), "volume")
        for entry in entries
        if entry["id"] in weeks
    }
    growth = growth if isinstance(growth, dict) else {}
    given = growth.get("brains")
    lists = given if isinstance(given, dict) else {"": given} if given is not None else {}
    if not all(isinstance(ids, list) and all(isinstance(name, str) for name in ids) for ids in lists.values()):
        return []
    known = [entry["id"] for entry in entries]
    paths = {name: f"growth.brains.{name}".rstrip(".") for name in lists}
    unknown = {name: [brain for brain in ids if brain not in known] for name, ids in lists.items()}
    if any(unknown.values()):
        return [
            f"{paths[name]}: found {', '.join(ids)}; expected ids of brains: {', '.join(known)}"
            for name, ids in unknown.items()
            if ids
        ]
    reasons = {name: _too_few_weeks(ids, weeks) for name, ids in lists.items()}
    problems = [f"{paths[name]}: {reason}" for name, reason in reasons.items() if reason is not None]
    series = growth_series(kinds, weeks, given)
    wanted = growth.get("estimated_from")
    if isinstance(wanted, str) and series and wanted not in series:
        problems.append(f"growth.estimated_from: found {wanted!r}; the series are {', '.join(series)}")
    reason = _too_few_weeks([brain for ids in lists.values() for brain in ids] if lists else list(weeks), weeks)
    if reason is None and wanted is None and estimated_from(series, None, str(start)) is None:
        reason = f"the start brain is in none of the series {', '.join(series)}; name one under growth.estimated_from"
    if reason is not None:
        estimated = [(name, key) for name in runs for key in GROWTH_RATES if runs[name].get(key) == "estimated"]
        problems += dict.fromkeys(f"{_where(name, key, runs)}: can't be estimated: {reason}" for name, key in estimated)
    return problems


def _too_few_weeks(brains: list[str], weeks: dict[str, float]) -> str | None:
    """Returns what is wrong with the weeks of brains that are to give growth rates, None where nothing is."""
    found = len({weeks[brain] for brain in brains if brain in weeks})
    if found > 1:
        return None
    return f"found brains of {found} week{'' if found == 1 else 's'}; a growth rate needs two or more"


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
    if start_week is not None and end_week is not None:
        problems += _value_problems(settings, start_week, end_week)
    if settings.get("allow_negative_growth") not in (True, "true"):
        for key in GROWTH_RATES:
            value = settings.get(key, FoldingSettings.model_fields[key].default)
            curve = value.get("weeks") if isinstance(value, dict) else {"": value}
            rates = [_number(rate) for rate in curve.values()] if isinstance(curve, dict) else []
            problems += [
                (key, f"found {rate:g}; it should be 0 or more unless allow_negative_growth is true")
                for rate in rates
                if rate is not None and rate < 0
            ]
    return problems


def _number(value: Any) -> float | None:
    try:
        return float(value)
    except (TypeError, ValueError):
        return None


def _curve(settings: dict[str, Any], key: str) -> dict[float, float] | None:
    """Returns the values of a parameter by week, one at week 0 for a number; None where it has a map or is wrong."""
    value = settings.get(key, FoldingSettings.model_fields[key].default)
    if isinstance(value, dict) and value.get("map") is None and isinstance(value.get("weeks"), dict):
        points = {_number(week): _number(number) for week, number in value["weeks"].items()}
    else:
        points = {0.0: _number(value)}
    known = {week: number for week, number in points.items() if week is not None and number is not None}
    return dict(sorted(known.items())) if known and len(known) == len(points) else None


def _value_problems(settings: dict[str, Any], start: float, end: float) -> list[tuple[str, str]]:
    """Returns what is wrong with the values that parameters take from the start to the end, curves included."""
    problems = []
    loss = _number(settings.get("thickness_growth_mm_per_gw", 0.0))
    thickness = _curve(settings, "thickness_mm")
    if thickness is not None and loss is not None and min(thickness.values()) > 0:
        for week in (start, *(week for week in thickness if start < week < end), end):
            reached = _at(thickness, week) + loss * (week - start)
            if reached <= 0:
                problems.append(("thickness_mm", f"reaches {reached:g} mm at {week:g} GW; it should stay above 0"))
                break
    step = _number(settings.get("step_s", FoldingSettings.model_fields["step_s"].default))
    rates = [curve for key in GROWTH_RATES if (curve := _curve(settings, key)) is not None]
    growth = sum(max(map(abs, curve.values())) for curve in rates)
    if step is not None and step > 0 and growth * step >= 1:
        problems.append(("step_s", f"found {step:g}; tissue would grow by {growth * step:.3g} in a step, beyond 1"))
    return problems


def _at(curve: dict[float, float], week: float) -> float:
    """Returns the value of a curve at a week: linear in between, constant beyond."""
    weeks = list(curve)
    if week <= weeks[0] or week >= weeks[-1]:
        return curve[weeks[0] if week <= weeks[0] else weeks[-1]]
    after = next(i for i, known in enumerate(weeks) if known >= week)
    a, b = weeks[after - 1], weeks[after]
    return curve[a] + (curve[b] - curve[a]) * (week - a) / (b - a)
