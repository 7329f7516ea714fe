"""Recognise the scans of a folder by file names, labels, and the tables of participants
and sessions."""

import logging
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..formats import (
    CIFTI_NAME,
    FOREIGN_TABLE,
    FOREIGN_VOLUME_SUFFIXES,
    SIDE_NAME,
    SURFACE_SUFFIXES,
    TO_NIFTI,
    TO_TABLE,
    VOLUME_SUFFIXES,
    format_of,
    is_volume,
    side_in_name,
)
from ..grouping import counted
from ..io.files import files_in, reading
from ..io.made_files import is_own_data_set
from ..io.yaml_files import SCHEMES
from ..settings.base import did_you_mean, own_name
from ..settings.terms import SIDES, Side
from ..settings.weeks import WeekNotation
from ..study.ages import (
    MAX_DIFFERENCE_WEEKS,
    ScanAge,
    require_clear_decimals,
    week_in_name,
)
from ..study.participants import TABLE_NAME, ScanTables, covariates, data_set_of
from .readings import ScanFiles, readings

log = logging.getLogger(__name__)

LABEL_NAME = re.compile(
    r"(?!.*probseg).*(label|seg|parcellation|tissue)", re.IGNORECASE
)
LAYER_NAME = re.compile(r"(?<=[._-])(?:(pial)|(white|wm))(?=[._-]|$)", re.IGNORECASE)
NO_BRAIN_NAME = re.compile(
    r"sphere|inflated|midthickness|flat|graymid|smoothwm|orig|cerebell|stem|skull|scalp|head|hull|ventric|white|wm",
    re.IGNORECASE,
)
"""Surfaces without a side that are not pial surfaces of a whole brain."""
RESAMPLED_NAME = re.compile(
    r"[._-]?(?:(?:space-\w+?_)?den-\w+?|\d+k_fs_LR)(?=[._]|$)", re.IGNORECASE
)
SPACE_NAME = re.compile(r"(?<![A-Za-z0-9])space-([A-Za-z0-9]+)")
NATIVE_SPACES = (
    "orig",
    "native",
    "individual",
    "subject",
    "anat",
    "scanner",
    "acpc",
    "t1w",
    "t2w",
)
SIDE_FOLDER = re.compile(r"lh|rh|left|right|l|r|hemi-[lr]", re.IGNORECASE)
TEMPLATE_FOLDER = re.compile(r"tpl-.*|MNINonLinear|fsaverage(?!_LR).*")
GENERIC_FOLDER = re.compile(
    r"surf|mri|anat|labels?|seg|segmentation|native|t[12]w|derivatives", re.IGNORECASE
)
"""Folders that do not name a subject."""
_SUFFIX_WORDS = sorted(
    {
        word
        for suffix in (*SURFACE_SUFFIXES, *VOLUME_SUFFIXES)
        for word in suffix[1:].split(".")
    }
)
SUFFIXES = re.compile(
    r"[._-]?(?<![A-Za-z0-9])(?:labels?|dseg|seg|parcellation|tissue|surf|native"
    rf"|{'|'.join(_SUFFIX_WORDS)})(?=[._-]|$)",
    re.IGNORECASE,
)
ENTITY = re.compile(r"(?<![A-Za-z0-9])(sub|ses)-([^_/.]+)")
FREESURFER_INPUT = re.compile(r"\.T[12]$")
"""Suffix for the image that a surface was made with: lh.pial is often a link to
lh.pial.T1."""
OF_A_TEMPLATE = "of a template, "
"""Start of the space of files in the folder of a template."""
RESAMPLED = "resampled"
"""Space of a subject's own surface on the mesh of a template."""
WHOLE_BRAIN_ML = (15.0, 700.0)
"""Smallest and largest volume of a closed surface that is accepted as a brain."""
UNSET = "CHOOSE"
"""Placeholder for values that the files do not give; `gyriflow check` then asks for
them."""


@dataclass
class FoundBrain:
    """A recognised scan: the file that names it, its entry of `brains`, and reasons why
    it cannot be used.

    `space` is "" for the subject's own. `problem` is about its files, `contradiction`
    about its age (`named_age`: as in its name); `notes` are values to fill in. It
    `is_unreadable` if files are damaged or missing. `fits` is from `scheme_fits`.
    """

    file: Path
    entry: dict[str, Any]
    space: str = ""
    problem: str = ""
    age_source: str = ""
    is_unreadable: bool = False
    contradiction: str = ""
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    fits: dict[str, str] | None = None
    named_age: str = ""

    @property
    def causes(self) -> list[str]:
        """Reasons why the scan cannot be used as it is."""
        return [
            cause
            for cause in (
                self.problem,
                self.contradiction,
                *self.notes,
            )
            if cause
        ]

    @property
    def files(self) -> str:
        """Its files, separated by commas."""
        source = self.entry.get("labels") or self.entry.get("pial")
        return str(source or ", ".join(self.entry["hemispheres"].values()))


