"""Validation of a configuration from plain dictionaries, with all problems reported
together."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..grouping import grouped
from ..io.yaml_files import read_keys
from ..settings.atlas import Atlas, AtlasSettings
from ..settings.base import PROBLEM, Key, line, messages
from ..settings.brains import ParticipantsSettings
from ..settings.root import Config
from .atlases import UsedAtlas, atlas_brains, atlas_problems
from .checks import problems_between
from .participants import participants_brains


def load(
    raw: Mapping[str, Any], base_dir: Path | str = ".", *, keep_going: bool = False
) -> Config:
    """Return the validated configuration, as read from YAML, with input files as
    absolute paths.

    Paths are relative to the folder `base_dir` of the configuration. With `keep_going`,
    rows of `participants` without age or data are left out (`Config.left_out`); else
    they are problems. InputError with all problems of single keys, or if there are none
    all problems between keys; each with its key, the value found and the values
    allowed.
    """
    folder = Path(base_dir)
    plain = _plain(raw)
    atlases, problems = _atlases(plain.get("atlas"), folder)
    # None: the ids of brains are incomplete, so checks skip them
    plain["atlas"] = None if problems else [used.settings for used in atlases]
    entries, left_out, sources = _participants(
        plain.get("participants"), folder, problems
    )
    if further := [
        *(entry for used in atlases for entry in atlas_brains(used)),
        *entries,
    ]:
        plain["brains"] = [*(plain.get("brains") or ()), *further]
    unusable = (
        []
        if keep_going and plain.get("brains")
        else [(scan, row["cause"]) for scan, row in left_out.items()]
    )
    awaited = [str(file.path) for used in atlases for file in used.files]
    hints = ["config/README.md lists the descriptions of all keys"]
    try:
        config = Config.model_validate(
            plain, context={"folder": str(folder), "awaited": awaited}
        )
    except ValidationError as error:
        problems += _lines(messages(error, Config))
        if any(details["type"] != PROBLEM for details in error.errors()):
            hints.append("once each key is valid, they are checked against each other")
    else:
        problems += _lines(
            [(problem.key, problem.text) for problem in problems_between(config)]
        )
    if not problems and not unusable:
        config.left_out.update(left_out)
        config.age_sources.update(sources)
        return config
    if left_out and not keep_going:
        hints.append("use --keep-going to leave out rows that cannot be used")
    count = len(problems) + len(unusable)
    counted = f"{count} problem{'s' if count > 1 else ''}"
    lines = [
        text
        for text, _ in grouped([*(("", problem) for problem in problems), *unusable])
    ]
    raise InputError(
        "\n  ".join([f"the configuration has {counted}:", *lines])
        + "\n"
        + "; ".join(hints)
    )


def _participants(
    section: Any, folder: Path, problems: list[str]
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], dict[str, str]]:
    # an invalid section is reported with all other keys
    with suppress(ValidationError):
        if section is not None:
            try:
                return participants_brains(
                    ParticipantsSettings.model_validate(section), folder
                )
            except InputError as error:
                problems.append(f"participants.file: {error}")
    return [], {}, {}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(item) for item in value]
    return value


def _atlases(raw: Any, folder: Path) -> tuple[list[UsedAtlas], list[str]]:
    several = isinstance(raw, list)
    sections = raw if several else [] if raw is None else [raw]
    atlases: list[UsedAtlas] = []
    problems: list[str] = []
    for number, section in enumerate(sections):
        path: Key = ("atlas", number) if several else ("atlas",)
        try:
            settings = AtlasSettings.model_validate(section).located(folder)
        except ValidationError as error:
            problems += [
                line((*path, *place), text)
                for place, text in messages(error, AtlasSettings)
            ]
            continue
        try:
            used = UsedAtlas(
                settings, Atlas.model_validate(read_keys(settings.description))
            )
        except InputError as error:
            problems.append(line((*path, "name"), str(error)))
        except ValidationError as error:
            problems += [
                f"{settings.description}: {line(place, text)}"
                for place, text in messages(error, Atlas)
            ]
        else:
            wrong = [
                line((*path, *problem.key), problem.text)
                for problem in atlas_problems(used)
            ]
            problems += wrong
            atlases += [] if wrong else [used]
    return atlases, problems


def _lines(problems: list[tuple[Key, str]]) -> list[str]:
    unique = [
        (path, text) for path, text in dict.fromkeys(problems) if path[0] != "atlas"
    ]
    folding_problems = {
        (path[1:], text) for path, text in unique if path[0] == "folding"
    }
    return [
        line(path, text)
        for path, text in unique
        if path[0] != "runs" or (path[2:], text) not in folding_problems
    ]
