"""Checks of sections against each other: names, starts, runs, growth, metrics, studies,
calibration."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..io.files import read_json
from ..io.yaml_files import SCHEMES
from ..names import column_part, folder_name, merged_names
from ..quantities import METRICS
from ..settings.base import Key, KeyProblem, did_you_mean, messages
from ..settings.folding import VARYING, value_problems
from ..settings.root import Config
from ..settings.runs import (
    ALL,
    CURVE_KEYS,
    FIRST,
    NOT_VARIED,
    ComparisonSettings,
    Run,
    Start,
    SweepSettings,
    changed,
    growing_groups,
    growth_series,
    members_of,
    starts_of,
    variants,
)
from ..settings.terms import AMPLITUDE, MEASURED, STIFFNESS_RATIO
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
RESERVED_STUDIES = (
    "benchmarks",
    "calibration",
    "figures",
    "growth",
    "logs",
    "matched",
    "registration",
    "tables",
    "validation",
)
"""Names that sweeps may not have, since other results of the study have folders of
these names."""
NO_FOLDING_KEY = "is not a key of folding"


def problems_between(config: Config) -> list[KeyProblem]:
    """Return the problems between the sections of a configuration, each once."""
    checks = (names, run_names, starts, runs, growth, studies, calibration, metrics)
    return list(dict.fromkeys(problem for check in checks for problem in check(config)))


def names(config: Config) -> Iterator[KeyProblem]:
    """Yield problems with the names of brains, runs, studies and schemes. Folders have
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
        if name in RESERVED_BRAINS:
            yield KeyProblem(f"the id {name} is reserved; choose another", ("brains",))
    for first, second in merged_names(counts, folder_name):
        yield KeyProblem(
            f"the ids {first} and {second} differ only in case, so some disks mix up"
            " their folders; rename one",
            ("brains",),
        )
    for first, second in merged_names(config.studies, folder_name):
        text = (
            f"differs from the study {first} only in case, so some disks mix up their"
            " folders; rename one"
        )
        yield KeyProblem(text, ("studies", second))
    reserved = {"runs": (MEASURED,), "schemes": tuple(SCHEMES)}
    for section, taken in reserved.items():
        for name in sorted(set(getattr(config, section)) & set(taken)):
            yield KeyProblem("the name is taken; choose another", (section, name))
    for name in config.studies:
        if folder_name(name) in RESERVED_STUDIES:
            yield KeyProblem("the name is taken; choose another", ("studies", name))
    covariates = {
        name: number
        for number, brain in reversed([*enumerate(config.brains)])
        for name in brain.covariates
    }
    for name, number in covariates.items():
        if RESULT_COLUMNS.fullmatch(name):
            text = (
                "is the name of a column of the results (metrics_wide.csv); rename the"
                " covariate"
            )
            yield KeyProblem(text, ("brains", number, "covariates", name))
    schemes = dict.fromkeys([*SCHEMES, *config.schemes])
    for number, brain in enumerate(config.brains):
        if brain.scheme not in (None, *schemes):
            expected = f"expected one of {', '.join(schemes)}, or a name of schemes"
            yield KeyProblem(
                f"found {brain.scheme!r}; {expected}", ("brains", number, "scheme")
            )


def starts(config: Config) -> Iterator[KeyProblem]:
    """Yield problems of the start brains of the study and of its runs."""
    yield from _start_problems(config.start, config, ("start",))
    for name, run in config.runs.items():
        yield from _start_problems(run.start, config, ("runs", name, "start"))
    if config.start is None and any(run.start is None for run in config.runs.values()):
        yield KeyProblem(
            "is missing; it is the id of the brain that is folded, a list of ids,"
            " or all",
            ("start",),
        )


def _start_problems(
    start: Start | None, config: Config, key: Key
) -> Iterator[KeyProblem]:
    if start is None or start in (ALL, FIRST) or not config.brains:
        return
    ids = [start] if isinstance(start, str) else list(start)
    if not ids:
        yield KeyProblem("found no ids; expected one or more", key)
    if twice := [name for name, count in Counter(ids).items() if count > 1]:
        yield KeyProblem(f"found {', '.join(twice)} more than once", key)
    yield from _unknown(ids, config, key)


