"""Measure a brain: the metrics of its surfaces and the maps over them.

A metric is an entry of `size_metrics` (any surface), `folding_metrics` (one hemisphere
or both), `_thickness_metrics` or `_spectrum_metrics` (one hemisphere); a map is an
entry of `measure_folds` or added by `measure_brain`. Each has a record in
`gyriflow.quantities`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import MeshError
from ..geometry.diffusion import harmonic_continuation
from ..geometry.matching import faces_that_cross
from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    area,
    area_cm2,
    convex_hull,
    vertex_areas,
    volume_ml,
)
from ..quantities import METRICS, Shown, metrics_shown
from ..settings.terms import (
    CURVATURE_RADIUS_MM,
    PROXIES,
    SPANGY_MODES,
    SPECTRUM_PREFIXES,
    MassMatrix,
)
from ..units import CM2_PER_MM2, ML_PER_MM3
from .curvature import (
    RESOLVED_RADII,
    Curvature,
    curvature,
    curvature_metrics,
)
from .gyrification import (
    Pieces,
    cap,
    envelope,
    gyrification_index,
    local_gyrification_index,
    pieces_without_cuts,
    sulcal_depth,
)
from .spangy import SpangyModes, Spectrum, spectral_basis, spectrum, weyl_number
from .thickness import at_part

type Metrics = dict[str, float]
"""Values by the names of their records, in their units."""
LABEL_VOLUMES = ("tissue", "ventricles", "cortex")
"""The volumes of labels in the reports of surfaces that are metrics, with `volume_` in
front."""


@dataclass(frozen=True, eq=False)
class Folds:
    """The folds of a hemisphere's surface of n vertices, pial or white.

    Hull and envelope are without what lies over cuts; `maps` are arrays (n,) of those
    in `BrainMetrics.maps`.
    """

    mesh: TriangleMesh
    curvature_maps: Curvature
    hull: Pieces
    envelope: Pieces
    maps: dict[str, NDArray]


def measure_folds(mesh: TriangleMesh, curvature_radius_mm: float) -> Folds:
    """Return the folds of a hemisphere's surface; see `curvature.curvature` for the
    radius."""
    fitted = curvature(mesh, radius_mm=curvature_radius_mm)
    hull = convex_hull(mesh)
    envelope_pieces = pieces_without_cuts(envelope(mesh), mesh)
    maps: dict[str, NDArray] = {
        "shape_index": fitted.shape_index,
        "curvedness": fitted.curvedness,
        "mean_curvature": fitted.mean,
        "gaussian_curvature": fitted.gaussian,
        "sulcal_depth_mm": sulcal_depth(mesh, hull),
        "local_gyrification_index": local_gyrification_index(mesh, envelope_pieces),
        "reliable": fitted.reliable.astype(np.int32),
    }
    return Folds(
        mesh,
        curvature_maps=fitted,
        hull=pieces_without_cuts(hull, mesh),
        envelope=envelope_pieces,
        maps=maps,
    )


def hemisphere_spectra(
    mesh: TriangleMesh,
    curvature_maps: Curvature,
    spangy_modes: SpangyModes,
    mass: MassMatrix = "mean",
) -> dict[str, Spectrum]:
    """Return the spectrum of each of the `PROXIES` of a hemisphere, all on the same
    modes; see `spectral_basis`."""
    basis = spectral_basis(mesh, spangy_modes, mass)
    # values near a cut are not reliable and are replaced by a harmonic continuation
    reliable = np.flatnonzero(curvature_maps.reliable)
    values = np.column_stack([curvature_maps.mean, curvature_maps.shape_index])
    continued = harmonic_continuation(
        mesh.vertices, mesh.faces, reliable, tolerance=1e-12
    )
    maps = continued(values[reliable]).T
    radius = float(curvature_maps.radius_mm.mean())
    return {
        proxy: spectrum(proxy_map, basis, radius_mm=radius)
        for proxy, proxy_map in zip(PROXIES, maps, strict=True)
    }


def surface_spectra(
    left: TriangleMesh | None,
    right: TriangleMesh | None,
    curvature_radius_mm: float,
    spangy_modes: SpangyModes,
    spangy_mass: MassMatrix = "mean",
) -> pd.DataFrame:
    """Return the spectra of the hemispheres of a brain, as in
    `BrainMetrics.spectra`."""
    spectra = {}
    for name, mesh in (("left", left), ("right", right)):
        if mesh is not None:
            fitted = curvature(mesh, radius_mm=curvature_radius_mm)
            spectra[name] = hemisphere_spectra(mesh, fitted, spangy_modes, spangy_mass)
    return _band_table(spectra)


def _band_table(spectra: Mapping[str, Mapping[str, Spectrum]]) -> pd.DataFrame:
    rows = {
        (name, proxy): part.bands
        for name, parts in spectra.items()
        for proxy, part in parts.items()
    }
    return (
        pd.concat(rows, names=["hemisphere", "proxy"])
        .reset_index([0, 1])
        .reset_index(drop=True)
    )


def _mode_table(name: str, spectra: Mapping[str, Spectrum]) -> pd.DataFrame:
    part = spectra[PROXIES[0]]
    modes = {
        "mode": np.arange(len(part.band)),
        "eigenvalue_per_mm2": part.eigenvalues,
        "band": part.band,
    }
    coefficients = {
        f"coefficient_{proxy}": part.coefficients for proxy, part in spectra.items()
    }
    return pd.DataFrame({"hemisphere": name} | modes | coefficients)


def size_metrics(
    mesh: TriangleMesh, hemispheres: Iterable[TriangleMesh] = ()
) -> Metrics:
    """Return volume and area of a hemisphere or of the whole, their ratio, and the
    number of faces that cut others.

    The area of the whole is that of its `hemispheres`, without caps of medial walls.
    """
    volume = volume_ml(cap(mesh))
    cm2 = sum(map(area_cm2, hemispheres)) or area_cm2(mesh)
    relative = cm2 / volume ** (2 / 3) if volume > 0 else np.nan
    crossing = float(len(faces_that_cross(mesh)))
    return {
        "volume": volume,
        "area": cm2,
        "relative_area": relative,
        "crossing_faces": crossing,
    }


def folding_metrics(sides: Sequence[Folds]) -> Metrics:
    """Return the metrics of folding of one hemisphere, or of both together; vertices
    near cuts are left out.

    Indices are of both hemispheres' areas, each in its own hull; means are over the
    vertices of both, by area.
    """
    meshes = [side.mesh for side in sides]
    areas = np.concatenate([vertex_areas(mesh) for mesh in meshes])
    curvature_maps = Curvature(
        *map(
            np.concatenate,
            zip(*(side.curvature_maps for side in sides), strict=True),
        )
    )
    weights = areas * curvature_maps.reliable
    if not weights.any():
        reason = "every vertex has the edge of the surface within its radius"
        raise MeshError(
            "no curvature away from the cut",
            found=reason,
            remedy="Lower metrics.curvature_radius_mm.",
        )

    mean = partial(np.average, weights=weights)
    depth = np.concatenate([side.maps["sulcal_depth_mm"] for side in sides])
    deep = np.quantile(depth, 0.95, weights=weights, method="inverted_cdf")
    radius = float(mean(curvature_maps.radius_mm))
    return {
        "gyrification_index": gyrification_index(meshes, [side.hull for side in sides]),
        "gyrification_index_envelope": gyrification_index(
            meshes, [side.envelope for side in sides]
        ),
        "mean_shape_index": float(mean(curvature_maps.shape_index)),
        "mean_curvedness": float(mean(curvature_maps.curvedness)),
        "sulcal_area_share": float(mean(curvature_maps.shape_index < 0)),
        "curvature_radius": radius,
        "curvature_wavelength": RESOLVED_RADII * radius,
        "mean_sulcal_depth": float(mean(depth)),
        "sulcal_depth_95": float(deep),
        **curvature_metrics(curvature_maps, weights),
    }


def _thickness_metrics(values: Floats, areas: Floats) -> Metrics:
    """Return the metrics of thickness at (n,) vertices, NaN where it was not measured,
    weighted by area.

    Empty where it was measured nowhere.
    """
    is_measured = np.isfinite(values)
    if not is_measured.any():
        return {}
    selected, weights = values[is_measured], areas[is_measured]
    mean = float(np.average(selected, weights=weights))
    low, high = np.quantile(
        selected, [0.05, 0.95], weights=weights, method="inverted_cdf"
    )
    return {
        "mean_thickness": mean,
        "thickness_sd": float(
            np.sqrt(
                np.average(
                    (selected - mean) ** 2,
                    weights=weights,
                )
            )
        ),
        "thickness_q05": float(low),
        "thickness_q95": float(high),
        "thickness_measured_share": float(weights.sum() / areas.sum()),
    }


def _folding_and_thickness(
    sides: Sequence[Folds], thickness: Sequence[Floats]
) -> Metrics:
    areas = np.concatenate([vertex_areas(side.mesh) for side in sides])
    return folding_metrics(sides) | _thickness_metrics(np.concatenate(thickness), areas)


def _area_ratio(whole: Metrics, mean_curvature: float) -> Metrics:
    """Return the pial area over that of a complete surface, or nothing where cortex or
    thickness is not known.

    A cortical sheet of volume V and thickness T has the area V/T in its middle and (1 +
    H T) V/T outside, with the `mean_curvature` H in 1/mm: a ratio below 1 means fused
    sulci.
    """
    if not {"volume_cortex", "mean_thickness"} <= set(whole):
        return {}
    sheet_cm2 = (
        whole["volume_cortex"] / ML_PER_MM3 / whole["mean_thickness"] * CM2_PER_MM2
    )
    return {
        "area_ratio": (
            whole["area"] / (1.0 + mean_curvature * whole["mean_thickness"]) / sheet_cm2
        )
    }


def _spectrum_metrics(spectra: Mapping[str, Spectrum], area_mm2: float) -> Metrics:
    """Return the metrics of a hemisphere's spectra.

    A band that is cut off has NaN, and relative powers are NaN where a band that they
    are shares of is cut off: `spectra` has all values with their flags.
    """
    eigenvalues = spectra[PROXIES[0]].eigenvalues
    metrics = {
        "spangy_modes": float(len(eigenvalues)),
        "weyl_number": float(weyl_number(area_mm2, eigenvalues[1])),
    }
    for proxy, found in spectra.items():
        bands, name = found.bands, f"spangy_{SPECTRUM_PREFIXES[proxy]}"
        power = bands["power"].where(bands["complete"])
        share = bands["relative_power"].where(
            bands["complete"] & bands["denominator_complete"]
        )
        metrics |= {
            f"{name}B{band}_power": float(power[band]) for band in bands["band"]
        }
        metrics |= {
            f"{name}B{band}_relative_power": float(share[band])
            for band in bands["band"][1:]
        }
        metrics[f"{name}captured_share"] = found.captured
    return metrics


def _table(parts: Mapping[str, Metrics]) -> pd.DataFrame:
    """Return metrics by hemisphere as a table with the units of their records."""
    rows = []
    for hemisphere, metrics in parts.items():
        for name, value in metrics.items():
            rows.append((hemisphere, name, value, METRICS[name].unit))
    return pd.DataFrame(
        rows,
        columns=["hemisphere", "metric", "value", "unit"],
    )


@dataclass(frozen=True, eq=False)
class BrainMetrics:
    """The metrics of one brain.

    `table` has a row per number: hemisphere (whole, left or right), metric, value,
    unit. `maps` has per hemisphere ("left", "right", or the only one) arrays per vertex
    by name: shape_index, curvedness (1/mm), mean_curvature (1/mm), gaussian_curvature
    (1/mm²), sulcal_depth_mm, local_gyrification_index, thickness_mm (where it is known;
    NaN where not measured), spangy_dominant_band and spangy_shape_index_dominant_band
    (−6 to 6; by mean curvature and by shape index), reliable (0 near a cut, else 1).
    `spectra` has a row per hemisphere, proxy and band with the columns of
    `Spectrum.bands`. `coefficients` has a row per hemisphere and mode: hemisphere,
    mode, eigenvalue_per_mm2, band (−1 beyond B6), coefficient_mean_curvature (cᵢ, no
    unit), coefficient_shape_index (in mm).
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
    spangy_mass: MassMatrix = "mean",
) -> BrainMetrics:
    """Measure a brain by its closed pial surface, outward, in mm, and the pial surfaces
    of its hemispheres.

    A hemisphere is closed, or open where a connected brain is cut at the fissure; None
    if the brain does not have it. A cut counts for the volume only. It is left out of
    area, gyrification, depth, curvature and spectrum, and depth and curvature within
    `curvature_radius_mm` of it out of the means. Except for volume and area, values of
    the whole are those of both hemispheres: Σ area over Σ area of the hulls, and means
    over both.

    `thickness_mm` (n,) is the cortical thickness at the vertices of `whole`, NaN where
    it was not measured, None where it is not known; `label_volumes_ml` are the volumes
    of the labels inside the surface, of which those of `LABEL_VOLUMES` become metrics
    of the whole. See `curvature.curvature` and `spangy.spectral_basis` for the others.
    MeshError where a surface looks inwards, or a hemisphere is not in one piece.
    """
    meshes = {
        name: mesh
        for name, mesh in (("left", left), ("right", right))
        if mesh is not None
    }
    for mesh in (whole, *meshes.values()):
        if (volume := volume_ml(cap(mesh))) <= 0:
            text = f"volume {volume:.3g} mL"
            raise MeshError(
                "the faces of the surface look inwards",
                found=text,
                remedy="Turn the faces round.",
            )
    folds = {
        name: measure_folds(mesh, curvature_radius_mm) for name, mesh in meshes.items()
    }
    spectra = {
        name: hemisphere_spectra(
            part.mesh, part.curvature_maps, spangy_modes, spangy_mass
        )
        for name, part in folds.items()
    }
    thickness = {
        name: (
            np.full(len(mesh.vertices), np.nan)
            if thickness_mm is None
            else at_part(thickness_mm, whole, mesh)
        )
        for name, mesh in meshes.items()
    }

    whole_metrics = size_metrics(whole, meshes.values()) | _folding_and_thickness(
        list(folds.values()), list(thickness.values())
    )
    volumes = label_volumes_ml or {}
    whole_metrics |= {
        f"volume_{name}": volumes[name] for name in LABEL_VOLUMES if name in volumes
    }
    bent = [
        np.average(
            part.curvature_maps.mean,
            weights=vertex_areas(part.mesh),
        )
        for part in folds.values()
    ]
    mean_curvature = float(
        np.average(
            bent,
            weights=[area_cm2(mesh) for mesh in meshes.values()],
        )
    )
    metrics = {"whole": whole_metrics | _area_ratio(whole_metrics, mean_curvature)}
    maps = {}
    for name, mesh in meshes.items():
        found = spectra[name]
        metrics[name] = (
            size_metrics(mesh)
            | _folding_and_thickness([folds[name]], [thickness[name]])
            | _spectrum_metrics(found, area(mesh))
        )
        maps[name] = dict(folds[name].maps)
        if np.isfinite(thickness[name]).any():
            maps[name]["thickness_mm"] = thickness[name]
        for proxy, part in found.items():
            maps[name][f"spangy_{SPECTRUM_PREFIXES[proxy]}dominant_band"] = (
                part.dominant_band
            )
    return BrainMetrics(
        table=_table(metrics),
        maps=maps,
        spectra=_band_table(spectra),
        coefficients=pd.concat(
            [_mode_table(name, part) for name, part in spectra.items()],
            ignore_index=True,
        ),
    )


def measure_white(
    sides: Mapping[str, TriangleMesh], curvature_radius_mm: float = CURVATURE_RADIUS_MM
) -> tuple[pd.DataFrame, dict[str, dict[str, NDArray]]]:
    """Return the metrics and the maps of the white surfaces of "left" and "right", or
    of the only hemisphere.

    They are measured as pial ones are. The table has hemisphere, metric, value and unit
    of the metrics of `Shown.WHITE`, named `white_…`; the maps are those of `Folds` per
    hemisphere.
    """
    folds = {
        side: measure_folds(mesh, curvature_radius_mm) for side, mesh in sides.items()
    }
    parts_of = {"whole": list(folds.values())}
    for side, part in folds.items():
        parts_of[side] = [part]
    metrics = {}
    for hemisphere, parts in parts_of.items():
        area_mm2 = sum(area(part.mesh) for part in parts)
        values = {"area": area_mm2 * CM2_PER_MM2} | folding_metrics(parts)
        metrics[hemisphere] = {
            f"white_{metric}": values[metric] for metric in metrics_shown(Shown.WHITE)
        }
    return _table(metrics), {side: part.maps for side, part in folds.items()}
