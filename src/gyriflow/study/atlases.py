"""Atlases of a study: their series and weeks, their files, present or to be fetched,
and the brains of these files."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..io.files import files_below
from ..io.yaml_files import read_keys
from ..settings.atlas import DOWNLOADS, Atlas, AtlasSettings, FileKey
from ..settings.base import KeyProblem, Problems, own_name
from ..settings.root import Config


@dataclass(frozen=True)
class AtlasFile:
    """A file of an atlas: its series, week and key, the id of its brain, its path, the
    address for its download, and its SHA-256 if known.

    `copies` are the files of that name in the folder: none if it is missing, several if
    it is ambiguous.
    """

    series: str
    week: float
    key: FileKey
    brain: str
    path: Path
    url: str | None
    sha256: str | None
    copies: tuple[Path, ...]


@dataclass(frozen=True)
class UsedAtlas:
    """An atlas with the settings by which a study uses it."""

    settings: AtlasSettings
    atlas: Atlas

    @property
    def _series(self) -> list[str]:
        """The names of the series that are used."""
        series = self.settings.series
        if series is None:
            return list(self.atlas.series)
        return [series] if isinstance(series, str) else list(series)

    @cached_property
    def folder(self) -> Path:
        """Folder for downloads, in the working directory in which it is first asked
        for."""
        return Path(self.settings.folder or Path.cwd() / DOWNLOADS / self.atlas.name)

    @cached_property
    def files(self) -> list[AtlasFile]:
        """The files that the study uses, by series and week."""
        files: list[AtlasFile] = []
        for name in self._series:
            if name in self.atlas.series:
                files += self._files_of(name)
        return files

    @property
    def missing(self) -> list[AtlasFile]:
        """The files that have to be downloaded."""
        return [file for file in self.files if not file.copies]

    def _files_of(self, name: str) -> Iterator[AtlasFile]:
        series = self.atlas.series[name]
        weeks = set(series.weeks)
        if self.settings.weeks is not None:
            weeks = self._known_weeks(name).intersection(self.settings.weeks)
        keys = series.files if self.settings.images else series.needed
        root = (self.atlas.url or "").rstrip("/")
        for week in sorted(weeks):
            brain = self.atlas.brain_id(name, week)
            checksums = series.weeks.get(week, {})
            for key in keys:
                pattern = series.files[key]
                # `{week}` has no decimals where there are none
                path = pattern.format(week=int(week) if week == int(week) else week)
                copies = self._in_folder[pattern].get(week) or self._shipped(path)
                yield AtlasFile(
                    series=name,
                    week=week,
                    key=key,
                    brain=brain,
                    path=copies[0] if copies else self.folder / path,
                    # unpublished files have no address
                    url=f"{root}/{path}" if root and week in series.weeks else None,
                    sha256=checksums.get(key),
                    copies=tuple(copies),
                )

    def _known_weeks(self, name: str) -> set[float]:
        """Return the weeks of a series that are published, or whose required files are
        in the folder."""
        series = self.atlas.series[name]
        weeks = [set(self._in_folder[series.files[key]]) for key in series.needed]
        complete = set.intersection(*weeks)
        return complete | set(series.weeks)

    @cached_property
    def _in_folder(self) -> dict[str, dict[float, list[Path]]]:
        files = files_below(self.folder)
        copies = {}
        for series in self.atlas.series.values():
            for pattern in series.files.values():
                copies[pattern] = _copies(pattern, files)
        return copies

    def _shipped(self, path: str) -> list[Path]:
        place = own_name(self.settings.description.parent / path)
        return [place] if place.is_file() else []


def _copies(pattern: str, files: Iterable[Path]) -> dict[float, list[Path]]:
    """Return files by week: those whose path ends as a pattern does, from the last part
    with the week on."""
    folder = pattern[: pattern.rindex("{week")].rpartition("/")[0]
    name = re.escape(pattern.removeprefix(f"{folder}/"))
    name = re.sub(r"\\{week.*?\\}", r"(\\d+(?:\\.\\d+)?)", name)
    copies: dict[float, list[Path]] = {}
    for path in files:
        match = re.fullmatch(
            f"(?:.*/)?{name}",
            path.as_posix(),
        )
        if match:
            copies.setdefault(
                float(match[1]),
                [],
            ).append(path)
    return copies


def atlas_brains(used: UsedAtlas) -> list[dict[str, Any]]:
    """Return the entries of `brains` for the brains of an atlas, even if their files
    have yet to be fetched."""
    entries: dict[str, dict[str, Any]] = {}
    for file in used.files:
        series = used.atlas.series[file.series]
        new = {
            "id": file.brain,
            "week": file.week,
            "population": series.population,
        }
        entry = entries.setdefault(file.brain, new)
        if file.key in ("left", "right"):
            entry.setdefault("hemispheres", {})[file.key] = str(file.path)
        elif file.key in ("white_left", "white_right"):
            sides = entry.setdefault("white", ["", ""])
            sides[file.key == "white_right"] = str(file.path)
        else:
            entry[file.key] = str(file.path)
        if "labels" in series.files:
            entry["scheme"] = series.scheme
    return list(entries.values())


def atlas_problems(used: UsedAtlas) -> Problems:
    """Yield the problems of a section `atlas` with respect to its atlas and its
    folder."""
    atlas = used.atlas
    settings = used.settings
    licence = atlas.licence
    unknown = [name for name in used._series if name not in atlas.series]
    if unknown:
        yield KeyProblem(
            f"found {', '.join(unknown)}; {atlas.name} has {', '.join(atlas.series)}",
            ("series",),
        )
        return
    if used.folder.exists() and not used.folder.is_dir():
        yield KeyProblem(f"{used.folder} is a file; expected a folder", ("folder",))
        return
    if licence.accept and not settings.accept_licence:
        yield KeyProblem(
            f"found false; true accepts the licence of {atlas.name} ({licence.name}):"
            f" {licence.terms}",
            ("accept_licence",),
        )
    available = set.union(*map(used._known_weeks, used._series))
    unknown_weeks = set(settings.weeks or ()) - available
    if unknown_weeks:
        source = atlas.name
        if settings.series is not None:
            source += f" ({', '.join(used._series)})"
        yield KeyProblem(
            f"{source} has no files of {_listed(unknown_weeks)} GW; it has"
            f" {_listed(available)} GW. Weeks are not rounded: write one of these",
            ("weeks",),
        )
    for file in used.files:
        if len(file.copies) > 1:
            yield KeyProblem(
                f"found copies {' and '.join(map(str, file.copies))}; keep one of them",
                ("folder",),
            )
        elif not file.copies and file.url is None:
            yield KeyProblem(
                f"{file.path} is missing, and {atlas.name} has no url for it",
                ("weeks",),
            )


def retrieval_note(used: UsedAtlas) -> str:
    """Return the note that is shown before missing files of an atlas are fetched, with
    its reference and licence."""
    atlas = used.atlas
    missing = used.missing
    files = "file" if len(missing) == 1 else "files"
    note = f"{atlas.name}: {len(missing)} {files}"
    note += f" to fetch into {used.folder} where a stage needs them"
    if not all(file.sha256 for file in missing):
        note += "; no checksums are known"
    if atlas.reference is not None:
        note += f"\n  cite: {atlas.reference}"
    licence = atlas.licence
    return f"{note}\n  licence: {licence.name}. {licence.terms}"


def _listed(weeks: Iterable[float]) -> str:
    return ", ".join(f"{week:g}" for week in sorted(weeks))


def used_atlases(config: Config) -> list[UsedAtlas]:
    """Return the atlases of a configuration, with their descriptions and the files that
    exist now."""
    return [
        UsedAtlas(section, Atlas(**read_keys(section.description)))
        for section in config.atlas
    ]


def atlas_by_brain(atlases: Iterable[UsedAtlas]) -> dict[str, UsedAtlas]:
    """Return the atlas of each brain that belongs to one, by the id of the brain."""
    by_brain = {}
    for used in atlases:
        for file in used.files:
            by_brain[file.brain] = used
    return by_brain


def known_checksums(atlases: Iterable[UsedAtlas]) -> dict[str, tuple[str, str]]:
    """Return the atlas and the SHA-256 of each atlas file whose checksum is known, by
    the file's path."""
    checksums = {}
    for used in atlases:
        for file in used.files:
            if file.sha256 is not None:
                checksums[str(file.path)] = (used.atlas.name, file.sha256)
    return checksums
