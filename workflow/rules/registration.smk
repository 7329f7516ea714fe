# Correspondence between brains of successive weeks: where each point of a start brain goes in the real ones.
if workflow.is_main_process:
    for series, cause in PLAN.chains.unmatched_starts.items():
        print(
            f"gyriflow: no local growth from the surfaces of {series}: {cause}",
            file=sys.stderr,
        )


rule surface_mask:
    input:
        PIAL["whole"],
    output:
        MASK,
    params:
        voxel_mm=CONFIG.surface.edge_length_mm,
    script:
        "../scripts/surface_mask.py"


rule register:
    input:
        earlier=lambda wildcards: PLAN.brains.registered_volume(wildcards.earlier),
        later=lambda wildcards: PLAN.brains.registered_volume(wildcards.later),
    output:
        REGISTERED,
    wildcard_constraints:
        earlier=one_of(PLAN.brains.ids),
        later=one_of(PLAN.brains.ids),
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        brains=of(PLAN.chains.registered),
    script:
        "../scripts/register.py"


# the surfaces as they are given, with all their vertices, in the pose of the mesh
rule matched_surface:
    input:
        lambda wildcards: CONFIG.brain(wildcards.brain).files,
        report=PIAL["report"],
    output:
        MATCHED_SURFACE,
    wildcard_constraints:
        brain=one_of(sorted(set().union(*PLAN.chains.matched_series.values()))),
    params:
        **of_brain("files"),
    script:
        "../scripts/matched_surface.py"


rule match_surfaces:
    input:
        earlier=MATCHED_SURFACE.format(brain="{earlier}"),
        later=MATCHED_SURFACE.format(brain="{later}"),
        earlier_report=PIAL["report"].format(brain="{earlier}"),
        later_report=PIAL["report"].format(brain="{later}"),
    output:
        MATCHED,
    wildcard_constraints:
        earlier=one_of(PLAN.brains.ids),
        later=one_of(PLAN.brains.ids),
    script:
        "../scripts/match_surfaces.py"


# the shapes that the mesh of a start brain is to have in later weeks, for runs that grow towards them
rule targets:
    input:
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        correspondences=of(PLAN.expecting.correspondences),
        surfaces=of(PLAN.expecting.surfaces),
        reports=of(PLAN.expecting.reports),
    output:
        TARGETS,
    wildcard_constraints:
        whose="self|atlas",
    resources:
        mem_mb=8000,
        runtime=30,
    params:
        start_week=lambda wildcards: CONFIG.brain(wildcards.brain).week,
        weeks=of(PLAN.expecting.weeks),
        further_weeks=of(PLAN.expecting.further_weeks),
        posed=of(PLAN.expecting.posed),
    script:
        "../scripts/targets.py"


rule carried_mesh:
    input:
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        later=of(PLAN.chains.correspondences_later),
    output:
        CARRIED_MESH,
    wildcard_constraints:
        brain=one_of(PLAN.chains.carried),
    resources:
        mem_mb=8000,
        runtime=30,
    params:
        weeks=of(PLAN.chains.later_weeks),
    script:
        "../scripts/carried_mesh.py"
