"""A cohort: the rows of a table, as BIDS has them in `participants.tsv`, as brains of a study."""

import difflib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.files import read_tab_separated
from ..parameters.files import beside
from ..parameters.settings import Settings, setting
from .brains import SOURCES, VOLUME_SUFFIXES, Brain, HemisphereFiles, OneHemisphere, SegmentationSettings, WhiteFiles

IDS = ("participant_id", "id")
AGE = "age"
"""The one name of the column with the gestational age that is the mother's, or that after birth, in many tables."""
SURE_AGES = ("gestational_age", "week")
"""Names of that column which are believed whatever others are there."""
AGES = (
    *(*SURE_AGES, "ga", "ga_weeks", "gestational_weeks", "gestational_age_weeks", "scan_age", "weeks", "age_at_scan"),
    AGE,
)
"""All names of that column, in small letters or capitals."""
FILES = ("file", "files")
SIDE = "side"
NESTED: Mapping[str, tuple[str, ...]] = {
    "hemispheres": (*(f"hemispheres.{key}" for key in HemisphereFiles.model_fields if key != "white"),
                    *(f"hemispheres.white.{key}" for key in WhiteFiles.model_fields)),
    "hemisphere": tuple(f"hemisphere.{key}" for key in OneHemisphere.model_fields),
    "segmentation": tuple(f"segmentation.{key}" for key in SegmentationSettings.model_fields),
}  # fmt: skip
COLUMNS = (
    *(key for key in Brain.model_fields if key not in (*NESTED, "phantom", "shape", "id")),
    *(column for columns in NESTED.values() for column in columns),
)
"""The columns that are keys of brains; any others are left alone, as BIDS allows."""
PATHS = ("labels", "image", "pial", "white", *NESTED["hemispheres"], "hemisphere.file", "hemisphere.white")
NOTHING = frozenset(("", "n/a"))
"""What stands for no value in BIDS."""
ALMOST = 0.85
"""How like the name of a key an unknown column has to be to be taken for a mistyped one."""
WEEKS = (15.0, 45.0)


class ParticipantsSettings(Settings):
    """A table of brains, one a row. `participants: FILE` is short for a section with only `file`.

    Columns: `participant_id` (or `id`); the gestational age in weeks, `gestational_age` (or `week`; or, where no two of
    these differ, `ga`, `scan_age`, `age` and the like); and keys of brains, nested ones with a dot, such as `labels`,
    `scheme` or `hemispheres.left`. In place of these, `files` has a label volume, a pial surface, or those of the left
    and the right hemisphere with a semicolon between; with `side`, the one hemisphere that there is. `n/a` stands for
    no value. Other columns are left alone.
    """

    file: str = setting(..., "", "The table, tab-separated; paths in it are relative to it.")
    columns: dict[str, str] = setting(
        {}, "",
        "Values of columns that the table lacks, the same for all rows; `{id}` stands for the row's id, as in "
        "`{labels: 'derivatives/{id}/anat/{id}_dseg.nii.gz', scheme: feta-7}`.",
    )  # fmt: skip


def participants_section(raw: Any) -> Any:
    """Returns the section as given (raw), a file's name as a section."""
    return {"file": raw} if isinstance(raw, str) else raw


def participants_brains(
    settings: ParticipantsSettings, folder: Path
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], list[str]]:
    """Returns the entries of `brains` that a table stands for, by id the rows that can't be used, and problems.

    Of the rows, `week` is the age if it is known, and `cause` what is missing. Problems are those that can't be left
    out with a row: a row that can't be used has the id of another one. `folder` is that of the configuration.
    InputError where the table cannot be read or lacks what every row needs.
    """
    places = [beside(folder, settings.file), Path(settings.file)]
    path = next((place for place in places if place.is_file()), places[0]).resolve()
    rows = read_tab_separated(path)
    columns = [*rows[0], *settings.columns] if rows else []
    _require_columns(path, columns)
    id_column = next(name for name in IDS if name in columns)
    age_column = _age_column(path, [settings.columns | row for row in rows])
    counts = Counter(row[id_column] for row in rows)
    entries: list[dict[str, Any]] = []
    refused: dict[str, dict[str, Any]] = {}
    problems: list[str] = []
    for row in rows:
        name = row[id_column]
        known = {key: value.replace("{id}", name) for key, value in settings.columns.items()} | row
        values = {key: value for key, value in known.items() if value not in NOTHING}
        week, cause = _week(values.get(age_column), age_column)
        entry, problem = _entry(values, path.parent)
        text = f"{path}: {name}: {cause or problem}"
        if not (cause or problem):
            entries.append({"id": name, "week": week} | entry)
        elif counts[name] > 1 and name not in NOTHING:
            problems.append(f"{text} (the id is that of {counts[name]} rows; ids are unique)")
        else:
            refused[name] = {"week": week, "cause": text}
    return entries, refused, problems


