"""Zones, tags and fields of a run on its start mesh."""

from collections.abc import Callable

import numpy as np

from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Mask, TriangleMesh
from ..io.tetmeshes import Regions
from ..settings.folding import FoldingParameters, require_maps
from ..settings.terms import LEFT, REGION_FIELDS, RIGHT
from ..settings.varying import Maps
from .checks import refuse_impossible
from .growth import GrowthInputs, StepStart
from .growth_models import growth_model
from .output import layer_fields, log_growth_at_vertices
from .points import IntegrationPoints
from .tissue import Elements
from .zones import cell_tags, zones_of_run


def start_regions(
    mesh: TetrahedralMesh,
    parameters: FoldingParameters,
    maps: Maps,
    left_faces: Callable[[TriangleMesh], Mask],
) -> Regions:
    """Return the regions of a run on its start mesh, with the fields of the first step.

    `left_faces` returns the mask of the left faces of the mesh's boundary; it is not
    called for a single hemisphere. InputError if maps or zones are impossible.
    """
    require_maps(parameters, maps, len(mesh.vertices))
    zones = zones_of_run(mesh, parameters)
    refuse_impossible(mesh, zones)
    inputs = GrowthInputs(mesh, zones, maps)
    growth = growth_model(parameters, inputs)(
        StepStart(mesh.vertices, 0.0, parameters.step_s)
    )
    points = IntegrationPoints.for_order(mesh.order)
    grown = growth.mean_deformation(
        Elements(
            mesh.tets,
            np.arange(len(mesh.vertices)),
            points,
        )
    )
    logs = (
        None if grown is None else log_growth_at_vertices(mesh.vertices, inputs, grown)
    )
    fields = layer_fields(
        mesh.vertices,
        zones,
        growth,
        maps,
        parameters.start_week,
        REGION_FIELDS,
        log_growth=logs,
    )
    if parameters.side is None:
        on_left = left_faces(TriangleMesh(mesh.vertices, zones.facets))
    else:
        on_left = np.full(
            len(zones.facets),
            parameters.side == "left",
        )
    of_cells = cell_tags(mesh, zones, fields["cortex_weight"])
    # the fissure may be curved, so that no plane separates the hemispheres
    side = np.where(on_left, LEFT, RIGHT)
    of_facets = {
        "zone": zones.facet_zone.astype(np.int32),
        "hemisphere": side.astype(np.int32),
    }
    return Regions(mesh, zones.facets, fields, of_cells, of_facets)
