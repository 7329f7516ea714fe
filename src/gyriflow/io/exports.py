"""Surfaces, maps and tables of a study in a folder to hand on, with their own names or those of BIDS derivatives."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ..errors import InputError
from ..parameters.terms import SIDES, STRUCTURES
from .files import AnyPath, replaced, write_json, write_table
from .surfaces import read_vertex_maps, write_vertex_maps

MEASURED = "real"
BIDS_VERSION = "1.9.0"
BIDS_MAPS = {
    "mean_curvature": "curv",
    "sulcal_depth_mm": "sulc",
    "thickness_mm": "thickness",
    "shape_index": "desc-shapeIndex_shape",
    "curvedness": "desc-curvedness_shape",
    "gaussian_curvature": "desc-gaussian_curv",
    "local_gyrification_index": "desc-localGyrification_shape",
    "spangy_dominant_band": "desc-spangyBand_shape",
    "reliable": "desc-reliable_shape",
}
"""Entities and suffix of each map's file."""


@dataclass(frozen=True)
class ExportedBrain:
    """A brain at a week, and its files.

    Attributes
    ----------
    brain, run, week
        As in the tables; the run is "real" for measured brains.
    subject
        Who was scanned; the brain where that is not said.
    surfaces, maps, regions
        By side; regions may be empty.
    """

    brain: str
    run: str
    week: float
    subject: str
    surfaces: Mapping[str, str]
    maps: Mapping[str, str]
    regions: Mapping[str, str]


def export_plain(folder: AnyPath, brains: Sequence[ExportedBrain], tables: Mapping[str, pd.DataFrame]) -> None:
    """Writes tables as CSV, and the files of each brain under `BRAIN/RUN/week-WEEK` with the names that they have."""
    folder = Path(folder)
    for name, table in tables.items():
        write_table(folder / f"{name}.csv", table)
    for brain in brains:
        place = folder / brain.brain / brain.run / f"week-{brain.week:.2f}"
        for path in (*brain.surfaces.values(), *brain.maps.values(), *brain.regions.values()):
            _copy(path, place / Path(path).name)


def export_bids(
    folder: AnyPath, brains: Sequence[ExportedBrain], tables: Mapping[str, pd.DataFrame], version: str
) -> None:
    """Writes a BIDS derivative: a session a week, simulated brains with `acq-RUN`, a file for each map, tables as TSV.

    Names follow the BIDS specification 1.9 with the suffixes that BEP011 proposes for surfaces. InputError where two
    brains of one subject have the same session.
    """
    folder = Path(folder)
    write_json(
        folder / "dataset_description.json",
        {
            "Name": "gyriflow",
            "BIDSVersion": BIDS_VERSION,
            "DatasetType": "derivative",
            "GeneratedBy": [{"Name": "gyriflow", "Version": version}],
        },
    )
    people: list[tuple[str, str, str, float]] = []
    taken: dict[tuple[str, str, str], ExportedBrain] = {}
    for brain in brains:
        name, session = f"sub-{_alphanumeric(brain.subject)}", f"ses-{_alphanumeric(f'{brain.week:.2f}')}w"
        before = taken.setdefault((name, session, _alphanumeric(brain.run)), brain)
        if before is not brain:
            raise InputError(
                f"two brains have the same BIDS name {name}_{session}",
                found=f"{before.brain} and {brain.brain}",
                expected="ids that differ in their letters and digits",
            )
        if brain.run == MEASURED:
            people.append((name, session, brain.brain, brain.week))
        run = "" if brain.run == MEASURED else f"_acq-{_alphanumeric(brain.run)}"
        for side in SIDES:
            stem = folder / name / session / "anat" / f"{name}_{session}{run}_hemi-{side[0].upper()}"
            _copy(brain.surfaces[side], f"{stem}_pial.surf.gii")
            for quantity, values in read_vertex_maps(brain.maps[side]).items():
                write_vertex_maps(f"{stem}_{BIDS_MAPS[quantity]}.shape.gii", {quantity: values}, STRUCTURES[side])
            if brain.regions:
                _copy(brain.regions[side], f"{stem}_desc-regions_dseg.label.gii")
    columns = ["participant_id", "session_id", "brain", "gestational_age_weeks"]
    _write_tsv(folder / "participants.tsv", pd.DataFrame(people, columns=columns)[columns[:1]].drop_duplicates())
    _write_tsv(folder / "sessions.tsv", pd.DataFrame(people, columns=columns))
    for name, table in tables.items():
        _write_tsv(folder / f"{name}.tsv", table)


def _alphanumeric(text: str) -> str:
    """Returns the letters and digits of a text, which is what BIDS labels may have."""
    return "".join(letter for letter in text if letter.isalnum())


def _copy(source: AnyPath, target: AnyPath) -> None:
    with replaced(target) as temporary:
        shutil.copyfile(source, temporary)


def _write_tsv(path: AnyPath, table: pd.DataFrame) -> None:
    with replaced(path) as temporary:
        table.to_csv(temporary, sep="\t", index=False, float_format="%.10g", na_rep="n/a")
