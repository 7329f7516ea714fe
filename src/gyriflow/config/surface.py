"""Settings of the pial surfaces."""

from ..parameters.settings import Settings, setting


class SurfaceSettings(Settings):
    """How label volumes and surface files become clean pial surfaces."""

    smoothing_voxels: float = setting(
        1.0, "voxels", "Standard deviation of the Gaussian that smooths a label mask before its surface is extracted.",
        ge=0, le=5,
    )  # fmt: skip
    edge_length_mm: float = setting(
        1.0, "mm", "Edge length of the remeshed pial surface; metrics are measured on it.", gt=0.1, le=5
    )
    smoothing_iterations: int = setting(10, "", "Iterations of Taubin smoothing.", ge=0, le=200)
    max_hole_mm: float = setting(
        3.0, "mm", "Holes up to this diameter are closed; larger ones are errors.", ge=0, le=20
    )
    fissure_mm: float = setting(
        1.5, "mm",
        "Width to which the fissure between the hemispheres is opened where a label volume shows none; 0: not opened.",
        ge=0, le=5,
    )  # fmt: skip
    max_hemisphere_ratio: float = setting(
        1.15, "", "Largest ratio of the volumes of two hemisphere surfaces of one brain; more is refused.", ge=1, le=20
    )
    max_asymmetry: float = setting(
        0.02, "",
        "Largest mean distance of two hemisphere surfaces from their mirror image, relative to the brain's length.",
        gt=0, le=0.5,
    )  # fmt: skip
    gap_mm: float = setting(
        0.5, "mm", "Width of the fissure that is kept where two hemisphere surfaces would touch.", ge=0, le=5
    )
