"""Figures as PNG and PDF, and tables as HTML."""

from os import PathLike

from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from .files import replaced

AnyPath = str | PathLike[str]


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
    """Writes a page with the given content."""
    with replaced(path) as temporary:
        page = f'<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n{body}\n</html>\n'
        temporary.write_text(page, encoding="utf-8")
