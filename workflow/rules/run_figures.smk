# Figures of each run from each brain that it folds.
from gyriflow.parameters.measures import SHAPE_MEASURES
from gyriflow.parameters.terms import ELEMENTS_NEEDED


def measured_beside(run, brain):
    """Returns, by week, the measured brain that a run's surface is shown beside, the start brain at its own week."""
    later = {
        week: brains[0] for week, brains in measured_after_start(run, brain).items()
    }
    return {week_tags(run, brain)[0]: brain, **later}


def beside(wildcards):
    """Returns the measured brains that the surfaces of a run are shown beside."""
    return list(measured_beside(wildcards.run, wildcards.brain).values())


def run_surfaces(part):
    """Returns an input function: a run's surfaces of a part at all output weeks."""
    return lambda wildcards: [
        surfaces_in(f"{RUN}/surfaces/week-{week}")[part]
        for week in week_tags(wildcards.run, wildcards.brain)
    ]


def measured_surfaces(part):
    """Returns an input function: the surfaces of a part of the measured brains beside a run."""
    return lambda wildcards: [
        PIAL[part].format(brain=brain) for brain in beside(wildcards)
    ]


# parameters of figures that show simulated beside measured brains
BESIDE = {
    **drawing(),
    "measured": lambda wildcards: CONFIG.measured_name(beside(wildcards)),
    "simulated_weeks": lambda wildcards: CONFIG.weeks(wildcards.run, wildcards.brain),
    "real_weeks": lambda wildcards: [
        float(week) for week in measured_beside(wildcards.run, wildcards.brain)
    ],
}


# runs in which something may touch
TOUCHING = [run for run in CONFIG.runs if CONFIG.run(run).contact.kind != "none"]


def run_figure(name, title, caption, category="Folding"):
    """Returns the outputs of a rule that draws a figure of a run."""
    return figure(
        f"{RUN}/figures/{name}", title, caption, category, run="{run}", brain="{brain}"
    )


rule weekly_figure:
    input:
        simulated=run_surfaces("whole"),
        real=measured_surfaces("whole"),
    output:
        **run_figure("weekly", "simulated beside measured brains", "weekly.rst"),
    log:
        f"{RUN}/logs/weekly_figure.log",
    benchmark:
        f"{RUN}/benchmarks/weekly_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **BESIDE,
    script:
        "../scripts/weekly_figure.py"


rule displacement_maps:
    input:
        rules.simulate.output.frames,
    output:
        **run_figure("displacement_maps", "displacement maps", "displacement_maps.rst"),
    log:
        f"{RUN}/logs/displacement_maps.log",
    benchmark:
        f"{RUN}/benchmarks/displacement_maps.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
    script:
        "../scripts/displacement_maps.py"


rule contact_maps:
    input:
        rules.simulate.output.frames,
    output:
        **run_figure("contact_maps", "contact pressure", "contact_maps.rst"),
    log:
        f"{RUN}/logs/contact_maps.log",
    benchmark:
        f"{RUN}/benchmarks/contact_maps.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
        # stress that each step forgets is written per week
        quantity=lambda wildcards: (
            "contact_pressure_pa"
            if CONFIG.runs[wildcards.run].stress_memory_gw
            else "contact_pressure_pa_per_gw"
        ),
    script:
        "../scripts/contact_maps.py"


rule shape_maps:
    input:
        # of one hemisphere after the other; the maps lie beside the metrics
        simulated=lambda wildcards: [
            file
            for side in sides_of(wildcards.brain)
            for file in run_surfaces(side)(wildcards)
        ],
        real=lambda wildcards: [
            file
            for side in sides_of(wildcards.brain)
            for file in measured_surfaces(side)(wildcards)
        ],
        simulated_maps=lambda wildcards: [
            f"{RUN}/metrics/week-{week}/{side}.shape.gii"
            for side in sides_of(wildcards.brain)
            for week in week_tags(wildcards.run, wildcards.brain)
        ],
        real_maps=lambda wildcards: [
            f"results/brains/{brain}/metrics/{side}.shape.gii"
            for side in sides_of(wildcards.brain)
            for brain in beside(wildcards)
        ],
    output:
        **run_figure("{measure}", "{measure} maps", "figure.rst", "Metrics"),
    log:
        f"{RUN}/logs/shape_maps.{{measure}}.log",
    benchmark:
        f"{RUN}/benchmarks/shape_maps.{{measure}}.tsv"
    wildcard_constraints:
        measure=one_of(SHAPE_MEASURES),
    conda:
        ENVIRONMENT
    params:
        **BESIDE,
        caption=lambda wildcards: (
            f"{SHAPE_MEASURES[wildcards.measure].caption} on the pial surfaces of run *{wildcards.run}* and of the "
            "measured brains of the same weeks."
        ),
    script:
        "../scripts/shape_maps.py"


