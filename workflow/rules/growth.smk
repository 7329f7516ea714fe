# Growth rates of the cortex, from the areas of the brains' pial surfaces over the weeks.
# a rate needs brains of two weeks
HAS_GROWTH = len({brain.week for brain in CONFIG.brains}) > 1


rule growth_rates:
    input:
        whole=expand("results/{brain}/surface/pial.surf.gii", brain=BRAINS),
        left=expand("results/{brain}/surface/left.pial.surf.gii", brain=BRAINS),
        right=expand("results/{brain}/surface/right.pial.surf.gii", brain=BRAINS),
    output:
        areas=f"results/{START}/growth/areas.csv",
        rates=f"results/{START}/growth/rates.csv",
    log:
        f"results/{START}/logs/growth_rates.log",
    benchmark:
        f"results/{START}/benchmarks/growth_rates.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        brains=BRAINS,
        weeks=[brain.week for brain in CONFIG.brains],
        code=code("growth"),
    script:
        "../scripts/growth_rates.py"


rule growth_figure:
    input:
        areas=rules.growth_rates.output.areas,
        rates=rules.growth_rates.output.rates,
    output:
        png=report(
            f"results/{START}/growth/growth.png",
            caption="../report/growth.rst",
            category="Brains and growth",
            labels={"figure": "cortical growth rates"},
        ),
        pdf=f"results/{START}/growth/growth.pdf",
        table=report(
            f"results/{START}/growth/rates.html",
            caption="../report/growth_table.rst",
            category="Brains and growth",
            labels={"figure": "growth rates, table"},
        ),
    log:
        f"results/{START}/logs/growth_figure.log",
    benchmark:
        f"results/{START}/benchmarks/growth_figure.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        folding_rate_per_s=CONFIG.folding.growth_rate_per_s,
        measured=CONFIG.measured_name(BRAINS),
        dpi=CONFIG.report.dpi,
        code=code("report"),
    script:
        "../scripts/growth_figure.py"


rule growth:
    input:
        [rules.growth_rates.output, rules.growth_figure.output] if HAS_GROWTH else [],
