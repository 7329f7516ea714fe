"""What the log of a job says: its warnings, how far a folding is, and why it failed."""

import re
from dataclasses import dataclass
from pathlib import Path

OWN = r"^(?:[\d-]+ [\d:,]+ )?{level} (?:gyriflow[\w.]*|root|__main__): (.+)$"
WARNING = re.compile(OWN.format(level="WARNING") + r"|^warning: (.+)$", re.MULTILINE)
"""Warnings of gyriflow; those of libraries are for the log."""
STEP = re.compile(r"^GW (?P<week>[\d.]+)/(?P<end>[\d.]+) .* left (?P<left>[\d:]+)\s*$", re.MULTILINE)
"""A line of the folding's log, one a step."""
SIZE = re.compile(r"^\d+ elements, .* about \d+ MiB$", re.MULTILINE)
"""The line of the folding's log with its size and predicted memory, before the solve."""
ERROR = re.compile(OWN.format(level="ERROR"), re.MULTILINE)
UNEXPECTED = "unexpected error"
MESSAGE = re.compile(r"^gyriflow: (.+(?:\n {2,}.+)*)$", re.MULTILINE)
RAISED = re.compile(r"^(\w[\w.]*(?:Error|Exception|Interrupt|Warning)\b.*)$", re.MULTILINE)
OF_SNAKEMAKE = "WorkflowError"
"""How the names of exceptions end that say no more than that a step has failed; logs of jobs on a cluster end so."""
SLURM = re.compile(r"SLURM-job '(\d+)' failed.*SLURM status is: '(\w+)'", re.DOTALL)
"""How the executor for Slurm says in which state a job has ended."""
STATES = {
    "CANCELLED": "it was cancelled",
    "TIMEOUT": "its time ran out: more is given by --set-resources {rule}:runtime=MINUTES",
    "OUT_OF_MEMORY": "its memory ran out: more is given by --set-resources {rule}:mem_mb=MIB",
    "NODE_FAIL": "its node was lost",
    "BOOT_FAIL": "its node did not start",
    "DEADLINE": "its deadline passed",
}
"""What states of Slurm mean that say more than the job's log; a program that has failed by itself says why there."""
LINES_OF_OTHERS = 5


@dataclass(frozen=True)
class FoldingStep:
    """How far a folding is: the week simulated, the last one, and the time left as the solver puts it (`m:ss`)."""

    week: float
    end_week: float
    left: str


def warnings_in(text: str) -> list[str]:
    """Returns the warnings of gyriflow in a piece of a log, each once."""
    return list(dict.fromkeys((match[1] or match[2]).strip() for match in WARNING.finditer(text)))


def size_in(text: str) -> str:
    """Returns the size of a folding and the memory that it is to need, from a piece of its log; empty without."""
    found = SIZE.search(text)
    return found[0] if found else ""


def last_step(text: str) -> FoldingStep | None:
    """Returns the last step of a folding in a piece of its log, or None where there is none."""
    steps = list(STEP.finditer(text))
    return FoldingStep(float(steps[-1]["week"]), float(steps[-1]["end"]), steps[-1]["left"]) if steps else None


def ended_by_slurm(message: str, rule: str) -> str:
    """Returns what Slurm has done to a job, from the executor's message on it; empty where it did nothing."""
    found = SLURM.search(message)
    return f"Slurm job {found[1]}: {STATES[found[2]].format(rule=rule)}" if found and found[2] in STATES else ""


def cause(text: str) -> str:
    """Returns why a job failed, from its log: gyriflow's own message, else the exception, else the last lines."""
    of_program = [match[1] for match in MESSAGE.finditer(text)]
    if of_program:
        return of_program[0]
    errors = list(ERROR.finditer(text))
    if errors and errors[0][1].strip() != UNEXPECTED:
        # a message may go over several lines, up to the next record
        rest = text[errors[0].start(1) :]
        return re.split(r"^\d{4}-\d\d-\d\d ", rest, maxsplit=1, flags=re.MULTILINE)[0].strip()
    raised = [line for line in RAISED.findall(text) if not line.partition(":")[0].endswith(OF_SNAKEMAKE)]
    if raised:
        return f"unexpected {raised[-1]}"
    return "\n".join([line for line in text.splitlines() if line.strip()][-LINES_OF_OTHERS:])


@dataclass
class GrowingLog:
    """A log that a job is writing, read piece by piece; it need not be there yet."""

    path: Path
    read: int = 0

    def new_text(self) -> str:
        """Returns what was written since the last call, in whole lines."""
        try:
            with self.path.open("rb") as file:
                # a job that is tried again begins its log anew
                size = file.seek(0, 2)
                self.read = file.seek(self.read if self.read <= size else 0)
                piece = file.read()
        except OSError:
            return ""
        whole = piece[: piece.rfind(b"\n") + 1]
        self.read += len(whole)
        return whole.decode("utf-8", errors="replace")

    def all_text(self) -> str:
        """Returns the whole log; nothing where it cannot be read."""
        try:
            return self.path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""
