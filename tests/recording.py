"""Recorded tables: all numbers of some results, compared with a file beside the test.

A table has a row a number: what it is of, the number, or a text. Arrays are summarised,
so that files stay small.
"""

import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import sparse

from gyriflow.errors import GyriflowError

SMALL = 9
"""Arrays of at most so many values are recorded whole."""
DIGITS = 6
"""Digits of the numbers in a file."""
ZERO = 1e-6
"""What is smaller than this share of its array's size is zero, as rounding decides
it."""

Row = tuple[str, float, str]


def table_of(results: Mapping[str, object]) -> pd.DataFrame:
    """Return the table of results by their names."""
    rows = []
    for name, value in results.items():
        rows.extend(_rows(name, value))
    table = pd.DataFrame(rows, columns=["quantity", "number", "text"])
    return table.set_index("quantity")


def numbers_in(message: str) -> str:
    """Return the numbers of a message, whose words may change."""
    return " ".join(re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?", message))


def _rows(name: str, value: object) -> Iterator[Row]:
    if value is None or isinstance(value, str | bool | np.bool_):
        yield name, np.nan, str(value)
    elif isinstance(value, Path):
        yield name, np.nan, value.name
    elif sparse.issparse(value):
        yield from _array_rows(name, _products(value))
    elif isinstance(value, pd.Series | pd.Index):
        yield from _array_rows(name, value.to_numpy())
    elif isinstance(value, set | frozenset):
        yield from _array_rows(name, np.array(sorted(value)))
    else:
        parts = _parts(value)
        if parts is None:
            yield from _array_rows(name, np.asarray(value))
        else:
            for key, part in parts.items():
                yield from _rows(f"{name}.{key}", part)


def _parts(value: object) -> dict | None:
    """Return the named parts of a result, or None if it is numbers."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, pd.DataFrame):
        return {column: value[column] for column in value}
    if dataclasses.is_dataclass(value):
        fields = dataclasses.fields(value)
        return {field.name: getattr(value, field.name) for field in fields}
    if isinstance(value, tuple | list):
        is_plain = all(isinstance(item, int | float | str) for item in value)
        return None if is_plain else dict(enumerate(value))
    return None


def _products(matrix: sparse.sparray) -> np.ndarray:
    """Return the products of a matrix with a vector of unequal numbers."""
    return matrix @ np.linspace(1.0, 2.0, matrix.shape[1])


def _array_rows(name: str, values: np.ndarray) -> Iterator[Row]:
    if not np.issubdtype(values.dtype, np.number) and values.dtype != bool:
        values = pd.Series(values.ravel()).fillna("").astype(str)
        yield name, np.nan, " ".join(values)
        return
    values = values.astype(float)
    finite = values[np.isfinite(values)]
    if values.size <= SMALL:
        size = np.abs(finite).max(initial=0.0)
        for index in np.ndindex(values.shape):
            place = list(index) if index else ""
            yield f"{name}{place}", _without_noise(values[index], size), ""
        return
    yield name, np.nan, "shape " + " ".join(map(str, values.shape))
    summary = {"finite": finite.size}
    # a place far from the origin is not to hide what is small
    is_points = values.ndim == 2 and values.shape[1] <= 4
    means = np.nanmean(values, axis=0) if is_points else np.nanmean(values)
    centred = values - means
    spread = np.sqrt(np.nanmean(centred**2))
    for column, mean in enumerate(np.atleast_1d(means)):
        summary[f"mean {column}"] = mean
    summary["spread"] = spread
    summary["least"] = np.nanmin(centred)
    summary["largest"] = np.nanmax(centred)
    # changes with the order of the values
    summary["weighted"] = np.nanmean(
        np.linspace(1.0, 2.0, values.size) * centred.ravel()
    )
    for part in (0.0, 0.3, 0.8):
        index = int(part * values.size)
        summary[f"at {index}"] = centred.ravel()[index]
    for key, number in summary.items():
        size = np.abs(values[np.isfinite(values)]).max() if "mean" in key else spread
        yield f"{name}: {key}", _without_noise(number, size), ""


def _without_noise(number: float, size: float) -> float:
    """Return a number, or 0 if it is nothing beside the size of its array."""
    if abs(number) < ZERO * size:
        return 0.0
    return float(number)


def answer_of(function: Callable, *values: object, **more: object) -> object:
    """Return what a function returns, or the name and numbers of the error that it
    raises; numbers only of messages."""
    try:
        answer = function(*values, **more)
    except GyriflowError as error:
        return f"{type(error).__name__} {numbers_in(str(error))}"
    if isinstance(answer, Iterator | list) and not isinstance(answer, str):
        return [
            numbers_in(item) if isinstance(item, str) else item for item in answer
        ]
    return answer
