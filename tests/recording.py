"""Recorded tables: all numbers of some results, compared with a file beside the test.

A table has a row a number, text or array. Arrays are summarised, so that files stay
small.
"""

import dataclasses
import json
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import h5py
import nibabel as nib
import numpy as np
import pandas as pd
import yaml
from scipy import sparse

from gyriflow.errors import GyriflowError
from gyriflow.geometry.triangles import area_cm2, corners, volume_ml
from gyriflow.io.surfaces import read_surface

SMALL = 9
"""Arrays of at most so many values are recorded whole."""
DIGITS = 6
"""Digits of the numbers in a file."""
ZERO = 1e-6
"""What is smaller than this share of its array's size is zero, as rounding decides
it."""


@dataclasses.dataclass(frozen=True)
class Row:
    """A row of a table: a text, a number, or an array's shape, its mean and what is
    measured from there."""

    quantity: str
    text: str = ""
    number: float = np.nan
    spread: float = np.nan
    least: float = np.nan
    largest: float = np.nan
    weighted: float = np.nan
    first: float = np.nan
    a_third: float = np.nan
    last: float = np.nan


def table_of(results: Mapping[str, object]) -> pd.DataFrame:
    """Return the table of results by their names."""
    rows = []
    for name, value in results.items():
        rows.extend(_rows(name, value))
    return pd.DataFrame(map(dataclasses.asdict, rows)).set_index("quantity")


def renewed(
    old: pd.DataFrame, new: pd.DataFrame, rtol: float, atol: float
) -> pd.DataFrame:
    """Return a new table with the old numbers where they agree."""
    table = new.copy()
    numbers = new.columns.drop("text")
    for name in new.index.intersection(old.index):
        before, now = old.loc[name, numbers], new.loc[name, numbers]
        if np.allclose(
            now.astype(float),
            before.astype(float),
            rtol,
            atol,
            equal_nan=True,
        ):
            table.loc[name, numbers] = before
    return table


def numbers_in(message: str) -> str:
    """Return the numbers of a message, whose words may change."""
    return " ".join(re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?", message))


def contents(path: Path, is_remeshed: bool = False) -> object:
    """Return the numbers and texts of a file: a table, JSON, YAML, GIFTI, NIfTI or
    HDF5; None of others.

    Of maps on a surface that was remeshed, whose vertices rounding decides, only the
    quartiles are returned.
    """
    if path.name.endswith(".csv"):
        return pd.read_csv(path, dtype={"subject": str})
    if path.name.endswith(".json"):
        return json.loads(path.read_text())
    if path.name.endswith(".yaml"):
        return yaml.safe_load(path.read_text())
    if _has_triangles(path):
        mesh = read_surface(path)
        # remeshing decides by rounding how many vertices there are
        return {
            "area cm2": area_cm2(mesh),
            "volume mL": volume_ml(mesh),
            "centre": np.round(corners(mesh).mean(axis=(0, 1)), 3),
            "extents": np.ptp(mesh.vertices, axis=0),
        }
    if path.name.endswith(".gii"):
        maps = {}
        for number, array in enumerate(nib.load(path).darrays):
            name = f"{number} {array.meta.get('Name', '')}"
            quartiles = np.nanquantile(array.data, [0.25, 0.5, 0.75])
            maps[name] = quartiles if is_remeshed else array.data
        return maps
    if path.name.endswith((".nii", ".nii.gz")):
        image = nib.load(path)
        return {"voxels": np.asarray(image.dataobj), "affine": image.affine}
    if path.name.endswith(".h5"):
        found = {}

        def take(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
                found[name] = item[()]

        with h5py.File(path) as file:
            file.visititems(take)
            # others have times
            if "made_from" in file.attrs:
                found["made_from"] = file.attrs["made_from"]
        return found
    return None


def _has_triangles(path: Path) -> bool:
    if not path.name.endswith(".gii"):
        return False
    return bool(nib.load(path).get_arrays_from_intent("NIFTI_INTENT_TRIANGLE"))


def _rows(name: str, value: object) -> Iterator[Row]:
    if value is None or isinstance(value, str | bool | np.bool_):
        yield Row(name, str(value))
    elif isinstance(value, Path):
        yield Row(name, value.name)
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
        texts = pd.Series(values.ravel()).fillna("").astype(str)
        if texts.size > SMALL:
            counts = texts.value_counts(sort=False)
            texts = [f"{count} x {text}" for text, count in counts.items()]
        yield Row(name, " | ".join(texts))
        return
    values = values.astype(float)
    if values.size <= SMALL:
        size = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        for index in np.ndindex(values.shape):
            place = list(index) if index else ""
            yield Row(f"{name}{place}", "", _without_noise(values[index], size))
    elif values.ndim == 2 and values.shape[1] <= 4:
        for column in range(values.shape[1]):
            yield _summary(f"{name}[:, {column}]", values[:, column])
    else:
        yield _summary(name, values)


def _summary(name: str, values: np.ndarray) -> Row:
    """Return the row of an array's numbers: the mean, and all others from there, so
    that a place far from the origin hides nothing."""
    shape = "x".join(map(str, values.shape))
    is_finite = np.isfinite(values)
    lacking = values.size - int(is_finite.sum())
    if lacking:
        shape += f", {lacking} lacking"
    if lacking == values.size:
        return Row(name, shape)
    mean = values[is_finite].mean()
    flat = np.where(is_finite, values, np.nan).ravel() - mean
    finite = flat[is_finite.ravel()]
    spread = finite.std()
    numbers = {
        "spread": spread,
        "least": finite.min(),
        "largest": finite.max(),
        # changes with the order of the values
        "weighted": np.nanmean(np.linspace(1.0, 2.0, flat.size) * flat),
        "first": flat[0],
        "a_third": flat[flat.size // 3],
        "last": flat[-1],
    }
    for key, number in numbers.items():
        numbers[key] = _without_noise(number, spread)
    largest = np.abs(values[is_finite]).max()
    return Row(name, shape, _without_noise(mean, largest), **numbers)


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
        return [numbers_in(item) if isinstance(item, str) else item for item in answer]
    return answer
