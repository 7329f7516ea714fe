"""Atlases: what an `atlas.yaml` says, and how a study uses one: series and weeks, places of files, brains."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import Formatter
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, field_validator, model_validator

from ..io.files import files_below
from ..parameters.settings import Problem, Settings, located, nearest, refused
from ..parameters.terms import AffineSource, Coordinates
from ..parameters.varying import Week
from ..shipped import SHIPPED

ATLASES = SHIPPED / "atlases"
"""Folder of the atlases that come with gyriflow, each in a folder of its own."""
SULCI = ATLASES / "spina-bifida"
"""The folder of the brain that named sulci are drawn on: how in `sulci.yaml`, by voxel in `sulci.nii.gz`."""
DOWNLOADS = Path("resources", "atlases")
"""Folder in the working directory for the files of atlases whose section names no other."""

FileKey = Literal["labels", "image", "left", "right", "pial"]
SOURCES_OF_SERIES = ({"labels"}, {"left", "right"}, {"pial"})
"""The keys of files that give a surface, of which a series has one set; `image` goes with labels."""
WEEK_FORMAT = r"(0?[1-9]?(\.[0-9])?f?)"
"""How a week may be written in a file's name, as `05.2f`."""
NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"


def _names_weeks(pattern: str) -> bool:
    try:
        fields = [(name, kind, flag) for _, name, kind, flag in Formatter().parse(pattern) if name is not None]
    except ValueError:
        return False
    return bool(fields) and all(
        name == "week" and flag is None and re.fullmatch(WEEK_FORMAT, kind or "") for name, kind, flag in fields
    )


def _require_weeks_once(weeks: Iterable[Any]) -> None:
    listed = [str(week) for week in weeks]
    if not listed or len(set(listed)) < len(listed):
        raise ValueError("should name one week or more, each once")


class AtlasLicence(Settings):
    """Terms of use, shown before any file is fetched."""

    name: str
    """Name of the licence, as `CC0 1.0`."""
    terms: str
    """Summary in a sentence or two."""
    url: str | None = None
    """Address of the full text."""
    accept: bool = False
    """Whether users have to accept terms that are narrow or unclear."""


class AtlasReference(Settings):
    """What to cite."""

    citation: str
    """Authors, title, journal and year."""
    doi: str | None = None
    """Digital object identifier."""
    url: str | None = None
    """Page of the atlas."""


class AtlasFileRecord(Settings):
    """Size and checksum of a file."""

    bytes: int | None = Field(None, ge=1)
    """Size of the file."""
    sha256: str | None = Field(None, pattern="^[0-9a-f]{64}$")
    """SHA-256; `null`: unknown, the file only has to be readable."""


class AtlasSeries(Settings):
    """One population by week."""

    population: str = Field(min_length=1)
    """Name of these brains in figures and tables."""
    scheme: str | None = None
    """Meaning of the labels, as for `brains`; required with `labels`."""
    affine_from: AffineSource = "auto"
    """As for `brains`, with `labels`."""
    coordinates: Coordinates = "auto"
    """As for `brains`, with surfaces."""
    matched: bool = False
    """Whether surfaces of all weeks have the same vertices; believed until the files are there."""
    files: dict[FileKey, str]
    """Path of each file below the folder and the URL, with `{week}` (`{week:05.2f}`: 21.00) for the week: `labels`
    and perhaps `image` (T2-weighted), or pial surfaces `left` and `right`, or the whole `pial` one."""
    weeks: dict[Week, dict[FileKey, AtlasFileRecord]]
    """The weeks, as a list, or each with `{labels: {bytes: …, sha256: …}}` for its files. [GW]"""

    @field_validator("weeks", mode="before")
    @classmethod
    def _weeks_without_records(cls, value: Any) -> Any:
        if isinstance(value, list | dict):
            _require_weeks_once(value)
        if isinstance(value, list):
            return {week: {} for week in value}
        return {week: records or {} for week, records in value.items()} if isinstance(value, dict) else value

    @field_validator("files")
    @classmethod
    def _paths_with_week(cls, files: dict[FileKey, str]) -> dict[FileKey, str]:
        if set(files) - {"image"} not in SOURCES_OF_SERIES or ("image" in files and "labels" not in files):
            raise ValueError("should have labels (and perhaps image), or left and right, or pial")
        for pattern in files.values():
            if Path(pattern).is_absolute() or ".." in Path(pattern).parts or "\\" in pattern:
                raise ValueError("should be paths below the folder of the atlas")
            if not _names_weeks(pattern):
                raise ValueError("should have {week} in each path, for the gestational week")
        return files

    def problems(self) -> Iterator[Problem]:
        if ("labels" in self.files) != (self.scheme is not None):
            yield Problem("is needed with labels, whose meaning it is, and with nothing else", ("scheme",))
        if self.matched and "labels" in self.files:
            yield Problem("has no meaning with labels, which have no vertices", ("matched",))

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
    reference: AtlasReference | None = None
    """What to cite."""
    url: str | None = Field(None, pattern="^https?://")
    """Address of the files' root; `null`: not online."""
    folder: str | None = None
    """Folder with local files, relative to `atlas.yaml`."""
    series: dict[Annotated[str, Field(pattern=NAME)], AtlasSeries] = Field(min_length=1)
    """Populations by name, each a series over the weeks."""

    def brain_id(self, series: str, week: float) -> str:
        """Return the id of a brain: `NAME-SERIES-WEEK`, or `NAME-WEEK` where the atlas has one series."""
        return "-".join([self.name, *([series] if len(self.series) > 1 else []), f"{week:g}"])


