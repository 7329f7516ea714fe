"""Which modes the spectra of brains are made of, so that they can be compared."""

from collections.abc import Mapping
from typing import Literal

import pandas as pd
from scipy import sparse

from ..geometry.triangles import TriangleMesh, area
from ..parameters.metrics import LastBand, WeylFormula
from .laplace_beltrami import Modes, count_below, laplacian, lowest_modes, modes_below
from .spangy import band_limits, first_eigenvalue, weyl_number

SpangyModes = int | LastBand | Literal["own"] | Mapping[str, int]


def weyl_numbers(sides: Mapping[str, TriangleMesh], formula: WeylFormula) -> pd.DataFrame:
    """Returns per hemisphere of a brain: hemisphere, vertices, area_mm2, first_eigenvalue_per_mm2, weyl_number."""
    rows = []
    for name, mesh in sides.items():
        first = first_eigenvalue(*laplacian(mesh))
        rows.append((name, len(mesh.vertices), area(mesh), first, weyl_number(area(mesh), first, formula)))
    return pd.DataFrame(rows, columns=["hemisphere", "vertices", "area_mm2", "first_eigenvalue_per_mm2", "weyl_number"])


def common_modes(numbers: pd.DataFrame) -> dict[str, int]:
    """Returns the largest Weyl number per hemisphere of tables as `weyl_numbers` makes, joined."""
    return {str(name): int(number) for name, number in numbers.groupby("hemisphere")["weyl_number"].max().items()}


def modes_of(
    choice: SpangyModes,
    hemisphere: str,
    mesh: TriangleMesh,
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    first: float,
    formula: WeylFormula,
) -> tuple[Modes, float]:
    """Returns the modes that a hemisphere's spectrum is made of, and the λ in mm⁻² below which none is missing.

    The name of a band stands for all modes up to its end; that none is missing there is known by inertia, so that no
    mode of the next band is needed to show it. "own" is Weyl's number, a mapping gives the number per hemisphere. All
    these are at most half as many as there are vertices. A number is taken as it is.
    """
    most = len(mesh.vertices) // 2
    if isinstance(choice, str) and choice != "own":
        end = float(band_limits(first)[int(choice.removeprefix("B"))])
        if count_below(stiffness, mass, end) <= most:
            return modes_below(stiffness, mass, end), end
        number = most
    elif isinstance(choice, int):
        number = choice
    else:
        wanted = choice[hemisphere] if isinstance(choice, Mapping) else weyl_number(area(mesh), first, formula)
        number = max(2, min(wanted, most))
    modes = lowest_modes(stiffness, mass, number)
    return modes, float(modes.eigenvalues[-1])
