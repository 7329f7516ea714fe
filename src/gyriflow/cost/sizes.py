"""How large the meshes of a configuration will be, before they are made."""

from dataclasses import dataclass

import numpy as np

from ..config.brains import Brain
from ..config.mesh import MeshSettings
from ..config.root import Config

FACE_AREA = np.sqrt(3) / 4
"""Area of an equilateral triangle, in edges squared."""
AREAS_CM2 = {21: 99.0, 25: 174.0, 29: 234.0, 33: 309.0, 36: 355.0}
"""Pial area by gestational week, of CRL's atlas by this project's own surfaces (Gholipour et al. 2017)."""
VOLUMES_ML = {21: 51.0, 25: 109.0, 29: 160.0, 33: 230.0, 36: 286.0}
"""Volume inside it."""
DEPTHS = 200


@dataclass(frozen=True)
class Size:
    """What the jobs of a brain have to do with.

    Attributes
    ----------
    faces
        Triangles of the pial surfaces that metrics are measured on.
    nodes, tets, pial_faces
        Nodes, elements and boundary triangles between nodes of the tetrahedral mesh.
    """

    faces: float
    nodes: float
    tets: float
    pial_faces: float


def size_of(brain: Brain, config: Config, nodes_factor: float, tets_per_node: float) -> Size:
    """Returns the sizes to expect of a brain, from its week and the edges that the configuration asks for.

    `nodes_factor` is the number of nodes over the volume in cubes of the wanted edge, `tets_per_node` the number of
    linear elements over that of nodes, both as found in meshes that were made.
    """
    if brain.shape is not None:
        extents = np.array(brain.shape.size_mm, dtype=float)
        extents = extents if len(extents) == 3 else np.full(3, 2 * extents[0])
        area, volume = (
            float(2 * (extents[0] * extents[1] + extents[1:].prod() + extents[0] * extents[2])),
            extents.prod(),
        )
    else:
        area = 100 * float(np.interp(brain.week, list(AREAS_CM2), list(AREAS_CM2.values())))
        volume = 1000 * float(np.interp(brain.week, list(VOLUMES_ML), list(VOLUMES_ML.values())))
    mesh = config.mesh
    edge = float(np.sqrt(area / (FACE_AREA * mesh.pial_faces))) if mesh.pial_faces else mesh.surface_edge_mm
    nodes = nodes_factor * cubes(area, float(volume), mesh, edge)
    # as many nodes, an eighth of the elements
    tets = tets_per_node * nodes / (8 if mesh.order == 2 else 1)
    return Size(area / (FACE_AREA * config.surface.edge_length_mm**2), nodes, tets, area / (FACE_AREA * edge**2))


def cubes(area_mm2: float, volume_mm3: float, mesh: MeshSettings, surface_edge_mm: float) -> float:
    """Returns how many cubes of the wanted edge fill a body: ∫ dV / h(depth)³.

    Shells below its surface shrink linearly to nothing, as they do in a body of area A and volume V whose inner
    radius is 3 V / A.
    """
    inner = 3 * volume_mm3 / area_mm2
    depth = (np.arange(DEPTHS) + 0.5) * inner / DEPTHS
    below = np.maximum(depth - mesh.fine_depth_edges * surface_edge_mm, 0.0)
    edge = np.minimum(surface_edge_mm + mesh.edge_growth * below, mesh.core_edge_mm)
    shell = area_mm2 * (1 - depth / inner) ** 2 * inner / DEPTHS
    return float((shell / edge**3).sum())
