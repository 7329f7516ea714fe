"""Which files of a folder are brains, by their names and what they hold: the beginning of a configuration."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..config.participants import AGE, AGES, IDS
from ..errors import InputError
from ..io.files import read_tab_separated
from ..io.volumes import read_label_volume
from ..parameters.schemes import SCHEMES, LabelScheme
from ..surface.labels import cerebrum_mask, require_cortex_outside

VOLUMES = (".nii", ".nii.gz", ".mgz", ".mgh")
SURFACES = (".gii", ".vtk", ".stl", ".ply", ".obj")
FREESURFER = re.compile(r"^(?:lh|rh)\.(?:pial|white)$")
LABELS = re.compile(r"label|seg|parcellation|tissue|regional|aparc|bounti|drawem", re.IGNORECASE)
IMAGES = re.compile(r"t2|srr|svr|recon|template|t1|image|brain", re.IGNORECASE)
SIDE = {
    "left": re.compile(r"(?:^|[._-])(?:left|lh|hemi-l|l)(?=[._-])", re.IGNORECASE),
    "right": re.compile(r"(?:^|[._-])(?:right|rh|hemi-r|r)(?=[._-])", re.IGNORECASE),
}
OF_SURFACES = {
    "pial": re.compile(r"pial|outer", re.IGNORECASE),
    "white": re.compile(r"white|(?<=[._-])wm(?=[._-])|inner", re.IGNORECASE),
}
OTHER_SURFACES = re.compile(r"sphere|midthickness|inflated|medial|\.(?:shape|func|label)\.gii$", re.IGNORECASE)
WEEK = re.compile(
    # the short ones begin a word, as in HarvardSTA25: no week is in patient23, subject-24, image24
    r"(?:(?:week|wk|gw|gestational[_-]?age|(?-i:(?<![A-Za-z])|(?<=[a-z])(?=[A-Z]))(?:e?ga|sta|t|age))"
    r"[-_]?(\d{2}(?:\.\d+)?))(?!\d)|(?<!\d)(\d{2}(?:\.\d+)?)[-_]?(?:weeks?|wk|gw|w)(?![a-z])",
    re.IGNORECASE,
)
WEEKS = (18.0, 45.0)
"""Numbers in names that may be gestational ages."""
AGE_COLUMNS = tuple(name for name in AGES if name != AGE)
ID_COLUMNS = (*IDS, "subject_id", "subject")
HIDDEN = ("results", "resources", "derivatives-gyriflow")
UNSET = "CHOOSE"
"""Stands where the files do not tell: `gyriflow check` then asks for it."""


@dataclass
class Found:
    """A brain that was recognised: its entry of `brains`, and what is to be said about it."""

    entry: dict[str, Any]
    notes: list[str] = field(default_factory=list)


def recognise(folder: Path) -> list[Found]:
    """Returns the brains of a folder and the folders in it, the youngest first.

    Raises
    ------
    InputError
        Where no file looks like a brain.
    """
    files = [
        path.relative_to(folder)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not any(part.startswith(".") or part in HIDDEN for part in path.relative_to(folder).parts)
    ]
    ages = participants(folder)
    found = [*_hemispheres(files, ages), *_volumes(folder, files, ages)]
    if not found:
        raise InputError(
            "no brain was recognised",
            path=folder,
            found=f"{len(files)} files",
            expected="tissue label volumes (.nii.gz), or pairs of surfaces with left and right in their names",
            remedy="Write the configuration by hand: config/README.md.",
        )
    _tell_apart(found)
    return sorted(found, key=lambda brain: (_number(brain.entry["week"]), brain.entry["id"]))


def participants(folder: Path) -> dict[str, float]:
    """Returns the gestational ages of a folder's participants.tsv, by id; nothing where there is none."""
    for path in (folder / "participants.tsv", *sorted(folder.glob("*/participants.tsv"))):
        if path.is_file():
            rows = read_tab_separated(path)
            columns = {name.lower(): name for name in rows[0]}
            of_id = next((columns[name] for name in ID_COLUMNS if name in columns), None)
            of_age = next((columns[name] for name in AGE_COLUMNS if name in columns), None)
            if of_id and of_age:
                ages = pd.to_numeric([row[of_age] for row in rows], errors="coerce")
                return {row[of_id]: float(age) for row, age in zip(rows, ages, strict=True) if age == age}
    return {}


def week_in(text: str) -> float | None:
    """Returns the gestational age in a name such as `week21`, `GA21`, `STA30`, `t21.00`, `25w`; None without one."""
    for match in WEEK.finditer(text):
        week = float(match[1] or match[2])
        if WEEKS[0] <= week <= WEEKS[1]:
            return week
    return None


def fitting_scheme(labels: np.ndarray) -> tuple[str | None, list[str]]:
    """Returns the label scheme that a volume's labels fit, or None with those that cannot be told apart.

    A scheme fits where it knows all labels and what it calls cortex lies around what it calls the cerebrum; of several
    that do, the one with most cortex outside is taken if it stands out.
    """
    present = set(np.unique(labels).tolist()) - {0}
    if present == {1}:
        return "binary", []
    shares = {}
    for name, scheme in SCHEMES.items():
        if not scheme.cortex:
            continue
        try:
            cerebrum_mask(labels, scheme)
            shares[name] = require_cortex_outside(labels, scheme), _known_share(present, scheme)
        except InputError:
            continue
    ranked = sorted(shares, key=lambda name: shares[name], reverse=True)
    if not ranked:
        return None, []
    best = [name for name in ranked if shares[name][0] > shares[ranked[0]][0] - 0.02]
    # of those that read the volume alike, the one whose labels are all there
    best.sort(key=lambda name: shares[name][1], reverse=True)
    if len(best) == 1 or shares[best[0]][1] > shares[best[1]][1]:
        return best[0], ranked
    return None, best


