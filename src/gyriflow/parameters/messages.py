"""Messages about invalid settings: the full path of each key, what was found, what is allowed."""

import difflib
from collections.abc import Iterable
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from .settings import PROBLEM

Path = tuple[str | int, ...]


def messages(error: ValidationError, kind: type[BaseModel]) -> list[tuple[Path, str]]:
    """Returns the path and the text of each problem of settings of a kind, in the order of the keys."""
    return [_message(details, kind) for details in error.errors()]


def line(path: Path, text: str) -> str:
    """Returns a problem as a line, such as `brains[0].week: found 20; it should be 21 or more`."""
    return f"{dotted(path)}: {text}"


def dotted(path: Path) -> str:
    """Returns the path of a key as it is written, such as `brains[0].week`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


def nearest(name: str, known: Iterable[str]) -> str:
    """Returns a hint for an unknown name: the most similar known name, or all of them."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"


def _message(details: ErrorDetails, kind: type[BaseModel]) -> tuple[Path, str]:
    # pydantic puts the tag of a union's member, here in parentheses, into the path
    path = tuple(part for part in details["loc"] if not str(part).startswith("("))
    match details["type"]:
        case t if t == PROBLEM:
            return path, details["msg"]
        case "extra_forbidden":
            return path, f"unknown key; {nearest(str(path[-1]), keys_at(kind, path[:-1]))}"
        case "missing":
            return path, "is missing"
        case "model_type":
            return path, f"found {details['input']!r}; it should hold keys and values"
    expected = details["msg"].removeprefix("Value error, ").removeprefix("Input should ")
    return path, f"found {details['input']!r}; it should {expected}"


def keys_at(kind: Any, path: Path) -> list[str]:
    """Returns the keys of the settings at `path` inside the type `kind`."""
    origin, arguments = get_origin(kind), get_args(kind)
    if path and origin in (dict, tuple):
        return keys_at(arguments[1 if origin is dict else 0], path[1:])
    models = _models(kind)
    if not models:
        return []
    if not path:
        return list(models[0].model_fields)
    field = models[0].model_fields.get(str(path[0]))
    return keys_at(field.annotation, path[1:]) if field is not None else []


def _models(kind: Any) -> list[type[BaseModel]]:
    if get_origin(kind) in (Union, UnionType, Annotated):
        return [model for part in get_args(kind) for model in _models(part)]
    return [kind] if isinstance(kind, type) and issubclass(kind, BaseModel) else []
