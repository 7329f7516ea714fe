# Figures of studies: how what is varied changes the folds at the week of comparison, and what comes nearest to real brains.
INFLUENCE = f"{STUDY}/{{study}}/figures"


def study_start(study):
    """Returns the brain that the figures of a study are of: the first that its runs fold."""
    return members(study)[0][1]


def shown_members(study):
    """Returns the runs of a study from its start, in order."""
    start = study_start(study)
    return [run for run, brain in members(study) if brain == start]


def shown_brain(study):
    """Returns the real brain that a study's runs are shown beside, in a list; none where there is none."""
    return real_brains(study, study_start(study))[:1]


def reached_runs(study):
    """Returns the runs of a study that have come to the week; for inputs of rules, once all are solved."""
    start = study_start(study)
    return [run for run, brain in reached_members(study) if brain == start]


def member_files(study, surfaces, maps):
    """Returns the hemispheres of a study's runs and of the real brain, and their maps, where a run has come to the week."""
    start = study_start(study)
    tag = week_tag(CONFIG.studies[study].compare_week)
    folders = [
        (
            f"results/runs/{run}/{start}/surfaces/week-{tag}",
            measured_at(study, run, start),
        )
        for run in reached_runs(study)
    ]
    folders += [
        (f"results/brains/{brain}/surface", f"results/brains/{brain}/metrics")
        for brain in shown_brain(study)
    ]
    sides = sides_of(start)
    return {
        surfaces: [
            f"{own}/{side}.pial.surf.gii" for own, _ in folders for side in sides
        ],
        maps: [f"{own}/{side}.shape.gii" for _, own in folders for side in sides],
    }


rule influence_figure:
    input:
        unpack(lambda wildcards: member_files(wildcards.study, "surfaces", "maps")),
    output:
        **figure(
            f"{INFLUENCE}/influence",
            "influence on the folds",
            "influence.rst",
            "Studies",
        ),
    log:
        f"{STUDY}/{{study}}/logs/influence_figure.log",
    benchmark:
        f"{STUDY}/{{study}}/benchmarks/influence_figure.tsv"
    wildcard_constraints:
        study=one_of(CONFIG.studies),
    conda:
        ENVIRONMENT
    params:
        synthetic=lambda wildcards: CONFIG.brain(study_start(wildcards.study)).synthetic,
        dpi=CONFIG.report.dpi,
        runs=lambda wildcards: shown_members(wildcards.study),
        reached=lambda wildcards: reached_runs(wildcards.study),
        members=lambda wildcards: [
            dict(member.values) for member in CONFIG.members[wildcards.study]
        ],
        sides=lambda wildcards: len(sides_of(study_start(wildcards.study))),
        measured=lambda wildcards: CONFIG.measured_name(shown_brain(wildcards.study)),
        week=lambda wildcards: CONFIG.studies[wildcards.study].compare_week,
    script:
        "../scripts/influence_figure.py"


rule influence_spectra:
    input:
        lambda wildcards: [
            f"{folder}/spectra.csv"
            for folder in [
                *(
                    measured_at(wildcards.study, run, study_start(wildcards.study))
                    for run in reached_runs(wildcards.study)
                ),
                *(
                    f"results/brains/{brain}/metrics"
                    for brain in shown_brain(wildcards.study)
                ),
            ]
        ],
    output:
        **figure(
            f"{INFLUENCE}/spectra",
            "influence on the spectrum of the folds",
            "influence_spectra.rst",
            "Studies",
        ),
    log:
        f"{STUDY}/{{study}}/logs/influence_spectra.log",
    benchmark:
        f"{STUDY}/{{study}}/benchmarks/influence_spectra.tsv"
    wildcard_constraints:
        study=one_of(CONFIG.studies),
    conda:
        ENVIRONMENT
    params:
        **{
            name: value
            for name, value in rules.influence_figure.params.items()
            if name not in ("sides", "reached")
        },
    script:
        "../scripts/influence_spectra.py"


rule nearest_figure:
    input:
        comparison=rules.study_tables.output.comparison_csv,
        nearest=rules.study_tables.output.nearest_csv,
    output:
        **figure(
            f"{INFLUENCE}/nearest",
            "what comes nearest to the real brain",
            "nearest.rst",
            "Studies",
        ),
    log:
        f"{STUDY}/{{study}}/logs/nearest_figure.log",
    benchmark:
        f"{STUDY}/{{study}}/benchmarks/nearest_figure.tsv"
    wildcard_constraints:
        study=one_of(CONFIG.studies),
    conda:
        ENVIRONMENT
    params:
        synthetic=rules.influence_figure.params.synthetic,
        dpi=CONFIG.report.dpi,
        varied=lambda wildcards: list(CONFIG.studies[wildcards.study].vary)[0],
        subject=lambda wildcards: study_start(wildcards.study),
        real=lambda wildcards: shown_brain(wildcards.study),
        week=lambda wildcards: CONFIG.studies[wildcards.study].compare_week,
    script:
        "../scripts/nearest_figure.py"


# studies that vary one number are a line over it
SWEEPS = [
    name
    for name, study in CONFIG.studies.items()
    if len(study.vary) == 1
    and shown_brain(name)
    and all(isinstance(value, (int, float)) for value in list(study.vary.values())[0])
]


rule influence_figures:
    input:
        expand(
            rules.influence_figure.output + rules.influence_spectra.output,
            study=CONFIG.studies,
        ),
        expand(rules.nearest_figure.output, study=SWEEPS),
