"""Base class of all settings. A key's docstring is its description; all problems are
reported together.

Pydantic checks single keys. `Settings.problems` checks keys against each other once
each is valid.
"""

import difflib
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, ClassVar, Self, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    ModelWrapValidatorHandler,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import (
    CoreSchema,
    ErrorDetails,
    InitErrorDetails,
    PydanticCustomError,
)
from pydantic_core.core_schema import tagged_union_schema

from ..errors import InputError
from ..formats import ALL_SUFFIXES

PROBLEM = "problem"
"""Type of the errors whose message already contains the value found."""


Key = tuple[str | int, ...]
"""The path of a key: names of keys, and numbers of entries in lists."""


@dataclass(frozen=True)
class KeyProblem:
    """A mistake and the path of its key, relative to the settings that are checked."""

    text: str
    key: Key = ()

    def inside(self, *outer: str | int) -> "KeyProblem":
        """Return the problem with the path of its key in outer settings."""
        return KeyProblem(self.text, (*outer, *self.key))

    def __str__(self) -> str:
        # such as `brains[0].week: Field required`
        parts = [
            f"[{part}]" if isinstance(part, int) else f".{part}" for part in self.key
        ]
        return f"{''.join(parts).removeprefix('.')}: {self.text}"


Problems = Iterator[KeyProblem]


@dataclass(frozen=True)
class FirstIf:
    """Mark a union of two types, the first of which is meant by values of some kinds
    and the second by all others.

    So a message is about one of them, not about both.
    """

    kinds: type | UnionType

    def __get_pydantic_core_schema__(
        self, union: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        first, second = map(handler.generate_schema, get_args(union))
        return tagged_union_schema(
            {"(first)": first, "(second)": second},
            lambda value: "(first)" if isinstance(value, self.kinds) else "(second)",
        )


def refused(text: str) -> PydanticCustomError:
    """Return an error for a validator of one key, with `text` as its complete
    message."""
    return PydanticCustomError(PROBLEM, text)


class Settings(BaseModel):
    """Frozen settings, validated as a whole. The value of the `short_key` alone, of its
    type, stands for a section."""

    short_key: ClassVar[tuple[str, type] | None] = None
    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        validate_default=True,
        use_attribute_docstrings=True,
        # an empty section, such as `mesh:`
        json_schema_extra={"type": ["object", "null"]},
    )

    @field_validator("*", mode="before")
    @classmethod
    def _reject_booleans_and_nul(cls, value: Any, info: ValidationInfo) -> Any:
        # YAML reads `on`, `yes` and the like as true, which would pass as 1.0
        kind = cls.model_fields[str(info.field_name)].annotation
        if isinstance(value, bool) and bool not in (kind, *get_args(kind)):
            raise ValueError(
                "should be a number or text, not true or false, as YAML also reads yes,"
                " no, on and off; write text in quotes"
            )
        # which ends a path or an argument for the system
        inner = [value]
        if isinstance(value, dict):
            inner = list(value.values())
        elif isinstance(value, list):
            inner = value
        for text in inner:
            if isinstance(text, str) and "\0" in text:
                raise ValueError("should have no NUL characters")
        return value

    @model_validator(mode="wrap")
    @classmethod
    def _report_all_problems(
        cls, raw: Any, handler: ModelWrapValidatorHandler[Self]
    ) -> Self:
        if cls.short_key and isinstance(raw, cls.short_key[1]):
            raw = {cls.short_key[0]: raw}
        settings = handler({} if raw is None else raw)
        if problems := dict.fromkeys(settings.problems()):
            errors = [
                InitErrorDetails(
                    type=refused(each.text),
                    loc=each.key,
                    input=None,
                )
                for each in problems
            ]
            raise ValidationError.from_exception_data(cls.__name__, errors)
        return settings

    def problems(self) -> Iterable[KeyProblem]:
        """Return the problems between keys that are each valid."""
        return ()

    def is_set(self, key: str) -> bool:
        """Return whether a key was given with a value other than null."""
        return key in self.model_fields_set and getattr(self, key) is not None


# messages: path of the key, allowed values, value found


def problems_in(error: ValidationError, kind: type[BaseModel]) -> list[KeyProblem]:
    """Return the problems of settings of a kind, in the order of the keys."""
    return [_problem(details, kind) for details in error.errors()]


