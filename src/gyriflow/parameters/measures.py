"""What is measured at each vertex of a brain's surface and drawn as a map."""

from dataclasses import dataclass


@dataclass(frozen=True)
class VertexMeasure:
    """How a map per vertex is drawn: the colour bar's label and the colours.

    The limits are the ends of the colour scale; None: from 0 to where few vertices of all surfaces are above.
    """

    label: str
    colours: str = "YlGnBu"
    limits: tuple[float, float] | None = None


SHAPE_MEASURES = {
    "shape_index": VertexMeasure("shape index (sulci −1, gyri +1)", colours="RdBu_r", limits=(-1.0, 1.0)),
    "curvedness": VertexMeasure("curvedness (mm⁻¹)"),
    "sulcal_depth_mm": VertexMeasure("sulcal depth (mm)"),
    "thickness_mm": VertexMeasure("cortical thickness (mm)"),
}
"""The arrays per vertex of a brain's metrics that are drawn as maps, by name."""
