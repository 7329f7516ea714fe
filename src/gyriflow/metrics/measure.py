"""All metrics of one brain."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import MeshError
from ..geometry.triangles import TriangleMesh, area, mean_edge_length, signed_volume, vertex_areas
from ..units import CM2_PER_MM2, ML_PER_MM3
from .curvature import Curvature, continued, curvature
from .gyrification import capped, convex_hull, envelope, gyrification_index
from .laplace_beltrami import laplacian, lowest_modes
from .spangy import Spectrum, WeylFormula, first_eigenvalue, number_of_modes, spectrum, weyl_number

SpangyProxy = Literal["shape_index", "mean_curvature"]


@dataclass(frozen=True, eq=False)
class BrainMetrics:
    """The metrics of one brain.

    Attributes
    ----------
    table : DataFrame
        hemisphere (whole, left or right), metric, value, unit: one row per number.
    maps : dict
        Per hemisphere ("left", "right") arrays per vertex by name: shape_index, curvedness (1/mm), mean_curvature
        (1/mm), gaussian_curvature (1/mm²), spangy_dominant_band (−6 to 6).
    spectra : DataFrame
        Per hemisphere and band: hemisphere, band, wavelength_min_mm, wavelength_max_mm, modes, power, relative_power,
        complete, resolved, weyl_formula.
    """

    table: pd.DataFrame
    maps: dict[str, dict[str, NDArray]]
    spectra: pd.DataFrame


def measure_brain(
    whole: TriangleMesh,
    left: TriangleMesh,
    right: TriangleMesh,
    *,
    curvature_radius: int = 3,
    spangy_proxy: SpangyProxy = "shape_index",
    spangy_modes: int | None = None,
    spangy_wavelength: WeylFormula = "paper",
) -> BrainMetrics:
    """Returns the metrics of a brain.

    Parameters
    ----------
    whole
        The closed pial surface, outward, in mm.
    left, right
        The pial surfaces of the hemispheres, closed, or open where a connected brain is cut at the fissure. A cut
        counts for the volume only. It is left out of area, gyrification, curvature and spectrum, and curvature within
        `curvature_radius` rings of it out of the means. The means of the whole are those over both hemispheres.
    curvature_radius
        Rings of neighbours that curvature is fitted to.
    spangy_proxy
        What is analysed: "shape_index" as in the paper, or "mean_curvature" as in Germanaud et al. 2012.
    spangy_modes
        Number of modes, the same for all brains that are compared; None for Weyl's number of each hemisphere, at most
        a tenth of its vertices.
    spangy_wavelength
        The formula of Weyl's number, see `spangy.weyl_number`.

    MeshError where a surface looks inwards, or a hemisphere is not in one piece.
    """
    bends = [curvature(mesh, rings=curvature_radius) for mesh in (left, right)]
    whole_rows = [*_global_metrics(whole), *_curvature_means([left, right], bends)]
    rows = [("whole", *row) for row in whole_rows]
    maps, spectra = {}, []
    for name, mesh, bend in zip(("left", "right"), (left, right), bends, strict=True):
        analysis, weyl = _spectrum(mesh, bend, spangy_proxy, spangy_modes, spangy_wavelength)
        own = _global_metrics(mesh) + _curvature_means([mesh], [bend]) + _spectrum_metrics(analysis, spangy_proxy)
        rows += [(name, *row) for row in [*own, ("weyl_number", float(weyl), "1")]]
        maps[name] = {
            "shape_index": bend.shape_index,
            "curvedness": bend.curvedness,
            "mean_curvature": bend.mean,
            "gaussian_curvature": bend.gaussian,
            "spangy_dominant_band": analysis.dominant_band,
        }
        spectra.append(analysis.bands.assign(weyl_formula=spangy_wavelength))
        spectra[-1].insert(0, "hemisphere", name)
    return BrainMetrics(
        table=pd.DataFrame(rows, columns=["hemisphere", "metric", "value", "unit"]),
        maps=maps,
        spectra=pd.concat(spectra, ignore_index=True),
    )


Row = tuple[str, float, str]


def _global_metrics(mesh: TriangleMesh) -> list[Row]:
    volume_mm3 = signed_volume(capped(mesh))
    if volume_mm3 <= 0:
        raise MeshError(
            "the faces of the surface look inwards",
            found=f"volume {volume_mm3 * ML_PER_MM3:.3g} mL",
            expected="a positive volume",
            remedy="Turn the faces round",
        )
    return [
        ("volume", volume_mm3 * ML_PER_MM3, "mL"),
        ("area", area(mesh) * CM2_PER_MM2, "cm2"),
        ("gyrification_index", gyrification_index(mesh, convex_hull(mesh)), "1"),
        ("gyrification_index_envelope", gyrification_index(mesh, envelope(mesh)), "1"),
    ]


def _curvature_means(meshes: list[TriangleMesh], bends: list[Curvature]) -> list[Row]:
    weights = np.concatenate([vertex_areas(m) * bend.reliable for m, bend in zip(meshes, bends, strict=True)])
    shape_index = np.concatenate([bend.shape_index for bend in bends])
    curvedness = np.concatenate([bend.curvedness for bend in bends])
    return [
        ("mean_shape_index", float(np.average(shape_index, weights=weights)), "1"),
        ("mean_curvedness", float(np.average(curvedness, weights=weights)), "1/mm"),
        ("sulcal_area_share", float(np.average(shape_index < 0, weights=weights)), "1"),
    ]


def _spectrum(
    mesh: TriangleMesh, bend: Curvature, proxy: SpangyProxy, count: int | None, formula: WeylFormula
) -> tuple[Spectrum, int]:
    """Returns the spectrum of the proxy and Weyl's number; near a cut the proxy is continued from beyond."""
    stiffness, mass = laplacian(mesh)
    first = first_eigenvalue(stiffness, mass)
    if count is None:
        count = number_of_modes(area(mesh), len(mesh.vertices), first, formula)
    values = continued(bend.shape_index if proxy == "shape_index" else bend.mean, bend.reliable, stiffness)
    modes = lowest_modes(stiffness, mass, count)
    return spectrum(values, modes, mass, edge_length_mm=mean_edge_length(mesh)), weyl_number(area(mesh), first, formula)


def _spectrum_metrics(analysis: Spectrum, proxy: SpangyProxy) -> list[Row]:
    unit = "mm2" if proxy == "shape_index" else "1"
    bands = analysis.bands
    rows: list[Row] = []
    for band, power, share in zip(bands["band"], bands["power"], bands["relative_power"], strict=True):
        rows.append((f"spangy_B{band}_power", float(power), unit))
        if band > 0:
            rows.append((f"spangy_B{band}_relative_power", float(share), "1"))
    return [
        *rows,
        ("spangy_modes", float(len(analysis.eigenvalues)), "1"),
        ("spangy_captured_share", analysis.captured, "1"),
    ]