def validated[Kind: BaseModel](
    kind: type[Kind],
    raw: Any,
    where: str,
) -> Kind:
    """Return settings of a kind from plain mappings; InputError naming `where` and all
    problems at once."""
    try:
        return kind.model_validate(raw)
    except ValidationError as error:
        problems = "; ".join(map(str, problems_in(error, kind)))
        raise InputError(f"{where}: {problems}") from None


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return a hint for an unknown name: the valid names that end with it, the most
    similar one, or all of them."""
    names = list(names)
    near = [longer for longer in names if longer.endswith(f"_{name}")]
    if not near:
        near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    if not near:
        return f"valid names are {', '.join(names)}"
    return f"did you mean {' or '.join(near)}?"


NUMBER_EXPECTED = "should be a number without a unit"
IN_WORDS = {
    **dict.fromkeys(("tuple_type", "list_type"), "should be a list, with - entries"),
    **dict.fromkeys(("dict_type", "model_type"), "should be keys with values"),
    **dict.fromkeys(("float_type", "float_parsing", "int_parsing"), NUMBER_EXPECTED),
    "string_type": "should be text",
}
"""What is expected, by pydantic's types of errors whose texts name types of Python."""
DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")


def _problem(details: ErrorDetails, kind: type[BaseModel]) -> KeyProblem:
    # pydantic puts tags into the path: of a union's member, here in parentheses, and
    # `[key]` for a wrong key
    path = tuple(
        part
        for part in details["loc"]
        if not str(part).startswith("(") and part != "[key]"
    )
    text = details["msg"].removeprefix("Value error, ")
    if details["type"] == "extra_forbidden":
        text = _unknown_key(kind, path)
    elif details["type"] not in (PROBLEM, "missing"):
        value = details["input"]
        # YAML reads 2026-11-29 as a date
        found = str(value) if isinstance(value, date) else repr(value)
        text = f"{IN_WORDS.get(details['type'], text)}; found {found}"
        if details["type"] == "string_type" and isinstance(value, int | float | date):
            text += "; write it in quotes"
        elif isinstance(value, str) and DECIMAL_COMMA.fullmatch(value):
            text += f"; write {value.replace(',', '.')}"
    return KeyProblem(text, path)


def _unknown_key(kind: type[BaseModel], path: Key) -> str:
    settings = _settings_at(kind, path[:-1])
    if settings is None:
        return "unknown key"
    return f"unknown key; {did_you_mean(str(path[-1]), settings.model_fields)}"


def _settings_at(kind: Any, path: Key) -> type[Settings] | None:
    """Return the class of the settings at `path` inside the type `kind`, or None if
    there are none."""
    if isinstance(kind, type) and issubclass(kind, Settings):
        if not path:
            return kind
        field = kind.model_fields.get(str(path[0]))
        return _settings_at(field.annotation, path[1:]) if field else None
    inner = path[1:] if get_origin(kind) in (dict, tuple) else path
    for part in get_args(kind):
        settings = _settings_at(part, inner)
        if settings is not None:
            return settings
    return None


# paths of input files

WILDCARD = re.compile(r"\{.*\}", re.DOTALL)
"""Part of a path that Snakemake takes for a wildcard; braces cannot be escaped."""


def path_in(folder: Path, path: str) -> Path:
    """Return the path of a file that is given relative to a folder or to a home folder
    (`~/scans/a.nii.gz`)."""
    try:
        return folder / Path(path).expanduser()
    except RuntimeError:  # no home folder of that name: `~` is part of the file name
        return folder / path


def located(folder: Path | str, path: str) -> Path:
    """Return the absolute path of a file in a folder or, if it only exists there, in
    the working directory."""
    in_folder = path_in(Path(folder), path)
    for place in (in_folder, Path.cwd() / path):
        if place.exists() or absent_content(place):
            return own_name(place)
    return own_name(in_folder)


def own_name(path: Path) -> Path:
    """Return an absolute path with folders resolved; a link to a file keeps its name,
    which has the format."""
    return path.resolve() if path.is_dir() else path.parent.resolve() / path.name


def folder_of(path: Path) -> Path:
    """Return the folder of a configuration: for a link, the folder of its target,
    unless git-annex stores that."""
    real = path.resolve()
    return (own_name(path) if "annex/objects" in real.as_posix() else real).parent