def _is_whole_surface(brain: FoundBrain) -> bool:
    """Return whether a scan is one surface of both hemispheres."""
    return "pial" in brain.entry and "side" not in brain.entry


@dataclass
class FoundScans:
    """The scans of a folder, the youngest first, and files that are not used, with the
    reasons."""

    brains: list[FoundBrain]
    unused: dict[str, str]


def _labels(file: Path, entity: str) -> list[str]:
    return sorted(
        {label for name, label in ENTITY.findall(file.as_posix()) if name == entity}
    )


def _label(file: Path, entity: str) -> str | None:
    # a path with several labels is refused
    return next(iter(_labels(file, entity)), None)


def _scan_of(file: Path) -> str:
    """Return the id of the scan that a file is of: the `_scan_name` with only the
    characters that ids may have."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", _scan_name(file)).strip("._-") or "brain"


def _scan_name(file: Path) -> str:
    """Return the name of the scan that a file is of: `sub-` and `ses-`, or else the
    name of the file or folder."""
    subject = _label(file, "sub")
    session = _label(file, "ses")
    if subject and session:
        return f"sub-{subject}_ses-{session}"
    if subject:
        return f"sub-{subject}"
    name = file.name
    # what names the file, not the scan, from the inner to the outer part
    for part in (FREESURFER_INPUT, SIDE_NAME, LAYER_NAME, RESAMPLED_NAME, SUFFIXES):
        name = part.sub("", name)
    folders = []
    for folder in file.parts[:-1]:
        if not GENERIC_FOLDER.fullmatch(folder):
            folders.append(folder)
    if folders and not re.search(r"\d", name):
        name = folders[-1]
    return name.strip(" ._-")


def recognise(
    folder: Path,
    files: str | None = None,
    scheme: str | None = None,
    notation: WeekNotation | None = None,
    participants: Collection[str] | None = None,
    sessions: Collection[str] | None = None,
) -> FoundScans:
    """Return the scans of a folder and of those in it, from files whose paths match
    the pattern `files`, if there is one.

    Results and data sets of gyriflow itself are left out. If a `scheme` is named, all
    labels are of it. If `participants` or `sessions` are named, with or without `sub-`
    and `ses-`, files of others are not read. InputError if no scan is found, or none of
    a named participant or session.
    """
    paths = _files_of_others(folder)
    table_files = [folder / path for path in paths if TABLE_NAME.fullmatch(path.name)]
    tables = ScanTables(table_files, notation)
    candidates = [*_hemispheres(paths), *_whole_surfaces(paths)]
    candidates += _volumes(
        paths,
        [path for path in paths if (folder / path).is_dir()],
    )
    found: dict[str, list[FoundBrain]] = defaultdict(list)
    for brain in candidates:
        if fnmatch(str(brain.file), files or "*"):
            found[_scan_of(brain.file)].append(brain)
    # sessions without labels or surfaces count
    sessions_of: dict[str | None, set[str | None]] = defaultdict(set)
    for path in paths:
        sessions_of[_label(path, "sub")] |= {_label(path, "ses")} - {None}
    if not found:
        raise _no_brain(
            folder,
            {str(path): _rejection(path) for path in paths},
        )
    selected = {
        "sub": {label.removeprefix("sub-") for label in participants or ()},
        "ses": {label.removeprefix("ses-") for label in sessions or ()},
    }
    for entity, labels in selected.items():
        existing: set[str | None] = set()
        for group in found.values():
            existing |= {_label(brain.file, entity) for brain in group}
        absent = [f"{entity}-{label}" for label in sorted(labels - existing)]
        if absent:
            names = sorted(f"{entity}-{label}" for label in existing if label)
            raise InputError(
                f"has no scan of {', '.join(absent)}",
                path=folder,
                found=", ".join(names[:20]) or "none",
                remedy="Labels must be equal, with their zeros and case.",
            )
    unused = _in_other_formats(paths)
    preferred: dict[str, list[FoundBrain]] = {}
    to_read: list[FoundBrain] = []
    for name, group in found.items():
        is_selected = True
        for entity, labels in selected.items():
            if labels and _label(group[0].file, entity) not in labels:
                is_selected = False
        if is_selected:
            preferred[name] = _preferred_files(group, unused)
            for brain in preferred[name]:
                _complete(brain, folder, tables, sessions_of)
            to_read += preferred[name]
    _read_files(to_read, folder)
    brains: list[FoundBrain] = []
    for name, files_of_scan in preferred.items():
        brains += _brains_of_scan(name, found[name], files_of_scan, unused)
    # templates among subjects are not scans
    templates = [brain for brain in brains if brain.space.startswith(OF_A_TEMPLATE)]
    if len(templates) < len(brains):
        unused |= {brain.files: brain.problem for brain in templates}
        brains = [brain for brain in brains if brain not in templates]
    if not brains:
        if unused:
            raise _no_brain(folder, unused)
        raise InputError(
            "has no scan of these participants in these sessions", path=folder
        )
    tables.require_clear_decimals(folder)
    require_clear_decimals([brain.named_age for brain in brains], notation, folder)
    _refuse_equal_weeks(brains)
    _choose_schemes(
        [brain for brain in brains if brain.fits is not None],
        scheme,
    )
    brains.sort(
        key=lambda brain: (
            brain.entry["week"] == UNSET,
            brain.entry["week"],
            brain.entry["id"],
        )
    )
    return FoundScans(brains, unused)


def _files_of_others(folder: Path) -> list[Path]:
    """Return the files in a folder, relative to it, without results and data sets of
    gyriflow itself."""
    files = [path.relative_to(folder) for path in files_in(folder)]
    own = []
    for file in files:
        if file.name == "dataset_description.json" and is_own_data_set(folder / file):
            own.append(file.parent)
        elif file.parts[-2:] == ("study", "study.json"):
            own.append(file.parents[1])
    own += [results.parent / "resources" for results in own]
    return [file for file in files if not any(map(file.is_relative_to, own))]


def _no_brain(folder: Path, reasons: Mapping[str, str]) -> InputError:
    expected = (
        "tissue label volumes (.nii.gz), or surfaces with left and right or pial in"
        " their names"
    )
    lines = [counted(len(reasons), "file")]
    for file, reason in list(reasons.items())[:10]:
        lines.append(f"  {file}: {reason}")
    if len(reasons) > 10:
        lines.append("  …")
    found = "\n".join(lines) + "\n"
    return InputError(
        "no brain was recognised", path=folder, found=found, expected=expected
    )


def _in_other_formats(files: Sequence[Path]) -> dict[str, str]:
    """Return why label volumes and tables are not used whose formats are not read,
    unless they are there in another format, too."""
    reasons = {}
    read = {file.with_name(file.name.split(".")[0]) for file in files if _is_read(file)}
    for file in files:
        if file.with_name(file.name.split(".")[0]) in read:
            continue
        if FOREIGN_TABLE.fullmatch(file.name):
            reasons[str(file)] = f"tables of this format are not read. {TO_TABLE}"
        elif file.name.lower().endswith(FOREIGN_VOLUME_SUFFIXES) and LABEL_NAME.match(
            file.name
        ):
            reasons[str(file)] = f"volumes of this format are not read. {TO_NIFTI}"
    return reasons


def _is_read(file: Path) -> bool:
    return is_volume(file) or TABLE_NAME.fullmatch(file.name) is not None


def _rejection(file: Path) -> str:
    name = file.name.lower()
    if name.endswith(FOREIGN_VOLUME_SUFFIXES):
        return f"volumes of this format are not read. {TO_NIFTI}"
    if CIFTI_NAME.search(name):
        return "a CIFTI file, with values at grayordinates and no volume of labels"
    if name.endswith(VOLUME_SUFFIXES):
        return "its name has no label, seg, parcellation or tissue"
    return (
        "its name is not that of a pial surface"
        if name.endswith(SURFACE_SUFFIXES)
        else "not a volume or surface"
    )


def _brains_of_scan(
    name: str,
    group: Sequence[FoundBrain],
    preferred: Sequence[FoundBrain],
    unused: dict[str, str],
) -> list[FoundBrain]:
    """Return a brain for each file of a scan that may be used, of the `preferred` ones
    of all its `group`; of several, one must be kept. Add to the `unused`."""
    brains = []
    for brain in preferred:
        if (
            brain.is_unreadable
            and _is_whole_surface(brain)
            and not LAYER_NAME.search(brain.file.name)
        ):
            unused[brain.files] = brain.problem
        else:
            brains.append(brain)
    readable = [brain for brain in brains if not brain.is_unreadable]
    names = sorted({_scan_name(brain.file) for brain in group})
    data_sets = _data_sets(group)
    unreadable = [brain for brain in brains if brain.is_unreadable]
    for number, brain in enumerate(
        [*readable, *unreadable],
        start=1,
    ):
        brain.entry["id"] = name if number == 1 else f"{name}-{number}"
        if len(brains) > 1:
            # several files of one scan do not make a series
            brain.entry.pop("subject", None)
        if len(names) > 1:
            found = ", ".join(names)
            brain.problem = (
                f"several scans would have the id {name}; found {found}; rename them"
                " with ASCII letters"
            )
        elif len(data_sets) > 1:
            brain.problem = (
                f"several data sets have this scan; found {', '.join(data_sets)}; run"
                " each by itself"
            )
        elif len(readable) > 1 and brain in readable:
            brain.notes.append(f"{len(readable)} files are of {name}: keep one")
    return brains


def _data_sets(group: Sequence[FoundBrain]) -> list[str]:
    """Return the folders of data sets that have the same kind of data of a scan, if
    there are several.

    Labels and surfaces of one scan may be in folders of their own.
    """
    folders: dict[str, set[str]] = defaultdict(set)
    for brain in group:
        above = re.match(r"(?:(.*?)/)?sub-", brain.file.as_posix())
        above_subject = above[1] if above else None
        folder = data_set_of(Path(above_subject or ""))
        parts = [part for part in folder.parts if not GENERIC_FOLDER.fullmatch(part)]
        kind = "labels" if "labels" in brain.entry else "surfaces"
        folders[kind].add(str(Path(*parts)))
    most = max(folders.values(), key=len)
    return sorted(most)


def _preferred_files(
    group: Sequence[FoundBrain], unused: dict[str, str]
) -> list[FoundBrain]:
    """Return the files of a scan in the subject's own space, else the resampled ones,
    else all; add to the `unused`."""
    native = [brain for brain in group if not brain.space]
    resampled = [brain for brain in group if brain.space == RESAMPLED]
    preferred = native or resampled or list(group)
    # volumes of FreeSurfer subjects that have surfaces, too
    volumes = {
        brain.file.parents[1] / "mri"
        for brain in preferred
        if brain.file.parent.name == "surf"
    }
    preferred = [brain for brain in preferred if brain.file.parent not in volumes]
    for brain in group:
        if brain in preferred:
            continue
        if brain.space == RESAMPLED:
            reason = RESAMPLED
        elif brain.space:
            reason = f"in the space {brain.space}"
        else:
            reason = "a volume of a subject with surfaces"
        unused[str(brain.file)] = reason
    return preferred


def _refuse_equal_weeks(brains: Sequence[FoundBrain]) -> None:
    scans: dict[tuple[str, float], list[FoundBrain]] = defaultdict(list)
    for brain in brains:
        if "subject" in brain.entry and brain.entry["week"] != UNSET:
            scans[brain.entry["subject"], brain.entry["week"]].append(brain)
    for (_, week), group in scans.items():
        if len(group) == 1:
            continue
        names = [f"{brain.entry['id']} ({brain.age_source})" for brain in group]
        for brain in group:
            brain.contradiction = (
                f"scans of one subject have the same age, {week:g}; found"
                f" {', '.join(names)}; expected one"
            )


def _space(file: Path, *, is_surface: bool) -> str:
    """Return the space of a file, "" for the subject's own; a subject's surface on a
    template's mesh is resampled."""
    if folders := [part for part in file.parts if TEMPLATE_FOLDER.fullmatch(part)]:
        return OF_A_TEMPLATE + folders[0]
    space = SPACE_NAME.search(file.name)
    if (
        is_surface
        and RESAMPLED_NAME.search(file.name)
        and not (space and space[1].startswith("MNI"))
    ):
        return RESAMPLED
    return space[1] if space and space[1].lower() not in NATIVE_SPACES else ""


