"""YAML files: configurations, read strictly, the parameters of a run, and the label
schemes of the folder `schemes`."""

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from ..errors import InputError
from ..settings.base import validated
from ..settings.schemes import SCHEME_FILES, LabelScheme, SchemeSettings
from .files import AnyPath, require_content, write_text

MAX_VALUES = 1_000_000
"""How many values a file may have, so that a few lines of nested aliases don't fill the
memory."""
MAX_DEPTH = 100
"""How deeply values may be nested: libyaml recurses, and ends the process where memory
for it runs out."""


# libyaml is ten times as fast, and PyYAML's wheels have it
class _StrictLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Loader that refuses duplicate keys, since YAML would silently keep the last
    one."""


def _size(value: Any, sizes: dict[int, int]) -> int:
    if id(value) not in sizes:
        inner = (
            value.values()
            if isinstance(value, dict)
            else value
            if isinstance(value, list)
            else ()
        )
        sizes[id(value)] = 1 + sum(_size(item, sizes) for item in inner)
    return sizes[id(value)]


def _has_valid_depth(text: str) -> bool:
    depth = 0
    for event in yaml.parse(text, Loader=_StrictLoader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > MAX_DEPTH:
            return False
    return True


def _mapping(loader: _StrictLoader, node: yaml.MappingNode) -> dict:
    first: dict[str, int] = {}
    equal: dict[Any, str] = {}
    for key, _ in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode):
            raise yaml.constructor.ConstructorError(
                None, None, "keys must be scalars", key.start_mark
            )
        kind = key.tag.rpartition(":")[2]
        if kind in ("bool", "null") or (
            kind == "int" and not re.fullmatch(r"-?(0|[1-9]\d*)", key.value)
        ):
            raise yaml.constructor.ConstructorError(
                None,
                None,
                f"the key {key.value} is another value to YAML; write it in quotes",
                key.start_mark,
            )
        if key.value in first and key.tag != "tag:yaml.org,2002:merge":
            raise yaml.constructor.ConstructorError(
                None,
                None,
                f"duplicate key {key.value!r} (first on line {first[key.value]})",
                key.start_mark,
            )
        first[str(key.value)] = line
        # 1 and 1.0 are one key of a dictionary
        value = key.value if kind == "merge" else loader.construct_object(key)
        other = equal.setdefault(value, key.value)
        if other != key.value:
            raise yaml.constructor.ConstructorError(
                None,
                None,
                f"the keys {other} and {key.value} are one number to YAML; write"
                " them in quotes if they are names",
                key.start_mark,
            )
    loader.flatten_mapping(node)
    return loader.construct_mapping(node, deep=True)


def _number(loader: _StrictLoader, node: yaml.ScalarNode) -> int | float:
    """Return a number as it is written; YAML would read 023 as 19, and 23:4 as 1384."""
    kind = node.tag.rpartition(":")[2]
    read = (
        loader.construct_yaml_int if kind == "int" else loader.construct_yaml_float
    )(node)
    if ":" in node.value or re.match(r"[-+]?0[0-7_]+$", node.value):
        raise yaml.constructor.ConstructorError(
            None,
            None,
            f"{node.value} is {read:g} to YAML; write a decimal number without"
            " zeros before it, or text in quotes",
            node.start_mark,
        )
    return read


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)
for _kind in ("int", "float"):
    _StrictLoader.add_constructor(f"tag:yaml.org,2002:{_kind}", _number)


def read_yaml(path: AnyPath) -> Any:
    """Return the content of a YAML (or JSON) file; InputError where it is missing,
    malformed or names a key twice."""
    require_content(path)
    try:
        text = Path(path).read_text(encoding="utf-8")
        if not _has_valid_depth(text):
            raise InputError(
                "is nested too deeply", path=path, expected="a configuration"
            )
        content = yaml.load(text, Loader=_StrictLoader)  # noqa: S506
        size = _size(content, {})
    except OSError as error:
        raise InputError("cannot be read", path=path, found=error) from error
    except UnicodeDecodeError as error:
        raise InputError(
            "is not text in UTF-8",
            path=path,
            found=f"byte {error.object[error.start]:#x} at {error.start}",
            remedy="Save it as UTF-8 in an editor.",
        ) from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error)
        remedy = _remedy(text.splitlines(), mark.line) if mark else ""
        raise InputError(
            f"is not valid YAML{line}: {problem}", path=path, remedy=remedy or None
        ) from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        # words that look like a date or a number and are none, such as 2001-99-99 or 0b
        raise InputError(
            f"has a value that YAML cannot read: {error}",
            path=path,
            remedy="Put texts in quotes.",
        ) from error
    if size > MAX_VALUES:
        raise InputError(
            "has too many values, aliases written out",
            path=path,
            found=size,
            expected=MAX_VALUES,
        )
    return content


INVISIBLE = re.compile(r"[\t\u00a0\u200b-\u200d\u2028\ufeff]")
"""Tabs and other spaces that cannot be seen, as texts from other programs have them."""


def _remedy(lines: Sequence[str], number: int) -> str:
    """Return what to do if a line with a mistake, or the one before it, has characters
    that YAML does not take for spaces."""
    for line in lines[max(number - 1, 0) : number + 1]:
        if found := INVISIBLE.search(line):
            name = unicodedata.name(found[0], "TAB")
            return f"Write spaces instead of {name} in: {line.strip()}"
    return ""


def read_keys(path: AnyPath) -> dict[str, Any]:
    """Return the keys of a YAML (or JSON) file with their values; InputError where it
    has none."""
    content = read_yaml(path)
    if not isinstance(content, dict):
        kind = (
            "nothing"
            if content is None
            else "a list"
            if isinstance(content, list)
            else repr(content)
        )
        raise InputError(
            "is not a mapping",
            path=path,
            found=kind,
            expected="keys with values, such as `week: 21`",
        )
    return content


def write_yaml(path: AnyPath, content: Any) -> None:
    """Write plain dictionaries, lists and numbers, keys in their order."""
    write_text(
        path,
        yaml.safe_dump(
            content,
            sort_keys=False,
            allow_unicode=True,
        ),
    )


class Schemes(Mapping[str, LabelScheme]):
    """The schemes by name, each read on first use; InputError if a file is not a
    scheme."""

    def __init__(self) -> None:
        self._known: dict[str, LabelScheme] = {}

    def __getitem__(self, name: str) -> LabelScheme:
        if name not in self._known:
            path = SCHEME_FILES[name]
            settings = validated(SchemeSettings, read_keys(path), str(path))
            self._known[name] = LabelScheme(
                name=name,
                **settings.model_dump(),
            )
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(SCHEME_FILES)

    def __len__(self) -> int:
        return len(SCHEME_FILES)


SCHEMES = Schemes()
"""A further scheme is a further file."""
