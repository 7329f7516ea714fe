"""What a figure shows: its words, its lines and bars, its pictures, and where these are
not empty."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text


def words(figure: Figure) -> set[str]:
    """Return all texts that a figure shows."""
    return {
        text.get_text()
        for text in parts(figure, Text)
        if text.get_visible() and text.get_text()
    }


def parts[Part: Artist](figure: Figure, kind: type[Part]) -> list[Part]:
    """Return the parts of a kind that a figure has, without axes that are off: their
    ticks would be made first."""
    found = []
    remaining: list[Artist] = [figure]
    while remaining:
        part = remaining.pop()
        if isinstance(part, Axis) and not part.axes.axison:
            continue
        if isinstance(part, kind):
            found.append(part)
        remaining += part.get_children()
    return found


def contents(figure: Figure) -> dict:
    """Return all that the panels of a chart show, and its legend, for a recorded
    table."""
    found = {}
    for number, axes in enumerate(figure.axes):
        titles = axes.get_title(), axes.get_xlabel(), axes.get_ylabel()
        panel = {"texts": [*titles, *(text.get_text() for text in axes.texts)]}
        for kind in ("lines", "patches"):
            for place, item in enumerate(getattr(axes, kind)):
                panel[f"{kind} {place}"] = {"look": look(item), "at": ends(item)}
        for place, band in enumerate(axes.collections):
            paths = band.get_paths()
            panel[f"band {place}"] = [path.vertices for path in paths]
        found[f"panel {number}"] = panel
    for legend in figure.legends:
        texts = [text.get_text() for text in legend.get_texts()]
        looks = [look(handle) for handle in legend.legend_handles]
        found["legend"] = dict(zip(texts, looks, strict=True))
    return found


def look(item: object) -> str:
    """Return the marker, the line and the colours of a line, or the hatch of a bar."""
    if isinstance(item, Line2D):
        colours = item.get_color(), item.get_markerfacecolor()
        drawn = item.get_marker(), item.get_linestyle(), *map(to_hex, colours)
        return " ".join(drawn)
    if isinstance(item, Patch):
        return f"{to_hex(item.get_facecolor())} {item.get_hatch() or ''}"
    return type(item).__name__


def ends(item: object) -> np.ndarray:
    """Return the points of a line, or the place, width and height of a bar."""
    if isinstance(item, Line2D):
        return np.column_stack([np.asarray(item.get_xdata(), float), item.get_ydata()])
    if hasattr(item, "get_height"):
        return np.array([item.get_x(), item.get_width(), item.get_height()])
    return item.get_path().vertices


def surfaces_seen(figure: Figure) -> dict:
    """Return the words of pictures of surfaces, the limits of colour bars, and of each
    picture its scale, what is not background and its colour, for a recorded table."""
    bars = [axes for axes in figure.axes if hasattr(axes, "_colorbar")]
    found = {"words": sorted(words(figure))}
    found["bars"] = {axes.get_xlabel(): axes.get_xlim() for axes in bars}
    for number, axes in enumerate(pictures(figure)):
        image = picture(figure, number)
        shown = covered(image)
        found[f"{number} {axes.get_label()}"] = {
            "dots per mm": axes.get_window_extent().width / np.ptp(axes.get_xlim()),
            "width and height": [shown.any(axis=0).sum(), shown.any(axis=1).sum()],
            # over the whole, and over the upper left part
            "tone": tone(image),
            "tone of a part": tone(image[: len(image) // 2, : image.shape[1] // 2]),
        }
    return found


def pictures(figure: Figure) -> list[Axes]:
    """Return the panels that show a picture."""
    return [axes for axes in figure.axes if axes.images]


def picture(figure: Figure, number: int = 0) -> np.ndarray:
    """Return the pixels of a panel."""
    return np.asarray(pictures(figure)[number].images[0].get_array())


def covered(image: np.ndarray) -> np.ndarray:
    """Return which pixels are not background."""
    return (image < 250).any(axis=-1)


def tone(image: np.ndarray) -> np.ndarray:
    """Return the mean red, green and blue of what is not background."""
    return image[covered(image)].astype(float).mean(axis=0)


def colour_bar(figure: Figure, words: str) -> Axes:
    """Return the colour bar with some words in its label."""
    (bar,) = [axes for axes in figure.axes if words in axes.get_xlabel()]
    return bar
