"""Atlases of a study: their series and weeks, their files, present or to be fetched,
and the brains of these files."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import Formatter
from typing import Any

from ..io.files import files_below
from ..io.yaml_files import read_keys
from ..settings.atlas import DOWNLOADS, Atlas, AtlasFileRecord, AtlasSettings, FileKey
from ..settings.base import KeyProblem, own_name
from ..settings.root import Config


@dataclass(frozen=True)
class AtlasFile:
    """A file of an atlas: its series, week and key, the id of its brain, its path, the
    address for its download, and its size and checksum.

    `copies` are the files of that name in the folder: none if it is missing, several if
    it is ambiguous.
    """

    series: str
    week: float
    key: FileKey
    brain: str
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
        series = self.settings.series
        return (
            list(self.atlas.series)
            if series is None
            else [series]
            if isinstance(series, str)
            else list(series)
        )

    @property
    def folder(self) -> Path:
        """Folder for downloads."""
        return Path(self.settings.folder or Path.cwd() / DOWNLOADS / self.atlas.name)

    @cached_property
    def files(self) -> list[AtlasFile]:
        """The files that the study uses, by series and week."""
        return [
            file
            for name in self.series
            if name in self.atlas.series
            for file in self._files_of(name)
        ]

    @property
    def missing(self) -> list[AtlasFile]:
        """The files that have to be downloaded."""
        return [file for file in self.files if not file.copies]

    def _files_of(self, name: str) -> Iterator[AtlasFile]:
        series = self.atlas.series[name]
        root, weeks = (self.atlas.url or "").rstrip("/"), self.settings.weeks
        for week in sorted(
            series.weeks
            if weeks is None
            else self.known_weeks(name).intersection(weeks)
        ):
            for key in series.files if self.settings.images else series.needed:
                path = series.files[key].format(
                    week=int(week) if week == int(week) else week
                )
                copies = self._in_folder[series.files[key]].get(week) or self._shipped(
                    path
                )
                # unpublished files have no address
                url = f"{root}/{path}" if root and week in series.weeks else None
                record = series.weeks.get(week, {}).get(key, AtlasFileRecord())
                place = copies[0] if copies else self.folder / path
                brain = self.atlas.brain_id(name, week)
                yield AtlasFile(
                    name, week, key, brain, place, url, record, tuple(copies)
                )

    def known_weeks(self, name: str) -> set[float]:
        """Return the weeks of a series that are published, or whose required files are
        in the folder."""
        series = self.atlas.series[name]
        present = [set(self._in_folder[series.files[key]]) for key in series.needed]
        return set(series.weeks) | set.intersection(*present)

    @cached_property
    def _in_folder(self) -> dict[str, dict[float, list[Path]]]:
        patterns = {
            pattern
            for series in self.atlas.series.values()
            for pattern in series.files.values()
        }
        files = files_below(self.folder)
        return {pattern: _copies(pattern, files) for pattern in patterns}

    def _shipped(self, path: str) -> list[Path]:
        if self.atlas.folder is None:
            return []
        place = own_name(self.settings.description.parent / self.atlas.folder / path)
        return [place] if place.is_file() else []


def _copies(pattern: str, files: Iterable[Path]) -> dict[float, list[Path]]:
    parts = pattern.split("/")
    tail = "/".join(
        parts[max(number for number, part in enumerate(parts) if "{week" in part) :]
    )
    pieces = list(Formatter().parse(tail))
    name = "".join(
        re.escape(text) + (r"(\d+(?:\.\d+)?)" if field else "")
        for text, field, *_ in pieces
    )
    copies: dict[float, list[Path]] = {}
    for path in files:
        if match := re.fullmatch(f"(?:.*/)?{name}", path.as_posix()):
            copies.setdefault(float(match[1]), []).append(path)
    return copies


def atlas_brains(used: UsedAtlas) -> list[dict[str, Any]]:
    """Return the entries of `brains` for the brains of an atlas, even if their files
    have yet to be fetched."""
    entries: dict[str, dict[str, Any]] = {}
    for file in used.files:
        series, name = (
            used.atlas.series[file.series],
            used.atlas.brain_id(file.series, file.week),
        )
        entry = entries.setdefault(
            name, {"id": name, "week": file.week, "population": series.population}
        )
        if file.key in ("left", "right"):
            entry.setdefault("hemispheres", {})[file.key] = str(file.path)
        elif file.key in ("white_left", "white_right"):
            entry.setdefault("white", ["", ""])[file.key == "white_right"] = str(
                file.path
            )
        else:
            entry[file.key] = str(file.path)
        if "labels" in series.files:
            entry |= {"scheme": series.scheme, "affine_from": series.affine_from}
        else:
            entry["coordinates"] = series.coordinates
    return list(entries.values())


def atlas_problems(used: UsedAtlas) -> Iterator[KeyProblem]:
    """Yield the problems of a section `atlas` with respect to its atlas and its
    folder."""
    atlas, settings, licence = used.atlas, used.settings, used.atlas.licence
    if unknown := [name for name in used.series if name not in atlas.series]:
        yield KeyProblem(
            f"found {', '.join(unknown)}; {atlas.name} has {', '.join(atlas.series)}",
            ("series",),
        )
        return
    if used.folder.exists() and not used.folder.is_dir():
        yield KeyProblem(f"{used.folder} is a file; expected a folder", ("folder",))
        return
    if licence.accept and not settings.accept_licence:
        name = ", ".join(filter(None, (licence.name, licence.url)))
        text = (
            f"found false; true accepts the licence of {atlas.name} ({name}):"
            f" {licence.terms}"
        )
        yield KeyProblem(text, ("accept_licence",))
    available = set.union(*map(used.known_weeks, used.series))
    if unknown_weeks := set(settings.weeks or ()) - available:
        source = (
            atlas.name
            if settings.series is None
            else f"{atlas.name} ({', '.join(used.series)})"
        )
        weeks = f"{_listed(unknown_weeks)} GW; it has {_listed(available)} GW"
        text = (
            f"{source} has no files of {weeks}. Weeks are not rounded: write one of"
            " these"
        )
        yield KeyProblem(text, ("weeks",))
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
    """Return the note that is shown before missing files of an atlas are fetched: size,
    reference and licence."""
    atlas, sizes = used.atlas, [file.record.bytes for file in used.missing]
    size = f" ({sum(size or 0 for size in sizes) / 1e6:.1f} MB)" if all(sizes) else ""
    checks = (
        ""
        if all(file.record.sha256 for file in used.missing)
        else "; no checksums are known"
    )
    count = f"{len(sizes)} file{'s' if len(sizes) > 1 else ''}"
    lines = [
        f"{atlas.name}: {count}{size} to fetch into {used.folder} where a stage needs"
        f" them{checks}"
    ]
    if atlas.reference is not None:
        place = (
            f"doi {atlas.reference.doi}" if atlas.reference.doi else atlas.reference.url
        )
        lines.append(
            "cite: " + ", ".join(filter(None, (atlas.reference.citation, place)))
        )
    address = f" ({atlas.licence.url})" if atlas.licence.url else ""
    return "\n  ".join(
        [*lines, f"licence: {atlas.licence.name}{address}. {atlas.licence.terms}"]
    )


def _listed(weeks: Iterable[float]) -> str:
    return ", ".join(f"{week:g}" for week in sorted(weeks))


def used_atlases(config: Config) -> list[UsedAtlas]:
    """Return the atlases of a configuration, with their descriptions and the files that
    exist now."""
    return [
        UsedAtlas(section, Atlas(**read_keys(section.description)))
        for section in config.atlas
    ]


def known_checksums(atlases: Iterable[UsedAtlas]) -> dict[str, tuple[str, str]]:
    """Return the atlas and the SHA-256 of each atlas file whose checksum is known, by
    the file's path."""
    return {
        str(file.path): (used.atlas.name, file.record.sha256)
        for used in atlases
        for file in used.files
        if file.record.sha256 is not None
    }
