"""Checks across sections: brains, starts, runs, growth and metrics against each other, on what is valid of each."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from ..parameters.folding import GROWTH_RATES, VARYING, value_problems
from ..parameters.messages import nearest
from ..parameters.schemes import SCHEMES, SchemeSettings
from ..parameters.settings import Problem
from ..parameters.synthetic import PhantomSettings
from ..parameters.terms import LONGEST_NAME
from ..parameters.varying import Varying
from .brains import Brain
from .growth import GrowthSettings, estimated_from, growth_series
from .metrics import LEAST_AGE_WEEKS, MetricsSettings
from .runs import ALL, FIRST, Run, Start, start_ids

RESERVED_BRAINS = ("study", "report", ALL, FIRST)
"""Names that stand for something else in results, tables and settings."""
RESERVED_RUNS = ("real",)
"""What stands for the run in tables of measured brains."""


def ids_of(brains: Sequence[Brain]) -> list[str]:
    """Returns the ids of the brains, each once; wrong ones are left out."""
    return list(dict.fromkeys(brain.id for brain in brains if brain.has("id")))


def name_problems(brains: Sequence[Brain], runs: Mapping[str, Run]) -> Iterator[Problem]:
    """Yields what is wrong with the names of brains and runs, which are folders of the results."""
    counts = Counter(brain.id for brain in brains if brain.has("id"))
    for name, count in counts.items():
        if count > 1:
            yield Problem(f"{count} brains have the id {name}; ids are unique", ("brains",))
        if name in RESERVED_BRAINS:
            yield Problem(f"the id {name} is reserved; choose another", ("brains",))
    for first, second in _equal_but_for_case(counts):
        yield Problem(f"the ids {first} and {second} are the same folder on some disks; rename one", ("brains",))
    for name in runs:
        if name in RESERVED_RUNS:
            yield Problem("the name is reserved; choose another", ("runs", name))
        elif not name or not all(char.isalnum() or char in "-_." for char in name) or not name[0].isalnum():
            text = "a run's name has letters, digits, - _ . only and begins with a letter or digit"
            yield Problem(text, ("runs", name))
        elif len(name) > LONGEST_NAME:
            text = f"a run's name has {LONGEST_NAME} characters at most"
            yield Problem(text, ("runs", name))
    for first, second in _equal_but_for_case(runs):
        yield Problem(f"is the same folder as that of the run {first} on some disks; rename one", ("runs", second))


def _equal_but_for_case(names: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    first: dict[str, str] = {}
    for name in names:
        if (other := first.setdefault(name.lower(), name)) != name:
            yield other, name


def scheme_problems(brains: Sequence[Brain], schemes: Mapping[str, object]) -> Iterator[Problem]:
    """Yields names of schemes that are taken, and those of brains that are unknown."""
    for name in schemes:
        if name in SCHEMES:
            yield Problem("the name is that of a scheme of gyriflow; choose another", ("schemes", name))
    known = dict.fromkeys([*SCHEMES, *schemes])
    for number, brain in enumerate(brains):
        if brain.has("scheme") and brain.scheme is not None and brain.scheme not in known:
            expected = f"expected one of {', '.join(known)}, or a name of schemes"
            yield Problem(f"found {brain.scheme!r}; {expected}", ("brains", number, "scheme"))


def start_problems(start: Start | None, brains: Sequence[Brain], runs: Mapping[str, Run]) -> Iterator[Problem]:
    """Yields what is wrong with the start brains of the study and of its runs."""
    known = ids_of(brains)
    yield from _id_problems(start, known, ("start",))
    for name, run in runs.items():
        if run.has("start") and run.start is not None:
            yield from _id_problems(run.start, known, ("runs", name, "start"))
    without = [name for name, run in runs.items() if run.has("start") and run.start is None]
    if start is None and without:
        yield Problem("is missing; it is the id of the brain that is folded, a list of ids, or all", ("start",))


def _id_problems(start: Start | None, known: Sequence[str], key: tuple[str, ...]) -> Iterator[Problem]:
    if start is None or start in (ALL, FIRST) or not known:
        return
    names = [start] if isinstance(start, str) else list(start)
    if not names:
        yield Problem("found no ids; expected one or more", key)
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        yield Problem(f"found {', '.join(twice)} more than once", key)
    for name in dict.fromkeys(names):
        if name not in known:
            expected = f"expected the id of a brain: {', '.join(known)}"
            hint = nearest(name, known) if len(known) > 1 else ""
            hint = f"; {hint}" if hint.startswith("did you") else ""
            yield Problem(f"found {name!r}; {expected}{hint}", key)


def run_problems(start: Start | None, brains: Sequence[Brain], runs: Mapping[str, Run]) -> Iterator[Problem]:
    """Yields what is wrong between the settings of each run and its start brains."""
    weeks = {brain.id: brain.week for brain in brains if brain.has("id", "week")}
    for name, run in runs.items():
        ids = start_ids(run.start if run.has("start") and run.start is not None else start, ids_of(brains))
        starts = [(weeks[brain], f"the week of the start brain {brain}") for brain in ids if brain in weeks]
        # without a start, what holds at the end is checked
        for week, called in starts or ([(run.end_week - 1e-9, "the start")] if run.has("end_week") else []):
            for problem in value_problems(run, week, {}, called):
                yield Problem(problem.text, _place(name, problem.key, runs))
        for key in VARYING if len(ids) > 1 else ():
            value = getattr(run, key, None)
            if isinstance(value, Varying) and value.surface is not None:
                text = f"has a map on a surface, which belongs to one brain; the run starts from {', '.join(ids)}"
                yield Problem(text, _place(name, (key,), runs))


def ventricle_problems(
    start: Start | None, brains: Sequence[Brain], runs: Mapping[str, Run], schemes: Mapping[str, SchemeSettings]
) -> Iterator[Problem]:
    """Yields the runs whose ventricles are to grow by a curve of their own, from brains whose labels know none."""
    for name, run in runs.items():
        follow = run.follow if run.has("follow") else None
        if follow is None or not follow.has("ventricles_ml") or follow.ventricles_ml is None:
            continue
        ids = start_ids(run.start if run.has("start") and run.start is not None else start, ids_of(brains))
        for brain in brains:
            if brain.has("id", "source") and brain.id in ids and (cause := _no_ventricles(brain, schemes)):
                text = f"needs a start brain whose labels know ventricles; {cause}"
                yield Problem(text, _place(name, ("follow", "ventricles_ml"), runs))


def _no_ventricles(brain: Brain, schemes: Mapping[str, SchemeSettings]) -> str:
    """Returns why the labels of a brain know no ventricles; empty where they do, or their scheme is unknown."""
    if not brain.has_labels:
        return f"{brain.id} has no labels"
    if not brain.has("scheme", "phantom"):
        return ""
    scheme = brain.scheme or (brain.phantom or PhantomSettings()).scheme
    found = schemes.get(scheme, SCHEMES.get(scheme))
    return "" if found is None or found.ventricles else f"{scheme}, the scheme of {brain.id}, names none"


def _place(run: str, key: tuple[str | int, ...], runs: Mapping[str, Run]) -> tuple[str | int, ...]:
    """Returns the path of a run's key: that of `folding` where all runs share the value."""
    values = [getattr(settings, str(key[0]), None) for settings in runs.values()]
    return ("folding", *key) if all(value == values[0] for value in values) else ("runs", run, *key)