def _known_share(present: Iterable[int], scheme: LabelScheme) -> float:
    """Returns which part of a scheme's labels a volume has."""
    return len(set(present) & set(scheme.labels)) / len(scheme.labels)


def _hemispheres(files: Sequence[Path], ages: dict[str, float]) -> list[Found]:
    """Returns the brains with pial surfaces, of both sides and then with their white ones, or of one side alone."""
    pairs: dict[tuple[str, str], dict[str, Path]] = {}
    for file in files:
        name = file.name
        if not (name.lower().endswith(SURFACES) or FREESURFER.match(name)) or OTHER_SURFACES.search(name):
            continue
        for side, pattern in SIDE.items():
            match = pattern.search(name)
            if not match:
                continue
            kind = next((kind for kind, found in OF_SURFACES.items() if found.search(name)), "pial")
            rest = str(file.parent / (name[: match.start()] + name[match.end() :]))
            pairs.setdefault((kind, rest), {})[side] = file
            break
    brains: dict[str, Found] = {}
    for (kind, rest), sides in sorted(pairs.items()):
        plain = OF_SURFACES[kind].sub("", rest)
        if set(sides) != {"left", "right"}:
            ((side, file),) = sides.items()
            if kind == "pial":
                alone = {"hemisphere": {"file": str(file), "side": side}}
                brains[plain] = Found({"id": _id(file), "week": _week(file, ages)} | alone)
            continue
        if kind == "pial":
            entry = {"id": _id(sides["left"]), "week": _week(sides["left"], ages)}
            brains[plain] = Found(entry | {"hemispheres": {side: str(sides[side]) for side in ("left", "right")}})
        elif "hemispheres" in brains.get(plain, Found({})).entry:
            brains[plain].entry["hemispheres"]["white"] = {side: str(sides[side]) for side in ("left", "right")}
    return list(brains.values())


def _volumes(folder: Path, files: Sequence[Path], ages: dict[str, float]) -> list[Found]:
    volumes = [file for file in files if file.name.lower().endswith(VOLUMES)]
    named = [file for file in volumes if LABELS.search(file.name)]
    brains = []
    for file in named or [file for file in volumes if not IMAGES.search(file.name)]:
        try:
            labels = read_label_volume(folder / file).labels
        except InputError:
            continue
        scheme, candidates = fitting_scheme(labels)
        brain = Found({"id": _id(file), "week": _week(file, ages), "labels": str(file), "scheme": scheme or UNSET})
        if scheme is None:
            listed = (
                " or ".join(candidates) if candidates else f"none of {', '.join(SCHEMES)} fits; write one under schemes"
            )
            brain.notes.append(f"scheme: {listed}")
        image = _image_of(file, [other for other in volumes if other not in named])
        if image is not None:
            brain.entry["image"] = str(image)
        brains.append(brain)
    return brains


def _image_of(labels: Path, others: Sequence[Path]) -> Path | None:
    """Returns the image beside a label volume: of the same folder and week, or the only one of the folder."""
    beside = [other for other in others if other.parent == labels.parent and IMAGES.search(other.name)]
    same = [other for other in beside if week_in(other.name) == week_in(labels.name) and _stem(other) == _stem(labels)]
    return same[0] if len(same) == 1 else beside[0] if len(beside) == 1 else None


def _stem(file: Path) -> str:
    """Returns a name without what says that it is labels or an image."""
    plain = re.sub(r"\.(nii|gz|mgz|mgh|gii|surf|vtk|stl|ply|obj)\b", "", file.name.lower())
    return re.sub(
        r"[._-]?(desc-\w+|labels?|dseg|seg|parcellation|tissue|regional|t2w?|t1w?|srr|svr|recon|dhcp-19|bounti)\b",
        "",
        plain,
    )


def _week(file: Path, ages: dict[str, float]) -> float | str:
    """Returns the age of a file's brain: of the participant that its path names, or of its name, else UNSET."""
    parts = "/".join(file.parts)
    for name, age in ages.items():
        if re.search(rf"(?<![A-Za-z0-9]){re.escape(name)}(?![A-Za-z0-9])", parts):
            return age
    # the file's own name before those of folders
    for text in reversed(file.parts):
        if (week := week_in(text)) is not None:
            return week
    return UNSET


def _id(file: Path) -> str:
    """Returns an id for a file's brain: the participant, or the name without what says left, pial or labels."""
    subject = next((part for part in file.parts[:-1] if part.startswith("sub-")), None)
    name = subject or file.name
    for pattern in (*SIDE.values(), *OF_SURFACES.values()):
        name = pattern.sub("", name)
    name = _stem(Path(name)) if subject is None else name
    if len(file.parts) > 1 and subject is None and (not name.strip("._-") or not re.search(r"\d", name)):
        name = file.parts[-2]
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("._-") or "brain"


def _tell_apart(found: Sequence[Found]) -> None:
    """Gives equal ids a number."""
    seen: dict[str, int] = {}
    for brain in found:
        name = brain.entry["id"]
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            brain.entry["id"] = f"{name}-{seen[name]}"


def _number(week: float | str) -> float:
    return float("inf") if isinstance(week, str) else week
