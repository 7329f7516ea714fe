"""The figures and tables of a study, and what each is made from; `workflow/report/figures.yaml` says what they show."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..settings.terms import MAX_COLOURS, REAL_BRAIN, run_names
from .paths import BRAIN, CALIBRATION, DEVIATION, FOLDING, GROWTH, MESH, PARAMETERS, REGIONS, RUN, STUDY
from .records import Brain, Comparison, Measured, Simulation
from .study import Study

OF_STUDY, OF_RUN, OF_COMPARISON = f"{STUDY}/figures", f"{RUN}/figures", f"{STUDY}/{{study}}/figures"
AROUND = ["left", "right", "top", "bottom"]
THREE_SIDES = ["left", "top", "bottom"]
ZONES = {"contact", "no_growth", "support"}
"""Settings of a run that decide its zones: runs alike in them have one figure of these."""
FEWEST_FOR_NORMS, MOST_SERIES = 5, 4

Given = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure or a table of a study.

    Attributes
    ----------
    name : of the rule, which all figures of a kind share
    pattern : the file, a PNG, an HTML page or JSON, with wildcards; a PDF stands beside each PNG
    draw
        The function that draws it, as `module.function` of `gyriflow.report`; empty for what another rule makes.
    inputs : the files that the function takes, by its parameters: a file, or lists and dictionaries of files
    options : what else it takes
    names : its wildcards, and what else its caption names
    target : the target that asks for it; "" for one of the paper alone, which is not in the report
    paper : whether the target `paper` asks for it, too
    may_end
        Run, start and week of simulations that may have ended before: `inputs["members"]` has none of theirs then.
    """

    name: str
    pattern: str
    draw: str = ""
    inputs: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    target: str = "figures"
    paper: bool = False
    may_end: tuple[tuple[str, str, float], ...] = ()

    @property
    def path(self) -> str:
        return self.pattern.format(**self.names)

    @property
    def outputs(self) -> list[str]:
        """The files that are written, with wildcards."""
        stem, dot, _ = self.pattern.rpartition(".png")
        return [self.pattern, f"{stem}.pdf"] if dot else [self.pattern]

    def inputs_without(self, runs: Iterable[str]) -> Mapping[str, Any]:
        """Return the inputs, None for those of members that have ended."""
        if "members" not in self.inputs:
            return self.inputs
        ended = set(runs)
        members = {run: None if run in ended else files for run, files in self.inputs["members"].items()}
        return {**self.inputs, "members": members}


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
        file.format(**figure.names)
        for figure in figures
        if figure.target in targets or (figure.paper and "paper" in targets)
        for file in figure.outputs
    ]


def by_rule(figures: Iterable[Figure]) -> dict[str, dict[str, Figure]]:
    """Return what is drawn, by rule and path."""
    rules: dict[str, dict[str, Figure]] = {}
    for figure in figures:
        if figure.draw:
            rules.setdefault(figure.name, {})[figure.path] = figure
    return rules


def figures_of(study: Study) -> list[Figure]:
    """Return the figures and tables of a study, in the order of the report."""
    return [
        *_of_brains(study),
        *_of_growth(study),
        *_of_folding(study),
        *_of_metrics(study),
        *_of_validation(study),
        *(figure for comparison in study.comparisons.values() for figure in _of_comparison(study, comparison)),
        *_of_the_rest(study),
    ]


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


def _halves(row: Measured) -> list[list[str]]:
    """Return the hemispheres of what is measured, each with its maps."""
    return [[row.parts[side], f"{row.folder}/{side}.shape.gii"] for side in row.sides]


def _regions(row: Measured) -> list[list[str]]:
    """Return the hemispheres of what is measured, each with its regions."""
    return [list(pair) for pair in zip(row.hemispheres, row.regions.values(), strict=True)]


def _whole(one: Simulation) -> dict[float, str]:
    """Return the surfaces of the simulated brains by week."""
    return {row.week: row.parts["whole"] for row in one.measured}


