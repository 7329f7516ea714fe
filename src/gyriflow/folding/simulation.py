"""Time stepping: in each step growth, layers and a Newton solve; steps whose solve fails are halved."""

import time
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from ..errors import SolverError
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats
from ..mechanics.materials import MATERIALS
from ..settings.folding import FoldingParameters, require_maps
from ..settings.varying import Maps, value_at, value_range
from ..settings.weeks import WEEK_RANGE
from ..units import M_PER_MM, MM_PER_M, SECONDS_PER_GW
from .checkpoint import State
from .contact import STIFFNESS_PER_MODULUS, SelfContact
from .diagnosis import contact_row, elements_through, resolution_warning, unconverged_warning, worst_places
from .domain import Domain
from .growth import GrowthInputs, StepGrowth, StepStart
from .growth_models import growth_model
from .layers import shear_modulus
from .linear_solver import RUNGS, NotConvergedError
from .newton import NewtonSettings, NewtonSolver, Solution, residual_floor
from .output import print_line, warn
from .problem import NonlinearProblem
from .step_fields import SolvedStep, StepFields
from .stress import left_stretch, packed, relaxed, unpacked
from .tissue import Elements, Tissue
from .zones import Zones

STEPS_BEFORE_DOUBLING = 4
"""Accepted steps after which a halved time step is doubled again."""
MAX_STEP_VOLUME_RATIO = 2.0
"""Largest volume of an element after one step of growth by rates, over that before: more is not resolved in time."""


