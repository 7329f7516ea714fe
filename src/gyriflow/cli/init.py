"""Write the first configuration of a study: from a folder's brains, for one prediction,
or for a BIDS data set."""

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from pathlib import Path
from string import Template
from typing import Any

import yaml

from ..errors import InputError
from ..grouping import grouped
from ..io.files import read_json, read_text, write_json, write_text
from ..io.yaml_files import read_keys
from ..names import require_bids_names
from ..settings.atlas import Atlas, AtlasSettings
from ..settings.base import own_name, validated
from ..settings.brains import BrainConfig
from ..settings.growth import BEFORE_GW
from ..settings.root import FOLDING_SECTIONS
from ..settings.runs import chosen_starts
from ..shipped import SHIPPED
from ..study.loading import load
from ..study.series import unmatched_reason
from .recognition import UNSET, FoundBrain, FoundScans, recognise_brain

TEMPLATES = SHIPPED / "config" / "templates"
BIDS_OPTIONS = "bids.json"
BIDS_HEAD = "# Written by `gyriflow bids`, which replaces it.\n"
SHIPPED_ATLAS = "spina-bifida"
QUICK_GW = 3.0
"""Least time between the atlas' brains of a quick prediction."""


def write_configuration(
    found: FoundScans,
    folder: Path,
    path: Path,
    *,
    force: bool = False,
    only_measured: bool = False,
) -> Path | None:
    """Write a configuration for the scans of a folder. Scans that cannot be used are
    comments in it, with the cause.

    By default, one of them is folded, and values may be left to fill in. InputError if
    no scan can be used. An earlier configuration is replaced as by
    `replace_configuration`.
    """
    inside = path.resolve().parent == folder.resolve()
    usable = []
    for brain in found.brains:
        is_refused = brain.causes if only_measured else brain.problem
        if not is_refused:
            usable.append(brain)
    if not usable:
        raise InputError(
            "no scan can be used", path=folder, found=_causes(found.brains)
        )
    lines = []
    for brain in found.brains:
        entry = brain.entry if inside else _absolute(brain.entry, folder)
        text = yaml.safe_dump(
            entry,
            default_flow_style=True,
            sort_keys=False,
            width=10_000,
            allow_unicode=True,
        ).strip()
        line = f"  {'-' if brain in usable else '# -'} {text}"
        for note in (*brain.causes, *brain.warnings):
            line += f"  # {' '.join(note.split())}"
        if brain.age_source:
            line += f"  # week: {brain.age_source}"
        lines.append(line)
    # the start is a brain with later scans of its subject or atlas, if any
    several = _series(usable)
    series = several[0] if several else usable
    weeks = _weeks(series)
    end = UNSET
    if weeks:
        end = f"{weeks[-1] if several else weeks[0] + 1:g}"
    text = _from_template(
        "brains",
        config=SHIPPED / "config",
        brains="\n".join(lines),
    )
    if not only_measured:
        # an id may look like a number, which YAML writes in quotes
        start = yaml.safe_dump(series[0].entry["id"]).splitlines()[0]
        measured_run = ""
        if several and _have_shapes(series, folder):
            measured_run = "\n  measured: {preset: measured}"
        text += _from_template("folding", start=start, end=end, measured=measured_run)
    return replace_configuration(path, text, path, "--output", force=force)


def _from_template(name: str, **values: object) -> str:
    return Template(read_text(TEMPLATES / f"{name}.yaml")).substitute(values)


def replace_configuration(
    path: Path,
    text: str,
    shown_path: Path,
    option: str,
    *,
    force: bool,
) -> Path | None:
    """Write a configuration; rename one with another text, such as to gyriflow.yaml.1,
    and return its new path.

    InputError if the one at `shown_path` has another text, unless `force` is set;
    `option` of the command names another path.
    """
    if shown_path.exists() and read_text(shown_path) != text and not force:
        raise InputError(
            "already exists with different content",
            path=shown_path,
            remedy=f"Choose another place with {option}, or add --force.",
        )
    kept = None
    if path.exists() and read_text(path) != text:
        names = (f"{path.name}.{number}" for number in count(1))
        free = (path.with_name(name) for name in names)
        kept = path.rename(next(other for other in free if not other.exists()))
    write_text(path, text)
    return kept


def commented_scans(path: Path) -> list[str]:
    """Return lines on the scans that are comments in a configuration as of
    `write_configuration`: id and cause."""
    text = path.read_text(encoding="utf-8")
    comment = r"^  # - \{id: ([^,]+),.*?\}  # (.*)$"
    return _grouped_causes(re.findall(comment, text, re.MULTILINE))


def _causes(brains: Iterable[FoundBrain]) -> str:
    scans = []
    for brain in brains:
        scans += [(brain.entry["id"], cause) for cause in brain.causes]
    return "".join(f"\n  {line}" for line in _grouped_causes(scans))


