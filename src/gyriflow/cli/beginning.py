"""The first configuration of a study, from which files of a folder are brains, by their names and what they hold."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy import ndimage

from ..anatomy.labels import cerebrum_mask, require_cortex_outside
from ..config.atlas import Atlas, AtlasSettings, atlas_sections
from ..config.brains import covariates
from ..config.scans import IDS, Scan, read_scans
from ..errors import InputError
from ..io.files import files_in, read_json, write_text
from ..io.schemes import SCHEMES
from ..io.volumes import read_label_volume
from ..io.yaml_files import read_keys
from ..parameters.growth import BEFORE_GW
from ..parameters.settings import validated
from ..shipped import SHIPPED

HEAD = f"""\
# yaml-language-server: $schema={SHIPPED / "config" / "schema.json"}
# Written by `gyriflow init` from the files of this folder. Every key has a default; paths are relative to this file.
# All keys with their units: {SHIPPED / "config" / "README.md"}

brains:
"""
REST = """\

# The brain to fold: an id, a list of ids, or all.
start: {start}

folding:
  end_week: {end}   # last week of the simulation [GW]

# Runs by name, each with what differs from `folding`; `measured` lets growth follow the brains above.
runs:
  reference: {{}}{measured}
"""
QUICK = """
# Minutes on a laptop: coarse, to see that all goes well. Without these lines the mesh is fine enough to be trusted.
surface: {edge_length_mm: 1.5}
mesh: {mesher: tetgen, order: 1, surface_edge_mm: 1.5, core_edge_mm: 4}
"""
MEASURED = """
  measured: {preset: measured}"""
SHIPPED_ATLAS = "spina-bifida"
SUBJECT = "subject"
"""Id and population of the brain of a prediction."""
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
ID_COLUMNS = (*IDS, "subject_id", "subject")
SUBJECT_AND_SESSION = re.compile(r"(?<![A-Za-z0-9])(sub-[A-Za-z0-9]+)(?:[_/](?:.*[_/])?(ses-[A-Za-z0-9]+))?")
"""The entities of BIDS in a path."""
HIDDEN = ("results", "resources", "derivatives-gyriflow")
UNSET = "CHOOSE"
"""Stands where the files do not tell: `gyriflow check` then asks for it."""


@dataclass
class Found:
    """A brain that was recognised: its entry of `brains`, and what is to be said about it."""

    entry: dict[str, Any]
    notes: list[str] = field(default_factory=list)


def write_configuration(folder: Path, path: Path, force: bool, quick: bool = False) -> Iterator[str]:
    """Writes a configuration for the brains of a folder; yields what was recognised, a line a kind.

    InputError where nothing was recognised, or a configuration is there and `force` is not set.
    """
    if path.exists() and not force:
        raise InputError(
            "is there already", path=path, remedy="Choose another file with --output, or replace it: --force"
        )
    found = recognise(folder)
    write_text(path, configuration(found, folder, path) + (QUICK if quick else ""))
    kinds = ", ".join(f"{count} from {kind}" for kind, count in Counter(map(_kind, found)).items())
    yield f"{len(found)} brain{'s' if len(found) > 1 else ''}: {kinds}"
    for brain in found:
        for note in brain.notes:
            yield f"to be filled in for {brain.entry['id']}: {note}"


def write_prediction(
    path: Path,
    labels: Path,
    weeks: tuple[float, float],
    *,
    atlas: str | None,
    scheme: str | None,
    image: Path | None,
    accepted: bool,
) -> Iterator[str]:
    """Writes a configuration by which a brain is folded as an atlas grows; yields what is to be said of that.

    One that is there already and says the same is kept. `weeks` are the brain's own and that to be foretold;
    `accepted` tells whether the atlas' licence is. InputError where anything is missing.
    """
    if atlas is None:
        yield (
            f"warning: no --atlas is named, so that of {SHIPPED_ATLAS} is taken. Its brains are of spina bifida "
            "aperta, not normal ones, and end at 25 GW unoperated"
        )
    entry = {"id": SUBJECT, "week": weeks[0], "population": SUBJECT, "labels": str(labels.resolve())}
    if scheme is None:
        scheme, candidates = fitting_scheme(read_label_volume(labels).labels)
        if scheme is None:
            fitting = " or ".join(candidates) or f"none of {', '.join(SCHEMES)}"
            raise InputError("has labels of an unclear scheme", path=labels, found=fitting, remedy="Name it: --scheme")
    entry |= {"scheme": scheme} | ({"image": str(image.resolve())} if image else {})
    settings = validated(AtlasSettings, atlas_sections(atlas or SHIPPED_ATLAS)[0][1], "--atlas")
    series = _growing(Atlas(**read_keys(settings.description)), weeks, accepted)
    section = settings.model_dump(exclude_defaults=True) | series | ({"accept_licence": True} if accepted else {})
    folding = {"preset": "expected", "end_week": weeks[1]}
    text = yaml.safe_dump({"brains": [entry], "atlas": section, "start": SUBJECT, "folding": folding}, sort_keys=False)
    if not path.exists():
        write_text(path, text)
    elif path.read_text() != text:
        raise InputError("is there already and says something else", path=path, remedy="Choose another --directory.")
    yield f"{SUBJECT}: {labels} ({scheme}), {weeks[0]:g} GW; atlas {section}; written to {path}"


def write_bids(
    folder: Path, path: Path, participants: Sequence[str], sessions: Sequence[str], files: str, settings: Path | None
) -> list[str]:
    """Writes a configuration for the scans of a BIDS data set, and returns their ids.

    Of it are taken the participants and sessions with these labels, all where there are none, and those files whose
    paths match a pattern. `settings` is a configuration without brains; what it does not say is as `init` has it, and
    the first scan of each subject that has several is folded. InputError where a scan has several files, no age or no
    scheme, or nothing is found.
    """
    wanted = [{f"{kind}-{label.removeprefix(f'{kind}-')}" for label in labels}
              for kind, labels in (("sub", participants), ("ses", sessions))]  # fmt: skip
    found, problems = [], []
    for brain in recognise(folder, files):
        entities = SUBJECT_AND_SESSION.match(brain.entry["id"])
        if entities and all(
            not labels or name in labels for labels, name in zip(wanted, entities.groups(), strict=True)
        ):
            found.append(brain)
            problems += [f"{brain.entry['id']}: {note}" for note in brain.notes]
    if not found:
        asked = " ".join(sorted(wanted[0] | wanted[1])) or "files named sub-…"
        raise InputError("has no such participants and sessions", path=folder, expected=asked)
    if problems:
        remedy = "Of several files of a scan choose with --files, such as '*_desc-brain_dseg.nii.gz'."
        raise InputError("cannot be run as it is", path=folder, found="\n  ".join(["", *problems]), remedy=remedy)
    first: dict[str, dict[str, Any]] = {}
    for brain in found:
        first.setdefault(str(brain.entry.get("subject")), brain.entry)
    several = Counter(str(brain.entry.get("subject")) for brain in found)
    starts = [entry["id"] for subject, entry in first.items() if subject != "None" and several[subject] > 1]
    weeks = [brain.entry["week"] for brain in found]
    given = read_keys(settings) if settings else {}
    runs: dict[str, Any] = {"reference": {}} | ({"measured": {"preset": "measured"}} if len(set(weeks)) > 1 else {})
    text = {
        **{"brains": [_absolute(brain.entry, folder) for brain in found], "start": starts or found[0].entry["id"]},
        **{"runs": runs, **given},
        "folding": {"end_week": max(max(weeks), min(weeks) + 1)} | (given.get("folding") or {}),
        "metrics": {"white_surfaces": "all"} | (given.get("metrics") or {}),
    }
    write_text(path, yaml.safe_dump(text, sort_keys=False))
    return [brain.entry["id"] for brain in found]


def _growing(atlas: Atlas, weeks: tuple[float, float], accepted: bool) -> dict[str, Any]:
    """Returns the series and the weeks of an atlas that lead from one week to another; InputError where none does."""
    if atlas.licence.accept and not accepted:
        raise InputError(
            f"the licence of the atlas {atlas.name} is to be accepted",
            found=f"{atlas.licence.name} ({atlas.licence.url}): {atlas.licence.terms.rstrip('.')}",
            remedy="Add --accept-licence if you accept it.",
        )
    for name, series in atlas.series.items():
        known = sorted(series.weeks)
        first = max((week for week in known if week <= weeks[0]), default=known[0])
        last = min((week for week in known if week >= weeks[1]), default=None)
        if last is not None and weeks[0] < weeks[1] and first <= weeks[0] + BEFORE_GW:
            return {"series": name, "weeks": [week for week in known if first <= week <= last]}
    has = "; ".join(
        f"{name}: {min(series.weeks):g} to {max(series.weeks):g} GW" for name, series in atlas.series.items()
    )
    raise InputError(
        f"no series of the atlas {atlas.name} leads from {weeks[0]:g} to {weeks[1]:g} GW",
        found=has,
        remedy="Choose another --atlas, or another --until, after --week.",
    )


def configuration(found: list[Found], folder: Path, path: Path) -> str:
    """Returns the text of a configuration in a file `path` for brains whose files are relative to a folder."""
    lines = []
    inside = path.resolve().parent == folder.resolve()
    for brain in found:
        entry = brain.entry if inside else _absolute(brain.entry, folder)
        text = yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True).strip()
        lines.append(f"  - {text}" + "".join(f"  # {note}" for note in brain.notes))
    weeks = sorted({brain.entry["week"] for brain in found if brain.entry["week"] != UNSET})
    start = next((brain.entry["id"] for brain in found if brain.entry["week"] != UNSET), found[0].entry["id"])
    end = f"{weeks[-1] if len(weeks) > 1 else weeks[0] + 1:g}" if weeks else UNSET
    rest = REST.format(start=start, end=end, measured=MEASURED if len(weeks) > 1 else "")
    return HEAD + "\n".join(lines) + "\n" + rest


def _absolute(value: object, folder: Path) -> object:
    if isinstance(value, dict):
        return {key: _absolute(item, folder) for key, item in value.items()}
    if isinstance(value, str) and (folder / value).is_file():
        return str((folder / value).resolve())
    return value


def _kind(brain: Found) -> str:
    if "hemispheres" in brain.entry:
        return "pairs of hemisphere surfaces"
    if "hemisphere" in brain.entry:
        return "surfaces of one hemisphere"
    return f"label volumes ({brain.entry['scheme'] if brain.entry['scheme'] != UNSET else 'scheme unclear'})"


def recognise(folder: Path, pattern: str = "*") -> list[Found]:
    """Returns the brains of a folder and the folders in it, the youngest first; InputError where there are none.

    They are those of files whose paths match a pattern.
    """
    every = [path.relative_to(folder) for path in files_in(folder, *HIDDEN)]
    own = [path.parent for path in every if path.name == "dataset_description.json" and _is_own(folder / path)]
    files = [path for path in every if fnmatch(str(path), pattern) and not any(map(path.is_relative_to, own))]
    scans, said = participants(folder)
    found = [*_hemispheres(files, scans), *_volumes(folder, files, scans)]
    if not found:
        raise InputError(
            "no brain was recognised",
            path=folder,
            found=f"{len(files)} files",
            expected="tissue label volumes (.nii.gz), or pairs of surfaces with left and right in their names",
            remedy="Write the configuration by hand: config/README.md.",
        )
    _tell_apart(found)
    for brain in found:
        if brain.entry["week"] == UNSET and not any(note.startswith("week:") for note in brain.notes):
            brain.notes.insert(0, f"week: {said or 'not told by its name'}")
    return sorted(found, key=lambda brain: (brain.entry["week"] == UNSET, brain.entry["week"], brain.entry["id"]))


def _is_own(description: Path) -> bool:
    """Returns whether a BIDS data set was made by gyriflow itself."""
    described = read_json(description)
    made_by = described.get("GeneratedBy") if isinstance(described, dict) else None
    return any(isinstance(tool, dict) and tool.get("Name") == "gyriflow" for tool in made_by or ())


def participants(folder: Path) -> tuple[list[Scan], str]:
    """Returns the scans that a folder's participants.tsv and sessions.tsv are of, and why none are known."""
    said = ""
    for path in (folder / "participants.tsv", *sorted(folder.glob("*/participants.tsv"))):
        if path.is_file():
            try:
                return read_scans(path, ids=ID_COLUMNS), ""
            except InputError as error:
                said = said or str(error)
    return [], said


