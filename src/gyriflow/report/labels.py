"""Titles of metrics, maps, parameters, weeks and columns in figures and tables."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from ..quantities import METRICS, VERTEX_MAPS

SIMPLER_PREDICTIONS = {
    "scaled": "start, scaled: no folding",
    "atlas": "the atlas' brain, scaled",
    "atlas_deformed": "the atlas' brain, deformed onto the start",
    "target": "target shape of the run",
}
"""Labels of the simpler predictions of a brain, by their names in the study's table."""
ATLAS_LABELS = {
    "crl": ("CRL", "Gholipour et al. 2017"),
    "chinese": ("Chinese", "Wu et al. 2021"),
}
"""Label and citation of the normal atlases with curves, by their names in
`norms/atlases.yaml`."""
PARAMETER_TITLES = {
    "thickness": "cortical thickness",
    "shear_modulus_cortex": "shear modulus of the cortex",
    "shear_modulus_core": "shear modulus of the core",
    "poisson_ratio": "Poisson's ratio",
    "contact": "contact",
    "step": "time step",
    "tets": "elements",
    "order": "order of the elements",
    "elements_through_cortex": "elements through the cortex at the start",
    "element_error_percent": (
        "error of the elements: fastest wave too slow by up to (%)"
    ),
    "newton": "Newton iterations",
    "seconds": "time of the solve (s)",
    "peak_memory_MiB": "memory (MiB)",
}
"""Titles of parameters, by their keys without the suffix of the unit. Other parameters
keep their names."""

# suffixes of names, longer ones first, and the column `unit` of tables
_ENDINGS = {
    "_mm_per_gw": "mm/GW",
    "_per_s": "s⁻¹",
    "_pa_per_m": "Pa/m",
    "_mm": "mm",
    "_cm2": "cm²",
    "_ml": "mL",
    "_pa": "Pa",
    "_gw": "GW",
    "_s": "s",
}
_UNITS = {
    "cm2": "cm²",
    "mm2": "mm²",
    "mm3": "mm³",
    "1/mm": "mm⁻¹",
    "1": "",
}


def with_unit(name: str, unit: object) -> str:
    """Append the unit from a table to a name, for example "time step (s)"."""
    text = _UNITS.get(unit, unit) if isinstance(unit, str) else ""
    return f"{name} ({text})" if text else name


def metric_title(name: str) -> str:
    """Return the title of a metric with its unit, for example "pial area (cm²)"."""
    return with_unit(METRICS[name].label, METRICS[name].unit)


def map_title(name: str) -> str:
    """Return the title of the colour bar of a map, for example "sulcal depth (mm)"."""
    return with_unit(
        VERTEX_MAPS[name].label, VERTEX_MAPS[name].ends or VERTEX_MAPS[name].unit
    )


def atlas_label(name: str) -> str:
    """Return the label of an atlas; its name if it has none."""
    return ATLAS_LABELS.get(name, (name,))[0]


def cited_atlas(name: str) -> str:
    """Return the label of an atlas with its citation, for example "CRL (Gholipour et
    al. 2017)"."""
    label, *citation = ATLAS_LABELS.get(name, (name,))
    return f"{label} ({citation[0]})" if citation else label


def plain(name: str) -> str:
    """Return a name of columns or files as words."""
    return (
        name.replace("_", " ")
        .replace("spangy", "SpAnGy")
        .replace(
            "weyl",
            "Weyl",
        )
    )


def week_label(week: float) -> str:
    """Return a gestational week as text, for example "21 GW" or "21.5 GW"."""
    return f"{week:g} GW"


def column_label(key: Hashable) -> str:
    """Return the heading of a column: a week, an interval of two weeks, or a name as it
    is."""
    match key:
        case (first, last):
            return f"{first:g}–{last:g} GW"
        case float() | int():
            return week_label(key)
        case _:
            return str(key)


def parameter_label(key: str) -> str:
    """Return the axis label of a parameter, with its unit, for example "cortical
    thickness (mm)"."""
    ending = next(filter(key.endswith, _ENDINGS), "")
    name = key.removesuffix(ending)
    title = PARAMETER_TITLES.get(name) or plain(
        name.replace(
            ".",
            " ",
        )
    )
    return with_unit(title, _ENDINGS.get(ending))


def value_labels(values: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a heading for each run of a sweep: its values with units, for example "1.5
    mm".

    If several keys are varied, each is named.
    """
    headings = []
    for member in values:
        labels = [
            _value_label(
                *item,
                alone=len(member) == 1,
            )
            for item in member.items()
        ]
        headings.append("\n".join(labels))
    return headings


def _value_label(
    key: str,
    value: Any,
    *,
    alone: bool,
) -> str:
    label = parameter_label(key)
    name, _, unit = label.removesuffix(")").partition(" (")
    words = [
        f"{value:g}"
        if isinstance(
            value,
            float,
        )
        else str(value)
    ]
    if unit:
        words.append(unit)
    if not (alone and unit):
        words.insert(0, name)
    return " ".join(words)
