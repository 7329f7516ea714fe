"""The shapes of a series whose fit is not finished, kept after each week: an
interrupted fit goes on from there.

They are in a folder beside the result that is no output of a rule, since Snakemake
deletes outputs before a rule runs.
"""

import hashlib
import json
import logging
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..geometry.triangles import Floats
from .files import AnyPath, new_hdf5, reading_hdf5, sha256_of

log = logging.getLogger(__name__)

FILE = "shapes.h5"


@dataclass(frozen=True)
class UnfinishedSeries:
    """The checkpoint of a fit: a file in a folder whose name has a hash of everything
    that the shapes depend on."""

    folder: Path

    def write(
        self,
        weeks: Iterable[float],
        positions: Floats,
        stops: Iterable[float],
    ) -> None:
        """Write the (w, n, 3) positions in mm at the weeks so far; `stops` are those
        without an observed brain."""
        with new_hdf5(self.folder / FILE) as file:
            file["weeks"] = np.array(list(weeks))
            file["stops"] = np.array(
                list(stops),
                dtype=np.float64,
            )
            # in full precision: folds may lie closer to each other than that of a
            # result
            file["positions"] = positions
            file.attrs["checksum"] = _checksum(positions)

    def read(self) -> tuple[list[float], Floats, list[float]] | None:
        """Return weeks, positions and stops; None where there is no file, or a corrupt
        one, with a warning."""
        path = self.folder / FILE
        if not path.is_file():
            return None
        try:
            with reading_hdf5(
                path, "unfinished shapes", "weeks, positions and stops"
            ) as file:
                weeks, positions, stops = (
                    file[name][:] for name in ("weeks", "positions", "stops")
                )
                is_whole = file.attrs["checksum"] == _checksum(positions)
        except InputError as error:
            log.warning("%s: not used, the fit begins again", error)
            return None
        if not is_whole:
            log.warning(
                "the checkpoint %s is corrupt: not used, the fit begins again", path
            )
            return None
        return weeks.tolist(), positions, stops.tolist()

    def remove(self) -> None:
        """Remove the checkpoint of a fit that is finished."""
        shutil.rmtree(self.folder, ignore_errors=True)


def unfinished_series(
    result: AnyPath,
    inputs: Iterable[AnyPath],
    settings: Any,
) -> UnfinishedSeries:
    """Return the checkpoint of the fit that makes a result; those of other inputs or
    settings are removed.

    `inputs` count with their contents and in their order, `settings` are plain values,
    the hash of the code included.
    """
    made_from = [sha256_of(path) for path in inputs]
    key = hashlib.sha256(json.dumps([made_from, settings]).encode()).hexdigest()[:12]
    # results of several origins may be in one folder
    name = f"{Path(result).stem}-checkpoint"
    folder = Path(result).parent / f"{name}-{key}"
    for other in folder.parent.glob(f"{name}-*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    return UnfinishedSeries(folder)


def _checksum(positions: Floats) -> str:
    return hashlib.sha256(np.ascontiguousarray(positions).tobytes()).hexdigest()