def _hemispheres(files: Sequence[Path]) -> Iterator[FoundBrain]:
    surfaces: dict[tuple[str, str], dict[Side, Path]] = {}
    further: dict[tuple[str, str], list[tuple[Side, Path]]] = defaultdict(list)
    files_of: dict[str, dict[Side, Path]] = defaultdict(dict)
    existing = set(files)
    for file in files:
        if not (match := SIDE_NAME.search(file.name)):
            continue
        side: Side = "left" if match[1] else "right"
        files_of[_scan_of(file)].setdefault(side, file)
        name = FREESURFER_INPUT.sub("", file.name)
        layer = LAYER_NAME.search(name)
        is_pial = layer[1] if layer else _may_be_brain(name)
        is_double = name != file.name and file.with_name(name) in existing
        if (
            (layer or is_pial)
            and name.lower().endswith(SURFACE_SUFFIXES)
            and not is_double
        ):
            # sides may be in other folders or in another order of parts
            folders = [
                part for part in file.parts[:-1] if not SIDE_FOLDER.fullmatch(part)
            ]
            parts = sorted(
                re.split(
                    r"[._]+",
                    LAYER_NAME.sub("", SIDE_NAME.sub("", name)),
                )
            )
            key = "/".join([*folders, *parts]), "pial" if is_pial else "white"
            if surfaces.setdefault(key, {}).setdefault(side, file) != file:
                further[key].append((side, file))
    for (rest, kind), sides in surfaces.items():
        pair = {side: str(sides[side]) for side in SIDES if side in sides}
        first = next(iter(pair))
        file, white = sides[first], surfaces.get((rest, "white"), {})
        source: dict[str, Any] = {"hemispheres": pair}
        problem = ""
        if kind == "white":
            if (rest, "pial") in surfaces:
                continue
            problem = "white surfaces alone; pial ones are needed"
        elif len(pair) == 1:
            source = {"pial": str(file), "side": first}
            for side, sign in files_of[_scan_of(file)].items():
                if side != first:
                    found = (
                        f"found {sign}; expected both sides, or no file of the"
                        f" {side} one"
                    )
                    problem = f"has no pial surface of the {side} hemisphere; {found}"
        elif len(white) == 1:
            problem = (
                f"has one white surface; found {next(iter(white.values()))}; expected"
                " both or none"
            )
        elif white:
            source["white"] = [str(white[side]) for side in SIDES]
        for key in ((rest, "pial"), (rest, "white")):
            for side, other in further[key]:
                problem = (
                    f"has two {key[1]} surfaces of the {side} hemisphere; found"
                    f" {surfaces[key][side]} and {other}"
                )
        yield FoundBrain(file, source, _space(file, is_surface=True), problem)


