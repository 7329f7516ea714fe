"""Which shapes runs grow towards: a start brain's own later ones, or those of another population's growth."""

from dataclasses import dataclass

from ..config.root import Config
from ..errors import InputError
from .brains import Brains
from .chains import Chains
from .paths import PIAL, TARGETS
from .runs import Runs


@dataclass(frozen=True)
class Expecting:
    """The chains of brains behind the shapes that runs with a closed loop grow towards.

    `whose` is `own` for the start's own series and `another` for another population's.
    """

    config: Config
    brains: Brains
    runs: Runs
    chains: Chains

    def whose(self, run: str) -> str:
        """Returns whose growth a run has."""
        return "another" if self.runs.expects(run) else "own"

    def targets(self, run: str, brain: str) -> str | list[str]:
        """Returns the file with the shapes that a run from a brain grows towards, none where its growth has rates."""
        base = self.runs.base(run)
        return TARGETS.format(brain=brain, whose=self.whose(base)) if self.runs.closed(base) else []

    def require_chains(self) -> None:
        """Raises InputError where no brains lead a run that grows towards shapes to its end."""
        for run, brain in self.runs.folded:
            if not self.runs.closed(run):
                continue
            end, found = self.config.run(run).end_week, self.chain(brain, self.whose(run))
            if len(found) < 2 or self.brains.week(found[-1]) < end:
                whose = "one series of another population" if self.runs.expects(run) else "the start's growth series"
                raise InputError(
                    f"run {run} from {brain} is to grow towards brains that are not there",
                    found=f"{', '.join(found)}; the last is of {self.brains.week(found[-1]):g} GW"
                    + (f"; {cause}" if (cause := self.chains.unmatched(brain)) else ""),
                    expected=f"brains of {whose} with label volumes or matched surfaces up to {end:g} GW",
                    remedy="Add them, name their series in growth.estimated_from, or set follow.loop to open.",
                )

    def chain(self, brain: str, whose: str) -> list[str]:
        """Returns the start brain, and the others through which its mesh is carried, one a week.

        Of another population they begin with the last week that is not after the start, or else its first. They go on
        to the end of the runs, as far as there are brains.
        """
        if whose == "own":
            found = self.chains.later(brain)
        else:
            series = self.config.another_series(brain)
            week, end = self.brains.week(brain), self.config.last_week(brain)
            by_week = {self.brains.week(name): name for name in self.config.growth_series.get(series or "", [])}
            first = max((known for known in by_week if known <= week), default=min(by_week, default=week))
            last = min((known for known in by_week if known >= end), default=end)
            found = [brain, *(by_week[known] for known in sorted(by_week) if first <= known <= last)]
        return found

    def reads_only_others(self, brain: str) -> bool:
        """Returns whether what is expected of a brain is a prediction: neither a later brain that it may be compared
        with nor a later scan of its subject is behind it."""
        start, later = self.config.brain(brain), set(self.chain(brain, "another")[1:])
        own = [other for other in self.config.brains if start.subject is not None and other.subject == start.subject]
        return all(other.week <= start.week for other in (*self.brains.comparable(brain), *own) if other.id in later)

    def weeks(self, brain: str, whose: str) -> list[float]:
        """Returns the weeks of the brains through which a mesh is carried, without the start's."""
        return [self.brains.week(name) for name in self.chain(brain, whose)[1:]]

    def correspondences(self, brain: str, whose: str) -> list[str]:
        """Returns the files that say how each of them corresponds to the next, from the start on."""
        return self.chains.between(self.chain(brain, whose))

    def surfaces(self, brain: str, whose: str) -> list[str]:
        """Returns the pial surfaces of the others."""
        return [PIAL["whole"].format(brain=name) for name in self.chain(brain, whose)[1:]]

    def reports(self, brain: str, whose: str) -> list[str]:
        """Returns the reports of these surfaces, with their poses."""
        return [PIAL["report"].format(brain=name) for name in self.chain(brain, whose)[1:]]
