"""Surfaces through the weeks as compact data for the report's 3D view."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.cm import ScalarMappable
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh
from .labels import DISPLACEMENT, MAPS, PRESSURES
from .pictures import Halves, scale_of, whole_maps
from .style import REAL_SURFACE_COLOUR, SIMULATED_SURFACE_COLOUR

BUDGET_BYTES = 12_000_000
"""What the surfaces may take in the page."""
MOST_VERTICES = 8000
"""Vertices of a surface in the view; more would not be seen."""
FEWEST_VERTICES = 500
LABELS = {name: label for name, label in MAPS.items() if name not in PRESSURES}
"""The maps of the view, with the labels of their colour bars."""

_POSITION_LEVELS, _VALUE_LEVELS, _UNKNOWN = 65535, 254, 255
# base64 writes three bytes as four letters
_LETTERS_PER_BYTE = 4 / 3


@dataclass(frozen=True, eq=False)
class TimedSurface:
    """A surface in RAS+ mm at a week, and its (n,) maps by name; NaN where a value is not known."""

    week: float
    mesh: TriangleMesh
    maps: Mapping[str, Floats]


def surfaces_view(
    runs: Mapping[str, Sequence[tuple[float, Halves]]], real: Sequence[tuple[float, Halves]], *, measured: str
) -> dict[str, Any]:
    """Returns `view_data` of simulated and measured brains, each a week with its hemispheres and their maps."""
    simulated = {name: with_displacement([_timed(*frame) for frame in frames]) for name, frames in runs.items()}
    return view_data(simulated, [_timed(*frame) for frame in real], measured=measured)


def _timed(week: float, halves: Halves) -> TimedSurface:
    mesh, maps = whole_maps(halves)
    return TimedSurface(week, mesh, {name: values for name, values in maps.items() if name in LABELS})


def with_displacement(surfaces: Sequence[TimedSurface]) -> list[TimedSurface]:
    """Returns a run's surfaces with the map of the distance in mm that each vertex has moved since the first one.

    InputError where the surfaces do not have the same vertices.
    """
    start = surfaces[0].mesh.vertices
    moved = []
    for surface in surfaces:
        if surface.mesh.vertices.shape != start.shape:
            found = f"{len(surface.mesh.vertices)} vertices at {surface.week:g} GW"
            raise InputError("a run's surfaces differ in their vertices", found=found, expected=f"{len(start)}")
        norms = np.linalg.norm(surface.mesh.vertices - start, axis=1)
        moved.append(TimedSurface(surface.week, surface.mesh, {**surface.maps, DISPLACEMENT: norms}))
    return moved


def view_data(
    simulated: Mapping[str, Sequence[TimedSurface]],
    real: Sequence[TimedSurface],
    *,
    measured: str,
    budget_bytes: float = BUDGET_BYTES,
) -> dict[str, Any]:
    """Returns the surfaces, thinned out to fit the budget, with their maps and colour scales, ready for JSON.

    A run's surfaces share their triangles, so that the view can move smoothly from week to week; measured brains have
    their own each week. Positions are in steps of 1/65535 of the box around all surfaces, values of maps in 254 steps
    of their scale.

    Parameters
    ----------
    simulated : {run: surfaces by week, with the same vertices}
    real : surfaces of the measured brains by week
    measured
        What the measured brains are called.
    """
    everything = [surface for surfaces in simulated.values() for surface in surfaces] + list(real)
    if not everything:
        return {"groups": [], "maps": []}
    vertices = _vertices_within(budget_bytes, simulated, real)
    low = np.min([surface.mesh.vertices.min(axis=0) for surface in everything], axis=0)
    high = np.max([surface.mesh.vertices.max(axis=0) for surface in everything], axis=0)
    names = [name for name in LABELS if any(name in surface.maps for surface in everything)]
    scales = {name: _scale(name, everything) for name in names}
    box = low, float((high - low).max())
    groups = []
    for run, surfaces in simulated.items():
        kept, faces = thin_out(surfaces[-1].mesh, vertices)
        frames = [_frame(surface, kept, box, scales) for surface in surfaces]
        groups.append(
            {"name": run, "kind": "simulated", "colour": SIMULATED_SURFACE_COLOUR, "faces": _faces(faces)}
            | {"frames": frames}
        )
    frames = []
    for surface in real:
        kept, faces = thin_out(surface.mesh, vertices)
        frames.append(_frame(surface, kept, box, scales) | {"faces": _faces(faces)})
    if frames:
        groups.append({"name": measured, "kind": "real", "colour": REAL_SURFACE_COLOUR, "frames": frames})
    return {
        "low": low.tolist(),
        "size": box[1],
        "groups": groups,
        "maps": [_described(name, scales[name]) for name in names],
    }


def thin_out(mesh: TriangleMesh, vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns which vertices are kept, about so many, and the (m, 3) triangles between them, as places among these.

    Edges are collapsed onto vertices that there are (Schroeder, Zarge & Lorensen 1992), so that maps and the positions
    of other weeks are those of the kept vertices.
    """
    if len(mesh.vertices) <= vertices:
        return np.arange(len(mesh.vertices)), np.asarray(mesh.faces, dtype=np.int64)
    body = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=int))
    coarse = body.decimate_pro(1 - vertices / len(mesh.vertices), preserve_topology=True)
    distance, kept = cKDTree(mesh.vertices).query(np.asarray(coarse.points, dtype=float))
    if distance.max() > 1e-3:
        raise InputError("thinning has moved vertices", found=f"{distance.max():.3g} mm", expected="none moved")
    return kept, np.asarray(coarse.regular_faces, dtype=np.int64)


