"""What is measured at each vertex of a brain's surface and drawn as a map: names and what figures call them."""

SHAPE_MEASURES = {
    "shape_index": "shape index (sulci −1, gyri +1)",
    "curvedness": "curvedness (mm⁻¹)",
    "sulcal_depth_mm": "sulcal depth (mm)",
}
"""Arrays per vertex that the metrics of a brain give, with their labels in figures."""
