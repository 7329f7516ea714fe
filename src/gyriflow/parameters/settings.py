"""The base of all settings: each key has its unit, bounds and description, and all problems are reported at once.

Pydantic checks single keys. A check across keys is a method with the decorator `check` that yields a `Problem` for each
mistake. Checks run even if some keys are invalid: the settings then hold only the valid keys, and a check stops at the
first key that is missing.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self, get_args, get_origin

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

PROBLEM = "problem"
"""Type of the errors whose message is complete as it is."""
_NOTHING = object()


class NotValidError(AttributeError):
    """A check asks for a key that is missing or invalid."""


@dataclass(frozen=True)
class Problem:
    """A mistake, and the path of its key below the settings that are checked."""

    text: str
    key: tuple[str | int, ...] = ()


def check[Check: Callable[[Any], Iterator[Problem]]](method: Check) -> Check:
    """Marks a method of settings that yields problems as a check across their keys."""
    method.is_check = True  # type: ignore[attr-defined]
    return method


def refused(text: str) -> PydanticCustomError:
    """Returns the error that a validator of one key raises so that `text` becomes its whole message."""
    return PydanticCustomError(PROBLEM, text)


def up_to_invalid(problems: Iterable[Problem]) -> Iterator[Problem]:
    """Yields problems until one needs a key that is missing or invalid."""
    with suppress(NotValidError):
        yield from problems


class Settings(BaseModel):
    """Settings that are validated as a whole and cannot change afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)
    checks: ClassVar[tuple[Callable[[Any], Iterator[Problem]], ...]] = ()

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        known = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
        cls.checks = tuple(value for value in known.values() if getattr(value, "is_check", False))

    @field_validator("*", mode="before")
    @classmethod
    def _refuse_truth_values_as_numbers(cls, value: Any, info: ValidationInfo) -> Any:
        # YAML reads `on`, `yes` and the like as true, which would pass as 1.0
        if isinstance(value, bool) and cls.model_fields[str(info.field_name)].annotation is not bool:
            raise ValueError("Input should be a number or text, not true or false")
        return value

    @field_validator("*", mode="before")
    @classmethod
    def _refuse_texts_with_nul(cls, value: Any) -> Any:
        # which ends a path or an argument for the system
        inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else [value]
        if any(isinstance(text, str) and "\0" in text for text in inner):
            raise ValueError("Text should have no NUL characters")
        return value

    @model_validator(mode="wrap")
    @classmethod
    def _report_all_problems(cls, raw: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo) -> Self:
        # an empty section, such as `mesh:`
        raw = {} if raw is None else raw
        errors: list[InitErrorDetails] = []
        try:
            settings = handler(raw)
        except ValidationError as error:
            if not isinstance(raw, Mapping):
                raise
            errors = [_again(details) for details in error.errors()]
            settings = cls._valid_part(raw, {str(details["loc"][0]) for details in errors}, info.context)
        found = [problem for check in cls.checks for problem in up_to_invalid(check(settings))]
        errors += [InitErrorDetails(type=refused(p.text), loc=p.key, input=None) for p in dict.fromkeys(found)]
        if errors:
            raise ValidationError.from_exception_data(cls.__name__, errors)
        return settings

    @classmethod
    def _valid_part(cls, raw: Mapping[str, Any], wrong: set[str], context: Any) -> Self:
        """Returns settings with the valid keys of `raw` and the defaults, without the keys in `wrong`."""
        values = {}
        for name in raw.keys() & cls.model_fields.keys():
            value = valid_part(cls.model_fields[name].rebuild_annotation(), raw[name], context, whole=name not in wrong)
            if value is not _NOTHING:
                values[name] = value
        settings = cls.model_construct(_fields_set=set(raw) & set(cls.model_fields), **values)
        for name in raw.keys() - values.keys():
            settings.__dict__.pop(name, None)
        return settings

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name in type(self).model_fields:
                raise NotValidError(name)
            return super().__getattr__(name)

    def has(self, *keys: str) -> bool:
        """Returns whether the values of all these keys are valid."""
        return all(hasattr(self, key) for key in keys)

    def gives(self, key: str) -> bool:
        """Returns whether a key was given with a value other than null, valid or not."""
        return key in self.model_fields_set and self.__dict__.get(key, _NOTHING) is not None


def setting(default: Any, unit: str, description: str, *, word: str | None = None, **bounds: Any) -> Any:
    """Returns a pydantic field with its unit; `default` is ... if the user has to give the value.

    `word` is accepted in place of a number. `bounds` are those of pydantic: gt, ge, lt, le, min_length, max_length,
    pattern.
    """
    extra: dict[str, Any] = {"unit": unit} if word is None else {"unit": unit, "word": word}
    return Field(default, description=description, json_schema_extra=extra, **bounds)


def valid_part(kind: Any, raw: Any, context: Any, *, whole: bool) -> Any:
    """Returns the valid part of a value of the type `kind`, for settings and for lists and tables of settings."""
    if whole:
        try:
            return TypeAdapter(kind).validate_python(raw, context=context)
        except ValidationError:  # of a value that a validator of its field makes valid
            return _NOTHING
    arguments = get_args(kind)
    if isinstance(kind, type) and issubclass(kind, Settings):
        given = raw if isinstance(raw, Mapping) else {}
        try:
            return kind.model_validate(raw, context=context)
        except ValidationError as error:
            wrong = {str(part) for details in error.errors() for part in details["loc"][:1]}
            return kind._valid_part(given, wrong, context)
    if get_origin(kind) is tuple and arguments[1:] == (...,) and isinstance(raw, list | tuple):
        parts = [valid_part(arguments[0], item, context, whole=False) for item in raw]
        return _NOTHING if _NOTHING in parts else tuple(parts)
    if get_origin(kind) is dict and isinstance(raw, Mapping):
        table = {key: valid_part(arguments[1], item, context, whole=False) for key, item in raw.items()}
        return _NOTHING if _NOTHING in table.values() else table
    return _NOTHING


def _again(details: Any) -> InitErrorDetails:
    """Converts an error that pydantic has reported into a form that can be raised again."""
    kind = refused(details["msg"]) if details["type"] == PROBLEM else details["type"]
    return InitErrorDetails(type=kind, loc=details["loc"], input=details["input"], ctx=details.get("ctx", {}))
