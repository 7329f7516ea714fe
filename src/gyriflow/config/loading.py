"""From plain dictionaries to a validated configuration, with every problem named at once."""

import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from ..errors import InputError
from .atlas import AtlasSettings, atlas_brains, atlas_files, atlas_problems
from .brains import SIDES, SINGLE_FILES, Brain
from .checks import brain_problems, growth_problems, study_problems
from .folding import VARYING, FoldingSettings
from .metrics import age_reference_problems
from .root import Config
from .schemes import scheme_problems
from .varying import TAGS

REFERENCE_RUNS: dict[str, Any] = {"reference": {}}


def load(raw: Mapping[str, Any], base_dir: Path | str = ".", *, downloading: bool = False) -> Config:
    """Returns the validated configuration, with input files as absolute paths.

    Parameters
    ----------
    raw
        The configuration as read from YAML.
    base_dir
        Folder of the configuration file, for relative paths.
    downloading
        Whether the files of the atlas are about to be fetched, so that they need not be there yet.

    Raises
    ------
    InputError
        Naming all problems at once, each with its key, what was found and what is allowed.
    """
    plain = _plain(raw)
    problems: list[str] = []
    valid: dict[str, Any] = {}
    for name, field in Config.model_fields.items():
        if name in ("brains", "runs", "folding"):
            continue
        if name in plain or field.is_required():
            valid[name] = _validated(field.annotation, plain.get(name, _ABSENT), (name,), problems)
    problems += [_unknown((key,), key, list(Config.model_fields)) for key in plain if key not in Config.model_fields]

    schemes = plain.get("schemes")
    schemes = schemes if isinstance(schemes, dict) else {}
    problems += [problem for name, scheme in schemes.items() for problem in scheme_problems(name, scheme)]
    with_atlas = plain.get("atlas") is not None
    given = plain.get("brains", [] if with_atlas else _ABSENT)
    valid["brains"] = _brains(given, list(schemes), Path(base_dir), problems, alone=not with_atlas)
    valid["atlas"], of_atlas = _atlas(valid.get("atlas"), Path(base_dir), problems, downloading=downloading)
    valid["brains"] += tuple(Brain(**entry) for entry in of_atlas)
    folding = _with_map_files(plain.get("folding", {}), Path(base_dir), "folding", problems)
    valid["folding"] = _validated(FoldingSettings, folding, ("folding",), problems)
    runs = _runs(plain.get("runs"), folding if isinstance(folding, dict) else {}, Path(base_dir), problems)
    entries = [*(given if isinstance(given, list) else []), *of_atlas]
    if with_atlas and not of_atlas:
        # the ids of an atlas section that is wrong are not known
        problems += study_problems(entries, None, runs)
    else:
        problems += study_problems(entries, plain.get("start"), runs)
        problems += growth_problems(entries, plain.get("growth"), plain.get("start"), runs)
        problems += age_reference_problems(entries, plain.get("metrics"))
    if problems:
        raise InputError(
            f"the configuration has {len(problems)} problem{'s' if len(problems) > 1 else ''}:\n  "
            + "\n  ".join(problems)
            + "\nAll keys are explained in config/README.md"
        )
    return Config(**valid | {"runs": runs})


_ABSENT = object()


