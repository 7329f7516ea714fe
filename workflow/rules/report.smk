# What the jobs took, and the report: one HTML page with the figures and tables that rules have marked by `report`.
from types import SimpleNamespace

from snakemake.io import get_flag_value, is_flagged

from gyriflow.report.page import hide_paths
from gyriflow.report.style import run_names

# by rule, what the paths of its benchmark files look like; files of earlier configurations do not match
BENCHMARKS = {
    job.name: job.benchmark.regex().pattern for job in workflow.rules if job.benchmark
}
# the brains of the atlas are among the brains by now
USED_CONFIG = WHOLE_CONFIG.model_dump(
    mode="json", exclude_defaults=True, exclude={"atlas", "participants"}
)


rule study_resources:
    input:
        # the files of benchmarks are no inputs: a lost one would have its stage run again
        rules.figures.input,
        rules.metrics.input,
        summaries=of_runs(rules.simulate.output.summary),
        steps=of_runs(rules.simulate.output.steps),
    output:
        csv=f"{STUDY}/resources.csv",
        table=report(
            f"{STUDY}/resources.html",
            caption="../report/resources_table.rst",
            category="Resources",
            labels={"figure": "time, memory, energy and emissions"},
        ),
    log:
        f"{STUDY}/logs/study_resources.log",
    benchmark:
        f"{STUDY}/benchmarks/study_resources.tsv"
    conda:
        ENVIRONMENT
    params:
        benchmarks=BENCHMARKS,
        power=CONFIG.report.energy.model_dump(),
        folded=FOLDED,
    script:
        "../scripts/study_resources.py"


PAGE = f"{workflow.basedir}/workflow/report/page"
# the files that may be in the report, where they are made
MADE = [
    *rules.figures.input,
    *rules.metrics.input,
    *rules.study_resources.output,
    f"{STUDY}/figures/cost.png",
    *rules.quality.input,
    *rules.influence_figures.input,
]
PICTURE_BYTES = 9_000_000


def caption_values(job, caption, wildcards):
    """Returns what a caption names: the wildcards of a file, and those parameters of its rule that it speaks of."""
    own = SimpleNamespace(**wildcards)
    named = set(re.findall(r"snakemake\.params\.(\w+)", Path(caption).read_text()))
    values = {
        name: value(own) if callable(value) else value
        for name, value in job.params.items()
        if name in named
    }
    return {"snakemake": {"wildcards": wildcards, "params": values}}


def marked_files():
    """Returns an entry for each figure and table of the report, in the order of the rules, runs and brains."""
    entries = []
    for job in workflow.rules:
        for output in job.output:
            if not is_flagged(output, "report"):
                continue
            mark = get_flag_value(output, "report")
            caption = str(
                job.basedir.join(mark.caption).get_path_or_uri(secret_free=False)
            )
            for path in dict.fromkeys(map(str, MADE)):
                found = output.regex().fullmatch(path)
                if found:
                    own = found.groupdict()
                    named = [
                        own[key] for key in ("run", "brain", "study") if own.get(key)
                    ]
                    labels = mark.labels or {}
                    title = str(labels.get("figure", job.name)).format(**own)
                    entries.append(
                        {
                            "file": path,
                            "section": mark.category,
                            "title": " · ".join([title[0].upper() + title[1:], *named]),
                            "caption": caption,
                            "values": caption_values(job, caption, own),
                        }
                    )
    return entries


def licences():
    """Returns the licence of each brain of an atlas."""
    return {
        used.atlas.brain_id(file.series, file.week): used.atlas.licence.name
        for used in CONFIG.atlases
        for file in used.files
    }


def described_brains():
    """Returns what the configuration says of each brain."""
    known = licences()
    return [
        {
            **{key: getattr(brain, key) for key in ("id", "week", "population")},
            **{key: getattr(brain, key) for key in ("source", "synthetic")},
            "licence": known.get(brain.id),
        }
        for brain in WHOLE_CONFIG.brains
    ]


def input_files():
    """Returns (brain, what it is, path) of all files that brains are made from."""
    return [
        (brain.id, what, path)
        for brain in CONFIG.brains
        for what, paths in (
            (brain.source, brain.files),
            ("image", [brain.image] if brain.image else []),
            ("white", list(brain.white_files.values())),
        )
        for path in paths
    ]


def described_settings(settings):
    """Returns the value, unit and description of each setting."""
    values = settings.model_dump(mode="json")
    return {
        name: {
            "value": values[name],
            "unit": field.json_schema_extra["unit"],
            "description": field.description,
        }
        for name, field in type(settings).model_fields.items()
    }


# the hemispheres of a brain at a week, and the folder of their maps
def timed(brain, week, folder, maps):
    sides = [surfaces_in(folder)[side] for side in sides_of(brain)]
    return [float(week), sides, maps]


