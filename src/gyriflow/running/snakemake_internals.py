"""Parts of Snakemake that gyriflow uses outside its public interface, tried with
Snakemake 9.27.0 and 9.27.1."""

import hashlib
import json
import os
import re
from base64 import urlsafe_b64decode
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from unittest.mock import patch

from ..code_hash import code_hash
from ..io.files import contents as file_contents
from ..io.files import files_below
from ..io.origins import joined_contents
from ..shipped import SHIPPED
from ..study.paths import log_of

REMOVED = (".csv", ".html", ".png", ".pdf")
DATE_TOL_S = 0.001


def rerun_on_code_changes(rules: Iterable[Any], scripts: Path) -> None:
    """Give rules a parameter that changes with their code; Snakemake reruns jobs whose
    parameters have changed.

    Snakemake itself sees the date of a script, which a new checkout changes, and no
    package that a script imports. A shell command has to name the code of its program
    itself. `scripts` is the folder of the rules' scripts.
    """
    for rule in rules:
        script = scripts / Path(rule.script or "").name
        if rule.script and not hasattr(rule.params, "code"):
            rule.set_params(code=code_hash(script))
        if rule.script or rule.shellcmd:
            text = rule.shellcmd or script.read_text()
            rule.set_params(
                command=f"code {hashlib.sha256(text.encode()).hexdigest()[:12]}"
            )


def complete_rules(rules: Iterable[Any], environment: str) -> None:
    """Give rules a log (see `log_of`), and rules that name no environment the common
    one.

    For Snakemake's software deployment with conda, `environment` is the path of the
    environment's file.
    """
    from snakemake.io import strip_wildcard_constraints

    for rule in rules:
        # a rule without output has nothing to do in this study
        runs = rule.output and (rule.script or rule.shellcmd)
        if runs and not rule.log:
            rule.log_modifier = rule.output_modifier
            rule.set_log(log_of(rule.name, strip_wildcard_constraints(rule.output[0])))
        if runs and not rule.conda_env:
            rule.conda_env = environment


def know_inputs_by_content(
    contents: Mapping[str, str],
    earlier: Collection[str],
    folders: Collection[str],
    awaited: Collection[str] = (),
) -> None:
    """Have Snakemake record the content of input files instead of their paths, so that
    they may be moved.

    Files of gyriflow and of a user count as changed if their content has, whatever
    their date. Dates of results mean nothing in a copy of a study. `contents` are
    hashes of the study's input files by path, `earlier` those of the last run; the
    place of `folders` is not recorded, like that of the working directory and of
    gyriflow. Of `awaited` files, which jobs of this run fetch, the content is known
    once they are there.
    """
    from snakemake.io import _IOFile
    from snakemake.persistence import PersistenceBase

    recorded_input = PersistenceBase._input
    recorded_params = PersistenceBase._params
    is_newer = _IOFile.is_newer
    names = {path: f"input {content}" for path, content in contents.items()}
    names |= dict.fromkeys([*folders, str(Path.cwd()), str(SHIPPED)], "a folder")
    # as parameters are written
    names |= {repr(path)[1:-1]: name for path, name in names.items()}
    awaited_by_text = {
        text: path for path in awaited for text in (path, repr(path)[1:-1])
    }
    longest_first = sorted([*names, *awaited_by_text], key=len, reverse=True)
    has_dates = not dates_before_copy(Path())
    places = re.compile(
        rf"(?<![\w./-])(?:{'|'.join(map(re.escape, longest_first))})(?![\w.-])"
    )

    @cache
    def present_content(path: str) -> str:
        return joined_contents(file_contents([path], {}))[path]

    def content_of(path: str) -> str | None:
        if path in contents:
            return contents[path]
        # files of gyriflow itself, and files that were fetched
        return (
            present_content(path)
            if path.startswith("/") and Path(path).is_file()
            else None
        )

    def name_of(match: re.Match[str]) -> str:
        text = match[0]
        path = awaited_by_text.get(text)
        if path is None:
            return names[text]
        return f"input {content}" if (content := content_of(path)) else text

    def by_content(self: PersistenceBase, job: Any) -> list[str]:
        return sorted(
            f"input {content}" if (content := content_of(path)) else path
            for path in recorded_input(self, job)
        )

    def without_places(self: PersistenceBase, job: Any) -> list[str]:
        return sorted(places.sub(name_of, text) for text in recorded_params(self, job))

    async def is_newer_or_other(self: Any, time: float) -> bool:
        content, is_known = content_of(str(self)), str(self) in contents
        may_be_newer = (
            has_dates
            if content is None
            else earlier and is_known and content not in earlier
        )
        return bool(may_be_newer) and await is_newer(self, time)

    PersistenceBase._input, PersistenceBase._params = by_content, without_places
    _IOFile.is_newer = is_newer_or_other


