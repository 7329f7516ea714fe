"""Write figures as PNG and PDF, and HTML pages with embedded pictures."""

import re
from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from .files import AnyPath, atomic_write, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTHS = (1800, 1400, 1100, 800)
"""Widths in pixels that pictures are tried with, until all of them together fit."""
QUALITY = 82

DPI = 200
"""Resolution of pictures as PNG, in dots per inch."""

TABLE_LOOK = (
    "body { font: 13px sans-serif } p { max-width: 60em } table { border-collapse:"
    " collapse; margin: 1em 0 } caption { text-align: left; font-weight: bold; padding:"
    " 4px 0 } th, td { text-align: left; border-bottom: 1px solid #ddd; padding: 3px"
    " 10px } td.number { text-align: right }"
)
"""How tables look in a page of their own."""


def write_figure(
    png: AnyPath,
    pdf: AnyPath,
    figure: "Figure",
) -> None:
    """Write a figure as pixels, `DPI` to the inch, and as vectors; pictures keep their
    pixels."""
    with atomic_write(png) as temporary:
        figure.savefig(temporary, dpi=DPI)
    # laid out once: both files look the same
    figure.set_layout_engine("none")
    for axes in figure.axes:
        for picture in axes.images:
            picture.set_interpolation("none")
    # without a date, so that the same figure gives the same file
    with atomic_write(pdf) as temporary:
        figure.savefig(temporary, dpi=DPI, metadata={"CreationDate": None})


def write_html(path: AnyPath, body: str) -> None:
    """Write a page with the given content, tables first of all."""
    head = (
        '<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n'
        f"<style>{TABLE_LOOK}</style>"
    )
    write_text(path, f"{head}\n{body}\n</html>\n")


def picture_addresses(
    paths: Sequence[AnyPath], budget_bytes: float
) -> list[tuple[str, float]]:
    """Return pictures as data addresses (WebP) that together fit `budget_bytes`, and
    their widths in print (inches)."""
    for width in WIDTHS:
        coded = [_data_address(path, width) for path in paths]
        if sum(len(address) for address, _ in coded) <= budget_bytes:
            break
    return coded


def _data_address(path: AnyPath, width: int) -> tuple[str, float]:
    """Return a picture as a data address (WebP), at most so many pixels wide, and its
    width in print in inches."""
    # only here, as tables are written without it
    from PIL import Image

    with Image.open(path) as picture:
        image = picture.convert("RGB")
        width_in = float(picture.width / picture.info["dpi"][0])
    if image.width > width:
        height = round(image.height * width / image.width)
        image = image.resize((width, height), Image.Resampling.LANCZOS)
    content = BytesIO()
    image.save(content, "WEBP", quality=QUALITY, method=4)
    text = b64encode(content.getvalue()).decode("ascii")
    return f"data:image/webp;base64,{text}", width_in


def read_body(path: AnyPath) -> str:
    """Return the content of a page that `write_html` has written."""
    text = Path(path).read_text(encoding="utf-8")
    body = re.fullmatch(r"<!DOCTYPE html>.*?</style>\n(.*)\n</html>\n", text, re.DOTALL)
    return body[1] if body else text
