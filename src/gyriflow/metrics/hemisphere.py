"""Everything that is measured on one hemisphere."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import MeshError
from ..geometry.crossings import crossing_faces
from ..geometry.triangles import Floats, TriangleMesh, area, mean_edge_length, signed_volume, vertex_areas
from ..parameters.metrics import (
    CURVATURE_RADIUS_MM,
    SPANGY_MODES,
    SPANGY_PROXY,
    SPANGY_WAVELENGTH,
    SpangyProxy,
    WeylFormula,
)
from ..units import CM2_PER_MM2, ML_PER_MM3
from .curvature import Curvature, continue_smoothly, curvature
from .depth import convex_hull, sulcal_depth
from .folding_measures import (
    folding_index,
    gaussian_curvature_norm,
    intrinsic_curvature_index,
    join,
    mean_curvature_norm,
    mean_curvature_quantiles,
)
from .gyrification import Pieces, cap, envelope, gyrification_index, local_gyrification_index, pieces_over
from .laplace_beltrami import laplacian
from .mode_numbers import SpangyModes, modes_of
from .spangy import Spectrum, first_eigenvalue, spectrum, weyl_number
from .thickness import thickness_metrics

Row = tuple[str, float, str]


@dataclass(frozen=True)
class Settings:
    """How hemispheres are measured; the names and values of the configuration's `metrics`."""

    curvature_radius_mm: float = CURVATURE_RADIUS_MM
    spangy_proxy: SpangyProxy = SPANGY_PROXY
    spangy_modes: SpangyModes = SPANGY_MODES
    spangy_wavelength: WeylFormula = SPANGY_WAVELENGTH


@dataclass(frozen=True, eq=False)
class Hemisphere:
    """A hemisphere of n vertices and what was measured on it.

    Attributes
    ----------
    name
        "left" or "right".
    hull, envelope
        What is around it, without what lies over cuts.
    depth, local_gyrification, thickness : (n,) float
        Sulcal depth and cortical thickness in mm; thickness is NaN where it is not known.
    crossing
        Number of faces that cut others.
    weyl
        Weyl's number of modes.
    """

    name: str
    mesh: TriangleMesh
    bend: Curvature
    hull: Pieces
    envelope: Pieces
    depth: Floats
    local_gyrification: Floats
    thickness: Floats
    crossing: int
    spectrum: Spectrum
    weyl: int

    def maps(self) -> dict[str, NDArray]:
        """Returns the arrays per vertex by name, as in `measure.BrainMetrics.maps`."""
        known = {} if np.isnan(self.thickness).all() else {"thickness_mm": self.thickness}
        return {
            "shape_index": self.bend.shape_index,
            "curvedness": self.bend.curvedness,
            "mean_curvature": self.bend.mean,
            "gaussian_curvature": self.bend.gaussian,
            "sulcal_depth_mm": self.depth,
            "local_gyrification_index": self.local_gyrification,
            **known,
            "spangy_dominant_band": self.spectrum.dominant_band,
            "reliable": self.bend.reliable.astype(np.int32),
        }


def measure_hemisphere(name: str, mesh: TriangleMesh, thickness: Floats | None, settings: Settings) -> Hemisphere:
    """Returns what is measured on a hemisphere, "left" or "right"; `thickness` in mm at its vertices, if known."""
    hull, wrap = convex_hull(mesh), envelope(mesh)
    bend = curvature(mesh, radius_mm=settings.curvature_radius_mm)
    analysis, weyl = _spectrum(name, mesh, bend, settings)
    around = pieces_over(wrap, mesh)
    return Hemisphere(
        name=name,
        mesh=mesh,
        bend=bend,
        hull=pieces_over(hull, mesh),
        envelope=around,
        depth=sulcal_depth(mesh, hull),
        local_gyrification=local_gyrification_index(mesh, around),
        thickness=np.full(len(mesh.vertices), np.nan) if thickness is None else np.asarray(thickness, dtype=float),
        crossing=crossing_faces(mesh),
        spectrum=analysis,
        weyl=weyl,
    )


