"""Atlases in a study: series and weeks in use, the places of their files, and the brains that they become."""

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import Formatter
from typing import Any

from pydantic import field_validator, model_validator

from ..io.downloads import sha256_of
from ..parameters.settings import Settings, setting
from ..parameters.varying import Week
from .atlas_description import ATLASES, Atlas, AtlasFileRecord, FileKey, shipped_atlases

DOWNLOADS = Path("resources", "atlases")
"""Folder in the working directory for the files of atlases whose section names no other."""


class AtlasSettings(Settings):
    """An atlas, each week of which is a brain with the id `NAME-SERIES-WEEK` (`NAME-WEEK` where it has one series).

    `atlas: NAME` and `atlas: FILE.yaml` are short for a section with only `name` or `file`; several atlases are a list.
    Missing files are fetched when a stage needs them, or all at once by `./run snakemake --cores 1 retrieve`. An
    existing file is never replaced or deleted.
    """

    name: str | None = setting(None, "", "An atlas that comes with gyriflow: the name of a folder in `atlases`.")
    file: str | None = setting(None, "", "The `atlas.yaml` of your own atlas, instead of `name`.")
    series: str | tuple[str, ...] | None = setting(None, "", "Series to use; `null`: all.")
    weeks: tuple[Week, ...] | None = setting(
        None, "GW", "Weeks to use, exactly as in the file names; `null`: all weeks of the series."
    )
    images: bool = setting(False, "", "Whether to use T2-weighted volumes, shown with the surfaces' outlines.")
    folder: str | None = setting(
        None, "",
        "Folder with files of the atlas, found by name anywhere in it; missing files are put there. `null`: "
        "`resources/atlases/NAME` in the working directory.",
    )  # fmt: skip
    url: str | None = setting(None, "", "A mirror with the same paths, instead of the atlas's own address.")
    accept_licence: bool = setting(
        False, "", "Whether you accept the licence; required if the `atlas.yaml` says so, as for research-only data."
    )

    @model_validator(mode="after")
    def _name_or_file(self) -> "AtlasSettings":
        if (self.name is None) == (self.file is None):
            raise ValueError("have either a `name` or a `file`")
        return self

    @field_validator("weeks")
    @classmethod
    def _some_weeks_once(cls, weeks: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if weeks is not None and not weeks:
            raise ValueError("have one week or more")
        if weeks is not None and len(set(weeks)) < len(weeks):
            raise ValueError("name each week once")
        return weeks

    @field_validator("url")
    @classmethod
    def _web_address(cls, url: str | None) -> str | None:
        if url is not None and not url.startswith(("http://", "https://")):
            raise ValueError("begin with https:// or http://")
        return url

    @property
    def description(self) -> Path:
        """The `atlas.yaml`."""
        return Path(self.file) if self.file is not None else ATLASES / str(self.name) / "atlas.yaml"

    def located(self, base_dir: Path) -> "AtlasSettings":
        """Returns the section with `file` and `folder` as absolute paths."""

        def absolute(path: str | None) -> str | None:
            if path is None:
                return None
            places = [base_dir / Path(path).expanduser(), Path.cwd() / path]
            return str(next((place for place in places if place.exists()), places[0]).resolve())

        return self.model_copy(update={"file": absolute(self.file), "folder": absolute(self.folder)})


@dataclass(frozen=True)
class AtlasFile:
    """A file of an atlas: its week and key, its place, its address and its record."""

    series: str
    week: float
    key: FileKey
    path: Path
    url: str | None
    record: AtlasFileRecord
    copies: tuple[Path, ...]
    """The files of that name: none if it is missing, several if it is ambiguous."""


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
        keys = list(series.files) if self.settings.images else series.needed
        for week in self._weeks_of(name):
            for key in keys:
                path = series.files[key].format(week=int(week) if week == int(week) else week)
                root = (self.settings.url or self.atlas.url or "").rstrip("/")
                copies = self._in_folder[series.files[key]].get(week) or self._shipped(path)
                yield AtlasFile(
                    series=name,
                    week=week,
                    key=key,
                    path=copies[0] if copies else self.folder / path,
                    # what is not published has no address
                    url=f"{root}/{path}" if root and week in series.weeks else None,
                    record=series.weeks.get(week, {}).get(key, AtlasFileRecord()),
                    copies=tuple(copies),
                )

    def _weeks_of(self, name: str) -> list[float]:
        """Returns the weeks of a series that are used: published ones, and others of which the folder has files."""
        published = set(self.atlas.series[name].weeks)
        if self.settings.weeks is None:
            return sorted(published)
        known = published | self.present_weeks(name)
        return [week for week in sorted(self.settings.weeks) if week in known]

    def present_weeks(self, name: str) -> set[float]:
        """Returns the weeks of which the folder has all that a brain needs."""
        series = self.atlas.series[name]
        return set.intersection(*(set(self._in_folder[series.files[key]]) for key in series.needed))

    @cached_property
    def _in_folder(self) -> dict[str, dict[float, list[Path]]]:
        """The files of each pattern in the folder."""
        patterns = {pattern for series in self.atlas.series.values() for pattern in series.files.values()}
        return {pattern: self._copies(pattern) for pattern in patterns}

    def _copies(self, pattern: str) -> dict[float, list[Path]]:
        """Returns the files of a pattern anywhere in the folder by week; the path from the week on has to match."""
        parts = pattern.split("/")
        tail = "/".join(parts[max(number for number, part in enumerate(parts) if "{week" in part) :])
        pieces = list(Formatter().parse(tail))
        name = "".join(re.escape(text) + (r"(\d+(?:\.\d+)?)" if field else "") for text, field, *_ in pieces)
        found: dict[float, list[Path]] = {}
        for path in sorted(self.folder.rglob("".join(text + ("*" if field else "") for text, field, *_ in pieces))):
            match = re.fullmatch(f"(?:.*/)?{name}", path.as_posix())
            if match and path.is_file():
                found.setdefault(float(match[1]), []).append(path)
        return found

    def _shipped(self, path: str) -> list[Path]:
        """Returns the file that comes with the atlas, if it does."""
        if self.atlas.folder is None:
            return []
        place = (self.settings.description.parent / self.atlas.folder / path).resolve()
        return [place] if place.is_file() else []


def atlas_sections(raw: Any) -> list[tuple[tuple[str | int, ...], Any]]:
    """Returns the entries of `atlas` as given (raw) with the keys that lead to them, names and files as sections."""
    several = isinstance(raw, list | tuple)
    entries = raw if several else [] if raw is None else [raw]
    return [(("atlas", number) if several else ("atlas",), _section(entry)) for number, entry in enumerate(entries)]


def _section(entry: Any) -> Any:
    if isinstance(entry, str):
        return {"file" if entry.endswith((".yaml", ".yml")) else "name": entry}
    return entry


def unknown_atlas(settings: AtlasSettings) -> str | None:
    """Returns what is wrong with the name of an atlas, None where there is one of that name."""
    known = shipped_atlases()
    if settings.name is None or settings.name in known:
        return None
    nearest = difflib.get_close_matches(settings.name, known, n=1, cutoff=0.5)
    hint = f"did you mean {nearest[0]}?" if nearest else f"known are {', '.join(known)}"
    return f"name: found {settings.name!r}; {hint} An atlas.yaml of your own goes under file"


def atlas_brains(used: UsedAtlas) -> list[dict[str, Any]]:
    """Returns the entries of `brains` that an atlas stands for, whether their files are there or to be fetched."""
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


def atlas_problems(used: UsedAtlas) -> Iterator[str]:
    """Yields what is wrong between a section, its atlas and its folder, each with its key in front."""
    atlas, settings = used.atlas, used.settings
    unknown = [name for name in used.series if name not in atlas.series]
    if unknown:
        yield f"series: found {', '.join(unknown)}; {atlas.name} has {', '.join(atlas.series)}"
        return
    if used.folder.exists() and not used.folder.is_dir():
        yield f"folder: {used.folder} is a file; it should be a folder"
        return
    licence = atlas.licence
    if licence.accept and not settings.accept_licence:
        yield (
            f"accept_licence: found false; the licence of {atlas.name} ({licence.name}"
            + (f", {licence.url}" if licence.url else "")
            + f") is to be accepted: {licence.terms} Write `accept_licence: true` if you do"
        )
    yield from _week_problems(used)
    for file in used.files:
        if len(file.copies) > 1:
            yield f"folder: found {' and '.join(map(str, file.copies))}; keep one of them"
        elif not file.copies and file.url is None:
            yield f"weeks: {file.path} is missing and cannot be fetched, as {atlas.name} has no url for it"
        elif file.copies and file.record.sha256 not in (None, sha256_of(file.path)):
            yield (
                f"folder: {file.path} is not the file of {atlas.name}: its SHA-256 is not {file.record.sha256}. Delete "
                "it, and it is fetched; or give a changed file as a brain of your own under brains"
            )


def _week_problems(used: UsedAtlas) -> Iterator[str]:
    """Yields the weeks that none of the series has."""
    have = {week for name in used.series for week in (*used.atlas.series[name].weeks, *used.present_weeks(name))}
    lacking = [week for week in sorted(used.settings.weeks or ()) if week not in have]
    if lacking:
        weeks = f"week{'s' if len(lacking) > 1 else ''} {_listed(lacking)}"
        chosen = "" if used.settings.series is None else f" ({', '.join(used.series)})"
        yield (
            f"weeks: {used.atlas.name}{chosen} has no files of {weeks}; it has {_listed(sorted(have))}. A week is "
            "never rounded"
        )


def retrieval_note(used: UsedAtlas) -> str:
    """Returns the note that is shown before missing files of an atlas are fetched: size, reference and licence."""
    atlas, sizes = used.atlas, [file.record.bytes for file in used.missing]
    size = f" ({sum(size or 0 for size in sizes) / 1e6:.1f} MB)" if all(sizes) else ""
    checks = "" if all(file.record.sha256 for file in used.missing) else "; no checksums are known"
    count = f"{len(sizes)} file{'s' if len(sizes) > 1 else ''}"
    lines = [f"{atlas.name}: {count}{size} to fetch into {used.folder} where a stage needs them{checks}"]
    lines += [f"cite: {atlas.reference.text}"] if atlas.reference else []
    address = f" ({atlas.licence.url})" if atlas.licence.url else ""
    return "\n  ".join([*lines, f"licence: {atlas.licence.name}{address}. {atlas.licence.terms}"])


def _listed(weeks: list[float]) -> str:
    """Returns weeks as text, three or more in a row as a range: "21-29, 30.5"."""
    rows: list[list[float]] = []
    for week in weeks:
        if rows and week == rows[-1][-1] + 1:
            rows[-1].append(week)
        else:
            rows.append([week])
    return ", ".join(
        f"{row[0]:g}-{row[-1]:g}" if len(row) > 2 else ", ".join(f"{week:g}" for week in row) for row in rows
    )
