"""The chart of the weeks in which sulci begin."""

import numpy as np
import pandas as pd

from gyriflow.report.onset import onset_chart


def table(**weeks):
    """Returns onsets by run of the sulci left central, left 2 and one that is there at the start."""
    rows = [
        {"run": run, "subject": "a", "region": name, "there_at_start": name == "left calcarine", "onset_week": week}
        for run, found in weeks.items()
        for name, week in zip(("left central", "left 2", "left calcarine"), found, strict=True)
    ]
    return pd.DataFrame(rows)


def test_each_sulcus_has_a_row_with_its_weeks():
    axes = onset_chart(table(real=(26.0, 28.0, np.nan), measured=(26.5, np.nan, np.nan)), runs=["measured"]).axes[0]
    # the earliest on top
    assert [label.get_text() for label in axes.get_yticklabels()] == ["left 2", "left central"]
    lines = {(line.get_marker(), line.get_color()): line for line in axes.lines if len(line.get_xdata())}
    (stars,) = (line for (marker, _), line in lines.items() if marker == "*")
    assert sorted(stars.get_xdata()) == [26.0, 28.0]
    (dots,) = (line for (marker, _), line in lines.items() if marker == "o")
    assert dots.get_xdata().tolist() == [26.5]
    assert np.abs(dots.get_ydata() - 1).max() < 0.5
    (never,) = (line for (marker, _), line in lines.items() if marker == "x")
    assert never.get_xdata().tolist() == [29.0]


def test_starts_are_told_apart_and_nothing_is_drawn_of_nothing():
    both = pd.concat([table(real=(26.0, 28.0, np.nan)), table(real=(27.0, 28.5, np.nan)).assign(subject="b")])
    names = [label.get_text() for label in onset_chart(both).axes[0].get_yticklabels()]
    assert set(names) == {f"{sulcus} · {start}" for sulcus in ("left central", "left 2") for start in "ab"}
    nothing = table(real=(26.0, 28.0, np.nan)).assign(there_at_start=True)
    assert "no sulcus begins" in onset_chart(nothing).axes[0].texts[0].get_text()