def _unknown(ids: Iterable[str], config: Config, key: Key) -> Iterator[KeyProblem]:
    brains = [brain.id for brain in config.brains]
    for name in dict.fromkeys(ids):
        if name not in brains:
            yield KeyProblem(
                f"found {name!r}, which is not a brain; {did_you_mean(name, brains)}",
                key,
            )


def runs(config: Config) -> Iterator[KeyProblem]:
    """Yield problems between the settings of each run and its start brains."""
    by_id = {brain.id: brain for brain in config.brains}
    for name, run in config.runs.items():
        brains = [by_id[brain] for brain in starts_of(config.start, run, list(by_id))]
        weeks = [
            (brain.week, f"the week of the start brain {brain.id}") for brain in brains
        ]
        # without a start brain, check the values at the end
        for week, called in weeks or [(run.end_week - 1e-9, "the start")]:
            for problem in value_problems(run, week, {}, called):
                yield KeyProblem(problem.text, _place(name, problem.key, config))
        for key in VARYING if len(brains) > 1 else ():
            value = getattr(run, key)
            if isinstance(value, Varying) and value.surface is not None:
                ids = ", ".join(brain.id for brain in brains)
                text = (
                    "has a map on a surface, which belongs to one brain; the run"
                    f" starts from {ids}"
                )
                yield KeyProblem(text, _place(name, (key,), config))


def run_names(config: Config) -> Iterator[KeyProblem]:
    """Yield runs with the name of another one. Runs of all sections have folders next
    to each other."""
    earlier: dict[str, tuple[str, str]] = {}
    for name, owner, key in _named_runs(config):
        first, of = earlier.setdefault(folder_name(name), (name, owner))
        if (first, of) != (name, owner):
            pair = f"the run {name} of {owner} and the run {first} of {of}"
            yield KeyProblem(
                f"{pair} would share a folder; choose names that differ, not only in"
                " case",
                key,
            )


def _named_runs(config: Config) -> Iterator[tuple[str, str, Key]]:
    """Yield each run's name, what it is of, and the key with which its name is
    changed."""
    for name in config.calibrate.runs if config.calibrate else ():
        yield name, "the calibration", ("calibrate",)
    for run, settings in config.runs.items():
        for name in members_of(run, settings):
            yield name, f"the ensemble of {run}", ("runs", run)
    for name in config.runs:
        yield name, "the section runs", ("runs", name)
    for study, sweep in config.studies.items():
        for name, values in variants(study, sweep):
            yield name, f"the study {study} ({values})", ("studies", study)


def _place(run: str, key: Key, config: Config) -> Key:
    values = [getattr(settings, str(key[0])) for settings in config.runs.values()]
    return (
        ("folding", *key)
        if all(value == values[0] for value in values)
        else ("runs", run, *key)
    )


def growth(config: Config) -> Iterator[KeyProblem]:
    """Yield problems between brains and growth series."""
    growth_brains = config.growth.brains
    named = dict(growth_brains) if isinstance(growth_brains, Mapping) else {}
    lists: dict[Key, Sequence[str]] = {
        ("growth", "brains", name): ids for name, ids in named.items()
    }
    if growth_brains is not None and not named:
        lists = {("growth", "brains"): list(growth_brains)}
    all_ids = [brain.id for brain in config.brains]
    lists = {
        key: all_ids if named and ALL in ids else ids for key, ids in lists.items()
    }
    unknown = [
        problem for key, ids in lists.items() for problem in _unknown(ids, config, key)
    ]
    yield from unknown
    if unknown:
        return
    for key, ids in lists.items():
        brains = [config.brain(brain) for brain in ids]
        if (weeks := len({brain.week for brain in brains})) < 2:
            yield KeyProblem(
                f"found brains of {weeks} week(s); growth needs two or more", key
            )
        mixed = sorted(
            {brain.population or "of no known population" for brain in brains}
        )
        if named and len(mixed) > 1:
            yield KeyProblem(
                f"found brains {' and '.join(mixed)}; a growth curve is of one"
                " population",
                key,
            )
    names = [name for name, _ in growing_groups(config.brains, config.growth.brains)]
    for name, count in Counter(names).items():
        if count > 1:
            text = (
                f"{count} growth series would have the name {name}; rename a subject or"
                " a population"
            )
            yield KeyProblem(text, ("growth", "brains"))
    series = growth_series(config.brains, config.growth.brains)
    preferred = config.growth.series
    if preferred is not None and series and preferred not in series:
        yield KeyProblem(
            f"found {preferred!r}; the series are {', '.join(series)}",
            ("growth", "series"),
        )


