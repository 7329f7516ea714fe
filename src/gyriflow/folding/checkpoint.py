"""The state of a run between two steps, and its checkpoint: enough to go on after any interruption, on any ranks.

Arrays are in the mesh file's order. A checkpoint names the mesh and the parameters it belongs to by a hash and carries
a checksum of its own content; one that does not fit or is torn is not used.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import h5py
import numpy as np

from ..code_hash import modules_behind, room_of
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats
from ..io.files import new_hdf5
from ..settings.folding import FoldingParameters
from ..settings.varying import Maps

ROOMS = ("folding", "mechanics", "geometry", "settings", "units")
"""Where the modules lie on which the course of a run depends."""
ARRAYS = ("positions", "last", "before_last", "stretch", "grown")


@dataclass(frozen=True, eq=False)
class State:
    """Where a run stands: everything that the next step depends on.

    The (n, 3) positions in m, the time since the start, and the present time step, smaller than the nominal one after a
    halving; the (n, 3) displacements in m and the lengths of the two last steps, zero where there was none; steps since
    the last halving. Where stress is remembered, the (m, q, 6) elastic stretch that the next step starts with; what
    the last step has taught growth by sizes; where growth is not by rates, its logarithm (6, n) since the last output
    week, and the time since then; the step table so far.
    """

    positions: Floats
    time_s: float
    step_s: float
    last: Floats
    before_last: Floats
    last_s: float = 0.0
    before_last_s: float = 0.0
    successes: int = 0
    stretch: Floats | None = None
    learnt: Sequence[float] | None = None
    grown: Floats | None = None
    grown_s: float = 0.0
    rows: tuple[dict, ...] = field(default=())

    @classmethod
    def at_start(cls, positions: Floats, step_s: float) -> "State":
        """Return the state before the first step, free of stress."""
        return cls(positions, 0.0, step_s, np.zeros_like(positions), np.zeros_like(positions))

    def predicted(self, step_s: float) -> list[Floats]:
        """Return (n, 3) first guesses in m for a step of a given length, the best one first where growth is steady.

        They are the two last steps' rates extended, and the last one's alone, for the step after growth has changed.
        """
        if self.last_s == 0:
            return []
        rate = self.last / self.last_s
        if self.before_last_s == 0:
            return [rate * step_s]
        slope = (rate - self.before_last / self.before_last_s) / ((self.last_s + self.before_last_s) / 2)
        return [(rate + slope * (self.last_s + step_s) / 2) * step_s, rate * step_s]

    def after(
        self,
        displacement: Floats,
        step_s: float,
        row: dict,
        stretch: Floats | None = None,
        learnt: Sequence[float] | None = None,
        log_growth: Floats | None = None,
    ) -> "State":
        """Return the state after an accepted step with its (n, 3) displacement in m; what it left and taught."""
        grown = self.grown if self.grown is None or log_growth is None else self.grown + log_growth
        return replace(
            self,
            positions=self.positions + displacement,
            time_s=self.time_s + step_s,
            last=displacement,
            before_last=self.last,
            last_s=step_s,
            before_last_s=self.last_s,
            successes=self.successes + 1,
            stretch=stretch,
            learnt=learnt,
            grown=log_growth if grown is None else grown,
            grown_s=self.grown_s + step_s,
            rows=(*self.rows, row),
        )


def run_key(mesh: TetrahedralMesh, parameters: FoldingParameters, maps: Maps) -> str:
    """Return a hash of all that decides the course of a run: mesh, parameters, maps, and the code of model and solver.

    Left out is what only decides how far it goes, when it writes and on how many ranks: a run that failed can be
    called again with an earlier end or more halvings and goes on.
    """
    values = parameters.model_dump(mode="json")
    for name in ("ranks", "end_week", "output_weeks", "output_every_gw"):
        del values[name]
    for name in ("max_newton", "max_halvings"):
        del values["solver"][name]
    digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode())
    solver = modules_behind(Path(__file__).with_name("__main__.py"))
    for source in sorted(module for module in solver if room_of(module) in ROOMS):
        digest.update(source.read_bytes())
    digest.update(mesh.vertices.tobytes())
    digest.update(mesh.tets.tobytes())
    for name in sorted(parameters.maps):
        digest.update(maps[name].tobytes())
    return digest.hexdigest()[:16]


def _checksum(arrays: dict[str, Floats], scalars: str) -> str:
    digest = hashlib.sha256(scalars.encode())
    for name in sorted(arrays):
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()


def write_checkpoint(path: Path, key: str, state: State) -> None:
    """Write the state of the run `key`; StorageError where the disk is full or the folder cannot be written."""
    values = dict(vars(state))
    arrays = {name: values.pop(name) for name in ARRAYS if values[name] is not None}
    for name in ARRAYS:
        values.pop(name, None)
    scalars = json.dumps({**values, "key": key}, sort_keys=True)
    with new_hdf5(path) as file:
        for name, array in arrays.items():
            file[name] = array
        # a data set, since the table of steps outgrows HDF5's limit for attributes
        file["scalars"] = np.frombuffer(scalars.encode(), dtype=np.uint8)
        file.attrs["checksum"] = _checksum(arrays, scalars)


def read_checkpoint(path: Path, key: str) -> tuple[State | None, str]:
    """Return the state of the run `key`, or None, and what to tell the user about it (empty: there is none)."""
    if not path.exists():
        return None, ""
    try:
        with h5py.File(path) as file:
            arrays = {name: file[name][:] for name in ARRAYS if name in file}
            scalars = file["scalars"][:].tobytes().decode()
            checksum = file.attrs["checksum"]
        if _checksum(arrays, scalars) != checksum:
            raise ValueError("its checksum is wrong")
        values = json.loads(scalars)
    except Exception as error:  # HDF5 raises whatever a torn file leads it into
        return None, f"the checkpoint {path} is torn ({error}): not used, the run starts anew"
    if values.pop("key") != key:
        return None, f"the checkpoint {path} belongs to another mesh or other parameters: not used"
    values["rows"] = tuple(values["rows"])
    state = State(**arrays, **values)
    return state, f"going on from the checkpoint after step {len(state.rows)}"
