"""The state of a run between two steps, and its checkpoint, which resumes on any number
of ranks.

Arrays are in the mesh file's order. A checkpoint contains a hash of its mesh,
parameters and code, and a checksum of its content; one that does not match or is
corrupt is not used.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import h5py
import numpy as np

from ..code_hash import modules_behind, subpackage_of
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats
from ..io.files import new_hdf5
from ..settings.folding import FoldingParameters
from ..settings.varying import Maps

SUBPACKAGES = ("folding", "mechanics", "geometry", "settings", "units")
"""Subpackages and modules with the code that determines the results of a run."""
NOT_IN_KEY = (
    "ranks",
    "end_week",
    "output_weeks",
    "output_every_gw",
    "max_halvings",
)
"""Parameters that determine the end of a run, its output, its ranks, or how long the
solver tries, but not its states."""
ARRAYS = ("positions", "last", "before_last", "stretch", "growth")


@dataclass(frozen=True, eq=False)
class State:
    """The state of a run between two steps: everything that the next step depends on.

    Attributes
    ----------
    positions
        (n, 3), in m.
    time_s, step_s
        Time since the start, and the current time step, which is smaller than the
        nominal one after a halving.
    last, before_last, last_s, before_last_s
        Displacements (n, 3) in m and lengths of the last two steps; zero before them.
    successes
        Accepted steps since the last halving.
    stretch
        Elastic stretch (m, q, 6) at the end of the last step, if any of it is kept.
    correction
        Feedback of the last step to growth by sizes (`StepGrowth.correction`).
    growth, growth_s
        Deformation (m, 3, 3) of the elements by growth since the last output week,
        unless growth is by rates, and the time since then.
    rows
        The step table so far.
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
    correction: Sequence[float] | None = None
    growth: Floats | None = None
    growth_s: float = 0.0
    rows: tuple[dict, ...] = field(default=())

    @classmethod
    def at_start(cls, positions: Floats, step_s: float) -> "State":
        """Return the state before the first step, free of stress."""
        return cls(
            positions,
            time_s=0.0,
            step_s=step_s,
            last=np.zeros_like(positions),
            before_last=np.zeros_like(positions),
        )

    def initial_guesses(self, step_s: float) -> list[Floats]:
        """Return initial guesses (n, 3) in m of the displacement of the next step.

        The first one extrapolates the rates of the last two steps linearly; the second
        one repeats the last rate, which is better in the step after growth has changed.
        """
        if self.last_s == 0:
            return []
        rate = self.last / self.last_s
        if self.before_last_s == 0:
            return [rate * step_s]
        # rates are those in the middles of steps
        rate_before = self.before_last / self.before_last_s
        slope = (rate - rate_before) / ((self.last_s + self.before_last_s) / 2)
        next_rate = rate + slope * (self.last_s + step_s) / 2
        return [next_rate * step_s, rate * step_s]

    def after(
        self,
        displacement: Floats,
        step_s: float,
        row: dict,
        stretch: Floats | None = None,
        correction: Sequence[float] | None = None,
        growth: Floats | None = None,
    ) -> "State":
        """Return the state after an accepted step with its displacement (n, 3) in m.

        The other arguments are as the attributes.
        """
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
            correction=correction,
            growth=growth,
            growth_s=self.growth_s + step_s,
            rows=(*self.rows, row),
        )


def run_key(
    mesh: TetrahedralMesh,
    parameters: FoldingParameters,
    maps: Maps,
) -> str:
    """Return a hash of everything that determines the states of a run: mesh,
    parameters, maps and code.

    Parameters are left out if they only determine the end of the run, its output, its
    ranks, or how long the solver tries: so a run that failed can be resumed with an
    earlier end or more halvings.
    """
    values = parameters.model_dump(mode="json")
    for name in NOT_IN_KEY:
        del values[name]
    digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode())
    for module in sorted(modules_behind(Path(__file__).with_name("__main__.py"))):
        if subpackage_of(module) in SUBPACKAGES:
            digest.update(module.read_bytes())
    digest.update(mesh.vertices.tobytes())
    digest.update(mesh.tets.tobytes())
    for name in sorted(parameters.maps):
        digest.update(maps[name].tobytes())
    return digest.hexdigest()[:16]


def _checksum(arrays: dict[str, Floats], scalars: str) -> str:
    digest = hashlib.sha256(scalars.encode())
    for _, array in sorted(arrays.items()):
        digest.update(np.ascontiguousarray(array))
    return digest.hexdigest()


def write_checkpoint(
    path: Path,
    key: str,
    state: State,
) -> None:
    """Write the state of the run `key`; StorageError where the disk is full or the
    folder cannot be written."""
    values = dict(vars(state))
    arrays = {}
    for name in ARRAYS:
        array = values.pop(name)
        if array is not None:
            arrays[name] = array
    values["key"] = key
    scalars = json.dumps(values, sort_keys=True)
    with new_hdf5(path) as file:
        for name, array in arrays.items():
            file[name] = array
        # a data set, since the table of steps outgrows HDF5's limit for attributes
        file["scalars"] = np.frombuffer(
            scalars.encode(),
            dtype=np.uint8,
        )
        file.attrs["checksum"] = _checksum(arrays, scalars)


def read_checkpoint(path: Path, key: str) -> tuple[State | None, str]:
    """Return the state of the run `key`, or None, and a message for the user, empty
    without a checkpoint."""
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
    except Exception as error:  # HDF5 may raise anything on a corrupt file
        problem = f"is corrupt ({error}): not used, the run starts again"
        return None, f"the checkpoint {path} {problem}"
    if values.pop("key") != key:
        problem = "belongs to another mesh or other parameters: not used"
        return None, f"the checkpoint {path} {problem}"
    values["rows"] = tuple(values["rows"])
    state = State(**arrays, **values)
    return state, f"resuming from the checkpoint after step {len(state.rows)}"
