"""The description of all keys, made from the models."""

from collections.abc import Iterator
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from ..parameters.settings import Settings
from ..parameters.varying import Varying
from .atlas_description import Atlas
from .root import Config

INTRODUCTION = """\
# Configuration

`config.yaml` is the demo, with the commonest keys explained in place; this page has all of them; `examples/` has
configurations for real data. Your own is given with `./run snakemake --cores 2 --configfile my.yaml` and replaces the
demo as a whole. Single values can be changed on the command line: `--config 'folding={end_week: 26}'`.

All problems of a configuration are reported at once, before any job starts; unknown keys are problems. Paths are
relative to the configuration file or, if no such file is there, to the working directory. The keys of `folding` are
the base of every run; each entry of `runs` has a name, the brain or brains that it folds, and what differs from
`folding`:

```yaml
start: week21                                     # the id of a brain, a list of ids, or all
runs:
  reference: {}                                   # from the `start` above
  thick: {thickness_mm: 2.5}
  cohort: {start: [case1, case2], end_week: 32}   # each of them is folded
  stiff: {start: all, shear_modulus_cortex_pa: 3000, solver: {max_newton: 30}}
```

This page is made from the models in `src/gyriflow/parameters` and `src/gyriflow/config` by
`./run python -m gyriflow.config`.
"""

BOUNDS = {"gt": "> {}", "ge": "≥ {}", "lt": "< {}", "le": "≤ {}"}


def documentation() -> str:
    """Returns the page config/README.md."""
    sections = [_section(name, model) for name, model in _sections(Config, "")]
    described = [_section(name, model) for name, model in _sections(Atlas, "atlas.yaml")]
    return "\n".join([INTRODUCTION, *sections, _section("varying", Varying), *described])


def _sections(model: type[BaseModel], path: str) -> Iterator[tuple[str, type[BaseModel]]]:
    """Yields each model with the path of the key that holds it, the outer ones first."""
    yield path, model
    for name, field in model.model_fields.items():
        # runs have the keys of `folding`
        if name != "runs":
            for inner in (model for model in _models(field.annotation) if model is not Varying):
                yield from _sections(inner, f"{path}.{name}".lstrip(".") + ("[]" if _is_list(field) else ""))


def _section(path: str, model: type[BaseModel]) -> str:
    title = f"## `{path}`" if path else "## Sections"
    rows = [_row(name, field) for name, field in model.model_fields.items()]
    return "\n".join(
        [
            f"{title}\n",
            f"{_one_line(model.__doc__)}\n",
            "| key | type | unit | default | bounds | description |",
            "| --- | --- | --- | --- | --- | --- |",
            *rows,
            "",
        ]
    )


def _row(name: str, field: FieldInfo) -> str:
    extra = field.json_schema_extra
    unit = str(extra["unit"]) if isinstance(extra, dict) else ""
    word = f" or `{extra['word']}`" if isinstance(extra, dict) and "word" in extra else ""
    held: Any = extra.get("bounds", {}) if isinstance(extra, dict) else {}
    bounds = [text.format(_number(held[key])) for key, text in BOUNDS.items() if key in held] + [
        text.format(_number(getattr(bound, key)))
        for bound in field.metadata
        for key, text in BOUNDS.items()
        if getattr(bound, key, None) is not None
    ]
    cells = [
        f"`{name}`",
        _type_name(field.annotation) + word,
        unit,
        _default(field),
        ", ".join(bounds),
        field.description or "",
    ]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _default(field: FieldInfo) -> str:
    value = field.default
    if field.is_required() or value is PydanticUndefined:
        return "required"
    if isinstance(value, Settings):
        return "as below"
    if value is None:
        return "`null`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return "`[" + ", ".join(map(_number, value)) + "]`"
    return f"`{_number(value)}`"


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _type_name(annotation: Any) -> str:
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _type_name(parts[0])
    if origin is Literal:
        return " or ".join(f"`{part}`" for part in parts)
    if origin in (Union, UnionType):
        kinds = ["`null`" if part is type(None) else _type_name(part) for part in parts]
        return " or ".join(dict.fromkeys(kinds))
    if origin is tuple:
        return "list of " + _type_name(parts[0])
    if origin is dict:
        if get_origin(parts[1]) is tuple:
            return "names with lists"
        plain = parts[1] in (str, float, int) or get_origin(parts[1]) is Annotated
        return "names with values" if plain else "names with settings"
    if annotation is Varying:
        return "varying"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "section"
    if origin is not None:
        return _type_name(parts[0])
    names = {"float": "number", "int": "whole number", "str": "text", "bool": "`true` or `false`"}
    return names[annotation.__name__]


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]


def _is_list(field: FieldInfo) -> bool:
    return get_origin(field.annotation) is tuple


def _one_line(text: str | None) -> str:
    return " ".join((text or "").split())
