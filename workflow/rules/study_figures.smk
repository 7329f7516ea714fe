# Figures of the whole study.
FIGURES = f"{STUDY}/figures"
# the last week of which every run has a surface, where there is one
COMMON_WEEKS = (
    set.intersection(*(set(week_tags(*pair)) for pair in FOLDED)) if FOLDED else set()
)
LAST_WEEK = max(COMMON_WEEKS, default=None)
FIRST_AND_LAST = list(
    dict.fromkeys(
        pick(CONFIG.brains, key=lambda brain: brain.week).id for pick in (min, max)
    )
)
TOUCHED = [pair for pair in FOLDED if pair[0] in TOUCHING]
LAST_BRAINS = [brain.id for brain in CONFIG.brains if week_tag(brain.week) == LAST_WEEK]


rule inputs_figure:
    input:
        [PIAL["whole"].format(brain=brain) for brain in FIRST_AND_LAST],
    output:
        **figure(f"{FIGURES}/inputs", "brains that went in", "inputs.rst", "Inputs"),
    log:
        f"{STUDY}/logs/inputs_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/inputs_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*FIRST_AND_LAST),
        headings=[
            f"{brain}\n{CONFIG.brain(brain).week:g} GW" for brain in FIRST_AND_LAST
        ],
    script:
        "../scripts/inputs_figure.py"


rule displacement_figure:
    input:
        f"{STUDY}/displacement.csv",
    output:
        **figure(
            f"{FIGURES}/displacement",
            "displacement per week",
            "displacement.rst",
            "Folding",
        ),
        table=report(
            f"{STUDY}/displacement_table.html",
            caption="../report/displacement_table.rst",
            category="Folding",
            labels={"figure": "displacement per week, table"},
        ),
    log:
        f"{STUDY}/logs/displacement_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/displacement_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        folded=FOLDED,
    script:
        "../scripts/displacement_figure.py"


rule metrics_figure:
    input:
        f"{STUDY}/metrics.csv",
    output:
        **figure(
            f"{FIGURES}/metrics", "metrics over the weeks", "metrics.rst", "Metrics"
        ),
        table=report(
            f"{STUDY}/metrics_table.html",
            caption="../report/metrics_table.rst",
            category="Metrics",
            labels={"figure": "metrics, table"},
        ),
    log:
        f"{STUDY}/logs/metrics_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/metrics_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        folded=FOLDED,
        measured=CONFIG.measured_name(BRAINS),
    script:
        "../scripts/metrics_figure.py"


rule spectra_figure:
    input:
        f"{STUDY}/spectra.csv",
    output:
        **figure(
            f"{FIGURES}/spectra",
            "SpAnGy bands B4-B6 over the weeks",
            "spectra.rst",
            "Metrics",
        ),
    log:
        f"{STUDY}/logs/spectra_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/spectra_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        folded=FOLDED,
        measured=CONFIG.measured_name(BRAINS),
    script:
        "../scripts/spectra_figure.py"


rule bands_figure:
    input:
        f"{STUDY}/spectra.csv",
    output:
        **figure(
            f"{FIGURES}/bands",
            "all SpAnGy bands at the last week",
            "bands.rst",
            "Metrics",
        ),
    log:
        f"{STUDY}/logs/bands_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/bands_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        folded=FOLDED,
        measured=CONFIG.measured_name(BRAINS),
        week=LAST_WEEK and float(LAST_WEEK),
    script:
        "../scripts/bands_figure.py"


rule age_profile_figure:
    input:
        profile=rules.age_profile.output.profile,
        check=rules.age_profile.output.check,
        similarity=rules.age_profile.output.similarity,
    output:
        **figure(
            f"{FIGURES}/age_profile",
            "apparent age of simulated brains",
            "age_profile.rst",
            "Metrics",
        ),
    log:
        f"{STUDY}/logs/age_profile_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/age_profile_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        folded=FOLDED,
        measured=CONFIG.measured_name(CONFIG.age_reference),
    script:
        "../scripts/age_profile_figure.py"


rule norms_figure:
    input:
        metrics=f"{STUDY}/metrics.csv",
        norms=rules.centiles.output.norms,
        curves=rules.centiles.output.curves,
        centiles=rules.centiles.output.centiles,
    output:
        **figure(f"{FIGURES}/norms", "norms over the weeks", "norms.rst", "Metrics"),
        table=report(
            f"{STUDY}/centiles.html",
            caption="../report/norms.rst",
            category="Metrics",
            labels={"figure": "centiles, table"},
        ),
    log:
        f"{STUDY}/logs/norms_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/norms_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        folded=FOLDED,
        reference=CONFIG.norm_reference,
        measured=CONFIG.measured_name(CONFIG.norm_reference or BRAINS),
    script:
        "../scripts/norms_figure.py"


