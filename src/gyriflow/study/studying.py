"""The members of studies and of the calibration, and what each is compared with."""

from dataclasses import dataclass
from typing import Any

from ..config.root import Config
from ..config.runs import Calibration
from ..units import week_tag
from .brains import Brains
from .paths import CALIBRATION, COMPARED_MEMBER, FOLDING, PARAMETERS, PIAL
from .runs import Runs


@dataclass(frozen=True)
class Studying:
    """Runs that differ from one in a few parameters, measured at one week and compared with real brains of it."""

    config: Config
    brains: Brains
    runs: Runs

    def members(self, study: str) -> list[tuple[str, str]]:
        """Returns each run of a study with each brain that it folds, in the order of the study."""
        return [
            (member.run, brain) for member in self.config.members[study] for brain in self.config.starts(member.run)
        ]

    def inputs(self, study: str) -> dict[str, list[str]]:
        """Returns what the tables of a study are made from, member by member."""
        files = {"comparisons": COMPARED_MEMBER, "params": PARAMETERS}
        files |= {"summaries": FOLDING["summary"], "zones": FOLDING["zones"]}
        members = self.members(study)
        return {
            name: [pattern.format(study=study, run=run, brain=brain) for run, brain in members]
            for name, pattern in files.items()
        }

    def rows(self, study: str) -> list[dict[str, Any]]:
        """Returns the run, the brain and the varied values of each member."""
        return [
            {"run": member.run, "subject": brain, "values": dict(member.values)}
            for member in self.config.members[study]
            for brain in self.config.starts(member.run)
        ]

    def week(self, study: str) -> float:
        """Returns the week of comparison."""
        return self.config.studies[study].compare_week

    def measured_at(self, study: str, run: str, brain: str) -> str:
        """Returns the folder of the metrics of a study's run at the week of comparison."""
        return f"results/runs/{run}/{brain}/metrics/week-{week_tag(self.week(study))}"

    def real(self, study: str, brain: str) -> list[str]:
        """Returns the real brains that the runs of a study from a brain are compared with."""
        return self.config.compared_with(self.config.studies[study], brain)

    def populations(self, study: str, brain: str) -> dict[str, str]:
        """Returns what those are called in tables."""
        return {name: self.brains.population(name) for name in self.real(study, brain)}

    def tables(self, study: str, run: str, brain: str) -> dict[str, list[str]]:
        """Returns the tables of a run at the week of comparison and of the real brains."""
        own, real = self.measured_at(study, run, brain), self.real(study, brain)
        folders = [own, *(f"results/brains/{name}/metrics" for name in real)]
        return {
            "metrics": [f"{folder}/metrics.csv" for folder in folders],
            "spectra": [f"{folder}/spectra.csv" for folder in folders],
            "similarity": [f"{own}/similarity.{name}.csv" for name in real],
        }


@dataclass(frozen=True)
class Calibrating:
    """Rounds of runs, each round's parameters chosen from the scores of the earlier ones."""

    config: Config
    runs: Runs

    @property
    def asked(self) -> Calibration:
        """What the configuration asks for; only of a configuration with a calibration."""
        assert self.config.calibrate is not None
        return self.config.calibrate

    @property
    def brains(self) -> list[str]:
        """The brains that the runs of the calibration fold."""
        return self.config.starts(self.asked.base)

    def scores_before(self, number: int) -> list[str]:
        """Returns the scores of all runs of the rounds before one."""
        return [f"{CALIBRATION}/scores/{run}.csv" for run, own in self.runs.calibrated.items() if own < number]

    def of_round(self, number: int) -> list[str]:
        """Returns the runs of a round."""
        return [run for run, own in self.runs.calibrated.items() if own == number]

    def design(self, run: str) -> str:
        """Returns the table with the parameters of a run and the others of its round."""
        return f"{CALIBRATION}/round-{self.runs.calibrated[run]}.csv"

    def base_parameters(self, brain: str) -> str:
        """Returns the file with the parameters of the base run from a brain."""
        return PARAMETERS.format(run=self.asked.base, brain=brain)

    @property
    def real(self) -> dict[str, list[str]]:
        """Returns the surfaces to be met, by the brain that is folded."""
        return {
            brain: [PIAL["whole"].format(brain=real) for real in self.config.compared_with(self.asked, brain)]
            for brain in self.brains
        }

    def summaries(self, run: str) -> list[str]:
        """Returns the summaries of the foldings of a run."""
        return [FOLDING["summary"].format(run=run, brain=brain) for brain in self.brains]