def _measured_by_week(*runs: Simulation) -> dict[float, Brain]:
    """Return the measured brains that runs are shown beside, by week."""
    return {week: brain for one in runs for week, brain in one.measured_by_week.items()}


def _of_brains(study: Study) -> Iterator[Figure]:
    for brain in study.brains.values():
        yield from _of_brain(brain)
    ends = dict.fromkeys(pick(study.brains.values(), key=lambda brain: brain.week) for pick in (min, max))
    inputs: Given = {"runs": {}, "real": {f"{brain.id}\n{brain.week:g} GW": brain.pial for brain in ends}}
    options: Given = {"views": THREE_SIDES, "measured": ""}
    path = f"{OF_STUDY}/inputs.png"
    yield Figure("inputs_figure", path, "pictures.runs_by_week", inputs, options, target="", paper=True)
    if not study.starts:
        return
    quality = {start.id: MESH["quality"].format(brain=start.id) for start in study.starts}
    limits = study.config.mesh.model_dump()
    gates = {key: value for key, value in limits.items() if key.startswith(("min_", "max_"))}
    path = f"{STUDY}/mesh_quality.html"
    yield Figure("mesh_quality", path, "tables.mesh_quality_table", {"quality": quality}, {"gates": gates})


def _of_brain(brain: Brain) -> Iterator[Figure]:
    """Yield what the page of a measured brain has, and the pictures of its row in the report."""
    names, row, folder = {"brain": brain.id}, brain.measured, f"{BRAIN}/figures"
    yield Figure("quality_page", f"{folder}/quality.png", names=names, target="quality")
    inputs: Given = {"halves": _halves(row)}
    options: Given = {"side": row.sides[0]}
    yield Figure("small_pictures", f"{folder}/small.png", "pictures.small_pictures", inputs, options, names, "small")
    inputs = {"brains": {"": {row.week: _halves(row)}}}
    options = {"quantity": "shape_index", "views": AROUND}
    yield Figure("brain_maps", f"{folder}/shape_index.png", "pictures.shape_maps", inputs, options, names, "brain")
    if brain.has_regions:
        inputs = {"brains": {brain.id: _regions(row)}}
        path = f"{folder}/regions.png"
        yield Figure("brain_regions", path, "pictures.regions_picture", inputs, names=names, target="brain")


def _of_growth(study: Study) -> Iterator[Figure]:
    # of many subjects that are not folded, charts of metrics and change.csv tell growth; here each would have a panel
    if not study.growing or (len(study.series.brains) > MOST_SERIES and not study.folded):
        return
    # runs that follow sizes or shapes have no rate of their own
    grown = [one.settings for one in study.simulations.values() if one.settings.growth.model == "rates"]
    rate: Any = grown[0].growth_rate_per_s if grown else None
    if any(settings.growth_rate_per_s != rate for settings in grown):
        rate = None
    elif grown and not isinstance(rate, float):
        rate = dict(rate.weeks or {}) if rate.map is None else None
    options = {"measured": measured_name(brain for _, brain in study.growing), "folding_rate_per_s": rate}
    path = f"{STUDY}/growth/growth.png"
    yield Figure("growth_figure", path, "growth.growth_chart", GROWTH, options, target="growth", paper=True)


def _of_prediction(one: Simulation, beside: Brain) -> Figure:
    predicted = f"predicted\n{one.weeks[-1]:g} GW"
    brains = {f"start\n{one.start.week:g} GW": one.start.pial, predicted: one.measured[-1].parts["whole"]}
    brains[f"atlas' own brain\n{beside.week:g} GW"] = beside.pial
    options: Given = {"views": THREE_SIDES, "measured": "", "predicted": predicted}
    inputs: Given = {"runs": {}, "real": brains}
    return Figure("predicted_figure", f"{OF_RUN}/predicted.png", "pictures.runs_by_week", inputs, options, one.names)