def _spectrum(name: str, mesh: TriangleMesh, bend: Curvature, settings: Settings) -> tuple[Spectrum, int]:
    """Returns the spectrum of the proxy and Weyl's number; near a cut the proxy is continued from beyond."""
    formula = settings.spangy_wavelength
    stiffness, mass = laplacian(mesh)
    first = first_eigenvalue(stiffness, mass)
    modes, reach = modes_of(settings.spangy_modes, name, mesh, stiffness, mass, first, formula)
    proxy = bend.shape_index if settings.spangy_proxy == "shape_index" else bend.mean
    values = continue_smoothly(proxy, bend.reliable, stiffness)
    analysis = spectrum(values, modes, mass, edge_length_mm=mean_edge_length(mesh), reach=reach)
    return analysis, weyl_number(area(mesh), first, formula)


def size_rows(mesh: TriangleMesh, crossing: int) -> list[Row]:
    """Returns the rows of size of a hemisphere or of the whole, and the number of faces that cut others."""
    return [
        ("volume", signed_volume(cap(mesh)) * ML_PER_MM3, "mL"),
        ("area", area(mesh) * CM2_PER_MM2, "cm2"),
        ("crossing_faces", float(crossing), "1"),
    ]


def folding_rows(sides: list[Hemisphere]) -> list[Row]:
    """Returns the rows of folding of one hemisphere, or of a brain's two together; what is near cuts is left out.

    Indices are of both hemispheres' areas, each in its own hull; means are over the vertices of both, by area.
    """
    meshes = [side.mesh for side in sides]
    areas = np.concatenate([vertex_areas(mesh) for mesh in meshes])
    bend = join([side.bend for side in sides])
    weights = areas * bend.reliable
    if not weights.any():
        raise MeshError(
            "no curvature away from the cut",
            found="every vertex has the edge of the surface within its radius",
            remedy="Lower metrics.curvature_radius_mm",
        )

    def mean(values: NDArray) -> float:
        return float(np.average(values, weights=weights))

    depth = np.concatenate([side.depth for side in sides])
    deep = np.quantile(depth, 0.95, weights=weights, method="inverted_cdf")
    return [
        ("gyrification_index", gyrification_index(meshes, [side.hull for side in sides]), "1"),
        ("gyrification_index_envelope", gyrification_index(meshes, [side.envelope for side in sides]), "1"),
        ("mean_shape_index", mean(bend.shape_index), "1"),
        ("mean_curvedness", mean(bend.curvedness), "1/mm"),
        ("sulcal_area_share", mean(bend.shape_index < 0), "1"),
        ("curvature_radius", mean(bend.radius_mm), "mm"),
        ("mean_sulcal_depth", mean(depth), "mm"),
        ("sulcal_depth_95", float(deep), "mm"),
        ("intrinsic_curvature_index", intrinsic_curvature_index(bend, weights), "1"),
        ("folding_index", folding_index(bend, weights), "1"),
        ("mean_curvature_norm", mean_curvature_norm(bend, weights), "1"),
        ("gaussian_curvature_norm", gaussian_curvature_norm(bend, weights), "1"),
        *((name, value, "1/mm") for name, value in mean_curvature_quantiles(bend, weights).items()),
        *thickness_metrics(np.concatenate([side.thickness for side in sides]), areas),
    ]


def spectrum_rows(side: Hemisphere, proxy: SpangyProxy) -> list[Row]:
    """Returns the rows of a hemisphere's spectrum.

    A band that is cut off has NaN, and relative powers are NaN where a band that they are shares of is cut off:
    `spectra` has all values with their flags.
    """
    unit = "mm2" if proxy == "shape_index" else "1"
    bands = side.spectrum.bands
    power = bands["power"].where(bands["complete"])
    share = bands["relative_power"].where(bands["complete"] & bands["denominator_complete"])
    rows: list[Row] = []
    for band in bands["band"]:
        rows.append((f"spangy_B{band}_power", float(power[band]), unit))
        if band > 0:
            rows.append((f"spangy_B{band}_relative_power", float(share[band]), "1"))
    return [
        *rows,
        ("spangy_modes", float(len(side.spectrum.eigenvalues)), "1"),
        ("spangy_captured_share", side.spectrum.captured, "1"),
        ("weyl_number", float(side.weyl), "1"),
    ]


def coefficient_table(side: Hemisphere) -> pd.DataFrame:
    """Returns the coefficients of the modes of a hemisphere, as in `measure.BrainMetrics.coefficients`."""
    analysis = side.spectrum
    return pd.DataFrame(
        {
            "hemisphere": side.name,
            "mode": np.arange(len(analysis.eigenvalues)),
            "eigenvalue_per_mm2": analysis.eigenvalues,
            "band": analysis.band,
            "coefficient": analysis.coefficients,
        }
    )
