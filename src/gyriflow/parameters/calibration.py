"""What a calibration may be scored by: measures of the validation stage, 0 where simulated and real brain agree."""

from typing import Literal, get_args

Score = Literal["shape_index", "mean_curvature", "curvature_distribution", "size", "surface_distance"]
"""A measure of how far a simulated brain is from a real one of its week.

- shape_index, mean_curvature: 1 − r, with r the correlation over the pial surface after scaling to the real volume;
- curvature_distribution: distance between the two distributions of mean curvature (1/mm);
- size: √(a² + v²), with a, v the relative differences of pial area and volume;
- surface_distance: mean distance of the two surfaces, each to the other, in mm.
"""
SCORES: tuple[Score, ...] = get_args(Score)

AMPLITUDE = ".amplitude"
"""Ending of a parameter that scales a curve of the base run."""
STIFFNESS_RATIO = "stiffness_ratio"
"""The parameter that sets the shear modulus of the cortex to a multiple of that of the core."""

MOST_PARAMETERS = 3
MOST_RUNS = 40
