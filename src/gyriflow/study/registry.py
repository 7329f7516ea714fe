"""Records of the figures and tables of a study: the entries of `workflow/figures.yaml`,
and their files."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from ..io.yaml_files import read_keys
from ..settings.terms import OBSERVED_BRAIN
from ..shipped import SHIPPED
from .paths import PUBLISHED
from .records import Brain

Arguments = Mapping[str, Any]
"""Inputs or options of a drawing function, by parameter."""


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of figure or table: an entry of `workflow/figures.yaml`, which explains
    the keys."""

    name: str
    file: str
    rule: str
    draw: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    options: Arguments = field(default_factory=dict)
    each: str = "study"
    needs: str = ""
    targets: Sequence[str] = ("figures",)
    section: str = ""
    title: str = ""
    caption: str = ""
    technical: bool = False
    first: bool = False

    @property
    def outputs(self) -> list[str]:
        """The files that are written, with wildcards."""
        stem, dot, _ = self.file.rpartition(".png")
        return [self.file, f"{stem}.pdf"] if dot else [self.file]


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure or a table of a study.

    Attributes
    ----------
    names : values of the wildcards, and other names in the title and the caption
    inputs
        Files by parameter of the function: a file, or lists and dictionaries of files.
        Those of the kind are added.
    options : the other arguments of the function. Those of the kind are added.
    may_end
        Start and week of runs that may end before that week. Their files are in
        `inputs["members"]` by run.
    """

    kind: Kind
    names: Mapping[str, str] = field(default_factory=dict)
    inputs: Arguments = field(default_factory=dict)
    options: Arguments = field(default_factory=dict)
    may_end: tuple[str, float] | None = None

    def __post_init__(self) -> None:
        files = {
            key: file.format(**self.names, published=PUBLISHED)
            for key, file in self.kind.inputs.items()
        }
        object.__setattr__(self, "inputs", {**files, **self.inputs})
        object.__setattr__(self, "options", {**self.kind.options, **self.options})

    @property
    def path(self) -> str:
        return self.kind.file.format(**self.names)

    @property
    def files(self) -> list[str]:
        return [file.format(**self.names) for file in self.kind.outputs]

    @property
    def wildcards(self) -> dict[str, str]:
        """The names that occur in the path."""
        return {
            key: name
            for key, name in self.names.items()
            if f"{{{key}}}" in self.kind.file
        }

    def reached_inputs(self, reaches: Callable[[str, str, float], bool]) -> Arguments:
        """Return the inputs, with None for runs that ended before; `reaches` says of
        run, start and week if not."""
        if self.may_end is None:
            return self.inputs
        members = {
            run: files if reaches(run, *self.may_end) else None
            for run, files in self.inputs["members"].items()
        }
        return {**self.inputs, "members": members}

    @property
    def described(self) -> dict[str, Any]:
        """The text of the report, with the path."""
        keys = ("name", "section", "title", "caption", "technical", "first")
        return {
            **{key: getattr(self.kind, key) for key in keys},
            "path": self.path,
            "names": dict(self.names),
        }


@cache
def kinds() -> dict[str, Kind]:
    """Return the kinds of figures and tables by name, in the order of the report."""
    entries = read_keys(SHIPPED / "workflow" / "figures.yaml")
    return {
        name: Kind(name, **{"rule": name, **entry}) for name, entry in entries.items()
    }


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
        if not set(targets).isdisjoint(figure.kind.targets)
        for file in figure.files
    ]


def by_rule(figures: Iterable[Figure]) -> dict[str, list[list[Figure]]]:
    """Return the figures by rule and job; figures of one job have the same
    wildcards."""
    rules: dict[str, dict[tuple[tuple[str, str], ...], list[Figure]]] = {}
    for figure in figures:
        if figure.kind.draw:
            jobs = rules.setdefault(figure.kind.rule, {})
            jobs.setdefault(tuple(figure.wildcards.items()), []).append(figure)
    return {rule: list(jobs.values()) for rule, jobs in rules.items()}


def observed_name(brains: Iterable[Brain]) -> str:
    """Return the name of observed brains in figures and tables: their populations if
    known.

    Several populations are listed with their weeks. Brains of unknown population are
    called "observed brain"; shapes are called by their kind if they share one.
    """
    populations: dict[str, set[float]] = {}
    kinds = set()
    for brain in brains:
        if brain.config.shape is not None:
            kinds.add(brain.config.shape.kind)
        else:
            populations.setdefault(
                brain.config.population or OBSERVED_BRAIN, set()
            ).add(brain.week)
    names = list(populations)
    if len(names) > 1:
        ranges = (
            "-".join(f"{week:g}" for week in sorted({min(ws), max(ws)}))
            for ws in populations.values()
        )
        names = [
            f"{name} ({weeks} GW)" for name, weeks in zip(names, ranges, strict=True)
        ]
    if kinds:
        names.append(kinds.pop() if len(kinds) == 1 else "simple shape")
    return " or ".join(names) or OBSERVED_BRAIN
