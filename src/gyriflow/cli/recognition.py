"""Recognise the brains of a folder by file names, labels and the table of participants."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from ..anatomy.labels import cerebrum_mask
from ..anatomy.layout import layout_of, scheme_contradictions
from ..errors import InputError
from ..formats import SURFACE_SUFFIXES, VOLUME_SUFFIXES
from ..io.files import files_in, read_json
from ..io.volumes import read_label_volume
from ..io.yaml_files import SCHEMES
from ..settings.base import did_you_mean
from ..study.participants import Scan, covariates, read_scans

LABEL_NAME = re.compile(r"label|seg|parcellation|tissue", re.IGNORECASE)
SIDE_NAME = re.compile(r"(?:(?<=[._-])|^)(?:(left|lh|hemi-L)|(right|rh|hemi-R))(?=[._-])", re.IGNORECASE)
LAYER_NAME = re.compile(r"(?<=[._-])(?:(pial)|(white|wm))(?=[._-]|$)", re.IGNORECASE)
WEEK_NAME = re.compile(r"(?<![A-Za-z])(?:week|ga)[-_]?(\d{2}(?:\.\d+)?)(?!\d)", re.IGNORECASE)
_SUFFIX_WORDS = sorted({word for suffix in (*SURFACE_SUFFIXES, *VOLUME_SUFFIXES) for word in suffix[1:].split(".")})
SUFFIXES = re.compile(
    rf"[._-]?(?<![A-Za-z0-9])(?:labels?|dseg|seg|parcellation|tissue|surf|{'|'.join(_SUFFIX_WORDS)})(?=[._-]|$)",
    re.IGNORECASE,
)
SUBJECT_AND_SESSION = re.compile(r"(?<![A-Za-z0-9])(sub-[A-Za-z0-9]+)(?:[_/](?:.*[_/])?(ses-[A-Za-z0-9]+))?")
"""The entities of BIDS in a path."""
HIDDEN = ("results", "resources", "derivatives-gyriflow")
UNSET = "CHOOSE"
"""Placeholder for values that the files do not give; `gyriflow check` then asks for them."""


@dataclass
class FoundBrain:
    """A recognised brain: its entry of `brains`, and notes about values to fill in."""

    entry: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    fits: dict[str, str] | None = None
    """Of labels what `scheme_fits` returns."""


def recognise(folder: Path, pattern: str = "*", scheme: str | None = None) -> list[FoundBrain]:
    """Return the brains of a folder and those in it, the youngest first, from files whose paths match a pattern.

    Data sets that gyriflow itself has made are left out. All labels are of the `scheme`, where one is named.
    InputError where there are none.
    """
    files = [path.relative_to(folder) for path in files_in(folder, *HIDDEN)]
    exports = [file.parent for file in files if file.name == "dataset_description.json" and _is_own(folder / file)]
    files = [file for file in files if fnmatch(str(file), pattern) and not any(map(file.is_relative_to, exports))]
    scans, no_ages = [], "its name does not give the week"
    try:
        scans = read_scans(folder / "participants.tsv")
    except InputError as error:
        if (folder / "participants.tsv").is_file():
            no_ages = str(error)
    brains = [*_hemispheres(files, scans), *_volumes(folder, files, scans)]
    if not brains:
        expected = "tissue label volumes (.nii.gz), or pairs of surfaces with left and right in their names"
        raise InputError("no brain was recognised", path=folder, found=f"{len(files)} files", expected=expected)
    seen: Counter[str] = Counter()
    counts = Counter(brain.entry["id"] for brain in brains)
    for brain in brains:
        name = brain.entry["id"]
        seen[name] += 1
        if brain.entry["week"] == UNSET and not brain.notes:
            brain.notes.append(f"week: {no_ages}")
        # several files of one scan do not make a series
        if counts[name] > 1:
            brain.entry.pop("subject", None)
            brain.notes.append(f"{counts[name]} files are of {name}: keep one")
        if seen[name] > 1:
            brain.entry["id"] = f"{name}-{seen[name]}"
    choose_schemes([brain for brain in brains if brain.fits is not None], scheme)
    return sorted(brains, key=lambda brain: (brain.entry["week"] == UNSET, brain.entry["week"], brain.entry["id"]))


def scheme_fits(labels: np.ndarray) -> dict[str, str]:
    """Return the shipped schemes with all labels of a volume, each with a contradiction or ""."""
    numbers = set(np.unique(labels).tolist()) - {0}
    layout, causes = layout_of(labels), {}
    for name, scheme in SCHEMES.items():
        if numbers and numbers <= set(scheme.labels):
            try:
                cerebrum_mask(labels, scheme)
                causes[name] = next(scheme_contradictions(layout, scheme), "")
            except InputError as error:
                causes[name] = str(error).partition(";")[0]
    return causes


def recognise_labels(file: Path, scheme: str | None) -> dict[str, Any]:
    """Return the entry of one label volume: its id, file and scheme; InputError where that is unknown or not one."""
    if scheme not in (None, *SCHEMES):
        raise InputError(f"--scheme: found {scheme!r}; {did_you_mean(str(scheme), SCHEMES)}")
    entry, fits = {"id": _id(file), "labels": str(file), "scheme": UNSET}, scheme_fits(read_label_volume(file).labels)
    fitting = [name for name, against in fits.items() if not against]
    if scheme and fitting and scheme not in fitting:
        problem = f"has labels arranged like those of {' or '.join(fitting)}, not like those of {scheme}"
        raise InputError(problem, path=file, found=fits.get(scheme) or "labels that are not in it")
    brain = FoundBrain(entry, fits=fits)
    choose_schemes([brain], scheme)
    if brain.notes:
        raise InputError("has labels of an unknown scheme", path=file, found=brain.notes[0], remedy="Name --scheme")
    return brain.entry


def choose_schemes(brains: Sequence[FoundBrain], scheme: str | None = None) -> None:
    """Set the scheme of all brains with labels: `scheme`, otherwise the only scheme that fits all of them.

    Where none fits all, each has its own. A note asks where several fit or none does, and where the scans of one
    subject would have several.
    """
    each = [[name for name, against in (brain.fits or {}).items() if not against] for brain in brains]
    fitting = [set(names) for names in each if names]
    common = set.intersection(*fitting) if fitting else set()
    by_subject: dict[str, set[str]] = defaultdict(set)
    for brain, names in zip(brains, each, strict=True):
        choices = [scheme] if scheme else sorted(common & set(names)) or names
        if len(choices) == 1:
            brain.entry["scheme"] = choices[0]
            by_subject[brain.entry.get("subject", "")].add(choices[0])
        elif choices:
            brain.notes.append(f"scheme: {' or '.join(choices)} both fit the labels")
        else:
            against = [f"; not {name}: {cause}" for name, cause in (brain.fits or {}).items()]
            brain.notes.append(f"scheme: no shipped one fits{''.join(against) or ', none has all labels'}")
    for brain in brains:
        schemes = by_subject[brain.entry.get("subject", "")]
        if brain.entry.get("subject") and len(schemes) > 1:
            brain.entry["scheme"] = UNSET
            brain.notes.append(f"scheme: scans of {brain.entry['subject']} fit {' and '.join(sorted(schemes))}")


def scheme_reasons(brains: Sequence[FoundBrain]) -> Iterator[str]:
    """Yield for each chosen scheme how many volumes have it, then what speaks against it and against each other one."""
    for name, number in Counter(brain.entry.get("scheme", UNSET) for brain in brains).items():
        if name != UNSET:
            fits = [brain.fits or {} for brain in brains if brain.entry.get("scheme") == name]
            causes = {fitted: cause for schemes in fits for fitted, cause in schemes.items() if cause}
            yield f"scheme {name}: {number} label volume{'s' if number > 1 else ''}"
            yield from (f"  {'but' if fitted == name else f'not {fitted}:'} {causes[fitted]}" for fitted in causes)


def _is_own(description: Path) -> bool:
    described = read_json(description)
    tools = described.get("GeneratedBy") if isinstance(described, dict) else None
    return any(isinstance(tool, dict) and tool.get("Name") == "gyriflow" for tool in tools or ())


def _hemispheres(files: Sequence[Path], scans: Sequence[Scan]) -> Iterator[FoundBrain]:
    surfaces: dict[tuple[str, str], dict[str, Path]] = {}
    for file in files:
        kind, side = LAYER_NAME.search(file.name), SIDE_NAME.search(file.name)
        if kind and side and file.name.lower().endswith(SURFACE_SUFFIXES):
            rest = str(file.parent / LAYER_NAME.sub("", SIDE_NAME.sub("", file.name)))
            sides = surfaces.setdefault((rest, "pial" if kind[1] else "white"), {})
            sides["left" if side[1] else "right"] = file
    for (rest, layer), sides in surfaces.items():
        if layer == "white":
            continue
        pair: dict[str, Any] = {name: str(sides[name]) for name in ("left", "right") if name in sides}
        first, file = next(iter(pair.items()))
        white = surfaces.get((rest, "white"), {})
        source: dict[str, Any] = {"hemispheres": pair}
        if len(pair) == 1:
            source = {"hemisphere": {"file": file, "side": first}}
        elif len(white) == 2:
            source["white"] = [str(white["left"]), str(white["right"])]
        yield _found_brain(Path(file), scans, source)


def _volumes(folder: Path, files: Sequence[Path], scans: Sequence[Scan]) -> Iterator[FoundBrain]:
    volumes = [file for file in files if file.name.lower().endswith(VOLUME_SUFFIXES)]
    for file in volumes:
        if LABEL_NAME.search(file.name):
            try:
                labels = read_label_volume(folder / file).labels
            except InputError:
                continue
            images = [str(path) for path in volumes if path.parent == file.parent and "_T2w." in path.name]
            image = {"image": images[0]} if len(images) == 1 else {}
            brain = _found_brain(file, scans, {"labels": str(file), "scheme": UNSET} | image)
            brain.fits = scheme_fits(labels)
            yield brain


def _found_brain(file: Path, scans: Sequence[Scan], source: dict[str, Any]) -> FoundBrain:
    entities = SUBJECT_AND_SESSION.search(file.as_posix())
    named = [scan for scan in scans if _names(file, scan.subject) and _names(file, scan.session)]
    # a participant's row holds for its sessions too, but the session's own comes first
    scan = max(named, key=lambda scan: scan.session is not None, default=None)
    weeks = [match[1] for part in reversed(file.parts) if (match := WEEK_NAME.search(part))]
    week = float(weeks[0]) if weeks and scan is None else UNSET
    if scan is not None and scan.week is not None:
        week = scan.week
    subject = entities[1] if entities else scan.subject if scan else None
    entry = {"id": _id(file), "week": week} | ({"subject": subject} if subject else {})
    further = covariates(scan) if scan else {}
    return FoundBrain(entry | further | source, [f"week: {scan.cause}"] if scan and scan.cause else [])


def _names(file: Path, part: str | None) -> bool:
    return part is None or bool(re.search(rf"(?<![A-Za-z0-9]){re.escape(part)}(?![A-Za-z0-9])", file.as_posix()))


def _id(file: Path) -> str:
    if entities := SUBJECT_AND_SESSION.search(file.as_posix()):
        return "_".join(filter(None, entities.groups()))
    name = SUFFIXES.sub("", LAYER_NAME.sub("", SIDE_NAME.sub("", file.name)))
    if len(file.parts) > 1 and not re.search(r"\d", name):
        name = file.parts[-2]
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("._-") or "brain"
