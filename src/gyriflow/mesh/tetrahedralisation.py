"""Filling a closed surface with tetrahedra by fTetWild (pytetwild), in a process of its own with a time limit.

`python -m gyriflow.mesh.tetrahedralisation` is that process: arrays come in on standard input and leave on standard
output.
"""

import io
import os
import subprocess
import sys
import tempfile

import numpy as np

from ..errors import MeshError
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, signed_volumes
from ..geometry.triangles import TriangleMesh, edges, euler_number, face_components, is_closed, signed_volume
from .sizing import background_mesh


def tetrahedralise(
    surface: TriangleMesh,
    *,
    surface_edge_mm: float,
    core_edge_mm: float,
    envelope_mm: float,
    time_limit_s: float,
) -> TetrahedralMesh:
    """Returns a tetrahedral mesh of the inside of a closed surface.

    Parameters
    ----------
    surface
        Closed, outward, in mm; one or more components.
    surface_edge_mm, core_edge_mm
        Edge length at the surface, and deep inside.
    envelope_mm
        How far the mesh's surface may be from the given one.
    time_limit_s
        The mesher is stopped after this time.

    Raises
    ------
    MeshError
        Where the surface is open or inside out, the mesher fails or takes too long, or its mesh is not the inside of
        the surface: other components or handles, inverted elements, more than 2 % of the volume lost.
    """
    if not is_closed(surface) or signed_volume(surface) <= 0:
        # the mesher would fill holes without a word
        raise MeshError("the surface to be filled must be closed and face outwards", remedy="Repair it first.")
    background, lengths = background_mesh(surface, surface_edge_mm, core_edge_mm)
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    arrays = {
        "vertices": surface.vertices,
        "faces": surface.faces,
        "bg_vertices": background.vertices,
        "bg_tets": background.tets,
        "bg_values": lengths,
        "edge": core_edge_mm,
        "epsilon": envelope_mm / diagonal,
    }
    mesh = _in_own_process(arrays, time_limit_s)
    _refuse_other_shape(mesh, surface)
    return mesh


def _in_own_process(arrays: dict, time_limit_s: float) -> TetrahedralMesh:
    sent = io.BytesIO()
    np.savez(sent, **arrays)
    try:
        # the mesher leaves a file in its working folder
        with tempfile.TemporaryDirectory() as folder:
            process = subprocess.run(
                [sys.executable, "-m", __name__],
                input=sent.getvalue(),
                capture_output=True,
                timeout=time_limit_s,
                check=False,
                cwd=folder,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
    except subprocess.TimeoutExpired as expired:
        log = (expired.stderr or b"").decode(errors="replace")[-1000:]
        raise MeshError(
            f"the mesher was stopped after {time_limit_s:g} s",
            found=f"its last words: {log or 'none'}",
            remedy="Raise mesh.time_limit_s, or mesh with longer edges.",
        ) from None
    if process.returncode != 0:
        raise MeshError(
            f"the mesher failed with exit code {process.returncode}",
            found=process.stderr.decode(errors="replace")[-1000:] or "no message",
            remedy="A negative code is a signal: -9 means that memory ran out.",
        )
    with np.load(io.BytesIO(process.stdout)) as received:
        return TetrahedralMesh(received["vertices"], received["tets"])


def _refuse_other_shape(mesh: TetrahedralMesh, surface: TriangleMesh) -> None:
    volumes = signed_volumes(mesh)
    boundary, _ = boundary_surface(mesh)
    open_edges = int((edges(boundary)[1] != 2).sum())
    wanted = signed_volume(surface)
    parts = [face_components(s).max() + 1 for s in (boundary, surface)]
    euler = [euler_number(s) for s in (boundary, surface)]
    problems = {
        f"{int((volumes <= 0).sum())} inverted elements": (volumes <= 0).any(),
        f"{open_edges} edges of its surface without two faces": open_edges > 0,
        f"volume {volumes.sum():.0f} mm3 instead of {wanted:.0f}": abs(volumes.sum() - wanted) > 0.02 * wanted,
        f"{parts[0]} parts instead of {parts[1]}": parts[0] != parts[1],
        f"Euler number {euler[0]} instead of {euler[1]}": euler[0] != euler[1],
    }
    found = [text for text, wrong in problems.items() if wrong]
    if found:
        raise MeshError(
            "the mesh is not the inside of the surface",
            found="; ".join(found),
            remedy="Mesh with a smaller mesh.envelope_mm, or smooth the surface more.",
        )


def _mesh_from_standard_input() -> None:
    import pytetwild

    output = os.dup(1)
    os.dup2(2, 1)  # what the mesher prints must not mix with the arrays
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as arrays:
        vertices, tets = pytetwild.tetrahedralize(
            arrays["vertices"],
            arrays["faces"].astype(np.uint32),
            edge_length_abs=float(arrays["edge"]),
            epsilon=float(arrays["epsilon"]),
            simplify=False,
            vtk_ordering=True,
            bg_vertices=arrays["bg_vertices"],
            bg_tets=arrays["bg_tets"].astype(np.int32),
            bg_values=arrays["bg_values"],
        )
    used, local = np.unique(tets, return_inverse=True)
    sent = io.BytesIO()
    np.savez(sent, vertices=vertices[used], tets=local.reshape(-1, 4))
    with os.fdopen(output, "wb") as stream:
        stream.write(sent.getvalue())


if __name__ == "__main__":
    _mesh_from_standard_input()
