"""Atlases: the keys of an `atlas.yaml`, and of the section by which a study uses
one."""

import re
from collections.abc import Iterable
from pathlib import Path
from string import Formatter
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field, field_validator

from ..shipped import ATLASES, shipped_atlases
from .base import (
    KeyProblem,
    Problems,
    Settings,
    did_you_mean,
    located,
    not_a_path,
    refused,
)
from .weeks import AnyWeek

DOWNLOADS = Path("resources", "atlases")
"""Folder in the working directory for the files of atlases whose section names no
other."""

FileKey = Literal[
    "labels", "image", "left", "right", "pial", "white_left", "white_right", "white"
]
SOURCES_OF_SERIES: tuple[tuple[set[FileKey], set[FileKey]], ...] = (
    ({"labels"}, {"image"}),
    ({"left", "right"}, {"white_left", "white_right"}),
    ({"pial"}, {"white"}),
)
"""Sets of file keys that define a surface, each with those that may come with it. A
series has one of them."""
Checksum = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
WEEK_FORMAT = r"(0?[1-9]?(\.[0-9])?f?)"
"""How a week may be written in a file's name, as `05.2f`."""
NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"


def _names_weeks(pattern: str) -> bool:
    try:
        parts = list(Formatter().parse(pattern))
    except ValueError:
        return False
    fields = [part[1:] for part in parts if part[1] is not None]
    for name, kind, flag in fields:
        if name != "week" or flag is not None:
            return False
        if not re.fullmatch(WEEK_FORMAT, kind or ""):
            return False
    return bool(fields)


def _require_weeks_once[Weeks: Iterable[Any]](weeks: Weeks) -> Weeks:
    listed = [str(week) for week in weeks]
    if not listed or len(set(listed)) < len(listed):
        raise ValueError("should name one week or more, each once")
    return weeks


class AtlasLicence(Settings):
    """Terms of use, shown before any file is fetched."""

    name: str
    """Name of the licence, as `CC0 1.0`."""
    terms: str
    """Summary in a sentence or two, with the address of the full text."""
    accept: bool = False
    """Whether users have to accept terms that are narrow or unclear."""


class AtlasSeries(Settings):
    """One population by week."""

    population: str = Field(min_length=1)
    """Name of these brains in figures and tables."""
    scheme: str | None = None
    """Meaning of the labels, as for `brains`; required with `labels`."""
    matched: bool = False
    """Whether surfaces of all weeks have the same vertices; believed until the files
    are there."""
    files: dict[FileKey, str]
    """Path of each file below the URL, and next to `atlas.yaml` or in the folder of a
    study's section `atlas`, with `{week}` (`{week:05.2f}`:
    21.00) for the week: `labels` and perhaps `image` (T2-weighted), or pial surfaces
    `left` and `right` (perhaps `white_left` and `white_right`), or the whole `pial` one
    (perhaps `white`)."""
    weeks: dict[AnyWeek, dict[FileKey, Checksum]]
    """The weeks, as a list, or each with the SHA-256 of its files, as `{labels: …}`; a
    file without one only has to be readable. [GW]"""

    @field_validator("weeks", mode="before")
    @classmethod
    def _weeks_without_checksums(cls, value: Any) -> Any:
        if isinstance(value, list | dict):
            _require_weeks_once(value)
        if isinstance(value, list):
            return {week: {} for week in value}
        if isinstance(value, dict):
            return {week: checksums or {} for week, checksums in value.items()}
        return value

    @field_validator("files")
    @classmethod
    def _paths_with_week(cls, files: dict[FileKey, str]) -> dict[FileKey, str]:
        allowed = []
        for needed, optional in SOURCES_OF_SERIES:
            allowed += [needed, needed | optional]
        if set(files) not in allowed:
            raise ValueError(
                "should have labels (and perhaps image), or left and right (and perhaps"
                " white_left and white_right), or pial (and perhaps white)"
            )
        for pattern in files.values():
            path = Path(pattern)
            if path.is_absolute() or ".." in path.parts or "\\" in pattern:
                raise ValueError("should be paths below the folder of the atlas")
            if not _names_weeks(pattern):
                raise ValueError(
                    "should have {week} in each path, for the gestational week"
                )
        return files

    def problems(self) -> Problems:
        if ("labels" in self.files) != (self.scheme is not None):
            yield KeyProblem(
                "is needed with labels, whose meaning it is, and with nothing else",
                ("scheme",),
            )
        if self.matched and "labels" in self.files:
            yield KeyProblem(
                "has no meaning with labels, which have no vertices", ("matched",)
            )

    @property
    def needed(self) -> list[FileKey]:
        # keys of the files that a week must have
        return [key for key in self.files if key != "image"]


