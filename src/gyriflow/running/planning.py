"""Find the planned jobs that run again: their results do not match their manifest, or
they depend on such jobs.

Snakemake lists its jobs in events of its log. It then makes the files that are missing,
as outdated ones are hidden from it.
"""

import logging
import os
import shutil
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tabulate import tabulate

from ..errors import InputError, StorageError
from ..io.files import files_below, read_json, write_json
from .manifest import (
    COPIES,
    UNNAMED,
    Contents,
    Job,
    difference,
    manifest_of,
    read_manifest,
    write_manifest,
)
from .provenance import recorded_inputs

FORCED = "Forced execution"
MISSING = "Missing output files"
HIDDEN = ".outdated."
"""Start of the names of outdated results during a run."""
BY_ANOTHER_JOB = "Input files updated by another job"
UPDATED = " (update)"
"""What Snakemake's log adds to the name of a result that a rule updates."""


def _job_from(job: Any) -> Job:
    """Return a job of Snakemake's own."""
    named = {}
    for name, files in job.input.items():
        paths = [files] if isinstance(files, str) else files
        named[name] = [str(path) for path in paths]
    with_name = set(chain.from_iterable(named.values()))
    unnamed = [str(path) for path in job.input if str(path) not in with_name]
    # a rule has these first
    inputs = {UNNAMED: unnamed, **named} if unnamed else named
    outputs = [str(file) for file in job.output]
    # a fetched file of an atlas is an input
    is_recorded = bool(job.log and outputs) and not Path(outputs[0]).is_absolute()
    manifest = manifest_of(job.log[0]) if is_recorded else None
    return Job(
        job.rule.name,
        inputs,
        outputs,
        manifest,
        settings=lambda: dict(job.params.items()),
        wildcards=job.wildcards_dict,
        threads=lambda: job.threads,
    )


@dataclass
class Events:
    """Jobs that Snakemake plans and finishes, from the events of its log.

    `reasons` replace Snakemake's own reasons to run a job, by the first of its results.
    `found` are the contents of files before a run, with which the manifest of each job
    that finishes is written. `jobs` are the planned ones by key, `ended` the keys of
    those that have finished, `started` the results of those that have begun.
    Snakemake `has_nothing` to do if it says so.
    """

    reasons: Mapping[str, str] = field(default_factory=dict)
    found: Contents | None = None
    jobs: dict[str, Job] = field(default_factory=dict)
    has_nothing: bool = False
    ended: set[str] = field(default_factory=set)
    started: set[str] = field(default_factory=set)
    _selected: dict[int, Any] = field(default_factory=dict)
    _keys: dict[int, str] = field(default_factory=dict)

    def take(self, record: logging.LogRecord) -> None:
        """Take a record of Snakemake's log."""
        event = vars(record)
        match event.get("event"):
            case "debug_dag" if event.get("status") == "selected":
                self._add(event["job"])
            case "job_info" if event["output"]:
                key = event["output"][0].removesuffix(UPDATED)
                self._keys[event["jobid"]] = key
                if key in self.jobs:
                    self.started.update(self.jobs[key].outputs)
                if key in self.reasons:
                    record.reason = self.reasons[key]
            case "job_finished":
                # a target has no results, and no key
                key = self._keys.get(event["job_id"])
                if key is not None:
                    self.ended.add(key)
                if self.found and key in self.jobs:
                    # a result without a manifest is made again
                    with suppress(StorageError):
                        write_manifest(self.jobs[key], self.found)
            case None if record.getMessage().startswith("Nothing to be done"):
                self.has_nothing = True

    def _add(self, selected: Any) -> None:
        # a job is selected for each of its results
        if id(selected) not in self._selected:
            self._selected[id(selected)] = selected
            # also again, once it is known what a checkpoint has made
            job = _job_from(selected)
            self.jobs[job.key] = job


