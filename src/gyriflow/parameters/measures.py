"""What is measured at each vertex of a brain's surface and drawn as a map."""

from dataclasses import dataclass


@dataclass(frozen=True)
class VertexMeasure:
    """How a map per vertex is drawn and described: the colour bar's label, the beginning of a sentence, its colours.

    The limits are the ends of the colour scale; None: from 0 to where few vertices of all surfaces are above.
    """

    label: str
    caption: str
    colours: str = "YlGnBu"
    limits: tuple[float, float] | None = None


SHAPE_MEASURES = {
    "shape_index": VertexMeasure(
        "shape index (sulci −1, gyri +1)",
        "Shape index, from −1 in sulci (blue) to +1 on gyri (red),",
        colours="RdBu_r",
        limits=(-1.0, 1.0),
    ),
    "curvedness": VertexMeasure(
        "curvedness (mm⁻¹)", "Curvedness, √((κ₁² + κ₂²)/2), which tells how sharply the surface is bent,"
    ),
    "sulcal_depth_mm": VertexMeasure(
        "sulcal depth (mm)",
        "Sulcal depth, the straight distance to the convex hull of each hemisphere,",
    ),
    "thickness_mm": VertexMeasure(
        "cortical thickness (mm)",
        "Cortical thickness, of simulated brains to the border that the cortex had at the start, carried with the "
        "tissue, of measured brains where labels or white surfaces give it (else grey),",
    ),
}
"""The arrays per vertex of a brain's metrics that are drawn as maps, by name."""
