# Figures and tables of `workflow/figures.yaml`: a rule for each entry, called as it is, or as its key `rule` says.
DRAW = Path(workflow.basedir, "workflow", "scripts", "draw.py")


for name, jobs in by_rule(FIGURES).items():
    kinds = [figure.kind for figure in jobs[0]]

    def drawn(wildcards, jobs={job[0].path: job for job in jobs}, pattern=kinds[0].file):
        return jobs[pattern.format(**dict(wildcards))]

    rule:
        name:
            name
        input:
            lambda wildcards, drawn=drawn: files_in(
                [figure.reached_inputs(reaches) for figure in drawn(wildcards)]
            ),
        output:
            [file for kind in kinds for file in kind.outputs],
        wildcard_constraints:
            **{key: one_of(dict.fromkeys(job[0].names[key] for job in jobs)) for key in jobs[0][0].wildcards},
        conda:
            ENVIRONMENT
        params:
            figures=lambda wildcards, drawn=drawn: [
                {
                    "draw": figure.kind.draw,
                    "inputs": figure.reached_inputs(reaches),
                    "options": figure.options,
                    "files": figure.files,
                }
                for figure in drawn(wildcards)
            ],
            code=code_hash(
                DRAW,
                *(Path(SOURCE, "gyriflow", "report", f"{kind.draw.partition('.')[0]}.py") for kind in kinds),
            ),
        script:
            "../scripts/draw.py"


rule figures:
    input:
        target_files(FIGURES, "figures", "growth"),


rule influence_figures:
    input:
        target_files(FIGURES, "influence_figures"),


# figures and tables of the paper; observed brains are measured only at the weeks of comparison
rule paper:
    input:
        target_files(FIGURES, "paper"),
        rules.growth_rates.output if study.growth_brains else [],
        rules.studies.input,