def _may_be_brain(name: str) -> bool:
    """Return whether a surface whose name has no layer may be a pial one."""
    # GIFTI files may have other data than pial surfaces
    return not (
        NO_BRAIN_NAME.search(name) or name.lower().endswith((".gii", ".gii.gz"))
    )


def _whole_surfaces(files: Sequence[Path]) -> Iterator[FoundBrain]:
    for file in files:
        name = file.name.lower()
        layer = LAYER_NAME.search(name)
        if (
            name.endswith(SURFACE_SUFFIXES)
            and (layer or _may_be_brain(name))
            and not SIDE_NAME.search(name)
        ):
            problem = (
                "a white surface alone; a pial one is needed"
                if layer and layer[2]
                else ""
            )
            yield FoundBrain(
                file, {"pial": str(file)}, _space(file, is_surface=True), problem
            )


def _volumes(files: Sequence[Path], unreadable: Sequence[Path]) -> Iterator[FoundBrain]:
    # of a pair, the header
    volumes = [
        file
        for file in files
        if is_volume(file) and file.name.lower().endswith(VOLUME_SUFFIXES)
    ]
    images: dict[Path, list[str]] = defaultdict(list)
    for file in volumes:
        if "_T2w." in file.name:
            images[file.parent].append(str(file))
    for file in files:
        if ENTITY.fullmatch(file.name) and file not in unreadable:
            yield FoundBrain(
                file,
                {"labels": str(file)},
                "",
                "is a link to a folder that is not there",
            )
    for file in volumes:
        if LABEL_NAME.match(file.name):
            image = (
                {"image": images[file.parent][0]}
                if len(images[file.parent]) == 1
                else {}
            )
            yield FoundBrain(
                file,
                {"labels": str(file), "scheme": UNSET} | image,
                _space(file, is_surface=False),
            )
    for folder in unreadable:
        yield FoundBrain(
            folder,
            {"labels": str(folder)},
            "",
            "is a folder that cannot be read: permission denied",
        )


