"""What simulations are compared with to tell what they are worth: which real brain in which week, and which runs."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from ..config.root import Config
from ..parameters.growth import SIZES
from ..units import week_tag
from .brains import Brains
from .chains import Chains
from .expecting import Expecting
from .measuring import Measuring
from .paths import AGREEMENT, CEILING, CURVES, DEVIATION, ONSET, PIAL, PREDICTION, READY, RUN, VALIDATION, region_files
from .runs import Runs

Kind = Literal["explained", "predicted"]


@dataclass(frozen=True)
class Validating:
    """The comparisons of runs with the real brains of their weeks."""

    config: Config
    brains: Brains
    runs: Runs
    chains: Chains
    expecting: Expecting
    measuring: Measuring

    def compared(self, run: str, brain: str) -> dict[str, str]:
        """Returns, by week after the start, the real brain that a run is compared with; none for synthetic starts."""
        if self.config.brain(brain).synthetic:
            return {}
        real = {
            week: [name for name in brains if not self.config.brain(name).synthetic]
            for week, brains in self.measuring.after_start(run, brain).items()
        }
        return {week: brains[0] for week, brains in real.items() if brains}

    @cached_property
    def pairs(self) -> list[tuple[str, str]]:
        """The runs and starts that are compared with some real brain."""
        return [pair for pair in self.runs.folded if self.compared(*pair)]

    @property
    def carried(self) -> list[tuple[str, str]]:
        """Those of them whose start's mesh is carried to later real brains."""
        return [(run, brain) for run, brain in self.pairs if brain in self.chains.carried]

    @cached_property
    def real(self) -> dict[tuple[str, str], str]:
        """The real brain by start and week."""
        return {(brain, week): real for run, brain in self.pairs for week, real in self.compared(run, brain).items()}

    @property
    def starts(self) -> list[str]:
        """The start brains of which some run is compared."""
        return list(dict.fromkeys(brain for brain, _ in self.real))

    @property
    def with_ceiling(self) -> list[str]:
        """Those of them for which registration alone is compared too."""
        return [brain for brain in self.chains.carried if brain in self.starts]

    def real_surface(self, brain: str, week: str) -> str:
        """Returns the surface of the real brain that runs from a start are compared with in a week."""
        return PIAL["whole"].format(brain=self.real[brain, week])

    def adjacent_surface(self, brain: str, week: str) -> str:
        """Returns the surface of the real brain of the latest week before one that a start may be compared with."""
        known = {
            other.week: other.id
            for other in reversed(self.config.comparable(brain))
            if other.week < float(week) and not other.synthetic
        }
        return PIAL["whole"].format(brain=known[max(known)])

    def validated(self, run: str, brain: str) -> dict[str, list[str]]:
        """Returns the surfaces that tell what a run is worth, week by week: ready ones, simulated ones, whole ones."""
        weeks = self.compared(run, brain)
        simulated = f"{RUN}/surfaces/week-{{week}}/pial.surf.gii"
        return {
            name: [pattern.format(run=run, brain=brain, week=week) for week in weeks]
            for name, pattern in {**READY, "simulated": simulated}.items()
        } | {"whole": [PIAL["whole"].format(brain=real) for real in weeks.values()]}

    def curves(self, brain: str) -> str | list[str]:
        """Returns the table of curves that the errors of runs are errors against, where there is one."""
        return CURVES["curves"] if self.config.estimated_from(brain) else []

    def kinds(self, run: str, brain: str) -> dict[float, Kind]:
        """Returns by compared week whether growth taken from brains of that week explains it, or it is predicted."""
        if self.predicts(run, brain):
            return {float(week): "predicted" for week in self.compared(run, brain)}
        kind: Kind = (
            "explained" if self.runs.grows_by(run) == "shapes" or self.runs.measured(run, *SIZES) else "predicted"
        )
        return {float(week): kind for week in self.compared(run, brain)}

    def registered(self, run: str, brain: str) -> bool:
        """Returns whether a run takes its growth from the registration that its displacement is compared with."""
        return self.runs.grows_by(run) == "shapes" and not self.predicts(run, brain)

    def ceiling_weeks(self, brain: str) -> list[float]:
        """Returns the compared weeks that a start brain's mesh is carried to."""
        later = self.chains.later_weeks(brain)[1:]
        return [float(week_tag(week)) for week in later if (brain, week_tag(week)) in self.real]

    def ceiling(self, brain: str) -> dict[str, list[str]]:
        """Returns the surfaces that tell what registration alone is worth, week by week."""
        weeks = [week_tag(week) for week in self.ceiling_weeks(brain)]
        ready = {name: [pattern.format(brain=brain, week=week) for week in weeks] for name, pattern in READY.items()}
        return ready | {"whole": [self.real_surface(brain, week) for week in weeks]}

    def onset(self, run: str, brain: str) -> dict[str, str | list[str]]:
        """Returns the surfaces in which the beginning of sulci is looked for, and how they correspond."""
        later, sides = self.chains.later(brain), self.brains.sides(brain)
        with_regions = [*self.measuring.regioned, *self.measuring.named]
        regions = region_files(f"results/brains/{later[-1]}/metrics") if later[-1] in with_regions else {}
        folder = f"results/runs/{run}/{brain}/surfaces"
        return {
            **{
                f"run_{side}": [
                    f"{folder}/week-{week}/{side}.pial.surf.gii" for week in self.runs.week_tags(run, brain)
                ]
                for side in sides
            },
            **{f"real_{side}": [PIAL[side].format(brain=name) for name in later] for side in sides},
            **regions,
            "reports": [PIAL["report"].format(brain=name) for name in later],
            "correspondences": self.chains.correspondences_later(brain),
        }

    @property
    def foretold(self) -> list[tuple[str, str]]:
        """The compared runs whose growth is another population's, and predictions from the same starts beside them."""
        starts = {brain for run, brain in self.pairs if self.predicts(run, brain)}
        return [
            (run, brain)
            for run, brain in self.pairs
            if brain in starts and "explained" not in self.kinds(run, brain).values()
        ]

    def predicts(self, run: str, brain: str) -> bool:
        """Returns whether a run has the growth of another population, and no later brain like the start is read."""
        return self.config.expects(run) and self.expecting.reads_only_others(brain)

    @property
    def expected(self) -> list[tuple[str, str]]:
        """The compared runs that tell what was to be expected of a real brain."""
        return [pair for pair in self.pairs if self.predicts(*pair)]

    def deviation(self, run: str, brain: str, week: str) -> dict[str, str | list[str]]:
        """Returns the files that tell how the real brain of a week deviates from what a run expects.

        Those of `thickness` are in the order of the surfaces; there are none where one is not known.
        """
        measured, weeks = self.measuring, (self.brains.week(brain), float(week))
        start, real = (measured.of_brain(name) for name in (brain, self.compared(run, brain)[week]))
        first, expected = (measured.simulated_at(run, brain, at) for at in weeks)
        rows = {"start": start, "first": first, "expected": expected, "real": real}
        known = all(row.thickness for row in rows.values())
        return {
            **{name: row.parts["whole"] for name, row in rows.items()},
            "thickness": [str(row.thickness) for row in rows.values()] if known else [],
            "sides": expected.hemispheres,
            "regions": list(expected.regions.values()),
        }

    def deviating(self, run: str, brain: str, week: str) -> dict[str, Any]:
        """Returns the first columns of its table."""
        real = self.config.brain(self.compared(run, brain)[week])
        return {"run": run, "start": brain, "week": real.week, "real": real.id, "subject": real.subject or real.id}

    def prediction(self, run: str, brain: str) -> dict[str, list[str]]:
        """Returns the surfaces that tell what such a run is worth, week by week, and those of the atlas."""
        weeks = self.compared(run, brain)
        patterns = {
            "simulated": f"{RUN}/surfaces/week-{{week}}/pial.surf.gii",
            **{name: READY[name] for name in ("real", "real_maps")},
        }
        return {
            **{name: [at.format(run=run, brain=brain, week=week) for week in weeks] for name, at in patterns.items()},
            "whole": [self.real_surface(brain, week) for week in weeks],
            "atlas": self.expecting.surfaces(brain, "atlas"),
        }

    @property
    def tables(self) -> dict[str, list[str]]:
        """The tables of validation by name, and the files that each is joined from."""
        return {
            "prediction": [PREDICTION.format(run=run, brain=brain) for run, brain in self.foretold],
            "deviation": [
                DEVIATION["table"].format(run=run, brain=brain, week=week)
                for run, brain in self.expected
                for week in self.compared(run, brain)
            ],
            "validation": [VALIDATION.format(run=run, brain=brain) for run, brain in self.pairs],
            "displacement_agreement": [AGREEMENT.format(run=run, brain=brain) for run, brain in self.carried],
            "registration_ceiling": [CEILING.format(brain=brain) for brain in self.with_ceiling],
            "onset": [ONSET.format(run=run, brain=brain) for run, brain in self.carried],
        }

    @property
    def week_pairs(self) -> list[tuple[str, str, float, str]]:
        """Run, start, week and real brain of all comparisons."""
        return [
            (run, brain, float(week), real)
            for run, brain in self.pairs
            for week, real in self.compared(run, brain).items()
        ]
