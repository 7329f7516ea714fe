"""What growth would make of the area and the volume of a brain if nothing held it back, from its layers and maps."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, linear_pieces, volumes_between
from ..geometry.triangles import TriangleMesh, area_vectors
from ..mechanics.growth import growth_increments
from ..mechanics.steering import Response, free_response
from ..parameters.folding import STRAIN, FoldingParameters
from ..parameters.varying import Maps, value_at
from ..units import SECONDS_PER_GW
from .layers import WEIGHT_REACH, PialSearch, cortical_weight
from .memory import unpacked
from .zones import Zones

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tissue:
    """What free growth depends on besides shape and week.

    Attributes
    ----------
    pieces : (p, 4) int
        Linear tetrahedra between the vertices of the mesh.
    zones, maps
        Those of the run, at all vertices.
    """

    pieces: NDArray[np.int64]
    zones: Zones
    maps: Maps

    @classmethod
    def of(cls, mesh: TetrahedralMesh, zones: Zones, maps: Maps) -> "Tissue":
        """Returns the tissue of a mesh."""
        return cls(linear_pieces(mesh), zones, maps)


def growth_of_brain(p: FoldingParameters, positions_mm: Floats, tissue: Tissue, week: float) -> Response:
    """Returns what free growth would make of the brain's sizes, in 1/s for unit rates of cortex and core.

    Each place grows by its maps' multiples of the two rates, and with measured strain where there is one. Volume is
    that of all tissue; area is as growth along the surface makes it.

    Parameters
    ----------
    positions_mm : (n, 3) float
        Of all vertices.
    week
        Whose thickness and maps hold.
    """
    zones, maps = tissue.zones, tissue.maps
    thickness = p.thickness_at(week, maps)
    reach = WEIGHT_REACH * float(np.max(thickness))
    distance = PialSearch(positions_mm, zones.cortex_facets).distance(positions_mm, reach)
    w = cortical_weight(distance, thickness)
    of_cortex, of_core = (
        1.0 if name is None else maps[name]
        for name in (
            map_at(p.regional_growth_of_cortex or p.regional_growth, week),
            map_at(p.regional_growth, week),
        )
    )
    volumes = volumes_between(positions_mm, tissue.pieces)
    whole = volumes.sum()

    def of_volume(
        tangential: float | Floats, radial: float | Floats, core: float | Floats, across: float | Floats
    ) -> float:
        dg, dr = growth_increments(w, zones.growth, tangential, radial, core, 1.0, across=across)
        return float((2 * dg + dr)[tissue.pieces].mean(axis=1) @ volumes / whole)

    faces = zones.measured_facets
    normals = area_vectors(TriangleMesh(positions_mm, faces))
    areas = np.linalg.norm(normals, axis=1)
    local = (zones.growth * of_cortex)[faces].mean(axis=1)
    surface = 2 * float(local @ areas / areas.sum())
    strain = strain_at(p, maps, week)
    stretched = 0.0
    if strain is not None:
        tensors = unpacked((strain * zones.growth).T[faces].mean(axis=1))
        across = np.einsum("fi,fij,fj->f", normals, tensors, normals) / areas**2
        stretched = float((np.trace(tensors, axis1=1, axis2=2) - across) @ areas / areas.sum()) / SECONDS_PER_GW
    return free_response(
        surface,
        of_volume(of_cortex, 0.0, 0.0, of_cortex if p.regional_strain else 0.0),
        of_volume(0.0, 0.0, of_core, 0.0),
        area_else=stretched,
        volume_else=of_volume(0.0, value_at(p.radial_growth_rate_per_s, week, maps), 0.0, 0.0),
    )


def strain_at(p: FoldingParameters, maps: Maps, week: float) -> Floats | None:
    """Returns the (6, n) measured strain per week that holds at a week, None where growth has no directions."""
    name = map_at(p.regional_strain, week)
    return None if name is None else np.stack([maps[f"{name}_{part}"] for part in STRAIN])


def undone(strain: Floats) -> Floats:
    """Returns the (..., 3, 3) inverse of growth by small (..., 6) strains, which leaves volumes as they are."""
    inverse = np.linalg.inv(np.eye(3) + unpacked(strain))
    return np.asarray(inverse / np.cbrt(np.linalg.det(inverse))[..., None, None])


def map_at(maps: Mapping[float, str], week: float) -> str | None:
    """Returns the name of the map that holds at a week: that of the last week before it, or else the first."""
    before = [start for start in maps if start < week]
    return maps[max(before)] if before else next(iter(maps.values()), None)