class Atlas(Settings):
    """The file `atlas.yaml` of an atlas: one in the folder `atlases`, or yours."""

    name: str = Field(pattern=NAME)
    """Name, with which ids of its brains begin."""
    title: str
    """What it is."""
    licence: AtlasLicence
    """Terms of use."""
    reference: str | None = None
    """The reference to cite: authors, title, journal, year, and DOI or address."""
    url: str | None = Field(None, pattern="^https?://")
    """Address of the files' root; `null`: not online."""
    series: dict[Annotated[str, Field(pattern=NAME)], AtlasSeries] = Field(min_length=1)
    """Populations by name, each a series over the weeks."""

    def brain_id(self, series: str, week: float) -> str:
        """Return the id of a brain: `NAME-SERIES-WEEK`, or `NAME-WEEK` where the atlas
        has one series."""
        parts = [self.name]
        if len(self.series) > 1:
            parts.append(series)
        parts.append(f"{week:g}")
        return "-".join(parts)


# in a study


class AtlasSettings(Settings):
    """An atlas. Each of its weeks is a brain with the id `NAME-SERIES-WEEK`
    (`NAME-WEEK` if it has one series).

    `atlas: NAME` is short for a section; several atlases are a list. Missing files are
    fetched when a stage needs them, or by `./run snakemake --cores 1 retrieve`. An
    existing file is never replaced.
    """

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string"]})
    short_key = ("name", str)

    name: str
    """An atlas that comes with gyriflow, the name of a folder in `atlases`; or the
    `atlas.yaml` of your own."""
    series: str | tuple[str, ...] | None = None
    """Series to use; `null`: all."""
    weeks: (
        Annotated[tuple[AnyWeek, ...], AfterValidator(_require_weeks_once)] | None
    ) = None
    """Weeks to use, as in the file names; `null`: all. [GW]"""
    images: bool = False
    """Whether T2-weighted volumes are shown with the surfaces' outlines."""
    folder: str | None = None
    """Folder where files are found by name, at any depth, and missing ones are put;
    `null`: `resources/atlases/NAME` in the working directory."""
    accept_licence: bool = False
    """Whether you accept the licence, where the `atlas.yaml` asks for it."""

    @field_validator("name")
    @classmethod
    def _known_name(cls, name: str) -> str:
        shipped = shipped_atlases()
        if not _is_file(name) and name not in shipped:
            raise refused(
                f"found {name!r}; {did_you_mean(name, shipped)} An atlas of your own is"
                " an atlas.yaml"
            )
        return name

    @field_validator("folder")
    @classmethod
    def _plain_folder(cls, folder: str | None) -> str | None:
        # a missing folder is made
        hint = folder and not Path(folder).exists() and not_a_path(folder)
        if hint:
            raise refused(f"found {folder!r}; {hint}")
        return folder

    @property
    def description(self) -> Path:
        if _is_file(self.name):
            return Path(self.name)
        return ATLASES / self.name / "atlas.yaml"

    def located(self, base_dir: Path) -> "AtlasSettings":
        """Return the section with absolute paths."""
        paths = {}
        if self.folder is not None:
            paths["folder"] = str(located(base_dir, self.folder))
        if _is_file(self.name):
            paths["name"] = str(located(base_dir, self.name))
        return self.model_copy(update=paths)


def _is_file(name: str) -> bool:
    return name.endswith((".yaml", ".yml"))
