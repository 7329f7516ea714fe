"""One step after the other: layers, a Newton solve, the moved mesh; halved steps where a solve fails."""

import math
import time
from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..errors import SolverError
from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from ..mechanics.materials import MATERIALS
from ..parameters.folding import FoldingParameters
from ..parameters.reading import require_maps
from ..parameters.terms import ELEMENT_FIELDS
from ..parameters.varying import Maps, value_range
from ..units import M_PER_MM, MM_PER_M, SECONDS_PER_GW
from .checkpoint import State
from .contact import SelfContact, contact_settings
from .domain import Domain
from .element_layers import Layered, linear_layers, quadratic_layers
from .following import Step, following_step, growing_at_start, size_of
from .free_growth import Tissue, strain_at, undone
from .ladder import RUNGS, NotConvergedError
from .layers import WEIGHT_REACH, PialSearch
from .memory import left_stretch, packed, relaxed, unpacked, unstretched
from .newton import NewtonSettings, NewtonSolver, StepCount
from .output import say
from .problem import Problem
from .rates import SMALL, RateProblem, rate_step, summed
from .resolution import elements_through, resolution_warning, unconverged_warning, worst_quality
from .stress import (
    deformation_gradients,
    elastic_strain_fields,
    stress_fields,
    total_strain_fields,
    volume_ratio_fields,
)
from .zones import Zones

Floats = NDArray[np.float64]
STEPS_BEFORE_GROWING = 4
"""Accepted steps after which a halved time step is doubled again."""


