"""Growth of tissue in a step: the interface of growth models to the solver, its tensor
G, and growth by rates."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..geometry.jacobians import chunks
from ..geometry.tetrahedra import TetrahedralMesh, linear_pieces
from ..geometry.triangles import Floats, Ints, Mask, TriangleMesh, area, signed_volume
from ..settings.folding import FoldingParameters
from ..settings.varying import Maps, value_at
from ..units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW
from .layers import PialSearch, cortical_weight
from .tissue import Elements, Tissue
from .zones import Zones

GROWTH_TOL = 1e-10
"""Difference below which growth increments count as equal: a hundred-millionth of the
cortex' growth in a step."""


@dataclass(frozen=True)
class Size:
    """The size of a brain: area of its pial surface, and volume inside."""

    area_mm2: float
    volume_mm3: float

    def rates_to(self, after: "Size", step_s: float) -> Floats:
        """Return the (2,) rates in 1/s of ln area and ln volume between the sizes
        before and after a step."""
        area_ratio = after.area_mm2 / self.area_mm2
        volume_ratio = after.volume_mm3 / self.volume_mm3
        return np.log([area_ratio, volume_ratio]) / step_s


@dataclass(frozen=True, eq=False)
class GrowthInputs:
    """Inputs of growth that are constant through a run.

    The mesh at its start, with the run's zones and maps; `total` adds up a count of
    elements over the ranks.
    """

    mesh: TetrahedralMesh
    zones: Zones
    maps: Maps
    total: Callable[[int], int] = int

    @cached_property
    def pieces(self) -> Ints:
        """The (p, 4) linear tetrahedra between the mesh's vertices."""
        return linear_pieces(self.mesh)

    def size(self, positions_mm: Floats) -> Size:
        """Return the size of the brain, for (n, 3) positions of all vertices."""
        return Size(
            area(TriangleMesh(positions_mm, self.zones.measured_facets)),
            signed_volume(TriangleMesh(positions_mm, self.zones.facets)),
        )


@dataclass(frozen=True, eq=False)
class StepStart:
    """The state a growth model sees at the start of a step.

    The (n, 3) positions of all vertices, equal on every rank, the time since the start
    of the run, the length of the step, and the `correction` that the last step has
    returned.
    """

    positions_mm: Floats
    time_s: float
    step_s: float
    correction: Sequence[float] | None = None

    def week(self, p: FoldingParameters, part: float) -> float:
        """Return the gestational week at a fraction of the step, from 0 at its start to
        1 at its end."""
        return p.start_week + (self.time_s + part * self.step_s) / SECONDS_PER_GW


@dataclass(frozen=True, eq=False)
class StepGrowth(ABC):
    """Growth of tissue in one step.

    `parameters` are those of the run, with the growth rates of this step.
    """

    parameters: FoldingParameters
    start: StepStart

    @abstractmethod
    def inverse(self, tissue: Tissue) -> Floats:
        """Return G⁻¹ (c, q, 3, 3) at the integration points of a rank's elements.

        For maps of growth, the elements are the mesh's vertices (`Tissue.at_vertices`).
        """

    def deformation(self, elements: Elements) -> Floats | None:
        """Return R·G (c, q, 3, 3), the deformation of free tissue at the points of
        elements, None if it is by rates."""
        return None

    def mean_deformation(self, elements: Elements) -> Floats | None:
        """Return the mean (c, 3, 3) of `deformation` over each element, None if growth
        is by rates."""
        deformation = self.deformation(elements)
        if deformation is None:
            return None
        # q: integration point, c: element, ij: tensor
        return np.einsum("q,cqij->cij", elements.points.weights, deformation)

    def guess(self, fixed: Mask) -> Floats | None:
        """Return the displacement (n, 3) in m of a free body, zero where it is fixed
        (n, 3); None if unknown."""
        return None

    def correction(self, after: Size) -> tuple[float, ...] | None:
        """Return the feedback to the next steps after a step that has reached a size,
        None without feedback."""
        return None

    def row(self, after: Size) -> dict[str, Any]:
        """Return the growth columns of the step table after a step that has reached a
        size."""
        return {
            "area_cm2": after.area_mm2 * CM2_PER_MM2,
            "volume_ml": after.volume_mm3 * ML_PER_MM3,
        }


StepModel = Callable[[StepStart], StepGrowth]
"""A growth model of a run: returns the growth of each step."""


