"""The fields that a step has left: stress, strain and contact pressure, as frames write them, and their measures.

The tensors of a step, elastic deformation and stress, come from the problem that was solved (`Problem.outcome`). Arrays
of tensors are (c, 3, 3), of scalars (c,).
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import Floats
from ..settings.folding import FoldingParameters
from ..settings.terms import ELEMENT_FIELDS
from ..units import SECONDS_PER_GW
from .contact import SelfContact
from .domain import Domain
from .layers import PialSearch
from .problem import Problem
from .zones import Zones


class StepFields:
    """What the last step has left; names of fields are those of the parameter `fields`, those of arrays have units.

    Where stress is forgotten, that of a step, its strain and its contact pressure are in proportion to the step, and
    are given per week. `step_s` is the length of the last step.
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
        """Return those among `wanted`, (m,) for all elements, equal on every rank: means over integration points.

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
        """Return the contact pressure (n,) at all vertices if it is among `wanted`. Right after a step only."""
        if self.contact is None or "contact_pressure" not in wanted:
            return {}
        return self._per_gw({"contact_pressure_pa": self.contact.pressure()})

    def _per_gw(self, fields: dict[str, Floats]) -> dict[str, Floats]:
        if self._remembers:
            return fields
        return {f"{name}_per_gw": values * (SECONDS_PER_GW / self.step_s) for name, values in fields.items()}


def deformation_gradients(before: Floats, after: Floats, cells: NDArray[np.integer], slopes: Floats) -> Floats:
    """Return the (c, q, 3, 3) deformation gradients F = ∂x_after/∂x_before of tetrahedra at points inside them.

    Positions of the nodes are (k, 3) in one unit, `cells` (c, n) their indices; the elements have a volume before.
    `slopes` (q, n, 3) are the gradients of the nodes' shape functions in the regular element, at the points.
    """
    # the transposed maps from the regular element: those after = those before · Fᵀ
    first, second = (np.matmul(slopes.transpose(0, 2, 1), x[cells][:, None]) for x in (before, after))
    return np.asarray(np.linalg.solve(first, second), dtype=np.float64).swapaxes(-1, -2)


def pressure(stress: Floats) -> Floats:
    """Return the (c,) pressures −tr(σ)/3, positive where tissue is pressed, in the unit of the stress."""
    return -np.trace(stress, axis1=1, axis2=2) / 3


def von_mises(stress: Floats) -> Floats:
    """Return the (c,) equivalent stresses √(3/2 dev σ : dev σ), in the unit of the stress."""
    mean = (np.trace(stress, axis1=1, axis2=2) / 3)[:, None, None] * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(stress - mean, axis=(1, 2))


def principal_stretches(F: Floats) -> Floats:
    """Return the (c, 3) principal stretches of (c, 3, 3) deformation gradients, ascending."""
    # twice as fast as singular values
    return np.sqrt(np.linalg.eigvalsh(F @ F.transpose(0, 2, 1)))


def hencky_equivalent(F: Floats) -> Floats:
    """Return the (c,) equivalent strains √(2/3 dev h : dev h) of the Hencky strain h = ln V.

    It is 0 where the shape is unchanged, and the logarithm of the stretch in a bar drawn out at constant volume.
    """
    h = np.log(principal_stretches(F))
    return np.sqrt(2 / 3) * np.linalg.norm(h - h.mean(axis=1, keepdims=True), axis=1)


def green_lagrange_maximum(F: Floats) -> Floats:
    """Return the (c,) largest principal values of the Green-Lagrange strain (FᵀF − I)/2."""
    return (principal_stretches(F)[:, -1] ** 2 - 1) / 2


def areal_stretch(F: Floats, N: Floats) -> Floats:
    """Return the (c,) ratios of areas, after to before, of planes with unit normals N (c, 3) before: det F·|F⁻ᵀ·N|."""
    rows = np.linalg.solve(F.transpose(0, 2, 1), N[:, :, None])[:, :, 0]
    return np.linalg.det(F) * np.linalg.norm(rows, axis=1)
