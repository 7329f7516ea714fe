"""The content of an `atlas.yaml`: populations by week, files and their source, licence and reference."""

import re
from pathlib import Path
from string import Formatter
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from ..parameters.settings import Settings, setting
from ..parameters.terms import AffineSource, Coordinates
from ..parameters.varying import Week
from ..shipped import SHIPPED

ATLASES = SHIPPED / "atlases"
"""Folder of the atlases that come with gyriflow, each in a folder of its own."""

FileKey = Literal["labels", "image", "left", "right", "pial"]

SOURCES_OF_SERIES = ({"labels"}, {"left", "right"}, {"pial"})
"""The keys of files that give a surface, of which a series has one set; `image` goes with labels."""

WEEK_FORMAT = r"(0?[1-9]?(\.[0-9])?f?)"
"""How a week may be written in a file's name, as `05.2f`."""
NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"


def _names_weeks(pattern: str) -> bool:
    """Returns whether the fields of a pattern are weeks, as plain numbers: what fills them out cannot be a path."""
    try:
        fields = [(name, kind, flag) for _, name, kind, flag in Formatter().parse(pattern) if name is not None]
    except ValueError:
        return False
    return bool(fields) and all(
        name == "week" and flag is None and re.fullmatch(WEEK_FORMAT, kind or "") for name, kind, flag in fields
    )


class AtlasLicence(Settings):
    """Terms of use, shown before any file is fetched."""

    name: str = setting(..., "", "Name of the licence, as `CC0 1.0`.")
    terms: str = setting(..., "", "Summary in a sentence or two.")
    url: str | None = setting(None, "", "Address of the full text.")
    accept: bool = setting(
        False, "", "Whether a configuration has to say `accept_licence: true`: for terms that are narrow or unclear."
    )


class AtlasReference(Settings):
    """What to cite."""

    citation: str = setting(..., "", "Authors, title, journal and year.")
    doi: str | None = setting(None, "", "Digital object identifier.")
    url: str | None = setting(None, "", "Page of the atlas.")

    @property
    def text(self) -> str:
        """The citation with its DOI or page."""
        place = f"doi {self.doi}" if self.doi else self.url
        return f"{self.citation}, {place}" if place else self.citation


class AtlasFileRecord(Settings):
    """Size and checksum of a file."""

    bytes: int | None = setting(None, "", "Size of the file.", ge=1)
    sha256: str | None = setting(
        None,
        "",
        "SHA-256 of the file; `null`: unknown, the file is only checked to be readable.",
        pattern="^[0-9a-f]{64}$",
    )


class AtlasSeries(Settings):
    """One population by week."""

    population: str = setting(..., "", "Name of these brains in figures and tables.", min_length=1)
    scheme: str | None = setting(None, "", "Meaning of the labels, as for `brains`; required with `labels`.")
    affine_from: AffineSource = setting("auto", "", "As for `brains`, with `labels`.")
    coordinates: Coordinates = setting("auto", "", "As for `brains`, with surfaces.")
    matched: bool = setting(
        False, "",
        "Whether the surfaces have the same vertices in all weeks: believed as long as the files are not there.",
    )  # fmt: skip
    files: dict[FileKey, str] = setting(
        ..., "",
        "Path of each file below the folder and the URL, with `{week}` for the week (`{week:05.2f}`: as 21.00): "
        "`labels` and perhaps `image` (T2-weighted), or the pial surfaces `left` and `right`, or the whole `pial` one.",
    )  # fmt: skip
    weeks: dict[Week, dict[FileKey, AtlasFileRecord]] = setting(
        ..., "GW", "The weeks, as a list, or each with `{labels: {bytes: …, sha256: …}}` for its files."
    )

    @field_validator("weeks", mode="before")
    @classmethod
    def _weeks_without_records(cls, value: Any) -> Any:
        if isinstance(value, list):
            if len({str(week) for week in value}) < len(value):
                raise ValueError("name each week once")
            return {week: {} for week in value}
        if isinstance(value, dict):
            return {week: records or {} for week, records in value.items()}
        return value

    @field_validator("weeks")
    @classmethod
    def _some_weeks(cls, weeks: dict[float, Any]) -> dict[float, Any]:
        if not weeks:
            raise ValueError("have one week or more")
        return weeks

    @field_validator("files")
    @classmethod
    def _paths_with_week(cls, files: dict[FileKey, str]) -> dict[FileKey, str]:
        if set(files) - {"image"} not in SOURCES_OF_SERIES or ("image" in files and "labels" not in files):
            raise ValueError("have labels (and perhaps image), or left and right, or pial")
        for pattern in files.values():
            if Path(pattern).is_absolute() or ".." in Path(pattern).parts or "\\" in pattern:
                raise ValueError("be paths below the folder of the atlas")
            if not _names_weeks(pattern):
                raise ValueError("have {week} in each path, for the gestational week")
        return files

    @model_validator(mode="after")
    def _labels_with_scheme(self) -> "AtlasSeries":
        if "labels" in self.files and self.scheme is None:
            raise ValueError("have a `scheme`, which says what the labels mean")
        if "labels" not in self.files and self.scheme is not None:
            raise ValueError("have no `scheme` where it has no labels")
        return self

    @model_validator(mode="after")
    def _matched_with_surfaces(self) -> "AtlasSeries":
        if self.matched and "labels" in self.files:
            raise ValueError("have no `matched` with labels, which have no vertices")
        return self

    @property
    def needed(self) -> list[FileKey]:
        """The keys of the files that a week must have."""
        return [key for key in self.files if key != "image"]


class Atlas(Settings):
    """The description of an atlas, `atlas.yaml`: one of gyriflow's own in `atlases/NAME`, or yours."""

    name: str = setting(..., "", "Name, with which the ids of its brains begin.", pattern=NAME)
    title: str = setting(..., "", "What it is.")
    licence: AtlasLicence = setting(..., "", "Terms of use.")
    reference: AtlasReference | None = setting(None, "", "What to cite.")
    url: str | None = setting(
        None, "", "Address of the files' root; `null`: not available online.", pattern="^https?://"
    )
    folder: str | None = setting(None, "", "Folder with local files, relative to `atlas.yaml`; `null`: none.")
    series: dict[Annotated[str, Field(pattern=NAME)], AtlasSeries] = setting(
        ..., "", "Populations by name, each a series over the weeks.", min_length=1
    )

    def brain_id(self, series: str, week: float) -> str:
        """Returns the id of a brain: `NAME-SERIES-WEEK`, or `NAME-WEEK` where the atlas has one series."""
        return "-".join([self.name, *([series] if len(self.series) > 1 else []), f"{week:g}"])


def shipped_atlases() -> list[str]:
    """Returns the names of the atlases that come with gyriflow."""
    return sorted(path.parent.name for path in ATLASES.glob("*/atlas.yaml"))