def week_in(text: str) -> float | None:
    """Returns the gestational age in a name such as `week21`, `GA21`, `STA30`, `t21.00`, `25w`; None without one."""
    weeks = (float(match[1] or match[2]) for match in WEEK.finditer(text))
    return next((week for week in weeks if WEEKS[0] <= week <= WEEKS[1]), None)


def fitting_scheme(labels: np.ndarray) -> tuple[str | None, list[str]]:
    """Returns the label scheme that a volume's labels fit, or None with those that cannot be told apart.

    A scheme fits where it knows all labels and what it calls cortex lies around what it calls the cerebrum; of several
    that do, the one with most cortex outside is taken if it stands out.
    """
    # the air around the head tells nothing, and is most of the volume
    for box in ndimage.find_objects((labels != 0).astype(np.int8)):
        labels = np.ascontiguousarray(labels[box])
    present = set(np.unique(labels).tolist()) - {0}
    if present == {1}:
        return "binary", []
    shares = {}
    for name, scheme in SCHEMES.items():
        if not scheme.cortex:
            continue
        try:
            cerebrum_mask(labels, scheme)
            known = len(present & set(scheme.labels)) / len(scheme.labels)
            shares[name] = require_cortex_outside(labels, scheme), known
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


def _hemispheres(files: Sequence[Path], scans: Sequence[Scan]) -> list[Found]:
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
    # pial surfaces come before white ones
    for (kind, rest), sides in sorted(pairs.items()):
        plain = OF_SURFACES[kind].sub("", rest)
        files_of = {side: str(sides[side]) for side in SIDE if side in sides}
        if kind == "pial":
            side, file = next((side, sides[side]) for side in SIDE if side in sides)
            whole = {"hemispheres": files_of} if len(sides) == 2 else {"hemisphere": {"file": str(file), "side": side}}
            brains[plain] = _found(file, scans, whole)
        elif len(sides) == 2 and plain in brains and "hemispheres" in brains[plain].entry:
            brains[plain].entry["hemispheres"]["white"] = files_of
    return list(brains.values())


