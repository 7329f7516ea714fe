"""How many modes the spectra of brains are made of, so that they can be compared."""

from collections.abc import Mapping
from typing import Literal

import pandas as pd
from scipy import sparse

from ..geometry.triangles import TriangleMesh, area
from .laplace_beltrami import count_below, laplacian
from .spangy import WeylFormula, band_limits, first_eigenvalue, weyl_number

LastBand = Literal["B4", "B5", "B6"]
SpangyModes = int | LastBand | Literal["own"] | Mapping[str, int]


def weyl_numbers(left: TriangleMesh, right: TriangleMesh, formula: WeylFormula) -> pd.DataFrame:
    """Returns per hemisphere: hemisphere, vertices, area_mm2, first_eigenvalue_per_mm2, weyl_number."""
    rows = []
    for name, mesh in (("left", left), ("right", right)):
        first = first_eigenvalue(*laplacian(mesh))
        rows.append((name, len(mesh.vertices), area(mesh), first, weyl_number(area(mesh), first, formula)))
    return pd.DataFrame(rows, columns=["hemisphere", "vertices", "area_mm2", "first_eigenvalue_per_mm2", "weyl_number"])


def common_modes(numbers: pd.DataFrame) -> dict[str, int]:
    """Returns the largest Weyl number per hemisphere of tables as `weyl_numbers` makes, joined."""
    return {str(name): int(number) for name, number in numbers.groupby("hemisphere")["weyl_number"].max().items()}


def modes_wanted(
    choice: SpangyModes,
    hemisphere: str,
    mesh: TriangleMesh,
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    first: float,
    formula: WeylFormula,
) -> int:
    """Returns the number of modes for a hemisphere.

    The name of a band stands for all modes up to its end, counted by inertia, and the next one. "own" is Weyl's number,
    a mapping gives the number per hemisphere. All these are at most half as many as there are vertices. A number is
    taken as it is.
    """
    if isinstance(choice, int):
        return choice
    if isinstance(choice, Mapping):
        number = choice[hemisphere]
    elif choice == "own":
        number = weyl_number(area(mesh), first, formula)
    else:
        end = band_limits(first)[int(choice.removeprefix("B"))]
        number = count_below(stiffness, mass, float(end)) + 1
    return max(2, min(number, len(mesh.vertices) // 2))
