"""The origin of a file that studies share: a description that names files, and a key of
it with their contents."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .files import contents


def origin_key(origin: Any, contents_by_path: Mapping[str, str]) -> str | None:
    """Return a hash of nested lists and mappings, with contents in place of the
    absolute paths of files.

    `contents_by_path` are those of `joined_contents`. None if that of a file is
    unknown.
    """
    try:
        described = _with_contents(origin, contents_by_path)
    except KeyError:
        return None
    text = json.dumps(described, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def present_key(origin: Any) -> str | None:
    """Return the key of an origin with the contents that its files have now; None if
    one cannot be read."""
    return origin_key(
        origin,
        joined_contents(contents(_paths_in(origin), {})),
    )


def joined_contents(found: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of each file of `io.files.contents`, followed by those of its
    companions, by path."""
    joined = {}
    for path, facts in found.items():
        group = dict.fromkeys([path, *facts[-1]])
        joined[path] = " ".join(found[member][0] for member in group if member in found)
    return joined


def _with_contents(value: Any, contents_by_path: Mapping[str, str]) -> Any:
    if isinstance(value, dict):
        return {
            key: _with_contents(item, contents_by_path) for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [_with_contents(item, contents_by_path) for item in value]
    return contents_by_path[value] if _is_path(value) else value


def _paths_in(value: Any) -> list[str]:
    if isinstance(value, dict):
        return _paths_in([*value.values()])
    if isinstance(value, list | tuple):
        paths = []
        for item in value:
            paths += _paths_in(item)
        return paths
    return [value] if _is_path(value) else []


def _is_path(value: Any) -> bool:
    return isinstance(value, str) and Path(value).is_absolute()