def _volumes(folder: Path, files: Sequence[Path], scans: Sequence[Scan]) -> list[Found]:
    volumes = [file for file in files if file.name.lower().endswith(VOLUMES)]
    named = [file for file in volumes if LABELS.search(file.name)]
    brains = []
    for file in named or [file for file in volumes if not IMAGES.search(file.name)]:
        try:
            labels = read_label_volume(folder / file).labels
        except InputError:
            continue
        scheme, candidates = fitting_scheme(labels)
        brain = _found(file, scans, {"labels": str(file), "scheme": scheme or UNSET})
        if scheme is None:
            none = f"none of {', '.join(SCHEMES)} fits; write one under schemes"
            brain.notes.append(f"scheme: {' or '.join(candidates) or none}")
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


def _found(file: Path, scans: Sequence[Scan], source: dict[str, Any]) -> Found:
    """Returns the brain of a file: of the scan that its path names, or of the age in its name."""
    entities = SUBJECT_AND_SESSION.search(file.as_posix())
    subject = {"subject": entities[1]} if entities and entities[2] else {}
    # a participant's row holds for its sessions too, but the session's own comes first
    named = [scan for scan in scans if all(_names(file, part) for part in (scan.subject or scan.id, scan.session))]
    scan = max(named, key=lambda scan: scan.session is not None, default=None)
    if scan is None:
        # the file's own name before those of folders
        week = next((week for text in reversed(file.parts) if (week := week_in(text)) is not None), UNSET)
        return Found({"id": _id(file), "week": week} | subject | source)
    week, notes = (scan.week, []) if scan.week is not None else (UNSET, [f"week: {scan.cause}"])
    return Found({"id": _id(file), "week": week} | subject | covariates(scan) | source, notes)


