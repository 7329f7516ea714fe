"""Figures and tables of a study as records: what draws each, from which files, and what the report says of it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..settings.terms import REAL_BRAIN
from .records import Brain, Measured, Simulation

AROUND = ["left", "right", "top", "bottom"]
THREE_SIDES = ["left", "top", "bottom"]


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of figure or table: what draws it, and what the report says of it.

    Attributes
    ----------
    name : of its log, and of the rule that draws it where `job` names no other
    pattern : the file with wildcards: a PNG, which a PDF stands beside, an HTML page, or JSON
    draw
        The function that draws it, as `module:function` of `gyriflow.report`; empty if a rule of its own makes it.
    section, title, caption
        Where and how the report shows it, the caption in reStructuredText. Names of a figure stand in braces. Without
        a section it is no part of the text.
    technical : whether the report collapses it
    target : the target that asks for it; empty if only the target `paper` does
    paper : whether the target `paper` asks for it
    job : the rule that draws several kinds at once
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
    inputs : the files that the function draws, by its parameters: a file, or lists and dictionaries of files
    options : what else the function takes
    names : its wildcards, and what else its title and caption name
    may_end
        Run, start and week of simulations that may have ended before: `inputs["members"]` has none of theirs then.
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
        """Those of its names that its path has."""
        return {key: name for key, name in self.names.items() if f"{{{key}}}" in self.kind.pattern}

    def inputs_without(self, runs: Iterable[str]) -> Mapping[str, Any]:
        """Return the inputs, None for those of members that have ended."""
        if "members" not in self.inputs:
            return self.inputs
        ended = set(runs)
        members = {run: None if run in ended else files for run, files in self.inputs["members"].items()}
        return {**self.inputs, "members": members}

    @property
    def described(self) -> dict[str, Any]:
        """What the report says of it, with its file."""
        keys = ("name", "section", "title", "caption", "technical")
        return {**{key: getattr(self.kind, key) for key in keys}, "path": self.path, "names": dict(self.names)}


def files_in(inputs: Any) -> list[str]:
    """Return the files in lists and dictionaries, each once."""
    if isinstance(inputs, str):
        return [inputs]
    if not isinstance(inputs, Mapping | list):
        return []
    items = inputs.values() if isinstance(inputs, Mapping) else inputs
    return list(dict.fromkeys(file for item in items for file in files_in(item)))


def asked_for(figures: Iterable[Figure], *targets: str) -> list[str]:
    """Return the files that targets ask for, those of the paper for "paper"."""
    return [
        file
        for figure in figures
        if figure.kind.target in targets or (figure.kind.paper and "paper" in targets)
        for file in figure.files
    ]


def by_rule(figures: Iterable[Figure]) -> dict[str, list[list[Figure]]]:
    """Return what is drawn by each rule, job by job: figures of one job have the same wildcards."""
    rules: dict[str, dict[tuple[tuple[str, str], ...], list[Figure]]] = {}
    for figure in figures:
        if figure.kind.draw:
            jobs = rules.setdefault(figure.kind.rule, {})
            jobs.setdefault(tuple(figure.wildcards.items()), []).append(figure)
    return {rule: list(jobs.values()) for rule, jobs in rules.items()}


def measured_name(brains: Iterable[Brain]) -> str:
    """Return the name of measured brains in figures and tables: their populations if known.

    Several populations are listed with their weeks. Real brains of unknown population are called "real brain"; shapes
    are called by their kind if they share one.
    """
    populations: dict[str, set[float]] = {}
    kinds = set()
    for brain in brains:
        if brain.given.shape is not None:
            kinds.add(brain.given.shape.kind)
        else:
            populations.setdefault(brain.given.population or REAL_BRAIN, set()).add(brain.week)
    names = list(populations)
    if len(names) > 1:
        spans = ("-".join(f"{week:g}" for week in sorted({min(ws), max(ws)})) for ws in populations.values())
        names = [f"{name} ({span} GW)" for name, span in zip(names, spans, strict=True)]
    if kinds:
        names.append(kinds.pop() if len(kinds) == 1 else "simple shape")
    return " or ".join(names) or REAL_BRAIN


def halves_of(row: Measured) -> list[list[str]]:
    """Return the hemispheres of a measured brain, each with its maps."""
    return [list(pair) for pair in zip(row.hemispheres, row.maps, strict=True)]


def regions_of(row: Measured) -> list[list[str]]:
    """Return the hemispheres of a measured brain, each with its regions."""
    return [list(pair) for pair in zip(row.hemispheres, row.regions.values(), strict=True)]


def surfaces_by_week(simulation: Simulation) -> dict[float, str]:
    """Return the surfaces of the simulated brains by week."""
    return {row.week: row.parts["whole"] for row in simulation.measured}


def measured_by_week(*simulations: Simulation) -> dict[float, Brain]:
    """Return the measured brains that simulations are shown beside, by week."""
    return {week: brain for simulation in simulations for week, brain in simulation.measured_by_week.items()}
