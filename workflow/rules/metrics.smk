# Metrics of observed and simulated brains, by the same script with the same settings.
MEASURED_WITH = CONFIG.metrics.model_dump(include={"curvature_radius_mm", "spangy_modes", "spangy_mass"})


def labels_or_white(wildcards):
    """Return the labels of a brain, or its white surfaces."""
    brain = brain_of(wildcards)
    return brain.labels.path if brain.labels else list(brain.config.white_files.values())


rule measure:
    input:
        unpack(lambda w: brain_of(w).measurement.parts),
        thickness=lambda w: brain_of(w).measurement.thickness,
        report=PIAL["report"],
    output:
        **measures_in(f"{BRAIN}/metrics", *SIDES),
    log:
        f"{BRAIN}/logs/measure.log",
    wildcard_constraints:
        brain=brains_with(*SIDES),
    params:
        labels=lambda w: brain_of(w).measurement.labels,
        settings=MEASURED_WITH,
    script:
        "../scripts/measure.py"


# also writes the surfaces: the facets of the start brain's hemispheres
rule measure_simulated:
    input:
        **START_REGIONS,
        frames=FOLDING["frames"],
    output:
        **folded_of(*SIDES),
        **measures_in(f"{RUN}/metrics/{WEEK}", *SIDES),
    log:
        f"{RUN}/logs/measure_simulated.{WEEK}.log",
    wildcard_constraints:
        brain=brains_with(*SIDES),
    params:
        labels=lambda w: simulation_of(w).at(float(w.week)).labels,
        settings=MEASURED_WITH,
    script:
        "../scripts/measure.py"


rule white:
    input:
        unpack(lambda w: brain_of(w).measurement.parts),
        report=PIAL["report"],
        given=labels_or_white,
    output:
        **white_of(*SIDES),
    log:
        f"{BRAIN}/logs/white.log",
    wildcard_constraints:
        brain=brains_with(*SIDES, has_white=True),
    params:
        columns=lambda w: brain_of(w).measurement.labels,
        labels=lambda w: brain_of(w).labels,
        white=lambda w: brain_of(w).config.white_files,
        surface=surface_settings("edge_length_mm", "max_hole_mm"),
        curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
    script:
        "../scripts/white.py"


use rule measure as measure_left with:
    output:
        **measures_in(f"{BRAIN}/metrics", "left"),
    wildcard_constraints:
        brain=brains_with("left"),


use rule measure_simulated as measure_simulated_left with:
    output:
        **folded_of("left"),
        **measures_in(f"{RUN}/metrics/{WEEK}", "left"),
    wildcard_constraints:
        brain=brains_with("left"),


use rule white as white_left with:
    output:
        **white_of("left"),
    wildcard_constraints:
        brain=brains_with("left", has_white=True),


use rule measure as measure_right with:
    output:
        **measures_in(f"{BRAIN}/metrics", "right"),
    wildcard_constraints:
        brain=brains_with("right"),


use rule measure_simulated as measure_simulated_right with:
    output:
        **folded_of("right"),
        **measures_in(f"{RUN}/metrics/{WEEK}", "right"),
    wildcard_constraints:
        brain=brains_with("right"),


use rule white as white_right with:
    output:
        **white_of("right"),
    wildcard_constraints:
        brain=brains_with("right", has_white=True),
