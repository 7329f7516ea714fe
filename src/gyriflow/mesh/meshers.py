"""The meshers, each in a process of its own with a time limit: fTetWild (pytetwild) and
TetGen (within libigl).

`python -m gyriflow.mesh.meshers NAME` is that process: arrays come in on standard input
and leave on standard output.
"""

import io
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Thread
from typing import Any

import numpy as np

from ..errors import MeshError
from ..geometry.tetrahedra import TetrahedralMesh

log = logging.getLogger(__name__)

LAST_WORDS = 1000
"""So many of the last characters that a mesher prints stand in the message of its
failure; all of them are logged."""

RADIUS_EDGE_RATIO = 1.3
"""TetGen's bound on circumradius over shortest edge: from here on edges grow as fast as
elements stay good."""
STOP_ENERGY = 50
"""Largest AMIPS energy at which fTetWild stops improving elements before it sizes them,
which improves them again; that of the regular element is 3."""
OPTIMISED_DEG = 140
"""Dihedral angles beyond this are what TetGen improves last; with its own 165 slivers
stay."""


def run_mesher(
    name: str,
    arrays: Mapping[str, Any],
    time_limit_s: float,
) -> TetrahedralMesh:
    """Return the mesh that a mesher, "pytetwild" or "tetgen", makes in a process of its
    own; its lines are logged.

    `arrays` are `vertices` (n, 3) and `faces` (m, 3) of the surface, and what the
    mesher needs besides. MeshError where it is missing, dies or takes longer than
    `time_limit_s`, with its last words.
    """
    sent = io.BytesIO()
    np.savez(sent, **arrays)
    # a mesher may leave files in its working folder
    with tempfile.TemporaryDirectory() as folder:
        ended = _run(name, sent.getvalue(), folder, time_limit_s)
    last = "\n".join(ended.lines)[-LAST_WORDS:]
    if ended.code is None:
        raise MeshError(
            f"the mesher {name} was stopped after {time_limit_s:g} s",
            found=f"its last words: {last or 'none'}",
            remedy="Mesh with longer edges, or with another mesh.mesher.",
        )
    if ended.code != 0:
        raise MeshError(
            f"the mesher {name} failed with exit code {ended.code}",
            found=last or "no message",
            remedy=(
                "A negative code is a signal: -9 means that memory ran out. A module"
                " that cannot be imported has to be installed in the version of"
                " envs/requirements.txt."
            ),
        )
    with np.load(io.BytesIO(ended.output)) as received:
        return TetrahedralMesh(received["vertices"], received["tets"])


@dataclass(frozen=True)
class Ended:
    """A process that has ended: its exit code, None after the time limit, its output
    and the lines that it printed."""

    code: int | None
    output: bytes
    lines: list[str]


def _run(
    name: str,
    sent: bytes,
    folder: str,
    time_limit_s: float,
) -> Ended:
    lines: list[str] = []
    reading, printing = os.pipe()
    listener = Thread(target=_log_lines, args=(reading, name, lines))
    search_path = os.pathsep.join(filter(None, sys.path))
    with subprocess.Popen(
        [sys.executable, "-m", __name__, name],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=printing,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": search_path},
    ) as process:
        os.close(printing)
        listener.start()
        try:
            output, _ = process.communicate(sent, timeout=time_limit_s)
            code: int | None = process.returncode
        except subprocess.TimeoutExpired:
            output = b""
            code = None
        finally:
            process.kill()
    listener.join()
    return Ended(code, output, lines)


def _log_lines(reading: int, name: str, lines: list[str]) -> None:
    """Log and collect what a mesher prints as it comes, so that one can see how far it
    is."""
    with os.fdopen(reading, errors="replace") as stream:
        for line in stream:
            text = line.rstrip()
            if text:
                lines.append(text)
                log.info("%s: %s", name, text)


def _pytetwild(arrays: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    import pytetwild

    return pytetwild.tetrahedralize(
        arrays["vertices"],
        arrays["faces"].astype(np.uint32),
        edge_length_abs=float(arrays["edge"]),
        epsilon=float(arrays["epsilon"]),
        simplify=False,
        stop_energy=STOP_ENERGY,
        # one job uses one core; threads add processor time
        num_threads=1,
        vtk_ordering=True,
        bg_vertices=arrays["bg_vertices"],
        bg_tets=arrays["bg_tets"].astype(np.int32),
        bg_values=arrays["bg_values"],
    )


def _tetgen(arrays: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    from igl.copyleft import tetgen

    # p: inside of the surface, Y: the surface as it is, q: quality, a: largest volume,
    # o: last improvements
    flags = f"pYq{RADIUS_EDGE_RATIO}a{float(arrays['volume']):.6f}o/{OPTIMISED_DEG}"
    vertices, tets, *_ = tetgen.tetrahedralize(
        arrays["vertices"], arrays["faces"], flags=flags
    )
    return vertices, tets


MESHERS = {"pytetwild": _pytetwild, "tetgen": _tetgen}


def _mesh_from_standard_input(name: str) -> None:
    output = os.dup(1)
    os.dup2(2, 1)  # what the mesher prints must not mix with the arrays
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as arrays:
        vertices, tets = MESHERS[name](arrays)
    used, local = np.unique(tets, return_inverse=True)
    sent = io.BytesIO()
    np.savez(
        sent,
        vertices=vertices[used],
        tets=local.reshape(-1, 4),
    )
    with os.fdopen(output, "wb") as stream:
        stream.write(sent.getvalue())


if __name__ == "__main__":
    _mesh_from_standard_input(sys.argv[1])
