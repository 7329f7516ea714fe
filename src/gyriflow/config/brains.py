"""The brains of a study: the data of their pial surfaces, tables of them, and regions given on them."""

import difflib
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, Field, model_validator

from ..errors import InputError
from ..parameters.schemes import Label
from ..parameters.settings import InputFile, Problem, Settings, beside, located
from ..parameters.synthetic import ShapeSettings
from ..parameters.terms import LONGEST_NAME, SIDES, AffineSource, Coordinates, Side
from ..parameters.varying import Week
from .scans import AGE, IDS, NOTHING, SESSION, UNIT_OF_AGE, Scan, read_scans

SOURCES = ("labels", "hemispheres", "hemisphere", "pial", "shape")
"""The keys of which a brain has exactly one."""

VOLUME_SUFFIXES = (".nii", ".nii.gz", ".mgz", ".mgh")
"""How the names of volumes end."""

HEMISPHERE_LABELS, HEMISPHERE_SURFACE = "labels of a hemisphere", "a hemisphere's surface"
OF_LABELS = ("labels", HEMISPHERE_LABELS)
OF_SURFACES = ("hemispheres", HEMISPHERE_SURFACE, "pial")
MEANINGS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("scheme", "image", "affine_from"), OF_LABELS),
    "coordinates": OF_SURFACES,
    "white": ("pial", HEMISPHERE_SURFACE),
    "population": (*OF_LABELS, *OF_SURFACES),
}
"""Keys that make sense only with some sources."""


class WhiteFiles(Settings):
    """The white surfaces of both hemispheres: the inner border of the cortex."""

    left: InputFile
    """File of the left hemisphere."""
    right: InputFile
    """File of the right hemisphere."""


class HemisphereFiles(Settings):
    """The pial surfaces of both hemispheres: GIFTI, VTK, STL, PLY or FreeSurfer files."""

    left: InputFile
    """File of the left hemisphere."""
    right: InputFile
    """File of the right hemisphere."""
    white: WhiteFiles | None = None
    """White surfaces in the same coordinates, for the cortical thickness."""


class OneHemisphere(Settings):
    """The only hemisphere of a brain, after hemispherectomy or where the data has one side."""

    file: InputFile
    """Its closed pial surface or, with the brain's `scheme`, a label volume without cortex of the other
    hemisphere."""
    side: Side
    """Which hemisphere it is."""


