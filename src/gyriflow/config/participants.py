"""Brains from a table of participants: which column is which key of a brain, and which rows can't be used."""

import difflib
from collections import Counter
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, Field, model_validator

from ..errors import InputError
from ..parameters.settings import Settings, beside, located
from .brains import SOURCES, VOLUME_SUFFIXES
from .scans import AGE, IDS, NOTHING, SESSION, UNIT_OF_AGE, Scan, read_scans

PATHS = ("labels", "image", "pial", "white", "hemispheres.left", "hemispheres.right", "hemisphere.file")
"""The columns that are keys of brains with paths, inner keys with dots."""
COLUMNS = (*PATHS, "population", "subject", "scheme", "affine_from", "coordinates", "hemisphere.side")
"""All columns that are keys of brains, besides those of who it is and of the age."""
FILES, SIDE = "files", "side"
"""Columns that stand for a source, whatever its key."""
KNOWN = {*IDS, SESSION, *UNIT_OF_AGE, AGE, FILES, SIDE, *COLUMNS}
ALMOST = 0.85
"""How like a known name an unknown column has to be to be taken for a mistyped one."""


class ParticipantsSettings(Settings):
    """A table with a brain in each row. `participants: FILE` is short for a section.

    Columns are `participant_id` (or `id`); the gestational age, `gestational_age` or `week`, as `24.3`, `24+2` or
    `24w2d` (or `age_weeks`, `age_days`, or `age` with its unit in the sidecar); and keys of brains, inner ones with a
    dot (`hemispheres.left`), two `white` surfaces with a semicolon between. Instead of keys, `files` may name labels, a
    pial surface, or left and right surfaces with a semicolon between; with `side`, one hemisphere. `n/a` is no value.
    Other columns are covariates. A participant with a `sub-01/sub-01_sessions.tsv` beside the table has a brain for
    each of its sessions, with that one's age.
    """

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string"]})

    file: str
    """Tab-separated file; paths in it are relative to it."""
    columns: dict[str, str] = Field({})
    """Columns that the table lacks, with one value for all rows, in which `{subject}`, `{session}` and `{id}`,
    such as `sub-01_ses-1`, are the row's: `{labels: '{subject}/{session}/anat/{id}_dseg.nii.gz', scheme:
    feta-7}`."""

    @model_validator(mode="before")
    @classmethod
    def _file_alone(cls, value: Any) -> Any:
        return {"file": value} if isinstance(value, str) else value


def participants_brains(
    settings: ParticipantsSettings, folder: Path
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], list[str]]:
    """Return the entries of `brains` that a table stands for, by id the rows that can't be used, and problems.

    Of the rows, `week` is the age if it is known, and `cause` what is missing. Problems are those that can't be left
    out with a row: a row that can't be used has the id of another one. `folder` is that of the configuration.
    InputError where the table cannot be read or lacks what every row needs.
    """
    path = located(folder, settings.file)
    scans = read_scans(path, settings.columns)
    for column in scans[0].values:
        if column not in KNOWN and (near := difflib.get_close_matches(column, KNOWN, n=1, cutoff=ALMOST)):
            raise InputError("has a column that seems mistyped", path=path, found=column, expected=near[0])
    counts = Counter(scan.id for scan in scans)
    entries: list[dict[str, Any]] = []
    left_out: dict[str, dict[str, Any]] = {}
    problems: list[str] = []
    for scan in scans:
        entry, problem = _entry(scan, path.parent)
        text = f"{path}: {scan.id}: {scan.cause or problem}"
        if not (scan.cause or problem):
            entries.append(entry)
        elif counts[scan.id] > 1 and scan.id not in NOTHING:
            problems.append(f"{text} (the id is that of {counts[scan.id]} rows; ids are unique)")
        else:
            left_out[scan.id] = {"week": scan.week, "cause": text}
    return entries, left_out, problems


def covariates(scan: Scan) -> dict[str, dict[str, str]]:
    """Return the key `covariates` of a scan's brain: the columns of its table that mean nothing else."""
    known = {*IDS, SESSION, FILES, SIDE, *COLUMNS, scan.age_column}
    others = {key: value for key, value in scan.values.items() if key not in known and value not in NOTHING}
    return {"covariates": others} if others else {}


def _entry(scan: Scan, folder: Path) -> tuple[dict[str, Any], str]:
    values = {key: value for key, value in scan.values.items() if value not in NOTHING}
    entry: dict[str, Any] = {"id": scan.id, "week": scan.week} | covariates(scan)
    if scan.subject is not None:
        entry["subject"] = scan.subject
    if FILES in values:
        files, side = [part.strip() for part in values[FILES].split(";")], values.get(SIDE)
        most, expected = (2, "a left and a right hemisphere at most") if side is None else (1, "the one of its side")
        if len(files) > most:
            return {}, f"files: found {len(files)}, {'; '.join(files)}; expected {expected}"
        values |= _of_files(files, side)
    for column in values:
        if column not in COLUMNS:
            continue
        value: Any = values[column]
        if column in PATHS:
            places = [beside(folder, part.strip()).resolve() for part in value.split(";")]
            if lost := [place for place in places if not place.is_file()]:
                return {}, f"{column}: no such file: {lost[0]}"
            value = str(places[0]) if len(places) == 1 else list(map(str, places))
        *outer, last = column.split(".")
        section = entry
        for key in outer:
            section = section.setdefault(key, {})
        section[last] = value
    return entry, "" if set(SOURCES) & set(entry) else f"found no data; expected files, or one of {', '.join(PATHS)}"


def _of_files(files: list[str], side: str | None) -> dict[str, str]:
    if side is not None:
        return {"hemisphere.file": files[0], "hemisphere.side": side}
    if len(files) == 2:
        return {"hemispheres.left": files[0], "hemispheres.right": files[1]}
    return {"labels" if files[0].lower().endswith(VOLUME_SUFFIXES) else "pial": files[0]}
