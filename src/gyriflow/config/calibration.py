"""Calibration: which parameters are searched, between which bounds, and what is to be met."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated

from pydantic import Field, ValidationError

from ..parameters.calibration import AMPLITUDE, MOST_PARAMETERS, MOST_RUNS, SCORES, STIFFNESS_RATIO, Score
from ..parameters.folding import VARYING
from ..parameters.messages import messages
from ..parameters.settings import Problem, Settings, check, setting
from ..parameters.varying import Varying
from .brains import Brain
from .runs import Run
from .studies import NOT_VARIED, changed, comparison_problems

CURVES = ("follow.area_cm2", "follow.volume_ml")
"""Further curves than those of parameters that may vary."""


class Calibration(Settings):
    """A search for the parameters whose brain is nearest to the real one of a week.

    First come runs spread over the bounds (a scrambled Sobol sequence), then rounds of runs where a Gaussian process
    through the scores expects the most. Runs that diverge count as worse than all others.
    """

    base: str = setting(..., "", "Name of the run that all runs of the calibration differ from.")
    parameters: dict[str, tuple[Annotated[float, Field(allow_inf_nan=False)], ...]] = setting(
        ..., "",
        "One to three keys of `folding` with their lowest and highest values, such as `{thickness_mm: [1, 3]}`; inner "
        "keys with dots. `stiffness_ratio` is the cortex's shear modulus over the core's; `KEY.amplitude` scales the "
        "curve that KEY is in the base run, estimated ones and those of `follow` too.",
    )  # fmt: skip
    score: dict[Score, Annotated[float, Field(gt=0)]] = setting(
        ..., "",
        "What is to be least: one or more of " + ", ".join(f"`{name}`" for name in SCORES) + ", each with its weight "
        "in the sum (docs/metrics.md).",
    )  # fmt: skip
    compare_week: float = setting(..., "GW", "Week of the comparison, at which the runs end.", gt=15, le=45)
    compare_with: tuple[str, ...] | None = setting(
        None, "", "Ids of the brains of that week to be met, whose mean score counts; `null`: as in `studies`."
    )
    first_runs: int = setting(12, "", "Runs of the first round.", ge=3, le=MOST_RUNS)
    rounds: int = setting(3, "", "Rounds after the first.", ge=0, le=20)
    runs_per_round: int = setting(4, "", "Runs of each of these rounds.", ge=1, le=MOST_RUNS)
    seed: int = setting(0, "", "Of the sequence and of the surrogate.", ge=0)

    @check
    def _few(self) -> Iterator[Problem]:
        if not 1 <= len(self.parameters) <= MOST_PARAMETERS:
            yield Problem(f"found {len(self.parameters)}; expected 1 to {MOST_PARAMETERS}", ("parameters",))
        if (total := self.first_runs + self.rounds * self.runs_per_round) > MOST_RUNS:
            yield Problem(f"first_runs and rounds make {total} runs; expected at most {MOST_RUNS}", ("rounds",))

    @check
    def _bounds(self) -> Iterator[Problem]:
        for key, bounds in self.parameters.items():
            if len(bounds) != 2 or not bounds[0] < bounds[1]:
                yield Problem(f"found {list(bounds)}; expected the lowest and the highest value", ("parameters", key))

    @check
    def _scored(self) -> Iterator[Problem]:
        if not self.score:
            yield Problem(f"found nothing; expected one or more of {', '.join(SCORES)}", ("score",))

    @property
    def runs(self) -> dict[str, int]:
        """The round of each run by the run's name."""
        sizes = [self.first_runs, *[self.runs_per_round] * self.rounds]
        rounds = [number for number, size in enumerate(sizes) for _ in range(size)]
        return {f"calibration-{index:02d}": number for index, number in enumerate(rounds)}


def calibration_problems(
    calibration: Calibration | None, runs: Mapping[str, Run], brains: Sequence[Brain]
) -> Iterator[Problem]:
    """Yields what is wrong between the calibration, the runs and the brains."""
    if calibration is None:
        return
    here = ("calibrate",)
    weeks = {brain.id: brain.week for brain in brains if brain.has("id", "week")}
    if calibration.has("compare_week", "compare_with"):
        yield from comparison_problems(calibration, weeks, here)
    for name in calibration.runs if calibration.has("first_runs", "rounds", "runs_per_round") else ():
        if name in runs:
            yield Problem("the name is that of a run of the calibration; choose another", ("runs", name))
    if not calibration.has("base", "parameters"):
        return
    if calibration.base not in runs:
        yield Problem(f"found {calibration.base!r}; expected a run: {', '.join(runs)}", (*here, "base"))
        return
    for key, bounds in calibration.parameters.items():
        for text in _parameter_problems(key, bounds, runs[calibration.base]):
            yield Problem(text, (*here, "parameters", key))


def _parameter_problems(key: str, bounds: Sequence[float], base: Run) -> Iterator[str]:
    if key.endswith(AMPLITUDE):
        yield from _amplitude_problems(key.removesuffix(AMPLITUDE), bounds, base)
    elif key == STIFFNESS_RATIO:
        if isinstance(base.shear_modulus_core_pa, Varying):
            yield "the core's shear modulus varies in the base run; expected a number"
        elif min(bounds) <= 0:
            yield f"found {min(bounds):g}; it should be above 0"
    elif key in NOT_VARIED:
        yield "cannot be calibrated"
    else:
        for bound in bounds:
            try:
                changed(base, {key: bound})
            except KeyError:
                yield "there is no such key of folding"
                return
            except ValidationError as error:
                yield from dict.fromkeys(text for _, text in messages(error, Run))


def _amplitude_problems(key: str, bounds: Sequence[float], base: Run) -> Iterator[str]:
    if min(bounds) <= 0:
        yield f"found {min(bounds):g}; it should be above 0"
    if key in CURVES:
        if base.follow is None:
            yield "the base run follows no curve"
        return
    value = getattr(base, key, None) if key in VARYING else None
    if value != "estimated" and not (isinstance(value, Varying) and value.weeks):
        yield f"{key} is no curve in the base run"
