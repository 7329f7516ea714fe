"""Measure a brain: the metrics of its surfaces and the maps over them.

A metric is an entry of `size_metrics` (any surface), `folding_metrics` (one hemisphere or both), `thickness_metrics` or
`spectrum_metrics` (one hemisphere); a map is an entry of `Folds.maps` or `Hemisphere.maps`. Each has a record in
`gyriflow.quantities`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import MeshError
from ..geometry.diffusion import harmonic_continuation
from ..geometry.matching import crossing_faces
from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    area,
    area_cm2,
    convex_hull,
    signed_volume,
    vertex_areas,
    volume_ml,
)
from ..quantities import METRICS, Shown, metrics_shown
from ..settings.terms import CURVATURE_RADIUS_MM, PROXIES, SPANGY_MODES, SPECTRUM_PREFIXES
from ..units import CM2_PER_MM2, ML_PER_MM3
from .curvature import RESOLVED_RADII, Curvature, curvature, curvature_integrals, join, mean_curvature_quantiles
from .gyrification import Pieces, cap, envelope, gyrification_index, local_gyrification_index, pieces_over, sulcal_depth
from .laplace_beltrami import laplacian
from .spangy import SpangyModes, Spectrum, first_eigenvalue, modes_of, spectrum, weyl_number
from .thickness import at_part

type Metrics = dict[str, float]
"""Values by the names of their records, in their units."""

LABEL_VOLUMES = {"volume_tissue": "tissue", "volume_ventricles": "ventricles", "volume_cortex": "cortex"}
"""The metrics that are volumes of labels, and what these are called in the reports of surfaces."""


@dataclass(frozen=True, eq=False)
class Folds:
    """The folds of a hemisphere's surface of n vertices, pial or white.

    Hull and envelope are without what lies over cuts; depth (in mm) and local gyrification are (n,).
    """

    mesh: TriangleMesh
    curvature_maps: Curvature
    hull: Pieces
    envelope: Pieces
    depth: Floats
    local_gyrification: Floats

    def maps(self) -> dict[str, NDArray]:
        """Return the arrays per vertex by name, of those in `BrainMetrics.maps`."""
        return {
            "shape_index": self.curvature_maps.shape_index,
            "curvedness": self.curvature_maps.curvedness,
            "mean_curvature": self.curvature_maps.mean,
            "gaussian_curvature": self.curvature_maps.gaussian,
            "sulcal_depth_mm": self.depth,
            "local_gyrification_index": self.local_gyrification,
            "reliable": self.curvature_maps.reliable.astype(np.int32),
        }


@dataclass(frozen=True, eq=False)
class Hemisphere(Folds):
    """A hemisphere of n vertices, "left" or "right", with its measures other than folds.

    Thickness is (n,), in mm, NaN where it is not known; `crossing` is the number of faces that cut others, `spectra`
    has a spectrum for each of the `PROXIES`, `weyl` is Weyl's number of modes.
    """

    name: str
    thickness: Floats
    crossing: int
    spectra: Mapping[str, Spectrum]
    weyl: int

    def maps(self) -> dict[str, NDArray]:
        """Return the arrays per vertex by name, as in `BrainMetrics.maps`."""
        thickness = {} if np.isnan(self.thickness).all() else {"thickness_mm": self.thickness}
        bands = {f"spangy_{SPECTRUM_PREFIXES[name]}dominant_band": x.dominant_band for name, x in self.spectra.items()}
        return {**super().maps(), **thickness, **bands}


def measure_folds(mesh: TriangleMesh, curvature_radius_mm: float) -> Folds:
    """Return the folds of a hemisphere's surface; see `curvature.curvature` for the radius."""
    hull, around = convex_hull(mesh), pieces_over(envelope(mesh), mesh)
    return Folds(
        mesh=mesh,
        curvature_maps=curvature(mesh, radius_mm=curvature_radius_mm),
        hull=pieces_over(hull, mesh),
        envelope=around,
        depth=sulcal_depth(mesh, hull),
        local_gyrification=local_gyrification_index(mesh, around),
    )


