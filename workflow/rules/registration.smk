# Correspondence between brains of successive weeks: where each point of a start brain goes in the real ones.
from gyriflow.parameters.schemes import SCHEMES

# growth series of surfaces: those with the same vertices, and why the others are not matched
MATCHED = CONFIG.matched_surfaces
UNMATCHED = CONFIG.unmatched_surfaces
if workflow.is_main_process:
    for series, cause in UNMATCHED.items():
        if set(CONFIG.growth_series[series]) & set(CONFIG.start_brains):
            print(
                f"gyriflow: no local growth from the surfaces of {series}: {cause}",
                file=sys.stderr,
            )


def correspond(brain, other):
    """Returns whether local growth is known between a start brain and another one of its growth series."""
    volumes = CONFIG.brain(brain).has_labels and CONFIG.brain(other).has_labels
    return volumes or {brain, other} <= MATCHED.get(CONFIG.estimated_from(brain), set())


def later_brains(brain):
    """Returns a start brain and the brains of its growth series up to where its runs end, one a week.

    All have label volumes, or surfaces with the same vertices.
    """
    series = CONFIG.growth_series.get(CONFIG.estimated_from(brain), [])
    start = CONFIG.brain(brain)
    end = max(CONFIG.run(run).end_week for run, folded in FOLDED if folded == brain)
    # the first brain past the end tells of growth up to it
    within = [
        week
        for week in sorted({CONFIG.brain(name).week for name in series})
        if week >= end
    ]
    last = within[0] if within else end
    chosen = {start.week: brain}
    for other in map(CONFIG.brain, series):
        if start.week < other.week <= last and correspond(brain, other.id):
            chosen.setdefault(other.week, other.id)
    return [chosen[week] for week in sorted(chosen)]


def earlier_brains(brain):
    """Returns the brains of a start brain's growth series up to it, one a week, where some run is to predict from them."""
    start = CONFIG.brain(brain)
    chosen = {start.week: brain}
    if any(predicts(run) for run, folded in FOLDED if folded == brain):
        for other in map(
            CONFIG.brain, CONFIG.growth_series.get(CONFIG.estimated_from(brain), [])
        ):
            if other.week < start.week and correspond(brain, other.id):
                chosen.setdefault(other.week, other.id)
    return [chosen[week] for week in sorted(chosen)]


def predicts(run):
    """Returns whether a run's regional growth is extrapolated from what was known by some week."""
    return regional(run) and CONFIG.run(run).follow.known_until_gw is not None


def chain_of(brain):
    """Returns the brains, one a week, that a start brain's mesh is carried through, itself among them."""
    return earlier_brains(brain)[:-1] + later_brains(brain)


def weeks_of_chain(brain):
    """Returns the weeks of the brains that a start brain's mesh is carried through."""
    return [CONFIG.brain(name).week for name in chain_of(brain)]


def matched(*brains):
    """Returns whether brains have surfaces with the same vertices."""
    return any(set(brains) <= known for known in MATCHED.values())


def correspondence(earlier, later):
    """Returns the file that says where one brain's points are in another: by matched vertices, or registration."""
    folder = "matched" if matched(earlier, later) else "registration"
    return f"{STUDY}/{folder}/{earlier}/{later}.h5"


def correspondences(chain):
    """Returns these files from each brain of a chain to the next."""
    return [correspondence(*pair) for pair in zip(chain, chain[1:])]


# start brains that real ones of later weeks follow, and those that real ones of any week are registered with
CARRIED = [brain for brain in CONFIG.start_brains if len(later_brains(brain)) > 1]
WITH_CHAIN = [brain for brain in CONFIG.start_brains if len(chain_of(brain)) > 1]


def registered_volume(brain):
    """Returns the volume by which a brain is registered: its labels, or a mask made of its surface."""
    if CONFIG.brain(brain).has_labels:
        return label_volume_of(brain)
    return rules.surface_mask.output[0].format(brain=brain)


