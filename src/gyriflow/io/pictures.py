"""Pictures and tables of the results, as they are put into one page."""

import re
from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from PIL import Image

from .files import AnyPath

WIDTHS = (1800, 1400, 1100, 800)
"""Widths in pixels that pictures are tried with, until all of them together fit."""
QUALITY = 82


def picture_addresses(paths: Sequence[AnyPath], budget_bytes: float) -> list[str]:
    """Returns pictures as data addresses for a page, all as wide as fits into a number of bytes, WebP coded."""
    for width in WIDTHS:
        coded = [_coded(path, width) for path in paths]
        if sum(map(len, coded)) <= budget_bytes:
            break
    return [f"data:image/webp;base64,{content}" for content in coded]


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
    body = re.fullmatch(r'<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n(.*)\n</html>\n', text, re.DOTALL)
    return body[1] if body else text
