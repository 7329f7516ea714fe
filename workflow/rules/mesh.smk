# The brains that runs start from as tetrahedral meshes.
MESH_GATES = {
    key: value
    for key, value in CONFIG.mesh.model_dump().items()
    if key.startswith(("min_", "max_"))
}


def stretched_until(wildcards):
    """Returns what tells how far a mesh will be stretched if it is made for the end of the runs, else nothing."""
    if CONFIG.mesh.sized_for == "start":
        return None
    return {
        "series": CONFIG.estimated_from(wildcards.brain),
        "week": CONFIG.brain(wildcards.brain).week,
        "end_week": CONFIG.last_week(wildcards.brain),
    }


rule tetrahedralise:
    input:
        PIAL["whole"],
        curves=(
            rules.growth_curves.output.curves if CONFIG.mesh.sized_for == "end" else []
        ),
    output:
        mesh=f"{BRAIN}/mesh/brain.xdmf",
        data=f"{BRAIN}/mesh/brain.h5",
        surface=f"{BRAIN}/mesh/pial.stl",
        quality=f"{BRAIN}/mesh/quality.json",
    log:
        f"{BRAIN}/logs/tetrahedralise.log",
    benchmark:
        f"{BRAIN}/benchmarks/tetrahedralise.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=6000,
        runtime=60,
    params:
        settings=CONFIG.mesh.model_dump(exclude={*MESH_GATES, "sized_for"}),
        stretched=stretched_until,
        gates=MESH_GATES,
        # not an output, so that it stays if the rule fails
        refused=f"{BRAIN}/mesh/refused",
    script:
        "../scripts/tetrahedralise.py"


rule quality_figure:
    input:
        rules.tetrahedralise.output.quality,
    output:
        **figure(
            f"{BRAIN}/figures/mesh_quality",
            "mesh quality",
            "figure.rst",
            "Brains and growth",
            brain="{brain}",
        ),
    log:
        f"{BRAIN}/logs/quality_figure.log",
    benchmark:
        f"{BRAIN}/benchmarks/quality_figure.tsv"
    conda:
        ENVIRONMENT
    params:
        **drawing(),
        caption=(
            "Quality of the tetrahedra: radius ratio (3 × inscribed / circumscribed radius, 1 for a "
            "regular element), smallest and largest dihedral angle, and volume. Dashed lines: the "
            "limits of the configuration. Below: distance between the mesh's surface and the pial "
            "surface, number of crossing faces, difference in volume, and the fraction of gaps "
            "narrower than 3 mm, such as the fissure, that is still open."
        ),
        gates=MESH_GATES,
    script:
        "../scripts/quality_figure.py"


# of a mesh that did not pass the gates; made on request
use rule quality_figure as refused_quality_figure with:
    input:
        f"{BRAIN}/mesh/refused/quality.json",
    output:
        png=f"{BRAIN}/mesh/refused/quality.png",
        pdf=f"{BRAIN}/mesh/refused/quality.pdf",
    log:
        f"{BRAIN}/logs/refused_quality_figure.log",
    benchmark:
        f"{BRAIN}/benchmarks/refused_quality_figure.tsv"


rule mesh:
    input:
        expand(rules.tetrahedralise.output, brain=CONFIG.start_brains),
