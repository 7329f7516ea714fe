"""Write, in a manifest in the folder of its results, what each job has made them from,
and find whether a planned job still matches it.

Files are compared by content, inputs by their role in the rule. Dates mean nothing, nor
do Snakemake's own records. Paths here are relative to the working directory.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from ..errors import InputError
from ..io.files import contents, files_below, read_json, write_json
from ..io.origins import joined_contents

FOLDER = "manifest"
"""Folder with the manifests of jobs, next to that of their logs."""
COPIES = Path(".snakemake", "gyriflow-contents.json")
"""Contents of results that are not as their job left them, such as those of a copy, so
that they are read once."""
MAX_SETTING = 500
"""Longer settings (characters) are recorded by their hash."""
NO_MANIFEST = "no manifest of what it was made from"
CODE = ("code", "command")
"""Settings that are hashes of the code behind a rule."""
CHANGED_CODE = "changed code"
UNNAMED = ""
"""The role of the inputs that have no name in their rule."""


@dataclass(frozen=True)
class Job:
    """A job that Snakemake plans.

    `inputs` are its files by role, in their order. `manifest` is the path of its
    manifest; None if it has no results to record. `settings` returns the parameters by
    name, `threads` their number, both of which some rules compute.
    """

    rule: str
    inputs: Mapping[str, list[str]]
    outputs: list[str]
    manifest: Path | None
    settings: Callable[[], Mapping[str, Any]]
    wildcards: Mapping[str, str] = field(default_factory=dict)
    threads: Callable[[], int] = int

    @property
    def key(self) -> str:
        """What distinguishes it from other jobs of a plan."""
        return self.outputs[0] if self.outputs else self.rule

    @property
    def files(self) -> list[str]:
        """All its inputs."""
        found = []
        for paths in self.inputs.values():
            found += paths
        return found


def manifest_of(log: str) -> Path | None:
    """Return the path of the manifest of a job with a log; None if its log lies beside
    no results."""
    path = Path(log)
    folder = next(
        (folder for folder in path.parents if folder.name == "logs"),
        None,
    )
    if folder is None:
        return None
    name = path.relative_to(folder).with_suffix(".json")
    return folder.with_name(FOLDER) / name


class Contents:
    """Contents of files by path: hashes that are computed once, and kept of files that
    have not changed.

    `known` are `io.files.contents` of an earlier run. `absent` are the hashes that
    files would have which are not there: removed results, and files to be fetched.
    """

    def __init__(self, known: Mapping[str, Any], absent: Mapping[str, str]) -> None:
        self._known = known
        self._absent = absent
        self._facts: dict[str, list[Any]] = {}
        self._hashes: dict[str, str] = {}

    def read(self, paths: Iterable[str]) -> None:
        """Find the contents of files; those that were found before, again."""
        found = contents(dict.fromkeys(paths), self._known)
        self._facts |= found
        self._hashes |= joined_contents(found)

    def get(self, path: str) -> str | None:
        """Return the hash of a file, with those of its companions; None if it is
        unknown."""
        if path not in self._hashes:
            self.read([path])
        return self._hashes.get(path) or self._absent.get(path)

    def facts(self, path: str) -> list[Any]:
        """Return the hash of a file that was read, its size and times; empty if it was
        missing."""
        return self._facts.get(path, [])


def _settings_of(job: Job, found: Contents) -> dict[str, str]:
    """Return the settings of a job as text, files by their content."""
    texts = {}
    for name, value in job.settings().items():
        text = json.dumps(_described(value, found), ensure_ascii=False)
        if len(text) > MAX_SETTING:
            text = f"sha256 {hashlib.sha256(text.encode()).hexdigest()}"
        texts[name] = text
    return texts


def _described(value: Any, found: Contents) -> Any:
    """Return a value in terms of JSON: contents for files, no places of folders."""
    if isinstance(value, Path):
        value = str(value)
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str):
        return _without_place(value, found)
    if isinstance(value, BaseModel):
        return _described(value.model_dump(), found)
    if isinstance(value, Mapping):
        return {
            str(_described(key, found)): _described(item, found)
            for key, item in value.items()
        }
    if isinstance(value, set | frozenset):
        return sorted(str(_described(item, found)) for item in value)
    if isinstance(value, Iterable):
        return [_described(item, found) for item in value]
    if is_dataclass(value):
        named = {item.name: getattr(value, item.name) for item in fields(value)}
        return _described(named, found)
    return type(value).__name__


def _without_place(text: str, found: Contents) -> str:
    if not Path(text).is_absolute():
        return text
    content = found.get(text)
    return "a folder" if content is None else f"file {content}"


def write_manifest(job: Job, found: Contents) -> None:
    """Write what a job has made its results from. Its inputs have the contents that
    they had before it."""
    if job.manifest is None:
        return
    inputs = {}
    for role, paths in job.inputs.items():
        inputs[role] = [[path, found.get(path)] for path in paths]
    found.read(job.outputs)
    manifest = {
        "rule": job.rule,
        "inputs": inputs,
        "settings": _settings_of(job, found),
        "results": {path: found.facts(path) for path in job.outputs},
    }
    write_json(job.manifest, manifest)


def read_manifest(path: Path | None) -> dict[str, Any]:
    """Return a manifest; empty if there is none, or if it is torn."""
    with suppress(InputError):
        if path is not None and path.is_file():
            return read_json(path)
    return {}


def recorded_results(folder: Path) -> dict[str, Any]:
    """Return the results that the manifests below a folder record, with their contents,
    by path."""
    found: dict[str, Any] = {}
    for path in files_below(folder):
        if path.suffix == ".json" and FOLDER in path.parts:
            found |= read_manifest(path).get("results", {})
    return found


def difference(
    job: Job,
    manifest: Mapping[str, Any],
    found: Contents,
) -> str:
    """Return in words how a job differs from the manifest of its results, the first of
    several ways; empty if they match."""
    if not manifest:
        return NO_MANIFEST
    recorded = manifest["results"]
    for path in job.outputs:
        content = found.get(path)
        if content is not None and content != recorded.get(path, [None])[0]:
            return f"changed result {Path(path).name}"
    if changed := _changed_inputs(job, manifest["inputs"], found):
        return f"changed input {', '.join(changed)}"
    return _changed_settings(_settings_of(job, found), manifest["settings"])


def _changed_inputs(
    job: Job,
    recorded: Mapping[str, list[list[str]]],
    found: Contents,
) -> list[str]:
    """Return the names of the inputs whose content or role has changed."""
    changed = []
    for role, paths in job.inputs.items():
        before = [content for _, content in recorded.get(role, [])]
        for number, path in enumerate(paths):
            is_same = number < len(before) and before[number] == found.get(path)
            if not is_same:
                changed.append(Path(path).name)
        fewer = recorded.get(role, [])[len(paths) :]
        changed += [Path(path).name for path, _ in fewer]
    for role in recorded:
        if role not in job.inputs:
            changed += [Path(path).name for path, _ in recorded[role]]
    return list(dict.fromkeys(changed))


def _changed_settings(now: Mapping[str, str], before: Mapping[str, str]) -> str:
    names = [name for name in {**now, **before} if now.get(name) != before.get(name)]
    if not names:
        return ""
    others = [name for name in names if name not in CODE]
    if not others:
        return CHANGED_CODE
    changes = []
    for name in others:
        changes += _changed_keys(
            name,
            now.get(name),
            before.get(name),
        )
    return f"changed settings {', '.join(dict.fromkeys(changes))}"


def _changed_keys(
    name: str,
    now: str | None,
    before: str | None,
) -> list[str]:
    """Return the keys of a setting that have changed, with their values if they are
    numbers, words or switches."""
    values = []
    for text in (now, before):
        # a long one is a hash
        with suppress(ValueError):
            values.append(json.loads(text or ""))
    if len(values) < 2:
        return [name]
    new, old = values
    if not (isinstance(new, dict) and isinstance(old, dict)):
        new, old = {name: new}, {name: old}
    changes = []
    for key in {**new, **old}:
        pair = new.get(key), old.get(key)
        if pair[0] != pair[1]:
            is_short = not any(isinstance(value, dict | list) for value in pair)
            changes.append(f"{key} {pair[0]} (was {pair[1]})" if is_short else key)
    return changes
