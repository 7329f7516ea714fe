"""Fields of a solved step, written to frames: stress, strain and contact pressure, and
the tensor measures they need.

Arrays of tensors are (c, 3, 3), of scalars (c,).
"""

from collections.abc import Collection

import numpy as np

from ..geometry.triangles import Floats
from ..settings.terms import ELEMENT_FIELDS
from ..units import SECONDS_PER_GW
from .layers import PialSearch
from .simulation import Folding
from .stretches import deformation_gradients


def step_fields(
    folding: Folding, names: Collection[str]
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Return fields of the last solved step, by names of the parameter `fields`; names
    of arrays contain units.

    The first ones are at all vertices (n,): contact pressure. The second ones are those
    of elements (m,), averaged over points. Both are equal on every rank. The problem's
    mesh is still at the start of the step. Without stress memory, stress, strain and
    contact pressure of a step are proportional to its length, so they are given per
    week. Growth towards shapes leaves no stress and elastic strain but next to
    contact, where they depend on the mesh: there are none.
    """
    p = folding.parameters
    problem = folding.problem
    domain = folding.domain
    u = folding.solved.displacement

    def as_rates(fields: dict[str, Floats]) -> dict[str, Floats]:
        if p.stress_memory_gw > 0:
            return fields
        steps_per_gw = SECONDS_PER_GW / folding.solved.step_s
        return {
            f"{name}_per_gw": values * steps_per_gw for name, values in fields.items()
        }

    at_vertices: dict[str, Floats] = {}
    if folding.contact is not None and "contact_pressure" in names:
        at_vertices = as_rates({"contact_pressure_pa": folding.contact.pressure(u)})
    is_elastic = p.growth.definition.measured != "shapes"
    element_names = {*names} & {*ELEMENT_FIELDS} - (set() if is_elastic else {"stress"})
    if not element_names:
        return at_vertices, {}
    fields: dict[str, Floats] = {}
    start, slopes = domain.local(folding.start), problem.points.gradients
    after = domain.local(domain.positions) + u
    total = deformation_gradients(start, after, domain.cells, slopes).reshape(-1, 3, 3)
    if "stress" in element_names:
        stress = problem.evaluate("stress", u).reshape(-1, 3, 3)
        fields |= {"von_mises_pa": von_mises(stress), "pressure_pa": pressure(stress)}
    if "strain" in element_names and is_elastic:
        Fe = problem.evaluate("elastic", u).reshape(-1, 3, 3)
        fields |= {
            "elastic_strain": hencky_equivalent(Fe),
            "elastic_volume_strain": np.log(np.linalg.det(Fe)),
        }
    fields = as_rates(fields)
    if "strain" in element_names:
        search = PialSearch(folding.start, folding.zones.cortex_facets)
        normals = np.repeat(
            search.nearest_normals(start[domain.corners].mean(axis=1)),
            len(slopes),
            axis=0,
        )
        fields |= {
            "total_strain": green_lagrange_maximum(total),
            "area_stretch": areal_stretch(total, normals),
        }
    if "volume_ratio" in element_names:
        fields["volume_ratio_step"] = np.linalg.det(
            problem.evaluate("deformation", u).reshape(-1, 3, 3)
        )
        fields["volume_ratio"] = np.linalg.det(total)
    means = [
        values.reshape(-1, len(slopes)) @ problem.points.weights
        for values in fields.values()
    ]
    gathered = domain.gather_cells(np.stack(means, axis=1))
    return at_vertices, dict(zip(fields, gathered.T, strict=True))


def pressure(stress: Floats) -> Floats:
    """Return the (c,) pressures −tr(σ)/3, positive where tissue is pressed, in the unit
    of the stress."""
    return -np.trace(stress, axis1=1, axis2=2) / 3


def von_mises(stress: Floats) -> Floats:
    """Return the (c,) equivalent stresses √(3/2 dev σ : dev σ), in the unit of the
    stress."""
    mean = (np.trace(stress, axis1=1, axis2=2) / 3)[:, None, None] * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(stress - mean, axis=(1, 2))


def principal_stretches(F: Floats) -> Floats:
    """Return the (c, 3) principal stretches of (c, 3, 3) deformation gradients,
    ascending."""
    # twice as fast as singular values
    return np.sqrt(np.linalg.eigvalsh(F @ F.transpose(0, 2, 1)))


def hencky_equivalent(F: Floats) -> Floats:
    """Return the (c,) equivalent strains √(2/3 dev h : dev h) of the Hencky strain h =
    ln V.

    It is 0 where the shape is unchanged, and the logarithm of the stretch in a bar
    drawn out at constant volume.
    """
    h = np.log(principal_stretches(F))
    return np.sqrt(2 / 3) * np.linalg.norm(h - h.mean(axis=1, keepdims=True), axis=1)


def green_lagrange_maximum(F: Floats) -> Floats:
    """Return the (c,) largest principal values of the Green-Lagrange strain (FᵀF −
    I)/2."""
    return (principal_stretches(F)[:, -1] ** 2 - 1) / 2


def areal_stretch(F: Floats, N: Floats) -> Floats:
    """Return the (c,) ratios of areas, after to before, of planes with unit normals N
    (c, 3) before: det F·|F⁻ᵀ·N|."""
    rows = np.linalg.solve(F.transpose(0, 2, 1), N[:, :, None])[:, :, 0]
    return np.linalg.det(F) * np.linalg.norm(rows, axis=1)