def _of_folding(study: Study) -> Iterator[Figure]:
    if study.prediction is not None:
        yield _of_prediction(study.prediction, study.atlas_brain(study.prediction))
    for start in study.starts:
        runs = [one for one in study.folded if one.start is start]
        names, real = {"brain": start.id}, _measured_by_week(*runs)
        options = {"measured": measured_name(real.values())}
        surfaces = {week: brain.pial for week, brain in real.items()}
        inputs: Given = {"runs": {one.run: _whole(one) for one in runs}, "real": surfaces}
        path = f"{OF_STUDY}/weekly.{{brain}}.png"
        yield Figure("weekly_figure", path, "pictures.runs_by_week", inputs, options, names, paper=True)
        simulated = {one.run: {week: _whole(one)[week] for week in _measured_by_week(one)} for one in runs}
        inputs = {"runs": simulated, "real": surfaces}
        path = f"{OF_STUDY}/outlines.{{brain}}.png"
        yield Figure("outlines_figure", path, "sections.outlines_chart", inputs, options, names, paper=True)
        inputs = {"frames": {one.run: one.file(FOLDING["frames"]) for one in runs}}
        path = f"{OF_STUDY}/displacement_maps.{{brain}}.png"
        yield Figure("displacement_maps", path, "pictures.displacement_maps", inputs, names=names, paper=True)
        brains = {one.run: {row.week: _halves(row) for row in one.measured} for one in runs}
        brains[measured_name(real.values())] = {week: _halves(brain.measured) for week, brain in real.items()}
        path, quantity = f"{OF_STUDY}/shape_index.{{brain}}.png", {"quantity": "shape_index"}
        yield Figure("shape_maps", path, "pictures.shape_maps", {"brains": brains}, quantity, names)
    zones = set()
    for one in study.folded:
        if one.shapes and "growth" in one.settings.fields:
            inputs = {"frames": one.file(FOLDING["frames"]), "params": one.file(PARAMETERS)}
            growth: Given = {"quantity": "area_growth_percent_per_gw", "views": THREE_SIDES}
            path = f"{OF_RUN}/growth_found.png"
            yield Figure("growth_found_figure", path, "pictures.scalar_maps", inputs, growth, one.names)
        if (zoned := repr((one.start.id, one.settings.model_dump(include=ZONES)))) not in zones:
            zones.add(zoned)
            inputs = {name: one.file(file) for name, file in {**REGIONS, "params": PARAMETERS}.items()}
            path = f"{OF_RUN}/zones.png"
            yield Figure("zones_figure", path, "pictures.zones_picture", inputs, names=one.names, target="", paper=True)
    if not study.folded:
        return
    yield Figure("study_runs", f"{STUDY}/runs.html", target="metrics")
    table, named = {"displacement": f"{STUDY}/displacement.csv"}, {"runs": run_names(study.pairs)}
    path = f"{OF_STUDY}/displacement.png"
    yield Figure("displacement_figure", path, "growth.displacement_chart", table, named, paper=True)


def _of_metrics(study: Study) -> Iterator[Figure]:
    metrics, spectra = {"metrics": f"{STUDY}/metrics.csv"}, {"spectra": f"{STUDY}/spectra.csv"}
    # those of a group have its colour and name
    everything, groups = study.brains.values(), _groups(study)
    others = [brain for brain in everything if brain.id not in groups]
    options: Given = {"runs": run_names(study.pairs), "measured": measured_name(others or everything)}
    subjects = {brain.id: brain.subject for brain in study.brains.values() if brain.given.subject is not None}
    options |= {"subjects": subjects, "groups": groups}
    yield Figure("metrics_figure", f"{OF_STUDY}/metrics.png", "charts.metrics_chart", metrics, options)
    if study.folded:
        measured = {"measured": measured_name(everything)}
        yield Figure("metrics_table", f"{STUDY}/metrics_table.html", "tables.metrics_table", metrics, measured)
    yield Figure("spectra_figure", f"{OF_STUDY}/spectra.png", "charts.spectra_weeks_chart", spectra, options)
    reference = list(study.norm_reference)
    if len({study.brains[brain].subject for brain in reference}) >= FEWEST_FOR_NORMS:
        inputs = {**metrics, "curves": f"{STUDY}/norm_curves.csv", "norms": f"{STUDY}/norms.csv"}
        name = measured_name(study.brains[brain] for brain in reference)
        options = {**options, "measured": name, "reference": reference}
        yield Figure("norms_figure", f"{OF_STUDY}/norms.png", "charts.norms_chart", inputs, options)
    yield from _of_regions(study)