@dataclass(frozen=True, eq=False)
class GrowthByRates(StepGrowth):
    """Growth by the parameters' rates of cortex and core, taken in the middle of the
    step."""

    def inverse(self, tissue: Tissue) -> Floats:
        dg, dr = increments(
            self.parameters,
            tissue.weight,
            tissue.growing,
            tissue.maps,
            self.start.week(self.parameters, 0.5),
            self.start.step_s,
        )
        # normals matter only where tangential and radial growth differ
        layered, normals = tissue.normals(np.abs(dg - dr) > GROWTH_TOL)
        return layered_inverse(
            tissue.at_points(dg),
            tissue.at_points(dr),
            layered,
            normals,
        )


def increments(
    p: FoldingParameters,
    weight: Floats,
    growing: Floats,
    maps: Maps,
    week: float,
    step_s: float,
) -> tuple[Floats, Floats]:
    """Return the tangential and radial growth increments dg and dr of a step, as
    stretches minus 1, by the parameters' rates at a week.

    dg = (α_TAN w + α_CORE (1 − w)) · g · Δt and dr = α_CORE (1 − w) · g · Δt, with the
    cortical weight w, g 1 where tissue is `growing` and else 0, and rates in 1/s:
    tangential of the cortex (α_TAN) and isotropic of the core (α_CORE). Weight,
    `growing` and maps are at the same points.
    """
    tangential = value_at(p.growth_rate_per_s, week, maps)
    core = value_at(p.core_growth_rate_per_s, week, maps)
    isotropic = core * (1 - weight)
    tangential_growth = (tangential * weight + isotropic) * (growing * step_s)
    radial_growth = isotropic * (growing * step_s)
    return tangential_growth, radial_growth


def growth_at_vertices(
    growth: StepGrowth,
    tissue: Tissue,
    week: float,
) -> tuple[Floats, Floats]:
    """Return tangential and radial growth (n,), as stretches minus 1, from the tensor G
    of a growth model for tissue at the vertices in the shape of a week.

    G is that of a step of the length `step_s` with this week in its middle.
    """
    p = growth.parameters
    start = replace(
        growth.start,
        positions_mm=tissue.places_mm,
        time_s=(week - p.start_week) * SECONDS_PER_GW - p.step_s / 2,
        step_s=p.step_s,
    )
    inverse = replace(growth, start=start).inverse(tissue)
    tensors = np.linalg.inv(inverse[:, 0])
    everywhere = np.ones(len(tensors), dtype=bool)
    _, at_points = tissue.normals(everywhere)
    normals = at_points[:, 0]
    # n: vertex, ij: tensor
    radial = np.einsum("ni,nij,nj->n", normals, tensors, normals)
    tangential = (np.trace(tensors, axis1=1, axis2=2) - radial) / 2
    return tangential - 1, radial - 1


def model_fields(
    growth: StepGrowth,
    zones: Zones,
    positions_mm: Floats,
    week: float,
) -> dict[str, Floats]:
    """Return the fields of a run without maps at its nodes, with the (n, 3) positions
    of a week.

    They are positions, weight (of the cortex), growing (0 or 1), increment (tangential
    growth in a step) and the normals (n, 3) of the pial surface at the nearest points.
    """
    pial = PialSearch(positions_mm, zones.cortex_facets)
    distance_mm, _ = pial.nearest(positions_mm)
    thickness_mm = value_at(growth.parameters.thickness_mm, week, {})
    weight = cortical_weight(distance_mm, thickness_mm)
    tissue = Tissue.at_vertices(positions_mm, zones, distance_mm, weight, {})
    tangential, _ = growth_at_vertices(growth, tissue, week)
    return {
        "positions": positions_mm,
        "weight": weight,
        "growing": zones.growing,
        "increment": tangential,
        "normals": pial.nearest_normals(positions_mm),
    }


def layered_inverse(
    dg: Floats,
    dr: Floats,
    layered: Mask,
    normals: Floats,
) -> Floats:
    """Return G⁻¹ (c, q, 3, 3) for G = (1 + dg)(I − N⊗N) + (1 + dr) N⊗N.

    The elements of the mask `layered` (c,) have unit normals N (e, q, 3); others grow
    by dg in all directions.
    """
    along = (1 + dg)[..., None, None]
    across = (1 + dr)[..., None, None]
    inverse = (1 / along) * np.eye(3)
    difference = 1 / across[layered] - 1 / along[layered]
    rows = np.flatnonzero(layered)
    for chunk in chunks(len(rows)):
        across_all = difference[chunk] * normals[chunk, ..., None]
        inverse[rows[chunk]] += across_all * normals[chunk, ..., None, :]
    return inverse
