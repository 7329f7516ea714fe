"""What a figure shows: its words, its pictures, and where these are not empty."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text


def words(figure: Figure) -> set[str]:
    """Return all texts that a figure shows."""
    return {
        text.get_text()
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text()
    }


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
