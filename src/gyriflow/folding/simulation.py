"""Time stepping: in each step growth, layers and a Newton solve; steps whose solve
fails are halved."""

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from ..errors import SolverError
from ..geometry.jacobians import EDGES, chunks, determinants
from ..geometry.straightening import InnerSides
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats, dots
from ..mechanics.materials import MATERIALS
from ..settings.folding import FoldingParameters, require_maps
from ..settings.terms import ELEMENTS_NEEDED, is_too_coarse
from ..settings.varying import Maps, value_at, value_range
from ..settings.weeks import WEEK_RANGE
from ..units import M_PER_MM, MM_PER_M, SECONDS_PER_GW
from .checkpoint import State
from .contact import STIFFNESS_PER_MODULUS, SelfContact
from .domain import Domain
from .growth import GrowthInputs, StepGrowth, StepStart
from .growth_models import growth_model
from .layers import shear_modulus
from .linear_solver import RUNGS, NotConvergedError
from .newton import NewtonSettings, NewtonSolver, Solution, residual_floor
from .output import print_line
from .problem import NonlinearProblem
from .stretches import left_stretch, packed, relaxed, unpacked
from .tissue import Elements, Tissue
from .zones import Zones

log = logging.getLogger(__name__)
STEPS_BEFORE_DOUBLING = 4
"""Accepted steps after which a halved time step is doubled again."""
MIN_STRAIGHTNESS = 0.4
"""Straightness of a curved element (`geometry.straightening`) above which its inner
sides stay as they are."""
MAX_STEP_VOLUME_RATIO = 3.0
"""Largest growth in volume by rates in one step: more is not resolved in time."""


@dataclass(frozen=True, eq=False)
class SolvedStep:
    """A step: its displacement (k, 3) of the local nodes in m, its length, and how
    tissue grew."""

    displacement: Floats
    step_s: float
    growth: StepGrowth


