# Metrics of observed and simulated brains, by the same script with the same settings.
MEASURED_WITH = CONFIG.metrics.model_dump(include={"curvature_radius_mm", "spangy_modes", "spangy_mass"})


rule measure:
    input:
        unpack(lambda w: BRAINS[w.brain].parts),
        thickness=lambda w: BRAINS[w.brain].thickness or [],
        report=PIAL["report"],
    output:
        **measures_in(f"{BRAIN}/metrics", *SIDES),
    log:
        f"{BRAIN}/logs/measure.log",
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == SIDES),
    params:
        columns=lambda w: BRAINS[w.brain].columns,
        settings=MEASURED_WITH,
    script:
        "../scripts/measure.py"


# of predictions, which are measured and compared by surfaces as fine as those of observed brains
FINE = [simulation for simulation in study.simulations.values() if study.has_fine_surfaces(simulation)]


def age_shift_gw(wildcards):
    """Return by how much a start brain is older than stated, in an ensemble."""
    variation = study.chains[wildcards.brain, simulation_of(wildcards).chain].variation
    return variation.age_shift_gw if variation else 0.0


def atlas_brains_of(wildcards):
    """Return the brains of the atlas, one of which is moved to the predicted shape."""
    return study.atlas_brains_near(simulation_of(wildcards), float(wildcards.week))


rule fine_surface:
    input:
        **START_MESH,
        frames=FOLDING["frames"],
        targets=lambda w: simulation_of(w).targets,
        start=lambda w: list(BRAINS[w.brain].parts.values()),
        atlas=lambda w: [file for brain in atlas_brains_of(w) for file in brain.parts.values()],
    output:
        **fine_of(*SIDES),
    wildcard_constraints:
        run=one_of(dict.fromkeys(simulation.run for simulation in FINE)),
        brain=one_of(dict.fromkeys(simulation.brain for simulation in FINE)),
    params:
        week=lambda w: float(w.week),
        # of the atlas' brain
        age=lambda w: float(w.week) + age_shift_gw(w),
        atlas_parts=lambda w: [list(brain.parts.values()) for brain in atlas_brains_of(w)],
        atlas_weeks=lambda w: [brain.week for brain in atlas_brains_of(w)],
    script:
        "../scripts/fine_surface.py"


def fine_parts(wildcards):
    """Return the surfaces that a simulated brain is measured by, if these are not its own."""
    if not study.has_fine_surfaces(simulation_of(wildcards)):
        return []
    row = SIMULATED[wildcards.run, wildcards.brain, float(wildcards.week)]
    return list(study.measured_parts(row).values())


# also writes the surfaces: the facets of the start brain's hemispheres
rule measure_simulated:
    input:
        **START_REGIONS,
        frames=FOLDING["frames"],
        fine=fine_parts,
    output:
        **folded_of(*SIDES),
        **measures_in(f"{RUN}/metrics/{WEEK}", *SIDES),
    log:
        f"{RUN}/logs/measure_simulated.{WEEK}.log",
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == SIDES),
    params:
        columns=lambda w: SIMULATED[w.run, w.brain, float(w.week)].columns,
        settings=MEASURED_WITH,
    script:
        "../scripts/measure.py"


rule white:
    input:
        unpack(lambda w: BRAINS[w.brain].parts),
        report=PIAL["report"],
        given=lambda w: BRAINS[w.brain].labels or list(BRAINS[w.brain].white_files.values()),
    output:
        **white_of(*SIDES),
    log:
        f"{BRAIN}/logs/white.log",
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == SIDES and brain.white),
    params:
        columns=lambda w: BRAINS[w.brain].columns,
        labels=lambda w: label_source(CONFIG, BRAINS[w.brain]),
        white=lambda w: BRAINS[w.brain].white_files,
        surface=EDGE_LENGTH,
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/white.py"


use rule measure as measure_left with:
    output:
        **measures_in(f"{BRAIN}/metrics", "left"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("left",)),


use rule measure_simulated as measure_simulated_left with:
    output:
        **folded_of("left"),
        **measures_in(f"{RUN}/metrics/{WEEK}", "left"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("left",)),


use rule white as white_left with:
    output:
        **white_of("left"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("left",) and brain.white),


use rule measure as measure_right with:
    output:
        **measures_in(f"{BRAIN}/metrics", "right"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("right",)),


use rule measure_simulated as measure_simulated_right with:
    output:
        **folded_of("right"),
        **measures_in(f"{RUN}/metrics/{WEEK}", "right"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("right",)),


use rule white as white_right with:
    output:
        **white_of("right"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.sides == ("right",) and brain.white),