def _names(file: Path, part: str | None) -> bool:
    """Returns whether a file's path names a participant or a session."""
    return part is None or bool(re.search(rf"(?<![A-Za-z0-9]){re.escape(part)}(?![A-Za-z0-9])", file.as_posix()))


def _id(file: Path) -> str:
    """Returns an id for a file's brain: its participant and session, or its name without what says pial or labels."""
    entities = SUBJECT_AND_SESSION.search(file.as_posix())
    if entities:
        return "_".join(filter(None, entities.groups()))
    name = file.name
    for pattern in (*SIDE.values(), *OF_SURFACES.values()):
        name = pattern.sub("", name)
    name = _stem(Path(name))
    if len(file.parts) > 1 and (not name.strip("._-") or not re.search(r"\d", name)):
        name = file.parts[-2]
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("._-") or "brain"


def _tell_apart(found: Sequence[Found]) -> None:
    """Gives equal ids a number; several files of one scan are no scans of several weeks."""
    counts: Counter[str] = Counter(brain.entry["id"] for brain in found)
    seen: Counter[str] = Counter()
    for brain in found:
        name = brain.entry["id"]
        seen[name] += 1
        if counts[name] > 1:
            brain.entry.pop("subject", None)
            brain.notes.append(f"{counts[name]} files are of {name}: keep one")
        if seen[name] > 1:
            brain.entry["id"] = f"{name}-{seen[name]}"
