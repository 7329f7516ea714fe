"""A whole run: from the start or a checkpoint to the last output week, with frames,
step table and summary."""

import logging
import math
import resource
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from mpi4py import MPI

from ..errors import SolverError
from ..geometry.tetrahedra import MIN_RADIUS_RATIO, TetrahedralMesh, radius_ratios
from ..geometry.triangles import Floats
from ..grouping import counted
from ..io.files import write_json, write_table
from ..io.frames import join_frames, write_frame
from ..settings.folding import FoldingParameters
from ..settings.varying import Maps
from ..units import MM_PER_M, SECONDS_PER_GW, week_tag
from .checkpoint import State, read_checkpoint, run_key, write_checkpoint
from .output import (
    GROWTH_SMOOTHING_MM,
    layer_fields,
    log_growth_at_vertices,
    print_line,
)
from .simulation import Folding, advance
from .steering import missed_curves
from .step_fields import step_fields
from .targets import missed_targets, shrinkage_note
from .zones import Zones

log = logging.getLogger(__name__)
FRAMES, STEPS, SUMMARY = "frames.h5", "steps.csv", "summary.json"
MAX_FLAT_SHARE = 0.001
"""Share of flat elements at the end of a run above which their note is a warning."""


def run(
    comm: MPI.Comm,
    mesh: TetrahedralMesh,
    zones: Zones,
    parameters: FoldingParameters,
    maps: Maps,
    out: Path,
    *,
    may_diverge: bool = False,
) -> None:
    """Simulate a brain from the first to the last output week; write frames, step table
    and summary into `out`.

    The run resumes from a checkpoint in `out` of this mesh and these parameters. A run
    that diverges raises SolverError; if it `may_diverge`, it ends with the output weeks
    that it has reached, and its summary gives the reason.
    """
    began = time.monotonic()
    folding = Folding(comm, mesh, zones, parameters, maps)
    key = run_key(mesh, parameters, maps)
    folder = out / f"checkpoint-{key}"
    loaded = _load_state(folder, key, parameters) if comm.rank == 0 else None
    state, message = comm.bcast(loaded, root=0)
    if comm.rank == 0:
        for note in (message, *_delete_old_checkpoints(out, folder)):
            if note:
                print_line(note)
    if state is None:
        state = State.at_start(folding.start, parameters.step_s)
        state = _save_frame(folding, state, parameters.output_weeks[0], folder)
    resumed_after = len(state.rows)
    state, diverged = _simulate(
        folding,
        state,
        folder,
        key,
        may_diverge=may_diverge,
    )
    memory_mib = comm.reduce(_peak_memory_mib())
    cpu_s = comm.reduce(time.process_time())
    if comm.rank != 0:
        return
    reached = parameters.start_week + state.time_s / SECONDS_PER_GW
    weeks = [week for week in parameters.output_weeks if week <= reached + 1e-9]
    frames = [_frame_path(folder, week) for week in weeks]
    join_frames(out / FRAMES, mesh.tets, frames)
    seconds = time.monotonic() - began
    summary = {
        "tets": len(mesh.tets),
        "dofs": 3 * len(mesh.vertices),
        "pial_faces": len(zones.facets),
        "ranks": comm.size,
        **_steps_summary(state.rows),
        "seconds": seconds,
        "cpu_seconds": cpu_s,
        "peak_memory_MiB": memory_mib,
        "weeks": weeks,
        "reached_week": reached,
        "diverged": diverged,
        "resumed_after_step": resumed_after,
    }
    write_table(out / STEPS, pd.DataFrame(list(state.rows)))
    write_json(out / SUMMARY, summary)
    shutil.rmtree(folder)
    shrinkage = shrinkage_note(state.rows)
    if shrinkage:
        print_line(shrinkage)
    _report_flat_elements(mesh, state.positions * MM_PER_M, reached)
    if diverged is not None:
        log.warning("the run diverges and ends at GW %.3f: %s", reached, diverged)
    n_steps = counted(len(state.rows), "step")
    print_line(f"folded to GW {reached:g} in {n_steps}, {seconds:.0f} s")


def _simulate(
    folding: Folding,
    state: State,
    folder: Path,
    key: str,
    *,
    may_diverge: bool,
) -> tuple[State, str | None]:
    """Run to the end and return the last state; write a frame per output week and a
    checkpoint per step into `folder`.

    If a run that `may_diverge` diverges, return the last good state and the reason.
    """
    p = folding.parameters
    began = time.monotonic()
    n_steps_before = len(state.rows)
    for last_week, week in pairwise(p.output_weeks):
        until = _seconds_to(week, p)
        while state.time_s < until * (1 - 1e-12):
            try:
                state = advance(folding, state, until)
            except SolverError as error:
                if not may_diverge:
                    raise
                return state, str(error)
            has_arrived = until - state.time_s < 1e-9 * until
            if has_arrived:
                state = _save_frame(folding, state, week, folder)
            if folding.domain.comm.rank == 0:
                if has_arrived:
                    _warn_of_misses(state.rows, last_week)
                write_checkpoint(folder / "state.h5", key, state)
                seconds = time.monotonic() - began
                n_steps = len(state.rows) - n_steps_before
                _report_step(state, p.end_week, seconds / n_steps)
    return state, None


def _warn_of_misses(rows: Sequence[dict], last_week: float) -> None:
    """Warn of curves and targets that were not followed since an output week."""
    since = [row for row in rows if row["week"] > last_week]
    curves = missed_curves(rows[-1])
    if curves:
        log.warning(curves)
    for warning in missed_targets(since):
        log.warning(warning)


