"""From plain dictionaries to a validated configuration, with every problem named at once."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..parameters.folding import VARYING
from ..parameters.messages import line, messages
from .atlas import AtlasSettings, atlas_brains, atlas_files, atlas_problems
from .root import Config

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
    plain = {"folding": {}} | _plain(raw)
    plain["runs"] = _complete_runs(plain.get("runs"), plain.get("folding"))
    plain["atlas"], of_atlas, problems = _atlas(plain.get("atlas"), Path(base_dir), downloading=downloading)
    if of_atlas:
        plain["brains"] = [*(plain.get("brains") or ()), *of_atlas]
    awaited = [path for entry in of_atlas for path in _texts(entry)]
    try:
        config = Config.model_validate(plain, context={"folder": str(base_dir), "awaited": awaited})
    except ValidationError as error:
        problems += _lines(error)
    if problems:
        raise InputError(
            f"the configuration has {len(problems)} problem{'s' if len(problems) > 1 else ''}:\n  "
            + "\n  ".join(problems)
            + "\nAll keys are explained in config/README.md"
        )
    return config


def _plain(value: Any) -> Any:
    """Returns nested mappings and sequences as plain dictionaries and lists."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(item) for item in value]
    return value


def _complete_runs(runs: Any, folding: Any) -> Any:
    """Returns the runs, each with the keys of `folding` that it does not name itself."""
    runs = runs or REFERENCE_RUNS
    if not isinstance(runs, dict):
        return runs
    base = folding if isinstance(folding, dict) else {}
    return {
        name: _merged(base, override or {}) if isinstance(override, dict | None) else override
        for name, override in runs.items()
    }


def _merged(base: dict[str, Any], override: dict[str, Any]) -> dict[str, Any]:
    both = dict(base)
    for key, value in override.items():
        nested = isinstance(value, dict) and isinstance(base.get(key), dict) and key not in VARYING
        both[key] = _merged(base[key], value) if nested else value
    return both


def _atlas(raw: Any, base_dir: Path, *, downloading: bool) -> tuple[Any, list[dict[str, Any]], list[str]]:
    """Returns the atlas section with its folder as an absolute path, the brains that it stands for, and problems."""
    try:
        atlas = None if raw is None else AtlasSettings.model_validate(raw)
    except ValidationError:
        return raw, [], []
    if atlas is None:
        return None, [], []
    places = [base_dir / Path(atlas.folder).expanduser(), Path.cwd() / atlas.folder]
    folder = next((place for place in places if place.exists()), places[0])
    atlas = atlas.model_copy(update={"folder": str(folder.resolve())})
    files = atlas_files(atlas)
    return atlas, atlas_brains(files), atlas_problems(atlas, files, downloading=downloading)


def _texts(value: Any) -> list[str]:
    """Returns all texts in an entry of `brains`, files among them."""
    if isinstance(value, dict):
        return [text for item in value.values() for text in _texts(item)]
    return [value] if isinstance(value, str) else []


def _lines(error: ValidationError) -> list[str]:
    """Returns the problems as lines; what a run has from `folding` is said there only."""
    found = dict.fromkeys(messages(error, Config))
    of_folding = {(path[1:], text) for path, text in found if path[0] == "folding"}
    return [line(path, text) for path, text in found if path[0] != "runs" or (path[2:], text) not in of_folding]
