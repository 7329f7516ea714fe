"""One step after the other: growth, layers, a Newton solve, the moved mesh; halved steps where a solve fails."""

import math
import time
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from ..errors import SolverError
from ..geometry.diffusion import Share
from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from ..geometry.triangles import Floats
from ..mechanics.materials import MATERIALS
from ..settings.folding import FoldingParameters, require_maps
from ..settings.varying import Maps, value_at, value_range
from ..units import M_PER_MM, MM_PER_M, SECONDS_PER_GW
from .checkpoint import State
from .contact import STIFFNESS_PER_MODULUS, SelfContact
from .diagnosis import contact_row, elements_through, resolution_warning, unconverged_warning, worst_places
from .domain import Domain
from .growth import Growth, GrowthInputs, StepStart
from .growth_models import growth_model
from .layers import PialSearch, Tissue, shear_modulus
from .linear_solver import RUNGS, NotConvergedError
from .newton import NewtonSettings, NewtonSolver, StepCount
from .output import say, warn
from .problem import Problem
from .step_fields import StepFields
from .stress import left_stretch, packed, relaxed, unpacked
from .zones import Zones

PENALTY_PA_PER_M = 5.0e5
"""Pressure per depth of penetration at the planes of contact (the paper)."""
STEPS_BEFORE_GROWING = 4
"""Accepted steps after which a halved time step is doubled again."""