def _grouped_causes(scans: Iterable[tuple[str, str]]) -> list[str]:
    """Return lines on scans, given id and cause of each; those of one kind together."""
    messages = [(scan, f"{scan}: {cause}") for scan, cause in scans]
    return [line for line, _ in grouped(messages)]


def predicted_study(
    files: Sequence[Path],
    weeks: tuple[float, float],
    *,
    white: Sequence[Path],
    atlas: str,
    folder: Path | None,
    scheme: str | None,
    image: Path | None,
    accepted: bool,
    ensemble: int | None,
    quick: bool,
) -> tuple[str, str]:
    """Return a configuration that folds a brain by the growth of an atlas, and a line
    on it.

    `files` are its label volume or pial surfaces; `weeks` are the week of the brain and
    the week to predict; `folder` has the atlas' files; `accepted` is about its licence.
    InputError if anything is missing.
    """
    entry = recognise_brain(files, white, scheme)
    if image and "scheme" not in entry:
        raise InputError(
            "--image: only labels are shown on an image",
            found="surfaces",
            remedy="Leave it out.",
        )
    entry = {
        "id": entry["id"],
        "week": weeks[0],
        "population": entry["id"],
    } | entry
    entry |= {"image": str(own_name(image))} if image else {}
    keys = {
        "name": atlas,
        "folder": folder and str(folder),
        "accept_licence": accepted,
    }
    settings = validated(AtlasSettings, keys, "--atlas").located(Path.cwd())
    series = _growth_series(
        Atlas(**read_keys(settings.description)),
        weeks,
        accepted,
        QUICK_GW if quick else 0.0,
    )
    section = settings.model_dump(exclude_defaults=True) | series
    more = read_keys(TEMPLATES / ("quick.yaml" if quick else "predict.yaml"))
    folding = {"preset": "expected", "end_week": weeks[1]} | more.get("folding", {})
    config = {
        "brains": [entry],
        "atlas": section,
        "start": entry["id"],
        **more,
        "folding": folding,
    }
    config["runs"] = {"predicted": {"ensemble": ensemble} if ensemble else {}}
    load(config)
    span = f"{weeks[0]:g} to {weeks[1]:g} GW by {settings.name}, {series['series']}"
    sides = entry.get("hemispheres", {}).items()
    names = ", ".join(f"{side} {path}" for side, path in sides) or files[0]
    given = entry.get("scheme", f"pial{' and white' if white else ''} surfaces")
    text = yaml.safe_dump(config, sort_keys=False)
    return text, f"{entry['id']}: {names} ({given}), {span}"