def _groups(study: Study) -> dict[str, str]:
    """Return what each measured brain is in the covariate that colours them."""
    brains, wanted = study.brains.values(), study.config.metrics.colour_by
    for name in [wanted] if wanted else dict.fromkeys(name for brain in brains for name in brain.given.covariates):
        values = {brain.id: of[name] for brain in brains if name in (of := brain.given.covariates)}
        subjects = {study.brains[brain].subject for brain in values}
        if 1 < len(set(values.values())) <= MAX_COLOURS and (wanted or len(set(values.values())) < len(subjects)):
            return {brain: f"{name}: {value}" for brain, value in values.items()}
    return {}


def _of_regions(study: Study) -> Iterator[Figure]:
    brains = [brain for brain in study.brains.values() if brain.has_regions]
    if not brains:
        return
    tables = {"regions": f"{STUDY}/regions.csv", "asymmetry": f"{STUDY}/asymmetry.csv"}
    options = {"measured": measured_name(brains)}
    yield Figure("regions_chart", f"{OF_STUDY}/regions_metrics.png", "charts.regions_chart", tables, options)
    rows = {
        f"{name}, {one.weeks[-1]:g} GW": one.measured[-1]
        for one, name in zip(study.folded, run_names(study.pairs), strict=True)
        if one.has_regions
    }
    if rows:
        rows = {brain.id: brain.measured for brain in brains} | rows
        sides = {heading: _regions(row) for heading, row in rows.items()}
        yield Figure("regions_figure", f"{OF_STUDY}/regions.png", "pictures.regions_picture", {"brains": sides})


def _of_validation(study: Study) -> Iterator[Figure]:
    options, target = {"runs": list(study.config.runs)}, "validate"
    if study.validated:
        ceiling = f"{STUDY}/registration_ceiling.csv" if study.carried else None
        inputs: Given = {"validation": f"{STUDY}/validation.csv", "ceiling": ceiling}
        path = f"{OF_STUDY}/validation.png"
        yield Figure("validation_figure", path, "scores.validation_chart", inputs, options, target=target)
    if study.predictions:
        inputs = {"prediction": f"{STUDY}/prediction.csv"}
        path = f"{OF_STUDY}/prediction.png"
        yield Figure("prediction_figure", path, "scores.prediction_chart", inputs, options, target=target)
        path = f"{STUDY}/prediction.html"
        yield Figure("prediction_table", path, "tables.prediction_table", inputs, target=target)
    for one in study.expected:
        yield from _of_expected(one)
    if study.validated_carried:
        inputs = {"onset": f"{STUDY}/onset.csv"}
        yield Figure("onset_figure", f"{OF_STUDY}/onset.png", "scores.onset_chart", inputs, options, target=target)


