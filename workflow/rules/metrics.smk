# Metrics of brains, measured and simulated: one rule, so that both go through the same code with the same settings.
def surface_folder(where):
    """Returns the folder with the surfaces that metrics in a folder belong to."""
    return (
        where.removesuffix("/metrics") + "/surface"
        if where.startswith("brains/")
        else where.replace("/metrics/", "/surfaces/")
    )


def brain_labels(where):
    """Returns the first columns of a brain's tables: its id, the run ("real" for measured brains), its week."""
    match where.split("/"):
        case ["brains", brain, "metrics"]:
            return {"subject": brain, "run": "real", "week": CONFIG.brain(brain).week}
        case ["runs", run, brain, "metrics", week]:
            return {
                "subject": brain,
                "run": run,
                "week": float(week.removeprefix("week-")),
            }


def thickness_of(wildcards):
    """Returns the file with the thickness of a brain's cortex, where it is known."""
    folder = f"results/{surface_folder(wildcards.where)}"
    match wildcards.where.split("/"):
        case ["brains", brain, "metrics"] if brain in (*WITH_CORTEX, *WITH_WHITE):
            return f"{folder}/measured_thickness.shape.gii"
        case ["runs", *_]:
            return f"{folder}/thickness.shape.gii"
    return []


# where the metrics of a brain lie under results
MEASURED = [f"brains/{brain}/metrics" for brain in BRAINS]
SIMULATED = of_weeks("runs/{run}/{brain}/metrics/week-{week}")
# the brains of runs of studies, at the weeks of comparison
COMPARED_MEMBERS = sorted(
    {
        f"runs/{member.run}/{brain}/metrics/week-{week_tag(study.compare_week)}"
        for name, study in CONFIG.studies.items()
        for member in CONFIG.members[name]
        for brain in CONFIG.starts(member.run)
    }
    - set(SIMULATED)
)


# Only a common number of modes makes brains depend on each other: measured ones then wait for all simulations.
rule weyl_numbers:
    input:
        left=[
            f"results/{surface_folder(where)}/left.pial.surf.gii"
            for where in MEASURED + SIMULATED
        ],
        right=[
            f"results/{surface_folder(where)}/right.pial.surf.gii"
            for where in MEASURED + SIMULATED
        ],
    output:
        f"{STUDY}/weyl_numbers.csv",
    log:
        f"{STUDY}/logs/weyl_numbers.log",
    benchmark:
        f"{STUDY}/benchmarks/weyl_numbers.tsv"
    conda:
        ENVIRONMENT
    resources:
        runtime=20,
    params:
        labels=[brain_labels(where) for where in MEASURED + SIMULATED],
        formula=CONFIG.metrics.spangy_wavelength,
    script:
        "../scripts/weyl_numbers.py"


rule measure:
    input:
        unpack(
            lambda wildcards: surfaces_in(f"results/{surface_folder(wildcards.where)}")
        ),
        thickness=thickness_of,
        mode_numbers=(
            rules.weyl_numbers.output[0]
            if CONFIG.metrics.spangy_modes == "common"
            else []
        ),
    output:
        metrics="results/{where}/metrics.csv",
        spectra="results/{where}/spectra.csv",
        coefficients="results/{where}/coefficients.csv",
        left="results/{where}/left.shape.gii",
        right="results/{where}/right.shape.gii",
    log:
        "results/{where}/logs/measure.log",
    benchmark:
        "results/{where}/benchmarks/measure.tsv"
    wildcard_constraints:
        where=one_of(MEASURED + SIMULATED + COMPARED_MEMBERS),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        labels=lambda wildcards: brain_labels(wildcards.where),
        settings=CONFIG.metrics.model_dump(exclude={"age_reference"}),
    script:
        "../scripts/measure.py"


rule displacement:
    input:
        rules.simulate.output.frames,
    output:
        f"{RUN}/metrics/displacement.csv",
    log:
        f"{RUN}/logs/displacement.log",
    benchmark:
        f"{RUN}/benchmarks/displacement.tsv"
    conda:
        ENVIRONMENT
    params:
        labels=lambda wildcards: {"subject": wildcards.brain, "run": wildcards.run},
    script:
        "../scripts/displacement.py"


rule similarity:
    input:
        simulated=list(surfaces_in(f"{RUN}/surfaces/week-{{week}}").values()),
        real=list(surfaces_in("results/brains/{measured}/surface").values()),
    output:
        f"{RUN}/metrics/week-{{week}}/similarity.{{measured}}.csv",
    log:
        f"{RUN}/logs/similarity.week-{{week}}.{{measured}}.log",
    benchmark:
        f"{RUN}/benchmarks/similarity.week-{{week}}.{{measured}}.tsv"
    wildcard_constraints:
        measured=one_of(BRAINS),
    conda:
        ENVIRONMENT
    resources:
        runtime=20,
    params:
        labels=lambda wildcards: {
            "subject": wildcards.brain,
            "run": wildcards.run,
            "week": float(wildcards.week),
            "real": wildcards.measured,
        },
        parts=list(SURFACES),
    script:
        "../scripts/similarity.py"
