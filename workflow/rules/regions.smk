# Regions of the cortex: given on some brains, carried to others by registration, and to simulated ones with the tissue.
REGIONED = [
    brain.id
    for brain in CONFIG.brains
    if CONFIG.regions_from(brain.id) == brain.id
    or (CONFIG.regions_from(brain.id) and brain.source != "shape")
]
GIVEN = [brain for brain in REGIONED if CONFIG.regions_from(brain) == brain]
REGIONED_RUNS = [(run, brain) for run, brain in FOLDED if brain in REGIONED]
# where metrics by region lie under results
WITH_REGIONS = [
    *(f"brains/{brain}/metrics" for brain in REGIONED),
    *(
        f"runs/{run}/{brain}/metrics/week-{week}"
        for run, brain in REGIONED_RUNS
        for week in week_tags(run, brain)
    ),
]


def region_files(folder):
    """Returns the files with the regions of both hemispheres in a folder."""
    return {f"{side}_regions": f"{folder}/{side}.regions.label.gii" for side in SIDES}


def region_settings(wildcards):
    """Returns the regions that are given on a brain."""
    return CONFIG.metrics.regions[wildcards.brain]


def source_of_regions(pattern):
    """Returns an input function: a file of the brain whose regions a brain gets."""
    return lambda wildcards: pattern.format(brain=CONFIG.regions_from(wildcards.brain))


def regions_in(where):
    """Returns the folder with the regions of what is measured in a folder: those of a run hold at all its weeks."""
    return where if where.startswith("brains/") else where.rsplit("/", 1)[0]


rule given_regions:
    input:
        unpack(lambda wildcards: region_settings(wildcards).files),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
    output:
        **region_files(f"{BRAIN}/metrics"),
    log:
        f"{BRAIN}/logs/given_regions.log",
    benchmark:
        f"{BRAIN}/benchmarks/given_regions.tsv"
    wildcard_constraints:
        brain=one_of(GIVEN),
    conda:
        ENVIRONMENT
    params:
        names=lambda wildcards: region_settings(wildcards).names,
        affine_from=lambda wildcards: CONFIG.brain(wildcards.brain).affine_from,
    script:
        "../scripts/given_regions.py"


rule carried_regions:
    input:
        **{
            name: source_of_regions(file)
            for name, file in region_files(f"{BRAIN}/metrics").items()
        },
        given_left=source_of_regions(PIAL["left"]),
        given_right=source_of_regions(PIAL["right"]),
        given_report=source_of_regions(PIAL["report"]),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
        correspondence=lambda wildcards: correspondence(
            CONFIG.regions_from(wildcards.brain), wildcards.brain
        ),
    output:
        **region_files(f"{BRAIN}/metrics"),
    log:
        f"{BRAIN}/logs/carried_regions.log",
    benchmark:
        f"{BRAIN}/benchmarks/carried_regions.tsv"
    wildcard_constraints:
        brain=one_of(brain for brain in REGIONED if brain not in GIVEN),
    conda:
        ENVIRONMENT
    params:
        # masks of surfaces are in the surfaces' own pose
        posed=lambda wildcards: [
            not CONFIG.brain(brain).has_labels
            and not matched(CONFIG.regions_from(wildcards.brain), wildcards.brain)
            for brain in (CONFIG.regions_from(wildcards.brain), wildcards.brain)
        ],
    script:
        "../scripts/carried_regions.py"


rule simulated_regions:
    input:
        **region_files(f"{BRAIN}/metrics"),
        left=PIAL["left"],
        right=PIAL["right"],
        mesh=rules.regions.output.mesh,
        data=rules.regions.output.data,
    output:
        **region_files(f"{RUN}/metrics"),
    log:
        f"{RUN}/logs/simulated_regions.log",
    benchmark:
        f"{RUN}/benchmarks/simulated_regions.tsv"
    wildcard_constraints:
        brain=one_of(REGIONED),
    conda:
        ENVIRONMENT
    script:
        "../scripts/simulated_regions.py"


rule region_metrics:
    input:
        unpack(lambda wildcards: region_files(f"results/{regions_in(wildcards.where)}")),
        unpack(
            lambda wildcards: surfaces_in(f"results/{surface_folder(wildcards.where)}")
        ),
        left_maps=rules.measure.output.left,
        right_maps=rules.measure.output.right,
    output:
        "results/{where}/regions.csv",
    log:
        "results/{where}/logs/region_metrics.log",
    benchmark:
        "results/{where}/benchmarks/region_metrics.tsv"
    wildcard_constraints:
        where=one_of(WITH_REGIONS),
    conda:
        ENVIRONMENT
    params:
        labels=lambda wildcards: brain_labels(wildcards.where),
    script:
        "../scripts/region_metrics.py"
