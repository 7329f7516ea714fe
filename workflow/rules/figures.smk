# Figures and tables of the registry, `gyriflow.study.figures`: each row that is drawn has a rule.
from dataclasses import replace

FIGURES = replace(PLAN.figures, reaches=reaches)
DRAW = Path(workflow.basedir, "workflow", "scripts", "draw.py")

for row in FIGURES.drawn:

    rule:
        name:
            row.name
        input:
            lambda wildcards, row=row: row.files(**dict(wildcards)),
        output:
            row.outputs,
        wildcard_constraints:
            measure=one_of(SHAPE_MEASURES),
            study=one_of(CONFIG.studies),
        params:
            draw=row.draw,
            inputs=lambda wildcards, row=row: row.inputs(**dict(wildcards)),
            options=lambda wildcards, row=row: row.options(**dict(wildcards)),
            dpi=CONFIG.report.dpi if row.path.endswith(".png") else None,
            code=code_hash(
                DRAW,
                Path(SOURCE, "gyriflow", "report", f"{row.module}.py"),
                function=row.function,
            ),
        script:
            "../scripts/draw.py"


rule figures:
    input:
        FIGURES.target("figures", "growth"),


rule influence_figures:
    input:
        FIGURES.target("influence_figures"),


# the figures and tables of the paper; brains are measured at the weeks of comparison only
rule paper:
    input:
        FIGURES.target("paper"),
        rules.growth_rates.output if study.growing else [],
        rules.replication.output,
        rules.studies.input,
