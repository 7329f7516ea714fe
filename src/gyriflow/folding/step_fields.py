"""Fields of a solved step, written to frames: stress, strain and contact pressure, and the tensor measures they need.

Arrays of tensors are (c, 3, 3), of scalars (c,).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..geometry.triangles import Floats
from ..settings.folding import FoldingParameters
from ..settings.terms import ELEMENT_FIELDS
from ..units import SECONDS_PER_GW
from .contact import SelfContact
from .growth import StepGrowth
from .layers import PialSearch
from .problem import NonlinearProblem
from .stretches import deformation_gradients
from .zones import Zones


@dataclass(frozen=True, eq=False)
class SolvedStep:
    """A step: its displacement (k, 3) of the local nodes in m, its length, and how tissue grew."""

    displacement: Floats
    step_s: float
    growth: StepGrowth


class StepFields:
    """The fields of a solved step, by names of the parameter `fields`. Names of arrays contain units.

    Fields are computed with the problem of the step, whose mesh stays at the start of the step until the next one
    begins. Without stress memory, stress, strain and contact pressure of a step are proportional to its length, so they
    are given per week; but a pressure and an elastic change of volume that tissue keeps are not divided by time. Growth
    towards shapes leaves no stress and elastic strain but next to contact, where they depend on the mesh: there are
    none.
    """

    def __init__(
        self, problem: NonlinearProblem, contact: SelfContact | None, zones: Zones, parameters: FoldingParameters
    ) -> None:
        self.problem, self.contact, domain = problem, contact, problem.domain
        self._is_elastic = parameters.growth.definition.measured != "shapes"
        self._remembers = parameters.stress_memory_gw > 0
        self._kept = {"pressure_pa", "elastic_volume_strain"} if parameters.keeps_volume_only else set()
        self._start = domain.local(domain.positions)
        if "strain" in parameters.fields:
            centres = self._start[domain.corners].mean(axis=1)
            self._start_normals = PialSearch(domain.positions, zones.cortex_facets).nearest_normals(centres)

    def elements(self, names: Iterable[str], step: SolvedStep) -> dict[str, Floats]:
        """Return those of the named fields that elements have, (m,), averaged over points, equal on every rank."""
        problem, u, domain = self.problem, step.displacement, self.problem.domain
        fields: dict[str, Floats] = {}
        names = {*names} & {*ELEMENT_FIELDS} - (set() if self._is_elastic else {"stress"})
        if not names:
            return fields
        slopes = problem.points.gradients
        after = domain.local(domain.positions) + u
        total = deformation_gradients(self._start, after, domain.cells, slopes).reshape(-1, 3, 3)
        if "stress" in names:
            stress = problem.evaluate("stress", u).reshape(-1, 3, 3)
            fields |= {"von_mises_pa": von_mises(stress), "pressure_pa": pressure(stress)}
        if "strain" in names and self._is_elastic:
            Fe = problem.evaluate("elastic", u).reshape(-1, 3, 3)
            fields |= {"elastic_strain": hencky_equivalent(Fe), "elastic_volume_strain": np.log(np.linalg.det(Fe))}
        fields = self._per_gw(fields, step.step_s)
        if "strain" in names:
            normals = np.repeat(self._start_normals, len(slopes), axis=0)
            fields |= {"total_strain": green_lagrange_maximum(total), "area_stretch": areal_stretch(total, normals)}
        if "volume_ratio" in names:
            fields["volume_ratio_step"] = np.linalg.det(problem.evaluate("deformation", u).reshape(-1, 3, 3))
            fields["volume_ratio"] = np.linalg.det(total)
        means = [values.reshape(-1, len(slopes)) @ problem.points.weights for values in fields.values()]
        gathered = domain.gather_cells(np.stack(means, axis=1))
        return dict(zip(fields, gathered.T, strict=True))

    def contact_pressure(self, names: Iterable[str], step: SolvedStep) -> dict[str, Floats]:
        """Return the contact pressure (n,) at all vertices, if it is one of the named fields."""
        if self.contact is None or "contact_pressure" not in names:
            return {}
        return self._per_gw({"contact_pressure_pa": self.contact.pressure(step.displacement)}, step.step_s)

    def _per_gw(self, fields: dict[str, Floats], step_s: float) -> dict[str, Floats]:
        if self._remembers:
            return fields
        kept = {name: values for name, values in fields.items() if name in self._kept}
        rates = {name: values for name, values in fields.items() if name not in self._kept}
        return kept | {f"{name}_per_gw": values * (SECONDS_PER_GW / step_s) for name, values in rates.items()}


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
