"""The meshers, each in a process of its own with a time limit: fTetWild (pytetwild) and TetGen (within libigl).

`python -m gyriflow.mesh.meshers NAME` is that process: arrays come in on standard input and leave on standard output.
"""

import io
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import MeshError
from ..geometry.tetrahedra import TetrahedralMesh

PACKAGES = {"pytetwild": "pytetwild", "tetgen": "libigl"}
"""The package that each mesher comes with."""
MISSING = 77
"""Exit code of a process whose mesher is not installed."""

RADIUS_EDGE_RATIO = 1.3
"""TetGen's bound on circumradius over shortest edge: from here on edges grow as fast as elements stay good."""
OPTIMISED_DEG = 140
"""Dihedral angles beyond this are what TetGen improves last; with its own 165 slivers stay."""


def run_mesher(name: str, arrays: Mapping[str, Any], time_limit_s: float) -> TetrahedralMesh:
    """Returns the mesh that a mesher makes in a process of its own.

    Parameters
    ----------
    name
        "pytetwild" or "tetgen".
    arrays
        `vertices` (n, 3) and `faces` (m, 3) of the surface, and what the mesher needs besides.
    time_limit_s
        The process is stopped after this time.

    Raises
    ------
    MeshError
        Where the mesher is not installed, dies or takes too long, with its last words.
    """
    sent = io.BytesIO()
    np.savez(sent, **arrays)
    try:
        # a mesher may leave files in its working folder
        with tempfile.TemporaryDirectory() as folder:
            process = subprocess.run(
                [sys.executable, "-m", __name__, name],
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
            f"the mesher {name} was stopped after {time_limit_s:g} s",
            found=f"its last words: {log or 'none'}",
            remedy="Raise mesh.time_limit_s, or mesh with longer edges.",
        ) from None
    log = process.stderr.decode(errors="replace")[-1000:]
    if process.returncode == MISSING:
        raise MeshError(
            f"the mesher {name} is not installed",
            found=log.strip().splitlines()[-1],
            remedy=f"Install {PACKAGES[name]} as envs/requirements.txt names it, or choose another mesh.mesher.",
        )
    if process.returncode != 0:
        raise MeshError(
            f"the mesher {name} failed with exit code {process.returncode}",
            found=log or "no message",
            remedy="A negative code is a signal: -9 means that memory ran out.",
        )
    with np.load(io.BytesIO(process.stdout)) as received:
        return TetrahedralMesh(received["vertices"], received["tets"])


def _pytetwild(arrays: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    import pytetwild

    return pytetwild.tetrahedralize(
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


def _tetgen(arrays: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    from igl.copyleft import tetgen

    # p: inside of the surface, Y: the surface as it is, q: quality, a: largest volume, o: last improvements
    flags = f"pYq{RADIUS_EDGE_RATIO}a{float(arrays['volume']):.6f}o/{OPTIMISED_DEG}"
    vertices, tets, *_ = tetgen.tetrahedralize(arrays["vertices"], arrays["faces"], flags=flags)
    return vertices, tets


MESHERS = {"pytetwild": _pytetwild, "tetgen": _tetgen}


def _mesh_from_standard_input(name: str) -> None:
    output = os.dup(1)
    os.dup2(2, 1)  # what the mesher prints must not mix with the arrays
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as arrays:
        try:
            vertices, tets = MESHERS[name](arrays)
        except ImportError as error:
            print(error, file=sys.stderr)
            sys.exit(MISSING)
    used, local = np.unique(tets, return_inverse=True)
    sent = io.BytesIO()
    np.savez(sent, vertices=vertices[used], tets=local.reshape(-1, 4))
    with os.fdopen(output, "wb") as stream:
        stream.write(sent.getvalue())


if __name__ == "__main__":
    _mesh_from_standard_input(sys.argv[1])
