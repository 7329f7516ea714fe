# Figures of each run from each brain that it folds.
from gyriflow.parameters.measures import SHAPE_MEASURES


def measured_beside(run, brain):
    """Returns, by week, the measured brain that a run's surface of that week is shown beside."""
    measured = {week_tag(one.week): one.id for one in reversed(CONFIG.brains)}
    tags = week_tags(run, brain)
    return {week: measured[week] for week in tags if week in measured}


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


# what figures that show simulated beside measured brains are told
BESIDE = {
    **drawing(),
    "measured": lambda wildcards: CONFIG.measured_name(beside(wildcards)),
    "simulated_weeks": lambda wildcards: CONFIG.weeks(wildcards.run, wildcards.brain),
    "real_weeks": lambda wildcards: [
        float(week) for week in measured_beside(wildcards.run, wildcards.brain)
    ],
}


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
        # stress that each step forgets is written per week
        quantity=lambda wildcards: (
            "contact_pressure_pa"
            if CONFIG.runs[wildcards.run].stress_memory_gw
            else "contact_pressure_pa_per_gw"
        ),
        **drawing(),
    script:
        "../scripts/contact_maps.py"


rule shape_maps:
    input:
        simulated_left=run_surfaces("left"),
        simulated_right=run_surfaces("right"),
        real_left=measured_surfaces("left"),
        real_right=measured_surfaces("right"),
        # the maps lie beside the metrics
        simulated_maps=lambda wildcards: [
            f"{RUN}/metrics/week-{week}/{side}.shape.gii"
            for side in SIDES
            for week in week_tags(wildcards.run, wildcards.brain)
        ],
        real_maps=lambda wildcards: [
            f"results/brains/{brain}/metrics/{side}.shape.gii"
            for side in SIDES
            for brain in beside(wildcards)
        ],
    output:
        **run_figure("{measure}", "{measure} maps", "shape_maps.rst", "Metrics"),
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
    output:
        **run_figure("normals", "pial normals in sections", "normals.rst"),
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
    script:
        "../scripts/steps_figure.py"
