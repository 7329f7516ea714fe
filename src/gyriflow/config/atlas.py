"""The dHCP fetal atlases as a source: where their files lie, here and on the server, and the brains they stand for."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import field_validator

from ..parameters.settings import Settings, setting
from ..parameters.varying import Week

PUBLISHED_WEEKS = tuple(float(week) for week in range(21, 37))
"""Gestational weeks that the atlases have; others are used where a folder has files of them."""

URL = "{server}/{repository}/raw/master/{path}"
"""Where the server has a file of a repository."""


@dataclass(frozen=True)
class Layout:
    """One atlas: its repository and, by key of a brain, the paths in it, with {} for the week in its format."""

    repository: str
    week_format: str
    paths: dict[str, str]
    needed: tuple[str, ...]


# the layout of the repositories in 2023-24 as they and programs that read them show it; files on disk go by name alone
LAYOUTS = {
    "surface": Layout(
        "kcl_cdb/dhcp_fetal_brain_surface_atlas",
        "g",
        {side: f"atlas/fetal.week{{}}.{side}.pial.surf.gii" for side in ("left", "right")},
        ("left", "right"),
    ),
    "volume": Layout(
        "kcl_cdb/fetal_brain_mri_atlas",
        "05.2f",
        {"labels": "parcellations/tissue-t{}_dhcp-19.nii.gz", "image": "structural/t2-t{}.nii.gz"},
        ("labels",),
    ),
}
"""The two atlases."""


class AtlasSettings(Settings):
    """The dHCP fetal atlases; each week of a source becomes a brain with the id `surface-week21` or `volume-week21`.

    Surfaces are the pial ones of both hemispheres, posed automatically; volumes are tissue labels of scheme `dhcp-19`,
    with the T2-weighted `image` where it is there. Files are found by their names anywhere in the folder; what is not
    there, `./run snakemake --cores 1 download` fetches.
    """

    source: Literal["surface", "volume", "both"] = setting(
        "both", "", "The atlas of hemisphere surfaces, that of label volumes, or both."
    )
    folder: str = setting(..., "", "Folder with the files, or where `download` is to put them.")
    weeks: tuple[Week, ...] = setting(
        PUBLISHED_WEEKS, "GW", "Weeks that are used; each needs files of exactly that week."
    )
    url: str = setting(
        "https://gin.g-node.org", "", "Server that has the repositories, or a mirror with the same paths."
    )

    @field_validator("weeks")
    @classmethod
    def _some_weeks(cls, weeks: tuple[float, ...]) -> tuple[float, ...]:
        if not weeks:
            raise ValueError("have one week or more")
        return weeks

    @field_validator("url")
    @classmethod
    def _web_address(cls, url: str) -> str:
        if not url.startswith(("http://", "https://")):
            raise ValueError("begin with https:// or http://")
        return url

    @property
    def sources(self) -> tuple[str, ...]:
        """The atlases that are used."""
        return tuple(LAYOUTS) if self.source == "both" else (self.source,)


@dataclass(frozen=True)
class AtlasFile:
    """A file of the atlas: what it is, where it lies or would be downloaded to, and from where."""

    source: str
    week: float
    key: str
    path: Path
    url: str
    copies: tuple[Path, ...]
    """The files of that name in the folder: none where it is missing, several where it is not clear which counts."""

    @property
    def present(self) -> bool:
        return bool(self.copies)

    @property
    def needed(self) -> bool:
        """Whether the brain can't be used without it."""
        return self.key in LAYOUTS[self.source].needed


def atlas_files(atlas: AtlasSettings) -> list[AtlasFile]:
    """Returns all files that the atlas section names, by source and week."""
    found = _in_folder(Path(atlas.folder))
    files = []
    for source in atlas.sources:
        layout = LAYOUTS[source]
        for week in sorted(set(atlas.weeks)):
            for key, template in layout.paths.items():
                path = template.format(format(week, layout.week_format))
                place = Path(atlas.folder, layout.repository.rpartition("/")[2], path)
                copies = found.get((source, key), {}).get(week, [])
                url = URL.format(server=atlas.url.rstrip("/"), repository=layout.repository, path=path)
                files.append(AtlasFile(source, week, key, copies[0] if copies else place, url, tuple(copies)))
    return files