def _complete(
    brain: FoundBrain,
    folder: Path,
    tables: ScanTables,
    sessions_of: Mapping[str | None, set[str | None]],
) -> None:
    """Add the age, the subject and its other values to a scan, and why it cannot be
    used."""
    subject = _label(brain.file, "sub")
    owners = _owners(brain.file, tables) if subject is None else [subject]
    facts = _facts(brain.file, owners, folder, tables, sessions_of)
    age = _age(
        facts,
        week_in_name(brain.file.parts, tables.notation),
    )
    entry: dict[str, Any] = {
        "id": _scan_of(brain.file),
        "week": UNSET,
    }
    if age.week is not None:
        entry["week"] = age.week
    elif age.cause:
        brain.contradiction = age.cause
    else:
        note = (
            "week: neither its name nor a table gives the week; put it into the name,"
            " such as week24.3, or into participants.tsv"
        )
        brain.notes.append("; ".join(filter(None, (note, tables.age_problem))))
    if owners:
        entry["subject"] = f"sub-{subject}" if subject else owners[0]
    brain.entry = entry | covariates(facts.values) | brain.entry
    brain.age_source, brain.named_age = age.source, age.named
    all_labels = []
    names = []
    for entity in ("ses", "sub"):
        labels = _labels(brain.file, entity)
        all_labels += labels
        if len(labels) > 1:
            names += [f"{entity}-{label}" for label in labels]
    if names:
        brain.problem = (
            f"its path names several scans: found {', '.join(names)}; expected one"
        )
    elif not all(re.fullmatch("[A-Za-z0-9-]+", label) for label in all_labels):
        brain.problem = (
            f"has other characters than letters and digits in {_scan_name(brain.file)}"
        )
    elif brain.space and brain.space != RESAMPLED:
        brain.problem = f"is in the space {brain.space}; expected the subject's own"
    elif brain.space:
        brain.warnings.append(
            "a surface on a template's mesh is used, since no native one was found"
        )


