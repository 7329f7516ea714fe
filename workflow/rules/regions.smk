# Regions of the cortex: given on some brains, carried to others by registration, to simulated brains with the tissue.
# Maps of all brains are also written at the vertices of the template.


rule given_regions:
    input:
        unpack(lambda w: CONFIG.metrics.regions[w.brain].files),
        **POSED_SIDES,
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=brains_with(regions_from="given"),
    params:
        affine_from=lambda w: brain_of(w).config.affine_from,
        names=lambda w: CONFIG.metrics.regions[w.brain].names,
    script:
        "../scripts/given_regions.py"


def region_pair(wildcards):
    """Return the brain on which regions are given, and the brain to which they are carried."""
    return study.region_source(wildcards.brain), brain_of(wildcards)


def regions_to_carry(wildcards):
    """Return the given regions and the surfaces of their brain."""
    giver, _ = region_pair(wildcards)
    return {**giver.regions, **{f"given_{side}": giver.measurement.parts[side] for side in SIDES}}


rule carried_regions:
    input:
        unpack(regions_to_carry),
        **POSED_SIDES,
        given_report=lambda w: region_pair(w)[0].report,
        correspondence=lambda w: study.series.correspondence(*region_pair(w)),
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=brains_with(regions_from="carried"),
    params:
        posed=lambda w: study.series.posed(*region_pair(w)),
    script:
        "../scripts/carried_regions.py"


rule simulated_regions:
    input:
        **region_files(f"{BRAIN}/metrics"),
        **REGIONS,
        left=PIAL["left"],
        right=PIAL["right"],
    output:
        **region_files(f"{RUN}/metrics"),
    wildcard_constraints:
        brain=brains_with(has_regions=True),
    script:
        "../scripts/simulated_regions.py"


def place_of(wildcards):
    """Return the brain that is measured in the folder of the wildcards."""
    return study.all_measurements[wildcards.where]


rule region_metrics:
    input:
        unpack(lambda w: place_of(w).regions),
        unpack(lambda w: place_of(w).parts),
        left_maps=f"{PLACE}/left.shape.gii",
        right_maps=f"{PLACE}/right.shape.gii",
    output:
        f"{PLACE}/regions.csv",
    wildcard_constraints:
        where=one_of(where for where, row in study.all_measurements.items() if row.regions),
    params:
        labels=lambda w: place_of(w).labels,
    script:
        "../scripts/region_metrics.py"


def on_template(wildcards):
    """Return the template, and the brain whose maps are moved to its vertices."""
    return study.brains[CONFIG.metrics.template], study.brains[place_of(wildcards).subject]


def mapped_surface(wildcards):
    """Return the hemisphere with a brain's maps; for a simulated brain that of its start, with the same vertices."""
    row, brain = place_of(wildcards), study.brains[place_of(wildcards).subject]
    if row.run in CONFIG.runs:
        row = study.simulations[row.run, brain.id].at(brain.week)
    return row.parts[wildcards.side]


def template_correspondence(wildcards):
    """Return the correspondence of the template with a brain; none for the template itself."""
    template, brain = on_template(wildcards)
    return [] if brain is template else [study.series.correspondence(template, brain)]


rule template_maps:
    input:
        template=lambda w: on_template(w)[0].measurement.parts[w.side],
        template_report=lambda w: on_template(w)[0].report,
        surface=mapped_surface,
        report=lambda w: on_template(w)[1].report,
        correspondence=template_correspondence,
        maps=f"{PLACE}/{{side}}.shape.gii",
    output:
        TEMPLATE_MAPS,
    wildcard_constraints:
        where=one_of(study.measurements),
    params:
        posed=lambda w: study.series.posed(*on_template(w)),
    script:
        "../scripts/template_maps.py"
