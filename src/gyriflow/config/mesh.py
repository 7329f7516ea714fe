"""Settings of the tetrahedral mesh."""

from .base import Settings, setting


class MeshSettings(Settings):
    """How the start brain's pial surface is filled with tetrahedra."""

    surface_edge_mm: float = setting(
        0.72, "mm", "Edge length in the cortex: at most half the cortical thickness.", gt=0.1, le=10
    )
    core_edge_mm: float = setting(2.5, "mm", "Edge length deep inside.", gt=0.1, le=20)
    envelope_mm: float = setting(0.1, "mm", "How far the mesh's surface may be from the pial surface.", gt=0.001, le=2)
    time_limit_s: float = setting(1800.0, "s", "The mesher is stopped after this time.", gt=0)
    min_radius_ratio: float = setting(
        0.02,
        "",
        "Least accepted quality of an element: 3 × inscribed / circumscribed radius, 1 is regular.",
        ge=0,
        lt=1,
    )
