# What the jobs took and warned of, and the report: one HTML page with the figures and tables of the registry.
from itertools import takewhile

PAGE = f"{workflow.basedir}/workflow/report/page"


rule study_resources:
    input:
        # logs and the files of benchmarks are no inputs: a lost one would have its stage run again
        rules.figures.input,
        rules.metrics.input,
        rules.quality_table.output,
    output:
        csv=f"{STUDY}/resources.csv",
        table=f"{STUDY}/resources.html",
        warnings=f"{STUDY}/warnings.csv",
    params:
        brains=[brain.id for brain in CONFIG.brains],
        # by rule, what the paths of its benchmark files look like; files of earlier configurations do not match
        benchmarks=lambda w: {
            job.name: job.benchmark.regex().pattern
            for job in takewhile(lambda job: job.name != "study_resources", workflow.rules)
            if job.benchmark
        },
        folded=study.pairs,
    script:
        "../scripts/study_resources.py"


# the report's own too: they are there where its page cannot be made
rule provenance:
    input:
        rules.figures.input,
        rules.metrics.input,
        rules.quality_table.output,
        run_params=study.files(PARAMETERS),
        summaries=study.files(FOLDING["summary"]),
        template=f"{PAGE}/methods.rst",
    output:
        study=f"{STUDY}/provenance.json",
        brains=expand(f"{BRAIN}/provenance.json", brain=study.brains),
        runs=study.files(f"{RUN}/provenance.json"),
        report="results/report/provenance.json",
        methods="results/report/methods.rst",
        # the configuration with its paths, for those who have the files
        config="results/report/config.yaml",
    params:
        config=study.used_settings,
        brains=[brain.given.model_dump(mode="json", exclude_defaults=True) for brain in study.brains.values()],
        files=study.input_files,
        folded=study.pairs,
        growth_of=[study.growth_of(one) for one in study.folded],
        method=study.method,
    script:
        "../scripts/provenance.py"


rule html_report:
    input:
        rules.figures.input,
        rules.metrics.input,
        rules.influence_figures.input,
        asked_for(FIGURES, "report", "quality"),
        runs=rules.study_runs.output.csv if study.folded else [],
        quality=rules.quality_table.output[0],
        warnings=rules.study_resources.output.warnings,
        validation=f"{STUDY}/validation.csv" if study.validated else [],
        view=asked_for(FIGURES, "view")[0],
        words=f"{workflow.basedir}/workflow/report/figures.yaml",
        provenance=rules.provenance.output.report,
        methods=rules.provenance.output.methods,
        page=f"{PAGE}/page.html",
        style=f"{PAGE}/style.css",
        three=f"{PAGE}/three.min.js",
        notice=f"{PAGE}/three.LICENSE.txt",
        controls=f"{PAGE}/OrbitControls.js",
        viewer=f"{PAGE}/viewer.js",
    output:
        "results/report/report.html",
    params:
        figures=[(figure.name, figure.path, dict(figure.names)) for figure in FIGURES if figure.target],
        brains=study.described_brains,
        config=study.used_settings,
    script:
        "../scripts/html_report.py"


rule report:
    input:
        rules.html_report.output,
        rules.provenance.output,


# what only moves text: no jobs of their own on a cluster, as targets
localrules:
    atlas_file,
    parameters,
    html_report,
