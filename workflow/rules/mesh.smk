# Tetrahedral meshes of start brains.

# limits on their quality
GATES = {"max_surface_distance_mm"}


rule tetrahedralise:
    input:
        PIAL["whole"],
    output:
        **MESH,
    priority: 1
    resources:
        mem_mb=6000,
    params:
        settings=CONFIG.mesh.model_dump(exclude=GATES),
        gates=CONFIG.mesh.model_dump(include=GATES),
        # not an output, so that it stays if the rule fails
        refused=f"{BRAIN}/mesh/refused",
    script:
        "../scripts/tetrahedralise.py"


# of the first brain of an atlas, for its path: the same in all studies
use rule tetrahedralise as path_mesh with:
    output:
        **PATH_MESH,
    params:
        settings=CONFIG.growth.path_mesh.model_dump(exclude=GATES),
        gates=CONFIG.growth.path_mesh.model_dump(include=GATES),
        refused=f"{BRAIN}/path/refused",


rule mesh:
    input:
        expand(list(MESH.values()), brain=[start.id for start in study.starts]),
