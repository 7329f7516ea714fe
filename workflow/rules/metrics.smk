# Metrics of brains, measured and simulated: one rule, so that both go through the same code with the same settings.
def surface_folder(where):
    """Returns the folder with the surfaces that metrics in a folder belong to."""
    return (
        where.removesuffix("/metrics") + "/surface"
        if where.startswith("brains/")
        else where.replace("/metrics/", "/surfaces/")
    )


def brain_of(where):
    """Returns the id of the brain that metrics in a folder are of: the measured one, or the start of the run."""
    kind, *names = where.split("/")
    return names[0] if kind == "brains" else names[1]


def of_sides(*sides):
    """Returns a pattern of the folders with metrics of brains that have these hemispheres."""
    return one_of(
        [
            where
            for where in MEASURED + SIMULATED + COMPARED_MEMBERS
            if sides_of(brain_of(where)) == sides
        ]
    )


def maps_of(*sides):
    """Returns the files with maps on some hemispheres, beside the metrics of a brain."""
    return {side: f"results/{{where}}/{side}.shape.gii" for side in sides}


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


# made for every brain, whatever hemispheres it has
MEASURES = {
    name: f"results/{{where}}/{name}.csv"
    for name in ("metrics", "spectra", "coefficients")
}
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


# brains whose labels can be counted
WITH_VOLUMES = [brain.id for brain in CONFIG.brains if brain.has_labels]


def report_of(wildcards):
    """Returns the report of a measured brain's surface, which has the volumes of its tissues."""
    match wildcards.where.split("/"):
        case ["brains", brain, "metrics"]:
            return PIAL["report"].format(brain=brain)
    return []


# Only a common number of modes makes brains depend on each other: measured ones then wait for all simulations.
rule weyl_numbers:
    input:
        [
            surfaces_in(f"results/{surface_folder(where)}")[side]
            for where in MEASURED + SIMULATED
            for side in sides_of(brain_of(where))
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
        sides=[sides_of(brain_of(where)) for where in MEASURED + SIMULATED],
        formula=CONFIG.metrics.spangy_wavelength,
    script:
        "../scripts/weyl_numbers.py"


rule measure:
    input:
        unpack(
            lambda wildcards: surfaces_in(
                f"results/{surface_folder(wildcards.where)}",
                sides_of(brain_of(wildcards.where)),
            )
        ),
        thickness=thickness_of,
        report=report_of,
        mode_numbers=(
            rules.weyl_numbers.output[0]
            if CONFIG.metrics.spangy_modes == "common"
            else []
        ),
    output:
        **MEASURES,
        **maps_of(*SIDES),
    log:
        "results/{where}/logs/measure.log",
    benchmark:
        "results/{where}/benchmarks/measure.tsv"
    wildcard_constraints:
        where=of_sides(*SIDES),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        labels=lambda wildcards: brain_labels(wildcards.where),
        settings=CONFIG.metrics.model_dump(
            include={
                "curvature_radius_mm",
                "spangy_proxy",
                "spangy_modes",
                "spangy_wavelength",
            }
        ),
    script:
        "../scripts/measure.py"


# of hemispheres that are alone
use rule measure as measure_left with:
    output:
        **MEASURES,
        **maps_of("left"),
    wildcard_constraints:
        where=of_sides("left"),


use rule measure as measure_right with:
    output:
        **MEASURES,
        **maps_of("right"),
    wildcard_constraints:
        where=of_sides("right"),


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
        simulated=lambda wildcards: list(
            surfaces_in(
                f"{RUN}/surfaces/week-{{week}}", sides_of(wildcards.brain)
            ).values()
        ),
        real=lambda wildcards: list(
            surfaces_in(
                "results/brains/{measured}/surface", sides_of(wildcards.brain)
            ).values()
        ),
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
        parts=lambda wildcards: ["whole", *sides_of(wildcards.brain)],
    script:
        "../scripts/similarity.py"


rule label_volumes:
    input:
        labels=label_volume,
        norms=f"{workflow.basedir}/norms/svrtk-volumes.yaml",
    output:
        volumes=f"{BRAIN}/metrics/volumes.csv",
        scores=f"{BRAIN}/metrics/published_centiles.csv",
    log:
        f"{BRAIN}/logs/label_volumes.log",
    benchmark:
        f"{BRAIN}/benchmarks/label_volumes.tsv"
    wildcard_constraints:
        brain=one_of(WITH_VOLUMES),
    conda:
        ENVIRONMENT
    params:
        labels=lambda wildcards: brain_labels(f"brains/{wildcards.brain}/metrics"),
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
        scheme=lambda wildcards: CONFIG.scheme(CONFIG.brain(wildcards.brain)),
        sides=lambda wildcards: sides_of(wildcards.brain),
    script:
        "../scripts/label_volumes.py"