def growth_problems(
    growth: GrowthSettings, start: Start | None, brains: Sequence[Brain], runs: Mapping[str, Run]
) -> Iterator[Problem]:
    """Yields what is wrong between the brains, the series that growth rates are estimated from, and the runs."""
    given = growth.brains
    lists = dict(given) if isinstance(given, Mapping) else {"": given} if given is not None else {}
    paths = {name: ("growth", "brains", *([name] if name else [])) for name in lists}
    known = ids_of(brains)
    unknown = {name: [brain for brain in ids if brain not in known] for name, ids in lists.items()}
    for name, ids in unknown.items():
        if ids:
            yield Problem(f"found {', '.join(ids)}; expected ids of brains: {', '.join(known)}", paths[name])
    if any(unknown.values()) or not all(brain.has("id", "week", "source") for brain in brains):
        return
    weeks = {brain.id: brain.week for brain in brains}
    for name, chosen in lists.items():
        if (reason := _too_few_weeks(chosen, weeks)) is not None:
            yield Problem(reason, paths[name])
    populations = {brain.id: brain.population if brain.has("population") else None for brain in brains}
    for name, chosen in lists.items() if isinstance(given, Mapping) else ():
        mixed = sorted({populations[brain] or "of no known population" for brain in chosen})
        if len(mixed) > 1:
            yield Problem(f"found brains {' and '.join(mixed)}; a growth curve is of one population", paths[name])
    series = growth_series({brain.id: brain.kind for brain in brains}, weeks, given, populations)
    wanted = growth.estimated_from if growth.has("estimated_from") else None
    if wanted is not None and series and wanted not in series:
        yield Problem(f"found {wanted!r}; the series are {', '.join(series)}", ("growth", "estimated_from"))
    reason = _too_few_weeks([brain for ids in lists.values() for brain in ids] if lists else list(weeks), weeks)
    for name, run in runs.items():
        for key in GROWTH_RATES:
            if getattr(run, key, None) != "estimated":
                continue
            ids = start_ids(run.start if run.has("start") and run.start is not None else start, known)
            without = [brain for brain in ids if wanted is None and estimated_from(series, None, brain) is None]
            found = reason
            if found is None and without:
                plural = f"the start brain{'s' if len(without) > 1 else ''} {', '.join(without)}"
                found = (
                    f"{plural} {'are' if len(without) > 1 else 'is'} in none of the series {', '.join(series)}; name "
                    "one under growth.estimated_from"
                )
            if found is not None:
                yield Problem(f"can't be estimated: {found}", _place(name, (key,), runs))


