# Metrics of observed and simulated brains, by the same script with the same settings.
MEASURED_WITH = CONFIG.metrics.model_dump(include={"curvature_radius_mm", "spangy_modes", "spangy_mass"})


def labels_or_white(wildcards):
    """Return the labels of a brain, or its white surfaces."""
    brain = brain_of(wildcards)
    return brain.labels.path if brain.labels else list(brain.config.white_files.values())


for suffix, sides in PARTS_OF_BRAINS.items():

    rule:
        name:
            f"measure{suffix}"
        input:
            unpack(lambda w: brain_of(w).measurement.parts),
            thickness=lambda w: brain_of(w).measurement.thickness,
            report=PIAL["report"],
        output:
            **measures_in(f"{BRAIN}/metrics", *sides),
        log:
            f"{BRAIN}/logs/measure{suffix}.log",
        benchmark:
            f"{BRAIN}/benchmarks/measure{suffix}.tsv"
        wildcard_constraints:
            brain=brains_with(lambda brain: brain.sides == sides),
        conda:
            ENVIRONMENT
        params:
            labels=lambda w: brain_of(w).measurement.labels,
            settings=MEASURED_WITH,
        script:
            "../scripts/measure.py"

    # also writes the surfaces: the facets of the start brain's hemispheres
    rule:
        name:
            f"measure_simulated{suffix}"
        input:
            frames=FOLDING["frames"],
            regions=REGIONS["mesh"],
            data=REGIONS["data"],
        output:
            **folded_of(*sides),
            **measures_in(f"{RUN}/metrics/{WEEK}", *sides),
        log:
            f"{RUN}/logs/measure_simulated{suffix}.{WEEK}.log",
        benchmark:
            f"{RUN}/benchmarks/measure_simulated{suffix}.{WEEK}.tsv"
        wildcard_constraints:
            brain=brains_with(lambda brain: brain.sides == sides),
        conda:
            ENVIRONMENT
        params:
            labels=lambda w: simulation_of(w).at(float(w.week)).labels,
            settings=MEASURED_WITH,
        script:
            "../scripts/measure.py"

    rule:
        name:
            f"white{suffix}"
        input:
            unpack(lambda w: brain_of(w).measurement.parts),
            report=PIAL["report"],
            given=labels_or_white,
        output:
            **white_of(*sides),
        log:
            f"{BRAIN}/logs/white{suffix}.log",
        benchmark:
            f"{BRAIN}/benchmarks/white{suffix}.tsv"
        wildcard_constraints:
            brain=brains_with(lambda brain: brain.has_white and brain.sides == sides),
        conda:
            ENVIRONMENT
        params:
            columns=lambda w: brain_of(w).measurement.labels,
            labels=lambda w: brain_of(w).labels,
            # also parameters, since swapped input files do not trigger a rerun
            white=lambda w: brain_of(w).config.white_files,
            surface=surface_settings("edge_length_mm", "max_hole_mm"),
            curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
        script:
            "../scripts/white.py"
