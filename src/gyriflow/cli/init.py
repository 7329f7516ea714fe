"""Write the first configuration of a study: from a folder's brains, for one prediction, or for a BIDS data set."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from ..errors import InputError
from ..io.files import read_json, write_json, write_text
from ..io.yaml_files import read_keys
from ..settings.atlas import Atlas, AtlasSettings
from ..settings.base import validated
from ..settings.brains import BrainConfig
from ..settings.growth import BEFORE_GW
from ..shipped import SHIPPED
from ..study.loading import OF_FOLDING, load
from ..study.series import unmatched_reason
from .recognition import SUBJECT_AND_SESSION, UNSET, Recognised, recognise, recognise_labels, scheme_reasons

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
MEASURED_RUN = """
  measured: {preset: measured}"""
SHIPPED_ATLAS = "spina-bifida"
QUICK: dict[str, Any] = {
    "surface": {"edge_length_mm": 1.2},
    "mesh": {"order": 1, "mesher": "tetgen", "surface_edge_mm": 0.67, "max_surface_distance_mm": 0.5},
    "folding": {"step_s": 86400, "thickness_mm": 2.5},
}
"""What a quick prediction differs in: a mesh as the demo's, and a cortex that it resolves."""


def write_configuration(
    folder: Path, path: Path, force: bool, fold: bool = True, scheme: str | None = None
) -> Iterator[str]:
    """Write a configuration for the brains of a folder; yield what was recognised, a line a kind.

    With `fold`, one of them is folded.

    InputError where nothing was recognised, or a configuration is there and `force` is not set.
    """
    if path.exists() and not force:
        raise InputError("is there already", path=path, remedy="Choose another file with --output, or add --force.")
    brains = recognise(folder, scheme=scheme)
    inside = path.resolve().parent == folder.resolve()
    lines = []
    for brain in brains:
        entry = brain.entry if inside else _absolute(brain.entry, folder)
        text = yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True).strip()
        lines.append(f"  - {text}" + "".join(f"  # {note}" for note in brain.notes) + "\n")
    # brains of unknown weeks come last; one that is followed by others of its subject, or its atlas, comes first
    of_subjects = _of_subjects(brains).values()
    series = next((ids for ids in of_subjects if len(_weeks(ids)) > 1), brains)
    weeks, several = _weeks(series), series is not brains
    end = f"{weeks[-1] if several else weeks[0] + 1:g}" if weeks else UNSET
    measured = MEASURED_RUN if fold and several and _leads(series, folder) else ""
    rest = REST.format(start=series[0].entry["id"], end=end, measured=measured)
    write_text(path, HEAD + "".join(lines) + (rest if fold else ""))
    for brain in brains:
        kind = f"labels, {brain.entry['scheme']}" if "labels" in brain.entry else "surfaces"
        yield f"{brain.entry['id']}: {kind}, week {brain.entry['week']}"
        yield from (f"  to be filled in: {note}" for note in brain.notes)
    yield from scheme_reasons(brains)


def write_prediction(
    path: Path,
    there: Path,
    labels: Path,
    weeks: tuple[float, float],
    *,
    atlas: str | None,
    folder: Path | None,
    scheme: str | None,
    image: Path | None,
    accepted: bool,
    quick: bool,
    force: bool,
) -> Iterator[str]:
    """Write a configuration by which a brain is folded as an atlas grows; yield what is to be said of that.

    `weeks` are the brain's own and that to be predicted; `folder` is that of the atlas' files, and `accepted` tells
    whether its licence is. Paths are relative to the working directory of this process. InputError where anything is
    missing, or where a configuration is `there` that says something else and `force` is not set.
    """
    if atlas is None:
        yield (
            f"warning: no --atlas is named, so that of {SHIPPED_ATLAS} is taken. Its brains are of spina bifida "
            "aperta, not normal ones, and end at 25 GW unoperated"
        )
    entry = recognise_labels(labels.resolve(), scheme)
    entry = {"id": entry["id"], "week": weeks[0], "population": entry["id"]} | entry
    entry |= {"image": str(image.resolve())} if image else {}
    given = {"name": atlas or SHIPPED_ATLAS, "folder": folder and str(folder), "accept_licence": accepted}
    settings = validated(AtlasSettings, given, "--atlas").located(Path.cwd())
    series = _growing(Atlas(**read_keys(settings.description)), weeks, accepted)
    section = settings.model_dump(exclude_defaults=True) | series
    more = QUICK if quick else {"folding": {}}
    folding = {"preset": "expected", "end_week": weeks[1]} | more["folding"]
    config = {"brains": [entry], "atlas": section, "start": entry["id"], **more, "folding": folding}
    config["runs"] = {"predicted": {}}
    load(config)
    text = yaml.safe_dump(config, sort_keys=False)
    if there.exists() and there.read_text() != text and not force:
        remedy = "Choose another --directory, or add --force."
        raise InputError("is there already and says something else", path=there, remedy=remedy)
    write_text(path, text)
    span = f"{weeks[0]:g} to {weeks[1]:g} GW by {settings.name}, {series['series']}"
    yield f"{entry['id']}: {labels} ({entry['scheme']}), {span}; configuration: {there}"


