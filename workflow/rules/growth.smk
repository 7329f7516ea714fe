# Growth rates of the cortex, from the areas of the brains' pial surfaces over the weeks.
rule growth_rates:
    input:
        whole=expand(PIAL["whole"], brain=PLAN.chains.grown),
        reports=expand(PIAL["report"], brain=PLAN.chains.grown),
        thickness=expand(THICKNESS["report"], brain=PLAN.chains.with_thickness),
    output:
        **GROWTH,
    params:
        series=[series for series, _ in PLAN.chains.series],
        brains=PLAN.chains.grown,
        with_thickness=PLAN.chains.with_thickness,
        weeks=[CONFIG.brain(brain).week for brain in PLAN.chains.grown],
    script:
        "../scripts/growth_rates.py"


rule growth_curves:
    input:
        GROWTH["areas"],
    output:
        **CURVES,
    params:
        may_shrink=CONFIG.folding.allow_negative_growth,
    script:
        "../scripts/growth_curves.py"


rule growth:
    input:
        rules.growth_rates.output if PLAN.chains.grown else [],
        PLAN.figures.target("growth"),