def registered_scheme(brain):
    """Returns the scheme of that volume."""
    if CONFIG.brain(brain).has_labels:
        return CONFIG.scheme(CONFIG.brain(brain))
    return SCHEMES["binary"].model_dump()


rule surface_mask:
    input:
        PIAL["whole"],
    output:
        f"{BRAIN}/surface/mask.nii.gz",
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


rule register:
    input:
        earlier=lambda wildcards: registered_volume(wildcards.earlier),
        later=lambda wildcards: registered_volume(wildcards.later),
    output:
        f"{STUDY}/registration/{{earlier}}/{{later}}.h5",
    log:
        f"{STUDY}/registration/logs/{{earlier}}.{{later}}.log",
    benchmark:
        f"{STUDY}/registration/benchmarks/{{earlier}}.{{later}}.tsv"
    wildcard_constraints:
        earlier=one_of(BRAINS),
        later=one_of(BRAINS),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        images=lambda wildcards: [
            CONFIG.brain(brain).image for brain in (wildcards.earlier, wildcards.later)
        ],
        affine_from=lambda wildcards: [
            CONFIG.brain(brain).affine_from
            for brain in (wildcards.earlier, wildcards.later)
        ],
        schemes=lambda wildcards: [
            registered_scheme(brain) for brain in (wildcards.earlier, wildcards.later)
        ],
    script:
        "../scripts/register.py"


# the surfaces as they are given, with all their vertices, in the pose of the mesh
rule matched_surface:
    input:
        lambda wildcards: CONFIG.brain(wildcards.brain).files,
        report=f"{BRAIN}/surface/surface.json",
    output:
        f"{BRAIN}/surface/matched.surf.gii",
    log:
        f"{BRAIN}/logs/matched_surface.log",
    benchmark:
        f"{BRAIN}/benchmarks/matched_surface.tsv"
    wildcard_constraints:
        brain=one_of(sorted(set().union(*MATCHED.values()))),
    conda:
        ENVIRONMENT
    params:
        # exchanged files are the same inputs to Snakemake
        files=lambda wildcards: CONFIG.brain(wildcards.brain).files,
    script:
        "../scripts/matched_surface.py"


rule match_surfaces:
    input:
        **{
            f"{which}{suffix}": f"results/brains/{{{which}}}/surface/{file}"
            for which in ("earlier", "later")
            for suffix, file in (
                ("", "matched.surf.gii"),
                ("_report", "surface.json"),
            )
        },
    output:
        f"{STUDY}/matched/{{earlier}}/{{later}}.h5",
    log:
        f"{STUDY}/matched/logs/{{earlier}}.{{later}}.log",
    benchmark:
        f"{STUDY}/matched/benchmarks/{{earlier}}.{{later}}.tsv"
    wildcard_constraints:
        earlier=one_of(BRAINS),
        later=one_of(BRAINS),
    conda:
        ENVIRONMENT
    script:
        "../scripts/match_surfaces.py"


rule carried_mesh:
    input:
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        report=PIAL["report"],
        earlier=lambda wildcards: correspondences(earlier_brains(wildcards.brain)),
        later=lambda wildcards: correspondences(later_brains(wildcards.brain)),
    output:
        f"{BRAIN}/mesh/carried.h5",
    log:
        f"{BRAIN}/logs/carried_mesh.log",
    benchmark:
        f"{BRAIN}/benchmarks/carried_mesh.tsv"
    wildcard_constraints:
        brain=one_of(WITH_CHAIN),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=8000,
        runtime=30,
    params:
        weeks=lambda wildcards: weeks_of_chain(wildcards.brain),
        strain=lambda wildcards: any(
            regional(run) and CONFIG.run(run).follow.directional > 0
            for run, brain in FOLDED
            if brain == wildcards.brain
        ),
        # the smoothing lengths that runs from this brain ask for
        smoothing_mm=lambda wildcards: sorted(
            {
                CONFIG.run(run).follow.smoothing_mm
                for run, brain in FOLDED
                if brain == wildcards.brain and regional(run)
            }
        ),
    script:
        "../scripts/carried_mesh.py"