def measure_hemisphere(
    name: str, mesh: TriangleMesh, thickness: Floats | None, curvature_radius_mm: float, spangy_modes: SpangyModes
) -> Hemisphere:
    """Measure a hemisphere, "left" or "right"; `thickness` in mm at its vertices, if known."""
    folds = measure_folds(mesh, curvature_radius_mm)
    spectra = hemisphere_spectra(mesh, folds.curvature_maps, spangy_modes)
    return Hemisphere(
        **vars(folds),
        name=name,
        thickness=np.full(len(mesh.vertices), np.nan) if thickness is None else np.asarray(thickness, dtype=float),
        crossing=crossing_faces(mesh),
        spectra=spectra,
        weyl=weyl_number(area(mesh), float(spectra[PROXIES[0]].eigenvalues[1])),
    )


def hemisphere_spectra(mesh: TriangleMesh, curvature_maps: Curvature, spangy_modes: SpangyModes) -> dict[str, Spectrum]:
    """Return the spectrum of each of the `PROXIES` of a hemisphere, all on the same modes."""
    stiffness, mass = laplacian(mesh)
    modes, reach = modes_of(spangy_modes, stiffness, mass, first_eigenvalue(stiffness, mass))
    # values near a cut are not reliable and are replaced by a harmonic continuation
    reliable = np.flatnonzero(curvature_maps.reliable)
    values = np.column_stack([curvature_maps.mean, curvature_maps.shape_index])[reliable]
    maps = harmonic_continuation(mesh.vertices, mesh.faces, reliable, tolerance=1e-12)(values).T
    radius = float(curvature_maps.radius_mm.mean())
    return {
        proxy: spectrum(proxy_map, modes, mass, radius_mm=radius, reach=reach)
        for proxy, proxy_map in zip(PROXIES, maps, strict=True)
    }


def surface_spectra(
    left: TriangleMesh | None, right: TriangleMesh | None, radius_mm: float, spangy_modes: SpangyModes
) -> pd.DataFrame:
    """Return the spectra of the hemispheres of a brain, as in `BrainMetrics.spectra`."""
    return _stacked(
        {
            name: band_table(hemisphere_spectra(mesh, curvature(mesh, radius_mm=radius_mm), spangy_modes))
            for name, mesh in (("left", left), ("right", right))
            if mesh is not None
        }
    )


def band_table(spectra: Mapping[str, Spectrum]) -> pd.DataFrame:
    """Return the columns proxy and those of `Spectrum.bands`, a row per proxy and band."""
    return _stacked({proxy: spectrum.bands for proxy, spectrum in spectra.items()}, "proxy")


def _mode_table(spectra: Mapping[str, Spectrum]) -> pd.DataFrame:
    part = spectra[PROXIES[0]]
    modes = {"mode": np.arange(len(part.band)), "eigenvalue_per_mm2": part.eigenvalues, "band": part.band}
    return pd.DataFrame(modes | {f"coefficient_{proxy}": part.coefficients for proxy, part in spectra.items()})


def size_metrics(mesh: TriangleMesh, crossing: int) -> Metrics:
    """Return volume and area of a hemisphere or of the whole, their ratio, and the number of faces that cut others."""
    volume, area_of_mesh = volume_ml(cap(mesh)), area_cm2(mesh)
    relative = area_of_mesh / volume ** (2 / 3) if volume > 0 else np.nan
    return {"volume": volume, "area": area_of_mesh, "relative_area": relative, "crossing_faces": float(crossing)}


def folding_metrics(sides: Sequence[Folds]) -> Metrics:
    """Return the metrics of folding of one hemisphere, or of both together; vertices near cuts are left out.

    Indices are of both hemispheres' areas, each in its own hull; means are over the vertices of both, by area.
    """
    meshes = [side.mesh for side in sides]
    areas = np.concatenate([vertex_areas(mesh) for mesh in meshes])
    curvature_maps = join([side.curvature_maps for side in sides])
    weights = areas * curvature_maps.reliable
    if not weights.any():
        reason = "every vertex has the edge of the surface within its radius"
        raise MeshError("no curvature away from the cut", found=reason, remedy="Lower metrics.curvature_radius_mm.")

    def mean(values: NDArray) -> float:
        return float(np.average(values, weights=weights))

    depth = np.concatenate([side.depth for side in sides])
    deep = np.quantile(depth, 0.95, weights=weights, method="inverted_cdf")
    return {
        "gyrification_index": gyrification_index(meshes, [side.hull for side in sides]),
        "gyrification_index_envelope": gyrification_index(meshes, [side.envelope for side in sides]),
        "mean_shape_index": mean(curvature_maps.shape_index),
        "mean_curvedness": mean(curvature_maps.curvedness),
        "sulcal_area_share": mean(curvature_maps.shape_index < 0),
        "curvature_radius": mean(curvature_maps.radius_mm),
        "curvature_wavelength": RESOLVED_RADII * mean(curvature_maps.radius_mm),
        "mean_sulcal_depth": mean(depth),
        "sulcal_depth_95": float(deep),
        **curvature_integrals(curvature_maps, weights),
        **mean_curvature_quantiles(curvature_maps, weights),
    }


