"""The time loop: layers, one Newton solve, moved mesh; halved steps where a solve fails; frames at the output weeks."""

import math
import shutil
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..errors import SolverError
from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from ..units import M_PER_MM, MM_PER_M, SECONDS_PER_GW
from .checkpoint import State, read_checkpoint, run_key, write_checkpoint
from .domain import Domain
from .layers import WEIGHT_REACH, PialSearch, cortical_weight
from .newton import RUNGS, NewtonSettings, NewtonSolver, NotConvergedError
from .output import finish, frame_path, peak_memory_mib, progress_line, save_frame, say
from .parameters import FoldingParameters
from .problem import Material, Problem
from .zones import Zones

Floats = NDArray[np.float64]
NO_GROWTH = 1e-10
"""Growth increment of a step that counts as none, a hundred-millionth of what the cortex grows."""
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
    zones, parameters
        What holds through the run.
    quadrature_degree
        See `Problem`.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        mesh: TetrahedralMesh,
        zones: Zones,
        parameters: FoldingParameters,
        *,
        quadrature_degree: int = 1,
    ) -> None:
        self.parameters = parameters
        self.zones = zones
        self.domain = Domain(comm, mesh)
        material = Material(parameters.poisson_ratio, parameters.contact.penalty_pa_per_m)
        self.problem = Problem(self.domain, zones, material, quadrature_degree=quadrature_degree)
        self._pial = np.unique(zones.facets)
        self._growth = self.domain.local(zones.growth)
        edge = float(np.cbrt(signed_volumes(mesh).mean())) * M_PER_MM
        # far below any force of growth: a brain that does not grow must stay where it is
        floor = 1e-11 * parameters.shear_modulus_cortex_pa * edge**2 * math.sqrt(len(mesh.vertices))
        solver = parameters.solver
        settings = NewtonSettings(solver.newton_tolerance, solver.krylov_tolerance, solver.max_newton)
        self.solver = NewtonSolver(self.problem, settings, floor)

    def set_layers(self, step_s: float) -> None:
        """Sets stiffness, growth increments and normals for a step of the present shape."""
        p, domain = self.parameters, self.domain
        thickness = p.thickness_mm * M_PER_MM
        search = PialSearch(domain.positions, self.zones.facets)
        nodes = domain.local(domain.positions)
        weight = cortical_weight(search.distance(nodes, WEIGHT_REACH * thickness), thickness)
        growing = self._growth * step_s
        dg = p.growth_rate_per_s * weight * growing
        dr = p.radial_growth_rate_per_s * (1 - weight) * growing
        # the direction matters only where tissue grows, and the search is slow deep inside
        grows = (np.abs(dg) + np.abs(dr))[domain.cells].max(axis=1) > NO_GROWTH
        normals = np.tile([0.0, 0.0, 1.0], (len(domain.cells), 1))
        normals[grows] = search.nearest_normals(nodes[domain.cells[grows]].mean(axis=1))
        mu = p.shear_modulus_core_pa * (1 - weight) + p.shear_modulus_cortex_pa * weight
        self.problem.set_layers(mu, dg, dr, normals)

    def step(self, state: State, step_s: float) -> State:
        """Returns the state after a step of a given length, the mesh moved along; its last row says what it took.

        Raises
        ------
        NotConvergedError
            Where the step is too large; the mesh is as before.
        """
        began = time.monotonic()
        domain, problem = self.domain, self.problem
        if domain.positions is not state.positions:
            domain.place(state.positions)
        self.set_layers(step_s)
        count = self.solver.solve(domain.local(state.predicted(step_s)))
        min_J = problem.smallest_volume_ratio()
        energy = problem.energy()
        u = domain.gathered(problem.displacement[: domain.owned])
        length = np.linalg.norm(u, axis=1) * MM_PER_M
        row = {
            "step": len(state.rows) + 1,
            "week": self.parameters.start_week + (state.time_s + step_s) / SECONDS_PER_GW,
            "dt_s": step_s,
            "newton": count.newton,
            "krylov": count.krylov,
            "residual": count.residual,
            "energy_J": energy,
            "min_J": min_J,
            "max_u_mm": float(length.max()),
            "mean_u_mm": float(length.mean()),
            "max_u_pial_mm": float(length[self._pial].max()),
            "mean_u_pial_mm": float(length[self._pial].mean()),
            "rung": RUNGS[count.rung],
            "seconds": time.monotonic() - began,
        }
        after = state.after(u, step_s, row)
        domain.place(after.positions)
        return after


def advance(folding: Folding, state: State, until_s: float) -> State:
    """Returns the state after one accepted step towards `until_s`; the step is halved while its solve fails.

    Raises
    ------
    SolverError
        Where the smallest step fails too.
    """
    p = folding.parameters
    smallest = p.step_s / 2**p.solver.max_halvings
    while True:
        left = until_s - state.time_s
        # a remainder of a rounding error's length is no step of its own
        step_s = left if left < state.step_s * (1 + 1e-9) else state.step_s
        try:
            after = folding.step(state, step_s)
        except NotConvergedError as error:
            half = min(state.step_s, step_s) / 2
            if half < smallest * (1 - 1e-9):
                raise SolverError(
                    f"the step at GW {p.start_week + state.time_s / SECONDS_PER_GW:.3f} fails even with {step_s:g} s",
                    found=error,
                    remedy="The last good state is kept: the same command with an earlier folding.end_week, or more "
                    "folding.solver.max_halvings, goes on from it. A finer mesh or less growth may help.",
                ) from None
            if folding.domain.comm.rank == 0:
                say(f"step of {step_s:g} s failed ({error}): trying {half:g} s")
            state = replace(state, step_s=half, successes=0)
            continue
        if after.successes >= STEPS_BEFORE_GROWING and after.step_s < p.step_s:
            after = replace(after, step_s=min(2 * after.step_s, p.step_s), successes=0)
        return after


