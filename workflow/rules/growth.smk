# Growth rates of the cortex, from the areas of the brains' pial surfaces over the weeks.
# by series, the earliest first
GROWTH_SERIES = [
    (series, brain)
    for series, brains in CONFIG.growth_series.items()
    for brain in sorted(brains, key=lambda name: CONFIG.brain(name).week)
]
GROWTH_BRAINS = [brain for _, brain in GROWTH_SERIES]


def follows_thickness(run):
    """Returns whether a run's cortex is as thick as measured."""
    follow = CONFIG.run(run).follow
    return follow is not None and follow.thickness_mm == "measured"


# brains whose cortical thickness gives a curve, where some run follows it
GROWTH_THICKNESS = [
    brain
    for brain in GROWTH_BRAINS
    if brain in (*WITH_CORTEX, *WITH_WHITE)
    and any(follows_thickness(run) for run in CONFIG.runs)
]


def folding_rate():
    """Returns the folding's growth rate: a number, {week: number}, `estimated`, or None where it has a map."""
    rate = CONFIG.folding.growth_rate_per_s
    if isinstance(rate, (float, str)):
        return rate
    return dict(rate.weeks) if rate.map is None else None


rule growth_rates:
    input:
        whole=expand(PIAL["whole"], brain=GROWTH_BRAINS),
        reports=expand(PIAL["report"], brain=GROWTH_BRAINS),
        thickness=expand(THICKNESS["report"], brain=GROWTH_THICKNESS),
    output:
        areas=f"{STUDY}/growth/areas.csv",
        rates=f"{STUDY}/growth/rates.csv",
        agreement=f"{STUDY}/growth/agreement.csv",
    log:
        f"{STUDY}/logs/growth_rates.log",
    benchmark:
        f"{STUDY}/benchmarks/growth_rates.tsv"
    conda:
        ENVIRONMENT
    params:
        series=[series for series, _ in GROWTH_SERIES],
        brains=GROWTH_BRAINS,
        with_thickness=GROWTH_THICKNESS,
        weeks=[CONFIG.brain(brain).week for brain in GROWTH_BRAINS],
    script:
        "../scripts/growth_rates.py"


rule growth_curves:
    input:
        rules.growth_rates.output.areas,
    output:
        curves=f"{STUDY}/growth/curves.csv",
        errors=f"{STUDY}/growth/curve_errors.csv",
    log:
        f"{STUDY}/logs/growth_curves.log",
    benchmark:
        f"{STUDY}/benchmarks/growth_curves.tsv"
    conda:
        ENVIRONMENT
    params:
        may_shrink=CONFIG.folding.allow_negative_growth,
        # predictions know the brains up to some week only
        known_until_gw=sorted(
            {
                CONFIG.run(run).follow.known_until_gw
                for run in CONFIG.runs
                if CONFIG.run(run).follow is not None
                and CONFIG.run(run).follow.known_until_gw is not None
            }
        ),
    script:
        "../scripts/growth_curves.py"


rule growth_figure:
    input:
        areas=rules.growth_rates.output.areas,
        rates=rules.growth_rates.output.rates,
        agreement=rules.growth_rates.output.agreement,
    output:
        **figure(
            f"{STUDY}/growth/growth",
            "cortical growth rates",
            "growth.rst",
            "Brains and growth",
        ),
        table=report(
            f"{STUDY}/growth/rates.html",
            caption="../report/growth_table.rst",
            category="Brains and growth",
            labels={"figure": "growth rates, table"},
        ),
    log:
        f"{STUDY}/logs/growth_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/growth_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        folding_rate_per_s=folding_rate(),
        estimated_from=CONFIG.start_brains
        and CONFIG.estimated_from(CONFIG.start_brains[0]),
        series_names=list(CONFIG.growth_series),
        measured=CONFIG.measured_name(GROWTH_BRAINS),
        dpi=CONFIG.report.dpi,
    script:
        "../scripts/growth_figure.py"


rule growth:
    input:
        [rules.growth_rates.output, rules.growth_figure.output] if GROWTH_BRAINS else [],