def absent_content(path: Path, start: bytes = b"") -> str:
    """Return how to get the content of a broken link of git-annex or of a pointer with
    this `start`, or ""."""
    if start.startswith(b"version https://git-lfs.github.com"):
        return (
            "its content is not here (Git LFS). Get it with"
            f" `git lfs pull --include {path}`"
        )
    is_broken = path.is_symlink() and not path.exists()
    is_of_annex = is_broken and "annex/objects" in path.readlink().as_posix()
    if is_of_annex or start.startswith(b"/annex/objects/"):
        return (
            "its content is not here (git-annex). Get it with"
            f" `datalad get {path}` or `git annex get {path}`"
        )
    return ""


def _absolute(path: str, info: ValidationInfo) -> str:
    """Return the absolute path of a file that must exist (a relative one if the working
    directory has braces).

    The validation context has the `folder` of the configuration, which is searched
    before the working directory, and `awaited` files, which may not exist yet. Without
    a context the path is returned unchanged.
    """
    if not info.context:
        return path
    folder = Path(info.context["folder"])
    try:
        place = located(folder, path)
        place.is_file()
    except PermissionError as error:
        raise refused(f"cannot be read: {error.filename}: permission denied") from error
    if absent := absent_content(place):
        raise refused(absent)
    if not place.is_file() and path not in info.context.get("awaited", ()):
        missing = path_in(folder, path)
        raise refused(f"no such file: {missing}{hint_for_missing(missing)}")
    if not WILDCARD.search(str(place)):
        return str(place)
    # a relative path avoids the braces of the working directory
    inside = os.path.relpath(place)
    if WILDCARD.search(inside) or not place.is_file():
        raise refused(
            f"found {place}; Snakemake takes braces in a path for wildcards: rename the"
            " file or its folder"
        )
    return inside


InputFile = Annotated[str, AfterValidator(_absolute)]
"""The path of an input file, relative to the configuration file or else to the working
directory."""


NO_PATH = (
    (
        re.compile(r"\$\w|\$\{|%\w+%"),
        "variables such as $HOME are not replaced; write the whole path, or ~/…",
    ),
    (
        re.compile(r"(?:^|/)[A-Za-z][A-Za-z0-9+.-]+:/"),
        "expected a path without file:// or another address",
    ),
    (re.compile(r"\\"), r"write / between folders, not \\"),
)
"""What paths of files do not have, and the hints about it."""
MAX_NAMES = 3
"""Most names of files in a hint."""


def not_a_path(text: str) -> str:
    """Return a hint if a text has what paths of files do not have, or ""."""
    for pattern, hint in NO_PATH:
        if pattern.search(text):
            return hint
    return ""


def hint_for_missing(path: Path) -> str:
    """Return a hint why there is no such file, or "": what its path is instead, or
    names like its in the folder."""
    if hint := not_a_path(str(path)):
        return f"; {hint}"
    try:
        if path.is_symlink() and not path.exists():
            if path.resolve().is_symlink():
                return f"; it is a link to {path.readlink()}, which leads back to it"
            return f"; it is a link to {path.readlink()}, which does not exist"
        if path.is_dir():
            content = _listed(" with", sorted(path.iterdir()))
            return f"; it is a folder{content}; expected a file"
        absent = [folder for folder in path.parents if not folder.exists()]
        if absent:
            return f"; there is no folder {absent[-1]}"
        return _listed("; there is", _named_alike(path))
    except OSError:
        return ""


def _named_alike(path: Path) -> list[Path]:
    """Return the files next to a missing one with its name, but for ending, case and
    spaces, or else for numbers."""
    files = sorted(path.parent.iterdir())
    stem = _stem(path.name)
    same = [file for file in files if _stem(file.name) == stem]
    if same:
        return same
    return [
        file
        for file in files
        if _without_numbers(_stem(file.name)) == _without_numbers(stem)
    ]


def _stem(name: str) -> str:
    name = name.strip().lower()
    endings = [ending for ending in ALL_SUFFIXES if name.endswith(ending)]
    longest = max(endings, key=len, default="")
    return name.removesuffix(longest)


def _without_numbers(stem: str) -> str:
    # such as the week
    return re.sub(r"\d+(\.\d+)?", "#", stem)


def _listed(words: str, files: Sequence[Path]) -> str:
    if not files:
        return ""
    names = []
    for file in files[:MAX_NAMES]:
        has_spaces = file.name != file.name.strip()
        names.append(repr(file.name) if has_spaces else file.name)
    if len(files) > MAX_NAMES:
        names.append("…")
    return f"{words} {', '.join(names)}"
