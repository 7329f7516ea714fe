"""How long a run will still take, from what its jobs took so far."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from statistics import mean

LEAST_SHARE = 0.05
"""No estimate is given before this share of the expected time has passed: it would be a guess."""


@dataclass
class Pace:
    """What jobs of each rule take, in seconds: as measured elsewhere, and as measured in this run.

    Parameters
    ----------
    typical : {rule: seconds}
        What jobs took in earlier runs; rules that it does not know take as long as the middle of those it knows.
    """

    typical: Mapping[str, float]
    taken: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    def finished(self, rule: str, seconds: float) -> None:
        """Takes note of a job that is done."""
        self.taken[rule].append(seconds)

    def expected(self, rule: str) -> float:
        """Returns what a job of a rule is likely to take, in seconds."""
        if rule in self.taken:
            return mean(self.taken[rule])
        return self._typical(rule) * self._slowness()

    def left(self, waiting: Mapping[str, int], running: Iterable[tuple[str, float, float | None]], cores: int) -> float:
        """Returns the seconds left of a run.

        Parameters
        ----------
        waiting : {rule: number of jobs}
            Jobs that have not begun.
        running : (rule, seconds since it began, seconds left as the job itself says or None)
            Jobs that are on their way.
        cores
            How many jobs run side by side.
        """
        on_their_way = [max(self.expected(rule) - since, 0.0) if own is None else own for rule, since, own in running]
        total = sum(on_their_way) + sum(count * self.expected(rule) for rule, count in waiting.items())
        return max(total / max(cores, 1), max(on_their_way, default=0.0))

    def share_done(self, waiting: Mapping[str, int]) -> float:
        """Returns the share of the expected time that finished jobs make up."""
        done = sum(map(sum, self.taken.values()))
        ahead = sum(count * self.expected(rule) for rule, count in waiting.items())
        return done / (done + ahead) if done + ahead > 0 else 0.0

    def _typical(self, rule: str) -> float:
        known = sorted(self.typical.values())
        return self.typical.get(rule, known[len(known) // 2] if known else 1.0)

    def _slowness(self) -> float:
        """How many times longer than typical the jobs of this run take."""
        expected = sum(len(times) * self._typical(rule) for rule, times in self.taken.items())
        return sum(map(sum, self.taken.values())) / expected if expected > 0 else 1.0


def as_duration(seconds: float) -> str:
    """Returns a duration in words, no more exact than an estimate is."""
    if seconds < 90:
        return f"{max(5 * round(seconds / 5), 5)} s"
    if seconds < 90 * 60:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h" if seconds < 36 * 3600 else f"{seconds / 86400:.1f} days"


def as_seconds(clock: str) -> float:
    """Returns the seconds of `h:mm:ss` or `m:ss`."""
    total = 0.0
    for part in clock.split(":"):
        total = 60 * total + float(part)
    return total
