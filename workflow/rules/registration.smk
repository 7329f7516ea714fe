# Correspondence between brains of successive weeks: where each point of a start brain goes in the real ones.
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
    params:
        voxel_mm=CONFIG.surface.edge_length_mm,
    script:
        "../scripts/surface_mask.py"


rule register:
    input:
        earlier=lambda w: study.brains[w.earlier].registered_volume,
        later=lambda w: study.brains[w.later].registered_volume,
        images=lambda w: [image for name in (w.earlier, w.later) if (image := study.brains[name].given.image)],
    output:
        REGISTERED,
    priority: 1
    params:
        brains=lambda w: [study.brains[name].registered for name in (w.earlier, w.later)],
    script:
        "../scripts/register.py"


# the surfaces as they are given, with all their vertices, in the pose of the mesh
rule match_surfaces:
    input:
        lambda w: study.brains[w.earlier].given.files + study.brains[w.later].given.files,
        reports=[PIAL["report"].format(brain=name) for name in ("{earlier}", "{later}")],
    output:
        MATCHED,
    params:
        files=lambda w: [study.brains[name].given.files for name in (w.earlier, w.later)],
    script:
        "../scripts/match_surfaces.py"


def from_chain(attribute):
    """Return an input function: an attribute of the brains behind the growth of the start that the wildcards name."""
    return lambda wildcards: getattr(study.chains[wildcards.brain, wildcards.origin], attribute)


# the shapes that the mesh of a start brain is to have in later weeks, for runs that grow towards them
rule targets:
    input:
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        correspondences=from_chain("correspondences"),
        surfaces=from_chain("surfaces"),
        reports=from_chain("reports"),
    output:
        TARGETS,
    wildcard_constraints:
        origin="self|atlas",
    priority: 1
    resources:
        mem_mb=8000,
    params:
        start_week=from_brain("week"),
        weeks=from_chain("later_weeks"),
        further_weeks=from_chain("further_weeks"),
        posed=from_chain("posed"),
    script:
        "../scripts/targets.py"


rule carried_mesh:
    input:
        mesh=MESH["mesh"],
        data=MESH["data"],
        report=PIAL["report"],
        later=lambda w: study.chains[w.brain, "self"].correspondences,
    output:
        CARRIED_MESH,
    resources:
        mem_mb=8000,
    params:
        weeks=lambda w: study.chains[w.brain, "self"].weeks,
    script:
        "../scripts/carried_mesh.py"