class Folding:
    """A brain that folds: the solver's objects, made once, and its steps.

    `mesh` is the start brain in RAS+ mm, whole on every rank; maps are at its vertices. `start` are its positions in m.
    `solved` is the last accepted step (at first, one without displacement); `fields` computes its fields until the next
    step begins.
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
            penalty_pa_per_m=p.contact.penalty_pa_per_m if p.contact.kind == "planes" else 0.0,
        )
        # of all weeks, so that it does not depend on the end of the run
        stiffest = value_range(p.shear_modulus_cortex_pa, self.maps, *WEEK_RANGE)[1]
        self.contact: SelfContact | None = None
        if p.contact.kind == "global":
            barrier_pa = STIFFNESS_PER_MODULUS * stiffest
            self.contact = SelfContact(self.domain, zones.facets, barrier_pa, stiffens=p.stress_memory_gw > 0)
            self.problem.contributions.append(self.contact)
        newton = NewtonSettings(p.solver.newton_tolerance)
        self.solver = NewtonSolver(self.problem, newton, residual_floor(mesh, stiffest))
        self.inputs = GrowthInputs.of(mesh, zones, self.maps)
        self.model = growth_model(p, self.inputs, mesh.vertices, comm.allreduce)
        self.solved = SolvedStep(self.problem.rest(), p.step_s, self.model(StepStart(mesh.vertices, 0.0, p.step_s)))
        self.fields = StepFields(self.problem, self.contact, zones, p)
        self.elements = Elements(self.domain.cells, self.domain.vertex_of_node, self.problem.points)
        self._pial = np.unique(zones.cortex_facets)

    def step(self, state: State, step_s: float) -> State:
        """Return the state after a step of a given length, with a new row of the step table.

        NotConvergedError if the step is too large.
        """
        began = time.monotonic()
        tissue, growth = self.begin(state, step_s)
        free = growth.guess(self.zones.fixed)
        guesses = state.initial_guesses(step_s) if free is None else [free, *state.initial_guesses(step_s)]
        solution = self.solver.solve(*map(self.domain.local, guesses))
        u = solution.displacement
        displacement = self.domain.gather(u[: self.domain.n_owned])
        positions = state.positions + displacement
        size = self.inputs.size(positions * MM_PER_M)
        thickness = value_at(self.parameters.thickness_mm, growth.start.week(self.parameters, 0.5), self.maps)
        stretch = None
        if self.parameters.keeps_stretch:
            stretch = self.domain.gather_cells(packed(left_stretch(self.problem.evaluate("elastic", u))))
        row = {
            "step": len(state.rows) + 1,
            "week": self.parameters.start_week + (state.time_s + step_s) / SECONDS_PER_GW,
            "dt_s": step_s,
            **self._solution_row(solution, displacement),
            **contact_row(self.contact, self.zones, u, positions),
            **growth.row(size),
            "elements_through_cortex": elements_through(
                self.domain, tissue.depth, float(np.mean(thickness)) * M_PER_MM
            ),
            "rung": RUNGS[solution.rung],
        }
        if growth.mean_deformation(self.elements) is None and row["max_J"] > MAX_STEP_VOLUME_RATIO:
            raise NotConvergedError(f"an element grows to {row['max_J']:.1f} times its volume")
        self.solved = SolvedStep(u, step_s, growth)
        grown = self.grown(state, growth)
        after = state.after(displacement, step_s, row, stretch, growth.correction(size), grown)
        row["seconds"] = time.monotonic() - began
        return after

    def begin(self, state: State, step_s: float) -> tuple[Tissue, StepGrowth]:
        """Set up the problem of a step; return its tissue, with the parameters at mid-step, and its growth."""
        start = StepStart(state.positions * MM_PER_M, state.time_s, step_s, state.correction)
        p, domain, week = self.parameters, self.domain, start.week(self.parameters, 0.5)
        if domain.positions is not state.positions:
            domain.place(state.positions)
        tissue = Tissue.of(self.elements, state.positions, self.zones, self.maps, p, week)
        part = domain.part
        if self.contact is not None:
            self.contact.begin_step()
            if self.problem.free:
                part = self.contact.join_touching(part)
        growth = self.model(start)
        mu = tissue.at_points(shear_modulus(p, tissue.weight, tissue.maps, week))
        self.problem.set_step(mu, growth.inverse(tissue), self._stretch(state, step_s), part)
        return tissue, growth

    def grown(self, state: State, growth: StepGrowth) -> Floats | None:
        """Return the deformation (m, 3, 3) of all elements by growth before and in a step, None if it is by rates."""
        mean = growth.mean_deformation(self.elements)
        if mean is None:
            return None
        grown = self.domain.gather_cells(mean)
        return grown if state.growth is None else grown @ state.growth

    def _stretch(self, state: State, step_s: float) -> Floats | None:
        if state.stretch is None:
            return None
        before = unpacked(state.stretch[self.domain.tet_of_cell])
        p = self.parameters
        return relaxed(before, step_s / SECONDS_PER_GW, p.stress_memory_gw, keeps_volume=p.relaxation == "shape")

    def _solution_row(self, solution: Solution, displacement: Floats) -> dict[str, float]:
        u, length = solution.displacement, np.linalg.norm(displacement, axis=1) * MM_PER_M
        ratios = self.problem.volume_ratios(u)
        return {
            "newton": solution.newton,
            "krylov": solution.krylov,
            "residual": solution.residual,
            "converged": solution.converged,
            "energy_J": self.problem.energy(u),
            "min_J": self.domain.min_over_ranks(ratios),
            "max_J": -self.domain.min_over_ranks(-ratios),
            "max_u_mm": float(length.max()),
            "mean_u_mm": float(length.mean()),
            "max_u_pial_mm": float(length[self._pial].max()),
            "mean_u_pial_mm": float(length[self._pial].mean()),
        }


def advance(folding: Folding, state: State, until_s: float) -> State:
    """Return the state after one accepted step towards `until_s`; the step is halved while its solve fails.

    SolverError if the smallest step fails too.
    """
    p = folding.parameters
    remaining = until_s - state.time_s
    # a remainder shorter than a whole step may be halved as often as a whole one
    whole = min(p.step_s, remaining) if state.step_s >= p.step_s else p.step_s
    smallest = whole / 2**p.solver.max_halvings
    while True:
        # a remainder as small as round-off gets no step of its own
        step_s = remaining if remaining < state.step_s * (1 + 1e-6) else state.step_s
        try:
            after = folding.step(state, step_s)
        except NotConvergedError as error:
            half = min(state.step_s, step_s) / 2
            if half < smallest * (1 - 1e-9):
                raise SolverError(
                    f"the step at GW {p.start_week + state.time_s / SECONDS_PER_GW:.3f} fails even with {step_s:g} s",
                    found=f"{error}; {worst_places(folding.solver)}",
                    remedy="The last good state is kept: the same command with an earlier folding.end_week or more "
                    "folding.solver.max_halvings resumes from it. A finer mesh or less growth may help.",
                ) from None
            if folding.domain.comm.rank == 0:
                print_line(f"step of {step_s:g} s failed ({error}): trying {half:g} s")
            state = replace(state, step_s=half, successes=0)
            continue
        if folding.domain.comm.rank == 0:
            coarse = resolution_warning(after.rows, folding.domain.order)
            for warning in filter(None, (unconverged_warning(after.rows[-1]), coarse)):
                warn(warning)
        if after.successes >= STEPS_BEFORE_DOUBLING and after.step_s < p.step_s:
            after = replace(after, step_s=min(2 * after.step_s, p.step_s), successes=0)
        return after
