"""Validation of a configuration from plain dictionaries, with all problems reported
together."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..grouping import counted, grouped
from ..io.yaml_files import read_keys
from ..settings.atlas import Atlas, AtlasSettings
from ..settings.base import PROBLEM, Key, KeyProblem, problems_in
from ..settings.brains import ParticipantsSettings
from ..settings.root import Config
from .atlases import UsedAtlas, atlas_brains, atlas_problems
from .checks import problems_between
from .participants import participants_brains


def load(
    raw: Mapping[str, Any],
    base_dir: Path | str = ".",
    *,
    keep_going: bool = False,
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
    further: list[Any] = []
    for used in atlases:
        further += atlas_brains(used)
    further += entries
    if further:
        plain["brains"] = [*(plain.get("brains") or ()), *further]
    causes = [(scan, row["cause"]) for scan, row in left_out.items()]
    if keep_going and plain.get("brains"):
        causes = []
    awaited = []
    for used in atlases:
        awaited += [str(file.path) for file in used.files]
    context = {"folder": str(folder), "awaited": awaited}
    hints = ["config/README.md lists the descriptions of all keys"]
    try:
        config = Config.model_validate(plain, context=context)
    except ValidationError as error:
        problems += _lines(problems_in(error, Config))
        if any(details["type"] != PROBLEM for details in error.errors()):
            hints.append("once each key is valid, they are checked against each other")
    else:
        between = problems_between(config)
        if (problems or causes) and not plain.get("brains"):
            # the table of brains says why there are none
            between = [problem for problem in between if problem.key != ("brains",)]
        problems += _lines(between)
    if not problems and not causes:
        config.left_out.update(left_out)
        config.age_sources.update(sources)
        return config
    if left_out and not keep_going:
        hints.append("use --keep-going to leave out rows that cannot be used")
    count = len(problems) + len(causes)
    lines = [f"the configuration has {counted(count, 'problem')}:"]
    texts = [*(("", problem) for problem in problems), *causes]
    lines += [text for text, _ in grouped(texts)]
    raise InputError("\n  ".join(lines) + "\n" + "; ".join(hints))


def _participants(
    section: Any,
    folder: Path,
    problems: list[str],
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], dict[str, str]]:
    if section is None:
        return [], {}, {}
    # an invalid section is reported with all other keys
    with suppress(ValidationError):
        settings = ParticipantsSettings.model_validate(section)
        try:
            return participants_brains(settings, folder)
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
    if raw is None:
        return [], []
    places: dict[Key, Any] = {("atlas",): raw}
    if isinstance(raw, list):
        places = {("atlas", number): section for number, section in enumerate(raw)}
    atlases: list[UsedAtlas] = []
    problems: list[str] = []
    for place, section in places.items():
        used, wrong = _atlas(section, folder, place)
        atlases += used
        problems += wrong
    return atlases, problems


def _atlas(
    section: Any,
    folder: Path,
    place: Key,
) -> tuple[list[UsedAtlas], list[str]]:
    """Return the atlas of a section, or none and its problems."""
    try:
        settings = AtlasSettings.model_validate(section).located(folder)
    except ValidationError as error:
        problems = problems_in(error, AtlasSettings)
        return [], [str(problem.inside(*place)) for problem in problems]
    try:
        atlas = Atlas.model_validate(read_keys(settings.description))
    except InputError as error:
        return [], [str(KeyProblem(str(error), (*place, "name")))]
    except ValidationError as error:
        problems = problems_in(error, Atlas)
        return [], [f"{settings.description}: {problem}" for problem in problems]
    used = UsedAtlas(settings, atlas)
    problems = list(atlas_problems(used))
    if problems:
        return [], [str(problem.inside(*place)) for problem in problems]
    return [used], []


def _lines(problems: list[KeyProblem]) -> list[str]:
    """Return the lines of problems, each once; those of the atlas are reported
    already."""
    unique = dict.fromkeys(problems)
    lines = []
    for problem in unique:
        section, *inner = problem.key
        in_folding = KeyProblem(problem.text, ("folding", *inner[1:]))
        # runs repeat the problems of folding
        is_repeated = section == "runs" and in_folding in unique
        if section != "atlas" and not is_repeated:
            lines.append(str(problem))
    return lines
