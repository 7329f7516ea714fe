"""Growth of tissue in a step: the interface of growth models to the solver, its tensor G, and growth by rates."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, linear_pieces
from ..geometry.triangles import Floats, TriangleMesh, area, signed_volume
from ..settings.folding import FoldingParameters
from ..settings.varying import Maps, value_at
from ..units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW
from .tissue import Tissue
from .zones import Zones

NO_GROWTH = 1e-10
"""Growth increment of a step that counts as none, a hundred-millionth of what the cortex grows."""


@dataclass(frozen=True)
class Size:
    """The size of a brain: of the surface under which cortex lies, and of all that the surface encloses."""

    area_mm2: float
    volume_mm3: float

    def rates_to(self, after: "Size", step_s: float) -> Floats:
        """Return the (2,) rates in 1/s of the logarithms of area and volume that lead to another size in a step."""
        return np.log([after.area_mm2 / self.area_mm2, after.volume_mm3 / self.volume_mm3]) / step_s


@dataclass(frozen=True, eq=False)
class GrowthInputs:
    """What growth depends on besides shape and time.

    The mesh as (p, 4) linear tetrahedra between its vertices, and the run's zones and maps at all of these.
    """

    pieces: NDArray[np.int64]
    zones: Zones
    maps: Maps

    @classmethod
    def of(cls, mesh: TetrahedralMesh, zones: Zones, maps: Maps) -> "GrowthInputs":
        """Return the inputs for a mesh."""
        return cls(linear_pieces(mesh), zones, maps)

    def size(self, positions_mm: Floats) -> Size:
        """Return the size of the brain, for (n, 3) positions of all vertices."""
        return Size(
            area(TriangleMesh(positions_mm, self.zones.measured_facets)),
            signed_volume(TriangleMesh(positions_mm, self.zones.facets)),
        )


@dataclass(frozen=True, eq=False)
class StepStart:
    """What a growth model is told of a step.

    The (n, 3) positions of all vertices at its start, equal on every rank, the time since the start of the run, the
    length of the step, and what the step before has taught.
    """

    positions_mm: Floats
    time_s: float
    step_s: float
    learnt: Sequence[float] | None = None

    def week(self, p: FoldingParameters, part: float) -> float:
        """Return the gestational week at a part of the step, of 0 at its start to 1 at its end."""
        return p.start_week + (self.time_s + part * self.step_s) / SECONDS_PER_GW


@dataclass(frozen=True, eq=False)
class StepGrowth(ABC):
    """How tissue grows in one step: by the run's parameters with the step's rates, which frames show."""

    parameters: FoldingParameters
    start: StepStart

    @abstractmethod
    def inverse(self, tissue: Tissue) -> Floats:
        """Return G⁻¹ (c, q, 3, 3) at the integration points of a rank's elements."""

    def logarithm(self) -> Floats | None:
        """Return ln G (6, n) at all vertices, None where growth is by the rates of the parameters."""
        return None

    def learnt(self, after: Size) -> tuple[float, ...] | None:
        """Return what a step that has led to a size teaches the next ones, None where that is nothing."""
        return None

    def row(self, after: Size) -> dict[str, Any]:
        """Return what the step table says of growth after the step has led to a size."""
        return {"area_cm2": after.area_mm2 * CM2_PER_MM2, "volume_ml": after.volume_mm3 * ML_PER_MM3}


StepModel = Callable[[StepStart], StepGrowth]
"""Says how tissue grows in each step."""


@dataclass(frozen=True, eq=False)
class GrowthByRates(StepGrowth):
    """Growth by the parameters' rates of cortex and core, as in the middle of the step."""

    def inverse(self, tissue: Tissue) -> Floats:
        p, start = self.parameters, self.start
        dg, dr = increments_at(p, tissue.weight, tissue.growing, tissue.maps, start.week(p, 0.5), start.step_s)
        # the direction matters only where growth differs along and across it
        chosen, normals = tissue.normals(np.abs(dg - dr) > NO_GROWTH)
        return layered_inverse(tissue.at_points(dg), tissue.at_points(dr), chosen, normals)


def increments(w: Any, g: Any, tangential: Any, radial: Any, core: Any, step_s: float) -> tuple[Any, Any]:
    """Return the increments dg along the pial surface and dr across it, as stretches less 1.

    dg = (α_TAN w + α_CORE (1 − w)) · g · Δt and dr = (α_RAD + α_CORE)(1 − w) · g · Δt, with the cortical weight w, g 1
    where tissue grows and else 0, and rates in 1/s: α_TAN of the cortex along its surface, α_RAD of the core along the
    normal, and α_CORE of the core in all directions.
    """
    isotropic = core * (1 - w)
    return (tangential * w + isotropic) * (g * step_s), (radial * (1 - w) + isotropic) * (g * step_s)


def increments_at(
    p: FoldingParameters, w: Floats, g: Floats, maps: Maps, week: float, step_s: float
) -> tuple[Floats, Floats]:
    """Return the increments of a step by the parameters' rates at a week, at points where maps have their values."""
    tangential, radial, core = (
        value_at(rate, week, maps)
        for rate in (p.growth_rate_per_s, p.radial_growth_rate_per_s, p.core_growth_rate_per_s)
    )
    return increments(w, g, tangential, radial, core, step_s)


def layered_inverse(dg: Floats, dr: Floats, chosen: NDArray[np.bool_], normals: Floats) -> Floats:
    """Return G⁻¹ (c, q, 3, 3) for G = (1 + dg)(I − N⊗N) + (1 + dr) N⊗N.

    The (c,) `chosen` elements have unit normals N (w, q, 3); others grow by dg in all directions.
    """
    inverse = (1 / (1 + dg))[..., None, None] * np.eye(3)
    across = normals[..., :, None] * normals[..., None, :]
    inverse[chosen] = (np.eye(3) - across) / (1 + dg[chosen])[..., None, None]
    inverse[chosen] += across / (1 + dr[chosen])[..., None, None]
    return inverse