class Folding:
    """A brain that folds: the solver's objects, made once, and one step at a time.

    The mesh is that at the start, RAS+ mm, whole on every rank; maps are at its vertices. `growth` is how tissue grew
    in the last step, or will in the first one.
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
        self.problem = Problem(
            self.domain,
            zones,
            MATERIALS[p.material](p.poisson_ratio),
            penalty_pa_per_m=PENALTY_PA_PER_M if p.contact.kind == "planes" else 0.0,
            remembers_stress=p.stress_memory_gw > 0,
        )
        stiffest = value_range(p.shear_modulus_cortex_pa, self.maps, p.start_week, p.end_week)[1]
        self.contact: SelfContact | None = None
        if p.contact.kind == "global":
            barrier = STIFFNESS_PER_MODULUS * stiffest, p.contact.distance_mm
            self.contact = SelfContact(self.domain, self.problem.displacement, zones.facets, *barrier)
            self.problem.contributions.append(self.contact)
        newton = NewtonSettings(p.solver.newton_tolerance, max_newton=p.solver.max_newton)
        edge = float(np.cbrt(signed_volumes(mesh).mean())) * M_PER_MM
        floor = 1e-11 * stiffest * edge**2 * math.sqrt(len(mesh.vertices))
        self.solver = NewtonSolver(self.problem, newton, floor)
        self.inputs = GrowthInputs.of(mesh, zones, self.maps)
        share = Share(comm.rank, comm.size, self.domain.summed)
        self.model = growth_model(p, self.inputs, mesh.vertices, share)
        self.growth: Growth = self.model(StepStart(mesh.vertices, 0.0, p.step_s))
        self.fields = StepFields(self.domain, self.problem, self.contact, zones, p)
        self._growing = self.domain.local(zones.growth)
        self._local_maps = {name: self.domain.local(self.maps[name]) for name in p.varying_maps}
        self._pial = np.unique(zones.cortex_facets)

    def step(self, state: State, step_s: float) -> State:
        """Return the state after a step of a given length, the mesh moved along; its last row says what it took.

        NotConvergedError where the step is too large; the mesh is as before.
        """
        began = time.monotonic()
        tissue, growth = self.begin(state, step_s)
        count = self.solver.solve(*[self.domain.local(guess) for guess in state.predicted(step_s)])
        self.growth, self.fields.step_s = growth, step_s
        u = self.domain.gathered(self.problem.displacement[: self.domain.owned])
        positions = state.positions + u
        size = self.inputs.size(positions * MM_PER_M)
        thickness = value_at(self.parameters.thickness_mm, growth.start.week(self.parameters, 0.5), self.maps)
        left = None
        if self.parameters.stress_memory_gw > 0:
            left = self.domain.gathered_cells(packed(left_stretch(self.problem.outcome("elastic"))))
        row = {
            "step": len(state.rows) + 1,
            "week": self.parameters.start_week + (state.time_s + step_s) / SECONDS_PER_GW,
            "dt_s": step_s,
            **self._solved_row(u, count),
            **contact_row(self.contact, self.zones, positions),
            **self.growth.row(size),
            "elements_through_cortex": elements_through(
                self.domain, tissue.depth, float(np.mean(thickness)) * M_PER_MM
            ),
            "rung": RUNGS[count.rung],
        }
        after = state.after(u, step_s, row, left, self.growth.learnt(size), self.growth.logarithm())
        self.domain.place(after.positions)
        row["seconds"] = time.monotonic() - began
        return after

    def begin(self, state: State, step_s: float) -> tuple[Tissue, Growth]:
        """Set all that a step is solved with, and return the tissue as in the middle of the step, and the growth."""
        start = StepStart(state.positions * MM_PER_M, state.time_s, step_s, state.learnt)
        p, domain, week = self.parameters, self.domain, start.week(self.parameters, 0.5)
        if domain.positions is not state.positions:
            domain.place(state.positions)
        tissue = Tissue.of(
            domain.cells,
            domain.vertex_of_node,
            self.problem.points,
            domain.local(domain.positions),
            PialSearch(domain.positions, self.zones.cortex_facets),
            self._growing,
            self._local_maps,
            lambda maps: value_at(p.thickness_mm, week, maps),
            float(np.max(value_at(p.thickness_mm, week, self.maps))),
        )
        self.problem.set_shear_modulus(tissue.at_points(shear_modulus(p, tissue.weight, tissue.maps, week)))
        part = domain.part
        if self.contact is not None:
            self.contact.adapt(state.rows)
            self.contact.mesh_moved()
            if self.problem.free:
                part = self.contact.joined(part)
        self.problem.mesh_moved(part)
        if p.stress_memory_gw > 0:
            self.problem.set_stretch(self._kept_stretch(state, step_s))
        growth = self.model(start)
        self.problem.set_growth(growth.inverse(tissue))
        return tissue, growth

    def _kept_stretch(self, state: State, step_s: float) -> Floats:
        if state.stretch is None:
            return np.tile(np.eye(3), (len(self.domain.cells), len(self.problem.points.weights), 1, 1))
        before = unpacked(state.stretch[self.domain.tet_of_cell])
        return relaxed(before, step_s / SECONDS_PER_GW, self.parameters.stress_memory_gw)

    def _solved_row(self, u: Floats, count: StepCount) -> dict[str, float]:
        ratios, length = self.problem.volume_ratios(), np.linalg.norm(u, axis=1) * MM_PER_M
        return {
            "newton": count.newton,
            "krylov": count.krylov,
            "residual": count.residual,
            "converged": count.converged,
            "energy_J": self.problem.energy(),
            "min_J": self.domain.minimum(ratios),
            "max_J": -self.domain.minimum(-ratios),
            "max_u_mm": float(length.max()),
            "mean_u_mm": float(length.mean()),
            "max_u_pial_mm": float(length[self._pial].max()),
            "mean_u_pial_mm": float(length[self._pial].mean()),
        }


def advance(folding: Folding, state: State, until_s: float) -> State:
    """Return the state after one accepted step towards `until_s`; the step is halved while its solve fails.

    SolverError where the smallest step fails too.
    """
    p = folding.parameters
    left = until_s - state.time_s
    # a remainder shorter than a whole step can be halved as often as one
    whole = min(p.step_s, left) if state.step_s >= p.step_s else p.step_s
    smallest = whole / 2**p.solver.max_halvings
    while True:
        # do not take a separate step for a remainder that is only round-off
        step_s = left if left < state.step_s * (1 + 1e-6) else state.step_s
        try:
            after = folding.step(state, step_s)
        except NotConvergedError as error:
            half = min(state.step_s, step_s) / 2
            if half < smallest * (1 - 1e-9):
                raise SolverError(
                    f"the step at GW {p.start_week + state.time_s / SECONDS_PER_GW:.3f} fails even with {step_s:g} s",
                    found=f"{error}; {worst_places(folding.solver)}",
                    remedy="The last good state is kept: the same command with an earlier folding.end_week, or more "
                    "folding.solver.max_halvings, goes on from it. A finer mesh or less growth may help.",
                ) from None
            if folding.domain.comm.rank == 0:
                say(f"step of {step_s:g} s failed ({error}): trying {half:g} s")
            state = replace(state, step_s=half, successes=0)
            continue
        if folding.domain.comm.rank == 0:
            coarse = resolution_warning(after.rows, folding.domain.order)
            for warning in filter(None, (unconverged_warning(after.rows[-1]), coarse)):
                warn(warning)
        if after.successes >= STEPS_BEFORE_GROWING and after.step_s < p.step_s:
            after = replace(after, step_s=min(2 * after.step_s, p.step_s), successes=0)
        return after
