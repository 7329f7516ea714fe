"""Output of a run: progress lines, and the fields of frames for ParaView."""

import logging
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ..geometry.diffusion import integrals_at_vertices, smooth_integrals
from ..geometry.triangles import Floats
from ..mechanics.materials import MATERIALS
from ..settings.varying import Maps, value_at
from .growth import GrowthInputs, StepGrowth, growth_at_vertices
from .layers import PialSearch, cortical_weight, shear_modulus
from .stretches import log_stretch, packed, unpacked
from .tissue import Tissue
from .zones import Zones

log = logging.getLogger(__name__)
GROWTH_SMOOTHING_MM = 0.4
"""Length over which the map of growth towards shapes is smoothed; growth itself is
not."""


def print_line(
    text: str,
    event: str = "",
    **facts: float | str | None,
) -> None:
    """Print a line without buffering, so that a log is always up to date, and log its
    `event`, if any, with its facts."""
    print(text, flush=True)
    if event:
        data = {"event": event} | facts
        log.info(text, extra={"data": data})


def layer_fields(
    positions_mm: Floats,
    zones: Zones,
    growth: StepGrowth,
    maps: Maps,
    week: float,
    names: Collection[str],
    log_growth: Floats | None = None,
) -> dict[str, NDArray]:
    """Return the fields of a shape at its vertices, for names of the parameter
    `fields`.

    Positions are (n, 3) in mm. The names of the arrays contain their units. The map of
    growth is made from its logarithm (n, 6) if given, else from the tensor of the
    growth model.
    """
    parameters = growth.parameters
    search = PialSearch(positions_mm, zones.cortex_facets)
    distance, _ = search.nearest(positions_mm)
    weight = cortical_weight(distance, value_at(parameters.thickness_mm, week, maps))
    growth_maps: dict[str, Floats] = {}
    if "growth" in names and log_growth is not None:
        growth_maps = growth_components(
            log_growth, search.nearest_normals(positions_mm)
        )
    elif "growth" in names:
        tissue = Tissue.at_vertices(
            positions_mm,
            zones,
            distance,
            weight,
            {name: maps[name] for name in parameters.varying_maps},
        )
        tangential, radial = growth_at_vertices(growth, tissue, week)
        growth_maps = {
            "tangential_growth_per_step": tangential,
            "radial_growth_per_step": radial,
        }
    # a vertex gets the highest of its facets' zones
    zone = np.zeros(len(positions_mm), dtype=np.int32)
    zone_at_corners = np.repeat(zones.facet_zone, 3).astype(np.int32)
    np.maximum.at(
        zone,
        zones.facets.ravel(),
        zone_at_corners,
    )
    modulus = shear_modulus(parameters, weight, maps, week)
    material = MATERIALS[parameters.material](parameters.poisson_ratio)
    by_name: dict[str, dict[str, NDArray]] = {
        "distance": {"distance_to_pial_mm": distance},
        "cortex_weight": {"cortex_weight": weight},
        "growth": growth_maps,
        "shear_modulus": {"shear_modulus_pa": modulus},
        "bulk_modulus": {"bulk_modulus_pa": material.bulk_to_shear_ratio * modulus},
        "zones": {"zone": zone, "growing": zones.growing},
    }
    fields = {}
    for name in names:
        if name == "normal":
            fields["pial_normal"] = search.nearest_normals(positions_mm)
        else:
            fields |= by_name.get(name, {})
    return fields


def log_growth_at_vertices(
    positions_mm: Floats,
    inputs: GrowthInputs,
    growth: Floats,
) -> Floats:
    """Return the logarithm (n, 6) of growth at (n, 3) positions, from the deformation
    (m, 3, 3) of elements by growth.

    It is smoothed over `GROWTH_SMOOTHING_MM`, and its axes are those of the tissue as
    it is now.
    """
    logs = packed(log_stretch(growth, left=True))
    logs = np.repeat(
        logs,
        len(inputs.pieces) // len(logs),
        axis=0,
    )
    integrals = integrals_at_vertices(positions_mm, inputs.pieces, logs)
    return smooth_integrals(positions_mm, inputs.pieces, integrals, GROWTH_SMOOTHING_MM)


def growth_components(log_growth: Floats, normals: Floats) -> dict[str, Floats]:
    """Return tangential and radial growth and its main direction, from the logarithm
    (n, 6) and unit normals (n, 3).

    The main direction is the tangential one of largest growth; the length of its vector
    is the difference to the growth across it.
    """
    tensors = unpacked(log_growth)
    radial = normals[:, :, None] * normals[:, None, :]
    tangential = np.eye(3) - radial
    # the first eigenvector is the normal, with −1
    values, axes = np.linalg.eigh(tangential @ tensors @ tangential - radial)
    _, least, largest = values.T
    difference = (largest - least)[:, None]
    return {
        "tangential_growth_per_step": values[:, 1:].mean(axis=1),
        "radial_growth_per_step": (tensors * radial).sum(axis=(1, 2)),
        "growth_direction_per_step": axes[:, :, 2] * difference,
    }
