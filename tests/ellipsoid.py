"""An ellipsoid in the place of a brain: its semi-axes in mm, and the parameters of its
run."""

SEMI_AXES = (20.0, 26.0, 18.0)
RUN = {
    "start_week": 21.0,
    "end_week": 22.0,
    "output_weeks": [21.0, 22.0],
    "fissure_x_mm": 0.0,
    "thickness_mm": 4.0,
    "contact": {"kind": "planes"},
}
GAP_MM = 8.0
"""Width of its fissure."""