def _require_columns(path: Path, columns: list[str]) -> None:
    ages = {name.lower() for name in columns}
    for names, there, what in ((IDS, set(columns), "ids"), (AGES, ages, "gestational ages")):
        if not set(names) & there:
            raise InputError(
                f"has no column of {what}",
                path=path,
                found=", ".join(columns) or "no rows",
                expected=" or ".join(names),
            )
    known = {*IDS, *SURE_AGES, AGE, *FILES, SIDE, *COLUMNS}
    for column in {name for name in columns if name.lower() not in AGES} - known:
        nearest = difflib.get_close_matches(column, known, n=1, cutoff=ALMOST)
        if nearest:
            raise InputError(
                "has a column that seems mistyped",
                path=path,
                found=column,
                expected=nearest[0],
                remedy="Rename it; columns with quite other names are left alone.",
            )


def _age_column(path: Path, rows: Sequence[Mapping[str, str]]) -> str:
    """Returns the column with the gestational age; InputError where several may be it that do not say the same."""
    columns = list(rows[0])
    found = [name for name in SURE_AGES if name in columns][:1] or [
        column for name in AGES for column in columns if column.lower() == name
    ]
    ages = [[_week(row[column], column)[0] for row in rows] for column in found]
    if any(other != ages[0] for other in ages[1:]):
        raise InputError(
            "has several columns that may be the gestational age, which differ",
            path=path,
            found=" and ".join(found),
            expected="one of them",
            remedy=f"Call that of the gestational age in weeks {SURE_AGES[0]}; it is taken whatever others are there.",
        )
    return found[0]


def _week(text: str | None, column: str) -> tuple[float | None, str]:
    """Returns the age and what is wrong with it, empty where nothing is."""
    try:
        week = float(text or "")
    except ValueError:
        return None, f"{column}: found {text or 'n/a'}; expected the gestational age in weeks"
    first, last = WEEKS
    if not first <= week <= last:
        return None, f"{column}: found {text}; expected gestational weeks, {first:g} to {last:g} (not days or years)"
    return week, ""


def _entry(values: Mapping[str, str], folder: Path) -> tuple[dict[str, Any], str]:
    """Returns the entry of a row without id and week, and what it lacks, empty where nothing is missing."""
    values = dict(values)
    files = next((values[name] for name in FILES if name in values), None)
    if files is not None:
        parts, side = [part.strip() for part in files.split(";")], values.get(SIDE)
        most, expected = (2, "a left and a right hemisphere at most") if side is None else (1, "the one of its side")
        if len(parts) > most:
            return {}, f"files: found {len(parts)}, {'; '.join(parts)}; expected {expected}"
        values |= _of_files(parts, side)
    entry: dict[str, Any] = {}
    for column in COLUMNS:
        if column not in values or column == "week":
            continue
        value = values[column]
        if column in PATHS:
            place = beside(folder, value).resolve()
            if not place.is_file():
                return {}, f"{column}: no such file: {place}"
            value = str(place)
        *outer, last = column.split(".")
        section = entry
        for key in outer:
            section = section.setdefault(key, {})
        section[last] = value
    if not set(SOURCES) & set(entry):
        return {}, f"found no data; expected files, or one of {', '.join(key for key in COLUMNS if key in PATHS)}"
    return entry, ""


def _of_files(files: list[str], side: str | None) -> dict[str, str]:
    """Returns the columns that files stand for, by their number and kind."""
    if side is not None:
        return {"hemisphere.file": files[0], "hemisphere.side": side}
    if len(files) == 2:
        left, right = files
        if re.search(r"\bright\b|\brh\b|hemi-R", left) and re.search(r"\bleft\b|\blh\b|hemi-L", right):
            left, right = right, left
        return {"hemispheres.left": left, "hemispheres.right": right}
    return {"labels" if files[0].lower().endswith(VOLUME_SUFFIXES) else "pial": files[0]}
