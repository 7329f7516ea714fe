"""`./run python docs/reference.py` writes keys.md and api.md, from the models of the
configuration and the docstrings of public functions."""

import inspect
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from gyriflow.geometry.triangles import TriangleMesh, area, convex_hull
from gyriflow.growth.rates import growth_rates
from gyriflow.io.frames import read_field, read_positions, read_tets, read_weeks
from gyriflow.io.surfaces import read_surface, read_vertex_maps, write_surface
from gyriflow.io.tetmeshes import (
    Regions,
    read_maps,
    read_regions,
    read_tetrahedral_mesh,
)
from gyriflow.io.volumes import read_label_volume
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.gyrification import gyrification_index, sulcal_depth
from gyriflow.metrics.measure import measure_brain
from gyriflow.settings.atlas import (
    Atlas,
    AtlasLicence,
    AtlasSeries,
    AtlasSettings,
)
from gyriflow.settings.brains import (
    BrainConfig,
    GivenRegions,
    HemisphereFiles,
    ParticipantsSettings,
    ShapeSettings,
)
from gyriflow.settings.folding import FoldingSettings
from gyriflow.settings.growth import Growth
from gyriflow.settings.runs import (
    CalibrationSettings,
    ComparisonSettings,
    GrowthSettings,
    SweepSettings,
)
from gyriflow.settings.schemes import SchemeSettings
from gyriflow.settings.stages import MeshSettings, MetricsSettings, SurfaceSettings
from gyriflow.settings.varying import Varying
from gyriflow.study.loading import load

DOCS = Path(__file__).parent
BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "at least",
    "exclusiveMaximum": "below",
    "maximum": "at most",
}
TYPES = {
    "number": "number",
    "integer": "whole number",
    "boolean": "true or false",
    "string": "text",
    "object": "section",
}
SECTIONS = {
    "Brains": {
        "brains: (a list)": BrainConfig,
        "hemispheres: of a brain": HemisphereFiles,
        "shape: of a brain": ShapeSettings,
        "participants:": ParticipantsSettings,
        "schemes: by name": SchemeSettings,
    },
    "Atlases": {
        "atlas: (one, or a list)": AtlasSettings,
        "The file atlas.yaml": Atlas,
        "series: by name, in atlas.yaml": AtlasSeries,
        "licence: in atlas.yaml": AtlasLicence,
    },
    "Surfaces and meshes": {"surface:": SurfaceSettings, "mesh:": MeshSettings},
    "Growth and folding": {
        "growth:": GrowthSettings,
        "folding:, and each of runs:": FoldingSettings,
        "growth: in folding:": Growth,
        "A parameter that varies": Varying,
    },
    "Sweeps and calibration": {
        "Both have": ComparisonSettings,
        "sweeps: by name": SweepSettings,
        "calibrate:": CalibrationSettings,
    },
    "Metrics": {"metrics:": MetricsSettings, "regions: by brain": GivenRegions},
}
FUNCTIONS: dict[str, list[Callable[..., Any]]] = {
    "Files": [
        read_surface,
        read_vertex_maps,
        write_surface,
        read_label_volume,
        read_tetrahedral_mesh,
        TriangleMesh,
    ],
    "Results of a simulation": [
        read_weeks,
        read_positions,
        read_field,
        read_tets,
        read_regions,
        Regions,
        read_maps,
    ],
    "Metrics": [
        measure_brain,
        curvature,
        area,
        convex_hull,
        gyrification_index,
        sulcal_depth,
    ],
    "Meshes and growth": [tetrahedralise, growth_rates],
    "Configurations": [load],
}


def type_text(schema: dict[str, Any]) -> str:
    """Return the kinds of values that a key takes, with their bounds."""
    kinds = schema.get("anyOf") or schema.get("oneOf") or [schema]
    texts = []
    for kind in kinds:
        kind = kind | {name: schema[name] for name in BOUNDS if name in schema}
        text = _kind_text(kind)
        if text and text not in texts:
            texts.append(text)
    return " or ".join(texts)


