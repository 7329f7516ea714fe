"""An ellipsoid in the place of a brain, far from the origin: its size and place in mm,
and the parameters of its run."""

from shapes import ellipsoid_mesh

from gyriflow.geometry.tetrahedra import TetrahedralMesh

SEMI_AXES = (20.0, 26.0, 18.0)
CENTRE_MM = (150.0, -220.0, 140.0)
"""Where it lies, so that a coordinate does not stand for a length."""
RUN = {
    "start_week": 21.0,
    "end_week": 22.0,
    "output_weeks": [21.0, 22.0],
    "fissure_x_mm": CENTRE_MM[0],
    "thickness_mm": 4.0,
    "contact": "planes",
}
FREE_BODY = ellipsoid_mesh(8, (20.0, 24.0, 18.0))
FREE_RUN = {
    "start_week": 21.0,
    "end_week": 23.0,
    "output_weeks": [21.0, 23.0],
    "fissure_x_mm": 0.0,
    "step_s": 86_400.0,
    "support": "free",
    "contact": "none",
    "thickness_mm": 4.0,
}
"""A body around the origin, and its run without contact and support."""
GAP_MM = 8.0
"""Width of its fissure."""


def brain_mesh(
    cells: int, semi_axes: tuple[float, float, float] = SEMI_AXES
) -> TetrahedralMesh:
    """Return the mesh of the ellipsoid, or of one with other semi-axes at its place."""
    return ellipsoid_mesh(cells, semi_axes, CENTRE_MM)
