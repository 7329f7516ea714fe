"""Studies: runs that differ from a base run in a few parameters, compared with real brains of one week."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, Protocol

from pydantic import Discriminator, Tag, ValidationError

from ..parameters.folding import value_problems
from ..parameters.messages import messages
from ..parameters.settings import Problem, Settings, setting
from ..parameters.terms import LONGEST_NAME
from .brains import Brain
from .runs import Run

Value = Annotated[
    Annotated[float, Tag("(number)")] | Annotated[str, Tag("(text)")],
    Discriminator(lambda value: "(text)" if isinstance(value, str) else "(number)"),
]
"""A value of a parameter that a study varies."""
NOT_VARIED = ("preset", "start", "end_week", "ranks", "output_every_gw", "fields")
"""Keys of a run that say nothing of its model, or that the study sets."""
RESERVED_STUDIES = ("benchmarks", "calibration", "figures", "growth", "logs", "registration", "tables")
"""Folders of the study's results that are no studies."""


class Compared(Protocol):
    """What is compared with real brains of a week: a study or a calibration."""

    @property
    def compare_week(self) -> float: ...

    @property
    def compare_with(self) -> tuple[str, ...] | None: ...


class Study(Settings):
    """A study: a run for each combination of the varied values, each compared with real brains of `compare_week`.

    Each run is the base run with the study's changes. It ends at the comparison week and is measured there only. Runs
    that are equal are solved once. A run that diverges is reported in the study's tables, and the others go on.
    """

    base: str = setting(..., "", "Name of the run that all runs of the study differ from.")
    vary: dict[str, tuple[Value, ...]] = setting(
        ..., "",
        "Values of one or more keys of `folding`, such as `{thickness_mm: [0.8, 1.5]}`; an inner key is written with "
        "dots (`contact.gap_mm`). With several keys each combination is a run.",
    )  # fmt: skip
    fixed: dict[str, Value] = setting(
        {}, "", "Keys of `folding` that all runs of the study have in place of the base's."
    )
    compare_week: float = setting(..., "GW", "Week at which the runs are compared with real brains.", gt=15, le=45)
    compare_with: tuple[str, ...] | None = setting(
        None, "",
        "Ids of the real brains of that week to compare with; `null`: all of the start's population or, where there "
        "are none, of any, which the tables then say.",
    )  # fmt: skip


@dataclass(frozen=True)
class Member:
    """A run of a study.

    Attributes
    ----------
    run
        Its name: that of an equal run of `runs` or of an earlier study, where there is one.
    values
        The varied values by their keys.
    settings
        Its complete settings, from its start to the week of comparison.
    """

    run: str
    values: Mapping[str, Any]
    settings: Run


def changed(run: Run, changes: Mapping[str, Any]) -> Run:
    """Returns a run with some settings changed, by keys with dots for inner ones.

    ValidationError where they are not valid; KeyError where there is no such key.
    """
    raw = run.model_dump(mode="json")
    for key, value in changes.items():
        *outer, last = key.split(".")
        place = raw
        for name in outer:
            place = place[name] if isinstance(place, dict) else {}
        if not isinstance(place, dict) or last not in place:
            raise KeyError(key)
        place[last] = value
    return type(run).model_validate(raw)


def combinations(study: Study) -> list[dict[str, Any]]:
    """Returns the varied values of each run of a study, the last key varying fastest."""
    return [dict(zip(study.vary, values, strict=True)) for values in product(*study.vary.values())]


def own_name(study: str, values: Mapping[str, Any]) -> str:
    """Returns the name of a study's run with some values."""
    return "-".join([study, *(f"{value:g}" if isinstance(value, float) else str(value) for value in values.values())])


def members_of(
    studies: Mapping[str, Study], runs: Mapping[str, Run], passes: Callable[[str, float], bool]
) -> dict[str, list[Member]]:
    """Returns the members of each study; equal ones share a run, which ends at the latest of their weeks.

    `passes` says whether a run of `runs`, by its name, has a given week among its output weeks.
    """
    wanted = [
        (name, values, changed(runs[study.base], study.fixed | values | {"end_week": study.compare_week}))
        for name, study in studies.items()
        for values in combinations(study)
    ]
    weeks: dict[str, set[float]] = {}
    for _, _, settings in wanted:
        weeks.setdefault(_model(settings), set()).add(settings.end_week)
    solved = {
        _model(run): name
        for name, run in reversed(list(runs.items()))
        if all(passes(name, week) for week in weeks.get(_model(run), ()))
    }
    members: dict[str, list[Member]] = {name: [] for name in studies}
    for name, values, settings in wanted:
        model = _model(settings)
        run = solved.setdefault(model, own_name(name, values))
        complete = runs.get(run) or changed(settings, {"end_week": max(weeks[model])})
        members[name].append(Member(run, values, complete))
    return members


