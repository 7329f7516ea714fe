"""Regions of a brain as tags of its elements and facets, and its ellipsoid of no growth: for a look before the solve.

Plain NumPy; the solver itself goes by `zones` and `layers`.
"""

import numpy as np
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh
from ..parameters.folding import FoldingParameters
from ..parameters.terms import BRIDGE, CORE, CORTEX, LEFT, RIGHT
from .zones import Zones, brain_box

Floats = NDArray[np.float64]
Tags = dict[str, NDArray[np.int32]]


def cell_tags(mesh: TetrahedralMesh, zones: Zones, weight: Floats) -> Tags:
    """Returns the (m,) tags of the elements.

    `hemisphere` is LEFT or RIGHT by the element's centroid, BRIDGE between the two contact planes. `growing` is 0
    where the model lets none of an element's vertices grow, else 1. `layer` is CORTEX or CORE.

    Parameters
    ----------
    weight : (n,) float
        Cortical weight at the vertices; an element is cortex where its mean is above a half.
    """
    x = mesh.vertices[mesh.corners, 0].mean(axis=1)
    left, right = zones.planes_mm
    return {
        "hemisphere": np.select([x <= left, x >= right], [LEFT, RIGHT], BRIDGE).astype(np.int32),
        "growing": (zones.growth[mesh.tets].max(axis=1) > 0).astype(np.int32),
        "layer": np.where(weight[mesh.tets].mean(axis=1) > 0.5, CORTEX, CORE).astype(np.int32),
    }


def facet_tags(zones: Zones, on_left: NDArray[np.bool_]) -> Tags:
    """Returns the (f,) tags of `zones.facets`: `zone` as in `zones`, `hemisphere` LEFT or RIGHT.

    Parameters
    ----------
    on_left : (f,) bool
        Which facets belong to the left hemisphere. The fissure may be curved, so that no plane tells.
    """
    side = np.where(on_left, LEFT, RIGHT)
    return {"zone": zones.facet_zone.astype(np.int32), "hemisphere": side.astype(np.int32)}


def no_growth_ellipsoid(vertices: Floats, parameters: FoldingParameters) -> tuple[Floats, Floats] | None:
    """Returns centre and semi-axes, (3,) in mm, of the ellipsoid in which nothing grows; None where there is none."""
    p = parameters.no_growth
    if p.kind == "none":
        return None
    low, high = brain_box(vertices, parameters.side)
    shift = np.array([0.0, p.shift_y, p.shift_z])
    return (low + high) / 2 + shift * (high - low), np.array(p.semi_axes) * (high - low)
