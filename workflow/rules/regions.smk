# Regions of the cortex: given on some brains, carried to others by registration, and to simulated ones with the tissue;
# where none are given, named sulci. Maps of all brains at the vertices of one, the template.
from gyriflow.config.atlas import SULCI


rule given_regions:
    input:
        unpack(lambda wildcards: CONFIG.metrics.regions[wildcards.brain].files),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=one_of(PLAN.measuring.given),
    params:
        **of_brain("affine_from"),
        names=lambda wildcards: CONFIG.metrics.regions[wildcards.brain].names,
    script:
        "../scripts/given_regions.py"


rule carried_regions:
    input:
        unpack(of(PLAN.chains.given_regions)),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=one_of(
            brain
            for brain in PLAN.measuring.regioned
            if brain not in [*PLAN.measuring.given, *PLAN.measuring.named]
        ),
    params:
        posed=of(PLAN.chains.posed),
    script:
        "../scripts/carried_regions.py"


rule named_sulci:
    input:
        volume=of(PLAN.brains.registered_volume),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
        drawing=SULCI / "sulci.yaml",
        drawn=SULCI / "sulci.nii.gz",
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=one_of(PLAN.measuring.named),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        own=of(PLAN.chains.named),
    script:
        "../scripts/named_sulci.py"


rule simulated_regions:
    input:
        **region_files(f"{BRAIN}/metrics"),
        **REGIONS,
        left=PIAL["left"],
        right=PIAL["right"],
    output:
        **region_files(f"{RUN}/metrics"),
    wildcard_constraints:
        brain=one_of(PLAN.measuring.regioned),
    script:
        "../scripts/simulated_regions.py"


rule region_metrics:
    input:
        unpack(lambda wildcards: PLAN.measuring.at(wildcards.where).regions),
        unpack(lambda wildcards: PLAN.measuring.at(wildcards.where).parts),
        left_maps=maps_of("left")["left"],
        right_maps=maps_of("right")["right"],
    output:
        "results/{where}/regions.csv",
    wildcard_constraints:
        where=one_of(brain.where for brain in PLAN.measuring.with_regions),
    params:
        labels=lambda wildcards: PLAN.measuring.at(wildcards.where).labels,
    script:
        "../scripts/region_metrics.py"


rule template_maps:
    input:
        unpack(of(PLAN.measuring.template_files)),
        correspondence=lambda wildcards: PLAN.chains.to_template(
            PLAN.measuring.at(wildcards.where).subject
        ),
        maps="results/{where}/{side}.shape.gii",
    output:
        TEMPLATE_MAPS,
    wildcard_constraints:
        where=one_of(brain.where for brain in PLAN.measuring.every),
    params:
        posed=lambda wildcards: PLAN.chains.in_pose(
            CONFIG.metrics.template, PLAN.measuring.at(wildcards.where).subject
        ),
    script:
        "../scripts/template_maps.py"
