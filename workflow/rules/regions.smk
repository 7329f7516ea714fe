# Regions of the cortex: given on some brains, carried to others by registration, and to simulated ones with the tissue;
# where none are given, named sulci. Maps of all brains at the vertices of one, the template.
from gyriflow.settings.atlas import SULCI


rule given_regions:
    input:
        unpack(lambda w: CONFIG.metrics.regions[w.brain].files),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.regions_from == "given"),
    params:
        affine_from=from_brain("given.affine_from"),
        names=lambda w: CONFIG.metrics.regions[w.brain].names,
    script:
        "../scripts/given_regions.py"


rule carried_regions:
    input:
        unpack(lambda w: study.region_inputs(w.brain)),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.regions_from == "carried"),
    params:
        posed=lambda w: study.posed_regions(w.brain),
    script:
        "../scripts/carried_regions.py"


rule named_sulci:
    input:
        volume=from_brain("registered_volume"),
        left=PIAL["left"],
        right=PIAL["right"],
        report=PIAL["report"],
        drawing=SULCI / "sulci.yaml",
        drawn=SULCI / "sulci.nii.gz",
    output:
        **region_files(f"{BRAIN}/metrics"),
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.regions_from == "named"),
    params:
        read=from_brain("registered"),
        posed=lambda w: not study.brains[w.brain].given.has_labels,
    script:
        "../scripts/named_sulci.py"


rule simulated_regions:
    input:
        **region_files(f"{BRAIN}/metrics"),
        **REGIONS,
        left=PIAL["left"],
        right=PIAL["right"],
    output:
        **region_files(f"{RUN}/metrics"),
    wildcard_constraints:
        brain=brains_with(lambda brain: brain.has_regions),
    script:
        "../scripts/simulated_regions.py"


rule region_metrics:
    input:
        unpack(from_place("regions")),
        unpack(from_place("parts")),
        left_maps=maps_of("left")["left"],
        right_maps=maps_of("right")["right"],
    output:
        "results/{where}/regions.csv",
    wildcard_constraints:
        where=one_of(where for where, row in study.places.items() if row.regions),
    params:
        labels=from_place("labels"),
    script:
        "../scripts/region_metrics.py"


rule template_maps:
    input:
        unpack(lambda w: study.template_inputs(w.where, w.side)),
        maps="results/{where}/{side}.shape.gii",
    output:
        TEMPLATE_MAPS,
    wildcard_constraints:
        where=one_of(study.measured),
    params:
        posed=lambda w: study.series.posed(
            study.brains[CONFIG.metrics.template],
            study.brains[study.places[w.where].subject],
        ),
    script:
        "../scripts/template_maps.py"