def atlas_brains(files: list[AtlasFile]) -> list[dict[str, Any]]:
    """Returns the entries of `brains` that the atlas section stands for, whether their files are there or not."""
    entries: dict[tuple[str, float], dict[str, Any]] = {}
    for file in files:
        entry = entries.setdefault(
            (file.source, file.week), {"id": f"{file.source}-week{file.week:g}", "week": file.week}
        )
        if file.source == "surface":
            entry.setdefault("hemispheres", {})[file.key] = str(file.path)
        elif file.needed or file.present:
            entry |= {file.key: str(file.path), "scheme": "dhcp-19"}
    return list(entries.values())


def atlas_problems(atlas: AtlasSettings, files: list[AtlasFile], *, downloading: bool) -> list[str]:
    """Returns what is wrong between the atlas section and its folder.

    Parameters
    ----------
    files
        Those of `atlas_files`.
    downloading
        Whether missing files are about to be fetched; else they are problems.
    """
    folder = Path(atlas.folder)
    if folder.exists() and not folder.is_dir():
        return [f"atlas.folder: {folder} is a file; it should be a folder"]
    twice = sorted({week for week in atlas.weeks if atlas.weeks.count(week) > 1})
    problems = [f"atlas.weeks: found {_listed(twice)} more than once"] if twice else []
    problems += [
        f"atlas.folder: found {' and '.join(map(str, file.copies))}; keep one of them"
        for file in files
        if len(file.copies) > 1
    ]
    there = _in_folder(folder)
    for source in atlas.sources:
        missing = [file for file in files if file.source == source and file.needed and not file.present]
        needed = [set(there.get((source, key), {})) for key in LAYOUTS[source].needed]
        problems += _missing_problems(missing, source, folder, set.intersection(*needed), downloading)
    return problems


def _missing_problems(
    missing: list[AtlasFile], source: str, folder: Path, present: set[float], downloading: bool
) -> Iterator[str]:
    """Yields what is to be said of the missing files of one source: weeks to download, and weeks that can't be."""
    have = f"present: {_listed(sorted(present))}" if present else "none is there"
    weeks = sorted({file.week for file in missing})
    unpublished = [week for week in weeks if week not in PUBLISHED_WEEKS]
    if unpublished:
        yield (
            f"atlas.weeks: {folder} has no {source} files of {_named(unpublished)}; {have}. The published atlas has "
            f"whole weeks {PUBLISHED_WEEKS[0]:g} to {PUBLISHED_WEEKS[-1]:g}; a week is never rounded"
        )
    fetched = [week for week in weeks if week in PUBLISHED_WEEKS]
    if fetched and not downloading:
        first = next(file for file in missing if file.week in fetched)
        yield (
            f"atlas.weeks: {folder} lacks the {source} files of {_named(fetched)}, such as {first.path.name}; {have}. "
            "`./run snakemake --cores 1 download` with this configuration fetches them; or take the weeks out"
        )


def _in_folder(folder: Path) -> dict[tuple[str, str], dict[float, list[Path]]]:
    """Returns the atlas files anywhere in a folder, by source and key, then by week."""
    patterns = {
        (source, key): re.compile(re.escape(Path(path).name).replace(r"\{\}", r"(\d+(?:\.\d+)?)"))
        for source, layout in LAYOUTS.items()
        for key, path in layout.paths.items()
    }
    found: dict[tuple[str, str], dict[float, list[Path]]] = {}
    for path in sorted(folder.rglob("*.gii")) + sorted(folder.rglob("*.nii.gz")):
        for place, pattern in patterns.items():
            match = pattern.fullmatch(path.name)
            if match and path.is_file():
                found.setdefault(place, {}).setdefault(float(match[1]), []).append(path)
    return found


def _named(weeks: list[float]) -> str:
    return f"week{'s' if len(weeks) > 1 else ''} {_listed(weeks)}"


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
