# Figures and tables of the registry, `gyriflow.study.figures`: what is drawn has a rule for each kind.
DRAW = Path(workflow.basedir, "workflow", "scripts", "draw.py")


def inputs_of(figure):
    """Return the inputs of a figure; which members of studies have come to their week is known once they are solved."""
    ended = (run for run, brain, week in figure.may_end if not reaches(run, brain, week))
    return figure.inputs_without(ended)


for name, figures in by_rule(FIGURES).items():
    some = next(iter(figures.values()))
    drawn_in = some.draw.rpartition(".")[0]

    def figure_of(wildcards, figures=figures, pattern=some.pattern):
        return figures[pattern.format(**dict(wildcards))]

    rule:
        name:
            name
        input:
            lambda wildcards, of=figure_of: files_in(inputs_of(of(wildcards))),
        output:
            some.outputs,
        log:
            figure_log(name, some.pattern),
        wildcard_constraints:
            **{
                key: one_of(dict.fromkeys(figure.names[key] for figure in figures.values()))
                for key in some.names
                if f"{{{key}}}" in some.pattern
            },
        conda:
            ENVIRONMENT
        params:
            draw=some.draw,
            inputs=lambda wildcards, of=figure_of: inputs_of(of(wildcards)),
            options=lambda wildcards, of=figure_of: of(wildcards).options,
            code=code_hash(
                DRAW,
                Path(SOURCE, "gyriflow", "report", f"{drawn_in}.py"),
                function=name,
            ),
        script:
            "../scripts/draw.py"


rule figures:
    input:
        asked_for(FIGURES, "figures", "growth"),


rule influence_figures:
    input:
        asked_for(FIGURES, "influence_figures"),


# the figures and tables of the paper; brains are measured at the weeks of comparison only
rule paper:
    input:
        asked_for(FIGURES, "paper"),
        rules.growth_rates.output if study.growing else [],
        rules.replication.output if study.folded else [],
        rules.studies.input,