def _save_frame(
    folding: Folding,
    state: State,
    week: float,
    folder: Path,
) -> State:
    """Write the frame of a week and return the state to continue with; collective over
    the ranks."""
    p = folding.parameters
    step_growth = folding.solved.growth
    at_vertices, at_elements = step_fields(folding, p.fields)
    # a mean over the steps since the last frame; before the first step, the growth of
    # that step
    growth = state.growth
    if growth is None:
        growth = folding.grown(state, step_growth)
    steps = state.growth_s / p.step_s or 1.0
    if folding.domain.comm.rank == 0:
        positions = state.positions * MM_PER_M
        fields = {"positions": positions}
        if "displacement" in p.fields:
            fields["displacement_mm"] = (state.positions - folding.start) * MM_PER_M
        logs: Floats | None = None
        smoothing = {}
        if growth is not None:
            logs = log_growth_at_vertices(positions, folding.inputs, growth) / steps
            smoothing = {"growth_smoothing_mm": GROWTH_SMOOTHING_MM}
        fields |= layer_fields(
            positions,
            folding.zones,
            step_growth,
            folding.maps,
            week,
            p.fields,
            logs,
        )
        write_frame(
            _frame_path(folder, week),
            week,
            fields | at_vertices,
            at_elements,
            smoothing,
        )
    return replace(state, growth=None, growth_s=0.0)


def _report_step(
    state: State,
    end_week: float,
    seconds_per_step: float,
) -> None:
    """Print the progress line of the last step: week, iterations, displacement,
    time."""
    row = state.rows[-1]
    left_s = seconds_per_step * (end_week - row["week"]) * SECONDS_PER_GW / state.step_s
    minutes, seconds = divmod(round(left_s), 60)
    line = (
        f"GW {row['week']:6.3f}/{end_week:g}  step {row['step']:4d}"
        f"  newton {row['newton']}  krylov {row['krylov']:3d}"
        f"  max|u| {row['max_u_mm']:.3f} mm  min J {row['min_J']:.3f}"
        f"  {row['seconds']:.2f} s  left {minutes}:{seconds:02d}"
    )
    print_line(
        line,
        "step",
        week=row["week"],
        end_week=end_week,
        step=row["step"],
        left_s=left_s,
    )


def _steps_summary(rows: Sequence[dict]) -> dict[str, float]:
    """Return totals over the step table."""
    seconds = [row["seconds"] for row in rows]
    return {
        "steps": len(rows),
        "newton": sum(row["newton"] for row in rows),
        "krylov": sum(row["krylov"] for row in rows),
        "seconds_per_step": float(np.median(seconds)) if rows else math.nan,
        "min_J": min((row["min_J"] for row in rows), default=math.nan),
    }


def _report_flat_elements(
    mesh: TetrahedralMesh,
    positions: Floats,
    week: float,
) -> None:
    """Print how many elements are flatter than any may be at the start; warn of
    many."""
    ratios = radius_ratios(TetrahedralMesh(positions, mesh.tets))
    allowed = min(MIN_RADIUS_RATIO, radius_ratios(mesh).min())
    n_flat = int((ratios < allowed).sum())
    if n_flat:
        text = (
            f"at GW {week:g} {n_flat} of {len(ratios)} elements are flatter than a mesh"
            f" may be at the start (radius ratio {ratios.min():.3f} of"
            f" {MIN_RADIUS_RATIO:g}): results are less accurate there"
        )
        tell = log.warning if n_flat > MAX_FLAT_SHARE * len(ratios) else print_line
        tell(text)


def _load_state(
    folder: Path,
    key: str,
    parameters: FoldingParameters,
) -> tuple[State | None, str]:
    """Return the state to resume from, or None, and a message for the user.

    A checkpoint is used only if the frames of all output weeks that it has passed
    exist, and if growth towards shapes, whose mean is written, has been added up since
    one of them.
    """
    state, message = read_checkpoint(folder / "state.h5", key)
    if state is None:
        return None, message
    passed = {}
    for week in parameters.output_weeks:
        seconds = _seconds_to(week, parameters)
        if seconds <= state.time_s * (1 + 1e-12):
            passed[week] = seconds
    problem = ""
    if not all(_frame_path(folder, week).exists() for week in passed):
        problem = "lacks frames of some output weeks"
    elif parameters.targets:
        since = state.time_s - state.growth_s
        distances = [abs(seconds - since) for seconds in passed.values()]
        if min(distances) > 1e-6 * since:
            problem = "is of a run with other output weeks"
    if problem:
        return (
            None,
            f"the checkpoint {folder} {problem}: not used, the run starts again",
        )
    end_s = _seconds_to(parameters.end_week, parameters)
    rows = []
    for row in state.rows:
        if _seconds_to(row["week"], parameters) <= end_s * (1 + 1e-9):
            rows.append(row)
    return replace(state, rows=tuple(rows)), message


def _frame_path(folder: Path, week: float) -> Path:
    """Return the file of a single frame, which exists until the run has ended."""
    return folder / f"frame-{week_tag(week)}.h5"


def _seconds_to(week: float, parameters: FoldingParameters) -> float:
    """Return the time in s from the start of a run to a week."""
    return (week - parameters.start_week) * SECONDS_PER_GW


def _delete_old_checkpoints(out: Path, own: Path) -> list[str]:
    """Delete all but the newest two checkpoints of other meshes or parameters, and
    return messages about these two."""
    folders = [path for path in out.glob("checkpoint-*") if path != own]
    folders.sort(
        key=lambda path: path.stat().st_mtime,
        reverse=True,
    )
    for folder in folders[2:]:
        shutil.rmtree(folder, ignore_errors=True)
    return [
        f"{path} belongs to another mesh or other parameters: kept but not used"
        for path in folders[:2]
    ]


def _peak_memory_mib() -> float:
    """Return the peak memory of this process in MiB."""
    unit = 1024 if sys.platform != "darwin" else 1024**2
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
