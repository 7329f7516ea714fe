"""Tables for print: one table as CSV with all digits, and as Markdown and LaTeX with the digits that a reader needs."""

from collections.abc import Mapping

import pandas as pd

from .files import AnyPath, replaced, write_table

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


def write_printed(
    paths: Mapping[str, AnyPath], table: pd.DataFrame, caption: str, *, printed: pd.DataFrame | None = None
) -> None:
    """Writes a table to the paths `csv`, `md` and `tex`.

    CSV holds the values; the others hold them as a reader wants them, with the caption, empty cells as a dash. LaTeX
    needs the package booktabs.

    Parameters
    ----------
    printed
        The table in another form for Markdown and LaTeX, where that is easier to read.
    """
    write_table(paths["csv"], table)
    shown = (table if printed is None else printed).map(as_printed)
    with replaced(paths["md"]) as temporary:
        plain = shown.rename(columns=lambda name: str(name).replace("|", r"\|")).map(lambda cell: cell.replace("|", r"\|"))
        text = plain.to_markdown(index=False, disable_numparse=True)
        temporary.write_text(f"{caption}\n\n{text}\n", encoding="utf-8")
    with replaced(paths["tex"]) as temporary:
        temporary.write_text(latex(shown, caption), encoding="utf-8")


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
