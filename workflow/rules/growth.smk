# Growth rates of the cortex, from the areas of the brains' pial surfaces over the weeks.


rule growth_rates:
    input:
        whole=[brain.pial for _, brain in study.growth_brains],
        reports=[brain.report for _, brain in study.growth_brains],
    output:
        **GROWTH,
    params:
        series=[series for series, _ in study.growth_brains],
        brains=[brain.id for _, brain in study.growth_brains],
        with_rates=[series.name for series in study.series.values() if series.has_rates],
        weeks=[brain.week for _, brain in study.growth_brains],
    script:
        "../scripts/growth_rates.py"


rule growth_curves:
    input:
        GROWTH["areas"],
    output:
        **CURVES,
    script:
        "../scripts/growth_curves.py"


rule growth:
    input:
        rules.growth_rates.output if study.growth_brains else [],
        figure_files("growth_figure"),
