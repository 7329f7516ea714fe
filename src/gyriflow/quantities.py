"""What is measured at each vertex of a brain's surface and drawn as a map."""

from dataclasses import dataclass


@dataclass(frozen=True)
class VertexMeasure:
    """How a map per vertex is drawn: the colour bar's label and the colours.

    The limits are the ends of the colour scale; None: from 0 to the `quantile` of all vertices.
    """

    label: str
    colours: str = "YlGnBu"
    limits: tuple[float, float] | None = None
    quantile: float = 0.995


SHAPE_MEASURES = {
    "shape_index": VertexMeasure("shape index (sulci −½, gyri +½)", colours="RdBu_r", limits=(-1.0, 1.0)),
    "curvedness": VertexMeasure("curvedness (mm⁻¹)", quantile=0.98),
    "sulcal_depth_mm": VertexMeasure("sulcal depth (mm)"),
    "thickness_mm": VertexMeasure("cortical thickness (mm)"),
}
"""The arrays per vertex of a brain's metrics that are drawn as maps, by name."""