def mesh_size_problems(
    growth: GrowthSettings, start: Start | None, brains: Sequence[Brain], runs: Mapping[str, Run]
) -> Iterator[Problem]:
    """Yields what is wrong where meshes are made for the end of the runs, by what measured brains are stretched."""
    if not all(brain.has("id", "week", "source") for brain in brains):
        return
    known = ids_of(brains)
    series = growth_series(
        {brain.id: brain.kind for brain in brains},
        {brain.id: brain.week for brain in brains},
        growth.brains,
        {brain.id: brain.population if brain.has("population") else None for brain in brains},
    )
    wanted = growth.estimated_from if growth.has("estimated_from") else None
    started = {
        brain for run in runs.values() for brain in start_ids(run.start if run.start is not None else start, known)
    }
    without = sorted(brain for brain in started if estimated_from(series, wanted, brain) is None)
    if without:
        text = (
            f"`end` needs brains of other weeks that belong with {', '.join(without)}, which tell how far the surface "
            "is stretched; list them, or give a smaller surface_edge_mm"
        )
        yield Problem(text, ("mesh", "sized_for"))


def _too_few_weeks(brains: Sequence[str], weeks: Mapping[str, float]) -> str | None:
    """Returns what is wrong with the weeks of brains that are to give growth rates, None where nothing is."""
    found = len({weeks[brain] for brain in brains})
    if found > 1:
        return None
    return f"found brains of {found} week{'' if found == 1 else 's'}; a growth rate needs two or more"


def age_reference_problems(brains: Sequence[Brain], given: Sequence[str] | None) -> Iterator[Problem]:
    """Yields what is wrong with the brains from which apparent ages are estimated."""
    if given is None:
        return
    known, key = ids_of(brains), ("metrics", "age_reference")
    if unknown := [name for name in given if name not in known]:
        yield Problem(f"found {', '.join(unknown)}; expected ids of brains: {', '.join(known)}", key)
    elif all(brain.has("week") for brain in brains):
        found = len({brain.week for brain in brains if brain.id in given})
        if found < LEAST_AGE_WEEKS:
            plural = "" if found == 1 else "s"
            yield Problem(f"found brains of {found} week{plural}; it should have {LEAST_AGE_WEEKS} or more", key)


def metrics_problems(brains: Sequence[Brain], metrics: MetricsSettings) -> Iterator[Problem]:
    """Yields brains that the metrics' settings name and that are not there, and scans of a subject of one week."""
    known = ids_of(brains)
    named = {"norm_reference": metrics.norm_reference or (), "regions": tuple(metrics.regions)}
    for key, ids in named.items():
        if unknown := [name for name in ids if name not in known]:
            text = f"found {', '.join(unknown)}; expected ids of brains: {', '.join(known)}"
            yield Problem(text, ("metrics", key))
    # the carrying of regions and their asymmetry are of both sides
    alone = [brain.id for brain in brains if brain.has("id", "hemisphere") and brain.hemisphere is not None]
    if wrong := [name for name in metrics.regions if name in alone]:
        yield Problem(f"found {', '.join(wrong)}, of one hemisphere; regions need both", ("metrics", "regions"))
    scans: dict[tuple[str, float], int] = Counter(
        (brain.subject, brain.week) for brain in brains if brain.has("subject", "week") and brain.subject is not None
    )
    for (subject, week), count in scans.items():
        if count > 1:
            yield Problem(f"{count} scans of the subject {subject} are of week {week:g}; expected one", ("brains",))