def run(
    comm: MPI.Comm,
    mesh: TetrahedralMesh,
    zones: Zones,
    parameters: FoldingParameters,
    out: Path,
) -> None:
    """Folds a brain from the first to the last output week and writes frames, step table and summary into `out`.

    Goes on from a checkpoint in `out` that belongs to this mesh and these parameters.
    """
    began = time.monotonic()
    folding = Folding(comm, mesh, zones, parameters)
    key = run_key(mesh, parameters)
    folder = out / f"checkpoint-{key}"
    state, message = comm.bcast(resumable(folder, key, parameters) if comm.rank == 0 else None, root=0)
    if comm.rank == 0:
        for note in (message, *foreign_checkpoints(out, folder), shortened_steps(parameters)):
            if note:
                say(note)
    start = mesh.vertices * M_PER_MM
    weeks = parameters.output_weeks
    if state is None:
        state = State.at_start(start, parameters.step_s)
        if comm.rank == 0:
            save_frame(folder, weeks[0], start, start, zones, parameters)
    first, resumed = len(state.rows), time.monotonic()
    for week in weeks[1:]:
        until = seconds_to(week, parameters)
        while state.time_s < until * (1 - 1e-12):
            state = advance(folding, state, until)
            if comm.rank == 0:
                if until - state.time_s < 1e-9 * until:
                    save_frame(folder, week, state.positions, start, zones, parameters)
                write_checkpoint(folder / "state.h5", key, state)
                rate = (time.monotonic() - resumed) / (len(state.rows) - first)
                steps_left = (parameters.end_week - state.rows[-1]["week"]) * SECONDS_PER_GW / state.step_s
                say(progress_line(state.rows[-1], parameters.end_week, rate * steps_left))
    memory = comm.reduce(peak_memory_mib(), op=MPI.SUM, root=0)
    if comm.rank == 0:
        steps = [row["seconds"] for row in state.rows]
        summary = {
            "tets": len(mesh.tets),
            "dofs": 3 * len(mesh.vertices),
            "pial_faces": len(zones.facets),
            "ranks": comm.size,
            "steps": len(steps),
            "newton": sum(row["newton"] for row in state.rows),
            "krylov": sum(row["krylov"] for row in state.rows),
            "seconds": time.monotonic() - began,
            "seconds_per_step": float(np.median(steps)),
            "peak_memory_MiB": memory,
            "min_J": min(row["min_J"] for row in state.rows),
            "weeks": list(weeks),
            "resumed_after_step": first,
        }
        finish(out, folder, mesh.tets, weeks, state.rows, summary)
        shutil.rmtree(folder)
        say(f"folded to GW {parameters.end_week:g} in {len(steps)} steps, {summary['seconds']:.0f} s")


def resumable(folder: Path, key: str, parameters: FoldingParameters) -> tuple[State | None, str]:
    """Returns the state to go on from, or None, and what to tell the user.

    The frames of all output weeks that the state has passed must be there.
    """
    state, message = read_checkpoint(folder / "state.h5", key)
    if state is None:
        return state, message
    end_s = seconds_to(parameters.end_week, parameters)
    passed = [week for week in parameters.output_weeks if seconds_to(week, parameters) <= state.time_s * (1 + 1e-12)]
    if not all(frame_path(folder, week).exists() for week in passed):
        return None, f"the checkpoint {folder} has passed output weeks that were not asked for then: starting anew"
    within = tuple(row for row in state.rows if seconds_to(row["week"], parameters) <= end_s * (1 + 1e-9))
    return replace(state, rows=within), message


def seconds_to(week: float, parameters: FoldingParameters) -> float:
    """Returns the time in s from the start of the run to a week."""
    return (week - parameters.start_week) * SECONDS_PER_GW


def foreign_checkpoints(out: Path, own: Path) -> list[str]:
    """Returns what to say of checkpoints of other meshes or parameters, which stay; only the newest two are kept."""
    others = sorted(
        (path for path in out.glob("checkpoint-*") if path != own), key=lambda path: path.stat().st_mtime, reverse=True
    )
    for old in others[2:]:
        shutil.rmtree(old, ignore_errors=True)
    return [f"{path} belongs to another mesh or other parameters: not used, kept for a return" for path in others[:2]]


def shortened_steps(parameters: FoldingParameters) -> str:
    """Returns what to say where the time step does not divide the time between two outputs; empty where it does."""
    step = parameters.step_s
    for a, b in pairwise(parameters.output_weeks):
        if abs(math.remainder((b - a) * SECONDS_PER_GW, step)) > 1e-6 * step:
            return f"step_s {step:g} does not divide the time from GW {a:g} to {b:g}: the last step there is shortened"
    return ""