class Folding:
    """A brain that folds: the solver's objects, made once, and its steps.

    `mesh` is the start brain in RAS+ mm, whole on every rank; maps are at its vertices.
    `start` are its positions in m. `solved` is the last accepted step; at first, one
    without displacement.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        mesh: TetrahedralMesh,
        zones: Zones,
        parameters: FoldingParameters,
        maps: Maps | None = None,
    ) -> None:
        p = self.parameters = parameters
        self.zones, self.maps = zones, maps or {}
        require_maps(p, self.maps, len(mesh.vertices))
        self.domain = Domain(comm, mesh)
        self.start = self.domain.positions
        self.problem = NonlinearProblem(
            self.domain,
            zones,
            MATERIALS[p.material](p.poisson_ratio),
            has_planes=p.contact == "planes",
        )
        # of all weeks, so that it does not depend on the end of the run
        stiffest = value_range(
            p.shear_modulus_cortex_pa,
            self.maps,
            *WEEK_RANGE,
        )[1]
        self.contact: SelfContact | None = None
        if p.contact == "global":
            barrier_pa = STIFFNESS_PER_MODULUS * stiffest
            self.contact = SelfContact(
                self.domain, zones.facets, barrier_pa, stiffens=p.stress_memory_gw > 0
            )
            self.problem.contributions.append(self.contact)
        newton = NewtonSettings(p.newton_tolerance)
        self.solver = NewtonSolver(
            self.problem,
            newton,
            residual_floor(mesh, stiffest),
        )
        self.inputs = GrowthInputs(
            mesh,
            zones,
            self.maps,
            comm.allreduce,
        )
        self.model = growth_model(p, self.inputs)
        self.solved = SolvedStep(
            self.problem.rest(),
            p.step_s,
            self.model(
                StepStart(
                    mesh.vertices,
                    0.0,
                    p.step_s,
                )
            ),
        )
        self.elements = Elements(
            self.domain.cells, self.domain.vertex_of_node, self.problem.points
        )
        # with stress memory, or growth that is recorded by element, tissue must stay in
        # its element
        has_free_nodes = mesh.order == 2 and p.stress_memory_gw == 0 and not p.targets
        self._inner_sides = InnerSides.of(mesh) if has_free_nodes else None

    def step(self, state: State, step_s: float) -> State:
        """Return the state after a step of a given length, with a new row of the step
        table.

        NotConvergedError if the step is too large.
        """
        began = time.monotonic()
        p = self.parameters
        tissue, growth = self.begin(state, step_s)
        guesses = state.initial_guesses(step_s)
        free = growth.guess(self.zones.fixed)
        if free is not None:
            guesses.insert(0, free)
        solution = self.solver.solve(*map(self.domain.local, guesses))
        u = solution.displacement
        displacement = self.domain.gather(u[: self.domain.n_owned])
        positions = state.positions + displacement
        size = self.inputs.size(positions * MM_PER_M)
        stretch = None
        if p.stress_memory_gw > 0:
            elastic = self.problem.evaluate("elastic", u)
            stretch = self.domain.gather_cells(packed(left_stretch(elastic)))
        row = {
            "step": len(state.rows) + 1,
            "week": p.start_week + (state.time_s + step_s) / SECONDS_PER_GW,
            "dt_s": step_s,
            **self._solution_row(solution, displacement),
            **self._contact_row(u, positions),
            **growth.row(size),
            "elements_through_cortex": self._elements_through_cortex(tissue, growth),
            "rung": RUNGS[solution.rung],
        }
        self.solved = SolvedStep(u, step_s, growth)
        after = state.after(
            displacement,
            step_s,
            row,
            stretch,
            growth.correction(size),
            self.grown(state, growth),
        )
        if self._inner_sides is not None:
            after = replace(after, positions=self._straightened(after.positions))
        row["seconds"] = time.monotonic() - began
        return after

    def _straightened(self, positions: Floats) -> Floats:
        """Return (n, 3) positions in m with straighter inner sides of elements that are
        about to fold over.

        Nothing pulls the inner nodes of tissue without stress back, so that sides bow
        until a corner of their element turns over.
        """
        straight = None
        if self.domain.comm.rank == 0 and self._inner_sides is not None:
            straight = self._inner_sides.straighten(positions, MIN_STRAIGHTNESS)
        # from rank 0, since other processors may round differently
        return self.domain.comm.bcast(straight, root=0)

    def begin(self, state: State, step_s: float) -> tuple[Tissue, StepGrowth]:
        """Set up the problem of a step; return its tissue, with the parameters at
        mid-step, and its growth."""
        p = self.parameters
        domain = self.domain
        start = StepStart(
            state.positions * MM_PER_M, state.time_s, step_s, state.correction
        )
        week = start.week(p, 0.5)
        if domain.positions is not state.positions:
            domain.place(state.positions)
        tissue = Tissue.of(
            self.elements, state.positions, self.zones, self.maps, p, week
        )
        part = domain.part
        if self.contact is not None:
            self.contact.begin_step()
            if self.problem.free:
                part = self.contact.join_touching(part)
        stretch = None
        if state.stretch is not None:
            before = unpacked(state.stretch[domain.tet_of_cell])
            step_gw = step_s / SECONDS_PER_GW
            stretch = relaxed(before, step_gw, p.stress_memory_gw)
        growth = self.model(start)
        modulus = _modulus_of_tissue(p, tissue, week)
        inverse = growth.inverse(tissue)
        self.problem.set_step(
            tissue.at_points(modulus),
            inverse,
            stretch,
            part,
        )
        if not p.targets:
            ratio = 1.0 / domain.min_over_ranks(determinants(inverse))
            if ratio > MAX_STEP_VOLUME_RATIO:
                raise NotConvergedError(
                    f"tissue grows to {ratio:.1f} times its volume in one step"
                )
        return tissue, growth

    def grown(self, state: State, growth: StepGrowth) -> Floats | None:
        """Return the deformation (m, 3, 3) of all elements by growth before and in a
        step, None if it is by rates."""
        mean = growth.mean_deformation(self.elements)
        if mean is None:
            return None
        grown = self.domain.gather_cells(mean)
        return grown if state.growth is None else grown @ state.growth

    def _elements_through_cortex(self, tissue: Tissue, growth: StepGrowth) -> float:
        """Return the cortical thickness at mid-step over the mean edge length of the
        elements in the cortex.

        It is NaN if there are none, and if growth has no layers, so that depths are not
        needed.
        """
        p = self.parameters
        if not p.growth.definition.has_layers:
            return math.nan
        week = growth.start.week(p, 0.5)
        thickness_mm = value_at(p.thickness_mm, week, self.maps)
        thickness = float(np.mean(thickness_mm)) * M_PER_MM
        domain = self.domain
        depth = tissue.layers.depth[domain.corners].mean(axis=1)
        inside = domain.corners[depth <= thickness]
        own_total = 0.0
        for chunk in chunks(len(inside)):
            places = np.take(domain.nodes, inside[chunk].T, axis=0)
            for i, j in EDGES:
                edges = places[i] - places[j]
                own_total += np.sqrt(dots(edges, edges)).sum()
        own_count = len(EDGES) * len(inside)
        total, count = domain.comm.allreduce(np.array([own_total, own_count]))
        return float(thickness * count / total) if count else math.nan

    def _solution_row(
        self, solution: Solution, displacement: Floats
    ) -> dict[str, float]:
        u = solution.displacement
        length = np.linalg.norm(displacement, axis=1) * MM_PER_M
        smallest, largest = self.problem.volume_range(u)
        return {
            "newton": solution.newton,
            "krylov": solution.krylov,
            "residual": solution.residual,
            "converged": solution.converged,
            "energy_J": self.problem.energy(u),
            "min_J": smallest,
            "max_J": largest,
            "max_u_mm": float(length.max()),
        }

    def _contact_row(self, u: Floats, positions: Floats) -> dict[str, float]:
        if self.contact is None:
            return {
                "plane_penetration_mm": self.zones.penetration_mm(positions * MM_PER_M)
            }
        distance = self.contact.smallest_distance_mm(u)
        return {
            "contact_distance_mm": self.contact.distance_mm,
            "contact_stiffness_pa": self.contact.stiffness_pa,
            "contact_pairs": self.contact.pair_count(u),
            # only pairs within the contact distance are searched for
            "min_distance_mm": distance if distance < math.inf else math.nan,
        }


def advance(
    folding: Folding,
    state: State,
    until_s: float,
) -> State:
    """Return the state after one accepted step towards `until_s`; the step is halved
    while its solve fails.

    SolverError if the smallest step fails too.
    """
    p = folding.parameters
    remaining = until_s - state.time_s
    # a remainder shorter than a whole step may be halved as often as a whole one
    whole = min(p.step_s, remaining) if state.step_s >= p.step_s else p.step_s
    smallest = whole / 2**p.max_halvings
    while True:
        # a remainder as small as round-off gets no step of its own
        step_s = remaining if remaining < state.step_s * (1 + 1e-6) else state.step_s
        try:
            after = folding.step(state, step_s)
        except NotConvergedError as error:
            half = min(state.step_s, step_s) / 2
            if half < smallest * (1 - 1e-9):
                raise SolverError(
                    f"the step at GW {p.start_week + state.time_s / SECONDS_PER_GW:.3f}"
                    f" fails even with {step_s:g} s",
                    found=f"{error}; {folding.solver.worst_places()}",
                    remedy=(
                        "The last good state is kept: the same command with an earlier"
                        " folding.end_week or more folding.max_halvings resumes"
                        " from it. A finer mesh or less growth may help."
                    ),
                ) from None
            if folding.domain.comm.rank == 0:
                print_line(f"step of {step_s:g} s failed ({error}): trying {half:g} s")
            state = replace(state, step_s=half, successes=0)
            continue
        if folding.domain.comm.rank == 0:
            _warn_of_unconverged(after.rows[-1])
            if p.growth.definition.has_layers:
                _warn_of_coarse_cortex(after.rows, folding.domain.order)
        if after.successes >= STEPS_BEFORE_DOUBLING and after.step_s < p.step_s:
            after = replace(
                after,
                step_s=min(2 * after.step_s, p.step_s),
                successes=0,
            )
        return after


def _modulus_of_tissue(
    p: FoldingParameters,
    tissue: Tissue,
    week: float,
) -> Floats:
    """Return the shear modulus in Pa of tissue like its `weight`, which is not needed
    where cortex and core are equally stiff."""
    is_uniform = p.shear_modulus_cortex_pa == p.shear_modulus_core_pa
    weight = np.zeros_like(tissue.growing) if is_uniform else tissue.weight
    return shear_modulus(p, weight, tissue.maps, week)


def _warn_of_coarse_cortex(rows: Sequence[dict], order: int) -> None:
    """Warn at the first step with too few elements through the cortex."""
    coarse = [is_too_coarse(order, row["elements_through_cortex"]) for row in rows[-2:]]
    if coarse in ([True], [False, True]):
        start = f"GW {rows[-1]['week']:.2f}" if len(rows) > 1 else "the start"
        log.warning(
            "from %s on fewer than %g elements lie through the cortex, so folds may be"
            " mesh noise: reduce mesh.surface_edge_mm to resolve the growing cortex"
            " longer",
            start,
            ELEMENTS_NEEDED[order],
        )


def _warn_of_unconverged(row: dict) -> None:
    """Warn if a step ended above the tolerance."""
    if not row["converged"]:
        log.warning(
            "step %s ends at %.1e of its initial residual, above"
            " folding.newton_tolerance: round-off prevents further progress",
            row["step"],
            row["residual"],
        )
