# Regions of the cortex: given on some brains, carried to others by registration, to simulated brains with the tissue.
# Maps of all brains are also written at the vertices of the template.


rule given_regions:
    input:
        unpack(lambda w: CONFIG.metrics.regions[w.brain].files),
        **POSED_SIDES,
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.regions_of == brain.id),
    params:
        affine_from=lambda w: BRAINS[w.brain].affine_from,
        names=lambda w: CONFIG.metrics.regions[w.brain].names,
    script:
        "../scripts/given_regions.py"


def region_pair(wildcards):
    """Return the brain on which regions are given, and the brain to which they are carried."""
    brain = BRAINS[wildcards.brain]
    return BRAINS[brain.regions_of], brain


# the maps between two brains that no member of an ensemble varies
LINKS = {(link.earlier, link.later): link for link in study.links.values() if link.seed == 0}


def region_link(wildcards):
    """Return the map by which regions are carried."""
    return LINKS[BRAINS[wildcards.brain].regions_of, wildcards.brain]


rule carried_regions:
    input:
        **POSED_SIDES,
        left_regions=lambda w: region_pair(w)[0].regions[0],
        right_regions=lambda w: region_pair(w)[0].regions[1],
        given_left=lambda w: region_pair(w)[0].parts["left"],
        given_right=lambda w: region_pair(w)[0].parts["right"],
        given_report=lambda w: region_pair(w)[0].report,
        correspondence=lambda w: region_link(w).file,
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.regions_of not in (None, brain.id)),
    params:
        posed=lambda w: region_link(w).posed,
    script:
        "../scripts/carried_regions.py"


rule simulated_regions:
    input:
        **region_files(f"{BRAIN}/metrics"),
        **MESH_REGIONS,
        left=PIAL["left"],
        right=PIAL["right"],
    output:
        **region_files(f"{RUN}/metrics"),
    wildcard_constraints:
        brain=brains_where(lambda brain: brain.regions),
    script:
        "../scripts/simulated_regions.py"


# observed and simulated brains that are measured, by the place of their tables
ALL_MEASURED = {row.place: row for row in SIMULATED.values()} | study.measured


rule region_metrics:
    input:
        unpack(lambda w: ALL_MEASURED[w.where].parts),
        left_regions=lambda w: ALL_MEASURED[w.where].regions[0],
        right_regions=lambda w: ALL_MEASURED[w.where].regions[1],
        left_maps=f"{PLACE}/left.shape.gii",
        right_maps=f"{PLACE}/right.shape.gii",
    output:
        f"{PLACE}/regions.csv",
    wildcard_constraints:
        where=one_of(place for place, row in ALL_MEASURED.items() if row.regions),
    params:
        columns=lambda w: ALL_MEASURED[w.where].columns,
    script:
        "../scripts/region_metrics.py"


def on_template(wildcards):
    """Return the template, and the brain whose maps are moved to its vertices."""
    return BRAINS[CONFIG.metrics.template], BRAINS[ALL_MEASURED[wildcards.where].id]


def mapped_surface(wildcards):
    """Return the hemisphere with a brain's maps; for a simulated brain that of its start, with the same vertices."""
    row = ALL_MEASURED[wildcards.where]
    if row.run in CONFIG.runs:
        row = SIMULATED[row.run, row.id, BRAINS[row.id].week]
    return row.parts[wildcards.side]


def template_links(wildcards):
    """Return the map from the template to a brain; none for the template itself."""
    template, brain = on_template(wildcards)
    return [] if brain is template else [LINKS[template.id, brain.id]]


rule template_maps:
    input:
        template=lambda w: on_template(w)[0].parts[w.side],
        template_report=lambda w: on_template(w)[0].report,
        surface=mapped_surface,
        report=lambda w: on_template(w)[1].report,
        correspondence=lambda w: [link.file for link in template_links(w)],
        maps=f"{PLACE}/{{side}}.shape.gii",
    output:
        TEMPLATE_MAPS,
    wildcard_constraints:
        where=one_of(study.measured),
    params:
        posed=lambda w: template_links(w)[0].posed if template_links(w) else [False, False],
    script:
        "../scripts/template_maps.py"
