"""Names and codes that files, settings and figures share."""

from collections.abc import Iterable, Sequence
from typing import Literal, get_args

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = get_args(Side)
STRUCTURES: dict[Side, Literal["CortexLeft", "CortexRight"]] = {"left": "CortexLeft", "right": "CortexRight"}
"""What GIFTI files call the cortex of each side."""

RegionField = Literal["zones", "distance", "cortex_weight", "growth", "shear_modulus", "bulk_modulus", "normal"]
VertexField = Literal["displacement", RegionField, "contact_pressure"]
"""Fields that a run can write for ParaView with values per vertex."""
ElementField = Literal["stress", "strain", "volume_ratio"]
"""Fields with values per element (up to four arrays each)."""
FieldName = Literal[VertexField, ElementField]
ELEMENT_FIELDS: tuple[ElementField, ...] = get_args(ElementField)
REGION_FIELDS: tuple[RegionField, ...] = get_args(RegionField)
"""Fields written with the regions, before the solve."""

Mesher = Literal["pytetwild", "tetgen"]
"""The programs that fill a surface with tetrahedra."""
MOST_HOLE_MM = 20.0
"""The largest hole of a surface that can be asked to be closed."""
Coordinates = Literal["auto", "ras", "lps"]
"""Axes of the coordinates in surface files; `auto`: to be found."""
AffineSource = Literal["auto", "sform", "qform"]
"""Which affine of a NIfTI file is used; `auto` refuses two that disagree."""

MaterialName = Literal["neo-hookean", "compressible-neo-hookean"]
"""Names of the constitutive laws; each is a class of `mechanics.materials`."""

FREE, CLAMPED, LEFT_CONTACT, RIGHT_CONTACT, BETWEEN_PLANES, BASE, SIDE_X, SIDE_Y, MEDIAL_WALL = range(9)
"""Zones of the boundary's facets."""
ZONE_NAMES = (
    *("free", "clamped", "left contact", "right contact", "between planes", "base", "side x", "side y"),
    "medial wall",
)
"""Their names, by code."""
SHAPE_CUTS = (BASE, SIDE_X, SIDE_Y)
"""Zones of simple shapes only: flat cuts through tissue."""
FLAT_CUTS = (*SHAPE_CUTS, MEDIAL_WALL)
"""Zones without cortex: the cuts, and the medial wall of a hemisphere that is alone."""

LEFT, RIGHT, BRIDGE = 1, 2, 3
"""Tags of the hemispheres, and of the tissue between the contact planes."""
CORTEX, CORE = 1, 2
"""Tags of the layers."""

ELEMENTS_NEEDED = {1: 2.0, 2: 0.8}
"""Elements through the cortex by their order, below which folds may be the mesh's: thickness over the mean edge of the
elements in it. For quadratic ones it comes from the table of docs/verification.md (Convergence on a brain): two
distances of nodes to the thickness at the surface are enough for sizes and places, and that mesh counts 0.81 at its
start over the cortex's volume, where elements are longer. As it grows the count falls (0.49 at 28 GW, where the errors
of that table were found), so that what is said of later weeks is cautious."""

LONGEST_NAME = 100
"""Characters that the name of a brain, run or study has at most: names of files have 255 bytes."""

MEASURED = "real"
"""The run of measured brains in tables."""
REAL_BRAIN = "real brain"
"""What a measured brain is called in figures where its population is not named."""

NO_REGION = 0
"""The label of what is in no region."""

MOST_COLOURED = 6
"""Values of a covariate that charts tell apart by colours."""
SPREAD_UNKNOWN = "spread of individuals unknown"
"""The flag of a brain that is compared with averages, such as an atlas: they have a curve, and no centiles."""

CORTICAL_STEEPNESS = 10.0
"""Of the cortical weight w = 1/(1 + exp(10 (d/H − 1))), which is ½ at the border of cortex and core."""

# metrics

LastBand = Literal["B4", "B5", "B6"]
"""The last complete band of eigenmodes."""

CURVATURE_RADIUS_MM = 3.0
"""At edges of 0.8 mm its bias is that of three rings of neighbours, with half their noise (docs/metrics.md)."""
SPANGY_MODES: LastBand = "B5"

FOLD_BANDS = (4, 5, 6)
"""Bands of the primary, secondary and tertiary folds (Germanaud et al. 2012)."""

# what a calibration may be scored by

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


CORE_POWER_W = 12.0
"""Power of a busy core: a processor's over its cores."""
CARBON_INTENSITY_G_PER_KWH = 475.0
"""CO₂ emitted for electricity, the world's average of 2019 (IEA)."""


def run_names(folded: Iterable[Sequence[str]]) -> list[str]:
    """Return what (run, brain) pairs are called in figures: their run, with the brain where a run has several."""
    pairs = [(run, brain) for run, brain in folded]
    several = {run for run, _ in pairs if sum(run == other for other, _ in pairs) > 1}
    return [f"{run} · {brain}" if run in several else run for run, brain in pairs]