def _vertices_within(
    budget_bytes: float, simulated: Mapping[str, Sequence[TimedSurface]], real: Sequence[TimedSurface]
) -> int:
    """Returns how many vertices each surface may have."""
    maps = len(LABELS)
    # about two triangles a vertex, of three indices of two bytes
    per_frame, per_triangulation = 6 + maps, 12
    frames = sum(len(surfaces) for surfaces in simulated.values()) + len(real)
    triangulations = len(simulated) + len(real)
    bytes_per_vertex = _LETTERS_PER_BYTE * (frames * per_frame + triangulations * per_triangulation)
    return int(np.clip(budget_bytes / bytes_per_vertex, FEWEST_VERTICES, MOST_VERTICES))


def _scale(name: str, surfaces: Sequence[TimedSurface]) -> ScalarMappable:
    values = np.concatenate([surface.maps[name] for surface in surfaces if name in surface.maps])
    return scale_of(name, values[np.isfinite(values)])


def _described(name: str, scale: ScalarMappable) -> dict[str, Any]:
    low, high = scale.get_clim()
    colours = scale.to_rgba(np.linspace(low, high, _VALUE_LEVELS + 1), bytes=True)[:, :3]
    return {"name": name, "label": LABELS[name], "low": low, "high": high, "colours": _text(colours.astype(np.uint8))}


def _frame(
    surface: TimedSurface,
    kept: NDArray[np.int64],
    box: tuple[Floats, float],
    scales: Mapping[str, ScalarMappable],
) -> dict[str, Any]:
    low, size = box
    places = np.round((surface.mesh.vertices[kept] - low) / size * _POSITION_LEVELS).astype("<u2")
    values = {}
    for name, scale in scales.items():
        if name in surface.maps:
            bottom, top = scale.get_clim()
            own = np.asarray(surface.maps[name], dtype=float)[kept]
            levels = np.clip(np.round((own - bottom) / (top - bottom) * _VALUE_LEVELS), 0, _VALUE_LEVELS)
            values[name] = _text(np.where(np.isfinite(own), levels, _UNKNOWN).astype(np.uint8))
    return {"week": surface.week, "positions": _text(places), "values": values}


def _faces(faces: NDArray[np.int64]) -> str:
    return _text(faces.astype("<u2"))


def _text(values: NDArray) -> str:
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