def remembered(path: Path, options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of a call for all of a BIDS data set: those that it has not are of earlier calls in a file."""
    earlier = read_json(path) if path.is_file() else {}
    return {key: value if value not in (None, ()) else earlier.get(key) for key, value in options.items()}


def remember(path: Path, options: dict[str, Any]) -> None:
    """Write the options of a call for some of a BIDS data set, whose participants and sessions join earlier ones."""
    earlier = read_json(path) if path.is_file() else options
    kept = dict(options)
    for key in ("participants", "sessions"):
        # none stands for all
        several = bool(options[key] and earlier[key])
        kept[key] = list(dict.fromkeys([*earlier[key], *options[key]])) if several else []
    write_json(path, kept)


def write_bids(
    folder: Path,
    path: Path,
    *,
    participants: Sequence[str] | None = None,
    sessions: Sequence[str] | None = None,
    files: str | None = None,
    settings: str | None = None,
    fold: bool | None = None,
    scheme: str | None = None,
) -> tuple[list[str], list[str]]:
    """Write a configuration for the scans of a BIDS data set, and return their ids and why labels have their schemes.

    Of it are taken the participants and sessions with these labels, all where there are none, and those files whose
    paths match a pattern. `settings` is a configuration without brains; what it does not say is as `init` has it. They
    are measured; with `fold` the first scan of each subject that has several is folded, too. InputError where a scan
    has several files, no age or no scheme, or nothing is found.
    """
    subjects = {f"sub-{label.removeprefix('sub-')}" for label in participants or ()}
    own_sessions = {f"ses-{label.removeprefix('ses-')}" for label in sessions or ()}
    brains = []
    for brain in recognise(folder, files or "*", scheme):
        entities = SUBJECT_AND_SESSION.match(brain.entry["id"])
        if entities and (not subjects or entities[1] in subjects) and (not own_sessions or entities[2] in own_sessions):
            brains.append(brain)
    if not brains:
        asked = " ".join(sorted(subjects | own_sessions)) or "files named sub-…"
        raise InputError("has no such participants and sessions", path=folder, expected=asked)
    if problems := [f"\n  {brain.entry['id']}: {note}" for brain in brains for note in brain.notes]:
        remedy = (
            "Of several files of a scan choose with --files, such as '*_desc-brain_dseg.nii.gz'; --scheme names labels."
        )
        raise InputError("cannot be run as it is", path=folder, found="".join(problems), remedy=remedy)
    youngest = brains[0].entry["id"]
    brains.sort(key=lambda brain: (brain.entry.get("subject", ""), brain.entry["week"]))
    followed = [scans for scans in _of_subjects(brains).values() if len(_weeks(scans)) > 1]
    starts = [scans[0].entry["id"] for scans in followed]
    leading = fold and bool(followed) and all(_leads(scans, folder) for scans in followed)
    weeks = _weeks(brains)
    given = read_keys(Path(settings)) if settings else {}
    runs: dict[str, Any] = {"reference": {}} | ({"measured": {"preset": "measured"}} if leading else {})
    text: dict[str, Any] = {"brains": [_absolute(brain.entry, folder) for brain in brains]}
    if fold:
        text |= {"start": starts or youngest, "runs": runs, **given}
        text["folding"] = {"end_week": max(max(weeks), min(weeks) + 1)} | (given.get("folding") or {})
    else:
        text |= {key: value for key, value in given.items() if key not in OF_FOLDING}
    text["metrics"] = {"white_surfaces": "all"} | (given.get("metrics") or {})
    write_text(path, yaml.safe_dump(text, sort_keys=False))
    return [brain.entry["id"] for brain in brains], list(scheme_reasons(brains))


def _of_subjects(brains: Sequence[Recognised]) -> dict[str, list[Recognised]]:
    scans: dict[str, list[Recognised]] = {}
    for brain in brains:
        scans.setdefault(brain.entry.get("subject", ""), []).append(brain)
    return scans


def _weeks(brains: Sequence[Recognised]) -> list[float]:
    return sorted({brain.entry["week"] for brain in brains if brain.entry["week"] != UNSET})


def _growing(atlas: Atlas, weeks: tuple[float, float], accepted: bool) -> dict[str, Any]:
    if atlas.licence.accept and not accepted:
        terms = f"{atlas.licence.name} ({atlas.licence.url}): {atlas.licence.terms.rstrip('.')}"
        raise InputError(f"the licence of {atlas.name} is not accepted", found=terms, remedy="Add --accept-licence.")
    for name, series in atlas.series.items():
        there = sorted(series.weeks)
        first = max((week for week in there if week <= weeks[0]), default=there[0])
        last = min((week for week in there if week >= weeks[1]), default=None)
        if last is not None and weeks[0] < weeks[1] and first <= weeks[0] + BEFORE_GW:
            return {"series": name, "weeks": [week for week in there if first <= week <= last]}
    spans = (f"{name}: {min(series.weeks):g} to {max(series.weeks):g} GW" for name, series in atlas.series.items())
    problem = f"no series of the atlas {atlas.name} leads from {weeks[0]:g} to {weeks[1]:g} GW"
    remedy = "Choose another --atlas, or another --until, after --week."
    raise InputError(problem, found="; ".join(spans), remedy=remedy)


def _leads(scans: Sequence[Recognised], folder: Path) -> bool:
    """Return whether scans can give a start its later shapes: label volumes, or surfaces matched by their vertices."""
    if all("labels" in brain.entry for brain in scans):
        return True
    dated = [brain.entry for brain in scans if brain.entry["week"] != UNSET and UNSET not in brain.entry.values()]
    return unmatched_reason([validated(BrainConfig, _absolute(entry, folder), entry["id"]) for entry in dated]) is None


def _absolute(value: object, folder: Path) -> object:
    if isinstance(value, dict):
        return {key: _absolute(item, folder) for key, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item, folder) for item in value]
    if isinstance(value, str) and (folder / value).is_file():
        return str((folder / value).resolve())
    return value