rule zones_figure:
    input:
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        params=rules.parameters.output[0],
    output:
        **run_figure("zones", "zones of the boundary", "zones.rst"),
    log:
        f"{RUN}/logs/zones_figure.log",
    benchmark:
        f"{RUN}/benchmarks/zones_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
    script:
        "../scripts/zones_figure.py"


# what the three figures of the regions share
REGIONS = {
    "mesh": rules.regions.output.mesh,
    "data": rules.regions.output.data,
    "params": rules.parameters.output[0],
}


rule mesh_figure:
    input:
        mesh=rules.regions.output.mesh,
        data=rules.regions.output.data,
    output:
        **run_figure("mesh", "the mesh, cut open", "mesh.rst"),
    log:
        f"{RUN}/logs/mesh_figure.log",
    benchmark:
        f"{RUN}/benchmarks/mesh_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
    script:
        "../scripts/mesh_figure.py"


rule contact_scheme:
    input:
        mesh=rules.tetrahedralise.output.mesh,
        data=rules.tetrahedralise.output.data,
        params=rules.parameters.output[0],
    output:
        **run_figure("contact_scheme", "scheme of contact", "contact_scheme.rst"),
    log:
        f"{RUN}/logs/contact_scheme.log",
    benchmark:
        f"{RUN}/benchmarks/contact_scheme.tsv"
    wildcard_constraints:
        run=one_of(TOUCHING),
    conda:
        ENVIRONMENT
    params:
        **drawing(),
    script:
        "../scripts/contact_scheme.py"


rule outlines_figure:
    input:
        simulated=lambda wildcards: [
            f"{RUN}/surfaces/week-{week}/pial.surf.gii"
            for week in measured_beside(wildcards.run, wildcards.brain)
        ],
        real=measured_surfaces("whole"),
    output:
        **run_figure("outlines", "outlines over each other", "outlines.rst"),
    log:
        f"{RUN}/logs/outlines_figure.log",
    benchmark:
        f"{RUN}/benchmarks/outlines_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
        measured=BESIDE["measured"],
        weeks=BESIDE["real_weeks"],
    script:
        "../scripts/outlines_figure.py"


rule growth_zone_figure:
    input:
        **REGIONS,
    output:
        **run_figure("growth_zone", "growth on the surface", "growth_zone.rst"),
    log:
        f"{RUN}/logs/growth_zone_figure.log",
    benchmark:
        f"{RUN}/benchmarks/growth_zone_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
    script:
        "../scripts/growth_zone_figure.py"


rule layers_figure:
    input:
        **REGIONS,
    output:
        **run_figure("layers", "regions and growth in sections", "layers.rst"),
    log:
        f"{RUN}/logs/layers_figure.log",
    benchmark:
        f"{RUN}/benchmarks/layers_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
    script:
        "../scripts/layers_figure.py"


rule normals_figure:
    input:
        **REGIONS,
        frames=rules.simulate.output.frames,
        maps=maps_of_run,
    output:
        **run_figure("normals", "pial normals at two weeks", "normals.rst"),
    log:
        f"{RUN}/logs/normals_figure.log",
    benchmark:
        f"{RUN}/benchmarks/normals_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
    script:
        "../scripts/normals_figure.py"


rule steps_figure:
    input:
        rules.simulate.output.steps,
    output:
        **run_figure("steps", "steps of the solver", "steps.rst"),
    log:
        f"{RUN}/logs/steps_figure.log",
    benchmark:
        f"{RUN}/benchmarks/steps_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
        order=CONFIG.mesh.order,
        elements_needed=ELEMENTS_NEEDED[CONFIG.mesh.order],
    script:
        "../scripts/steps_figure.py"


# figures of every run; those for a paper first
PAPER_FIGURES_OF_RUNS = [
    rules.weekly_figure,
    rules.outlines_figure,
    rules.mesh_figure,
    rules.displacement_maps,
    rules.shape_maps,
    rules.zones_figure,
    rules.growth_zone_figure,
    rules.layers_figure,
    rules.normals_figure,
]
FIGURES_OF_RUNS = [*PAPER_FIGURES_OF_RUNS, rules.steps_figure]
# runs that write the contact pressure
PRESSED = [
    pair
    for pair in FOLDED
    if "contact_pressure" in CONFIG.run(pair[0]).fields
    and CONFIG.run(pair[0]).contact.kind == "global"
]
