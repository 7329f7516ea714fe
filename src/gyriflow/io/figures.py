"""What readers look at: figures as PNG and PDF, pages as HTML with pictures in them, tables for print.

A table for print is CSV with all digits, and Markdown and LaTeX with the digits that a reader needs.
"""

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from PIL import Image

from .files import AnyPath, replaced, write_table, write_text

WIDTHS = (1800, 1400, 1100, 800)
"""Widths in pixels that pictures are tried with, until all of them together fit."""
QUALITY = 82
DIGITS = 4
"""Significant digits in Markdown and LaTeX."""
IN_LATEX = {
    "²": r"\textsuperscript{2}",
    "³": r"\textsuperscript{3}",
    "⁻⁷": r"\textsuperscript{-7}",
    "⁻¹": r"\textsuperscript{-1}",
    "μ": r"$\mu$",
    "ν": r"$\nu$",
    "·": r"$\cdot$",
    "×": r"$\times$",
    "–": "--",
    "−": r"$-$",
    "≤": r"$\le$",
    "≥": r"$\ge$",
}
"""Characters that not every LaTeX engine sets."""

TABLE_LOOK = (
    "body { font: 13px sans-serif } p { max-width: 60em } table { border-collapse: collapse; margin: 1em 0 } "
    "caption { text-align: left; font-weight: bold; padding: 4px 0 } "
    "th, td { text-align: left; border-bottom: 1px solid #ddd; padding: 3px 10px } td.number { text-align: right }"
)
"""How tables look in a page of their own."""


def write_figure(png: AnyPath, pdf: AnyPath, figure: Figure, *, dpi: int) -> None:
    """Writes a figure twice, as pixels of `dpi` dots per inch and as vectors.

    Pictures within the vectors keep all of their pixels.
    """
    with replaced(png) as temporary:
        figure.savefig(temporary, dpi=dpi)
    for picture in figure.findobj(AxesImage):
        picture.set_interpolation("none")
    # without a date, so that the same figure gives the same file
    with replaced(pdf) as temporary:
        figure.savefig(temporary, dpi=dpi, metadata={"CreationDate": None})


def write_html(path: AnyPath, body: str) -> None:
    """Writes a page with the given content, tables first of all."""
    head = f'<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n<style>{TABLE_LOOK}</style>'
    write_text(path, f"{head}\n{body}\n</html>\n")


def picture_addresses(paths: Sequence[AnyPath], budget_bytes: float) -> list[tuple[str, float]]:
    """Returns pictures as data addresses for a page, WebP coded, each with the width in inches that it has in print.

    All have as many pixels as fit into a number of bytes.
    """
    for width in WIDTHS:
        coded = [_coded(path, width) for path in paths]
        if sum(map(len, coded)) <= budget_bytes:
            break
    return [(f"data:image/webp;base64,{content}", _inches(path)) for content, path in zip(coded, paths, strict=True)]


def _inches(path: AnyPath) -> float:
    with Image.open(path) as picture:
        return float(picture.width / picture.info["dpi"][0])


def _coded(path: AnyPath, width: int) -> str:
    with Image.open(path) as picture:
        shown = picture.convert("RGB")
    if shown.width > width:
        shown = shown.resize((width, round(shown.height * width / shown.width)), Image.Resampling.LANCZOS)
    content = BytesIO()
    shown.save(content, "WEBP", quality=QUALITY, method=4)
    return b64encode(content.getvalue()).decode("ascii")


def read_body(path: AnyPath) -> str:
    """Returns the content of a page that `write_html` has written."""
    text = Path(path).read_text(encoding="utf-8")
    body = re.fullmatch(r"<!DOCTYPE html>.*?</style>\n(.*)\n</html>\n", text, re.DOTALL)
    return body[1] if body else text


def write_printed(
    paths: Mapping[str, AnyPath], table: pd.DataFrame, caption: str, *, printed: pd.DataFrame | None = None
) -> None:
    """Writes a table to the paths `csv`, `md` and `tex`.

    CSV holds the values; the others hold them as a reader wants them, with the caption, empty cells as a dash, and in
    the form `printed` where that is easier to read. LaTeX needs the package booktabs.
    """
    write_table(paths["csv"], table)
    shown = (table if printed is None else printed).map(as_printed)
    plain = shown.rename(columns=lambda name: str(name).replace("|", r"\|")).map(lambda cell: cell.replace("|", r"\|"))
    text = plain.to_markdown(index=False, disable_numparse=True)
    write_text(paths["md"], f"{caption}\n\n{text}\n")
    write_text(paths["tex"], latex(shown, caption))


def as_printed(value: object) -> str:
    """Returns a cell as it is printed: numbers with four significant digits, nothing as a dash."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, int | float):
        return str(value).strip() or "–" if value is not None else "–"
    if pd.isna(value):
        return "–"
    return f"{value:.{DIGITS}g}" if abs(value) < 10**DIGITS else f"{value:,.0f}".replace(",", " ")


def latex(shown: pd.DataFrame, caption: str) -> str:
    """Returns a table of text as LaTeX with booktabs."""
    plain = shown.rename(columns=str).map(_escaped)
    plain.columns = [_escaped(name) for name in plain.columns]
    text = plain.style.hide(axis="index").to_latex(
        hrules=True,
        caption=_escaped(caption),
        position="htbp",
        position_float="centering",
        column_format="l" * len(plain.columns),
    )
    return str(text)


def _escaped(text: str) -> str:
    marks = {"\\": r"\textbackslash{}", **{mark: f"\\{mark}" for mark in "&%$#_{}"}, "~": r"\textasciitilde{}"}
    safe = "".join(marks.get(mark, mark) for mark in text)
    for mark, command in IN_LATEX.items():
        safe = safe.replace(mark, command)
    return safe
