# Metrics of brains, measured and simulated: one rule, so that both go through the same code with the same settings.


def from_place(attribute):
    """Return an input function: an attribute of what is measured in the folder that the wildcards name."""
    return lambda wildcards: getattr(study.places[wildcards.where], attribute)


for suffix, sides in PARTS_OF_BRAINS.items():

    rule:
        name:
            f"measure{suffix}"
        input:
            unpack(from_place("parts")),
            thickness=from_place("thickness"),
            report=from_place("report"),
        output:
            **MEASURES,
            **maps_of(*sides),
        wildcard_constraints:
            where=one_of(where for where, row in study.places.items() if row.sides == sides),
        params:
            labels=from_place("labels"),
            settings=CONFIG.metrics.model_dump(include={"curvature_radius_mm", "spangy_modes"}),
        script:
            "../scripts/measure.py"

    rule:
        name:
            f"white{suffix}"
        input:
            unpack(from_brain("measured.parts")),
            report=PIAL["report"],
            source=lambda w: list(study.brains[w.brain].white_from.values()),
        output:
            **white_of(*sides),
        wildcard_constraints:
            brain=brains_with(lambda brain: brain.white_from and brain.sides == sides),
        params:
            affine_from=from_brain("given.affine_from"),
            labels=from_brain("measured.labels"),
            scheme=from_brain("scheme"),
            # exchanged files are the same inputs to Snakemake
            source=from_brain("white_from"),
            surface=surface_settings("edge_length_mm", "max_hole_mm"),
            curvature_radius_mm=CONFIG.metrics.curvature_radius_mm,
        script:
            "../scripts/white.py"


rule displacement:
    input:
        FOLDING["frames"],
    output:
        DISPLACEMENT,
    params:
        labels=lambda w: {"subject": w.brain, "run": w.run},
    script:
        "../scripts/displacement.py"


rule label_volumes:
    input:
        labels=from_brain("given.label_volume"),
        norms=f"{workflow.basedir}/norms/svrtk-volumes.yaml",
    output:
        **VOLUMES,
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.given.has_labels),
    params:
        affine_from=from_brain("given.affine_from"),
        sides=from_brain("sides"),
        labels=from_brain("measured.labels"),
        scheme=from_brain("scheme"),
    script:
        "../scripts/label_volumes.py"
