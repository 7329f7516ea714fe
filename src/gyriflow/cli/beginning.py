"""Writes the first configuration of a study from the files of a folder."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import yaml

from ..errors import InputError
from ..io.files import write_text
from .recognition import UNSET, Found, recognise

HEAD = """\
# Written by `gyriflow init` from the files of this folder. Every key has a default: config/README.md of gyriflow lists
# them with their units. Paths are relative to this file.

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
MEASURED = """
  measured: {preset: measured}"""


def write_configuration(folder: Path, path: Path, force: bool) -> Iterator[str]:
    """Writes a configuration for the brains of a folder; yields what was recognised, a line a kind.

    InputError where nothing was recognised, or a configuration is there and `force` is not set.
    """
    if path.exists() and not force:
        raise InputError(
            "is there already", path=path, remedy="Choose another file with --output, or replace it: --force"
        )
    found = recognise(folder)
    text = configuration(found, folder, path)
    write_text(path, text)
    kinds = Counter(_kind(brain) for brain in found)
    yield f"{len(found)} brain{'s' if len(found) > 1 else ''}: " + ", ".join(
        f"{count} from {kind}" for kind, count in kinds.items()
    )
    for brain in found:
        missing = [key for key in ("week", "scheme") if brain.entry.get(key) == UNSET]
        for key in missing:
            note = next((note for note in brain.notes if note.startswith(key)), f"{key}: not told by its name")
            yield f"to be filled in for {brain.entry['id']}: {note}"


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
    end = weeks[-1] if len(weeks) > 1 else (weeks[0] + 1 if weeks else UNSET)
    end_text = f"{end:g}" if isinstance(end, float) else end
    return (
        HEAD
        + "\n".join(lines)
        + "\n"
        + REST.format(start=start, end=end_text, measured=MEASURED if len(weeks) > 1 else "")
    )


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
