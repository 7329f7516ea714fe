"""Checks across sections that are valid each: names, starts, runs, growth, metrics, studies, calibration."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from pydantic import ValidationError

from ..io.yaml_files import SCHEMES
from ..parameters.folding import VARYING, value_problems
from ..parameters.settings import Key, Problem, messages, nearest
from ..parameters.terms import AMPLITUDE, LONGEST_NAME, STIFFNESS_RATIO
from ..parameters.varying import Varying
from .brains import Brain
from .root import Config
from .runs import (
    ALL,
    CURVES,
    FIRST,
    NOT_VARIED,
    Compared,
    Run,
    Start,
    Study,
    changed,
    variants,
)

RESERVED_BRAINS = ("study", "report", ALL, FIRST)
"""Names that stand for something else in results, tables and settings."""
RESERVED_RUNS = ("real",)
"""What stands for the run in tables of measured brains."""
RESERVED_STUDIES = ("benchmarks", "calibration", "figures", "growth", "logs", "registration", "tables")
"""Folders of the study's results that are no studies."""


def _place(run: str, key: Key, config: Config) -> Key:
    """Returns the path of a run's key: that of `folding` where all runs share the value."""
    values = [getattr(settings, str(key[0])) for settings in config.runs.values()]
    return ("folding", *key) if all(value == values[0] for value in values) else ("runs", run, *key)


def _unknown(names: Iterable[str], known: Sequence[str], key: Key) -> Iterator[Problem]:
    if unknown := [name for name in names if name not in known]:
        yield Problem(f"found {', '.join(unknown)}; expected ids of brains: {', '.join(known)}", key)


def names(config: Config) -> Iterator[Problem]:
    """Yields what is wrong with the names of brains, runs and schemes, of which the first are folders of the results.

    A study without brains is told here, too.
    """
    if not config.brains and not config.atlas:
        yield Problem("found nothing; expected a list of brains, each with id, week and a source", ("brains",))
    counts = Counter(brain.id for brain in config.brains)
    for name, count in counts.items():
        if count > 1:
            yield Problem(f"{count} brains have the id {name}; ids are unique", ("brains",))
        if name in RESERVED_BRAINS:
            yield Problem(f"the id {name} is reserved; choose another", ("brains",))
    for first, second in _equal_but_for_case(counts):
        yield Problem(f"the ids {first} and {second} are the same folder on some disks; rename one", ("brains",))
    for name in config.runs:
        yield from _name_problems("run", name, "-_.", RESERVED_RUNS, ("runs", name))
    for first, second in _equal_but_for_case(config.runs):
        text = f"is the same folder as that of the run {first} on some disks; rename one"
        yield Problem(text, ("runs", second))
    for name in config.schemes:
        if name in SCHEMES:
            yield Problem("the name is that of a scheme of gyriflow; choose another", ("schemes", name))
    known = dict.fromkeys([*SCHEMES, *config.schemes])
    for number, brain in enumerate(config.brains):
        if brain.scheme not in (None, *known):
            expected = f"expected one of {', '.join(known)}, or a name of schemes"
            yield Problem(f"found {brain.scheme!r}; {expected}", ("brains", number, "scheme"))


def _name_problems(what: str, name: str, marks: str, reserved: Sequence[str], key: Key) -> Iterator[Problem]:
    if name in reserved:
        yield Problem("the name is reserved; choose another", key)
    elif not name or not all(char.isalnum() or char in marks for char in name) or not name[0].isalnum():
        allowed = f"letters, digits, {' '.join(marks)} only"
        yield Problem(f"a {what}'s name has {allowed} and begins with a letter or digit", key)
    elif len(name) > LONGEST_NAME:
        yield Problem(f"a {what}'s name has {LONGEST_NAME} characters at most", key)


def _equal_but_for_case(given: Iterable[str]) -> Iterator[tuple[str, str]]:
    first: dict[str, str] = {}
    for name in given:
        if (other := first.setdefault(name.lower(), name)) != name:
            yield other, name


def starts(config: Config) -> Iterator[Problem]:
    """Yields what is wrong with the start brains of the study and of its runs."""
    known = [brain.id for brain in config.brains]
    yield from _id_problems(config.start, known, ("start",))
    for name, run in config.runs.items():
        yield from _id_problems(run.start, known, ("runs", name, "start"))
    if config.start is None and any(run.start is None for run in config.runs.values()):
        yield Problem("is missing; it is the id of the brain that is folded, a list of ids, or all", ("start",))