@dataclass(frozen=True)
class Plan:
    """Planned jobs, and those whose results do not match what they would be made from
    now.

    `reasons` why jobs run are by their first result. `outdated` are files to be made
    again. `found` are the contents of files before the run, `manifests` those of the
    jobs by their key.
    """

    jobs: Collection[Job] = ()
    manifests: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    found: Contents = field(default_factory=lambda: Contents({}, {}))
    reasons: Mapping[str, str] = field(default_factory=dict)
    outdated: Collection[str] = ()

    @property
    def reasoned_jobs(self) -> list[tuple[Job, str]]:
        """The jobs that run, each with its reason."""
        return [
            (job, self.reasons[job.key]) for job in self.jobs if job.key in self.reasons
        ]


def made_plan(
    events: Events,
    targets: Collection[str],
    forced: Collection[str],
) -> Plan:
    """Return the plan of the jobs that Snakemake has listed, for the working directory.

    `targets` and `forced` are rules and files that the call names.
    """
    jobs = events.jobs
    manifests = {key: read_manifest(job.manifest) for key, job in jobs.items()}
    found = _present_contents(jobs, manifests)
    reasons = {}
    for key, job in jobs.items():
        if not set(forced).isdisjoint([job.rule, *job.outputs]):
            reasons[key] = FORCED
        elif why := _outdated_by_itself(job, manifests[key], found):
            reasons[key] = why
    producers = _producers(jobs)
    for file in _required(jobs, producers, targets):
        if file in producers and not Path(file).exists():
            reasons.setdefault(
                producers[file],
                f"{MISSING}: {file}",
            )
    _spread(reasons, jobs, producers)
    # targets make nothing, so they never end
    reasons = {key: why for key, why in reasons.items() if jobs[key].outputs}
    outdated = []
    for key in reasons:
        outdated += [file for file in jobs[key].outputs if Path(file).exists()]
    return Plan(jobs.values(), manifests, found, reasons, outdated)


def _outdated_by_itself(
    job: Job,
    manifest: Mapping[str, Any],
    found: Contents,
) -> str:
    """Return why the results of a job do not match their manifest, or ''. Results that
    were removed match as well, and those that were never made."""
    if job.manifest is None:
        return ""
    is_made = manifest or any(Path(file).exists() for file in job.outputs)
    return difference(job, manifest, found) if is_made else ""


def _producers(jobs: Mapping[str, Job]) -> dict[str, str]:
    """Return the job that makes each file."""
    producers: dict[str, str] = {}
    for key, job in jobs.items():
        producers |= dict.fromkeys(job.outputs, key)
    return producers


def _required(
    jobs: Mapping[str, Job],
    producers: Mapping[str, str],
    targets: Collection[str],
) -> list[str]:
    """Return the files that a call asks for, with the names of rules among its targets.

    A rule without results, such as `all`, asks for all results of the jobs that make
    its inputs. Such a rule lists only one result of each job, since every listed file
    costs Snakemake time.
    """
    files = list(targets)
    asked = [key for key, job in jobs.items() if job.rule in targets]
    for job in jobs.values():
        if not job.outputs:
            asked += [producers[file] for file in job.files if file in producers]
    for key in dict.fromkeys(asked):
        files += jobs[key].outputs
    return files


def _spread(
    reasons: dict[str, str],
    jobs: Mapping[str, Job],
    producers: Mapping[str, str],
) -> None:
    """Add the jobs that run because of those with `reasons`: those that read their
    results, and those that make what they miss."""
    readers = defaultdict(set)
    for key, job in jobs.items():
        for file in job.files:
            if file in producers and job.outputs:
                readers[producers[file]].add(key)
    waiting = list(reasons)
    while waiting:
        key = waiting.pop()
        for file in jobs[key].files:
            maker = producers.get(file)
            if maker is not None and maker not in reasons and not Path(file).exists():
                reasons[maker] = f"{MISSING}: {file}"
                waiting.append(maker)
        for reader in readers[key] - reasons.keys():
            reasons[reader] = f"{BY_ANOTHER_JOB}: {jobs[key].rule}"
            waiting.append(reader)


def _present_contents(
    jobs: Mapping[str, Job], manifests: Mapping[str, Mapping[str, Any]]
) -> Contents:
    """Return the contents of the files of planned jobs."""
    known = recorded_inputs(Path())
    absent: dict[str, str] = {}
    results = []
    for key, job in jobs.items():
        recorded = manifests[key].get("results", {})
        known |= recorded
        absent |= {path: facts[0] for path, facts in recorded.items()}
        results += job.outputs
        if job.manifest is None and job.outputs:
            absent[job.outputs[0]] = str(job.settings().get("sha256"))
    with suppress(InputError):
        known |= read_json(COPIES)
    found = Contents(known, absent)
    found.read(results)
    return found


