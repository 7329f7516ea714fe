"""How many modes the spectra of brains are made of, so that they can be compared."""

from collections.abc import Mapping
from typing import Literal

import pandas as pd
from scipy import sparse

from ..geometry.triangles import TriangleMesh, area
from .laplace_beltrami import count_below, laplacian
from .spangy import WeylFormula, band_limits, first_eigenvalue, number_of_modes, weyl_number

SpangyModes = int | Literal["own", "complete"] | Mapping[str, int]


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


def complete_number(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, first: float) -> int:
    """Returns the number of modes that holds all of B6: those below 4⁶·λ1, by inertia, and the next.

    At most half as many as there are vertices; B6 is then flagged as incomplete.
    """
    return min(count_below(stiffness, mass, float(band_limits(first)[-1])) + 1, stiffness.shape[0] // 2)


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

    A number is taken as it is. "own" is Weyl's number, "complete" what holds all of B6, and a mapping gives the number
    per hemisphere. "own" and a mapping give at most a tenth of the number of vertices: higher modes show the mesh.
    """
    if isinstance(choice, int):
        return choice
    if choice == "complete":
        return complete_number(stiffness, mass, first)
    number = weyl_number(area(mesh), first, formula) if choice == "own" else choice[hemisphere]
    return number_of_modes(number, len(mesh.vertices))