def norm_settings(config: Config) -> dict[str, Any]:
    """Return the version and the settings that the norms of metrics depend on."""
    return {
        "version": RELEASE,
        # raised with the definition of a metric or of the norms
        "norms": 2,
        "open_sulci": config.surface.open_sulci,
        "edge_length_mm": config.surface.edge_length_mm,
        **config.metrics.model_dump(
            mode="json", include={"curvature_radius_mm", "spangy_modes", "spangy_mass"}
        ),
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
    found = content.get("made_with") if isinstance(content, dict) else None
    if (
        not isinstance(found, dict)
        or not isinstance(content.get("norms"), list)
        or not content["norms"]
    ):
        yield f"{path}: expected the results/study/norms.json of a study"
        return
    for name, value in expected.items():
        # a study may have fewer label schemes than the cohort
        if found.get(name) != value and not (
            name == "schemes" and set(value) <= set(found.get(name, ()))
        ):
            yield (
                f"{path}: made with other settings; found {name}: {found.get(name)};"
                f" expected {value}, as here"
            )


def metrics(config: Config) -> Iterator[KeyProblem]:
    """Yield unknown brains in the settings of metrics, and scans of a subject in the
    same week."""
    settings = config.metrics
    atlases = {used.atlas.name for used in used_atlases(config)}
    norm = [name for name in settings.norm_reference or () if name not in atlases]
    yield from _unknown(norm, config, ("metrics", "norm_reference"))
    if settings.norms is not None:
        for problem in _norms_problems(settings.norms, norm_settings(config)):
            yield KeyProblem(problem, ("metrics", "norms"))
    yield from _unknown(settings.regions, config, ("metrics", "regions"))
    names = [
        name for given in settings.regions.values() for name in given.names.values()
    ]
    for first, second in merged_names(names, column_part):
        text = (
            f"found {first!r} and {second!r}, which are one column of metrics_wide.csv;"
            " rename one"
        )
        yield KeyProblem(text, ("metrics", "regions"))
    yield from _unknown(
        [settings.template] if settings.template else (),
        config,
        ("metrics", "template"),
    )
    # regions are carried, and their asymmetry measured, on both hemispheres together
    if wrong := [
        brain.id
        for brain in config.brains
        if brain.id in settings.regions and brain.hemisphere is not None
    ]:
        yield KeyProblem(
            f"found {', '.join(wrong)} with one hemisphere; expected brains with both",
            ("metrics", "regions"),
        )
    scans = Counter(
        (brain.subject, brain.week)
        for brain in config.brains
        if brain.subject is not None
    )
    for (subject, week), count in scans.items():
        if count > 1:
            yield KeyProblem(
                f"found {count} scans of the subject {subject} in week {week:g};"
                " expected one",
                ("brains",),
            )


def studies(config: Config) -> Iterator[KeyProblem]:
    """Yield problems between the studies, the runs and the brains."""
    for name, study in config.studies.items():
        key = ("studies", name)
        yield from _comparison_problems(study, config, key)
        if study.base in config.runs:
            yield from _member_problems(study, config.runs[study.base], key)


def _member_problems(study: SweepSettings, base: Run, key: Key) -> Iterator[KeyProblem]:
    if not study.vary:
        yield KeyProblem(
            "found nothing; expected keys of folding with lists of values",
            (*key, "vary"),
        )
    for value in study.fixed_at:
        if value not in next(iter(study.vary.values()), ()):
            yield KeyProblem(
                f"found {value:g}; expected a value of the first varied key",
                (*key, "fixed_at"),
            )
    for varied, values in study.vary.items():
        if not values or len(set(values)) < len(values):
            yield KeyProblem(
                f"found {list(values)}; expected one or more values, each once",
                (*key, "vary", varied),
            )
    fixed_at = {
        name: value
        for settings in study.fixed_at.values()
        for name, value in settings.items()
    }
    sections: dict[str, Mapping[str, object]] = {
        "vary": study.vary,
        "fixed": study.fixed,
        "fixed_at": fixed_at,
    }
    places = {
        name: (*key, section, name)
        for section, names in sections.items()
        for name in names
    }
    if wrong := [name for name in places if name in NOT_VARIED]:
        yield KeyProblem(
            "cannot differ within a study; choose another base", places[wrong[0]]
        )
        return
    for _, combination in variants("", study):
        try:
            settings = changed(base, study.changes(combination))
        except KeyError as error:
            yield KeyProblem(NO_FOLDING_KEY, places[error.args[0]])
            return
        except ValidationError as error:
            for path, text in messages(error, Run):
                name = ".".join(map(str, path))
                yield KeyProblem(text, places.get(name, (*key, "fixed", name)))
        else:
            for problem in value_problems(settings, settings.end_week - 1e-9, {}):
                yield KeyProblem(problem.text, (*key, "vary", *problem.key))


def _comparison_problems(
    settings: ComparisonSettings, config: Config, key: Key
) -> Iterator[KeyProblem]:
    weeks = {brain.id: brain.week for brain in config.brains}
    week = settings.compare_week
    if settings.base not in config.runs:
        yield KeyProblem(
            f"found {settings.base!r}; expected a run: {', '.join(config.runs)}",
            (*key, "base"),
        )
    for brain in settings.compare_with or ():
        if weeks.get(brain) != week:
            what = (
                f"of {weeks[brain]:g} GW" if brain in weeks else "which is not a brain"
            )
            yield KeyProblem(
                f"found {brain}, {what}; expected brains of {week:g} GW",
                (*key, "compare_with"),
            )
    if settings.compare_with is None and week not in weeks.values():
        available = ", ".join(
            f"{other_week:g}" for other_week in sorted(set(weeks.values()))
        )
        yield KeyProblem(
            f"found {week:g}; there are brains of {available} GW to compare with",
            (*key, "compare_week"),
        )


def calibration(config: Config) -> Iterator[KeyProblem]:
    """Yield problems between the calibration, the runs and the brains."""
    calibrate = config.calibrate
    if calibrate is None:
        return
    yield from _comparison_problems(calibrate, config, ("calibrate",))
    if calibrate.base in config.runs:
        for key, bounds in calibrate.parameters.items():
            for text in _parameter_problems(key, bounds, config.runs[calibrate.base]):
                yield KeyProblem(text, ("calibrate", "parameters", key))


def _parameter_problems(key: str, bounds: Sequence[float], base: Run) -> Iterator[str]:
    curve = key.removesuffix(AMPLITUDE)
    if key == STIFFNESS_RATIO or curve != key:
        if min(bounds) <= 0:
            yield f"found {min(bounds):g}; expected bounds above 0"
        if key == STIFFNESS_RATIO and isinstance(base.shear_modulus_core_pa, Varying):
            yield "the core's shear modulus varies in the base run; expected a number"
        if curve != key and not _is_curve(curve, base):
            yield f"{curve} is not a curve in the base run"
    elif key in NOT_VARIED:
        yield "cannot be calibrated"
    else:
        for bound in bounds:
            try:
                changed(base, {key: bound})
            except KeyError:
                yield NO_FOLDING_KEY
                return
            except ValidationError as error:
                yield from dict.fromkeys(text for _, text in messages(error, Run))


def _is_curve(key: str, base: Run) -> bool:
    value = getattr(base, key) if key in VARYING else None
    if key in CURVE_KEYS:
        return key.removeprefix("growth.") in base.growth.definition.keys
    return isinstance(value, Varying) and bool(value.weeks)