def keep_contents(plan: Plan) -> None:
    """Find the contents of inputs before a run, and keep those of results that were
    copied, in the working directory, so that the next call does not read them again."""
    copied = {}
    for job in plan.jobs:
        for path in job.files:
            plan.found.get(path)
        recorded = plan.manifests[job.key].get("results", {})
        for path in job.outputs:
            facts = plan.found.facts(path)
            if facts and facts != recorded.get(path):
                copied[path] = facts
    if copied:
        with suppress(StorageError):
            write_json(COPIES, copied)


def listing(plan: Plan, quiet: Collection[str] = ()) -> str:
    """Return the jobs that would run as text: each with its files and its reason, and
    their number by rule.

    `quiet` are words of Snakemake's option of this name: without single jobs for
    "rules", nothing at all for "all".
    """
    if "all" in quiet:
        return ""
    counts = Counter(job.rule for job, _ in plan.reasoned_jobs)
    rows = [*sorted(counts.items()), ("total", counts.total())]
    text = f"Job stats:\n{tabulate(rows, headers=('job', 'count'))}\n"
    if "rules" in quiet:
        return text
    for job, reason in plan.reasoned_jobs:
        names = [f"{name}={value}" for name, value in job.wildcards.items()]
        facts = {
            "input": ", ".join(job.files),
            "output": ", ".join(job.outputs),
            "wildcards": ", ".join(names),
            "reason": reason,
        }
        text += f"\nrule {job.rule}:\n"
        for name, value in facts.items():
            if value:
                text += f"    {name}: {value}\n"
    return text


def hide_results(directory: Path, files: Iterable[str]) -> None:
    """Rename results that Snakemake would take for current."""
    for file in files:
        path = directory / file
        path.rename(path.with_name(HIDDEN + path.name))


def restore_results(directory: Path, replaced: Collection[str] = ()) -> None:
    """Give hidden results their names again, unless they were made again or `replaced`
    by a step that failed."""
    for hidden in files_below(directory / "results"):
        if not hidden.name.startswith(HIDDEN):
            continue
        path = hidden.with_name(hidden.name.removeprefix(HIDDEN))
        is_replaced = path.relative_to(directory).as_posix() in replaced
        if is_replaced or path.exists():
            hidden.unlink()
        else:
            hidden.rename(path)


@contextmanager
def view_of(directory: Path) -> Iterator[Path]:
    """Yield a folder with links to the files of a working directory. Snakemake can plan
    there: it needs to write, and a study may be read-only."""
    with TemporaryDirectory() as scratch:
        view = Path(scratch)
        paths = directory.absolute().iterdir() if directory.is_dir() else []
        for path in paths:
            if path.name not in (".snakemake", "results"):
                (view / path.name).symlink_to(path)
        link_results(directory, view, [])
        yield view


def link_results(
    directory: Path,
    view: Path,
    left_out: Iterable[str],
) -> None:
    """Link the results of a working directory into a view of it, without some files.

    Folders are linked whole where that is possible. Files that cannot be written are
    linked one by one: Snakemake refuses to plan their replacement, but that of links.
    """
    results, links = directory.absolute() / "results", view / "results"
    if links.is_symlink():
        links.unlink()
    elif links.is_dir():
        shutil.rmtree(links)
    hidden = {directory.absolute() / file for file in left_out}
    parted: set[Path] = set()
    for path in files_below(results):
        if path in hidden or not os.access(path, os.W_OK):
            parted.update(path.parents)
    if results.is_dir():
        _link(results, links, hidden, parted)


def _link(
    source: Path,
    link: Path,
    hidden: set[Path],
    parted: set[Path],
) -> None:
    if source not in parted:
        link.symlink_to(source)
        return
    link.mkdir()
    for path in source.iterdir():
        if path not in hidden:
            _link(path, link / path.name, hidden, parted)
