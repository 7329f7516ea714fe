"""Tables in tests, as texts."""

from io import StringIO

import pandas as pd


def frame(text: str, **columns: object) -> pd.DataFrame:
    """Return a table from its lines, in which spaces part cells and `-` is a missing
    value, with further columns of one value or of a list."""
    return pd.read_csv(StringIO(text), sep=r"\s+", na_values="-").assign(**columns)
