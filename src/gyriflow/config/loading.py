"""Validates a configuration from plain dictionaries and reports its problems together."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..io.yaml_files import read_keys
from ..parameters.folding import VARYING
from ..parameters.settings import PROBLEM, Key, dotted, line, messages
from .atlas import Atlas, AtlasSettings, UsedAtlas, atlas_brains, atlas_problems, atlas_sections
from .brains import ParticipantsSettings, participants_brains
from .checks import problems_between
from .root import Config
from .runs import PRESETS

REFERENCE_RUNS: dict[str, Any] = {"reference": {}}


def load(raw: Mapping[str, Any], base_dir: Path | str = ".", *, keep_going: bool = False) -> Config:
    """Returns the validated configuration, with input files as absolute paths.

    Parameters
    ----------
    raw
        The configuration as read from YAML.
    base_dir
        Folder of the configuration file, for relative paths.
    keep_going
        Whether rows of `participants` that lack their age or data are left out, as `Config.left_out`; else they are
        problems.

    Raises
    ------
    InputError
        Naming all problems of keys at once, or where each key is valid all problems between keys, each with its key,
        what was found and what is allowed.
    """
    plain = {"folding": {}} | _plain(raw)
    plain["runs"] = _complete_runs(plain.get("runs"), plain.get("folding"))
    if isinstance(plain["folding"], dict):
        plain["folding"] = _with_preset(plain["folding"], {})
    atlases, problems = _atlases(plain.get("atlas"), Path(base_dir))
    # an invalid value tells the checks that not all ids of brains are known
    plain["atlas"] = None if problems else [used.settings for used in atlases]
    of_table, left_out = _participants(plain, Path(base_dir), problems)
    if further := [*(entry for used in atlases for entry in atlas_brains(used)), *of_table]:
        plain["brains"] = [*(plain.get("brains") or ()), *further]
    if not (keep_going and plain.get("brains")):
        problems += [row["cause"] for row in left_out.values()]
    awaited = [str(file.path) for used in atlases for file in used.files]
    waiting = False
    try:
        config = Config.model_validate(plain, context={"folder": str(base_dir), "awaited": awaited})
    except ValidationError as error:
        waiting = any(details["type"] != PROBLEM for details in error.errors())
        problems += _lines(messages(error, Config))
    else:
        problems += _lines([(problem.key, problem.text) for problem in problems_between(config)])
    if problems:
        raise InputError(
            f"the configuration has {len(problems)} problem{'s' if len(problems) > 1 else ''}:\n  "
            + "\n  ".join(problems)
            + "\nconfig/README.md says where all keys are described"
            + ("; once each key is valid, they are checked against each other" if waiting else "")
            + ("; with --keep-going, rows that can't be used are left out" if left_out and not keep_going else "")
        )
    return config.leave_out(left_out)


def _participants(
    plain: dict[str, Any], base_dir: Path, problems: list[str]
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """Returns the brains of `participants` and its rows that can't be used, or adds what is wrong to `problems`."""
    if plain.get("participants") is None:
        return [], {}
    try:
        settings = ParticipantsSettings.model_validate(plain["participants"])
        entries, left_out, found = participants_brains(settings, base_dir)
    except ValidationError:
        # said with all other keys
        return [], {}
    except InputError as error:
        problems.append(f"participants.file: {error}")
        return [], {}
    problems += found
    return entries, left_out


def _plain(value: Any) -> Any:
    """Returns nested mappings and sequences as plain dictionaries and lists."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(item) for item in value]
    return value


def _complete_runs(runs: Any, folding: Any) -> Any:
    """Returns the runs, each with the keys of its preset and of `folding` that it does not name itself."""
    runs = runs or REFERENCE_RUNS
    if not isinstance(runs, dict):
        return runs
    base = folding if isinstance(folding, dict) else {}
    return {
        name: _with_preset(base, override or {}) if isinstance(override, dict | None) else override
        for name, override in runs.items()
    }


def _with_preset(base: dict[str, Any], override: dict[str, Any]) -> dict[str, Any]:
    """Returns the settings of a run: those of `base`, its preset over them, its own over both.

    A preset of `base` lies under the other settings of `base`.
    """
    if "preset" in override:
        return _merge(_merge(base, PRESETS.get(str(override["preset"]), {})), override)
    return _merge(_merge(PRESETS.get(str(base.get("preset")), {}), base), override)


def _merge(base: dict[str, Any], override: dict[str, Any]) -> dict[str, Any]:
    both = dict(base)
    for key, value in override.items():
        if key == "growth":
            both[key] = _merged_growth(base.get(key), value)
            continue
        nested = isinstance(value, dict) and isinstance(base.get(key), dict) and key not in VARYING
        both[key] = _merge(base[key], value) if nested else value
    return both


def _merged_growth(base: Any, override: Any) -> Any:
    """Returns growth with the keys of `base` too where both have one model; either may be the model's name alone."""
    old, new = ({"model": given} if isinstance(given, str) else given for given in (base, override))
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    return new if new.get("model", old.get("model")) != old.get("model") else {**old, **new}


def _atlases(raw: Any, base_dir: Path) -> tuple[list[UsedAtlas], list[str]]:
    """Returns the atlases that can be used, and what is wrong with others and their sections."""
    atlases: list[UsedAtlas] = []
    problems: list[str] = []
    for path, section in atlas_sections(raw):
        where = dotted(path)
        try:
            settings = AtlasSettings.model_validate(section).located(base_dir)
        except ValidationError as error:
            problems += [line((*path, *place), text) for place, text in messages(error, AtlasSettings)]
            continue
        try:
            used = UsedAtlas(settings, Atlas.model_validate(read_keys(settings.description)))
        except InputError as error:
            problems.append(f"{where}.file: {error}")
        except ValidationError as error:
            problems += [f"{settings.description}: {line(place, text)}" for place, text in messages(error, Atlas)]
        else:
            found = [f"{where}.{problem}" for problem in atlas_problems(used)]
            problems += found
            atlases += [] if found else [used]
    return atlases, problems


def _lines(told: list[tuple[Key, str]]) -> list[str]:
    """Returns the problems as lines but those of atlases; what a run has from `folding` is said there only."""
    found = [(path, text) for path, text in dict.fromkeys(told) if path[0] != "atlas"]
    of_folding = {(path[1:], text) for path, text in found if path[0] == "folding"}
    return [line(path, text) for path, text in found if path[0] != "runs" or (path[2:], text) not in of_folding]
