"""Figures as PNG and PDF."""

from os import PathLike

from matplotlib.figure import Figure

from .files import replaced


def write_figure(png: str | PathLike[str], pdf: str | PathLike[str], figure: Figure, *, dpi: int) -> None:
    """Writes a figure twice, as pixels of `dpi` dots per inch and as vectors."""
    with replaced(png) as temporary:
        figure.savefig(temporary, dpi=dpi)
    # without a date, so that the same figure gives the same file
    with replaced(pdf) as temporary:
        figure.savefig(temporary, dpi=dpi, metadata={"CreationDate": None})
