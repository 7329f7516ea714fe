# The weeks in which sulci begin, in simulated brains and in the real ones that follow their start.
def regions_of_last(side):
    """Returns an input function: the regions of the last brain that a start brain is carried to, where it has some."""

    def files(wildcards):
        last = later_brains(wildcards.brain)[-1]
        names = region_files(f"results/brains/{last}/metrics")
        return names[f"{side}_regions"] if last in REGIONED else []

    return files


rule onset:
    input:
        **{
            f"run_{side}": lambda wildcards, side=side: [
                f"results/runs/{wildcards.run}/{wildcards.brain}/surfaces/week-{week}/{side}.pial.surf.gii"
                for week in week_tags(wildcards.run, wildcards.brain)
                if side in sides_of(wildcards.brain)
            ]
            for side in SIDES
        },
        **{
            f"real_{side}": lambda wildcards, side=side: (
                expand(PIAL[side], brain=later_brains(wildcards.brain))
                if side in sides_of(wildcards.brain)
                else []
            )
            for side in SIDES
        },
        **{f"{side}_regions": regions_of_last(side) for side in SIDES},
        reports=lambda wildcards: expand(
            PIAL["report"], brain=later_brains(wildcards.brain)
        ),
        correspondences=lambda wildcards: correspondences(later_brains(wildcards.brain)),
    output:
        f"{RUN}/metrics/onset.csv",
    log:
        f"{RUN}/logs/onset.log",
    benchmark:
        f"{RUN}/benchmarks/onset.tsv"
    wildcard_constraints:
        brain=one_of(CARRIED),
    conda:
        ENVIRONMENT
    params:
        radius_mm=CONFIG.metrics.curvature_radius_mm,
        run=lambda wildcards: wildcards.run,
        subject=lambda wildcards: wildcards.brain,
        sides=lambda wildcards: sides_of(wildcards.brain),
        run_weeks=lambda wildcards: CONFIG.weeks(wildcards.run, wildcards.brain),
        real_weeks=lambda wildcards: [
            CONFIG.brain(name).week for name in later_brains(wildcards.brain)
        ],
    script:
        "../scripts/onset.py"


rule onset_figure:
    input:
        "results/study/onset.csv",
    output:
        **figure(
            f"{STUDY}/figures/onset",
            "weeks in which sulci begin",
            "figure.rst",
            "Validation",
        ),
    log:
        f"{STUDY}/logs/onset_figure.log",
    benchmark:
        f"{STUDY}/benchmarks/onset_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        runs=list(CONFIG.runs),
        dpi=CONFIG.report.dpi,
        caption=(
            "Weeks in which sulci of the last real brain that are not there at the start come to be 2 mm deep below "
            "their neighbouring crowns. Marks at the right edge: never in the weeks that were folded or measured."
        ),
    script:
        "../scripts/onset_figure.py"


rule onset_table:
    input:
        [
            f"results/runs/{run}/{brain}/metrics/onset.csv"
            for run, brain in VALIDATED
            if brain in CARRIED
        ],
    output:
        f"{STUDY}/onset.csv",
    log:
        f"{STUDY}/logs/onset_table.log",
    benchmark:
        f"{STUDY}/benchmarks/onset_table.tsv"
    conda:
        ENVIRONMENT
    script:
        "../scripts/join_tables.py"