def _id_problems(start: Start | None, known: Sequence[str], key: Key) -> Iterator[Problem]:
    if start is None or start in (ALL, FIRST) or not known:
        return
    ids = [start] if isinstance(start, str) else list(start)
    if not ids:
        yield Problem("found no ids; expected one or more", key)
    if twice := [name for name, count in Counter(ids).items() if count > 1]:
        yield Problem(f"found {', '.join(twice)} more than once", key)
    for name in dict.fromkeys(ids):
        if name not in known:
            hint = nearest(name, known) if len(known) > 1 else ""
            hint = f"; {hint}" if hint.startswith("did you") else ""
            yield Problem(f"found {name!r}; expected the id of a brain: {', '.join(known)}{hint}", key)


def runs(config: Config) -> Iterator[Problem]:
    """Yields what is wrong between the settings of each run and its start brains."""
    for name, run in config.runs.items():
        brains = [config.brain(brain) for brain in config.starts(name)]
        weeks = [(brain.week, f"the week of the start brain {brain.id}") for brain in brains]
        # without a start, what holds at the end is checked
        for week, called in weeks or [(run.end_week - 1e-9, "the start")]:
            for problem in value_problems(run, week, {}, called):
                yield Problem(problem.text, _place(name, problem.key, config))
        for key in VARYING if len(brains) > 1 else ():
            value = getattr(run, key)
            if isinstance(value, Varying) and value.surface is not None:
                ids = ", ".join(brain.id for brain in brains)
                text = f"has a map on a surface, which belongs to one brain; the run starts from {ids}"
                yield Problem(text, _place(name, (key,), config))


def growth(config: Config) -> Iterator[Problem]:
    """Yields what is wrong between the brains, and the series that growth is measured on."""
    given, brains = config.growth.brains, {brain.id: brain for brain in config.brains}
    lists = dict(given) if isinstance(given, Mapping) else {"": given} if given is not None else {}
    paths = {name: ("growth", "brains", *([name] if name else [])) for name in lists}
    unknown = [problem for name, ids in lists.items() for problem in _unknown(ids, list(brains), paths[name])]
    yield from unknown
    if unknown:
        return
    for name, ids in lists.items():
        if reason := _too_few_weeks([brains[brain] for brain in ids]):
            yield Problem(reason, paths[name])
        mixed = sorted({brains[brain].population or "of no known population" for brain in ids})
        if isinstance(given, Mapping) and len(mixed) > 1:
            yield Problem(f"found brains {' and '.join(mixed)}; a growth curve is of one population", paths[name])
    series, wanted = config.growth_series, config.growth.estimated_from
    if wanted is not None and series and wanted not in series:
        yield Problem(f"found {wanted!r}; the series are {', '.join(series)}", ("growth", "estimated_from"))


def _too_few_weeks(brains: Sequence[Brain]) -> str:
    """Returns what is wrong with the weeks of brains that growth is measured on, empty where nothing is."""
    found = len({brain.week for brain in brains})
    return (
        "" if found > 1 else f"found brains of {found} week{'s' if not found else ''}; a growth rate needs two or more"
    )


def metrics(config: Config) -> Iterator[Problem]:
    """Yields brains that the metrics' settings name and that are not there, and scans of a subject of one week."""
    given, known = config.metrics, [brain.id for brain in config.brains]
    yield from _unknown(given.norm_reference or (), known, ("metrics", "norm_reference"))
    yield from _unknown(given.regions, known, ("metrics", "regions"))
    yield from _unknown([given.template] if given.template else (), known, ("metrics", "template"))
    # the carrying of regions and their asymmetry are of both sides
    if wrong := [brain.id for brain in config.brains if brain.id in given.regions and brain.hemisphere is not None]:
        yield Problem(f"found {', '.join(wrong)}, of one hemisphere; regions need both", ("metrics", "regions"))
    if given.named_sulci and given.regions:
        yield Problem("found true beside regions; expected one of the two", ("metrics", "named_sulci"))
    scans = Counter((brain.subject, brain.week) for brain in config.brains if brain.subject is not None)
    for (subject, week), count in scans.items():
        if count > 1:
            yield Problem(f"{count} scans of the subject {subject} are of week {week:g}; expected one", ("brains",))


