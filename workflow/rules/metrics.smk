# Metrics of brains, measured and simulated: one rule, so that both go through the same code with the same settings.
rule measure:
    input:
        unpack(lambda wildcards: PLAN.measuring.at(wildcards.where).parts),
        thickness=lambda wildcards: PLAN.measuring.at(wildcards.where).thickness,
        report=lambda wildcards: PLAN.measuring.at(wildcards.where).report,
    output:
        **MEASURES,
        **maps_of(*SIDES),
    wildcard_constraints:
        where=one_of(PLAN.measuring.of_sides(*SIDES)),
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        labels=lambda wildcards: PLAN.measuring.at(wildcards.where).labels,
        settings=CONFIG.metrics.model_dump(
            include={
                "curvature_radius_mm",
                "spangy_proxy",
                "spangy_modes",
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
        where=one_of(PLAN.measuring.of_sides("left")),


use rule measure as measure_right with:
    output:
        **MEASURES,
        **maps_of("right"),
    wildcard_constraints:
        where=one_of(PLAN.measuring.of_sides("right")),


rule white:
    input:
        unpack(lambda wildcards: PLAN.measuring.of_brain(wildcards.brain).parts),
        report=PIAL["report"],
        source=lambda wildcards: list(
            PLAN.measuring.white_source(wildcards.brain).values()
        ),
    output:
        **white_of(*SIDES),
    wildcard_constraints:
        brain=one_of(PLAN.measuring.with_white(*SIDES)),
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        **of_brain("affine_from"),
        labels=lambda wildcards: PLAN.measuring.of_brain(wildcards.brain).labels,
        scheme=of(PLAN.brains.scheme),
        # exchanged files are the same inputs to Snakemake
        source=of(PLAN.measuring.white_source),
        surface=CONFIG.surface.model_dump(
            include={
                "smoothing_voxels",
                "edge_length_mm",
                "smoothing_iterations",
                "max_hole_mm",
            }
        ),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/white.py"


use rule white as white_left with:
    output:
        **white_of("left"),
    wildcard_constraints:
        brain=one_of(PLAN.measuring.with_white("left")),


use rule white as white_right with:
    output:
        **white_of("right"),
    wildcard_constraints:
        brain=one_of(PLAN.measuring.with_white("right")),


rule displacement:
    input:
        FOLDING["frames"],
    output:
        DISPLACEMENT,
    params:
        labels=lambda wildcards: {"subject": wildcards.brain, "run": wildcards.run},
    script:
        "../scripts/displacement.py"


rule similarity:
    input:
        unpack(of(PLAN.measuring.similarity)),
    output:
        SIMILARITY,
    wildcard_constraints:
        measured=one_of(PLAN.brains.ids),
    resources:
        runtime=20,
    params:
        labels=lambda wildcards: {
            "subject": wildcards.brain,
            "run": wildcards.run,
            "week": float(wildcards.week),
            "real": wildcards.measured,
        },
        parts=lambda wildcards: ["whole", *CONFIG.brain(wildcards.brain).sides],
    script:
        "../scripts/similarity.py"


rule label_volumes:
    input:
        labels=of(PLAN.brains.label_volume),
        norms=f"{workflow.basedir}/norms/svrtk-volumes.yaml",
    output:
        **VOLUMES,
    wildcard_constraints:
        brain=one_of(PLAN.brains.with_volumes),
    params:
        **of_brain("affine_from", "sides"),
        labels=lambda wildcards: PLAN.measuring.at(
            f"brains/{wildcards.brain}/metrics"
        ).labels,
        scheme=of(PLAN.brains.scheme),
    script:
        "../scripts/label_volumes.py"
