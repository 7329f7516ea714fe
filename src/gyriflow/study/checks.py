"""Checks of sections against each other: names, starts, runs, growth, metrics, sweeps,
calibration."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..io.files import read_json
from ..io.yaml_files import SCHEMES
from ..names import DEVICE, column_part, folder_name, merged_names
from ..quantities import METRICS
from ..settings.base import Key, KeyProblem, Problems, did_you_mean, problems_in
from ..settings.folding import VARYING, value_problems
from ..settings.root import Config
from ..settings.runs import (
    ALL,
    FIRST,
    NOT_VARIED,
    ComparisonSettings,
    Run,
    Start,
    SweepSettings,
    changed,
    chosen_starts,
    growing_groups,
    members_of,
    variants,
)
from ..settings.terms import OBSERVED
from ..settings.varying import Varying
from ..version import RELEASE
from .atlases import used_atlases

RESERVED_BRAINS = ("study", "report", ALL, FIRST)
"""Ids that brains may not have, since they have another meaning in results, tables or
settings."""
RESULT_COLUMNS = re.compile(
    "subject|run|week|(participant_id|session_id|gestational_age|brain)_of_input|(whole|left|right)_(.+_)?("
    + "|".join(
        f"{metric.name}_{metric.unit.replace('/', '_per_')}".removesuffix("_1")
        for metric in METRICS.values()
    )
    + ")"
)
"""Columns of `metrics_wide.csv`, which covariates stand in as well."""
RESERVED_SWEEPS = (
    "calibration",
    "figures",
    "growth",
    "logs",
    "manifest",
    "matched",
    "registration",
    "tables",
    "validation",
)
"""Names that sweeps may not have, since other results of the study have folders of
these names."""
MIXED_UP = (
    "differ only in case, accents' forms or dots at the end, so some disks mix up their"
    " folders"
)


def problems_between(config: Config) -> list[KeyProblem]:
    """Return the problems between the sections of a configuration, each once."""
    checks = (
        _names,
        _run_names,
        _starts,
        _runs,
        _growth,
        _sweeps,
        _calibration,
        _metrics,
    )
    problems: list[KeyProblem] = []
    for check in checks:
        problems += check(config)
    return list(dict.fromkeys(problems))


def _names(config: Config) -> Problems:
    """Yield problems with the names of brains, runs, sweeps and schemes. Folders have
    the names of brains and runs."""
    if not config.brains and not config.atlas:
        yield KeyProblem(
            "found nothing; expected a list of brains, each with id, week and a source",
            ("brains",),
        )
    counts = Counter(brain.id for brain in config.brains)
    for name, count in counts.items():
        if count > 1:
            yield KeyProblem(
                f"{count} brains have the id {name}; ids are unique", ("brains",)
            )
        if folder_name(name) in RESERVED_BRAINS:
            yield KeyProblem(f"the id {name} is reserved; choose another", ("brains",))
    for first, second in merged_names(counts, folder_name):
        yield KeyProblem(
            f"the ids {first} and {second} {MIXED_UP}; rename one", ("brains",)
        )
    for first, second in merged_names(config.sweeps, folder_name):
        yield KeyProblem(
            f"the sweeps {first} and {second} {MIXED_UP}; rename one",
            ("sweeps", second),
        )
    named: list[tuple[str, Key]] = [(name, ("brains",)) for name in counts]
    named += [(name, ("runs", name)) for name in config.runs]
    named += [(name, ("sweeps", name)) for name in config.sweeps]
    for name, key in named:
        if DEVICE.fullmatch(name):
            yield KeyProblem(
                f"found {name}, a device on Windows, whose disks have no folder of this"
                " name; choose another",
                key,
            )
    taken = [("runs", name) for name in config.runs if name == OBSERVED]
    taken += [("schemes", name) for name in config.schemes if name in SCHEMES]
    for name in config.sweeps:
        if folder_name(name) in RESERVED_SWEEPS:
            taken.append(("sweeps", name))
    for key in taken:
        yield KeyProblem("the name is taken; choose another", key)
    yield from _covariates(config)
    schemes = dict.fromkeys([*SCHEMES, *config.schemes])
    for number, brain in enumerate(config.brains):
        if brain.scheme not in (None, *schemes):
            expected = f"expected one of {', '.join(schemes)}, or a name of schemes"
            yield KeyProblem(
                f"found {brain.scheme!r}; {expected}", ("brains", number, "scheme")
            )


def _covariates(config: Config) -> Problems:
    """Yield the first brain with each covariate that has the name of a column."""
    found = set()
    for number, brain in enumerate(config.brains):
        for name in brain.covariates:
            if name not in found and RESULT_COLUMNS.fullmatch(name):
                found.add(name)
                yield KeyProblem(
                    "is the name of a column of the results (metrics_wide.csv); rename"
                    " the covariate",
                    ("brains", number, "covariates", name),
                )


def _starts(config: Config) -> Problems:
    """Yield problems of the start brains of the study and of its runs."""
    yield from _start_problems(config.start, config, ("start",))
    for name, run in config.runs.items():
        yield from _start_problems(
            run.start,
            config,
            ("runs", name, "start"),
        )
    if config.start is None and any(run.start is None for run in config.runs.values()):
        yield KeyProblem(
            "is missing; it is the id of the brain that is folded, a list of ids,"
            " or all",
            ("start",),
        )


def _start_problems(
    start: Start | None,
    config: Config,
    key: Key,
) -> Problems:
    if start in (None, ALL, FIRST) or not config.brains:
        return
    ids = [start] if isinstance(start, str) else list(start or ())
    if not ids:
        yield KeyProblem("found no ids; expected one or more", key)
    twice = [name for name, count in Counter(ids).items() if count > 1]
    if twice:
        yield KeyProblem(f"found {', '.join(twice)} more than once", key)
    yield from _unknown(ids, config, key)


def _unknown(
    ids: Iterable[str],
    config: Config,
    key: Key,
) -> Problems:
    brains = [brain.id for brain in config.brains]
    for name in dict.fromkeys(ids):
        if name not in brains:
            hint = did_you_mean(name, brains)
            yield KeyProblem(f"found {name!r}, which is not a brain; {hint}", key)


def _runs(config: Config) -> Problems:
    """Yield problems between the settings of each run and its start brains."""
    weeks = {brain.id: brain.week for brain in config.brains}
    for name, run in config.runs.items():
        problems: list[KeyProblem] = []
        start = config.start if run.start is None else run.start
        starts = chosen_starts(start, list(weeks))
        for brain in starts:
            called = f"the week of the start brain {brain}"
            problems += value_problems(run, weeks[brain], {}, called)
        if not starts:
            # check the values at the end
            problems += value_problems(run, run.end_week - 1e-9, {}, "the start")
        for key in VARYING:
            value = getattr(run, key)
            has_surface = isinstance(value, Varying) and value.surface is not None
            if has_surface and len(starts) > 1:
                text = (
                    "has a map on a surface, which belongs to one brain; the run"
                    f" starts from {', '.join(starts)}"
                )
                problems.append(KeyProblem(text, (key,)))
        for problem in problems:
            yield problem.inside(
                *_section(
                    name,
                    str(problem.key[0]),
                    config,
                )
            )


def _section(
    run: str,
    key: str,
    config: Config,
) -> Key:
    """Return the section to change a key of a run in: `folding` if all runs have the
    same value."""
    own = getattr(config.runs[run], key)
    for settings in config.runs.values():
        if getattr(settings, key) != own:
            return ("runs", run)
    return ("folding",)


def _run_names(config: Config) -> Problems:
    """Yield runs with the name of another one. Runs of all sections have folders next
    to each other."""
    earlier: dict[str, str] = {}
    for name, owner, key in _named_runs(config):
        run = f"the run {name} of {owner}"
        first = earlier.setdefault(folder_name(name), run)
        if first != run:
            yield KeyProblem(
                f"{run} and {first} would share a folder; choose names that differ in"
                " more than case, accents' forms or dots at the end",
                key,
            )


def _named_runs(config: Config) -> Iterator[tuple[str, str, Key]]:
    """Yield each run's name, what it is of, and the key with which its name is
    changed."""
    if config.calibrate is not None:
        for name in config.calibrate.runs:
            yield name, "the calibration", ("calibrate",)
    for run, settings in config.runs.items():
        for name in members_of(run, settings):
            yield name, f"the ensemble of {run}", ("runs", run)
    for name in config.runs:
        yield name, "the section runs", ("runs", name)
    for sweep, varied in config.sweeps.items():
        for name, values in variants(sweep, varied):
            yield name, f"the sweep {sweep} ({values})", ("sweeps", sweep)


def _growth(config: Config) -> Problems:
    """Yield problems between brains and growth series."""
    settings = config.growth
    lists: dict[Key, Sequence[str]] = {}
    if settings.brains and isinstance(settings.brains, Mapping):
        for name, ids in settings.brains.items():
            everyone = [brain.id for brain in config.brains]
            lists["growth", "brains", name] = everyone if ALL in ids else ids
    elif settings.brains is not None:
        lists["growth", "brains"] = list(settings.brains)
    unknown: list[KeyProblem] = []
    for key, names in lists.items():
        unknown += _unknown(names, config, key)
    yield from unknown
    if unknown:
        return
    for key, names in lists.items():
        members = [config.brain(brain) for brain in names]
        weeks = {brain.week for brain in members}
        if len(weeks) < 2:
            yield KeyProblem(
                f"found brains of {len(weeks)} week(s); growth needs two or more", key
            )
        populations = {
            brain.population or "of no known population" for brain in members
        }
        is_named = len(key) > 2
        if is_named and len(populations) > 1:
            yield KeyProblem(
                f"found brains {' and '.join(sorted(populations))}; a growth curve is"
                " of one population",
                key,
            )
    groups = growing_groups(config.brains, settings.brains)
    series = Counter(name for name, _ in groups)
    for name, count in series.items():
        if count > 1:
            yield KeyProblem(
                f"{count} growth series would have the name {name}; rename a subject or"
                " a population",
                ("growth", "brains"),
            )
    if settings.series is not None and series and settings.series not in series:
        yield KeyProblem(
            f"found {settings.series!r}; the series are {', '.join(series)}",
            ("growth", "series"),
        )


def norm_settings(config: Config) -> dict[str, Any]:
    """Return the version and the settings that the norms of metrics depend on.

    They are compared key by key with those that norms were made with. Norms of a study
    (`_norms_problems`) have to have all keys here; the record of the shipped atlases
    (`metrics.atlas_curves`) only those that it has, since it is valid for any version
    and any schemes.
    """
    return {
        "version": RELEASE,
        # raised with the definition of a metric or of the norms
        "norms": 3,
        "open_sulci": config.surface.open_sulci,
        "edge_length_mm": config.surface.edge_length_mm,
        "curvature_radius_mm": config.metrics.curvature_radius_mm,
        "spangy_modes": config.metrics.spangy_modes,
        "spangy_mass": config.metrics.spangy_mass,
        "spectra": "mean_curvature",
        "schemes": sorted({brain.scheme for brain in config.brains if brain.scheme}),
    }


def _norms_problems(path: str, expected: Mapping[str, Any]) -> Iterator[str]:
    """Yield in what the norms of a file cannot be used with the expected
    `norm_settings`."""
    try:
        content = read_json(path)
    except InputError as error:
        yield str(error)
        return
    content = content if isinstance(content, dict) else {}
    made_with = content.get("made_with")
    norms = content.get("norms")
    if not isinstance(made_with, dict) or not isinstance(norms, list) or not norms:
        yield f"{path}: expected the results/study/norms.json of a study"
        return
    for name, value in expected.items():
        found = made_with.get(name)
        # a study may have fewer label schemes than the cohort
        has_fewer_schemes = name == "schemes" and set(value) <= set(found or ())
        if found != value and not has_fewer_schemes:
            yield (
                f"{path}: made with other settings; found {name}: {found};"
                f" expected {value}, as here"
            )


def _metrics(config: Config) -> Problems:
    """Yield unknown brains in the settings of metrics, and scans of a subject in the
    same week."""
    settings = config.metrics
    atlases = {used.atlas.name for used in used_atlases(config)}
    reference = settings.norm_reference or ()
    named = {
        "norm_reference": [name for name in reference if name not in atlases],
        "regions": list(settings.regions),
        "template": [settings.template] if settings.template else [],
    }
    for key, ids in named.items():
        yield from _unknown(ids, config, ("metrics", key))
    if settings.norms is not None:
        for problem in _norms_problems(settings.norms, norm_settings(config)):
            yield KeyProblem(problem, ("metrics", "norms"))
    names: list[str] = []
    for regions in settings.regions.values():
        names += regions.names.values()
    for first, second in merged_names(names, column_part):
        yield KeyProblem(
            f"found {first!r} and {second!r}, which are one column of metrics_wide.csv;"
            " rename one",
            ("metrics", "regions"),
        )
    # regions are carried, and their asymmetry measured, on both hemispheres together
    single = [
        brain.id
        for brain in config.brains
        if brain.id in settings.regions and brain.side is not None
    ]
    if single:
        yield KeyProblem(
            f"found {', '.join(single)} with one hemisphere; expected brains with both",
            ("metrics", "regions"),
        )
    scans = Counter((brain.subject, brain.week) for brain in config.brains)
    for (subject, week), count in scans.items():
        if count > 1 and subject is not None:
            yield KeyProblem(
                f"found {count} scans of the subject {subject} in week {week:g};"
                " expected one",
                ("brains",),
            )


def _sweeps(config: Config) -> Problems:
    """Yield problems between the sweeps, the runs and the brains."""
    for name, sweep in config.sweeps.items():
        problems = [*_comparison_problems(sweep, config)]
        if sweep.base in config.runs:
            problems += _sweep_problems(sweep, config.runs[sweep.base])
        for problem in problems:
            yield problem.inside("sweeps", name)


def _sweep_problems(sweep: SweepSettings, base: Run) -> Problems:
    if not sweep.vary:
        yield KeyProblem(
            "found nothing; expected keys of folding with lists of values", ("vary",)
        )
    first_values = next(iter(sweep.vary.values()), ())
    for value in sweep.fixed_at:
        if value not in first_values:
            yield KeyProblem(
                f"found {value:g}; expected a value of the first varied key",
                ("fixed_at",),
            )
    for varied, values in sweep.vary.items():
        if not values or len(set(values)) < len(values):
            yield KeyProblem(
                f"found {list(values)}; expected one or more values, each once",
                ("vary", varied),
            )
    sections = dict.fromkeys(sweep.vary, "vary")
    sections |= dict.fromkeys(sweep.fixed, "fixed")
    for settings in sweep.fixed_at.values():
        sections |= dict.fromkeys(settings, "fixed_at")
    changes = [sweep.changes(values) for _, values in variants("", sweep)]
    yield from _varied_problems(base, sections, changes)


def _varied_problems(
    base: Run,
    sections: Mapping[str, str],
    changes: Iterable[Mapping[str, Any]],
) -> Problems:
    """Yield problems of runs that differ from a base; `sections` has where each varied
    key is."""
    fixed = [name for name in sections if name in NOT_VARIED]
    for name in fixed:
        text = "cannot be varied; leave it out, or choose another base"
        yield KeyProblem(text, (sections[name], name))
    if fixed:
        return
    for values in changes:
        try:
            run = changed(base, values)
        except KeyError as error:
            problems = [KeyProblem("is not a key of folding", error.args)]
        except ValidationError as error:
            problems = problems_in(error, Run)
        else:
            problems = list(
                value_problems(
                    run,
                    run.end_week - 1e-9,
                    {},
                )
            )
        for problem in problems:
            name = ".".join(map(str, problem.key))
            # a key that is not varied is one of the base
            yield KeyProblem(problem.text, (sections.get(name, "base"), name))


def _comparison_problems(settings: ComparisonSettings, config: Config) -> Problems:
    weeks = {brain.id: brain.week for brain in config.brains}
    week = settings.compare_week
    if settings.base not in config.runs:
        yield KeyProblem(
            f"found {settings.base!r}; expected a run: {', '.join(config.runs)}",
            ("base",),
        )
    for brain in settings.compare_with or ():
        if weeks.get(brain) != week:
            found = f"{brain}, which is not a brain"
            if brain in weeks:
                found = f"{brain}, of {weeks[brain]:g} GW"
            yield KeyProblem(
                f"found {found}; expected brains of {week:g} GW", ("compare_with",)
            )
    if settings.compare_with is None and week not in weeks.values():
        available = ", ".join(f"{other:g}" for other in sorted(set(weeks.values())))
        yield KeyProblem(
            f"found {week:g}; there are brains of {available} GW to compare with",
            ("compare_week",),
        )


def _calibration(config: Config) -> Problems:
    """Yield problems between the calibration, the runs and the brains."""
    calibrate = config.calibrate
    if calibrate is None:
        return
    problems = [*_comparison_problems(calibrate, config)]
    if calibrate.base in config.runs:
        sections = dict.fromkeys(calibrate.parameters, "parameters")
        changes = []
        for key, bounds in calibrate.parameters.items():
            changes += [{key: bound} for bound in bounds]
        problems += _varied_problems(config.runs[calibrate.base], sections, changes)
    for problem in problems:
        yield problem.inside("calibrate")
