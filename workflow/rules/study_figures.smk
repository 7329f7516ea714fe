# Figures of the whole study.
FIGURES = f"{STUDY}/figures"
# the last week of which every run has a surface, where there is one
COMMON_WEEKS = set.intersection(*(set(week_tags(*pair)) for pair in FOLDED))
LAST_WEEK = max(COMMON_WEEKS, default=None)
LAST_BRAINS = [brain.id for brain in CONFIG.brains if week_tag(brain.week) == LAST_WEEK]


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
        measured=CONFIG.measured_name(BRAINS),
        week=LAST_WEEK and float(LAST_WEEK),
    script:
        "../scripts/bands_figure.py"


rule age_profile_figure:
    input:
        profile=rules.age_profile.output.profile,
        check=rules.age_profile.output.check,
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
        measured=CONFIG.measured_name(CONFIG.age_reference),
    script:
        "../scripts/age_profile_figure.py"


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
        measured=CONFIG.measured_name(LAST_BRAINS),
        folded=FOLDED,
        week=LAST_WEEK and float(LAST_WEEK),
    script:
        "../scripts/runs_figure.py"


# runs that write the pressure between their folds
PRESSED = [
    pair
    for pair in FOLDED
    if "contact_pressure" in CONFIG.run(pair[0]).fields
    and CONFIG.run(pair[0]).contact.kind == "global"
]
OF_THE_LAST_WEEK = [
    rules.bands_figure.output if LAST_WEEK else [],
    rules.runs_figure.output if LAST_WEEK and len(FOLDED) > 1 else [],
]
# figures of a run that belong into a paper
PRINTED = [
    rules.weekly_figure,
    rules.displacement_maps,
    rules.shape_maps,
    rules.zones_figure,
    rules.growth_zone_figure,
    rules.layers_figure,
    rules.normals_figure,
]


rule figures:
    input:
        [of_runs(rule.output, measure=SHAPE_MEASURES) for rule in PRINTED],
        of_runs(rules.steps_figure.output),
        [
            expand(rules.contact_maps.output, run=run, brain=brain)
            for run, brain in PRESSED
        ],
        expand(rules.quality_figure.output, brain=CONFIG.start_brains),
        expand(rules.overlay_figure.output, brain=OVERLAID),
        rules.metrics_figure.output,
        rules.spectra_figure.output,
        rules.displacement_figure.output,
        rules.age_profile_figure.output if CONFIG.age_reference else [],
        OF_THE_LAST_WEEK,
        rules.growth.input,


# the figures and tables of the paper that this study's data allow
rule paper:
    input:
        [of_runs(rule.output, measure=SHAPE_MEASURES) for rule in PRINTED],
        rules.displacement_figure.output,
        rules.spectra_figure.output,
        OF_THE_LAST_WEEK,
        rules.growth.input,
