# Figures of what simulations are worth, and the target of all of validation.
def smoothing_lengths():
    """Returns the runs that differ in nothing but the smoothing of measured growth, and their lengths in mm.

    They are those like the first run with regional growth; one that is like it but uniform has an infinite length.
    """
    like, found = None, {}
    for run in CONFIG.runs:
        settings = CONFIG.run(run).model_dump(exclude={"preset"})
        follow = settings["follow"]
        if follow is None:
            continue
        length = follow.pop("smoothing_mm") if regional(run) else float("inf")
        amounts = follow.pop("regional"), follow.pop("directional")
        follow.pop("smoothing_mm", None)
        if like is None and regional(run):
            like = settings | {"amounts": amounts}
        # all that is left of a uniform run is compared, whatever the amounts
        if (
            like is not None
            and settings | {"amounts": amounts if regional(run) else like["amounts"]}
            == like
        ):
            found[run] = length
    return found


SMOOTHING = {
    run: length
    for run, length in smoothing_lengths().items()
    if any(run == validated for validated, _ in VALIDATED)
}
CEILING = (
    rules.registration_ceiling_table.output
    if any(start in CARRIED for start, _ in COMPARED_IN)
    else []
)


rule validation_figure:
    input:
        validation=rules.validation_table.output[0],
        ceiling=CEILING[0] if CEILING else [],
    output:
        **figure(
            f"{STUDY}/figures/validation",
            "gain over no folding, by week",
            "figure.rst",
            "Validation",
        ),
    log:
        f"{STUDY}/logs/validation_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/validation_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        smoothing_mm=None,
        runs=list(CONFIG.runs),
        dpi=CONFIG.report.dpi,
        caption=(
            "Correlation of curvature with that of the real brain, less that of the start brain merely scaled up: "
            "above 0 folding is worth more than none. Bars are 95 % intervals of a bootstrap over patches of the "
            "surface; full marks explain a week whose own brains gave the growth, open ones predict it."
        ),
    script:
        "../scripts/validation_figure.py"


use rule validation_figure as smoothing_figure with:
    output:
        **figure(
            f"{STUDY}/figures/smoothing",
            "gain by the smoothing of measured growth",
            "figure.rst",
            "Validation",
        ),
    log:
        f"{STUDY}/logs/smoothing_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/smoothing_figure.tsv"
    params:
        smoothing_mm=SMOOTHING,
        dpi=CONFIG.report.dpi,
        caption=(
            "How local growth must be known: correlation of curvature with that of the real brain, less that of the "
            "scaled start, of runs that differ in the smoothing of measured growth alone."
        ),


def models():
    """Returns for each run the first one that differs from it only in its start, seed, end, or in what is known."""
    known, found = {}, {}
    for run in CONFIG.runs:
        settings = CONFIG.run(run).model_dump(
            exclude={"preset", "start", "end_week", "ranks"}
        )
        follow = settings["follow"]
        if follow is not None:
            follow.update(seed=None, known_until_gw=None)
        found[run] = known.setdefault(repr(settings), run)
    return found


rule horizon:
    input:
        validation=rules.validation_table.output[0],
        displacement=(
            rules.displacement_agreement_table.output[0]
            if any(brain in CARRIED for _, brain in VALIDATED)
            else []
        ),
    output:
        f"{STUDY}/horizon.csv",
    log:
        f"{STUDY}/logs/horizon.log",
    benchmark:
        f"{STUDY}/benchmarks/horizon.tsv"
    conda:
        ENVIRONMENT
    params:
        models=models(),
        known_until_gw={
            run: (
                CONFIG.run(run).follow.known_until_gw
                if CONFIG.run(run).follow
                else None
            )
            for run in CONFIG.runs
        },
    script:
        "../scripts/horizon.py"


rule horizon_figure:
    input:
        horizon=rules.horizon.output[0],
        ceiling=CEILING[0] if CEILING else [],
    output:
        **figure(
            f"{STUDY}/figures/horizon",
            "gain by weeks after the start",
            "figure.rst",
            "Validation",
        ),
    log:
        f"{STUDY}/logs/horizon_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/horizon_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        runs=list(CONFIG.runs),
        dpi=CONFIG.report.dpi,
        caption=(
            "Prediction horizon: correlation of curvature with that of the real brain, less that of the scaled start, "
            "by weeks after the start. Each line begins at the week that stands at its end; weeks whose growth was "
            "known and weeks whose growth was not stand in panels of their own."
        ),
    script:
        "../scripts/horizon_figure.py"


rule validate:
    input:
        (
            [
                rules.validation_table.output,
                rules.validation_figure.output,
                rules.horizon.output,
                rules.horizon_figure.output,
            ]
            if VALIDATED
            else []
        ),
        rules.smoothing_figure.output if len(set(SMOOTHING.values())) > 2 else [],
        CEILING,
        (
            [
                rules.displacement_agreement_table.output,
                rules.onset_table.output,
                rules.onset_figure.output,
            ]
            if any(brain in CARRIED for _, brain in VALIDATED)
            else []
        ),
