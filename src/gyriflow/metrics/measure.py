"""All metrics of one brain."""

import os
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from tempfile import TemporaryDirectory

import pandas as pd
from numpy.typing import NDArray

from ..errors import MeshError
from ..geometry.crossings import crossing_faces
from ..geometry.triangles import Floats, TriangleMesh, signed_volume
from ..parameters.metrics import (
    CURVATURE_RADIUS_MM,
    SPANGY_MODES,
    SPANGY_PROXY,
    SPANGY_WAVELENGTH,
    SpangyProxy,
    WeylFormula,
)
from ..units import ML_PER_MM3
from .gyrification import cap
from .hemisphere import (
    Hemisphere,
    Settings,
    coefficient_table,
    folding_rows,
    measure_hemisphere,
    size_rows,
    spectrum_rows,
)
from .mode_numbers import SpangyModes
from .thickness import at_part

LABEL_VOLUMES = {"volume_tissue": "tissue", "volume_ventricles": "ventricles", "volume_cortex": "cortex"}
"""The metrics that are volumes of labels, and what these are called in the reports of surfaces."""


@dataclass(frozen=True, eq=False)
class BrainMetrics:
    """The metrics of one brain.

    Attributes
    ----------
    table : DataFrame
        hemisphere (whole, left or right), metric, value, unit: one row per number.
    maps : dict
        Per hemisphere ("left", "right", or the only one) arrays per vertex by name: shape_index, curvedness (1/mm),
        mean_curvature (1/mm), gaussian_curvature (1/mm²), sulcal_depth_mm, local_gyrification_index, thickness_mm
        (where it is known; NaN where not measured), spangy_dominant_band (−6 to 6), reliable (0 near a cut, else 1).
    spectra : DataFrame
        Per hemisphere and band: hemisphere, band, wavelength_min_mm, wavelength_max_mm, modes, power, relative_power,
        complete, denominator_complete, resolved, weyl_formula.
    coefficients : DataFrame
        Per hemisphere and mode: hemisphere, mode, eigenvalue_per_mm2, band (−1 beyond B6), coefficient (cᵢ, in mm, or
        without a unit for mean curvature).
    """

    table: pd.DataFrame
    maps: dict[str, dict[str, NDArray]]
    spectra: pd.DataFrame
    coefficients: pd.DataFrame


def measure_brain(
    whole: TriangleMesh,
    left: TriangleMesh | None,
    right: TriangleMesh | None,
    *,
    thickness_mm: Floats | None = None,
    label_volumes_ml: Mapping[str, float] | None = None,
    curvature_radius_mm: float = CURVATURE_RADIUS_MM,
    spangy_proxy: SpangyProxy = SPANGY_PROXY,
    spangy_modes: SpangyModes = SPANGY_MODES,
    spangy_wavelength: WeylFormula = SPANGY_WAVELENGTH,
    threads: int = 1,
) -> BrainMetrics:
    """Returns the metrics of a brain.

    Parameters
    ----------
    whole
        The closed pial surface, outward, in mm.
    left, right
        The pial surfaces of the hemispheres, closed, or open where a connected brain is cut at the fissure; None for a
        hemisphere that the brain does not have. A cut
        counts for the volume only. It is left out of area, gyrification, depth, curvature and spectrum, and depth and
        curvature within `curvature_radius_mm` of it out of the means. What is said of the whole but its volume and area
        is of both hemispheres: Σ area over Σ area of the hulls, and means over both.
    thickness_mm : (n,) float
        Cortical thickness at the vertices of `whole`, NaN where it was not measured; None where it is not known.
    label_volumes_ml
        Volumes of the labels inside the surface in mL, by name: those of `LABEL_VOLUMES` become metrics of the whole.
    curvature_radius_mm
        Radius of the balls that curvature is fitted in, see `curvature.curvature`.
    spangy_proxy
        What is analysed: "shape_index" as in the paper, or "mean_curvature" as in Germanaud et al. 2012.
    spangy_modes
        Which modes, see `mode_numbers.modes_of`.
    spangy_wavelength
        The formula of Weyl's number, see `spangy.weyl_number`.
    threads
        With two or more, the hemispheres are measured at the same time, each in a process of its own.

    Raises
    ------
    MeshError
        Where a surface looks inwards, or a hemisphere is not in one piece.
    """
    meshes = {name: mesh for name, mesh in (("left", left), ("right", right)) if mesh is not None}
    _check_outward((whole, *meshes.values()))
    settings = Settings(curvature_radius_mm, spangy_proxy, spangy_modes, spangy_wavelength)
    thicknesses = {
        name: None if thickness_mm is None else at_part(thickness_mm, whole, mesh) for name, mesh in meshes.items()
    }
    jobs = [(name, mesh, thicknesses[name], settings) for name, mesh in meshes.items()]
    sides = _measure_sides(jobs, threads)
    rows = [("whole", *row) for row in size_rows(whole, crossing_faces(whole)) + folding_rows(sides)]
    known = label_volumes_ml or {}
    rows += [("whole", metric, known[name], "mL") for metric, name in LABEL_VOLUMES.items() if name in known]
    for side in sides:
        own = size_rows(side.mesh, side.crossing) + folding_rows([side]) + spectrum_rows(side, spangy_proxy)
        rows += [(side.name, *row) for row in own]
    spectra = [side.spectrum.bands.assign(hemisphere=side.name, weyl_formula=spangy_wavelength) for side in sides]
    joined = pd.concat(spectra, ignore_index=True)
    return BrainMetrics(
        table=pd.DataFrame(rows, columns=["hemisphere", "metric", "value", "unit"]),
        maps={side.name: side.maps() for side in sides},
        spectra=joined[["hemisphere", *joined.columns.drop("hemisphere")]],
        coefficients=pd.concat([coefficient_table(side) for side in sides], ignore_index=True),
    )


def _measure_sides(jobs: list[tuple[str, TriangleMesh, Floats | None, Settings]], threads: int) -> list[Hemisphere]:
    """Returns the hemispheres, measured one after the other or each in a process: PETSc cannot be used by threads."""
    if threads == 1:
        return [measure_hemisphere(*job) for job in jobs]
    # forked, since a new interpreter would run the calling script again; what MPI leaves behind goes with the folder
    with (
        TemporaryDirectory(prefix="gyriflow-") as folder,
        ProcessPoolExecutor(
            min(threads, len(jobs)), get_context("fork"), os.environ.update, ({"TMPDIR": folder},)
        ) as pool,
    ):
        return list(pool.map(measure_hemisphere, *zip(*jobs, strict=True)))


def _check_outward(meshes: tuple[TriangleMesh, ...]) -> None:
    for mesh in meshes:
        volume_mm3 = signed_volume(cap(mesh))
        if volume_mm3 <= 0:
            raise MeshError(
                "the faces of the surface look inwards",
                found=f"volume {volume_mm3 * ML_PER_MM3:.3g} mL",
                expected="a positive volume",
                remedy="Turn the faces round",
            )