def _kind_text(kind: dict[str, Any]) -> str:
    """Return one kind of values; '' for none."""
    if "$ref" in kind:
        return "section"
    if kind.get("format") == "age":
        return "an age such as `24+2`"
    values = kind.get("enum") or ([kind["const"]] if "const" in kind else [])
    if values:
        return ", ".join(f"`{value}`" for value in values)
    if kind.get("type") == "array":
        items = kind.get("items")
        inside = type_text(items) if isinstance(items, dict) else ""
        return f"list of {inside}" if inside else "list"
    name = TYPES.get(kind.get("type", ""), "")
    if name in ("number", "whole number"):
        limits = [
            f"{words} {kind[key]:g}" for key, words in BOUNDS.items() if key in kind
        ]
        return ", ".join([name, *limits])
    return name


def keys_of(title: str, model: type[BaseModel]) -> Iterable[str]:
    """Yield the lines of a section: a table of its keys."""
    schema = model.model_json_schema()
    yield f"### {title}"
    yield ""
    yield one_line(inspect.getdoc(model) or "")
    yield ""
    yield "| key | values | default | meaning |"
    yield "| --- | --- | --- | --- |"
    required = schema.get("required", [])
    for key, field in schema["properties"].items():
        default = "required" if key in required else default_text(field.get("default"))
        meaning = one_line(field.get("description", ""))
        yield f"| `{key}` | {type_text(field)} | {default} | {meaning} |"
    yield ""


def default_text(value: Any) -> str:
    """Return a default as it stands in YAML; nothing for none."""
    if value is None:
        return ""
    if isinstance(value, dict | list) and not value:
        return ""
    return f"`{json.dumps(value, ensure_ascii=False)}`".replace('"', "")


def one_line(text: str) -> str:
    """Return a text on one line, fit for a cell."""
    return " ".join(text.split()).replace("|", "\\|")


def keys_page() -> str:
    lines = [
        "# Keys of a configuration",
        "",
        "All keys by section, with values, bounds, default, meaning and [unit].",
        "How to write one: [config/README.md](../config/README.md).",
        "This page is made by `./run python docs/reference.py`.",
        "",
    ]
    for heading, models in SECTIONS.items():
        lines += [f"## {heading}", ""]
        for title, model in models.items():
            lines += keys_of(title, model)
    return "\n".join(lines)


def functions_page() -> str:
    lines = [
        "# Functions",
        "",
        "Functions to call from your own scripts, without the workflow; [an example]"
        "(how-to/python.md). Lengths are in mm and coordinates RAS+, unless stated",
        "otherwise. This page is made by `./run python docs/reference.py`.",
        "",
    ]
    for heading, functions in FUNCTIONS.items():
        lines += [f"## {heading}", ""]
        for function in functions:
            lines += function_lines(function)
    return "\n".join(lines)


def function_lines(function: Callable[..., Any]) -> Iterable[str]:
    """Yield a function with its signature and docstring."""
    place = f"{function.__module__}.{function.__qualname__}"
    yield f"### {function.__name__}"
    yield ""
    yield "```python"
    yield f"from {function.__module__} import {function.__qualname__}"
    yield ""
    yield f"{function.__qualname__}{signature_text(function)}"
    yield "```"
    yield ""
    docstring = inspect.getdoc(function)
    if not docstring:
        raise ValueError(f"{place} has no docstring")
    yield docstring
    yield ""


def signature_text(function: Callable[..., Any]) -> str:
    """Return a signature, a line for each argument if it is long."""
    signature = inspect.signature(function)
    text = str(signature).replace("gyriflow.geometry.triangles.", "")
    if len(function.__name__) + len(text) <= 80:
        return text
    lines = ["("]
    was_keyword = False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not was_keyword:
            lines.append("    *,")
            was_keyword = True
        lines.append(f"    {parameter},")
    lines.append(f") -> {inspect.formatannotation(signature.return_annotation)}")
    return "\n".join(lines).replace("gyriflow.geometry.triangles.", "")


PAGES = {"keys.md": keys_page, "api.md": functions_page}

if __name__ == "__main__":
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), encoding="utf-8")
