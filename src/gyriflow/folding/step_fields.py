"""The fields that a step has left: stress, strain and contact pressure, as frames write them."""

from collections.abc import Iterable

import numpy as np

from ..geometry.triangles import Floats
from ..parameters.folding import FoldingParameters
from ..parameters.terms import ELEMENT_FIELDS
from ..units import SECONDS_PER_GW
from .contact import SelfContact
from .domain import Domain
from .layers import PialSearch
from .problem import Problem
from .stress import (
    areal_stretch,
    deformation_gradients,
    green_lagrange_maximum,
    hencky_equivalent,
    pressure,
    von_mises,
)
from .zones import Zones


class StepFields:
    """What the last step has left; names of fields are those of the parameter `fields`, those of arrays have units.

    Where stress is forgotten, that of a step, its strain and its contact pressure are in proportion to the step, and
    are given per week.

    Attributes
    ----------
    step_s : float
        Length of the last step.
    """

    def __init__(
        self, domain: Domain, problem: Problem, contact: SelfContact | None, zones: Zones, parameters: FoldingParameters
    ) -> None:
        self.domain, self.problem, self.contact = domain, problem, contact
        self.step_s = parameters.step_s
        self._remembers = parameters.stress_memory_gw > 0
        self._start = domain.positions
        if "strain" in parameters.fields:
            centres = domain.local(self._start)[domain.corners].mean(axis=1)
            self._start_normals = PialSearch(self._start, zones.cortex_facets).nearest_normals(centres)

    def of_elements(self, wanted: Iterable[str]) -> dict[str, Floats]:
        """Returns those among `wanted`, (m,) for all elements, equal on every rank: means over integration points.

        Right after a step only.
        """
        domain, problem = self.domain, self.problem
        fields: dict[str, Floats] = {}
        if set(ELEMENT_FIELDS).isdisjoint(wanted):
            return fields
        after, slopes = domain.positions, problem.points.slopes
        total = deformation_gradients(domain.local(self._start), domain.local(after), domain.cells, slopes)
        total = total.reshape(-1, 3, 3)

        # back to where the step began, which its displacement refers to
        moved = problem.displacement.copy()
        domain.place(after - domain.gathered(moved[: domain.owned]))
        if "stress" in wanted:
            stress = problem.outcome("stress").reshape(-1, 3, 3)
            fields |= {"von_mises_pa": von_mises(stress), "pressure_pa": pressure(stress)}
        if "strain" in wanted:
            Fe = problem.outcome("elastic").reshape(-1, 3, 3)
            fields |= {"elastic_strain": hencky_equivalent(Fe), "elastic_volume_strain": np.log(np.linalg.det(Fe))}
        fields = self._per_gw(fields)
        if "strain" in wanted:
            normals = np.repeat(self._start_normals, len(slopes), axis=0)
            fields |= {"total_strain": green_lagrange_maximum(total), "area_stretch": areal_stretch(total, normals)}
        if "volume_ratio" in wanted:
            fields["volume_ratio_step"] = np.linalg.det(problem.outcome("deformation").reshape(-1, 3, 3))
            fields["volume_ratio"] = np.linalg.det(total)
        domain.place(after)
        by_cell = [values.reshape(-1, len(slopes)) @ problem.points.weights for values in fields.values()]
        together = domain.gathered_cells(np.stack(by_cell, axis=1))
        return dict(zip(fields, together.T, strict=True))

    def of_contact(self, wanted: Iterable[str]) -> dict[str, Floats]:
        """Returns the contact pressure (n,) at all vertices if it is among `wanted`. Right after a step only."""
        if self.contact is None or "contact_pressure" not in wanted:
            return {}
        return self._per_gw({"contact_pressure_pa": self.contact.pressure()})

    def _per_gw(self, fields: dict[str, Floats]) -> dict[str, Floats]:
        if self._remembers:
            return fields
        return {f"{name}_per_gw": values * (SECONDS_PER_GW / self.step_s) for name, values in fields.items()}
