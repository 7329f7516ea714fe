"""Diagnostics of a step: contact and resolution for the step table, warnings, and where a failed solve was worst."""

import math
from collections.abc import Sequence

import numpy as np

from ..geometry.jacobians import EDGES
from ..geometry.triangles import Floats
from ..settings.terms import ELEMENTS_NEEDED
from ..units import MM_PER_M
from .contact import SelfContact
from .domain import Domain
from .newton import NewtonSolver
from .zones import Zones


def elements_through(domain: Domain, distance: Floats, thickness: float) -> float:
    """Return a cortical thickness over the mean edge length of the elements in the cortex; NaN if there are none.

    `distance` (k,) is from the local nodes to the pial surface, in m like the thickness.
    """
    inside = domain.corners[distance[domain.corners].mean(axis=1) <= thickness]
    nodes = domain.local(domain.positions)
    lengths = sum(float(np.linalg.norm(nodes[inside[:, i]] - nodes[inside[:, j]], axis=1).sum()) for i, j in EDGES)
    total, count = domain.comm.allreduce(np.array([lengths, len(EDGES) * len(inside)]))
    return float(thickness * count / total) if count else math.nan


def resolution_warning(rows: Sequence[dict], order: int) -> str:
    """Return a warning at the first step with too few elements through the cortex, else an empty text."""
    # NaN: no element has its centre in the cortex
    through = [
        0.0 if math.isnan(row["elements_through_cortex"]) else row["elements_through_cortex"] for row in rows[-2:]
    ]
    current, before = through[-1], through[0] if len(through) > 1 else math.inf
    if not current < ELEMENTS_NEEDED[order] <= before:
        return ""
    start = f"from GW {rows[-1]['week']:.2f} on" if len(rows) > 1 else "from the start on"
    return (
        f"{start} fewer than {ELEMENTS_NEEDED[order]:g} elements lie through the cortex, so folds may be mesh noise: "
        "reduce mesh.surface_edge_mm to resolve the growing cortex longer"
    )


def unconverged_warning(row: dict) -> str:
    """Return a warning if a step ended above the tolerance, else an empty text."""
    if row["converged"]:
        return ""
    return (
        f"step {row['step']} ends at {row['residual']:.1e} of its initial residual, above "
        "folding.solver.newton_tolerance: round-off prevents further progress"
    )


def contact_row(contact: SelfContact | None, zones: Zones, u: Floats, positions: Floats) -> dict[str, float]:
    """Return the contact columns of the step table, for a displacement u (k, 3) and new positions (n, 3) in m."""
    if contact is None:
        return {"plane_penetration_mm": zones.penetration_mm(positions * MM_PER_M)}
    distance = contact.smallest_distance_mm(u)
    return {
        "contact_distance_mm": contact.barrier.distance_mm,
        "contact_stiffness_pa": contact.barrier.stiffness_pa,
        "contact_pairs": contact.pair_count(u),
        # only pairs within the contact distance are searched for
        "min_distance_mm": distance if distance < math.inf else math.nan,
    }


def worst_places(solver: NewtonSolver) -> str:
    """Return where a failed solve was worst: the most compressed element and the largest residual, in mm."""
    problem, domain = solver.problem, solver.problem.domain
    last = solver.last or problem.residual(problem.rest())
    before = domain.local(domain.positions)
    ratios = problem.volume_ratios(last.displacement) if solver.inverted is None else solver.inverted
    forces = -np.linalg.norm(last.owned.reshape(-1, 3), axis=1)
    centres = before[domain.corners].mean(axis=1) * MM_PER_M
    ratio, tet, centre = domain.locate_minimum(ratios.min(axis=1), domain.tet_of_cell, centres)
    force, vertex, position = domain.locate_minimum(forces, domain.vertex_of_node, before * MM_PER_M)
    return (
        f"smallest det F {ratio:.3g} in element {tet} at {np.round(centre, 1).tolist()} mm, "
        f"largest residual {-force:.2e} N at vertex {vertex} at {np.round(position, 1).tolist()} mm"
    )