def _of_expected(one: Simulation) -> Iterator[Figure]:
    simulated, real = _whole(one), _measured_by_week(one)
    away = {week: [simulated[week], one.file(DEVIATION["maps"], week=week)] for week in one.real}
    # the last week and others, four at most
    weeks = sorted(away, reverse=True)[:: -(-len(away) // 4)]
    shown = {min(simulated), *weeks}
    inputs: Given = {
        "runs": {"expected": {week: surface for week, surface in simulated.items() if week in shown}},
        "real": {week: brain.pial for week, brain in real.items() if week in shown},
        "deviations": {week: away[week] for week in weeks},
    }
    options: Given = {"measured": measured_name(real.values())}
    path = f"{OF_RUN}/expected.png"
    yield Figure("expected_figure", path, "pictures.runs_by_week", inputs, options, one.names, target="validate")
    for quantity in ("log_area", "thickness_difference_mm"):
        if quantity == "log_area" or one.start.has_thickness:
            inputs = {"brains": {"real less expected": {week: [files] for week, files in away.items()}}}
            options, names = {"quantity": quantity, "views": AROUND}, {**one.names, "quantity": quantity}
            path = f"{OF_RUN}/deviation_{{quantity}}.png"
            yield Figure("deviation_figure", path, "pictures.shape_maps", inputs, options, names, target="validate")


def _of_comparison(study: Study, comparison: Comparison) -> Iterator[Figure]:
    start, week = comparison.members[0][0].start, comparison.week
    values = {one.run: dict(values) for one, values in comparison.members if one.start is start}
    rows = {one.run: one.at(week) for one, _ in comparison.members if one.start is start}
    real = comparison.real[start.id][:1]
    measured = measured_name(real)
    shared: Given = {"target": "influence_figures", "paper": True}
    shared["names"] = {"study": comparison.name, "week": f"{week:g}"}
    may_end = tuple((run, start.id, week) for run in rows)
    inputs: Given = {
        "members": {run: _halves(row) for run, row in rows.items()},
        "real": _halves(real[0].measured) if real else None,
    }
    options: Given = {"values": values, "measured": measured}
    path = f"{OF_COMPARISON}/influence.png"
    yield Figure("influence_figure", path, "pictures.influence_picture", inputs, options, may_end=may_end, **shared)
    inputs = {
        "members": {run: f"{row.folder}/spectra.csv" for run, row in rows.items()},
        "real": [f"{brain.measured.folder}/spectra.csv" for brain in real],
    }
    options = {**options, "week": week}
    path = f"{OF_COMPARISON}/spectra.png"
    yield Figure("influence_spectra", path, "charts.influence_spectra", inputs, options, may_end=may_end, **shared)
    vary = study.config.studies[comparison.name].vary
    if len(vary) == 1 and real and all(isinstance(value, int | float) for value in next(iter(vary.values()))):
        inputs = {table: f"{STUDY}/{comparison.name}/{table}.csv" for table in ("comparison", "nearest")}
        options = {"varied": next(iter(vary)), "subject": start.id, "real": [brain.id for brain in real]}
        path = f"{OF_COMPARISON}/nearest.png"
        yield Figure("nearest_figure", path, "scores.nearest_chart", inputs, options, **shared)


def _of_the_rest(study: Study) -> Iterator[Figure]:
    if study.calibration and (calibrate := study.config.calibrate):
        tables = {name: f"{CALIBRATION}/{name}.csv" for name in ("runs", "optimum")}
        path, options = f"{CALIBRATION}/calibration.png", {"score": list(calibrate.score)}
        yield Figure("calibration_figure", path, "scores.calibration_chart", tables, options, target="calibrate")
    populations = [start.given.population for start in study.starts[:1]]
    # a view of measured brains alone is none over the weeks of one brain
    real = [brain for brain in study.brains.values() if populations and brain.given.population in populations]
    runs = zip(run_names(study.pairs), study.folded, strict=True)
    inputs = {
        "runs": {name: [[row.week, _halves(row)] for row in one.measured] for name, one in runs},
        "real": [[brain.week, _halves(brain.measured)] for brain in sorted(real, key=lambda brain: brain.week)],
    }
    view = {"measured": measured_name(real)}
    yield Figure("view_surfaces", "results/report/surfaces.json", "view3d.surfaces_view", inputs, view, target="view")
    yield Figure("study_resources", f"{STUDY}/resources.html", target="report")