def _read_files(brains: Sequence[FoundBrain], folder: Path) -> None:
    """Read the files of scans, and add the schemes that fit labels, or why a scan
    cannot be read."""
    whole = []
    for brain in brains:
        if brain.problem:
            continue
        if "labels" in brain.entry or _is_whole_surface(brain):
            whole.append(brain)
            continue
        names = [*brain.files.split(", "), *brain.entry.get("white", ())]
        try:
            for name in names:
                _require_some_content(folder / name)
        except InputError as error:
            brain.problem, brain.is_unreadable = str(error), True
    scans = [ScanFiles([str((folder / brain.file).absolute())]) for brain in whole]
    for brain, found in zip(
        whole,
        readings(_fits_of_file, scans),
        strict=True,
    ):
        for text in found.warnings:
            log.warning("%s", text)
        if found.error:
            brain.problem, brain.is_unreadable = found.error, True
        elif "labels" in brain.entry:
            (brain.fits,) = found.values


def _require_some_content(path: Path) -> None:
    with reading(path, "a surface"), path.open("rb") as file:
        if not file.read(1):
            raise InputError("is empty", path=path, expected="a surface")


def _fits_of_file(files: Sequence[str]) -> Iterator[dict[str, str]]:
    """Yield what `scheme_fits` returns for a label volume; nothing for a surface.

    InputError if it cannot be read, has no label, or is not a whole brain.
    """
    (file,) = files
    if not is_volume(file):
        _require_brain(Path(file))
        return
    # imports that kept results need not wait for
    from ..io.volumes import read_label_volume

    labels = read_label_volume(file, cropped=True).labels
    if not labels.any():
        raise InputError(
            "has no label",
            path=file,
            found="0 in all voxels",
            expected="tissue labels above 0",
            remedy="The segmentation has failed, or this is another file.",
        )
    yield scheme_fits(labels)


def _require_brain(path: Path, *, whole: bool = False) -> None:
    # imports that label volumes need not wait for
    from ..anatomy.plausible import MIN_NARROWNESS, narrowness, require_one_brain
    from ..geometry.triangles import volume_ml
    from ..io.surfaces import read_surface

    mesh = read_surface(path)
    if not WHOLE_BRAIN_ML[0] < (volume := abs(volume_ml(mesh))) < WHOLE_BRAIN_ML[1]:
        expected = (
            f"the closed surface of a brain, {WHOLE_BRAIN_ML[0]:g} to"
            f" {WHOLE_BRAIN_ML[1]:g} mL"
        )
        raise InputError(
            "is not a brain",
            path=path,
            found=f"{volume:.3g} mL",
            expected=expected,
        )
    if not whole:
        return
    require_one_brain(mesh, "surface", path)
    if (shape := narrowness(mesh)) < MIN_NARROWNESS:
        problem = "seems to be one hemisphere only, and atlases have whole brains"
        found = f"a shortest extent of {shape:.2f} of the longest"
        expected = f"{MIN_NARROWNESS} or more"
        raise InputError(
            problem,
            path=path,
            found=found,
            expected=expected,
            remedy="Give LEFT and RIGHT.",
        )


def _facts(
    file: Path,
    owners: Sequence[str],
    folder: Path,
    tables: ScanTables,
    sessions_of: Mapping[str | None, set[str | None]],
) -> ScanAge:
    """Return the age and the values that tables give a file, which may be of the
    subjects `owners`."""
    if len(owners) > 1:
        cause = (
            f"several rows may be of this scan: found {', '.join(owners)}; expected one"
            " id in its path"
        )
        return ScanAge(None, cause=cause)
    subject = _label(file, "sub")
    if not owners:
        return ScanAge(None, cause=_similar_ids(_scan_of(file), tables))
    is_only_scan = subject is None or len(sessions_of[subject]) < 2
    session = _label(file, "ses")
    facts = tables.facts(
        owners[0],
        session,
        is_only_scan,
        folder / file,
    )
    if facts is None and subject is not None:
        return ScanAge(None, cause=_similar_ids(subject, tables, or_first=True))
    return facts or ScanAge(None)


