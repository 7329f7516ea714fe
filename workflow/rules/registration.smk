# Correspondences between brains of successive weeks, and the targets of start brains.
from gyriflow.running.cost import targets_memory_mib
from gyriflow.io.origins import origin_key
from gyriflow.running.path_store import has_path, kept_path, path_origin, store_folder

if PRINTS:
    for series in study.series.values():
        if series.unmatched and any(start.id in series.brains for start in study.starts):
            print(
                f"gyriflow: surfaces of {series.name} are not matched by their vertices: {series.unmatched}",
                file=sys.stderr,
            )


def similar_thickness(wildcards):
    """Return the summary of the thickness that fills a brain; empty if there is none."""
    source = BRAINS[wildcards.brain].thickness_of
    return THICKNESS["summary"].format(brain=source) if source else []


# labels for the registration of brains that are given as surfaces
rule filled_labels:
    input:
        whole=PIAL["whole"],
        sides=lambda w: BRAINS[w.brain].hemispheres,
        report=PIAL["report"],
        white=lambda w: list(BRAINS[w.brain].white_files.values()),
        similar=similar_thickness,
    output:
        FILLED_LABELS,
    params:
        white=lambda w: BRAINS[w.brain].white_files,
    script:
        "../scripts/filled_labels.py"


def pair_of(wildcards):
    """Return the two brains of the wildcards."""
    return BRAINS[wildcards.earlier], BRAINS[wildcards.later]


rule register:
    input:
        brains=lambda w: [registered_source(CONFIG, brain).path for brain in pair_of(w)],
        images=lambda w: [brain.image for brain in pair_of(w) if brain.image],
    output:
        REGISTERED,
    wildcard_constraints:
        smoothing=r"\d\.\d+",
        seed=r"\d+",
    priority: 1
    params:
        brains=lambda w: [registered_source(CONFIG, brain) for brain in pair_of(w)],
        images=lambda w: [brain.image for brain in pair_of(w)],
        smoothing=lambda w: float(dict(w).get("smoothing", 1)),
        seed=lambda w: int(dict(w).get("seed", 0)),
        is_varied=lambda w: "seed" in dict(w),
    script:
        "../scripts/register.py"


# of a member of an ensemble
use rule register as register_varied with:
    output:
        VARIED_REGISTRATION,


# the original surfaces with all their vertices, in the pose of the mesh
rule match_surfaces:
    input:
        lambda w: [path for brain in pair_of(w) for path in brain.files],
        reports=lambda w: [brain.report for brain in pair_of(w)],
    output:
        MATCHED,
    params:
        files=lambda w: [brain.files for brain in pair_of(w)],
    script:
        "../scripts/match_surfaces.py"


def chain_of(wildcards):
    """Return the brains on which the growth of a start brain was measured."""
    return study.chains[wildcards.brain, wildcards.origin]


def origins(origin):
    """Return a pattern for the names of the chains of an origin, members of ensembles included."""
    return one_of(dict.fromkeys(name for (_, name), chain in study.chains.items() if chain.origin == origin))


def followers_of(wildcards):
    """Return the simulations that grow towards the shapes of a start brain."""
    file = TARGETS.format(brain=wildcards.brain, origin=wildcards.origin)
    return [simulation for simulation in study.simulations.values() if simulation.targets == file]


def posed_links(chain):
    """Return, for each link of a chain, whether it refers to the posed surfaces of its two brains."""
    return [study.links[file].posed for file in chain.links]


# shapes of a start brain's mesh in the later weeks of its own series, for runs that grow towards them
rule targets:
    input:
        **START_MESH,
        report=PIAL["report"],
        correspondences=lambda w: chain_of(w).links,
        surfaces=lambda w: [BRAINS[brain].pial for brain in chain_of(w).later],
        reports=lambda w: [BRAINS[brain].report for brain in chain_of(w).later],
    output:
        TARGETS,
    wildcard_constraints:
        origin=origins("self"),
    priority: 1
    resources:
        mem_mb=lambda w: targets_memory_mib(BRAINS[w.brain], CONFIG.mesh),
    params:
        weeks=lambda w: chain_of(w).weeks,
        posed=lambda w: posed_links(chain_of(w)),
        open_sulci=CONFIG.surface.open_sulci,
        origin=None,
        store=None,
    script:
        "../scripts/targets.py"


