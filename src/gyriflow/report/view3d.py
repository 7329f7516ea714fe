"""Surfaces through the weeks as compact data for the report's 3D view."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersCore import vtkDecimatePro

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh
from ..quantities import VERTEX_MAPS
from .labels import map_title
from .pictures import Halves, scale_of, whole_maps
from .scene import polydata
from .style import OBSERVED_SURFACE_COLOUR, SIMULATED_SURFACE_COLOUR

BUDGET_BYTES = 12_000_000
"""Maximum size of the surfaces in the page."""
MAX_VERTICES = 8000
"""Vertices of a surface in the view; more would not be visible."""
MIN_VERTICES = 500
FEATURE_DEG = 45.0
"""Angle between faces along an edge that is kept as long as possible, in degrees."""

_POSITION_LEVELS, _VALUE_LEVELS, _UNKNOWN = 65535, 254, 255
_DRAWN = [name for name, record in VERTEX_MAPS.items() if record.colours]
# base64 writes three bytes as four letters; a vertex has about two triangles, of three
# indices of two bytes
_LETTERS_PER_BYTE = 4 / 3
_BYTES_PER_FRAME = 6 + len(_DRAWN)
_BYTES_PER_TRIANGULATION = 12

Timed = tuple[float, TriangleMesh, dict[str, Floats]]
"""A week, a surface in RAS+ mm and its maps by name; NaN for unknown values."""


def surfaces_view(
    runs: Mapping[str, Sequence[tuple[float, Halves]]],
    observed: Sequence[tuple[float, Halves]],
    *,
    observed_name: str,
) -> dict[str, Any]:
    """Return the surfaces, decimated to fit the budget, with their maps and colour
    scales, for JSON.

    A run's surfaces share their triangles, so that the view can interpolate between
    weeks, and have a map of the displacement since the first week. Observed brains have
    their own triangles each week. Positions are in steps of 1/65535 of the box around
    all surfaces, values of maps in 254 steps of their scale.

    Week and hemispheres are by week, those of a run with the same vertices: InputError
    if their numbers differ.
    """
    simulated = {
        name: _with_displacement([_timed(*frame) for frame in frames])
        for name, frames in runs.items()
    }
    observed_frames = [_timed(*frame) for frame in observed]
    everything = [*chain.from_iterable(simulated.values()), *observed_frames]
    if not everything:
        return {"groups": [], "maps": []}
    bytes_per_vertex = (
        len(everything) * _BYTES_PER_FRAME
        + (len(runs) + len(observed)) * _BYTES_PER_TRIANGULATION
    )
    affordable = BUDGET_BYTES / _LETTERS_PER_BYTE / bytes_per_vertex
    vertices = int(np.clip(affordable, MIN_VERTICES, MAX_VERTICES))
    places = np.concatenate([mesh.vertices for _, mesh, _ in everything])
    low = places.min(axis=0)
    box = low, float((places.max(axis=0) - low).max())
    scales = {}
    for name in _DRAWN:
        values = [maps[name] for _, _, maps in everything if name in maps]
        if values:
            scales[name] = scale_of(name, np.concatenate(values))
    groups: list[dict[str, Any]] = []
    for run, frames in simulated.items():
        vertices_kept, faces = _thin_out(frames[-1][1], vertices)
        drawn = [_frame(frame, vertices_kept, box, scales) for frame in frames]
        group = {
            "name": run,
            "kind": "simulated",
            "colour": SIMULATED_SURFACE_COLOUR,
            "faces": _text(faces, "<u2"),
            "frames": drawn,
        }
        groups.append(group)
    if observed_frames:
        drawn = []
        for frame in observed_frames:
            vertices_kept, faces = _thin_out(frame[1], vertices)
            own_faces = {"faces": _text(faces, "<u2")}
            drawn.append(_frame(frame, vertices_kept, box, scales) | own_faces)
        group = {
            "name": observed_name,
            "kind": "observed",
            "colour": OBSERVED_SURFACE_COLOUR,
            "frames": drawn,
        }
        groups.append(group)
    maps = [
        _drawn_map(
            name,
            scale,
        )
        for name, scale in scales.items()
    ]
    return {
        "low": low.tolist(),
        "size": box[1],
        "groups": groups,
        "maps": maps,
    }


def _drawn_map(name: str, scale: ScalarMappable) -> dict[str, Any]:
    """Return the title and the colours of a map."""
    low, high = scale.get_clim()
    levels = np.linspace(low, high, _VALUE_LEVELS + 1)
    colours = scale.to_rgba(levels, bytes=True)[:, :3]
    return {
        "name": name,
        "label": map_title(name),
        "low": low,
        "high": high,
        "colours": _text(colours, "u1"),
    }


def _timed(week: float, halves: Halves) -> Timed:
    mesh, maps = whole_maps(halves)
    drawn = {name: values for name, values in maps.items() if name in _DRAWN}
    return week, mesh, drawn


def _with_displacement(frames: Sequence[Timed]) -> list[Timed]:
    start = frames[0][1].vertices
    for week, mesh, maps in frames:
        if mesh.vertices.shape != start.shape:
            count = f"{len(mesh.vertices)} vertices at {week:g} GW"
            raise InputError(
                "the surfaces of a run differ in size",
                found=count,
                expected=f"{len(start)} vertices",
            )
        maps["displacement_mm"] = np.linalg.norm(
            mesh.vertices - start,
            axis=1,
        )
    return list(frames)


def _thin_out(
    mesh: TriangleMesh, vertices: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of about so many vertices to keep, and the (m, 3) triangles
    between them.

    Edges are collapsed onto existing vertices (Schroeder, Zarge & Lorensen 1992), so
    that maps and positions of other weeks can be indexed by the kept vertices.
    """
    if len(mesh.vertices) <= vertices:
        return np.arange(len(mesh.vertices)), np.asarray(
            mesh.faces,
            dtype=np.int64,
        )
    share = 1 - vertices / len(mesh.vertices)
    collapse = vtkDecimatePro()
    collapse.SetInputData(polydata(mesh))
    collapse.SetTargetReduction(share)
    collapse.PreserveTopologyOn()
    collapse.SetFeatureAngle(FEATURE_DEG)
    collapse.Update()
    coarse = collapse.GetOutput()
    points = vtk_to_numpy(coarse.GetPoints().GetData())
    _, vertices_kept = cKDTree(mesh.vertices).query(points)
    faces = vtk_to_numpy(coarse.GetPolys().GetConnectivityArray())
    return vertices_kept, faces.astype(np.int64).reshape(-1, 3)


def _frame(
    frame: Timed,
    vertices_kept: NDArray[np.int64],
    box: tuple[Floats, float],
    scales: Mapping[str, ScalarMappable],
) -> dict[str, Any]:
    (week, mesh, maps), (low, size) = frame, box
    values = {}
    for name, vertex_values in maps.items():
        bottom, top = scales[name].get_clim()
        heights = np.asarray(vertex_values, dtype=float)[vertices_kept] - bottom
        levels = np.round(heights / (top - bottom) * _VALUE_LEVELS)
        levels = np.where(
            np.isnan(levels),
            _UNKNOWN,
            levels.clip(0, _VALUE_LEVELS),
        )
        values[name] = _text(levels, "u1")
    places = np.round((mesh.vertices[vertices_kept] - low) / size * _POSITION_LEVELS)
    return {
        "week": week,
        "positions": _text(places, "<u2"),
        "values": values,
    }


def _text(values: NDArray, kind: str) -> str:
    return b64encode(values.astype(kind).tobytes()).decode("ascii")