VIEWED_RUNS = {
    name: [
        timed(
            brain,
            week,
            f"results/runs/{run}/{brain}/surfaces/week-{week}",
            f"results/runs/{run}/{brain}/metrics/week-{week}",
        )
        for week in week_tags(run, brain)
    ]
    for name, (run, brain) in zip(run_names(FOLDED), FOLDED)
}
# the measured brains that are shown beside the runs
VIEWED = [
    brain
    for brain in CONFIG.brains
    if not CONFIG.start_brains
    or brain.population == CONFIG.brain(CONFIG.start_brains[0]).population
]
VIEWED_BRAINS = [
    timed(
        brain.id,
        brain.week,
        f"results/brains/{brain.id}/surface",
        f"results/brains/{brain.id}/metrics",
    )
    for brain in sorted(VIEWED, key=lambda brain: brain.week)
]


rule view_surfaces:
    input:
        rules.metrics.input,
        [
            side
            for frames in [*VIEWED_RUNS.values(), VIEWED_BRAINS]
            for _, sides, _ in frames
            for side in sides
        ],
    output:
        "results/report/surfaces.json",
    log:
        "results/report/logs/view_surfaces.log",
    benchmark:
        "results/report/benchmarks/view_surfaces.tsv"
    conda:
        ENVIRONMENT
    params:
        runs=VIEWED_RUNS,
        real=VIEWED_BRAINS,
        measured=CONFIG.measured_name([brain.id for brain in VIEWED]),
    script:
        "../scripts/view_surfaces.py"


rule report_provenance:
    input:
        rules.metrics.input,
    output:
        "results/report/provenance.json",
    log:
        "results/report/logs/report_provenance.log",
    benchmark:
        "results/report/benchmarks/report_provenance.tsv"
    conda:
        ENVIRONMENT
    params:
        files=input_files(),
        paths=CONFIG.report.paths,
    script:
        "../scripts/report_provenance.py"


rule cost_figure:
    input:
        rules.study_resources.output.csv,
    output:
        **figure(f"{STUDY}/figures/cost", "time and energy", "cost.rst", "Resources"),
    log:
        f"{STUDY}/logs/cost_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/cost_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        dpi=CONFIG.report.dpi,
    script:
        "../scripts/cost_figure.py"


rule html_report:
    input:
        MADE,
        surfaces=expand(PIAL["report"], brain=BRAINS),
        runs=rules.study_runs.output.csv,
        quality=rules.quality_table.output.csv,
        warnings=rules.study_warnings.output[0],
        validation=rules.validation_table.output[0] if VALIDATED else [],
        displacement=(
            rules.displacement_agreement_table.output[0]
            if any(brain in CARRIED for _, brain in VALIDATED)
            else []
        ),
        provenance=rules.report_provenance.output[0],
        view=rules.view_surfaces.output[0],
        page=f"{PAGE}/page.html",
        style=f"{PAGE}/style.css",
        three=f"{PAGE}/three.min.js",
        notice=f"{PAGE}/three.LICENSE.txt",
        controls=f"{PAGE}/OrbitControls.js",
        viewer=f"{PAGE}/viewer.js",
    output:
        "results/report/report.html",
    log:
        "results/report/logs/html_report.log",
    benchmark:
        "results/report/benchmarks/html_report.tsv"
    conda:
        ENVIRONMENT
    resources:
        runtime=20,
    params:
        entries=marked_files(),
        first=(
            rules.weekly_figure.output.png.format(run=FOLDED[0][0], brain=FOLDED[0][1])
            if FOLDED
            else None
        ),
        picture_bytes=PICTURE_BYTES,
        brains=described_brains(),
        surfaced=BRAINS,
        metrics=described_settings(CONFIG.metrics),
        config=USED_CONFIG if CONFIG.report.paths else hide_paths(USED_CONFIG),
    script:
        "../scripts/html_report.py"


rule provenance:
    input:
        rules.figures.input,
        rules.metrics.input,
    output:
        study=f"{STUDY}/provenance.json",
        brains=expand(f"{BRAIN}/provenance.json", brain=BRAINS),
        runs=of_runs(f"{RUN}/provenance.json"),
    log:
        f"{STUDY}/logs/provenance.log",
    benchmark:
        f"{STUDY}/benchmarks/provenance.tsv"
    conda:
        ENVIRONMENT
    params:
        config=USED_CONFIG,
        brains=[
            brain.model_dump(mode="json", exclude_defaults=True)
            for brain in CONFIG.brains
        ],
        folded=FOLDED,
    script:
        "../scripts/provenance.py"


# the configuration with its paths, for those who have the files
rule report_config:
    output:
        "results/report/config.yaml",
    log:
        "results/report/logs/report_config.log",
    benchmark:
        "results/report/benchmarks/report_config.tsv"
    conda:
        ENVIRONMENT
    params:
        config=USED_CONFIG,
    script:
        "../scripts/report_config.py"


rule report:
    input:
        rules.html_report.output,
        rules.report_config.output,
        rules.provenance.output,


# targets, and what only moves text: no jobs of their own on a cluster
localrules:
    all,
    atlas_file,
    retrieve,
    surface,
    mesh,
    growth,
    folding,
    validate,
    metrics,
    figures,
    quality,
    report,
    studies,
    influence_figures,
    calibrate,
    paper,
    parameters,
    html_report,
