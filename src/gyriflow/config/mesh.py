"""Settings of the tetrahedral mesh."""

from typing import Literal

from ..parameters.settings import Settings, setting
from ..parameters.terms import Mesher


class MeshSettings(Settings):
    """How the start brain's pial surface is filled with tetrahedra."""

    mesher: Mesher = setting(
        "pytetwild",
        "",
        "`pytetwild` (fTetWild): the best elements, with its own surface within `envelope_mm`; `tetgen`: a finer "
        "surface with few elements below it, in a few seconds.",
    )
    order: Literal[1, 2] = setting(
        2,
        "",
        "Order of the elements: 1 linear, 2 quadratic with curved sides. Both have about as many nodes, quadratic "
        "ones an eighth of the elements.",
    )
    surface_edge_mm: float = setting(
        0.72,
        "mm",
        "Distance of neighbouring nodes in the cortex, a little less than half the cortical thickness (0.72 for "
        "1.5 mm): the edge length of linear elements, half of that of quadratic ones.",
        gt=0.1,
        le=10,
    )
    pial_faces: int | None = setting(
        None,
        "",
        "About how many triangles between nodes the mesh's surface has; `surface_edge_mm` then does not count.",
        ge=100,
        le=2_000_000,
    )
    sized_for: Literal["start", "end"] = setting(
        "start",
        "",
        "`start`: these distances are those of the start brain, and grow with the tissue; `end`: they are met at the "
        "last week of its runs: the mesh is finer by what the measured brains' surface is stretched until then.",
    )
    core_edge_mm: float = setting(2.5, "mm", "Distance of neighbouring nodes deep inside.", gt=0.1, le=20)
    fine_depth_edges: float = setting(
        2.5,
        "surface edges",
        "Depth down to which elements are as fine as at the surface; `pytetwild` only.",
        ge=0,
        le=20,
    )
    edge_growth: float = setting(
        0.5, "mm/mm", "Growth of these distances with depth below that; `pytetwild` only.", gt=0, le=2
    )
    envelope_mm: float = setting(
        0.1, "mm", "Largest distance of the mesh's surface from the pial surface; `pytetwild` only.", gt=0.001, le=2
    )
    time_limit_s: float = setting(1800.0, "s", "The mesher is stopped after this time.", gt=0)
    min_radius_ratio: float = setting(
        0.02,
        "",
        "Least accepted quality of an element: 3 × inscribed / circumscribed radius, 1 is regular.",
        ge=0,
        lt=1,
    )
    min_dihedral_deg: float = setting(1.0, "deg", "Least accepted dihedral angle of an element.", ge=0, lt=70)
    max_dihedral_deg: float = setting(178.0, "deg", "Largest accepted dihedral angle of an element.", gt=71, le=180)
    min_volume_mm3: float = setting(1e-6, "mm³", "Least accepted volume of an element.", ge=0, lt=1)
    min_jacobian_ratio: float = setting(
        0.1,
        "",
        "Least accepted determinant of a quadratic element's map, over its mean; 1 is straight, 0 folded over.",
        ge=0,
        lt=1,
    )
    max_volume_change: float = setting(
        0.01,
        "",
        "Largest accepted relative difference between the mesh's volume and that inside the pial surface.",
        gt=0,
        lt=1,
    )
    max_surface_distance_mm: float = setting(
        0.1,
        "mm",
        "Largest accepted distance between the mesh's surface and the pial surface, within which 99 % of either lies.",
        gt=0,
        le=5,
    )
    min_gap_kept: float = setting(
        0.95,
        "",
        "Least accepted fraction of the fissure and of other gaps narrower than 3 mm, by area of their walls, that "
        "stays open to at least half of its width in the mesh.",
        ge=0,
        le=1,
    )
