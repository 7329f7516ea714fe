"""The figures and tables of a study: what each is called, is made from and shows, and for which runs and brains."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

from ..config.root import Config
from ..parameters.measures import SHAPE_MEASURES
from ..parameters.terms import ELEMENTS_NEEDED, run_names
from .brains import Brains
from .chains import Chains
from .measuring import Measured, Measuring
from .paths import BRAIN, CALIBRATION, DEVIATION, FOLDING, GROWTH, MESH, PARAMETERS, PIAL, REGIONS, RUN, STUDY
from .runs import Runs
from .studying import Studying
from .validating import Validating

Wildcards = Mapping[str, str]
STUDY_FIGURES = f"{STUDY}/figures"
INFLUENCE = f"{STUDY}/{{study}}/figures"
WEEKLY = f"{STUDY_FIGURES}/weekly.{{brain}}.png"
AROUND = ("left", "right", "top", "bottom")
ZONES = ("contact", "no_growth", "support", "medial_wall")


def nothing(**_: str) -> dict[str, Any]:
    """Returns no inputs or options."""
    return {}


@dataclass(frozen=True)
class Figure:
    """A row of the registry: a figure, or a table of the report.

    Attributes
    ----------
    name
        Name of its rule.
    section, title, caption
        Where it stands in the report, its heading, and what is said of it: reStructuredText, in which wildcards stand
        in braces; a caption may name the `week` of a study, and what a map `shows`.
    path
        The file, a PNG or an HTML page, with wildcards. A PDF stands beside each PNG.
    draw
        The function that draws it, as `module.function` of `gyriflow.report`; empty for what another rule makes.
    inputs
        From the wildcards to the files that the function takes, by its parameters: a file, or lists and dictionaries
        of files.
    options
        From the wildcards to what else it takes.
    of
        The wildcards of all that is made.
    target
        The target that asks for it.
    paper
        Whether the target `paper` does, too.
    technical
        Whether it is for those who look into the mesh or the solver: folded away in the report, and drawn only where
        `report.figures` is "all".
    """

    name: str
    section: str
    title: str
    path: str
    draw: str = ""
    caption: str = ""
    inputs: Callable[..., dict[str, Any]] = nothing
    options: Callable[..., dict[str, Any]] = nothing
    of: tuple[Wildcards, ...] = ({},)
    target: str = "figures"
    paper: bool = False
    technical: bool = False

    @property
    def module(self) -> str:
        """The module of the function that draws it."""
        return self.draw.rpartition(".")[0]

    @property
    def function(self) -> str:
        """The name of the function that draws it."""
        return self.draw.rpartition(".")[2]

    @property
    def outputs(self) -> list[str]:
        """The files that are written, with wildcards."""
        return [self.path, self.path.removesuffix("png") + "pdf"] if self.path.endswith(".png") else [self.path]

    def made(self) -> list[str]:
        """Returns all files that are asked for."""
        return [output.format(**wildcards) for wildcards in self.of for output in self.outputs]

    def files(self, **wildcards: str) -> list[str]:
        """Returns the files that one of them is made from, each once."""
        return list(dict.fromkeys(_files(self.inputs(**wildcards))))


def _files(inputs: Any) -> Iterator[str]:
    if isinstance(inputs, str):
        yield inputs
    elif isinstance(inputs, Mapping | list | tuple):
        for item in inputs.values() if isinstance(inputs, Mapping) else inputs:
            yield from _files(item)


@dataclass(frozen=True)
class Figures:
    """The registry for a configuration."""

    config: Config
    brains: Brains
    runs: Runs
    chains: Chains
    measuring: Measuring
    validating: Validating
    studying: Studying
    reaches: Callable[[str, str, float], bool] = lambda run, brain, week: True
    """Whether a run from a brain has come to a week, which is known once it is solved."""

    @cached_property
    def all(self) -> tuple[Figure, ...]:
        """The rows, in the order of the report."""
        return (
            *self._of_brains,
            *self._of_growth,
            *self._of_folding,
            *self._of_metrics,
            *self._of_validation,
            *self._of_studies,
            *self._of_calibration,
            *self._of_resources,
        )

    @property
    def drawn(self) -> list[Figure]:
        """The rows that have rules of their own."""
        return [figure for figure in self.all if figure.draw]

    def target(self, *names: str) -> list[str]:
        """Returns the files that targets ask for, those of the paper for "paper"."""
        return [
            file
            for row in self.all
            if (row.target in names and self._wanted(row)) or (row.paper and "paper" in names)
            for file in row.made()
        ]

    def _wanted(self, figure: Figure) -> bool:
        """Returns whether the report shows a figure; what other rules make is there anyway."""
        return not (figure.technical and figure.path.endswith("png") and figure.draw) or (
            self.config.report.figures == "all"
        )

    def entries(self) -> list[dict[str, Any]]:
        """Returns what the report says of each figure and table: file, section, title and caption."""
        return [
            {
                "file": figure.path.format(**wildcards),
                "section": figure.section,
                "title": self._title(figure, wildcards),
                "caption": self._caption(figure, wildcards),
                "technical": figure.technical,
            }
            for figure in self.all
            if figure.section and self._wanted(figure)
            for wildcards in figure.of
        ]

    def _title(self, figure: Figure, wildcards: Wildcards) -> str:
        words = {key: value.removesuffix("_mm").replace("_", " ") for key, value in wildcards.items()}
        title = figure.title.format(**words)
        # the page's title names a brain that all figures of a kind are of
        one = len({of.get("brain") for of in figure.of}) == 1
        named = [value for key, value in wildcards.items() if key in ("run", "study") or (key == "brain" and not one)]
        return " · ".join([title[0].upper() + title[1:], *named])

    def _caption(self, figure: Figure, wildcards: Wildcards) -> str:
        values: dict[str, Any] = dict(wildcards)
        if "measure" in wildcards:
            values["shows"] = SHAPE_MEASURES[wildcards["measure"]].caption
        if "study" in wildcards:
            values["week"] = f"{self.studying.week(wildcards['study']):g}"
        # names in captions of the study may have braces
        return " ".join((figure.caption.format(**values) if values else figure.caption).split())

    @property
    def first(self) -> str | None:
        """The figure that stands on the first page of the report: the weeks of the first brain that is folded."""
        return WEEKLY.format(brain=self.runs.folded[0][1]) if self.runs.folded else None

    def _synthetic(self, *brains: str) -> dict[str, Any]:
        return {"synthetic": all(self.config.brain(brain).synthetic for brain in brains)}

    def _beside(self, run: str, brain: str, **_: str) -> dict[str, Any]:
        """Returns the options of figures that show simulated beside measured brains."""
        measured = self.config.measured_name(self.measuring.beside(run, brain).values())
        return {**self._synthetic(brain), "measured": measured}

    def _of_study(self, *brains: str) -> dict[str, Any]:
        """Returns the options of charts of all runs, beside measured brains that are called by some of them."""
        synthetic = self._synthetic(*self.config.start_brains)
        return {**synthetic, "measured": self.config.measured_name(brains or self.brains.ids)}

    @property
    def _runs(self) -> dict[str, Any]:
        return {"runs": run_names(self.runs.folded)}

    def _surfaces(self, run: str, brain: str) -> dict[float, Measured]:
        """Returns a run's simulated brains by week."""
        rows = [self.measuring.simulated_at(run, brain, week) for week in self.config.weeks(run, brain)]
        return {row.week: row for row in rows}

    def _real_beside(self, run: str, brain: str) -> dict[float, Measured]:
        """Returns the measured brains beside a run by week."""
        real = {row.subject: row for row in self.measuring.real}
        return {float(week): real[name] for week, name in self.measuring.beside(run, brain).items()}

    def _runs_from(self, start: str) -> list[str]:
        return [run for run, brain in self.runs.folded if brain == start]

    def _real_beside_runs(self, start: str) -> dict[float, Measured]:
        beside = [self._real_beside(run, start) for run in self._runs_from(start)]
        return {week: row for rows in beside for week, row in rows.items()}

    def _beside_runs(self, brain: str) -> dict[str, Any]:
        """Returns the options of figures that show all runs from a brain beside measured brains."""
        real = [row.subject for row in self._real_beside_runs(brain).values()]
        return {**self._synthetic(brain), "measured": self.config.measured_name(real)}

    def _deviations(self, run: str, brain: str) -> dict[float, list[str]]:
        """Returns by week the surface that a run expects and the maps of how the real brain deviates."""
        surfaces, maps = self._surfaces(run, brain), DEVIATION["maps"].format(run=run, brain=brain, week="{week}")
        weeks = self.validating.compared(run, brain)
        return {float(week): [surfaces[float(week)].parts["whole"], maps.format(week=week)] for week in weeks}

    def _expected(self, run: str, brain: str) -> dict[str, Any]:
        """Returns the brains that a run expects, the real ones, and maps, at four of the compared weeks at most."""
        deviations = self._deviations(run, brain)
        weeks = sorted(deviations, reverse=True)[:: -(-len(deviations) // 4)]
        found, real = ({w: row.parts["whole"] for w, row in rows.items() if w in (*weeks, self.brains.week(brain))}
                       for rows in (self._surfaces(run, brain), self._real_beside(run, brain)))  # fmt: skip
        return {"runs": {"expected": found}, "real": real, "deviations": {w: deviations[w] for w in weeks}}

    def _each_brain(self, brains: list[str]) -> tuple[Wildcards, ...]:
        return tuple({"brain": brain} for brain in brains)

    @property
    def _each_start(self) -> tuple[Wildcards, ...]:
        return self._each_brain(list(dict.fromkeys(brain for _, brain in self.runs.folded)))

    @property
    def _each_run(self) -> tuple[Wildcards, ...]:
        return tuple({"run": run, "brain": brain} for run, brain in self.runs.folded)

    def _each_run_with(self, chosen: Callable[[str], bool]) -> tuple[Wildcards, ...]:
        return tuple(wildcards for wildcards in self._each_run if chosen(wildcards["run"]))

    def _each_start_with(self, *settings: str) -> tuple[Wildcards, ...]:
        """Returns the first of the runs from a brain that are alike in some settings."""
        first: dict[str, Wildcards] = {}
        for wildcards in self._each_run:
            own = self.config.run(wildcards["run"]).model_dump(include=set(settings))
            first.setdefault(repr((wildcards["brain"], own)), wildcards)
        return tuple(first.values())

    @property
    def gates(self) -> dict[str, float]:
        """The limits of the quality of elements."""
        settings = self.config.mesh.model_dump()
        return {key: value for key, value in settings.items() if key.startswith(("min_", "max_"))}

    @property
    def _of_brains(self) -> Iterator[Figure]:
        ends = [pick(self.config.brains, key=lambda brain: brain.week).id for pick in (min, max)]
        ends = list(dict.fromkeys(ends))
        yield Figure(
            "overlay_figure", "Inputs", "surface over the image", f"{BRAIN}/figures/overlay.png",
            "sections.surface_overlay",
            """Pial surface of *{brain}* (line) over its image: coronal (a) and axial plane (b) through the middle,
            sagittal plane through one hemisphere (c). The surface follows the labels, whose cortex may end inside the
            bright rim of a blurred image.""",
            lambda brain: {
                "image": self.config.brain(brain).image,
                "surface": PIAL["whole"].format(brain=brain),
                "report": PIAL["report"].format(brain=brain),
            },
            lambda brain: {"affine_from": self.config.brain(brain).affine_from},
            self._each_brain(self.brains.with_image),
        )  # fmt: skip
        yield Figure(
            "inputs_figure", "Inputs", "brains that went in", f"{STUDY_FIGURES}/inputs.png", "pictures.brains_picture",
            "The youngest and the oldest brain that went in, at one scale.",
            lambda: {
                "brains": {f"{b}\n{self.brains.week(b):g} GW": PIAL["whole"].format(brain=b) for b in ends}
            },
            lambda: {**self._synthetic(*ends), "views": ["left", "top", "bottom"]},
            paper=True, technical=True,
        )  # fmt: skip
        yield Figure(
            "mesh_quality", "Inputs", "mesh quality", f"{STUDY}/mesh_quality.html", "tables.mesh_quality_page",
            """Radius ratio (3 × inscribed / circumscribed radius, 1 for a regular element), dihedral angles and volume
            of the tetrahedra, how far the mesh is from the pial surface, and how much of gaps narrower than 3 mm, as
            the fissure, is open; beside them the limits of the configuration.""",
            lambda: {"quality": {brain: MESH["quality"].format(brain=brain) for brain in self.config.start_brains}},
            lambda: {"gates": self.gates},
            technical=True,
        )  # fmt: skip
        yield Figure(
            "quality_page", "Inputs", "quality of the brain", f"{BRAIN}/figures/quality.png",
            caption="""Quality of *{brain}* before the solve: (a) the pial surface and the inner border of the cortex
            over the image or the labels, (b) the surface from several sides, (c) cortical thickness where it is known,
            else further sides, and what the steps have warned of.""",
            of=self._each_brain(self.brains.ids),
            target="quality", technical=True,
        )  # fmt: skip

    @property
    def _of_growth(self) -> Iterator[Figure]:
        series = list(self.config.growth_series)
        measured = self.config.measured_name(self.chains.grown)
        yield Figure(
            "growth_figure", "Growth", "cortical growth rates", f"{STUDY}/growth/growth.png", "growth.growth_chart",
            f"""Pial area (a; both hemispheres, without the cut at the midline) and brain volume (b) of the brains that
            were given, and the tangential growth rate between successive weeks{" (c)" if len(series) == 1 else ""},
            α = (√θ − 1)/Δt with θ the ratio of the areas. {self._series_note(series)} {self._rate_note()}""",
            lambda: dict(GROWTH),
            lambda: {
                "measured": measured,
                "folding_rate_per_s": self.chains.folding_rate_per_s,
            },
            ({},) if self.chains.grown else (),
            "growth", paper=True,
        )  # fmt: skip

    def _series_note(self, series: list[str]) -> str:
        if len(series) < 2:
            return ""
        return f"The series {', '.join(series)} are brains from different data."

    def _rate_note(self) -> str:
        rate = self.chains.folding_rate_per_s
        if not rate:
            return ""
        of = f", {1e7 * rate:.3g}·10⁻⁷ s⁻¹," if isinstance(rate, float) else ""
        return f"The dashed line is the growth rate of the simulation{of}."

    @property
    def _of_folding(self) -> Iterator[Figure]:
        at = f"{RUN}/figures"

        def files(**patterns: str) -> Callable[..., dict[str, Any]]:
            return lambda run, brain: {key: path.format(run=run, brain=brain) for key, path in patterns.items()}

        yield Figure(
            "weekly_figure", "Folding", "simulated beside measured brains", WEEKLY, "pictures.runs_by_week",
            """Runs from *{brain}* (blue) above the measured brains of the same weeks (beige), from the left and from
            above, at one scale. The first week is the start brain as it was meshed. What differs between the runs is in
            ``results/study/runs.csv``.""",
            lambda brain: {
                "runs": {
                    run: {week: row.parts["whole"] for week, row in self._surfaces(run, brain).items()}
                    for run in self._runs_from(brain)
                },
                "real": {week: row.parts["whole"] for week, row in self._real_beside_runs(brain).items()},
            },
            self._beside_runs,
            self._each_start,
            paper=True,
        )  # fmt: skip
        yield Figure(
            "outlines_figure", "Folding", "outlines over each other", f"{STUDY_FIGURES}/outlines.{{brain}}.png",
            "sections.outlines_chart",
            """Simulated brains over the measured one of the same week (black), rigidly aligned: coronal (a) and axial
            planes (b) through the middle, sagittal ones through the right hemisphere (c).""",
            lambda brain: {
                "runs": {
                    run: {
                        week: self._surfaces(run, brain)[week].parts["whole"] for week in self._real_beside(run, brain)
                    }
                    for run in self._runs_from(brain)
                },
                "real": {week: row.parts["whole"] for week, row in self._real_beside_runs(brain).items()},
            },
            self._beside_runs,
            tuple(start for start in self._each_start if self._real_beside_runs(start["brain"])),
            paper=True,
        )  # fmt: skip
        yield Figure(
            "displacement_maps", "Folding", "displacement maps", f"{STUDY_FIGURES}/displacement_maps.{{brain}}.png",
            "pictures.displacement_maps",
            """Norm of the displacement between output weeks on the pial surface, on one scale for all runs. One vertex
            in two hundred is above the scale. Ring: the largest one, dotted where it lies on the side turned away, with
            its place in RAS+ mm. The mean is over the vertices.""",
            lambda brain: {
                "frames": {run: FOLDING["frames"].format(run=run, brain=brain) for run in self._runs_from(brain)}
            },
            lambda brain: self._synthetic(brain), self._each_start, paper=True,
        )  # fmt: skip
        yield Figure(
            "contact_maps", "Folding", "contact pressure", f"{at}/contact_maps.png", "pictures.scalar_maps",
            """Pressure of contact at the output weeks of run *{run}*, the size of the contact force over the area of
            each vertex; where the model forgets stress, what a week of the present growth would build up. It is shown
            on the surface of the start, since folds hide where they press on each other.""",
            files(frames=FOLDING["frames"]),
            lambda run, brain: {
                **self._synthetic(brain),
                "views": list(AROUND),
                # stress that each step forgets is written per week
                "quantity": f"contact_pressure_pa{'' if self.config.runs[run].stress_memory_gw else '_per_gw'}",
            },
            self._each_run_with(
                lambda run: "contact_pressure" in self.config.run(run).fields
                and self.config.run(run).contact.kind == "global"
            ), technical=True,
        )  # fmt: skip
        yield Figure(
            "zones_figure", "Folding", "zones of the boundary", f"{at}/zones.png", "pictures.zones_picture",
            """Zones of the boundary at the start of run *{run}*, from the left (a), from below (b) and on the medial
            sides (c, d): free, clamped (inside the ellipsoid of no growth), the facets of each hemisphere that may
            touch at the fissure, and those between the contact planes. Grey: the inside of the surface.""",
            files(mesh=REGIONS["mesh"], data=REGIONS["data"], params=PARAMETERS),
            lambda run, brain: self._synthetic(brain), self._each_start_with(*ZONES), paper=True, technical=True,
        )  # fmt: skip
        yield Figure(
            "growth_found_figure", "Folding", "growth found", f"{at}/growth_found.png", "pictures.scalar_maps",
            """Growth of area along the pial surface that takes run *{run}* from week to week towards the shapes that it
            is to have, on the surface at the interval's end. Lines: the direction along the surface in which it is
            largest, the longer the more it exceeds the growth across.""",
            files(frames=FOLDING["frames"], params=PARAMETERS),
            lambda run, brain: {
                **self._synthetic(brain), "quantity": "area_growth_percent_per_gw", "views": ["left", "top", "bottom"]
            },
            self._each_run_with(
                lambda run: self.runs.grows_by(run) == "shapes" and "growth" in self.config.run(run).fields
            ),
        )  # fmt: skip
        order = self.config.mesh.order
        kind = "quadratic" if order == 2 else "linear"
        yield Figure(
            "steps_figure", "Folding", "steps of the solver", f"{at}/steps.png", "solve.steps_chart",
            f"""Solver of run *{{run}}*, step by step: Newton (a) and CG iterations (b); smallest det F (c; an element
            would be inverted at 0, dashed); displacement of the step (d); elements through the cortex (e; below
            {ELEMENTS_NEEDED[order]:g}, dashed, {kind} elements may fold by the mesh and not by the material); radius
            ratio that all but the worst hundredth of the elements are above (f; 1 is regular); wall time (g).""",
            files(steps=FOLDING["steps"]),
            lambda run, brain: {**self._synthetic(brain), "order": order},
            self._each_run, technical=True,
        )  # fmt: skip
        yield Figure(
            "study_runs", "Folding", "parameters of the runs", f"{STUDY}/runs.html",
            caption="""What differs between the runs comes first, then what is the same in all. All parameters are in
            ``results/study/runs.csv``.""",
            target="metrics", technical=True,
        )  # fmt: skip
        displacement = {"displacement": f"{STUDY}/displacement.csv"}
        yield Figure(
            "displacement_figure", "Folding", "displacement per week", f"{STUDY_FIGURES}/displacement.png",
            "solve.displacement_chart",
            """Largest (a) and mean (b) displacement between output weeks, over all nodes, divided by the weeks between
            them, beside what the FetalFoldSim paper reports of its simulation and of other real brains: compare orders
            of magnitude only.""",
            lambda: displacement,
            lambda: {**self._runs, **self._synthetic(*self.config.start_brains)},
            paper=True,
        )  # fmt: skip

    @property
    def _mapped(self) -> list[str]:
        """The measures that are drawn as maps."""
        return list(SHAPE_MEASURES)[: None if self.config.report.figures == "all" else 1]

    @property
    def _of_metrics(self) -> Iterator[Figure]:
        yield Figure(
            "shape_maps", "Metrics", "maps of the {measure}", f"{STUDY_FIGURES}/{{measure}}.{{brain}}.png",
            "pictures.shape_maps",
            "{shows} on the pial surfaces of the runs and of the measured brains of the same weeks.",
            lambda brain, measure: {
                "brains": {
                    run: {week: _halves(row) for week, row in self._surfaces(run, brain).items()}
                    for run in self._runs_from(brain)
                } | {
                    self._beside_runs(brain)["measured"]: {
                        week: _halves(row) for week, row in self._real_beside_runs(brain).items()
                    },
                }
            },
            lambda brain, measure: {**self._beside_runs(brain), "quantity": measure},
            tuple({**start, "measure": measure} for start, measure in product(self._each_start, self._mapped)),
        )  # fmt: skip
        metrics = {"metrics": f"{STUDY}/metrics.csv"}
        yield Figure(
            "metrics_figure", "Metrics", "metrics over the weeks", f"{STUDY_FIGURES}/metrics.png",
            "charts.metrics_chart",
            """Runs as lines, measured brains as stars. The gyrification index is the pial area over that of the convex
            hulls of the hemispheres, or of tighter envelopes. The cut at the midline is left out of both, of the hull
            by what lies nearest to it: a smooth brain may come out a few per cent below 1. Shape index: −1 is a cup,
            +1 a cap.""",
            lambda: metrics, lambda: {**self._runs, **self._of_study()},
        )  # fmt: skip
        yield Figure(
            "metrics_table", "Metrics", "metrics, table", f"{STUDY}/metrics_table.html", "tables.metrics_page",
            """The measured brain, each run, and the run's difference from the measured brain. Curvature of folds
            shorter than the curvature wavelength is flattened, and with it the mean curvature norm. All weeks, and the
            hemispheres, are in ``results/study/metrics.csv``.""",
            lambda: metrics, self._of_study,
        )  # fmt: skip
        spectra = {"spectra": f"{STUDY}/spectra.csv"}
        yield Figure(
            "spectra_figure", "Metrics", "SpAnGy bands B4-B6 over the weeks", f"{STUDY_FIGURES}/spectra.png",
            "charts.spectra_weeks_chart",
            """Relative power in the bands B4, B5 and B6 (primary, secondary and tertiary folds) per hemisphere (SpAnGy,
            Germanaud et al. 2012). Open marks: the band is cut off, or finer than the surface resolves.""",
            lambda: spectra, lambda: {**self._runs, **self._of_study()},
        )  # fmt: skip
        reference = self.config.norm_reference
        # of fewer brains there are no centiles
        with_norms: tuple[Wildcards, ...] = ({},) if len(reference) >= 5 else ()
        caption = f"""Metrics of whole brains over the weeks: stars are the measured brains that make the norm
            ({len(reference)} of them, each compared with the others), the grey band holds 90 % of further brains by a
            quadratic of the week and Student's distribution, bars are 5, 50 and 95 % quantiles where a week has five
            brains or more. The table gives the centile and, in brackets, z. With one brain a week the scatter is that
            of templates round the curve, which is less than that of subjects. Brains with other hemispheres than these
            are compared with none of them, and not drawn."""
        yield Figure(
            "norms_figure", "Metrics", "norms over the weeks", f"{STUDY_FIGURES}/norms.png", "charts.norms_chart",
            caption,
            lambda: {**metrics, "curves": f"{STUDY}/norm_curves.csv", "norms": f"{STUDY}/norms.csv"},
            lambda: {**self._runs, **self._of_study(*reference), "reference": list(reference)},
            with_norms,
        )  # fmt: skip
        yield Figure(
            "centiles_table", "Metrics", "centiles, table", f"{STUDY}/centiles.html", "tables.centiles_page", caption,
            lambda: {"centiles": f"{STUDY}/centiles.csv"}, lambda: self._of_study(*reference), with_norms,
        )  # fmt: skip
        named = dict(zip(self.runs.folded, run_names(self.runs.folded), strict=True))
        shown = {row.subject: row for row in self.measuring.real if row.regions} | {
            f"{named[run, brain]}, {self.config.weeks(run, brain)[-1]:g} GW": row
            for run, brain in self.measuring.regioned_runs
            for row in [list(self._surfaces(run, brain).values())[-1]]
        }
        of_regions: tuple[Wildcards, ...] = ({},) if self.measuring.with_regions else ()
        tables = {"regions": f"{STUDY}/regions.csv", "asymmetry": f"{STUDY}/asymmetry.csv"}
        given = ", ".join(self.measuring.given) or "a brain of the spina bifida atlas (named sulci)"
        said = f"""Regions of the cortex, given on {given}, carried to other measured brains
            by registration, and to simulated ones with the tissue. Metrics by region: areas are sums of both sides,
            other values means by area; the asymmetry index is 2 (left − right)/(\\|left\\| + \\|right\\|)."""

        def options() -> dict[str, Any]:
            return self._of_study(*self.measuring.regioned)

        yield Figure(
            "regions_figure", "Metrics", "regions of the cortex", f"{STUDY_FIGURES}/regions.png",
            "pictures.regions_picture", said,
            lambda: {
                "brains": {
                    heading: [list(pair) for pair in zip(row.hemispheres, row.regions.values(), strict=True)]
                    for heading, row in shown.items()
                }
            },
            options, of_regions,
        )  # fmt: skip
        yield Figure(
            "regions_chart", "Metrics", "metrics by region", f"{STUDY_FIGURES}/regions_metrics.png",
            "charts.regions_chart", said, lambda: tables, options, of_regions,
        )  # fmt: skip
        yield Figure(
            "regions_table", "Metrics", "metrics by region, table", f"{STUDY}/regions.html", "tables.regions_page",
            said, lambda: tables, options, of_regions,
        )  # fmt: skip

    @property
    def _of_validation(self) -> Iterator[Figure]:
        compared: tuple[Wildcards, ...] = ({},) if self.validating.pairs else ()
        ceiling = [f"{STUDY}/registration_ceiling.csv"] if self.validating.with_ceiling else []
        runs = {"runs": list(self.config.runs)}

        def beside(**tables: str) -> Callable[[], dict[str, Any]]:
            # a file in a list may be missing
            return lambda: {**tables, "ceiling": ceiling[0] if ceiling else None}

        yield Figure(
            "validation_figure", "Validation", "gain over no folding, by week", f"{STUDY_FIGURES}/validation.png",
            "scores.validation_chart",
            """Gain: the correlation r of the shape index (a) and of the mean curvature (b) with those of the real
            brain, less the r of the start brain scaled up. Above 0, folding is worth more than none. Bars: 95 %
            intervals of a bootstrap over patches of the surface. Full marks explain a week whose own brains gave the
            growth, open ones predict it. Dotted: the start carried to the real brain by registration.""",
            beside(validation=f"{STUDY}/validation.csv"), lambda: runs, compared, target="validate",
        )  # fmt: skip
        foretold: tuple[Wildcards, ...] = ({},) if self.validating.foretold else ()
        prediction = {"prediction": f"{STUDY}/prediction.csv"}
        yield Figure(
            "prediction_figure", "Validation", "foretold brains beside the real ones",
            f"{STUDY_FIGURES}/prediction.png", "scores.prediction_chart",
            """Brains that another population's growth foretells, by weeks after the start: correlation of shape index
            with the real brain's, both at one size, and mean distance of the two surfaces, as they are and rigidly
            aligned. Dashed: simpler ways to foretell the same brain, which need no mechanics, and the shape that the
            run grows towards.""",
            lambda: prediction, lambda: runs, foretold, target="validate",
        )  # fmt: skip
        yield Figure(
            "prediction_table", "Validation", "foretold brains, table", f"{STUDY}/prediction.html",
            "tables.prediction_page",
            """The same as numbers, unscaled but for r. Skill is 1 − distance over that of the best simpler way of the
            week; roughness is that of the real surface's. All columns are in ``results/study/prediction.csv``.""",
            lambda: prediction, of=foretold, target="validate",
        )  # fmt: skip
        expected = tuple({"run": run, "brain": brain} for run, brain in self.validating.expected)
        yield Figure(
            "expected_figure", "Validation", "start, expected and real brains", f"{RUN}/figures/expected.png",
            "pictures.runs_by_week",
            """The start and what was to be expected of it (blue) beside the real brains (beige), from the left and from
            above, at one scale. Below, on the expected surface, how far the real one lies outside (red)
            or inside (blue) of it, both laid onto each other rigidly.""",
            self._expected, self._beside, expected, target="validate",
        )  # fmt: skip
        yield Figure(
            "deviation_figure", "Validation", "deviation from the expected: {quantity}",
            f"{RUN}/figures/deviation_{{quantity}}.png", "pictures.shape_maps",
            """How real brains deviate from what run *{run}* expects of them, on the expected surface: logarithm of the
            real over the expected area, or thickness less that of the start as the run has it grow. By region, with z
            among the study's other brains, in ``results/study/deviation_centiles.csv``.""",
            lambda run, brain, quantity: {
                "brains": {"real less expected": {w: [of] for w, of in self._deviations(run, brain).items()}}
            },
            lambda run, brain, quantity: {**self._beside(run, brain), "quantity": quantity, "views": list(AROUND)},
            tuple(
                {**pair, "quantity": name}
                for pair, name in product(expected, ("log_area", "thickness_difference_mm"))
                if name == "log_area" or pair["brain"] in self.brains.with_thickness
            ),
            target="validate",
        )  # fmt: skip
        yield Figure(
            "onset_figure", "Validation", "weeks in which sulci begin", f"{STUDY_FIGURES}/onset.png",
            "scores.onset_chart",
            """Weeks in which sulci of the last real brain that are not there at the start come to be 2 mm deep below
            their neighbouring crowns. Marks at the right edge: never in the weeks that were folded or measured.""",
            lambda: {"onset": f"{STUDY}/onset.csv"}, lambda: runs, ({},) if self.validating.carried else (),
            target="validate",
        )  # fmt: skip

    @property
    def _of_studies(self) -> Iterator[Figure]:
        studies = tuple({"study": study} for study in self.config.studies)

        def options(study: str) -> dict[str, Any]:
            measured = self.config.measured_name(row.subject for row in self._shown_real(study))
            return {**self._synthetic(self._start(study)), "measured": measured}

        def values(study: str) -> dict[str, Any]:
            members = zip(self._members(study), self.config.members[study], strict=True)
            return {"values": {run: dict(member.values) for run, member in members}}

        yield Figure(
            "influence_figure", "Studies", "influence on the folds", f"{INFLUENCE}/influence.png",
            "pictures.influence_picture",
            """Runs of the study *{study}* at {week} GW, and the real brain last, from the left (a, c) and from above
            (b, d): surfaces, and the shape index from −1 in sulci (blue) to +1 on gyri (red).""",
            lambda study: {
                "members": {
                    run: _halves(self._member(study, run)) if self._reached(study, run) else None
                    for run in self._members(study)
                },
                "real": {options(study)["measured"]: _halves(row) for row in self._shown_real(study)},
            },
            lambda study: {**options(study), **values(study)},
            studies, "influence_figures", paper=True,
        )  # fmt: skip
        yield Figure(
            "influence_spectra", "Studies", "influence on the spectrum of the folds", f"{INFLUENCE}/spectra.png",
            "scores.influence_spectra",
            """Relative power in the bands B4 to B6 (primary to tertiary folds) of the left (a) and the right hemisphere
            (b) in the study *{study}* at {week} GW: runs from pale to dark in their order, the real brain as stars.
            Hatched bars and open stars: the band is cut off or finer than the surface.""",
            lambda study: {
                "spectra": [
                    *(
                        f"{self._member(study, run).folder}/spectra.csv"
                        for run in self._members(study)
                        if self._reached(study, run)
                    ),
                    *(f"{row.folder}/spectra.csv" for row in self._shown_real(study)),
                ]
            },
            lambda study: {**options(study), **values(study), "week": self.studying.week(study)},
            studies, "influence_figures", paper=True,
        )  # fmt: skip
        yield Figure(
            "nearest_figure", "Studies", "what comes nearest to the real brain", f"{INFLUENCE}/nearest.png",
            "scores.nearest_chart",
            """Distance of the runs of the study *{study}* from the real brain at {week} GW by each measure, over what
            is varied. Ring and number: the nearest run that is resolved. Open marks: the mesh does not resolve the
            cortex, or the band is cut off. Dashed: the value that the FetalFoldSim paper found nearest.""",
            lambda study: {name: f"{STUDY}/{study}/{name}.csv" for name in ("comparison", "nearest")},
            lambda study: {
                **self._synthetic(self._start(study)),
                "varied": next(iter(self.config.studies[study].vary)),
                "subject": self._start(study),
                "real": [row.subject for row in self._shown_real(study)],
            },
            tuple({"study": study} for study in self.config.studies if self._is_sweep(study)),
            "influence_figures", paper=True,
        )  # fmt: skip

    @property
    def _of_calibration(self) -> Iterator[Figure]:
        # a calibration is looked at by itself
        yield Figure(
            "calibration_figure", "", "calibration", f"{CALIBRATION}/calibration.png", "scores.calibration_chart",
            inputs=lambda: {name: f"{CALIBRATION}/{name}.csv" for name in ("runs", "optimum")},
            options=lambda: {
                **self._synthetic(*self.config.start_brains),
                "score": list(self.config.calibrate.score if self.config.calibrate else ()),
            },
            of=({},) if self.config.calibrate else (), target="calibrate",
        )  # fmt: skip

    @property
    def _of_resources(self) -> Iterator[Figure]:
        start = self.config.start_brains[:1]
        population = self.config.brain(start[0]).population if start else None
        real = [
            row for row in self.measuring.real if not start or self.config.brain(row.subject).population == population
        ]
        yield Figure(
            "view_surfaces", "", "surfaces in 3D", "results/report/surfaces.json", "view3d.surfaces_view",
            inputs=lambda: {
                "runs": {
                    name: [[week, _halves(row)] for week, row in self._surfaces(*pair).items()]
                    for name, pair in zip(run_names(self.runs.folded), self.runs.folded, strict=True)
                },
                "real": [[row.week, _halves(row)] for row in sorted(real, key=lambda row: row.week)],
            },
            options=lambda: {"measured": self.config.measured_name([row.subject for row in real])},
            target="view",
        )  # fmt: skip
        report = self.config.report
        yield Figure(
            "study_resources", "Resources", "time, memory, energy and emissions", f"{STUDY}/resources.html",
            caption=f"""What the jobs behind this report took. Energy is core hours × {report.core_power_w:g} W,
            emissions are energy × {report.carbon_intensity_g_per_kwh:g} g CO₂e per kWh: nobody has measured power. As
            numbers in ``results/study/resources.csv``.""",
            target="report", technical=True,
        )  # fmt: skip

    def _start(self, study: str) -> str:
        """Returns the brain that the figures of a study are of: the first that its runs fold."""
        return self.studying.members(study)[0][1]

    def _members(self, study: str) -> list[str]:
        """Returns the runs of a study from its start, in order."""
        return [run for run, brain in self.studying.members(study) if brain == self._start(study)]

    def _member(self, study: str, run: str) -> Measured:
        """Returns a run of a study at the week of comparison."""
        return self.measuring.simulated_at(run, self._start(study), self.studying.week(study))

    def _reached(self, study: str, run: str) -> bool:
        return self.reaches(run, self._start(study), self.studying.week(study))

    def _shown_real(self, study: str) -> list[Measured]:
        """Returns the real brain that a study's runs are shown beside, in a list; none where there is none."""
        chosen = self.studying.real(study, self._start(study))[:1]
        return [row for row in self.measuring.real if row.subject in chosen]

    def _is_sweep(self, study: str) -> bool:
        """Returns whether a study varies one number, which is a line over it, and has a real brain beside it."""
        vary = self.config.studies[study].vary
        numbers = all(isinstance(value, int | float) for values in vary.values() for value in values)
        return len(vary) == 1 and numbers and bool(self._shown_real(study))


def _halves(row: Measured) -> list[list[str]]:
    """Returns the hemispheres of what is measured, each with its maps."""
    return [[row.parts[side], f"{row.folder}/{side}.shape.gii"] for side in row.sides]