class Brain(Settings):
    """One brain, made from exactly one of `labels`, `hemispheres`, `hemisphere`, `pial` and `shape`."""

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=LONGEST_NAME)
    """Name in paths and tables: letters, digits, - _ ."""
    week: Week
    """Gestational age. [GW]"""
    population: str | None = Field(None, min_length=1)
    """Population in figures and tables, such as `spina bifida aperta`; `null`: real brain."""
    subject: str | None = Field(None, min_length=1)
    """Subject of whom several brains are scans. Change between scans is tabled, and simulations are compared
    with scans of their subject first."""
    covariates: dict[str, str] = Field({})
    """What else is known of it, such as `{sex: F}`: columns of `metrics_wide.csv` and of the export."""
    labels: InputFile | None = None
    """Tissue label volume (NIfTI or MGZ)."""
    image: InputFile | None = None
    """T2-weighted volume (NIfTI) of the labels, shown in a figure."""
    scheme: str | None = None
    """What the labels mean: the name of a file in the folder `schemes`, such as `dhcp-19`, or of the key
    `schemes`. Needed with `labels`."""
    affine_from: AffineSource = "auto"
    """NIfTI affine of `labels` and `image`; `auto` refuses two that disagree."""
    hemispheres: HemisphereFiles | None = None
    """Surface files of both hemispheres."""
    hemisphere: OneHemisphere | None = None
    """The only hemisphere, as a surface or as labels."""
    pial: InputFile | None = None
    """Closed surface of the whole brain."""
    white: InputFile | None = None
    """White surface of `pial` or `hemisphere`, in the same coordinates, for the cortical thickness."""
    coordinates: Coordinates = "auto"
    """Axes of surface files; `auto` finds any pose."""
    shape: ShapeSettings | None = None
    """A simple geometry in place of a brain."""

    @property
    def source(self) -> str:
        """The key that the surface is made from."""
        return next(name for name in SOURCES if self.gives(name))

    @property
    def synthetic(self) -> bool:
        """Whether it is a shape in place of a brain."""
        return self.shape is not None

    @property
    def sides(self) -> tuple[Side, ...]:
        """The hemispheres that the brain has."""
        return SIDES if self.hemisphere is None else (self.hemisphere.side,)

    @property
    def label_volume(self) -> str | None:
        """The label volume; None where there is none."""
        if self.hemisphere is not None and self.scheme is not None:
            return self.hemisphere.file
        return self.labels

    @property
    def has_labels(self) -> bool:
        """Whether the surface is made from a label volume."""
        return self.label_volume is not None

    @property
    def has_vertices(self) -> bool:
        """Whether the surface is made from surface files, whose vertices may be those of other brains too."""
        return not self.has_labels and self.source in ("hemispheres", "hemisphere", "pial")

    @property
    def files(self) -> list[str]:
        """The files that the surface is made from, the left hemisphere's first."""
        sides = [] if self.hemispheres is None else [self.hemispheres.left, self.hemispheres.right]
        one = None if self.hemisphere is None else self.hemisphere.file
        return [path for path in (self.labels, self.pial, *sides, one) if path is not None]

    @property
    def white_files(self) -> dict[str, str]:
        """The white surfaces by what they are of: left, right, whole."""
        pair = self.hemispheres.white if self.hemispheres else None
        sides = {} if pair is None else {"left": pair.left, "right": pair.right}
        return sides if self.white is None else {"whole": self.white}

    @property
    def _kind(self) -> str:
        """The source, with what it is where that may be either."""
        if self.hemisphere is None:
            return self.source
        volume = self.hemisphere.file.lower().endswith(VOLUME_SUFFIXES)
        return HEMISPHERE_LABELS if volume else HEMISPHERE_SURFACE

    def problems(self) -> Iterator[Problem]:
        given = [key for key in SOURCES if self.gives(key)]
        if not given and self.image is not None:
            yield Problem("gyriflow does not segment images; give a label volume under labels", ("image",))
        elif len(given) != 1:
            text = f"found {' and '.join(given) or 'none'} as its source; expected exactly one of {', '.join(SOURCES)}"
            yield Problem(text)
        else:
            for key, kinds in MEANINGS.items():
                if key in self.model_fields_set and self._kind not in kinds:
                    yield Problem(f"has no meaning with {self._kind}; only with {' or '.join(kinds)}", (key,))
            if self._kind in OF_LABELS and self.scheme is None:
                yield Problem("is missing; it says what the labels mean", ("scheme",))


# tables of brains

FILES = ("file", "files")
SIDE = "side"
NESTED: Mapping[str, tuple[str, ...]] = {
    "hemispheres": (*(f"hemispheres.{key}" for key in HemisphereFiles.model_fields if key != "white"),
                    *(f"hemispheres.white.{key}" for key in WhiteFiles.model_fields)),
    "hemisphere": tuple(f"hemisphere.{key}" for key in OneHemisphere.model_fields),
}  # fmt: skip
NOT_OF_TABLES = ("id", "shape", "covariates")
COLUMNS = (
    *(key for key in Brain.model_fields if key not in (*NESTED, *NOT_OF_TABLES)),
    *(column for columns in NESTED.values() for column in columns),
)
"""The columns that are keys of brains; any others are covariates."""
PATHS = ("labels", "image", "pial", "white", *NESTED["hemispheres"], "hemisphere.file")
ALMOST = 0.85
"""How like the name of a key an unknown column has to be to be taken for a mistyped one."""


