# Correspondences between brains of successive weeks, and the targets of start brains.
from gyriflow.running.cost import targets_memory_mib

if workflow.is_main_process:
    for series, cause in study.series.unmatched.items():
        if set(study.starts) & set(study.series.brains[series]):
            print(
                f"gyriflow: surfaces of {series} are not matched by their vertices: {cause}",
                file=sys.stderr,
            )


def similar_thickness(brain):
    """Return the summary of the thickness of a similar brain; empty if there is none."""
    similar = study.similar_in_thickness(brain)
    return THICKNESS["summary"].format(brain=similar.id) if similar else []


# labels for the registration of brains that are given as surfaces
rule filled_labels:
    input:
        whole=PIAL["whole"],
        sides=lambda w: brain_of(w).measurement.hemispheres,
        report=PIAL["report"],
        white=lambda w: list(brain_of(w).config.white_files.values()),
        similar=lambda w: similar_thickness(brain_of(w)),
    output:
        FILLED_LABELS,
    log:
        f"{BRAIN}/logs/filled_labels.log",
    params:
        white=lambda w: brain_of(w).config.white_files,
    script:
        "../scripts/filled_labels.py"


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
    wildcard_constraints:
        smoothing=r"\d\.\d+",
        seed=r"\d+",
    priority: 1
    params:
        brains=lambda w: [brain.registered for brain in pair_of(w)],
        images=lambda w: [brain.config.image for brain in pair_of(w)],
        smoothing=lambda w: float(dict(w).get("smoothing", 1)),
        seed=lambda w: int(dict(w).get("seed", 0)),
        is_varied=lambda w: "seed" in dict(w),
    script:
        "../scripts/register.py"


# of a member of an ensemble
use rule register as register_varied with:
    output:
        VARIED_REGISTRATION,
    log:
        f"{STUDY}/logs/register.{{earlier}}.{{later}}.smoothing-{{smoothing}}.seed-{{seed}}.log",


# the original surfaces with all their vertices, in the pose of the mesh
rule match_surfaces:
    input:
        lambda w: [path for brain in pair_of(w) for path in brain.config.files],
        reports=lambda w: [brain.report for brain in pair_of(w)],
    output:
        MATCHED,
    log:
        f"{STUDY}/logs/match_surfaces.{{earlier}}.{{later}}.log",
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
        # norms of another study, whose volumes the curve of an atlas follows as well
        norms=lambda w: CONFIG.metrics.norms if CONFIG.metrics.norms and chain_of(w).origin == "atlas" else [],
    output:
        TARGETS,
    log:
        f"{BRAIN}/logs/targets.{{origin}}.log",
    wildcard_constraints:
        origin=one_of(dict.fromkeys(name for _, name in study.chains)),
    priority: 1
    resources:
        mem_mb=lambda w: targets_memory_mib(brain_of(w), CONFIG.mesh),
    params:
        start_week=lambda w: brain_of(w).week,
        weeks=lambda w: chain_of(w).growth_weeks,
        stated_weeks=lambda w: chain_of(w).later_weeks,
        further_weeks=lambda w: chain_of(w).further_weeks,
        posed=lambda w: chain_of(w).posed,
        is_own_growth=lambda w: chain_of(w).origin == "self",
        opens_sulci=CONFIG.surface.open_sulci,
        variation=lambda w: chain_of(w).variation,
    script:
        "../scripts/targets.py"
