"""Surfaces, maps and tables of a study in a folder to hand on, with their own names or those of BIDS derivatives."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ..errors import InputError
from ..parameters.terms import STRUCTURES, Side
from .files import AnyPath, replaced, write_json, write_table
from .surfaces import read_vertex_maps, write_vertex_maps

MEASURED = "real"
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
"""Entities and suffix of the files of maps that BIDS, or a label of this project's own, names."""


@dataclass(frozen=True)
class ExportedBrain:
    """A brain at a week, and its files by the sides that it has; regions may be empty.

    The run is "real" for measured brains; the subject is who was scanned, or the brain where that is not said.
    """

    brain: str
    run: str
    week: float
    subject: str
    surfaces: Mapping[Side, str]
    maps: Mapping[Side, str]
    regions: Mapping[Side, str]


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
    made_by = [{"Name": "gyriflow", "Version": version}]
    described = {"Name": "gyriflow", "BIDSVersion": "1.9.0", "DatasetType": "derivative", "GeneratedBy": made_by}
    write_json(folder / "dataset_description.json", described)
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
        for side, surface in brain.surfaces.items():
            stem = folder / name / session / "anat" / f"{name}_{session}{run}_hemi-{side[0].upper()}"
            _copy(surface, f"{stem}_pial.surf.gii")
            for quantity, values in read_vertex_maps(brain.maps[side]).items():
                # a map that BIDS has no name for is described by its own
                kind = BIDS_MAPS.get(quantity, f"desc-{_alphanumeric(quantity.title())}_shape")
                write_vertex_maps(f"{stem}_{kind}.shape.gii", {quantity: values}, STRUCTURES[side])
            if side in brain.regions:
                _copy(brain.regions[side], f"{stem}_desc-regions_dseg.label.gii")
    sessions = pd.DataFrame(people, columns=["participant_id", "session_id", "brain", "gestational_age_weeks"])
    participants = sessions[["participant_id"]].drop_duplicates()
    for name, table in {"participants": participants, "sessions": sessions, **tables}.items():
        with replaced(folder / f"{name}.tsv") as temporary:
            table.to_csv(temporary, sep="\t", index=False, float_format="%.10g", na_rep="n/a")


def _alphanumeric(text: str) -> str:
    """Returns the letters and digits of a text, which is what BIDS labels may have."""
    return "".join(letter for letter in text if letter.isalnum())


def _copy(source: AnyPath, target: AnyPath) -> None:
    with replaced(target) as temporary:
        shutil.copyfile(source, temporary)