def thickness_metrics(values: Floats, areas: Floats) -> Metrics:
    """Return the metrics of thickness at (n,) vertices, NaN where it was not measured, weighted by area.

    Empty where it was measured nowhere.
    """
    is_measured = np.isfinite(values)
    if not is_measured.any():
        return {}
    selected, weights = values[is_measured], areas[is_measured]
    mean = float(np.average(selected, weights=weights))
    low, high = np.quantile(selected, [0.05, 0.95], weights=weights, method="inverted_cdf")
    return {
        "mean_thickness": mean,
        "thickness_sd": float(np.sqrt(np.average((selected - mean) ** 2, weights=weights))),
        "thickness_q05": float(low),
        "thickness_q95": float(high),
        "thickness_measured_share": float(weights.sum() / areas.sum()),
    }


def area_ratio(whole: Metrics) -> Metrics:
    """Return the pial area over the area of a sheet of cortex, or nothing where cortex or thickness is not known.

    A cortical sheet of volume V and thickness H has the area V/H in its middle and a larger one outside: a ratio much
    below 1 means fused sulci.
    """
    if not {"volume_cortex", "mean_thickness"} <= set(whole):
        return {}
    sheet_cm2 = whole["volume_cortex"] / ML_PER_MM3 / whole["mean_thickness"] * CM2_PER_MM2
    return {"area_ratio": whole["area"] / sheet_cm2}


def spectrum_metrics(side: Hemisphere) -> Metrics:
    """Return the metrics of a hemisphere's spectra.

    A band that is cut off has NaN, and relative powers are NaN where a band that they are shares of is cut off:
    `spectra` has all values with their flags.
    """
    metrics: Metrics = {"spangy_modes": float(len(side.spectra[PROXIES[0]].band)), "weyl_number": float(side.weyl)}
    for proxy, found in side.spectra.items():
        bands, name = found.bands, f"spangy_{SPECTRUM_PREFIXES[proxy]}"
        power = bands["power"].where(bands["complete"])
        share = bands["relative_power"].where(bands["complete"] & bands["denominator_complete"])
        metrics |= {f"{name}B{band}_power": float(power[band]) for band in bands["band"]}
        metrics |= {f"{name}B{band}_relative_power": float(share[band]) for band in bands["band"][1:]}
        metrics[f"{name}captured_share"] = found.captured
    return metrics


def _folding_and_thickness(sides: Sequence[Hemisphere]) -> Metrics:
    areas = np.concatenate([vertex_areas(side.mesh) for side in sides])
    return folding_metrics(sides) | thickness_metrics(np.concatenate([side.thickness for side in sides]), areas)


def _table(parts: Mapping[str, Metrics]) -> pd.DataFrame:
    """Return metrics by hemisphere as a table with the units of their records."""
    rows = [
        (hemisphere, name, value, METRICS[name].unit)
        for hemisphere, metrics in parts.items()
        for name, value in metrics.items()
    ]
    return pd.DataFrame(rows, columns=["hemisphere", "metric", "value", "unit"])


