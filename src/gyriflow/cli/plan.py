"""What a study will run: the jobs of a dry run, why each runs, and what they will take."""

import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..cost.prediction import Job
from ..errors import GyriflowError
from ..io.files import read_json
from ..shipped import PACKAGE

REASONS = {
    "Params have changed": "settings changed",
    "Code has changed": "code changed",
    "Updated input files": "newer input",
    "Set of input files has changed": "other inputs",
    "Software environment definition has changed": "environment changed",
    "Missing output files": "not made yet",
    "Input files updated by another job": "follows another step",
    "Forced execution": "asked for",
    "Incomplete": "left incomplete",
}
"""How Snakemake's reasons begin or what they contain, and what they are called here; the first that fits counts."""


class PlanError(GyriflowError):
    """A study that cannot be planned."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code


@dataclass(frozen=True)
class PlannedJob:
    """A job of a dry run: rule, wildcards, cores, outputs, and Snakemake's reason to run it."""

    rule: str
    wildcards: dict[str, str]
    threads: int
    output: tuple[str, ...]
    reason: str

    @property
    def why(self) -> str:
        """The reason in few words."""
        return next((words for found, words in REASONS.items() if found in self.reason), self.reason)

    @property
    def job(self) -> Job:
        """What the cost of the job depends on."""
        place = re.fullmatch(r"runs/([^/]+)/([^/]+)/.*|brains/([^/]+)/.*", self.wildcards.get("where", ""))
        run, brain, measured = (
            place.groups() if place else (self.wildcards.get("run"), self.wildcards.get("brain"), None)
        )
        return Job(self.rule, run, brain or measured, self.threads)


def plan(arguments: Sequence[str], directory: Path | None = None) -> list[PlannedJob]:
    """Returns the jobs that Snakemake would run, those with outputs; PlanError where it refuses.

    `arguments` are Snakemake's own, such as `--configfile FILE`.
    """
    with tempfile.TemporaryDirectory(prefix="gyriflow-") as folder:
        file = Path(folder, "plan.json")
        command = [sys.executable, "-m", "gyriflow.launch", "--logger", "gyriflow", "--logger-gyriflow-plan", str(file)]
        outcome = subprocess.run(
            [*command, "--dry-run", *arguments],
            cwd=directory, env=environment(), capture_output=True, text=True, check=False,
        )  # fmt: skip
        if outcome.returncode or not file.is_file():
            said = [line for line in outcome.stderr.splitlines() if not line.startswith("Using workflow specific")]
            raise PlanError(
                "\n".join(said).removeprefix("gyriflow: ") or "Snakemake gave no plan", outcome.returncode or 1
            )
        jobs = read_json(file)
    return [
        PlannedJob(job["rule"], job["wildcards"], int(job["threads"]), tuple(job["output"]), job["reason"])
        for job in jobs
        if job["output"]
    ]


def environment() -> dict[str, str]:
    """Returns the variables of programs that import this package, wherever it is."""
    paths = [str(PACKAGE.parent), *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return os.environ | {"PYTHONPATH": os.pathsep.join(dict.fromkeys(paths))}


def reasons(jobs: Sequence[PlannedJob]) -> str:
    """Returns how many jobs run for which reason, the most frequent first."""
    counts = Counter(job.why for job in jobs)
    return ", ".join(f"{count} {why}" for why, count in counts.most_common())