def with_earlier_options(path: Path, options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of a call for a whole BIDS data set. Missing ones are those of
    earlier calls, from a file."""
    earlier = read_json(path) if path.is_file() else {}
    return {
        key: value if value not in (None, ()) else earlier.get(key)
        for key, value in options.items()
    }


def store_options(path: Path, options: dict[str, Any]) -> None:
    """Store the options of a call for a part of a BIDS data set; earlier participants
    and sessions are added."""
    earlier = read_json(path) if path.is_file() else options
    stored = dict(options)
    for key in ("participants", "sessions"):
        # an empty list means all
        several = bool(options[key] and earlier[key])
        stored[key] = (
            list(dict.fromkeys([*earlier[key], *options[key]])) if several else []
        )
    write_json(path, stored)


def write_bids(
    found: FoundScans,
    folder: Path,
    path: Path,
    shown_path: Path,
    *,
    settings: str | None = None,
    fold: bool | None = None,
) -> tuple[list[str], list[str], list[str]]:
    """Write a configuration for the scans of a BIDS data set that can be used; return
    their ids, those of the folded ones, and the unused sections of the settings. The
    one at `shown_path` has to be of an earlier call.

    `settings` is a configuration without brains. The scans are measured. With `fold`
    those that `start` of the settings names are also folded, or else the first of
    several scans of a subject. Scans without `sub-` in their path become unused.
    InputError if no scan can be used.
    """
    with_subject = []
    for brain in found.brains:
        if brain.entry["id"].startswith("sub-"):
            with_subject.append(brain)
        else:
            found.unused[brain.files] = "no sub-… in its path"
    found.brains = with_subject
    brains = [brain for brain in with_subject if not brain.causes]
    if not brains:
        causes = _causes(with_subject) or "no files named sub-…"
        remedy = None
        if "keep one" in causes:
            remedy = (
                "Choose one of several files with --files, such as"
                " '*_desc-brain_dseg.nii.gz'."
            )
        raise InputError(
            "no scan can be used",
            path=folder,
            found=causes,
            remedy=remedy,
        )
    require_bids_names(
        brain.entry.get("subject", brain.entry["id"]) for brain in brains
    )
    brains.sort(key=lambda brain: (brain.entry.get("subject", ""), brain.entry["week"]))
    further = read_keys(Path(settings)) if settings else {}
    text: dict[str, Any] = {
        "brains": [_absolute(brain.entry, folder) for brain in brains]
    }
    series = _series(brains)
    unused = []
    if fold and (series or "start" in further):
        runs: dict[str, Any] = {"reference": {}}
        if series and all(_have_shapes(scans, folder) for scans in series):
            runs["measured"] = {"preset": "measured"}
        starts = [scans[0].entry["id"] for scans in series]
        text |= {"start": starts, "runs": runs, **further}
        # without later scans it is not known how far to fold
        end = {"end_week": _weeks(brains)[-1]} if series else {}
        text["folding"] = end | (further.get("folding") or {})
    else:
        for key, value in further.items():
            if key in FOLDING_SECTIONS:
                unused.append(key)
            else:
                text[key] = value
    text["metrics"] = {"white_surfaces": "all"} | (further.get("metrics") or {})
    if shown_path.exists() and not read_text(shown_path).startswith(BIDS_HEAD):
        raise InputError(
            "was not written by gyriflow bids and is not replaced",
            path=shown_path,
            remedy="Choose another folder with --work-dir.",
        )
    write_text(path, BIDS_HEAD + yaml.safe_dump(text, sort_keys=False))
    names = [brain.entry["id"] for brain in brains]
    return names, _folded(text, names), unused


def _folded(config: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    """Return which brains a configuration folds, of all its `names`."""
    starts: set[str] = set()
    runs = config.get("runs") or {}
    for section in [config, *runs.values()]:
        if section:
            start = section.get("start")
            starts.update(chosen_starts(start, names))
    return [name for name in names if name in starts]


def _series(brains: Sequence[FoundBrain]) -> list[list[FoundBrain]]:
    """Return the scans of each subject or atlas that has several weeks."""
    scans: dict[str, list[FoundBrain]] = {}
    for brain in brains:
        subject = brain.entry.get("subject", "")
        scans.setdefault(subject, []).append(brain)
    series = []
    for group in scans.values():
        if len(_weeks(group)) > 1:
            series.append(group)
    return series


def _weeks(brains: Sequence[FoundBrain]) -> list[float]:
    return sorted(
        {brain.entry["week"] for brain in brains if brain.entry["week"] != UNSET}
    )


def _growth_series(
    atlas: Atlas,
    weeks: tuple[float, float],
    accepted: bool,
    least_gw: float = 0.0,
) -> dict[str, Any]:
    """Return the first series of an atlas that covers a start and an end week, and its
    weeks that are used.

    These are all later ones, so that a prediction does not depend on where it ends;
    with `least_gw` between them only those that a prediction to the end needs.
    """
    if atlas.licence.accept and not accepted:
        raise InputError(
            f"the licence of {atlas.name} is not accepted",
            found=f"{atlas.licence.name}: {atlas.licence.terms.rstrip('.')}",
            remedy="Add --accept-licence.",
        )
    for name, series in atlas.series.items():
        available = sorted(series.weeks)
        first = max(
            (week for week in available if week <= weeks[0]), default=available[0]
        )
        last = min((week for week in available if week >= weeks[1]), default=None)
        if last is not None and weeks[0] < weeks[1] and first <= weeks[0] + BEFORE_GW:
            later = [week for week in available if week >= first]
            return {
                "series": name,
                "weeks": _thinned(later, weeks[1], least_gw) if least_gw else later,
            }
    spans = (
        f"{name}: {min(series.weeks):g} to {max(series.weeks):g} GW"
        for name, series in atlas.series.items()
    )
    problem = (
        f"no series of the atlas {atlas.name} covers {weeks[0]:g} to {weeks[1]:g} GW"
    )
    remedy = "Choose another --atlas, or another --until, after --week."
    raise InputError(problem, found="; ".join(spans), remedy=remedy)


def _thinned(
    weeks: Sequence[float],
    end: float,
    least_gw: float,
) -> list[float]:
    """Return ascending weeks at least so far apart, up to the first one at or past an
    end, or as far as they go."""
    chosen = [weeks[0]]
    for week in weeks[1:]:
        is_far = week - chosen[-1] >= least_gw
        is_last_chance = week == weeks[-1]
        if chosen[-1] < end and (is_far or is_last_chance):
            chosen.append(week)
    return chosen


def _have_shapes(scans: Sequence[FoundBrain], folder: Path) -> bool:
    """Return whether scans can give the later shapes of a start brain: label volumes or
    vertex-matched surfaces."""
    if all("labels" in brain.entry for brain in scans):
        return True
    brains = []
    for scan in scans:
        # without a week or a scheme it is no brain yet
        if UNSET not in scan.entry.values():
            entry = _absolute(scan.entry, folder)
            brains.append(validated(BrainConfig, entry, scan.entry["id"]))
    return unmatched_reason(brains) is None


def _absolute(value: object, folder: Path) -> object:
    """Return an entry with absolute paths of files in a folder."""
    if isinstance(value, dict):
        return {key: _absolute(item, folder) for key, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item, folder) for item in value]
    if isinstance(value, str):
        path = folder / value
        if path.is_file():
            return str(own_name(path))
    return value