# by the id of their first brain, from which rules get them
PATHS = study.paths
if PATHS and not CONTENTS:
    CONTENTS = input_contents(Path.cwd(), CONFIG, known_checksums(study.used_atlases), record=False)
PATH_ORIGINS = {brain: path_origin(study, path) for brain, path in PATHS.items()}
# None until all files of the atlas are there
PATH_KEYS = {brain: origin_key(origin, CONTENTS) for brain, origin in PATH_ORIGINS.items()}
# No rule makes a path that the study has: one that was copied needs nothing of what it was made from, and one that was
# made here stays where the kept one is taken away.
NEEDED_PATHS = {brain: path for brain, path in PATHS.items() if not has_path(path, PATH_KEYS[brain])}
KEPT_PATHS = {brain: kept_path(study, path, PATH_KEYS[brain]) for brain, path in NEEDED_PATHS.items()}


def path_of(wildcards):
    """Return the path of an atlas, whose first brain is that of the wildcards."""
    return PATHS[wildcards.brain]


# the same of the first brain of an atlas, which other brains are carried by
use rule targets as atlas_path with:
    input:
        mesh=PATH_MESH["mesh"],
        data=PATH_MESH["data"],
        report=PIAL["report"],
        correspondences=lambda w: path_of(w).links,
        surfaces=lambda w: [BRAINS[brain].pial for brain in path_of(w).later],
        reports=lambda w: [BRAINS[brain].report for brain in path_of(w).later],
    output:
        ATLAS_PATH,
    wildcard_constraints:
        brain=one_of(brain for brain, kept in KEPT_PATHS.items() if kept is None),
    resources:
        mem_mb=lambda w: targets_memory_mib(BRAINS[w.brain], CONFIG.growth.path_mesh),
    params:
        weeks=lambda w: path_of(w).weeks,
        posed=lambda w: posed_links(path_of(w)),
        open_sulci=CONFIG.surface.open_sulci,
        origin=lambda w: PATH_ORIGINS[w.brain],
        store=lambda w: store_folder(study, path_of(w)),


rule kept_path:
    output:
        ATLAS_PATH,
    wildcard_constraints:
        brain=one_of(brain for brain, kept in KEPT_PATHS.items() if kept is not None),
    params:
        kept=lambda w: KEPT_PATHS[w.brain],
    script:
        "../scripts/kept_path.py"


def atlas_of(wildcards):
    """Return the brain of an atlas that a start brain is registered to."""
    return BRAINS[chain_of(wildcards).later[0]]


NORMAL = "neurotypical"


def normal_volumes(wildcards):
    """Return the volumes of normal populations, if the atlas is of one."""
    population = BRAINS[chain_of(wildcards).path].population_name
    return NORMAL_VOLUMES if population.startswith(NORMAL) else []


def populations_left_out(wildcards):
    """Return the atlases of a prediction: the growing one has its own volumes, and the start's are to be predicted."""
    brains = [wildcards.brain, chain_of(wildcards).path]
    return [BRAINS[brain].atlas for brain in brains if BRAINS[brain].atlas]


# shapes that a start brain would have in later weeks if it grew as an atlas
rule predicted_targets:
    input:
        **START_MESH,
        path=lambda w: ATLAS_PATH.format(brain=chain_of(w).path),
        correspondence=lambda w: chain_of(w).links,
        reports=lambda w: [PIAL["report"], atlas_of(w).report],
        # norms of another study, and other populations, with whose growth the volume of the atlas grows as well
        norms=CONFIG.metrics.norms or [],
        volumes=normal_volumes,
    output:
        TARGETS,
    log:
        f"{BRAIN}/logs/targets.{{origin}}.log",
    wildcard_constraints:
        origin=origins("atlas"),
    priority: 1
    resources:
        mem_mb=lambda w: targets_memory_mib(BRAINS[w.brain], CONFIG.mesh),
    params:
        start_week=lambda w: BRAINS[w.brain].week,
        end_week=lambda w: max(run.settings.end_week for run in followers_of(w)),
        atlas_week=lambda w: atlas_of(w).week,
        further_weeks=lambda w: chain_of(w).further_weeks,
        posed=lambda w: posed_links(chain_of(w))[0],
        open_sulci=CONFIG.surface.open_sulci,
        variation=lambda w: chain_of(w).variation,
        left_out=populations_left_out,
    script:
        "../scripts/predicted_targets.py"
