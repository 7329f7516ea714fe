"""What holds for every figure that a test of the report draws."""

from string import ascii_lowercase

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text


@pytest.fixture(autouse=True)
def panels_have_letters(monkeypatch):
    """A caption calls the parts of a figure by bold letters: each figure of several panels has a, b, c …, each once."""
    drawn, begin = [], Figure.__init__

    def noted(figure, *arguments, **settings):
        begin(figure, *arguments, **settings)
        drawn.append(figure)

    monkeypatch.setattr(Figure, "__init__", noted)
    yield
    for figure in drawn:
        panels = [axes for axes in figure.axes if axes.get_label() != "scale bar" and not hasattr(axes, "_colorbar")]
        bold = [text for text in figure.findobj(Text) if text.get_fontweight() == "bold"]
        letters = sorted(text.get_text() for text in bold if len(text.get_text()) == 1)
        assert letters == list(ascii_lowercase[: len(letters)])
        assert (len(letters) > 1) == (len(panels) > 1), [axes.get_title() for axes in panels]