@dataclass(frozen=True, eq=False)
class BrainMetrics:
    """The metrics of one brain.

    `table` has a row per number: hemisphere (whole, left or right), metric, value, unit. `maps` has per hemisphere
    ("left", "right", or the only one) arrays per vertex by name: shape_index, curvedness (1/mm), mean_curvature (1/mm),
    gaussian_curvature (1/mm²), sulcal_depth_mm, local_gyrification_index, thickness_mm (where it is known; NaN where
    not measured), spangy_dominant_band and spangy_shape_index_dominant_band (−6 to 6; by mean curvature and by shape
    index), reliable (0 near a cut, else 1). `spectra` has a row per hemisphere, proxy and band with the columns of
    `Spectrum.bands`. `coefficients` has a row per hemisphere and mode: hemisphere, mode, eigenvalue_per_mm2, band (−1
    beyond B6), coefficient_mean_curvature (cᵢ, no unit), coefficient_shape_index (in mm).
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
    spangy_modes: SpangyModes = SPANGY_MODES,
) -> BrainMetrics:
    """Measure a brain.

    A cut counts for the volume only. It is left out of area, gyrification, depth, curvature and spectrum, and depth and
    curvature within `curvature_radius_mm` of it out of the means. Except for volume and area, values of the whole
    are those of both hemispheres: Σ area over Σ area of the hulls, and means over both.

    Parameters
    ----------
    whole
        The closed pial surface, outward, in mm.
    left, right
        The pial surfaces of the hemispheres, closed, or open where a connected brain is cut at the fissure; None for a
        hemisphere that the brain does not have.
    thickness_mm : (n,) float
        Cortical thickness at the vertices of `whole`, NaN where it was not measured; None where it is not known.
    label_volumes_ml
        Volumes of the labels inside the surface in mL, by name: those of `LABEL_VOLUMES` become metrics of the whole.
    curvature_radius_mm, spangy_modes
        See `curvature.curvature` and `spangy.modes_of`.

    Raises
    ------
    MeshError
        Where a surface looks inwards, or a hemisphere is not in one piece.
    """
    meshes = {name: mesh for name, mesh in (("left", left), ("right", right)) if mesh is not None}
    _require_outward(whole, *meshes.values())
    sides = []
    for name, mesh in meshes.items():
        thickness = None if thickness_mm is None else at_part(thickness_mm, whole, mesh)
        sides.append(measure_hemisphere(name, mesh, thickness, curvature_radius_mm, spangy_modes))
    volumes = {metric: (label_volumes_ml or {}).get(name) for metric, name in LABEL_VOLUMES.items()}
    whole_metrics = size_metrics(whole, crossing_faces(whole)) | _folding_and_thickness(sides)
    # without caps of medial walls
    whole_metrics["area"] = sum(area_cm2(side.mesh) for side in sides)
    whole_metrics |= {metric: volume for metric, volume in volumes.items() if volume is not None}
    metrics = {"whole": whole_metrics | area_ratio(whole_metrics)}
    for side in sides:
        sizes = size_metrics(side.mesh, side.crossing)
        metrics[side.name] = sizes | _folding_and_thickness([side]) | spectrum_metrics(side)
    return BrainMetrics(
        table=_table(metrics),
        maps={side.name: side.maps() for side in sides},
        spectra=_stacked({side.name: band_table(side.spectra) for side in sides}),
        coefficients=_stacked({side.name: _mode_table(side.spectra) for side in sides}),
    )


def _require_outward(*meshes: TriangleMesh) -> None:
    for mesh in meshes:
        if (volume_mm3 := signed_volume(cap(mesh))) <= 0:
            volume = f"volume {volume_mm3 * ML_PER_MM3:.3g} mL"
            raise MeshError("the faces of the surface look inwards", found=volume, remedy="Turn the faces round.")


def _stacked(tables: Mapping[str, pd.DataFrame], name: str = "hemisphere") -> pd.DataFrame:
    return pd.concat(tables, names=[name, None]).reset_index(name).reset_index(drop=True)


def measure_white(
    sides: Mapping[str, TriangleMesh], curvature_radius_mm: float = CURVATURE_RADIUS_MM
) -> tuple[pd.DataFrame, dict[str, dict[str, NDArray]]]:
    """Return the metrics and the maps of the white surfaces of "left" and "right", or of the only hemisphere.

    They are measured as pial ones are. The table has hemisphere, metric, value and unit of the metrics that are shown
    of white surfaces, the names with `white_` in front; the maps are those of `Folds` per hemisphere.
    """
    folds = {name: measure_folds(mesh, curvature_radius_mm) for name, mesh in sides.items()}
    metrics = {}
    for name, parts in {"whole": list(folds.values()), **{name: [part] for name, part in folds.items()}}.items():
        values = {"area": sum(area(part.mesh) for part in parts) * CM2_PER_MM2} | folding_metrics(parts)
        metrics[name] = {f"white_{metric}": values[metric] for metric in metrics_shown(Shown.WHITE)}
    return _table(metrics), {name: part.maps() for name, part in folds.items()}
