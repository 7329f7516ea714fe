"""What holds for every figure that a test of the report draws."""

from itertools import combinations
from string import ascii_lowercase

import matplotlib as mpl
import pytest
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from pictures import parts

from gyriflow.io import figures
from gyriflow.report import panels, quality, style

SMALLEST_PT = 6.0
"""Least size of print in a figure."""
TOUCH = 3.0
"""By how many dots texts may reach into each other or over the edge: boxes are a little
larger than letters."""


@pytest.fixture(autouse=True, scope="module")
def quick_pictures():
    """Draw surfaces and figures with fewer pixels than print has."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(panels, "PIXELS_PER_INCH", 100)
        patch.setattr(quality, "PIXELS_PER_INCH", 50)
        patch.setattr(figures, "DPI", 50)
        # numbers at axes are set as formulas otherwise, which takes as long as drawing
        patch.setitem(style.MATPLOTLIB_SETTINGS, "axes.formatter.use_mathtext", False)
        yield


@pytest.fixture(autouse=True)
def figures_can_be_printed(monkeypatch):
    """Figures of several panels have letters, each once, and no text is small, cut off,
    or over another one."""
    drawn, begin = [], Figure.__init__

    def noted(figure, *arguments, **settings):
        begin(figure, *arguments, **settings)
        drawn.append(figure)

    monkeypatch.setattr(Figure, "__init__", noted)
    yield
    for figure in drawn:
        drawn_on = [axes for axes in figure.axes if axes.axison or axes.has_data()]
        panels = [
            axes
            for axes in drawn_on
            if axes.get_label() != "scale bar" and not hasattr(axes, "_colorbar")
        ]
        bold = [text for text in parts(figure, Text) if text.get_fontweight() == "bold"]
        letters = sorted(text.get_text() for text in bold if len(text.get_text()) == 1)
        assert letters == list(ascii_lowercase[: len(letters)])
        assert (len(letters) > 1) == (len(panels) > 1), [
            axes.get_title() for axes in panels
        ]
    # the first of each test, as it takes time
    for figure in drawn[:1]:
        require_legible(figure)


def require_legible(figure: Figure) -> None:
    figure.draw_without_rendering()
    boxes = {text: text.get_window_extent() for text in shown_texts(figure)}
    small = {text.get_text() for text in boxes if text.get_fontsize() < SMALLEST_PT}
    assert not small
    page = figure.bbox.padded(TOUCH)
    assert not [
        text.get_text()
        for text, box in boxes.items()
        if not page.containsx(box.x0)
        or not page.containsx(box.x1)
        or not page.containsy(box.y0)
        or not page.containsy(box.y1)
    ]
    for (text, box), (other, near) in combinations(boxes.items(), 2):
        common = mpl.transforms.Bbox.intersection(box, near)
        over = common is not None and min(common.width, common.height) > TOUCH
        assert not over, (text.get_text(), other.get_text())


def shown_texts(figure: Figure) -> set[Text]:
    """Return the texts that are seen: not those of ticks beyond an axis, nor of an axis
    that is off."""
    hidden = set()
    for axis in parts(figure, Axis):
        low, high = sorted(axis.get_view_interval())
        for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
            if not low <= tick.get_loc() <= high:
                hidden |= {tick.label1, tick.label2}
    return {
        text
        for text in parts(figure, Text)
        if text.get_visible() and text.get_text().strip()
    } - hidden
