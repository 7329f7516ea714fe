"""Fields of a solved step, written to frames: stress, strain and contact pressure, and
the tensor measures they need.

Arrays of tensors are (c, 3, 3), of scalars (c,).
"""

from collections.abc import Collection

import numpy as np

from ..geometry.triangles import Floats
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
    at_vertices: dict[str, Floats] = {}
    if folding.contact is not None and "contact_pressure" in names:
        pressure_pa = folding.contact.pressure(folding.solved.displacement)
        at_vertices = _as_rates(folding, {"contact_pressure_pa": pressure_pa})
    is_elastic = folding.parameters.growth.definition.measured != "shapes"
    fields: dict[str, Floats] = {}
    if is_elastic:
        fields |= _as_rates(folding, _elastic_fields(folding, names))
    fields |= _total_fields(folding, names)
    if not fields:
        return at_vertices, {}
    points = folding.problem.points
    means = []
    for values in fields.values():
        by_element = values.reshape(-1, len(points.weights))
        means.append(by_element @ points.weights)
    gathered = folding.domain.gather_cells(np.stack(means, axis=1))
    return at_vertices, dict(
        zip(
            fields,
            gathered.T,
            strict=True,
        )
    )


def _as_rates(folding: Folding, fields: dict[str, Floats]) -> dict[str, Floats]:
    """Return fields per week, without stress memory."""
    if folding.parameters.stress_memory_gw > 0:
        return fields
    steps_per_gw = SECONDS_PER_GW / folding.solved.step_s
    return {f"{name}_per_gw": values * steps_per_gw for name, values in fields.items()}


def _elastic_fields(folding: Folding, names: Collection[str]) -> dict[str, Floats]:
    """Return fields of stress and elastic strain at a rank's points."""
    problem = folding.problem
    u = folding.solved.displacement
    fields: dict[str, Floats] = {}
    if "stress" in names:
        stress = problem.evaluate("stress", u).reshape(-1, 3, 3)
        fields["von_mises_pa"] = _von_mises(stress)
        fields["pressure_pa"] = _pressure(stress)
    if "strain" in names:
        elastic = problem.evaluate("elastic", u).reshape(-1, 3, 3)
        fields["elastic_strain"] = _hencky_equivalent(elastic)
        fields["elastic_volume_strain"] = np.log(np.linalg.det(elastic))
    return fields


def _total_fields(folding: Folding, names: Collection[str]) -> dict[str, Floats]:
    """Return fields of the deformation since the start of the run, and of the step's
    volume ratio, at a rank's points."""
    domain = folding.domain
    slopes = folding.problem.points.gradients
    u = folding.solved.displacement
    start = domain.local(folding.start)
    after = domain.nodes + u
    fields: dict[str, Floats] = {}
    if "strain" in names or "volume_ratio" in names:
        total = deformation_gradients(start, after, domain.cells, slopes)
        total = total.reshape(-1, 3, 3)
    if "strain" in names:
        search = PialSearch(folding.start, folding.zones.cortex_facets)
        centres = start[domain.corners].mean(axis=1)
        normals = np.repeat(
            search.nearest_normals(centres),
            len(slopes),
            axis=0,
        )
        fields["total_strain"] = _green_lagrange_maximum(total)
        fields["area_stretch"] = _areal_stretch(total, normals)
    if "volume_ratio" in names:
        deformation = folding.problem.evaluate("deformation", u).reshape(-1, 3, 3)
        fields["volume_ratio_step"] = np.linalg.det(deformation)
        fields["volume_ratio"] = np.linalg.det(total)
    return fields


def _pressure(stress: Floats) -> Floats:
    """Return the (c,) pressures −tr(σ)/3, positive where tissue is pressed, in the unit
    of the stress."""
    return (
        -np.trace(
            stress,
            axis1=1,
            axis2=2,
        )
        / 3
    )


def _von_mises(stress: Floats) -> Floats:
    """Return the (c,) equivalent stresses √(3/2 dev σ : dev σ), in the unit of the
    stress."""
    mean = (
        np.trace(
            stress,
            axis1=1,
            axis2=2,
        )
        / 3
    )
    isotropic = mean[:, None, None] * np.eye(3)
    deviator = stress - isotropic
    norm = np.linalg.norm(
        deviator,
        axis=(1, 2),
    )
    return np.sqrt(1.5) * norm


def _principal_stretches(F: Floats) -> Floats:
    """Return the (c, 3) principal stretches of (c, 3, 3) deformation gradients,
    ascending."""
    # twice as fast as singular values
    return np.sqrt(np.linalg.eigvalsh(F @ F.transpose(0, 2, 1)))


def _hencky_equivalent(F: Floats) -> Floats:
    """Return the (c,) equivalent strains √(2/3 dev h : dev h) of the Hencky strain h =
    ln V.

    It is 0 where the shape is unchanged, and the logarithm of the stretch in a bar
    drawn out at constant volume.
    """
    h = np.log(_principal_stretches(F))
    mean = h.mean(axis=1, keepdims=True)
    deviator = h - mean
    norm = np.linalg.norm(deviator, axis=1)
    return np.sqrt(2 / 3) * norm


def _green_lagrange_maximum(F: Floats) -> Floats:
    """Return the (c,) largest principal values of the Green-Lagrange strain (FᵀF −
    I)/2."""
    return (_principal_stretches(F)[:, -1] ** 2 - 1) / 2


def _areal_stretch(F: Floats, N: Floats) -> Floats:
    """Return the (c,) ratios of areas, after to before, of planes with unit normals N
    (c, 3) before: det F·|F⁻ᵀ·N|."""
    turned = np.linalg.solve(
        F.transpose(0, 2, 1),
        N[..., None],
    )
    return np.linalg.det(F) * np.linalg.norm(turned[..., 0], axis=1)
