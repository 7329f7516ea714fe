"""Choices of the metrics, with their defaults: what configuration, measuring and figures share."""

from typing import Literal

SpangyProxy = Literal["shape_index", "mean_curvature"]
"""The map whose spectrum is analysed."""
LastBand = Literal["B4", "B5", "B6"]
"""The last complete band."""
ModesWord = Literal[LastBand, "common", "own"]
"""What the number of eigenmodes may be called instead of being given."""
WeylFormula = Literal["paper", "textbook"]
"""Relation between the shortest wavelength WL and λ: 2π/WL² or (2π/WL)²."""

ExportNames = Literal["plain", "bids"]
"""How exported files are named."""

CURVATURE_RADIUS_MM = 3.0
"""At edges of 0.8 mm its bias is that of three rings of neighbours, with half their noise (docs/metrics.md)."""
SPANGY_PROXY: SpangyProxy = "shape_index"
SPANGY_MODES: LastBand = "B5"
SPANGY_WAVELENGTH: WeylFormula = "paper"

FOLD_BANDS = (4, 5, 6)
"""Bands of the primary, secondary and tertiary folds (Germanaud et al. 2012)."""