class Folding:
    """A brain that folds: the solver's objects, made once, and one step at a time.

    Parameters
    ----------
    comm
        Communicator of the solve.
    mesh
        The brain at the start, RAS+ mm; the whole mesh on every rank.
    zones, parameters, maps
        What holds through the run; maps at the mesh's vertices, for the parameters that have one.
    quadrature_degree
        See `Problem`.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        mesh: TetrahedralMesh,
        zones: Zones,
        parameters: FoldingParameters,
        maps: Maps | None = None,
        *,
        quadrature_degree: int | None = None,
    ) -> None:
        self.parameters = parameters
        self.zones = zones
        self.maps = maps or {}
        require_maps(parameters, self.maps, len(mesh.vertices))
        self.domain = Domain(comm, mesh)
        by_planes = parameters.contact.kind == "planes"
        self._remembers = parameters.stress_memory_gw > 0
        self.problem = (Problem if parameters.time_scheme == "implicit" else RateProblem)(
            self.domain,
            zones,
            MATERIALS[parameters.material](parameters.poisson_ratio),
            penalty_pa_per_m=parameters.contact.penalty_pa_per_m if by_planes else 0.0,
            quadrature_degree=quadrature_degree,
            remembers_stress=self._remembers or bool(parameters.regional_strain),
        )
        self.contact: SelfContact | None = None
        if parameters.contact.kind == "global":
            settings = contact_settings(parameters, self.maps)
            self.contact = SelfContact(self.domain, self.problem.displacement, zones.facets, settings)
            self.problem.contributions.append(self.contact)
        self._pial = np.unique(zones.cortex_facets)
        self._growth = self.domain.local(zones.growth)
        self._local_maps = {name: self.domain.local(values) for name, values in self.maps.items()}
        edge = float(np.cbrt(signed_volumes(mesh).mean())) * M_PER_MM
        # far below any force of growth: a brain that does not grow must stay where it is
        stiffness = value_range(
            parameters.shear_modulus_cortex_pa, self.maps, parameters.start_week, parameters.end_week
        )[1]
        floor = 1e-11 * stiffness * edge**2 * math.sqrt(len(mesh.vertices))
        solver = parameters.solver
        self._start = self.domain.positions
        self._start_size = size_of(mesh.vertices, zones)
        self._tissue = Tissue.of(mesh, zones, self.maps)
        # those of the last step, with its rates of growth
        self.present = growing_at_start(parameters, mesh.vertices, self._tissue)
        self._strained = np.zeros_like(self.problem.displacement)  # what the last step's stress belongs to
        self._step_s = parameters.step_s  # of the last step
        self._through, self._part = math.nan, self.domain.part  # of its layers
        if "strain" in parameters.fields:
            nodes = self.domain.local(self._start)
            centres = nodes[self.domain.corners].mean(axis=1)
            self._start_normals = PialSearch(self._start, zones.cortex_facets).nearest_normals(centres)
        limits = NewtonSettings(solver.newton_tolerance, solver.krylov_tolerance, solver.max_newton)
        self.solver = NewtonSolver(self.problem, limits, floor)

    def set_layers(self, time_s: float, step_s: float, at: float = 0.5) -> None:
        """Sets stiffness, growth and normals for a step from a time on, with parameters as at a part of it."""
        self._set_tissue(time_s + at * step_s, step_s)
        self._part = self.domain.part
        if self.contact is not None:
            self.contact.mesh_moved()
            if self.problem.free:
                self._part = self.contact.joined(self._part)
        self.problem.mesh_moved(self._part)

    def _set_tissue(self, time_s: float, step_s: float) -> None:
        """Sets stiffness, normals and the growth of a step, with parameters as at a time."""
        p, domain = self.present, self.domain
        week = p.start_week + time_s / SECONDS_PER_GW
        reach = WEIGHT_REACH * float(np.max(p.thickness_at(week, self.maps))) * M_PER_MM
        search = PialSearch(domain.positions, self.zones.cortex_facets)
        thickness = float(np.mean(p.thickness_at(week, self.maps)))
        at_nodes = domain.local(domain.positions)
        to_points = linear_layers if domain.order == 1 else quadratic_layers
        given = Layered(domain.cells, self.problem.points, self._growth, self._local_maps, p, week, step_s)
        layers, distance = to_points(given, search, at_nodes, reach)
        self.problem.set_layers_at_points(*layers)
        self._through = elements_through(domain, distance, thickness * M_PER_MM)

    def _kept_stretch(self, state: State, step_s: float) -> Floats | None:
        """Returns the (c, q, 3, 3) stretch of local elements that is left for a step, None where all is forgotten."""
        if not self._remembers:
            return None
        if state.stretch is None:
            return unpacked(unstretched(len(self.domain.cells), len(self.problem.points.weights)))
        before = unpacked(state.stretch[self.domain.tet_of_cell])
        return relaxed(before, step_s / SECONDS_PER_GW, self.parameters.stress_memory_gw)

    def _directions(self, state: State, step_s: float) -> Floats | None:
        """Returns the (c, q, 3, 3) inverse of a step's growth in measured directions, None where there are none."""
        step_gw = step_s / SECONDS_PER_GW
        week = self.parameters.start_week + state.time_s / SECONDS_PER_GW + step_gw
        strain = strain_at(self.parameters, self._local_maps, week)
        if strain is None:
            return None
        at_points = (strain * self._growth)[:, self.domain.cells] @ self.problem.points.bounded.T
        return undone(step_gw * np.moveaxis(at_points, 0, -1))

    def element_fields(self, wanted: Iterable[str]) -> dict[str, Floats]:
        """Returns the fields of the last step that are among `wanted`, (m,) for all elements, equal on every rank.

        They are means over the integration points. Names are those of the parameter `fields`; those of the arrays carry
        their units. Where stress is forgotten, that of a step and its strain are in proportion to the step, and are
        given per week. Right after a step only.
        """
        domain = self.domain
        fields: dict[str, Floats] = {}
        if set(ELEMENT_FIELDS).isdisjoint(wanted):
            return fields
        after = domain.positions
        slopes = self.problem.points.slopes
        total = deformation_gradients(domain.local(self._start), domain.local(after), domain.cells, slopes)
        total = total.reshape(-1, 3, 3)

        # back to where the step began, which its displacement refers to
        moved = self.problem.displacement.copy()
        domain.place(after - domain.gathered(moved[: domain.owned]))
        if isinstance(self.problem, RateProblem):
            with self.problem.in_small():
                self.problem.set_displacement(SMALL * self._strained)
                fields |= self._stress_fields(wanted, 1 / SMALL)
        else:
            fields |= self._stress_fields(wanted)
        if "strain" in wanted:
            fields |= total_strain_fields(total, np.repeat(self._start_normals, len(slopes), axis=0))
        self.problem.set_displacement(moved)
        if "volume_ratio" in wanted:
            fields |= volume_ratio_fields(self._at_all_points("deformation"), total)
        domain.place(after)
        by_cell = [values.reshape(-1, len(slopes)) @ self.problem.points.weights for values in fields.values()]
        together = domain.gathered_cells(np.stack(by_cell, axis=1))
        return dict(zip(fields, together.T, strict=True))

    def _at_all_points(self, name: Literal["deformation", "elastic", "stress"]) -> Floats:
        """Returns the tensors (c q, 3, 3) at the integration points, one local element after the other."""
        return self.problem.outcome(name).reshape(-1, 3, 3)

    def _stress_fields(self, wanted: Iterable[str], factor: float = 1.0) -> dict[str, Floats]:
        """Returns a multiple of the stress and elastic strain (c q,) at integration points, if they are wanted."""
        fields: dict[str, Floats] = {}
        if "stress" in wanted:
            fields |= stress_fields(self._at_all_points("stress"))
        if "strain" in wanted:
            fields |= elastic_strain_fields(self._at_all_points("elastic"))
        return self._per_gw({name: factor * values for name, values in fields.items()})

    def contact_fields(self, wanted: Iterable[str]) -> dict[str, Floats]:
        """Returns the contact pressure (n,) at all vertices if it is among `wanted`.

        Per week where stress is forgotten. Right after a step only.
        """
        if self.contact is None or "contact_pressure" not in wanted:
            return {}
        return self._per_gw({"contact_pressure_pa": self.contact.pressure()})

    def _per_gw(self, fields: dict[str, Floats]) -> dict[str, Floats]:
        """Returns fields of a step as they are where stress is remembered, and else as rates, named so."""
        if self._remembers:
            return fields
        return {f"{name}_per_gw": values * (SECONDS_PER_GW / self._step_s) for name, values in fields.items()}

    def _contact_row(self, positions: Floats) -> dict[str, float]:
        """Returns what the step table says of contact right after a solve that led to (n, 3) positions in m."""
        if self.contact is not None:
            distance = self.contact.smallest_distance_mm()
            # what is farther apart than the barrier reaches is not looked for
            near = {"min_distance_mm": distance if distance < math.inf else math.nan}
            contact = self.contact
            return {
                "contact_distance_mm": contact.distance_mm,
                "contact_stiffness_pa": contact.stiffness_pa,
                "contact_pairs": contact.pair_count(),
                **near,
            }
        return {"plane_penetration_mm": self.zones.penetration_mm(positions * MM_PER_M)}

    def trouble(self) -> str:
        """Returns where the last solve stood worst: the most compressed element and the largest residual, in mm."""
        domain, problem = self.domain, self.problem
        before = domain.local(domain.positions)
        ratios = problem.volume_ratios() if self.solver.inverting is None else self.solver.inverting
        residual = problem.new_vector()
        problem.residual(residual)
        forces = -np.linalg.norm(residual.array_r.reshape(-1, 3), axis=1)
        centres = before[domain.corners].mean(axis=1) * MM_PER_M
        ratio, tet, centre = domain.least(ratios.min(axis=1), domain.tet_of_cell, centres)
        force, vertex, place = domain.least(forces, domain.vertex_of_node, before * MM_PER_M)
        return (
            f"smallest det F {ratio:.3g} in element {tet} at {np.round(centre, 1).tolist()} mm, "
            f"largest residual {-force:.2e} N at vertex {vertex} at {np.round(place, 1).tolist()} mm"
        )

    def _grow(self, state: State, step_s: float, growth: Step) -> tuple[Step, Floats, StepCount, Floats | None]:
        """Solves a step, again while growth that follows asks for it.

        Returns the growth that it had, its (n, 3) displacement in m, what it took, and the velocity it began with.
        """
        guess, counts = self.domain.local(state.predicted(step_s)), []
        while True:
            self.present = growth.parameters
            count, rate = self._solve(state, step_s, guess)
            counts.append(count)
            guess = self.problem.displacement.copy()
            u = self.domain.gathered(guess[: self.domain.owned])
            again = growth.again(size_of((state.positions + u) * MM_PER_M, self.zones))
            if again is None:
                return growth, u, summed(counts), rate
            growth = again

    def _solve(self, state: State, step_s: float, guess: Floats) -> tuple[StepCount, Floats | None]:
        """Leaves the displacement of a step in the problem; returns what it took, and the velocity it began with."""
        problem = self.problem
        if not isinstance(problem, RateProblem):
            self.set_layers(state.time_s, step_s)
            count = self.solver.solve(guess)
            self._strained = problem.displacement.copy()
            return count, None

        def move_aside(positions: Floats, at: float) -> None:
            self.domain.place(positions)
            self._set_tissue(state.time_s + at * step_s, step_s)
            problem.mesh_moved(self._part)

        self.set_layers(state.time_s, step_s, at=0.0)
        two_stages = self.parameters.time_scheme == "midpoint"
        try:
            solved = rate_step(state, step_s, problem, self.solver, two_stages=two_stages, move_aside=move_aside)
        finally:
            self.domain.place(state.positions)
        self._strained = solved.strained
        return solved.count, solved.rate

    def _energy(self) -> float:
        """Returns the energy in J of the step that has been solved, contact included."""
        problem = self.problem
        if not isinstance(problem, RateProblem):
            return problem.energy()
        moved = problem.displacement.copy()
        problem.set_displacement(self._strained)
        energy = problem.stored_energy()
        problem.set_displacement(moved)
        return energy + sum(part.energy() for part in problem.contributions)

    def step(self, state: State, step_s: float) -> State:
        """Returns the state after a step of a given length, the mesh moved along; its last row says what it took.

        Raises
        ------
        NotConvergedError
            Where the step is too large; the mesh is as before.
        """
        began = time.monotonic()
        domain, problem, self._step_s = self.domain, self.problem, step_s
        if domain.positions is not state.positions:
            domain.place(state.positions)
        if self.contact is not None:
            self.contact.adapt(state.rows)
        last = state.rows[-1] if state.rows else {}
        at_start = self.parameters, self._start_size, state.positions * MM_PER_M, self._tissue
        growth = following_step(*at_start, state.time_s, step_s, last, state.learnt)
        kept = self._kept_stretch(state, step_s)
        directions = self._directions(state, step_s)
        stretches = [part for part in (kept, directions) if part is not None]
        if stretches:
            problem.set_stretch(stretches[0] if len(stretches) == 1 else stretches[0] @ stretches[1])
        growth, u, count, rate = self._grow(state, step_s, growth)
        ratios = problem.volume_ratios()
        energy = self._energy()
        size = size_of((state.positions + u) * MM_PER_M, self.zones)
        length = np.linalg.norm(u, axis=1) * MM_PER_M
        left = None if kept is None else domain.gathered_cells(packed(left_stretch(problem.outcome("elastic"))))
        row = {
            "step": len(state.rows) + 1,
            "week": self.parameters.start_week + (state.time_s + step_s) / SECONDS_PER_GW,
            "dt_s": step_s,
            "newton": count.newton,
            "krylov": count.krylov,
            "residual": count.residual,
            "converged": count.converged,
            "energy_J": energy,
            "min_J": domain.minimum(ratios),
            "max_J": -domain.minimum(-ratios),
            "max_u_mm": float(length.max()),
            "mean_u_mm": float(length.mean()),
            "max_u_pial_mm": float(length[self._pial].max()),
            "mean_u_pial_mm": float(length[self._pial].mean()),
            **self._contact_row(domain.positions + u),
            **growth.row(size),
            "elements_through_cortex": self._through,
            "rung": RUNGS[count.rung],
        }
        after = state.after(u, step_s, row, left, rate, growth.learnt(size))
        domain.place(after.positions)
        row["radius_ratio_01"] = worst_quality(domain)
        row["seconds"] = time.monotonic() - began
        return after


def advance(folding: Folding, state: State, until_s: float) -> State:
    """Returns the state after one accepted step towards `until_s`; the step is halved while its solve fails.

    Raises
    ------
    SolverError
        Where the smallest step fails too.
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
                    found=f"{error}; {folding.trouble()}",
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
                say(f"warning: {warning}")
        if after.successes >= STEPS_BEFORE_GROWING and after.step_s < p.step_s:
            after = replace(after, step_s=min(2 * after.step_s, p.step_s), successes=0)
        return after
