# Correspondences between brains of successive weeks, and the targets of start brains.
if workflow.is_main_process:
    for series, cause in study.unmatched_starts.items():
        print(
            f"gyriflow: surfaces of {series} are not matched by their vertices: {cause}",
            file=sys.stderr,
        )


rule surface_mask:
    input:
        PIAL["whole"],
    output:
        MASK,
    log:
        f"{BRAIN}/logs/surface_mask.log",
    benchmark:
        f"{BRAIN}/benchmarks/surface_mask.tsv"
    conda:
        ENVIRONMENT
    params:
        voxel_mm=CONFIG.surface.edge_length_mm,
    script:
        "../scripts/surface_mask.py"


def pair_of(wildcards):
    """Return the two brains of the wildcards."""
    return study.brains[wildcards.earlier], study.brains[wildcards.later]


rule register:
    input:
        brains=lambda w: [brain.registered.path for brain in pair_of(w)],
        images=lambda w: [brain.config.image for brain in pair_of(w) if brain.config.image],
    output:
        REGISTERED,
    log:
        f"{STUDY}/logs/register.{{earlier}}.{{later}}.log",
    benchmark:
        f"{STUDY}/benchmarks/register.{{earlier}}.{{later}}.tsv"
    priority: 1
    conda:
        ENVIRONMENT
    params:
        brains=lambda w: [brain.registered for brain in pair_of(w)],
        images=lambda w: [brain.config.image for brain in pair_of(w)],
    script:
        "../scripts/register.py"


# the original surfaces with all their vertices, in the pose of the mesh
rule match_surfaces:
    input:
        lambda w: [path for brain in pair_of(w) for path in brain.config.files],
        reports=lambda w: [brain.report for brain in pair_of(w)],
    output:
        MATCHED,
    log:
        f"{STUDY}/logs/match_surfaces.{{earlier}}.{{later}}.log",
    benchmark:
        f"{STUDY}/benchmarks/match_surfaces.{{earlier}}.{{later}}.tsv"
    conda:
        ENVIRONMENT
    params:
        files=lambda w: [brain.config.files for brain in pair_of(w)],
    script:
        "../scripts/match_surfaces.py"


def chain_of(wildcards):
    """Return the brains on which the growth of a start brain was measured."""
    return study.chains[wildcards.brain, wildcards.origin]


# shapes of a start brain's mesh in later weeks, for runs that grow towards them
rule targets:
    input:
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        correspondences=lambda w: chain_of(w).correspondences,
        surfaces=lambda w: [brain.pial for brain in chain_of(w).later],
        reports=lambda w: [brain.report for brain in chain_of(w).later],
    output:
        TARGETS,
    log:
        f"{BRAIN}/logs/targets.{{origin}}.log",
    benchmark:
        f"{BRAIN}/benchmarks/targets.{{origin}}.tsv"
    wildcard_constraints:
        origin="self|atlas",
    priority: 1
    conda:
        ENVIRONMENT
    resources:
        mem_mb=8000,
    params:
        start_week=lambda w: brain_of(w).week,
        weeks=lambda w: chain_of(w).later_weeks,
        further_weeks=lambda w: chain_of(w).further_weeks,
        posed=lambda w: chain_of(w).posed,
        by_size=lambda w: w.origin == "atlas" and CONFIG.growth.atlas_ages == "size",
    script:
        "../scripts/targets.py"
