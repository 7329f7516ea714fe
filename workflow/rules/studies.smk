# Studies: runs that differ from one in a few parameters, measured at one week and compared with real brains of it.
#
# results/study/STUDY/ holds members (a row a run: values, resolution, outcome with its cause, time), comparison (how far
# each is from each real brain by each measure), and nearest (which is nearest, with the paper's beside it), each as CSV,
# Markdown and LaTeX. A run that has diverged before the week of comparison stands in `members` alone.
PUBLISHED = f"{workflow.basedir}/workflow/published/fetalfoldsim.yaml"
TABLES = f"{STUDY}/tables"


def printed(path):
    """Returns the files of a table for print, by kind."""
    return {kind: f"{path}.{kind}" for kind in ("csv", "md", "tex")}


def members(study):
    """Returns (run, brain) for each run of a study and each brain that it folds, in the order of the study."""
    return [
        (member.run, brain)
        for member in CONFIG.members[study]
        for brain in CONFIG.starts(member.run)
    ]


def measured_at(study, run, brain):
    """Returns the folder of the metrics of a study's run at the week of comparison."""
    tag = week_tag(CONFIG.studies[study].compare_week)
    return f"results/runs/{run}/{brain}/metrics/week-{tag}"


def real_brains(study, brain):
    """Returns the real brains that the runs of a study from a brain are compared with."""
    return CONFIG.compared_with(CONFIG.studies[study], brain)


def reached_members(study):
    """Returns the members of a study that have come to the week of comparison; for inputs of rules, once all are solved."""
    week = CONFIG.studies[study].compare_week
    return [pair for pair in members(study) if reaches(*pair, week)]


def tables_of_member(wildcards):
    """Returns the tables of a run at the week of comparison and of the real brains, none where it has not come there."""
    study, run, brain = wildcards.study, wildcards.run, wildcards.brain
    if not reaches(run, brain, CONFIG.studies[study].compare_week):
        return {}
    own, real = measured_at(study, run, brain), real_brains(study, brain)
    folders = [own, *(f"results/brains/{name}/metrics" for name in real)]
    return {
        "metrics": [f"{folder}/metrics.csv" for folder in folders],
        "spectra": [f"{folder}/spectra.csv" for folder in folders],
        "similarity": [f"{own}/similarity.{name}.csv" for name in real],
    }


def population_of(brain):
    """Returns what a brain is called in tables: its population, or that it is synthetic or of unknown population."""
    found = CONFIG.brain(brain)
    return found.population or ("synthetic" if found.synthetic else "unknown")


rule compare_member:
    input:
        unpack(tables_of_member),
        # solved in any case
        summary=rules.simulate.output.summary,
    output:
        f"{STUDY}/{{study}}/members/{{run}}/{{brain}}.csv",
    log:
        f"{STUDY}/{{study}}/logs/compare_member.{{run}}.{{brain}}.log",
    benchmark:
        f"{STUDY}/{{study}}/benchmarks/compare_member.{{run}}.{{brain}}.tsv"
    wildcard_constraints:
        study=one_of(CONFIG.studies),
    conda:
        ENVIRONMENT
    params:
        real=lambda wildcards: {
            name: population_of(name)
            for name in real_brains(wildcards.study, wildcards.brain)
        },
        population=lambda wildcards: population_of(wildcards.brain),
    script:
        "../scripts/compare_member.py"


rule study_tables:
    input:
        comparisons=lambda wildcards: [
            f"{STUDY}/{wildcards.study}/members/{run}/{brain}.csv"
            for run, brain in members(wildcards.study)
        ],
        params=lambda wildcards: [
            rules.parameters.output[0].format(run=run, brain=brain)
            for run, brain in members(wildcards.study)
        ],
        summaries=lambda wildcards: [
            rules.simulate.output.summary.format(run=run, brain=brain)
            for run, brain in members(wildcards.study)
        ],
        zones=lambda wildcards: [
            rules.simulate.output.zones.format(run=run, brain=brain)
            for run, brain in members(wildcards.study)
        ],
        published=PUBLISHED,
    output:
        **{
            f"{name}_{kind}": path
            for name in ("members", "comparison", "nearest")
            for kind, path in printed(f"{STUDY}/{{study}}/{name}").items()
        },
    log:
        f"{STUDY}/{{study}}/logs/study_tables.log",
    benchmark:
        f"{STUDY}/{{study}}/benchmarks/study_tables.tsv"
    wildcard_constraints:
        study=one_of(CONFIG.studies),
    conda:
        ENVIRONMENT
    params:
        members=lambda wildcards: [
            {"run": run, "subject": brain} for run, brain in members(wildcards.study)
        ],
        values=lambda wildcards: [
            dict(member.values)
            for member in CONFIG.members[wildcards.study]
            for _ in CONFIG.starts(member.run)
        ],
        week=lambda wildcards: CONFIG.studies[wildcards.study].compare_week,
    script:
        "../scripts/study_tables.py"


# what stands beside the paper's own tables
rule published_tables:
    input:
        published=PUBLISHED,
        params=of_runs(rules.parameters.output),
        displacement=of_runs(rules.displacement.output),
        rates=rules.growth_rates.output.rates if GROWTH_BRAINS else [],
        summaries=of_runs(rules.simulate.output.summary),
    output:
        **{
            f"{name}_{kind}": path
            for name in ("parameters", "displacement", "growth_rates", "cost")
            for kind, path in printed(f"{TABLES}/{name}").items()
        },
    log:
        f"{STUDY}/logs/published_tables.log",
    benchmark:
        f"{STUDY}/benchmarks/published_tables.tsv"
    conda:
        ENVIRONMENT
    params:
        folded=FOLDED,
        populations=[population_of(brain) for _, brain in FOLDED],
    script:
        "../scripts/published_tables.py"


rule studies:
    input:
        [
            expand(list(rules.study_tables.output), study=study)
            for study in CONFIG.studies
        ],