@contextmanager
def temporary_records(directory: Path) -> Iterator[None]:
    """Let Snakemake plan in a directory that may be read-only: it writes records and
    caches to a temporary folder."""
    from snakemake import workflow
    from snakemake.jobs import Job
    from snakemake.persistence.file import FilePersistence

    async def check_nothing(job: Job) -> None:
        pass

    with (
        TemporaryDirectory() as scratch,
        patch.object(Job, "check_protected_output", check_nothing),
        patch.dict(os.environ, XDG_CACHE_HOME=scratch),
    ):
        # nothing is written to these in a dry run
        for name in ("metadata", "incomplete", "locks"):
            if (record := directory / ".snakemake" / name).is_dir():
                Path(scratch, name).symlink_to(record.resolve())
        with patch.object(
            workflow,
            "FilePersistence",
            lambda **kw: FilePersistence(**kw | {"path": Path(scratch)}),
        ):
            yield


def dates_before_copy(directory: Path) -> dict[Path, float]:
    """Return when the results of a copied working directory were made (s since the
    epoch), by path.

    Empty if any of them still has its date, as after a move: then no copy has given all
    of them new ones.
    """
    dates = {}
    for made in _made_files(directory):
        if made.has_its_date:
            return {}
        dates[made.path] = made.date_s
    return dates


def remove_stale(rules: Collection[Any], *folders: str) -> None:
    """Remove tables, figures and pages that an earlier run made and no rule makes, such
    as those of refused brains.

    Files that a user has saved or changed in these `folders` are left.
    """
    for made in _made_files(Path()):
        is_in_folders = any(made.path.is_relative_to(folder) for folder in folders)
        is_stale = is_in_folders and not any(
            rule.is_producer(str(made.path)) for rule in rules
        )
        if is_stale and made.path.suffix in REMOVED and made.has_its_date:
            made.path.unlink()
            made.record.unlink()


class _MadeFile(NamedTuple):
    """A result in a working directory that a job made, Snakemake's record of it, and
    its date then."""

    path: Path
    record: Path
    date_s: float

    @property
    def has_its_date(self) -> bool:
        return abs(self.path.lstat().st_mtime - self.date_s) < DATE_TOL_S


def _made_files(directory: Path) -> Iterator[_MadeFile]:
    records = directory / ".snakemake" / "metadata"
    for record in files_below(records):
        # a long name is split into folders
        parts = [part.removeprefix("@") for part in record.relative_to(records).parts]
        # a record may be torn
        with suppress(OSError, ValueError, KeyError, TypeError):
            name = urlsafe_b64decode("".join(parts)).decode()
            path = directory / name
            date_s = float(json.loads(record.read_text())["endtime"])
            if not Path(name).is_absolute() and path.is_file():
                yield _MadeFile(path, record, date_s)


def usage_patterns(rules: Iterable[Any]) -> dict[str, str]:
    """Return the regular expression of the records of time and memory of each rule,
    with wildcards as groups.

    They are named like the rule's log (see `step.record_usage`).
    """
    patterns = {}
    for rule in rules:
        if rule.log:
            log = rule.log[0].regex().pattern
            patterns[rule.name] = log.replace("/logs/", "/benchmarks/").replace(
                r"\.log", r"\.tsv"
            )
    return patterns
