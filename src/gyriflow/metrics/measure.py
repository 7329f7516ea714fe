"""All metrics of one brain."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import MeshError
from ..geometry.crossings import crossing_faces
from ..geometry.triangles import Floats, TriangleMesh, area, mean_edge_length, signed_volume, vertex_areas
from ..units import CM2_PER_MM2, ML_PER_MM3
from .curvature import RADIUS_MM, Curvature, continued, curvature
from .gyrification import capped, convex_hull, envelope, gyrification_index, sulcal_depth
from .laplace_beltrami import laplacian, lowest_modes
from .mode_numbers import SpangyModes, modes_wanted
from .spangy import Spectrum, WeylFormula, first_eigenvalue, spectrum, weyl_number

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
        (1/mm), gaussian_curvature (1/mm²), sulcal_depth_mm, spangy_dominant_band (−6 to 6).
    spectra : DataFrame
        Per hemisphere and band: hemisphere, band, wavelength_min_mm, wavelength_max_mm, modes, power, relative_power,
        complete, resolved, weyl_formula.
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
    left: TriangleMesh,
    right: TriangleMesh,
    *,
    curvature_radius_mm: float = RADIUS_MM,
    spangy_proxy: SpangyProxy = "shape_index",
    spangy_modes: SpangyModes = "B5",
    spangy_wavelength: WeylFormula = "paper",
    threads: int = 1,
) -> BrainMetrics:
    """Returns the metrics of a brain.

    Parameters
    ----------
    whole
        The closed pial surface, outward, in mm.
    left, right
        The pial surfaces of the hemispheres, closed, or open where a connected brain is cut at the fissure. A cut
        counts for the volume only. It is left out of area, gyrification, curvature and spectrum, and curvature within
        `curvature_radius_mm` of it out of the means. The means of the whole are those over both hemispheres.
    curvature_radius_mm
        Radius of the balls that curvature is fitted in, see `curvature.curvature`.
    spangy_proxy
        What is analysed: "shape_index" as in the paper, or "mean_curvature" as in Germanaud et al. 2012.
    spangy_modes
        Number of modes, see `mode_numbers.modes_wanted`.
    spangy_wavelength
        The formula of Weyl's number, see `spangy.weyl_number`.
    threads
        Threads that the modes are computed with.

    MeshError where a surface looks inwards, or a hemisphere is not in one piece.
    """
    bends = [curvature(mesh, radius_mm=curvature_radius_mm) for mesh in (left, right)]
    surfaces = (whole, left, right)
    _check_outward(surfaces)
    outsides = [envelope(mesh) for mesh in surfaces]
    depths = [sulcal_depth(*pair) for pair in zip((left, right), outsides[1:], strict=True)]
    whole_rows = _global_metrics(whole, outsides[0]) + _local_means([left, right], bends, depths)
    rows = [("whole", *row) for row in whole_rows]
    maps, spectra, coefficients = {}, [], []
    parts = zip(("left", "right"), (left, right), outsides[1:], bends, depths, strict=True)
    for name, mesh, outside, bend, depth in parts:
        analysis, weyl = _spectrum(name, mesh, bend, spangy_proxy, spangy_modes, spangy_wavelength, threads)
        own = _global_metrics(mesh, outside) + _local_means([mesh], [bend], [depth])
        own += _spectrum_metrics(analysis, spangy_proxy)
        rows += [(name, *row) for row in [*own, ("weyl_number", float(weyl), "1")]]
        maps[name] = {
            "shape_index": bend.shape_index,
            "curvedness": bend.curvedness,
            "mean_curvature": bend.mean,
            "gaussian_curvature": bend.gaussian,
            "sulcal_depth_mm": depth,
            "spangy_dominant_band": analysis.dominant_band,
        }
        spectra.append(analysis.bands.assign(weyl_formula=spangy_wavelength))
        spectra[-1].insert(0, "hemisphere", name)
        coefficients.append(_coefficient_table(name, analysis))
    return BrainMetrics(
        table=pd.DataFrame(rows, columns=["hemisphere", "metric", "value", "unit"]),
        maps=maps,
        spectra=pd.concat(spectra, ignore_index=True),
        coefficients=pd.concat(coefficients, ignore_index=True),
    )


Row = tuple[str, float, str]


def _check_outward(meshes: tuple[TriangleMesh, ...]) -> None:
    for mesh in meshes:
        volume_mm3 = signed_volume(capped(mesh))
        if volume_mm3 <= 0:
            raise MeshError(
                "the faces of the surface look inwards",
                found=f"volume {volume_mm3 * ML_PER_MM3:.3g} mL",
                expected="a positive volume",
                remedy="Turn the faces round",
            )


def _global_metrics(mesh: TriangleMesh, outside: TriangleMesh) -> list[Row]:
    """Returns the rows of a surface and its envelope."""
    return [
        ("volume", signed_volume(capped(mesh)) * ML_PER_MM3, "mL"),
        ("area", area(mesh) * CM2_PER_MM2, "cm2"),
        ("gyrification_index", gyrification_index(mesh, convex_hull(mesh)), "1"),
        ("gyrification_index_envelope", gyrification_index(mesh, outside), "1"),
        ("crossing_faces", float(crossing_faces(mesh)), "1"),
    ]


def _local_means(meshes: list[TriangleMesh], bends: list[Curvature], depths: list[Floats]) -> list[Row]:
    """Returns the rows that are means over vertices, those near cuts left out of curvature."""
    areas = np.concatenate([vertex_areas(mesh) for mesh in meshes])
    weights = areas * np.concatenate([bend.reliable for bend in bends])
    if not weights.any():
        raise MeshError(
            "no curvature away from the cut",
            found="every vertex has the edge of the surface within its radius",
            remedy="Lower metrics.curvature_radius_mm",
        )
    shape_index = np.concatenate([bend.shape_index for bend in bends])
    curvedness = np.concatenate([bend.curvedness for bend in bends])
    radius = np.concatenate([bend.radius_mm for bend in bends])
    depth = np.concatenate(depths)
    deep = np.quantile(depth, 0.95, weights=areas, method="inverted_cdf")
    return [
        ("mean_shape_index", float(np.average(shape_index, weights=weights)), "1"),
        ("mean_curvedness", float(np.average(curvedness, weights=weights)), "1/mm"),
        ("sulcal_area_share", float(np.average(shape_index < 0, weights=weights)), "1"),
        ("curvature_radius", float(np.average(radius, weights=weights)), "mm"),
        ("mean_sulcal_depth", float(np.average(depth, weights=areas)), "mm"),
        ("sulcal_depth_95", float(deep), "mm"),
    ]


def _spectrum(
    name: str,
    mesh: TriangleMesh,
    bend: Curvature,
    proxy: SpangyProxy,
    choice: SpangyModes,
    formula: WeylFormula,
    threads: int,
) -> tuple[Spectrum, int]:
    """Returns the spectrum of the proxy and Weyl's number; near a cut the proxy is continued from beyond."""
    stiffness, mass = laplacian(mesh)
    first = first_eigenvalue(stiffness, mass)
    count = modes_wanted(choice, name, mesh, stiffness, mass, first, formula)
    values = continued(bend.shape_index if proxy == "shape_index" else bend.mean, bend.reliable, stiffness)
    modes = lowest_modes(stiffness, mass, count, threads=threads)
    return spectrum(values, modes, mass, edge_length_mm=mean_edge_length(mesh)), weyl_number(area(mesh), first, formula)


def _coefficient_table(name: str, analysis: Spectrum) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "hemisphere": name,
            "mode": np.arange(len(analysis.eigenvalues)),
            "eigenvalue_per_mm2": analysis.eigenvalues,
            "band": analysis.band,
            "coefficient": analysis.coefficients,
        }
    )


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