# what is shown with its regions: the brains, and each run at its last week
SHOWN_WITH_REGIONS = {
    **{brain: f"brains/{brain}/metrics" for brain in REGIONED},
    **{
        f"{run if len(CONFIG.starts(run)) == 1 else f'{run} · {brain}'}, {CONFIG.weeks(run, brain)[-1]:g} GW": (
            f"runs/{run}/{brain}/metrics/week-{week_tags(run, brain)[-1]}"
        )
        for run, brain in REGIONED_RUNS
    },
}


rule regions_figure:
    input:
        left=[
            f"results/{surface_folder(where)}/left.pial.surf.gii"
            for where in SHOWN_WITH_REGIONS.values()
        ],
        right=[
            f"results/{surface_folder(where)}/right.pial.surf.gii"
            for where in SHOWN_WITH_REGIONS.values()
        ],
        left_regions=[
            f"results/{regions_in(where)}/left.regions.label.gii"
            for where in SHOWN_WITH_REGIONS.values()
        ],
        right_regions=[
            f"results/{regions_in(where)}/right.regions.label.gii"
            for where in SHOWN_WITH_REGIONS.values()
        ],
        regions=f"{STUDY}/regions.csv",
        asymmetry=rules.asymmetry.output[0],
    output:
        **figure(
            f"{FIGURES}/regions", "regions of the cortex", "regions.rst", "Metrics"
        ),
        chart=report(
            f"{FIGURES}/regions_metrics.png",
            caption="../report/regions.rst",
            category="Metrics",
            labels={"figure": "metrics by region"},
        ),
        chart_pdf=f"{FIGURES}/regions_metrics.pdf",
        table=report(
            f"{STUDY}/regions.html",
            caption="../report/regions.rst",
            category="Metrics",
            labels={"figure": "metrics by region, table"},
        ),
    log:
        f"{STUDY}/logs/regions_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/regions_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        headings=list(SHOWN_WITH_REGIONS),
        given=GIVEN,
        measured=CONFIG.measured_name(REGIONED or BRAINS),
    script:
        "../scripts/regions_figure.py"


rule runs_figure:
    input:
        runs=of_runs(f"{RUN}/surfaces/week-{LAST_WEEK}/pial.surf.gii"),
        real=expand(PIAL["whole"], brain=LAST_BRAINS),
    output:
        **figure(f"{FIGURES}/runs", "runs side by side", "runs.rst", "Folding"),
    log:
        f"{STUDY}/logs/runs_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/runs_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(*CONFIG.start_brains),
        folded=FOLDED,
        measured=CONFIG.measured_name(LAST_BRAINS),
        week=LAST_WEEK and float(LAST_WEEK),
    script:
        "../scripts/runs_figure.py"


OF_THE_LAST_WEEK = [
    rules.bands_figure.output if LAST_WEEK else [],
    rules.runs_figure.output if LAST_WEEK and len(FOLDED) > 1 else [],
]


rule figures:
    input:
        [of_runs(rule.output, measure=SHAPE_MEASURES) for rule in FIGURES_OF_RUNS],
        [
            expand(rules.contact_maps.output, run=run, brain=brain)
            for run, brain in PRESSED
        ],
        expand(rules.quality_figure.output, brain=CONFIG.start_brains),
        expand(rules.overlay_figure.output, brain=OVERLAID),
        rules.metrics_figure.output,
        rules.spectra_figure.output,
        rules.displacement_figure.output,
        rules.inputs_figure.output,
        expand(
            rules.contact_scheme.output,
            zip,
            run=[run for run, _ in TOUCHED],
            brain=[brain for _, brain in TOUCHED],
        ),
        rules.age_profile_figure.output if CONFIG.age_reference else [],
        rules.norms_figure.output if CONFIG.norm_reference else [],
        rules.regions_figure.output if WITH_REGIONS else [],
        OF_THE_LAST_WEEK,
        rules.growth.input,


# what shows runs without measuring them week by week
PAPER_FIGURES = [rule for rule in PAPER_FIGURES_OF_RUNS if rule is not rules.shape_maps]


# the figures and tables of the paper; brains are measured at the weeks of comparison only
rule paper:
    input:
        [of_runs(rule.output) for rule in PAPER_FIGURES],
        expand(
            rules.contact_scheme.output,
            zip,
            run=[run for run, _ in TOUCHED],
            brain=[brain for _, brain in TOUCHED],
        ),
        rules.inputs_figure.output,
        rules.displacement_figure.output,
        rules.growth.input,
        rules.published_tables.output,
        rules.studies.input,
        rules.influence_figures.input,