def _age(facts: ScanAge, named: ScanAge) -> ScanAge:
    """Return the age that tables give, or else a name; None, with the cause, if they
    differ."""
    if facts.week is None:
        return facts if facts.cause else named
    if named.week is None or _agree(facts.week, named.week):
        return facts
    found = f"{facts.week:g} ({facts.source}) and {named.source}"
    return ScanAge(None, cause=f"found two ages, {found}; expected one")


def _agree(week: float, named: float) -> bool:
    difference = week - named
    # names may give whole weeks, completed or rounded
    is_rounded = named.is_integer() and -0.5 <= difference < 1.0
    return is_rounded or abs(difference) <= MAX_DIFFERENCE_WEEKS


def _owners(file: Path, tables: ScanTables) -> list[str]:
    """Return the subjects of tables whose ids are whole parts of a path without `sub-`:
    of the name or of a folder."""
    parts = re.split(r"[._]", file.name)
    beginnings = {_scan_of(file)}
    for number in range(1, len(parts) + 1):
        beginnings.add("_".join(parts[:number]))
    in_name = [subject for subject in tables.rows if subject in beginnings]
    if in_name:
        return [max(in_name, key=len)]
    return [subject for subject in tables.rows if subject in file.parts[:-1]]


def _similar_ids(
    subject: str,
    tables: ScanTables,
    *,
    or_first: bool = False,
) -> str:
    """Return which ids tables have instead of a subject's, or "": those that differ in
    zeros or case, otherwise, if asked, the first five."""
    found = []
    for name, rows in tables.rows.items():
        if _plain_id(name) == _plain_id(subject):
            found.append(f"{name} ({rows[-1].place})")
    if not found and or_first and tables.rows:
        found = [*list(tables.rows)[:5], "…"]
    if not found:
        return ""
    return (
        f"no table has its id; found {', '.join(found)}; expected {subject}, with the"
        " same zeros and case"
    )


def _plain_id(name: str) -> str:
    return re.sub(r"(?<!\d)0+(?=\d)", "", name.lower())


def scheme_fits(labels: np.ndarray) -> dict[str, str]:
    """Return the shipped schemes with all labels of a volume, each with a contradiction
    or ""."""
    # takes half a second, which kept results need not wait for
    from ..anatomy.labels import layout_of, require_labels, scheme_contradictions

    present = np.unique(labels)
    numbers = set(present.tolist()) - {0}
    layout = layout_of(labels)
    causes = {}
    for name, scheme in SCHEMES.items():
        if numbers and numbers <= set(scheme.labels):
            try:
                require_labels(present, scheme)
                causes[name] = next(scheme_contradictions(layout, scheme), "")
            except InputError as error:
                causes[name] = error.problem
    return causes


def require_fit(
    fits: Mapping[str, str],
    scheme: str,
    path: str | Path,
    found: str,
) -> None:
    """Raise InputError if other schemes fit the labels of a file, and this one does
    not."""
    fitting = [name for name, against in fits.items() if not against]
    if fitting and scheme not in fitting:
        problem = (
            f"has labels arranged like those of {' or '.join(fitting)}, not like those"
            f" of {scheme}"
        )
        raise InputError(problem, path=path, found=found)


def recognise_brain(
    files: Sequence[Path],
    white: Sequence[Path],
    scheme: str | None,
) -> dict[str, Any]:
    """Return the entry of one brain: from a label volume, one surface, or the left and
    the right pial surface.

    There may be as many `white` surfaces as pial ones. InputError for files of other
    kinds, numbers or sides, and for one hemisphere.
    """
    if any(map(is_volume, files)):
        if len(files) > 1 or white:
            found = " and ".join(file.name for file in (*files, *white))
            raise InputError(
                "one brain is expected",
                found=found,
                expected="one label volume, or surfaces alone",
            )
        return _recognise_labels(own_name(files[0]), scheme)
    if scheme:
        raise InputError(
            "--scheme: surfaces have no labels", found=scheme, remedy="Leave it out."
        )
    for file in (*files, *white):
        if format_of(file, "surface") is None:
            expected = (
                f"a label volume ({', '.join(VOLUME_SUFFIXES)}) or a surface"
                f" ({', '.join(SURFACE_SUFFIXES)})"
            )
            raise InputError(
                "is neither a label volume nor a surface", path=file, expected=expected
            )
    pial = _in_order(files, "pial")
    entry: dict[str, Any] = {"id": _scan_of(own_name(files[0]))}
    if len(pial) == 1:
        _require_brain(pial[0], whole=True)
        entry["pial"] = str(pial[0])
    else:
        entry["hemispheres"] = dict(
            zip(
                SIDES,
                map(str, pial),
                strict=True,
            )
        )
    if white and len(white) != len(files):
        problem = (
            f"--white: found {counted(len(white), 'surface')} for {len(files)} pial"
        )
        raise InputError(
            problem,
            expected="one for each: of the left and the right, or of the whole brain",
        )
    if white:
        whites = [str(file) for file in _in_order(white, "white")]
        entry["white"] = whites if len(whites) > 1 else whites[0]
    return entry


