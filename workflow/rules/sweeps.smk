# Sweeps: runs that differ from a base run in a few parameters, compared with observed brains at a week.
#
# results/study/SWEEP/ has members (per run: values, resolution, outcome with its cause, time), comparison (distance of
# each run from each observed brain by each measure) and nearest (the nearest run by each measure). A run that diverged
# before the week of comparison is only in `members`.
def sweep_run(wildcards):
    """Return the run of a sweep from a start brain; runs that share a simulation are compared with the same brains."""
    rows = SWEEPS[wildcards.sweep]
    return next(row for row in rows if (row.run, row.brain) == (wildcards.run, wildcards.brain))


def files_of_member(wildcards):
    """Return the files of a run at the week of comparison and of the observed brains; none if it has not reached it."""
    compared = sweep_run(wildcards)
    if not reaches(wildcards.run, wildcards.brain, compared.week):
        return {}
    simulated = SIMULATED[wildcards.run, wildcards.brain, compared.week]
    rows = [simulated, *(BRAINS[brain] for brain in compared.observed)]
    tables = ("metrics", "spectra", "coefficients")
    return {
        **{name: [f"{row.folder}/{name}.csv" for row in rows] for name in tables},
        "simulated": list(study.measured_parts(simulated).values()),
        "measured": [path for row in rows[1:] for path in row.parts.values()],
    }


def from_members(pattern):
    """Return an input function: a file of each run of a sweep."""
    return lambda w: [pattern.format(sweep=w.sweep, run=row.run, brain=row.brain) for row in SWEEPS[w.sweep]]


rule compare_member:
    input:
        unpack(files_of_member),
        # solved even if it diverges
        summary=FOLDING["summary"],
    output:
        table=COMPARED_MEMBER,
        coefficients=MEMBER_COEFFICIENTS,
    params:
        observed=lambda w: {brain: BRAINS[brain].population_name for brain in sweep_run(w).observed},
        population=lambda w: BRAINS[w.brain].population_name,
        parts=lambda w: ["whole", *BRAINS[w.brain].sides],
    script:
        "../scripts/compare_member.py"


rule sweep_tables:
    input:
        comparisons=from_members(COMPARED_MEMBER),
        coefficients=from_members(MEMBER_COEFFICIENTS),
        params=from_members(PARAMETERS),
        summaries=from_members(FOLDING["summary"]),
        zones=from_members(FOLDING["zones"]),
        noise=f"{workflow.basedir}/norms/repeatability.yaml",
    output:
        members=f"{SWEEP}/members.csv",
        comparison=f"{SWEEP}/comparison.csv",
        nearest=f"{SWEEP}/nearest.csv",
    params:
        members=lambda w: [
            {"run": row.run, "subject": row.brain, "values": row.values} for row in SWEEPS[w.sweep]
        ],
        week=lambda w: SWEEPS[w.sweep][0].week,
    script:
        "../scripts/sweep_tables.py"


rule sweeps:
    input:
        expand(list(rules.sweep_tables.output), sweep=SWEEPS),


# figures and tables of the paper; observed brains are measured only at the weeks of comparison
rule paper:
    input:
        figure_files("inputs_figure", "growth_figure", "weekly_figure", "outlines_figure", "displacement_maps"),
        figure_files("zones_figure", "model_figure", "run_tables", "paper_displacement_figure"),
        figure_files("influence_figure", "influence_spectra", "paper_nearest_figure"),
        rules.growth_rates.output if study.growth_brains else [],
        rules.sweeps.input,