def shipped_atlases() -> list[str]:
    """Return the names of the atlases that come with gyriflow."""
    return sorted(path.parent.name for path in ATLASES.glob("*/atlas.yaml"))


# in a study


class AtlasSettings(Settings):
    """An atlas, each week of which is a brain with the id `NAME-SERIES-WEEK` (`NAME-WEEK` if it has one series).

    `atlas: NAME` is short for a section; several atlases are a list. Missing files are fetched when a stage needs
    them, or by `./run snakemake --cores 1 retrieve`. An existing file is never replaced.
    """

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string"]})

    name: str
    """An atlas that comes with gyriflow, the name of a folder in `atlases`; or the `atlas.yaml` of your own."""
    series: str | tuple[str, ...] | None = None
    """Series to use; `null`: all."""
    weeks: tuple[Week, ...] | None = None
    """Weeks to use, as in the file names; `null`: all. [GW]"""
    images: bool = False
    """Whether T2-weighted volumes are shown with the surfaces' outlines."""
    folder: str | None = None
    """Folder where files are found by name, at any depth, and missing ones are put; `null`:
    `resources/atlases/NAME` in the working directory."""
    accept_licence: bool = False
    """Whether you accept the licence, where the `atlas.yaml` asks for it."""

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"name": value} if isinstance(value, str) else value

    @field_validator("name")
    @classmethod
    def _known_name(cls, name: str) -> str:
        if not name.endswith((".yaml", ".yml")) and name not in (shipped := shipped_atlases()):
            raise refused(f"found {name!r}; {nearest(name, shipped)} An atlas of your own is an atlas.yaml")
        return name

    @field_validator("weeks")
    @classmethod
    def _some_weeks_once(cls, weeks: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if weeks is not None:
            _require_weeks_once(weeks)
        return weeks

    @property
    def description(self) -> Path:
        return Path(self.name) if self.name.endswith((".yaml", ".yml")) else ATLASES / self.name / "atlas.yaml"

    def located(self, base_dir: Path) -> "AtlasSettings":
        """Return the section with absolute paths."""
        paths = {} if self.folder is None else {"folder": str(located(base_dir, self.folder))}
        if self.description == Path(self.name):
            paths["name"] = str(located(base_dir, self.name))
        return self.model_copy(update=paths)


@dataclass(frozen=True)
class AtlasFile:
    """A file of an atlas: its week and key, its place, its address and its record.

    `copies` are the files of that name: none if it is missing, several if it is ambiguous.
    """

    series: str
    week: float
    key: FileKey
    path: Path
    url: str | None
    record: AtlasFileRecord
    copies: tuple[Path, ...]


@dataclass(frozen=True)
class UsedAtlas:
    """An atlas with the settings by which a study uses it."""

    settings: AtlasSettings
    atlas: Atlas

    @property
    def series(self) -> list[str]:
        """The names of the series that are used."""
        given = self.settings.series
        return list(self.atlas.series) if given is None else [given] if isinstance(given, str) else list(given)

    @property
    def folder(self) -> Path:
        """Where missing files are put."""
        return Path(self.settings.folder or Path.cwd() / DOWNLOADS / self.atlas.name)

    @cached_property
    def files(self) -> list[AtlasFile]:
        """The files that the study uses, by series and week."""
        return [file for name in self.series if name in self.atlas.series for file in self._files_of(name)]

    @property
    def missing(self) -> list[AtlasFile]:
        """Those that are to be fetched."""
        return [file for file in self.files if not file.copies]

    def _files_of(self, name: str) -> Iterator[AtlasFile]:
        series = self.atlas.series[name]
        root = (self.atlas.url or "").rstrip("/")
        for week in self._weeks_of(name):
            for key in series.files if self.settings.images else series.needed:
                path = series.files[key].format(week=int(week) if week == int(week) else week)
                copies = self._in_folder[series.files[key]].get(week) or self._shipped(path)
                # what is not published has no address
                url = f"{root}/{path}" if root and week in series.weeks else None
                record = series.weeks.get(week, {}).get(key, AtlasFileRecord())
                place = copies[0] if copies else self.folder / path
                yield AtlasFile(name, week, key, place, url, record, tuple(copies))

    def _weeks_of(self, name: str) -> list[float]:
        if self.settings.weeks is None:
            return sorted(self.atlas.series[name].weeks)
        return [week for week in sorted(self.settings.weeks) if week in self.known_weeks(name)]

    def known_weeks(self, name: str) -> set[float]:
        """Return the weeks of a series that are published, or of which the folder has all that a brain needs."""
        series = self.atlas.series[name]
        present = [set(self._in_folder[series.files[key]]) for key in series.needed]
        return set(series.weeks) | set.intersection(*present)

    @cached_property
    def _in_folder(self) -> dict[str, dict[float, list[Path]]]:
        patterns = {pattern for series in self.atlas.series.values() for pattern in series.files.values()}
        return {pattern: self._copies(pattern) for pattern in patterns}

    @cached_property
    def _files_there(self) -> list[Path]:
        return files_below(self.folder)

    def _copies(self, pattern: str) -> dict[float, list[Path]]:
        parts = pattern.split("/")
        tail = "/".join(parts[max(number for number, part in enumerate(parts) if "{week" in part) :])
        pieces = list(Formatter().parse(tail))
        name = "".join(re.escape(text) + (r"(\d+(?:\.\d+)?)" if field else "") for text, field, *_ in pieces)
        copies: dict[float, list[Path]] = {}
        for path in self._files_there:
            if match := re.fullmatch(f"(?:.*/)?{name}", path.as_posix()):
                copies.setdefault(float(match[1]), []).append(path)
        return copies

    def _shipped(self, path: str) -> list[Path]:
        if self.atlas.folder is None:
            return []
        place = (self.settings.description.parent / self.atlas.folder / path).resolve()
        return [place] if place.is_file() else []


def atlas_brains(used: UsedAtlas) -> list[dict[str, Any]]:
    """Return the entries of `brains` that an atlas stands for, whether their files are there or to be fetched."""
    entries: dict[str, dict[str, Any]] = {}
    for file in used.files:
        series, name = used.atlas.series[file.series], used.atlas.brain_id(file.series, file.week)
        entry = entries.setdefault(name, {"id": name, "week": file.week, "population": series.population})
        if file.key in ("left", "right"):
            entry.setdefault("hemispheres", {})[file.key] = str(file.path)
        else:
            entry[file.key] = str(file.path)
        if "labels" in series.files:
            entry |= {"scheme": series.scheme, "affine_from": series.affine_from}
        else:
            entry["coordinates"] = series.coordinates
    return list(entries.values())


def atlas_problems(used: UsedAtlas) -> Iterator[Problem]:
    """Yield what is wrong between a section, its atlas and its folder."""
    atlas, settings, licence = used.atlas, used.settings, used.atlas.licence
    if unknown := [name for name in used.series if name not in atlas.series]:
        yield Problem(f"found {', '.join(unknown)}; {atlas.name} has {', '.join(atlas.series)}", ("series",))
        return
    if used.folder.exists() and not used.folder.is_dir():
        yield Problem(f"{used.folder} is a file; expected a folder", ("folder",))
        return
    if licence.accept and not settings.accept_licence:
        name = ", ".join(filter(None, (licence.name, licence.url)))
        text = f"found false; true accepts the licence of {atlas.name} ({name}): {licence.terms}"
        yield Problem(text, ("accept_licence",))
    available = set.union(*map(used.known_weeks, used.series))
    if unknown_weeks := set(settings.weeks or ()) - available:
        of = atlas.name if settings.series is None else f"{atlas.name} ({', '.join(used.series)})"
        text = f"{of} has no files of {_listed(unknown_weeks)}; it has {_listed(available)}. A week is never rounded"
        yield Problem(text, ("weeks",))
    for file in used.files:
        if len(file.copies) > 1:
            yield Problem(f"found {' and '.join(map(str, file.copies))}; keep one of them", ("folder",))
        elif not file.copies and file.url is None:
            yield Problem(f"{file.path} is missing, and {atlas.name} has no url for it", ("weeks",))


def retrieval_note(used: UsedAtlas) -> str:
    """Return the note that is shown before missing files of an atlas are fetched: size, reference and licence."""
    atlas, sizes = used.atlas, [file.record.bytes for file in used.missing]
    size = f" ({sum(size or 0 for size in sizes) / 1e6:.1f} MB)" if all(sizes) else ""
    checks = "" if all(file.record.sha256 for file in used.missing) else "; no checksums are known"
    count = f"{len(sizes)} file{'s' if len(sizes) > 1 else ''}"
    lines = [f"{atlas.name}: {count}{size} to fetch into {used.folder} where a stage needs them{checks}"]
    if atlas.reference is not None:
        place = f"doi {atlas.reference.doi}" if atlas.reference.doi else atlas.reference.url
        lines.append("cite: " + ", ".join(filter(None, (atlas.reference.citation, place))))
    address = f" ({atlas.licence.url})" if atlas.licence.url else ""
    return "\n  ".join([*lines, f"licence: {atlas.licence.name}{address}. {atlas.licence.terms}"])


def _listed(weeks: Iterable[float]) -> str:
    return ", ".join(f"{week:g}" for week in sorted(weeks))