def _in_order(files: Sequence[Path], layer: str) -> list[Path]:
    """Return the surfaces of one layer, left before right, with resolved folders; their
    names may say which is which.

    InputError if a name says another layer, or if it is one hemisphere, both are of one
    side, or there are more.
    """
    sides = [side_in_name(file.name) for file in files]
    for file in files:
        named = LAYER_NAME.search(FREESURFER_INPUT.sub("", file.name))
        if named and bool(named[1]) != (layer == "pial"):
            problem = f"is named as a {'pial' if named[1] else 'white'} surface"
            remedy = "Give pial surfaces first, and white ones each after --white."
            raise InputError(
                problem,
                path=file,
                expected=f"a {layer} surface",
                remedy=remedy,
            )
    if len(files) == 1 and sides[0]:
        problem = f"is the {sides[0]} hemisphere only, and atlases have whole brains"
        raise InputError(
            problem,
            path=files[0],
            expected="LEFT and RIGHT, or one surface of the whole brain",
        )
    if len(files) > len(SIDES) or (None not in sides and len(set(sides)) < len(sides)):
        found = ", ".join(file.name for file in files)
        expected = "the left and the right one, or one of the whole brain"
        raise InputError(
            f"these are not the {layer} surfaces of one brain",
            found=found,
            expected=expected,
        )
    return [
        own_name(file)
        for file in (files if sides != ["right", "left"] else files[::-1])
    ]


def _recognise_labels(file: Path, scheme: str | None) -> dict[str, Any]:
    """Return the entry of a label volume: its id, file and scheme; InputError if the
    scheme is unknown or unclear."""
    if scheme not in (None, *SCHEMES):
        raise InputError(
            f"--scheme: found {scheme!r}; {did_you_mean(str(scheme), SCHEMES)}"
        )
    entry = {
        "id": _scan_of(file),
        "labels": str(file),
        "scheme": UNSET,
    }
    (fits,) = _fits_of_file([str(file)])
    if scheme:
        require_fit(fits, scheme, file, fits.get(scheme) or "labels that are not in it")
    brain = FoundBrain(file, entry, fits=fits)
    _choose_schemes([brain], scheme)
    if brain.notes:
        raise InputError(
            "has labels of an unknown scheme",
            path=file,
            found=brain.notes[0],
            remedy="Name --scheme",
        )
    return brain.entry


def _choose_schemes(brains: Sequence[FoundBrain], scheme: str | None = None) -> None:
    """Set the scheme of all brains with labels: `scheme`, otherwise the only scheme
    that fits all of them.

    If none fits all, each has its own. A note asks for the scheme if several fit or
    none does, or if the scans of one subject would have several.
    """
    each = [
        [name for name, against in (brain.fits or {}).items() if not against]
        for brain in brains
    ]
    fitting = [set(names) for names in each if names]
    common = set.intersection(*fitting) if fitting else set()
    by_subject: dict[str, set[str]] = defaultdict(set)
    for brain, names in zip(brains, each, strict=True):
        choices = [scheme] if scheme else sorted(common & set(names)) or names
        if len(choices) == 1:
            brain.entry["scheme"] = choices[0]
            if against := (brain.fits or {}).get(choices[0]):
                brain.warnings.append(f"scheme {choices[0]}: {against}")
            by_subject[brain.entry.get("subject", "")].add(choices[0])
        elif choices:
            brain.notes.append(f"scheme: {' or '.join(choices)} both fit the labels")
        else:
            note = "scheme: no shipped one fits"
            if not brain.fits:
                note += ", none has all labels"
            for name, cause in (brain.fits or {}).items():
                note += f"; not {name}: {cause}"
            brain.notes.append(note)
    for brain in brains:
        schemes = by_subject[brain.entry.get("subject", "")]
        if brain.entry.get("subject") and len(schemes) > 1:
            brain.entry["scheme"] = UNSET
            brain.notes.append(
                f"scheme: scans of {brain.entry['subject']} fit"
                f" {' and '.join(sorted(schemes))}"
            )
