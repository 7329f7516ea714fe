"""The page and the JSON schema of all keys, made from the models."""

from collections.abc import Iterator
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ..parameters.settings import Settings
from ..parameters.varying import Varying
from .atlas import Atlas
from .root import Config

INTRODUCTION = """\
# Configuration

`config.yaml` is the demo, with the commonest keys explained in place; `examples/` has configurations for real data.
`./run snakemake --cores 2 --configfile my.yaml` takes yours instead of the demo; `--config 'folding={end_week: 26}'`
changes single values. All problems are reported before any job starts: first those of keys, then those between keys.
Unknown keys are problems. Paths are relative to the configuration file or else to the working directory.

Each entry of `runs` has a name, the brains that it folds, and what differs from `folding`:

```yaml
start: week21                                     # the id of a brain, a list of ids, or all
runs:
  reference: {}                                   # from the `start` above
  cohort: {start: [case1, case2], end_week: 32}   # each of them is folded
  stiff: {start: all, shear_modulus_cortex_pa: 3000, solver: {max_newton: 30}}
```

Below stand all keys: `key = default`, what else it may be, unit, and range; `(0, 5]` is above 0 and at most 5. Without
a default it is `null`. Editors check keys by `schema.json`; `./run python -m gyriflow.config`
writes both.
"""
BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}
PLAIN = ("number", "whole number", "text", "table", "`true` or `false`")
NAMES = {float: "number", int: "whole number", str: "text", bool: "`true` or `false`", Varying: "`varying`"}


def documentation() -> str:
    """Returns the page config/README.md."""
    sections: dict[type[BaseModel], str] = {}
    for path, model in [*_sections(Config, ""), *_sections(Varying, "varying"), *_sections(Atlas, "atlas.yaml")]:
        # what has the keys of another section is described there
        sections.setdefault(model, path)
    return "\n".join([INTRODUCTION, *(_section(path, model) for model, path in sections.items())])


def _sections(model: type[BaseModel], path: str) -> Iterator[tuple[str, type[BaseModel]]]:
    """Yields each model with the path of the key that holds it, the outer ones first."""
    yield path, model
    for name, field in model.model_fields.items():
        # runs have the keys of `folding`
        if name != "runs":
            several = "[]" if get_origin(field.annotation) is tuple else ""
            for inner in (model for model in _models(field.annotation) if model is not Varying):
                yield from _sections(inner, f"{path}.{name}".lstrip(".") + several)


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]


def _section(path: str, model: type[BaseModel]) -> str:
    title = f"## `{path}`" if path else "## Sections"
    text = " ".join((model.__doc__ or "").split())
    return "\n".join([f"{title}\n\n{text}\n", *(_line(*item) for item in model.model_fields.items()), ""])


def _line(name: str, field: FieldInfo) -> str:
    """Returns a key with its default or that it is required, what else it may be, unit, range and meaning."""
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    held: Any = extra.get("bounds", {})
    default, kinds = _default(field), list(dict.fromkeys(_type_names(field.annotation)))
    kinds += [f"`{extra['word']}`"] if "word" in extra else []
    # words that are explained need no list, and of which kind a default is shows by itself
    kinds = [kind for kind in kinds if not (kind.startswith("`") and kind in str(field.description))]
    if default:
        kinds = [kind for kind in kinds if kind != default and kind not in PLAIN and not kind.startswith("list")]
    given = " or ".join(part for part in (default, ", ".join(kinds)) if part)
    value = (
        f" = {given}" if default else "".join(f", {part}" for part in ("required" * field.is_required(), given) if part)
    )
    limits = _range({key: bound for part in _metadata(field) for key, bound in _bounds_in(part).items()} | held)
    return (
        " ".join(part for part in (f"- `{name}`{value}", str(extra["unit"]), limits) if part) + f": {field.description}"
    )


def _metadata(field: FieldInfo) -> list[Any]:
    """Returns what bounds a value, or each of a list."""

    def of(annotation: Any) -> list[Any]:
        inner = [] if get_origin(annotation) is dict else get_args(annotation)
        own = [part for found in getattr(annotation, "__metadata__", ()) for part in getattr(found, "metadata", ())]
        return [*own, *(part for other in inner for part in of(other))]

    return [*of(field.annotation), *field.metadata]


def _bounds_in(metadata: object) -> dict[str, Any]:
    return {key: getattr(metadata, key) for key in BOUNDS if getattr(metadata, key, None) is not None}


def _range(bounds: dict[str, Any]) -> str:
    low = next((_number(bounds[key]) for key in ("gt", "ge") if key in bounds), None)
    high = next((_number(bounds[key]) for key in ("lt", "le") if key in bounds), None)
    if low is not None and high is not None:
        return f"{'(' if 'gt' in bounds else '['}{low}, {high}{')' if 'lt' in bounds else ']'}"
    return f"{'>' if 'gt' in bounds else '≥'} {low}" if low is not None else ""


def _default(field: FieldInfo) -> str:
    """Returns the default as it is written; empty for required keys, for null, and for sections."""
    value = field.default
    if field.is_required() or value is None or isinstance(value, Settings):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return "`[" + ", ".join(map(_number, value)) + "]`" if isinstance(value, tuple) else f"`{_number(value)}`"


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _type_names(annotation: Any) -> list[str]:
    """Returns what values of a type are called, without null, which is then the default."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return [f"`{part}`" for part in parts]
    if origin in (Union, UnionType):
        return [name for part in parts if part is not type(None) for name in _type_names(part)]
    if origin is tuple:
        return [f"list of {_type_names(parts[0])[0]}s".replace("texts", "text")]
    if origin is dict:
        return ["table"]
    if origin is Annotated:
        return _type_names(parts[0])
    return [NAMES.get(annotation, "section")]


# the schema

NULL = {"type": "null"}


def schema() -> dict[str, Any]:
    """Returns the JSON schema of a configuration as it is written, for editors: config/schema.json."""
    found = _for_editors(Config.model_json_schema())
    # runs need only what differs from `folding`
    found["$defs"]["Run"].pop("required")
    keys = found["properties"]
    # short forms, for a section with one key
    either = {"anyOf": [{"type": "string"}, {"$ref": "#/$defs/AtlasSettings"}]}
    keys["atlas"] = {"anyOf": [*either["anyOf"], keys["atlas"] | {"items": either}]}
    keys["participants"] = {"anyOf": [{"type": "string"}, keys["participants"]]}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | found


def _for_editors(node: Any) -> Any:
    """Returns a part of pydantic's schema with units in the descriptions and all bounds; sections may be empty."""
    if isinstance(node, list):
        return [_for_editors(item) for item in node]
    if not isinstance(node, dict):
        return node
    own = {key: value for key, value in node.items() if key not in ("unit", "bounds", "word")}
    if isinstance(own.get("title"), str):
        del own["title"]
    if node.get("unit"):
        own["description"] += f" [{node['unit']}]"
    if "bounds" in node:
        limits = {BOUNDS[key]: value for key, value in node["bounds"].items()}
        own["oneOf"] = [kind | limits if kind.get("type") == "number" else kind for kind in own["oneOf"]]
    if "word" in node:
        own["anyOf"] = [{"type": own.pop("type")}, {"const": node["word"]}]
    if "$ref" in own and "description" in own:
        own = {"anyOf": [{"$ref": own["$ref"]}, NULL], "description": own["description"]}
    if "$ref" in (inner := own.get("additionalProperties") or {}):
        own["additionalProperties"] = {"anyOf": [inner, NULL]}
    return {key: _for_editors(value) for key, value in own.items()}