def _plain(value: Any) -> Any:
    """Returns nested mappings and sequences as plain dictionaries and lists."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(item) for item in value]
    return value


def _validated(kind: Any, value: Any, path: tuple, problems: list[str]) -> Any:
    """Returns `value` as the type `kind`, or adds what is wrong with it to `problems` and returns None."""
    if value is _ABSENT:
        problems.append(f"{_dotted(path)}: is missing")
        return None
    try:
        return TypeAdapter(kind).validate_python({} if value is None and _is_model(kind) else value)
    except ValidationError as error:
        problems += [_described(kind, details, path) for details in error.errors()]
        return None


def _brains(
    raw: Any, schemes: list[str], base_dir: Path, problems: list[str], *, alone: bool = True
) -> tuple[Brain, ...]:
    """Returns the brains of `brains`; with `alone` there are no others, so that it may not be empty."""
    if raw is _ABSENT or not isinstance(raw, list) or (alone and not raw):
        found = "nothing" if raw is _ABSENT else repr(raw)
        problems.append(f"brains: found {found}; expected a list of brains, each with id, week and a source")
        return ()
    brains = []
    for number, entry in enumerate(raw):
        where = f"brains[{number}]"
        problems += brain_problems(entry, where, schemes)
        brains.append(_validated(Brain, _with_files(entry, base_dir, where, problems), ("brains", number), problems))
    return tuple(brains)


def _atlas(
    atlas: AtlasSettings | None, base_dir: Path, problems: list[str], *, downloading: bool
) -> tuple[AtlasSettings | None, list[dict[str, Any]]]:
    """Returns the atlas section with its folder as an absolute path, and the entries of `brains` that it stands for."""
    if atlas is None:
        return None, []
    places = [base_dir / Path(atlas.folder).expanduser(), Path.cwd() / atlas.folder]
    folder = next((place for place in places if place.exists()), places[0])
    atlas = atlas.model_copy(update={"folder": str(folder.resolve())})
    files = atlas_files(atlas)
    problems += atlas_problems(atlas, files, downloading=downloading)
    return atlas, atlas_brains(files)


def _with_files(entry: Any, base_dir: Path, where: str, problems: list[str]) -> Any:
    """Returns an entry of `brains` with its files as absolute paths; missing ones are added to `problems`."""
    if not isinstance(entry, dict):
        return entry
    entry = dict(entry)
    holders = [(entry, key, "") for key in SINGLE_FILES]
    for name, keys in (("hemispheres", SIDES), ("hemisphere", ("file", "white"))):
        if isinstance(entry.get(name), dict):
            entry[name] = dict(entry[name])
            holders += [(entry[name], key, f"{name}.") for key in keys]
            if isinstance(entry[name].get("white"), dict):
                entry[name]["white"] = dict(entry[name]["white"])
                holders += [(entry[name]["white"], side, f"{name}.white.") for side in SIDES]
    for holder, key, prefix in holders:
        if isinstance(holder.get(key), str):
            holder[key] = _found_file(holder[key], base_dir, f"{where}.{prefix}{key}", problems)
    return entry


def _with_map_files(settings: Any, base_dir: Path, where: str, problems: list[str]) -> Any:
    """Returns settings of the folding with the files of maps as absolute paths; missing ones go to `problems`."""
    if not isinstance(settings, dict):
        return settings
    settings = dict(settings)
    for name in VARYING:
        if not isinstance(settings.get(name), dict):
            continue
        settings[name] = dict(settings[name])
        for key in ("map", "surface"):
            value, place = settings[name].get(key), f"{where}.{name}.{key}"
            if isinstance(value, str):
                settings[name][key] = _found_file(value, base_dir, place, problems)
            elif isinstance(value, list) and all(isinstance(path, str) for path in value):
                settings[name][key] = [_found_file(path, base_dir, place, problems) for path in value]
    return settings


def _found_file(path: str, base_dir: Path, where: str, problems: list[str]) -> str:
    """Returns the absolute path of a file; where there is none, that is added to `problems`."""
    places = [base_dir / Path(path).expanduser(), Path.cwd() / path]
    present = [place for place in places if place.is_file()]
    if not present:
        problems.append(f"{where}: no such file: {places[0]}{_present_instead(places[0])}")
    return str((present or places)[0].resolve())


def _present_instead(path: Path) -> str:
    """Returns the files beside a missing one that differ from it in a number only, such as those of other weeks."""
    pattern = re.compile(re.sub(r"\d+(\\\.\d+)?", r"[0-9.]+", re.escape(path.name)))
    try:
        names = sorted(other.name for other in path.parent.iterdir() if pattern.fullmatch(other.name))
    except OSError:
        names = []
    return f"; there are {', '.join(names)}" if names else ""


def _runs(raw: Any, folding: dict[str, Any], base_dir: Path, problems: list[str]) -> dict[str, dict[str, Any]]:
    """Returns each run's settings: `folding` with the run's own on top."""
    if raw is None or raw == {}:
        raw = REFERENCE_RUNS
    if not isinstance(raw, dict):
        problems.append(f"runs: found {raw!r}; expected names, each with the settings that differ from folding")
        return {}
    runs = {}
    for name, override in raw.items():
        if override is not None and not isinstance(override, dict):
            problems.append(f"runs.{name}: found {override!r}; expected settings that differ from folding")
            continue
        override = _with_map_files(override or {}, base_dir, f"runs.{name}", problems)
        runs[name] = _merged(folding, override)
        found: list[str] = []
        _validated(FoldingSettings, runs[name], ("runs", name), found)
        # what `folding` itself has wrong was already said there
        known = {problem.removeprefix("folding") for problem in problems if problem.startswith("folding")}
        problems += [problem for problem in found if problem.removeprefix(f"runs.{name}") not in known]
    return runs


def _merged(base: dict[str, Any], override: dict[str, Any]) -> dict[str, Any]:
    both = dict(base)
    for key, value in override.items():
        nested = isinstance(value, dict) and isinstance(base.get(key), dict) and key not in VARYING
        both[key] = _merged(base[key], value) if nested else value
    return both


def _dotted(path: tuple) -> str:
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


def _described(kind: Any, details: ErrorDetails, path: tuple) -> str:
    place = tuple(part for part in details["loc"] if part not in TAGS)
    where = (*path, *place)
    if details["type"] == "extra_forbidden":
        return _unknown(where, str(place[-1]), list(_keys_at(kind, place[:-1])))
    if details["type"] == "missing":
        return f"{_dotted(where)}: is missing"
    expected = details["msg"].removeprefix("Value error, ").removeprefix("Input should ")
    return f"{_dotted(where)}: found {details['input']!r}; it should {expected}"


def _unknown(where: tuple, key: str, known: list[str]) -> str:
    nearest = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    hint = f"did you mean {nearest[0]}?" if nearest else f"known are {', '.join(known)}"
    return f"{_dotted(where)}: unknown key; {hint}"


def _keys_at(kind: Any, path: tuple) -> list[str]:
    """Returns the known keys of the model that stands at `path` inside the type `kind`."""
    if get_origin(kind) is dict:
        return _keys_at(get_args(kind)[1], path[1:])
    models = _models(kind)
    if not models:
        return []
    if not path:
        return list(models[0].model_fields)
    field = models[0].model_fields.get(str(path[0]))
    return _keys_at(field.annotation, path[1:]) if field is not None else []


def _models(kind: Any) -> list[type[BaseModel]]:
    if get_origin(kind) in (Union, UnionType, Annotated):
        return [model for part in get_args(kind) for model in _models(part)]
    return [kind] if _is_model(kind) else []


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)