class ParticipantsSettings(Settings):
    """A table with a brain in each row. `participants: FILE` is short for a section.

    Columns are `participant_id` (or `id`); the gestational age, `gestational_age` or `week`, as `24.3`, `24+2` or
    `24w2d` (or `age_weeks`, `age_days`, or `age` with its unit in the sidecar); and keys of brains, inner ones with a
    dot (`hemispheres.left`). Instead of keys, `files` may name labels, a pial surface, or left and right surfaces with
    a semicolon between; with `side`, one hemisphere. `n/a` is no value. Other columns are covariates. A participant
    with a `sub-01/sub-01_sessions.tsv` beside the table has a brain for each of its sessions, with that one's age.
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
    def _short_form(cls, value: Any) -> Any:
        return {"file": value} if isinstance(value, str) else value


def participants_brains(
    settings: ParticipantsSettings, folder: Path
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], list[str]]:
    """Returns the entries of `brains` that a table stands for, by id the rows that can't be used, and problems.

    Of the rows, `week` is the age if it is known, and `cause` what is missing. Problems are those that can't be left
    out with a row: a row that can't be used has the id of another one. `folder` is that of the configuration.
    InputError where the table cannot be read or lacks what every row needs.
    """
    path = located(folder, settings.file)
    scans = read_scans(path, settings.columns)
    _require_known_columns(path, list(scans[0].values))
    counts = Counter(scan.id for scan in scans)
    entries: list[dict[str, Any]] = []
    refused: dict[str, dict[str, Any]] = {}
    problems: list[str] = []
    for scan in scans:
        values = {key: value for key, value in scan.values.items() if value not in NOTHING}
        entry, problem = _entry(values, path.parent)
        text = f"{path}: {scan.id}: {scan.cause or problem}"
        if not (scan.cause or problem):
            subject = {} if scan.subject is None else {"subject": scan.subject}
            further = covariates(scan)
            entries.append({"id": scan.id, "week": scan.week} | subject | further | entry)
        elif counts[scan.id] > 1 and scan.id not in NOTHING:
            problems.append(f"{text} (the id is that of {counts[scan.id]} rows; ids are unique)")
        else:
            refused[scan.id] = {"week": scan.week, "cause": text}
    return entries, refused, problems


def covariates(scan: Scan) -> dict[str, dict[str, str]]:
    """Returns the key `covariates` of a scan's brain: the columns of its table that mean nothing else."""
    known = {*IDS, SESSION, *FILES, SIDE, *COLUMNS, scan.age_column}
    found = {key: value for key, value in scan.values.items() if key not in known and value not in NOTHING}
    return {"covariates": found} if found else {}


def _require_known_columns(path: Path, columns: list[str]) -> None:
    known = {*IDS, SESSION, *UNIT_OF_AGE, AGE, *FILES, SIDE, *COLUMNS}
    for column in set(columns) - known:
        nearest = difflib.get_close_matches(column, known, n=1, cutoff=ALMOST)
        if nearest:
            raise InputError(
                "has a column that seems mistyped",
                path=path,
                found=column,
                expected=nearest[0],
                remedy="Rename it; columns with quite other names are covariates.",
            )


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


# regions


class SurfaceRegions(Settings):
    """Regions at the vertices of a hemisphere's surface."""

    labels: InputFile
    """GIFTI label file (.label.gii), a label for each vertex."""
    surface: InputFile
    """The surface, in the coordinates of the brain's own files."""


class GivenRegions(Settings):
    """Regions of a brain, from a label volume or from labels of both hemispheres' surfaces.

    Left and right regions of one name are compared. Other brains get the regions of the brain nearest in week.
    """

    volume: InputFile | None = None
    """Label volume (NIfTI) in the space of the brain's `labels`, with regions along the cortex."""
    left: SurfaceRegions | None = None
    """Instead of a volume, labels of the left hemisphere."""
    right: SurfaceRegions | None = None
    """Labels of the right hemisphere."""
    names: dict[Label, str] = Field({})
    """Region of each label, such as `{1: frontal, 2: frontal, 3: parietal}`; labels of one name are one region,
    unnamed ones none. Needed with a volume; else the label files' names count."""

    def problems(self) -> Iterator[Problem]:
        sides = [side for side in SIDES if self.gives(side)]
        if (self.volume is not None) == bool(sides):
            found = "both" if sides else "neither"
            yield Problem(f"found {found}; expected volume, or left and right")
        elif len(sides) == 1:
            missing = "right" if sides == ["left"] else "left"
            yield Problem("is missing; both hemispheres need labels", (missing,))
        if self.volume is not None and not self.names:
            yield Problem("is missing; it names the regions of the volume", ("names",))

    @property
    def files(self) -> dict[str, str]:
        """The files by what they are."""
        if self.volume is not None:
            return {"volume": self.volume}
        pairs = {"left": self.left, "right": self.right}
        return {
            f"{side}_{kind}": getattr(pair, kind)
            for side, pair in pairs.items()
            if pair is not None
            for kind in ("labels", "surface")
        }