def studies(config: Config) -> Iterator[Problem]:
    """Yields what is wrong between the studies, the runs and the brains."""
    weeks = {brain.id: brain.week for brain in config.brains}
    own: dict[str, str] = {}
    for name, study in config.studies.items():
        here = ("studies", name)
        yield from _name_problems("study", name, "-_", RESERVED_STUDIES, here)
        if study.base not in config.runs:
            yield Problem(f"found {study.base!r}; expected a run: {', '.join(config.runs)}", (*here, "base"))
        else:
            yield from _member_problems(name, study, config.runs[study.base], own)
        yield from _comparison_problems(study, weeks, here)
    for run, study_name in own.items():
        if run in config.runs:
            text = f"has a run of the name {run}, which stands under runs too; rename one"
            yield Problem(text, ("studies", study_name))


def _member_problems(name: str, study: Study, base: Run, names: dict[str, str]) -> Iterator[Problem]:
    here = ("studies", name)
    if not study.vary:
        yield Problem("found nothing; expected keys of folding with lists of values", (*here, "vary"))
    first = next(iter(study.vary.values()), ())
    for value in study.fixed_at:
        if value not in first:
            yield Problem(f"found {value:g}; expected a value of the first varied key", (*here, "fixed_at"))
    sections: list[tuple[str, Mapping[str, object]]] = [("vary", study.vary), ("fixed", study.fixed)]
    sections += [("fixed_at", keys) for keys in study.fixed_at.values()]
    for section, keys in sections:
        for key in keys:
            if key in NOT_VARIED:
                yield Problem("cannot differ within a study; choose another base", (*here, section, key))
                return
    for key, listed in study.vary.items():
        if not listed or len(set(listed)) < len(listed):
            yield Problem(f"found {list(listed)}; expected one or more values, each once", (*here, "vary", key))
    for own, values in variants(name, study):
        try:
            settings = changed(base, study.changes(values))
        except KeyError as error:
            section = next(section for section, keys in sections if error.args[0] in keys)
            yield Problem("there is no such key of folding", (*here, section, error.args[0]))
            return
        except ValidationError as error:
            for path, text in messages(error, Run):
                key = ".".join(map(str, path))
                yield Problem(text, (*here, "vary" if key in study.vary else "fixed", key))
            continue
        if names.setdefault(own, name) != name:
            yield Problem(f"has a run of the name {own}, as the study {names[own]} has; rename one", here)
        for problem in value_problems(settings, settings.end_week - 1e-9, {}):
            yield Problem(problem.text, (*here, "vary", *problem.key))


def _comparison_problems(compared: Compared, weeks: Mapping[str, float], here: Key) -> Iterator[Problem]:
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


def calibration(config: Config) -> Iterator[Problem]:
    """Yields what is wrong between the calibration, the runs and the brains."""
    found, here = config.calibrate, ("calibrate",)
    if found is None:
        return
    weeks = {brain.id: brain.week for brain in config.brains}
    yield from _comparison_problems(found, weeks, here)
    for name in found.runs:
        if name in config.runs:
            yield Problem("the name is that of a run of the calibration; choose another", ("runs", name))
    if found.base not in config.runs:
        yield Problem(f"found {found.base!r}; expected a run: {', '.join(config.runs)}", (*here, "base"))
        return
    for key, bounds in found.parameters.items():
        for text in _parameter_problems(key, bounds, config.runs[found.base]):
            yield Problem(text, (*here, "parameters", key))


def _parameter_problems(key: str, bounds: Sequence[float], base: Run) -> Iterator[str]:
    scale = key == STIFFNESS_RATIO or key.endswith(AMPLITUDE)
    if key == STIFFNESS_RATIO and isinstance(base.shear_modulus_core_pa, Varying):
        yield "the core's shear modulus varies in the base run; expected a number"
    elif scale and min(bounds) <= 0:
        yield f"found {min(bounds):g}; it should be above 0"
    if key.endswith(AMPLITUDE):
        curve = key.removesuffix(AMPLITUDE)
        value = getattr(base, curve) if curve in VARYING else None
        if curve in CURVES and base.growth.model != "sizes":
            yield "the base run follows no curve"
        elif curve not in CURVES and not (isinstance(value, Varying) and value.weeks):
            yield f"{curve} is no curve in the base run"
    elif key in NOT_VARIED:
        yield "cannot be calibrated"
    for bound in () if scale or key in NOT_VARIED else bounds:
        try:
            changed(base, {key: bound})
        except KeyError:
            yield "there is no such key of folding"
            return
        except ValidationError as error:
            yield from dict.fromkeys(text for _, text in messages(error, Run))


def problems_between(config: Config) -> list[Problem]:
    """Returns what is wrong between the sections of a configuration, each problem once."""
    every = (names, starts, runs, growth, studies, calibration, metrics)
    return list(dict.fromkeys(problem for check in every for problem in check(config)))
