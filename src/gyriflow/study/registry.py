"""Records of the figures and tables of a study: the drawing function, the files, and the text of the report."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..settings.terms import OBSERVED_BRAIN
from .paths import RUN, STUDY
from .records import Brain, Measurement, Simulation

Arguments = dict[str, Any]
"""Inputs or options of a drawing function, by parameter."""
RUN_FIGURES, STUDY_FIGURES = f"{RUN}/figures", f"{STUDY}/figures"
AROUND = ["left", "right", "top", "bottom"]
THREE_SIDES = ["left", "top", "bottom"]


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of figure or table: the function that draws it and its text in the report.

    Attributes
    ----------
    name : name of the kind, and of its rule unless `job` is given
    pattern : path with wildcards: a PNG (a PDF is written with it) or an HTML page
    draw : the function, as `module:function` of `gyriflow.report`; empty if the file has a rule of its own
    section, title, caption
        Text of the report, the caption in reStructuredText, with the names of a figure in braces. Kinds without a
        section are not in the report.
    technical : whether the report collapses it
    target : the target that includes it; empty if only the target `paper` does
    paper : whether the target `paper` includes it
    job : name of the rule, if one job draws several kinds
    """

    name: str
    pattern: str
    draw: str = ""
    section: str = ""
    title: str = ""
    caption: str = ""
    technical: bool = False
    target: str = "figures"
    paper: bool = False
    job: str = ""

    @property
    def rule(self) -> str:
        return self.job or self.name

    @property
    def outputs(self) -> list[str]:
        """The files that are written, with wildcards."""
        stem, dot, _ = self.pattern.rpartition(".png")
        return [self.pattern, f"{stem}.pdf"] if dot else [self.pattern]


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure or a table of a study.

    Attributes
    ----------
    inputs : files by parameter of the function: a file, or lists and dictionaries of files
    options : the other arguments of the function
    names : values of the wildcards, and other names in the title and the caption
    may_end
        Run, start and week of simulations that may end before that week; their files in `inputs["members"]` are then
        left out.
    """

    kind: Kind
    inputs: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    may_end: tuple[tuple[str, str, float], ...] = ()

    @property
    def path(self) -> str:
        return self.kind.pattern.format(**self.names)

    @property
    def files(self) -> list[str]:
        return [file.format(**self.names) for file in self.kind.outputs]

    @property
    def wildcards(self) -> dict[str, str]:
        """The names that occur in the path."""
        return {key: name for key, name in self.names.items() if f"{{{key}}}" in self.kind.pattern}

    def inputs_without(self, runs: Iterable[str]) -> Mapping[str, Any]:
        """Return the inputs, with None for runs that ended before."""
        if "members" not in self.inputs:
            return self.inputs
        ended = set(runs)
        members = {run: None if run in ended else files for run, files in self.inputs["members"].items()}
        return {**self.inputs, "members": members}

    @property
    def described(self) -> dict[str, Any]:
        """The text of the report, with the path."""
        keys = ("name", "section", "title", "caption", "technical")
        return {**{key: getattr(self.kind, key) for key in keys}, "path": self.path, "names": dict(self.names)}


def files_in(inputs: Any) -> list[str]:
    """Return all files in nested lists and dictionaries, each once."""
    if isinstance(inputs, str):
        return [inputs]
    if not isinstance(inputs, Mapping | list):
        return []
    items = inputs.values() if isinstance(inputs, Mapping) else inputs
    return list(dict.fromkeys(file for item in items for file in files_in(item)))


def target_files(figures: Iterable[Figure], *targets: str) -> list[str]:
    """Return the files that targets include."""
    return [
        file
        for figure in figures
        if figure.kind.target in targets or (figure.kind.paper and "paper" in targets)
        for file in figure.files
    ]


def by_rule(figures: Iterable[Figure]) -> dict[str, list[list[Figure]]]:
    """Return the figures by rule and job; figures of one job have the same wildcards."""
    rules: dict[str, dict[tuple[tuple[str, str], ...], list[Figure]]] = {}
    for figure in figures:
        if figure.kind.draw:
            jobs = rules.setdefault(figure.kind.rule, {})
            jobs.setdefault(tuple(figure.wildcards.items()), []).append(figure)
    return {rule: list(jobs.values()) for rule, jobs in rules.items()}


def observed_name(brains: Iterable[Brain]) -> str:
    """Return the name of observed brains in figures and tables: their populations if known.

    Several populations are listed with their weeks. Brains of unknown population are called "observed brain"; shapes
    are called by their kind if they share one.
    """
    populations: dict[str, set[float]] = {}
    kinds = set()
    for brain in brains:
        if brain.config.shape is not None:
            kinds.add(brain.config.shape.kind)
        else:
            populations.setdefault(brain.config.population or OBSERVED_BRAIN, set()).add(brain.week)
    names = list(populations)
    if len(names) > 1:
        ranges = ("-".join(f"{week:g}" for week in sorted({min(ws), max(ws)})) for ws in populations.values())
        names = [f"{name} ({weeks} GW)" for name, weeks in zip(names, ranges, strict=True)]
    if kinds:
        names.append(kinds.pop() if len(kinds) == 1 else "simple shape")
    return " or ".join(names) or OBSERVED_BRAIN


def halves_of(row: Measurement) -> list[list[str]]:
    """Return the hemispheres of a brain, each with its maps."""
    return [list(pair) for pair in zip(row.hemispheres, row.maps, strict=True)]


def regions_of(row: Measurement) -> list[list[str]]:
    """Return the hemispheres of a brain, each with its regions."""
    return [list(pair) for pair in zip(row.hemispheres, row.regions.values(), strict=True)]


def surfaces_by_week(simulation: Simulation) -> dict[float, str]:
    """Return the surfaces of the simulated brains by week."""
    return {row.week: row.parts["whole"] for row in simulation.measurements}


def observed_by_week(*simulations: Simulation) -> dict[float, Brain]:
    """Return the observed brains that are shown with simulations, by week."""
    return {week: brain for simulation in simulations for week, brain in simulation.observed_with_start.items()}
