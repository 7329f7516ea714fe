# Metrics of brains, measured and simulated: one rule, so that both go through the same code with the same settings.


def place_of(wildcards):
    """Return the brain that is measured in the folder that the wildcards name."""
    return study.places[wildcards.where]


for suffix, sides in PARTS_OF_BRAINS.items():

    rule:
        name:
            f"measure{suffix}"
        input:
            unpack(lambda w: place_of(w).parts),
            thickness=lambda w: place_of(w).thickness,
            report=lambda w: place_of(w).report,
        output:
            **MEASURES,
            **maps_of(*sides),
        log:
            f"{PLACE}/logs/measure{suffix}.log",
        benchmark:
            f"{PLACE}/benchmarks/measure{suffix}.tsv"
        wildcard_constraints:
            where=one_of(where for where, row in study.places.items() if row.sides == sides),
        conda:
            ENVIRONMENT
        params:
            labels=lambda w: place_of(w).labels,
            settings=CONFIG.metrics.model_dump(include={"curvature_radius_mm", "spangy_modes"}),
        script:
            "../scripts/measure.py"

    rule:
        name:
            f"white{suffix}"
        input:
            unpack(lambda w: brain_of(w).measured.parts),
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
            columns=lambda w: brain_of(w).measured.labels,
            labels=lambda w: brain_of(w).labels,
            # exchanged files are the same inputs to Snakemake
            white=lambda w: brain_of(w).given.white_files,
            surface=surface_settings("edge_length_mm", "max_hole_mm"),
            curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
        script:
            "../scripts/white.py"
