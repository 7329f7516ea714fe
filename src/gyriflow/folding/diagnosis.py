"""What a step says of itself: contact, resolution and worst places for the step table, warnings and messages."""

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
    """Return a thickness below the pial surface in mean edges of the present elements in it; NaN where there are none.

    `distance` (k,) is that of the local nodes to the pial surface, in m as the thickness.
    """
    inside = domain.corners[distance[domain.corners].mean(axis=1) <= thickness]
    nodes = domain.local(domain.positions)
    lengths = sum(float(np.linalg.norm(nodes[inside[:, i]] - nodes[inside[:, j]], axis=1).sum()) for i, j in EDGES)
    total, count = domain.comm.allreduce(np.array([lengths, len(EDGES) * len(inside)]))
    return float(thickness * count / total) if count else math.nan


def resolution_warning(rows: Sequence[dict], order: int) -> str:
    """Return what to say where the cortex has just come to be resolved too coarsely; empty where it has not."""
    # not a number where no element has its centre in the cortex: none lies through it
    through = [
        0.0 if math.isnan(row["elements_through_cortex"]) else row["elements_through_cortex"] for row in rows[-2:]
    ]
    now, before = through[-1], through[0] if len(through) > 1 else math.inf
    if not now < ELEMENTS_NEEDED[order] <= before:
        return ""
    since = f"since it grows, from GW {rows[-1]['week']:.2f} on" if len(rows) > 1 else "from the start on"
    return (
        f"{since} fewer than {ELEMENTS_NEEDED[order]:g} elements lie through the cortex: folds may be mesh noise; "
        "a smaller mesh.surface_edge_mm resolves it to a later week"
    )


def unconverged_warning(row: dict) -> str:
    """Return what to say of a step that ended above the tolerance; empty of others."""
    if row["converged"]:
        return ""
    return (
        f"step {row['step']} ends at {row['residual']:.1e} of its first residual, above "
        "folding.solver.newton_tolerance: nothing was left to gain but round-off"
    )


def contact_row(contact: SelfContact | None, zones: Zones, u: Floats, positions: Floats) -> dict[str, float]:
    """Return the columns of contact for a step's displacement u (k, 3) in m that led to (n, 3) positions in m."""
    if contact is None:
        return {"plane_penetration_mm": zones.penetration_mm(positions * MM_PER_M)}
    distance = contact.smallest_distance_mm(u)
    return {
        "contact_distance_mm": contact.barrier.distance_mm,
        "contact_stiffness_pa": contact.barrier.stiffness_pa,
        "contact_pairs": contact.pair_count(u),
        # pairs farther apart than the barrier reaches are not searched for
        "min_distance_mm": distance if distance < math.inf else math.nan,
    }


def worst_places(solver: NewtonSolver) -> str:
    """Return where the last solve ended worst: the most compressed element and the largest residual, in mm."""
    problem, domain, last = solver.problem, solver.problem.domain, solver.last
    assert last is not None
    before = domain.local(domain.positions)
    ratios = problem.volume_ratios(last.displacement) if solver.inverted is None else solver.inverted
    forces = -np.linalg.norm(last.owned.reshape(-1, 3), axis=1)
    centres = before[domain.corners].mean(axis=1) * MM_PER_M
    ratio, tet, centre = domain.least(ratios.min(axis=1), domain.tet_of_cell, centres)
    force, vertex, place = domain.least(forces, domain.vertex_of_node, before * MM_PER_M)
    return (
        f"smallest det F {ratio:.3g} in element {tet} at {np.round(centre, 1).tolist()} mm, "
        f"largest residual {-force:.2e} N at vertex {vertex} at {np.round(place, 1).tolist()} mm"
    )
