"""Which shapes runs grow towards: a start brain's own later ones, or those of an atlas' growth."""

from dataclasses import dataclass
from itertools import pairwise

from ..config.root import Config
from ..errors import InputError
from ..parameters.growth import BEFORE_GW
from ..units import week_tag
from .brains import Brains
from .chains import Chains
from .paths import PIAL, TARGETS
from .runs import Runs


@dataclass(frozen=True)
class Expecting:
    """The chains of brains behind the shapes that runs grow towards.

    `whose` is `self` for the start's own series and `atlas` for another population's.
    """

    config: Config
    brains: Brains
    runs: Runs
    chains: Chains

    def whose(self, run: str) -> str:
        """Returns whose growth a run has."""
        return self.config.run(run).growth.of

    def targets(self, run: str, brain: str) -> str | list[str]:
        """Returns the file with the shapes that give a run from a brain its growth, none where sizes or rates do."""
        base = self.runs.base(run)
        return TARGETS.format(brain=brain, origin=self.whose(base)) if self.runs.grows_by(base) == "shapes" else []

    def unled(self) -> dict[str, InputError]:
        """Returns by start brain why no brains lead a run that grows towards shapes to its end.

        Runs of studies and of the calibration may end later than all others.
        """
        found: dict[str, InputError] = {}
        for run, brain, end in self.config.ends:
            if self.runs.grows_by(run) == "shapes" and (lacking := self._lacking(brain, self.whose(run), end)):
                named = f"run {run} from {brain} is to grow towards brains that are not there"
                found.setdefault(brain, InputError(named, **lacking))
        return found

    def _lacking(self, brain: str, whose: str, end: float) -> dict[str, str]:
        """Returns what leads a start brain to an end week, what should, and what to do; nothing where it is led."""
        week, weeks = self.brains.week(brain), self.weeks(brain, whose)
        found = ", ".join(f"{name} ({self.brains.week(name):g} GW)" for name in self.chain(brain, whose))
        if whose == "self":
            led, series = bool(weeks), [self.config.own_series(brain)]
            found += f"; {cause}" if (cause := self.chains.unmatched(brain)) else ""
            expected = "the start's own growth series with label volumes or matched surfaces"
            remedy = "Add later brains to its series (growth.brains), or grow by sizes or rates."
        else:
            led, series = len(weeks) > 1 and week >= weeks[0] - BEFORE_GW, self.config.other_series(brain)
            expected = "one series of another population with the same hemispheres"
            remedy = "Add an atlas of these weeks, or name one of several series in growth.estimated_from."
        if led and weeks[-1] >= end:
            return {}
        if series in ([], [""]):
            found = f"none; the growth series are {', '.join(self.config.growth_series)}"
        elif len(series) > 1:
            found = f"several series: {', '.join(series)}"
        return {"found": found, "expected": f"brains of {expected}, from {week:g} to {end:g} GW", "remedy": remedy}

    def chain(self, brain: str, whose: str) -> list[str]:
        """Returns the start brain, and the others through which its mesh is carried, one a week.

        Of another population they begin with the last week that is not after the start, or else its first. They go on
        to the end of the runs, as far as there are brains.
        """
        if whose == "self":
            return self.chains.later(brain)
        series, of = self.config.other_series(brain), self.brains.week
        names = self.config.growth_series[series[0]] if len(series) == 1 else []
        known = sorted({week_tag(of(name)): name for name in names}.values(), key=of)
        first = max((of(name) for name in known if of(name) <= of(brain)), default=of(known[0]) if known else 0)
        end = self.config.last_week(brain)
        last = min((of(name) for name in known if of(name) >= end and of(name) > first), default=end)
        return [brain, *(name for name in known if first <= of(name) <= last)]

    def reads_only_others(self, brain: str) -> bool:
        """Returns whether what is expected of a brain is a prediction: neither a later brain that it may be compared
        with nor a later scan of its subject is behind it."""
        start, later = self.config.brain(brain), set(self.chain(brain, "atlas")[1:])
        own = [other for other in self.config.brains if start.subject is not None and other.subject == start.subject]
        return all(other.week <= start.week for other in (*self.config.comparable(brain), *own) if other.id in later)

    def weeks(self, brain: str, whose: str) -> list[float]:
        """Returns the weeks of the brains through which a mesh is carried, without the start's."""
        return [self.brains.week(name) for name in self.chain(brain, whose)[1:]]

    def further_weeks(self, brain: str, whose: str) -> list[float]:
        """Returns the other weeks in which what is expected of a brain is compared."""
        known, last = {week_tag(week) for week in self.weeks(brain, whose)}, self.config.last_week(brain)
        compared = self.config.compared_weeks(brain) if whose == "atlas" else []
        return [week for week in compared if week <= last and week_tag(week) not in known]

    def posed(self, brain: str, whose: str) -> list[list[bool]]:
        """Returns for each of these brains and the next, from the start on, whether they correspond in their poses."""
        return [self.chains.in_pose(*pair) for pair in pairwise(self.chain(brain, whose))]

    def correspondences(self, brain: str, whose: str) -> list[str]:
        """Returns the files that say how each of them corresponds to the next, from the start on."""
        return self.chains.between(self.chain(brain, whose))

    def surfaces(self, brain: str, whose: str) -> list[str]:
        """Returns the pial surfaces of the others."""
        return [PIAL["whole"].format(brain=name) for name in self.chain(brain, whose)[1:]]

    def reports(self, brain: str, whose: str) -> list[str]:
        """Returns the reports of these surfaces, with their poses."""
        return [PIAL["report"].format(brain=name) for name in self.chain(brain, whose)[1:]]
