"""The report: one HTML page with all that it shows inside."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from docutils.core import publish_parts
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

SECTIONS = (
    "Inputs",
    "Quality of the brains",
    "Growth",
    "Folding",
    "Metrics",
    "Validation",
    "Studies",
    "Resources",
)
"""The sections of figures and tables in their order; others follow."""
VERDICTS = ("fine", "look", "refused")
_WORD, _SENTENCE = 24, 60
FILE, COMMAND = "(file)", "(command)"
_FILE_NAME = re.compile(r"[/\\]|\.(nii|gii|mgz|mgh|stl|ply|obj|vtk|yaml|yml|h5|csv|sif)(\.gz)?$", re.IGNORECASE)


@dataclass(frozen=True)
class Shown:
    """A figure or table of the report.

    Attributes
    ----------
    section, title : where it stands, and its heading
    content : HTML
    caption : reStructuredText
    first : whether it stands on the first page instead
    """

    section: str
    title: str
    content: str
    caption: str = ""
    first: bool = False


def picture(address: str, alt: str) -> str:
    """Returns an image of the page from its data address."""
    return Markup('<img src="{}" alt="{}" loading="lazy">').format(address, alt)


def table_html(table: pd.DataFrame) -> Markup:
    """Returns a table as HTML in the page's look: text escaped, numbers at the right, dashes for missing ones."""
    rows = [Markup("<tr>{}</tr>").format(_cells(table, row)) for row in table.itertuples(index=False, name=None)]
    heads = Markup("").join(Markup("<th>{}</th>").format(name) for name in table.columns)
    return Markup("<table><thead><tr>{}</tr></thead><tbody>{}</tbody></table>").format(heads, Markup("").join(rows))


def _cells(table: pd.DataFrame, row: Sequence[Any]) -> Markup:
    cells = []
    for name, value in zip(table.columns, row, strict=True):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        text = ("–" if pd.isna(value) else f"{value:.4g}") if number else "–" if value is None else str(value)
        kind = "number" if number else f"verdict {text}" if name == "verdict" and text in VERDICTS else ""
        # columns of sentences are wide, single words and numbers stay on one line
        kind = kind or ("wide" if len(text) > _SENTENCE else "whole" if len(text) <= _WORD else "")
        cells.append(Markup('<td class="{}">{}</td>').format(kind, text))
    return Markup("").join(cells)


def render_caption(template: str, values: Mapping[str, Any]) -> str:
    """Returns a caption, reStructuredText, from its Jinja template; UndefinedError for a name without a value."""
    return Environment(undefined=StrictUndefined, autoescape=False).from_string(template).render(values)


def caption_html(caption: str) -> Markup:
    """Returns a caption as HTML."""
    settings = {"report_level": 5, "raw_enabled": False, "file_insertion_enabled": False}
    return Markup(publish_parts(caption, writer="html5", settings_overrides=settings)["body"])


def hide_paths(value: Any) -> Any:
    """Returns a configuration, plain dictionaries and lists, without the paths and commands in it.

    A file's name may hold a patient's.
    """
    match value:
        case dict():
            return {key: COMMAND if key == "command" and item else hide_paths(item) for key, item in value.items()}
        case list() | tuple():
            return [hide_paths(item) for item in value]
        case str() if _FILE_NAME.search(value):
            return FILE
        case _:
            return value


def sections(shown: Sequence[Shown]) -> list[tuple[str, list[dict[str, Any]]]]:
    """Returns the sections that have something to show, in order, each with its numbered figures and tables."""
    names = [*SECTIONS, *sorted({item.section for item in shown} - set(SECTIONS))]
    found = []
    number = 0
    for name in names:
        items = []
        for item in shown:
            if item.section == name:
                number += 1
                items.append(
                    {
                        "number": number,
                        "title": item.title,
                        "content": Markup(item.content),
                        "caption": caption_html(item.caption),
                    }
                )
        if items:
            found.append((name, items))
    return found


def report_page(template: str, parts: Mapping[str, str], view: Mapping[str, Any], **content: Any) -> str:
    """Returns the page.

    Parameters
    ----------
    template
        Jinja template of the page, which escapes what is put in.
    parts : style, three, notice, controls, viewer
        The style sheet and the scripts of the 3D view with their licence, put into the page as they are.
    view
        What `view_data` returns.
    content
        What else the template names; HTML as `Markup`.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    # within a script, nothing may look like its end
    data = Markup(json.dumps(view, separators=(",", ":")).replace("</", "<\\/"))
    inside = {name: Markup(text.replace("</script", "<\\/script")) for name, text in parts.items()}
    return environment.from_string(template).render(**content, **inside, surfaces=data)