def _model(run: Run) -> str:
    """Returns what makes two runs the same but for their ends and what does not change their shapes."""
    return run.model_dump_json(exclude={"end_week", "preset", "ranks", "fields"})


def real_brains(compared: Compared, start: Brain, brains: Sequence[Brain]) -> list[str]:
    """Returns the ids of the real brains that runs from a start brain are compared with."""
    if compared.compare_with is not None:
        return list(compared.compare_with)
    of_week = [brain for brain in brains if brain.week == compared.compare_week]
    own = [brain for brain in of_week if brain.population == start.population]
    return [brain.id for brain in own or of_week]


def study_problems(studies: Mapping[str, Study], runs: Mapping[str, Run], brains: Sequence[Brain]) -> Iterator[Problem]:
    """Yields what is wrong between the studies, the runs and the brains."""
    weeks = {brain.id: brain.week for brain in brains if brain.has("id", "week")}
    names: dict[str, str] = {}
    for name, study in studies.items():
        here = ("studies", name)
        if not name.replace("-", "").replace("_", "").isalnum() or not name[0].isalnum() or len(name) > LONGEST_NAME:
            text = "a study's name has letters, digits, - _ only and begins with a letter or digit"
            text = f"{text}; {LONGEST_NAME} characters at most"
            yield Problem(text, here)
        if name in RESERVED_STUDIES:
            yield Problem("the name is reserved; choose another", here)
        if study.has("base") and study.base not in runs:
            yield Problem(f"found {study.base!r}; expected a run: {', '.join(runs)}", (*here, "base"))
        elif study.has("base", "vary", "fixed", "compare_week"):
            yield from _member_problems(name, study, runs[study.base], names)
        if study.has("compare_week", "compare_with"):
            yield from comparison_problems(study, weeks, here)
    for run, key in names.items():
        if run in runs:
            yield Problem(f"has a run of the name {run}, which stands under runs too; rename one", ("studies", key))


def _member_problems(name: str, study: Study, base: Run, names: dict[str, str]) -> Iterator[Problem]:
    here = ("studies", name)
    if not study.vary:
        yield Problem("found nothing; expected keys of folding with lists of values", (*here, "vary"))
    for section, keys in (("vary", study.vary), ("fixed", study.fixed)):
        for key in keys:
            if key in NOT_VARIED:
                yield Problem("cannot differ within a study; choose another base", (*here, section, key))
                return
    for key, listed in study.vary.items():
        if not listed or len(set(listed)) < len(listed):
            yield Problem(f"found {list(listed)}; expected one or more values, each once", (*here, "vary", key))
    for values in combinations(study):
        try:
            settings = changed(base, study.fixed | values | {"end_week": study.compare_week})
        except KeyError as error:
            section = "vary" if error.args[0] in study.vary else "fixed"
            yield Problem("there is no such key of folding", (*here, section, error.args[0]))
            return
        except ValidationError as error:
            for path, text in messages(error, Run):
                key = ".".join(map(str, path))
                yield Problem(text, (*here, "vary" if key in study.vary else "fixed", key))
            continue
        own = own_name(name, values)
        if names.setdefault(own, name) != name:
            yield Problem(f"has a run of the name {own}, as the study {names[own]} has; rename one", here)
        for problem in value_problems(settings, settings.end_week - 1e-9, {}):
            yield Problem(problem.text, (*here, "vary", *problem.key))


def comparison_problems(compared: Compared, weeks: Mapping[str, float], here: tuple[str, ...]) -> Iterator[Problem]:
    """Yields what is wrong with the brains to compare with, among brains of known `weeks`."""
    known, week = sorted(set(weeks.values())), compared.compare_week
    for brain in compared.compare_with or ():
        if weeks.get(brain) != week:
            found = f"of {weeks[brain]:g} GW" if brain in weeks else "which is no brain"
            yield Problem(f"found {brain}, {found}; expected brains of {week:g} GW", (*here, "compare_with"))
    if compared.compare_with is None and week not in known:
        listed = ", ".join(f"{other:g}" for other in known)
        text = f"found {week:g}; there are brains of {listed} GW to compare with"
        yield Problem(text, (*here, "compare_week"))
