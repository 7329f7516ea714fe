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
        if self.file.endswith(".png"):
            return [self.file, f"{self.file.removesuffix('.png')}.pdf"]
        return [self.file]


@dataclass(frozen=True)
class Drawing:
    """What a figure or a table has besides its kind.

    Attributes
    ----------
    names : values of the wildcards, and other names in the title and the caption
    inputs
        Files by parameter of the function: a file, or lists and dictionaries of files.
    options : the other arguments of the function
    may_end
        Start and week of runs that may end before that week. Their files are in
        `inputs["members"]` by run.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    inputs: Arguments = field(default_factory=dict)
    options: Arguments = field(default_factory=dict)
    may_end: tuple[str, float] | None = None


@dataclass(frozen=True, eq=False)
class Figure(Drawing):
    """A figure or a table of a study, with the inputs and the options of its kind."""

    kind: Kind = field(kw_only=True)

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
        kind = self.kind
        return {
            "name": kind.name,
            "section": kind.section,
            "title": kind.title,
            "caption": kind.caption,
            "technical": kind.technical,
            "first": kind.first,
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


def figure_of(kind: Kind, drawing: Drawing) -> Figure:
    """Return a figure of a kind, with the inputs and the options of both."""
    inputs = {}
    for key, file in kind.inputs.items():
        inputs[key] = file.format(**drawing.names, published=PUBLISHED)
    return Figure(
        kind=kind,
        names=drawing.names,
        inputs=inputs | dict(drawing.inputs),
        options={**kind.options, **drawing.options},
        may_end=drawing.may_end,
    )


def files_in(inputs: Any) -> list[str]:
    """Return all files in nested lists and dictionaries, each once."""
    if isinstance(inputs, str):
        return [inputs]
    if isinstance(inputs, Mapping):
        inputs = inputs.values()
    elif not isinstance(inputs, list):
        return []
    files: list[str] = []
    for item in inputs:
        files += files_in(item)
    return list(dict.fromkeys(files))


def target_files(figures: Iterable[Figure], *targets: str) -> list[str]:
    """Return the files that targets include."""
    files: list[str] = []
    for figure in figures:
        if set(targets) & set(figure.kind.targets):
            files += figure.files
    return files


def by_rule(figures: Iterable[Figure]) -> dict[str, list[list[Figure]]]:
    """Return the figures by rule and job; figures of one job have the same
    wildcards."""
    jobs: dict[tuple[str, str], list[Figure]] = {}
    for figure in figures:
        if figure.kind.draw:
            job = (figure.kind.rule, repr(figure.wildcards))
            jobs.setdefault(job, []).append(figure)
    rules: dict[str, list[list[Figure]]] = {}
    for (rule, _), same_job in jobs.items():
        rules.setdefault(rule, []).append(same_job)
    return rules


def observed_name(brains: Iterable[Brain]) -> str:
    """Return the name of observed brains in figures and tables: their populations if
    known.

    Several populations are listed with their weeks. Brains of unknown population are
    called "observed brain"; shapes are called by their kind if they share one.
    """
    weeks: dict[str, list[float]] = {}
    shapes = set()
    for brain in brains:
        if brain.config.shape is not None:
            shapes.add(brain.config.shape.kind)
        else:
            name = brain.config.population or OBSERVED_BRAIN
            weeks.setdefault(name, []).append(brain.week)
    names = list(weeks)
    if len(names) > 1:
        names = []
        for name, of_name in weeks.items():
            ends = sorted({min(of_name), max(of_name)})
            names.append(f"{name} ({'-'.join(f'{week:g}' for week in ends)} GW)")
    if len(shapes) == 1:
        names.append(shapes.pop())
    elif shapes:
        names.append("simple shape")
    return " or ".join(names) or OBSERVED_BRAIN
