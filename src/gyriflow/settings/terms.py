"""Names and codes that files, settings and figures share."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Literal, get_args

import numpy as np

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = get_args(Side)
STRUCTURES: dict[Side, Literal["CortexLeft", "CortexRight"]] = {
    "left": "CortexLeft",
    "right": "CortexRight",
}
"""Names of each side's cortex in GIFTI files."""

RegionField = Literal[
    "zones",
    "distance",
    "cortex_weight",
    "growth",
    "shear_modulus",
    "bulk_modulus",
    "normal",
]
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
FUSED_AFTER_GW = 26.0
"""Up to this week labels of 0.8 mm close no sulci: CRL has the same area with fused and
opened ones."""
Coordinates = Literal["auto", "ras", "lps"]
"""Axes of the coordinates in surface files; `auto`: determined from the shape."""
AffineSource = Literal["auto", "sform", "qform"]
"""The affine of a NIfTI file that is used; `auto` refuses two that disagree."""

MaterialName = Literal["neo-hookean", "compressible-neo-hookean"]
"""Names of the constitutive laws; each is a class of `mechanics.materials`."""

(
    FREE,
    CLAMPED,
    LEFT_CONTACT,
    RIGHT_CONTACT,
    BETWEEN_PLANES,
    BASE,
    SIDE_X,
    SIDE_Y,
    MEDIAL_WALL,
) = range(9)
"""Zones of the boundary's facets."""
ZONE_NAMES = (
    "free",
    "clamped",
    "left contact",
    "right contact",
    "between planes",
    "base",
    "side x",
    "side y",
    "medial wall",
)
"""Their names, by code."""
SHAPE_CUTS = (BASE, SIDE_X, SIDE_Y)
"""Zones of simple shapes only: flat cuts through tissue."""
FLAT_CUTS = (*SHAPE_CUTS, MEDIAL_WALL)
"""Zones without cortex: the cuts, and the medial wall of a single hemisphere."""

LEFT, RIGHT, BRIDGE = 1, 2, 3
"""Tags of the hemispheres, and of the tissue between the contact planes."""
CORTEX, CORE = 1, 2
"""Tags of the layers."""

ELEMENTS_NEEDED = {1: 2.0, 2: 0.8}
"""Minimum number of elements through the cortex, by element order: thickness over the
mean edge length there. With fewer, folds may depend on the mesh. The value for
quadratic elements comes from docs/verification.md (Convergence on a brain): two node
distances through the thickness at the surface are enough, and that mesh has a count of
0.81 at its start. The count falls as the brain grows (0.49 at 28 GW), so warnings about
later weeks are cautious. Runs whose growth has no layers (`GrowthModel.has_layers`)
need none."""
ELEMENT_ERRORS = {
    1: {2.0: 32.2, 4.0: 13.3, 8.0: 4.5},
    2: {1.0: 4.3, 2.0: 0.9},
}
"""How much too slowly the fastest wave grows (%), by element order and cells per
thickness of a uniform slab (docs/verification.md, Elements). The slab's mean edge is
1.26 cells, so for as many elements these are upper bounds."""
LARGE_ELEMENT_ERROR = 10.0
"""Error in % above which there is a warning."""

MAX_NAME_LENGTH = 100
"""Longest name of a brain, run or study; file names are limited to 255 bytes."""

OBSERVED = "observed"
"""The run of observed brains in tables."""
OBSERVED_BRAIN = "observed brain"
"""Name of an observed brain of unknown population in figures."""

NO_REGION = 0
"""The label of vertices without a region."""

MAX_COLOURS = 6
"""Largest number of covariate values that charts show by colour."""
SPREAD_UNKNOWN = "spread of individuals unknown"
"""Flag of a brain that is compared with averages, such as an atlas, which have a curve
but no centiles."""

CORTICAL_STEEPNESS = 10.0
"""Steepness of the cortical weight w = 1/(1 + exp(10 (d/H − 1))), which is ½ at the
border of cortex and core."""

# metrics

LastBand = Literal["B4", "B5", "B6"]
"""The last complete band of eigenmodes."""

MassMatrix = Literal["mean", "consistent"]
"""The mass matrix of eigenmodes: the mean of consistent and lumped, or the consistent
one."""

CURVATURE_RADIUS_MM = 3.0
"""With edges of 0.8 mm it has the bias of three rings of neighbours and half their
noise (docs/metrics.md)."""
SPANGY_MODES: LastBand = "B5"

PROXIES = ("mean_curvature", "shape_index")
"""Maps whose spectra are computed: as in SpAnGy (Germanaud et al. 2012), and as in the
FetalFoldSim paper."""
SPECTRUM_PREFIXES = {"mean_curvature": "", "shape_index": "shape_index_"}
"""Prefixes of the names of metrics and measures of a proxy's spectrum."""
MIN_KEPT_CURVATURE = 0.8
"""A band is resolved if a wave of its middle length keeps this share of its
curvature."""
FOLD_BANDS = (4, 5, 6)
"""Bands of the primary, secondary and tertiary folds (Germanaud et al. 2012)."""


def min_norm_subjects(*, individuals: bool) -> int:
    """Return how many subjects a norm needs at least: individuals, or average brains as
    in an atlas."""
    return 10 if individuals else 5


# scores of calibration

SpectralScore = Literal[
    "relative_power_b4", "relative_power_b5", "relative_power_b6", "spectral_distance"
]
Score = Literal[
    "shape_index",
    "mean_curvature",
    "curvature_distribution",
    "size",
    "surface_distance",
    SpectralScore,
]
"""A measure of the difference between a simulated and an observed brain of the same
week.

- shape_index, mean_curvature: 1 − r, with r the correlation over the pial surface after
  scaling to the observed volume;
- curvature_distribution: distance between the two distributions of mean curvature
  (1/mm);
- size: √(a² + v²), with a, v the relative differences of pial area and volume;
- surface_distance: mean distance of the two surfaces, each to the other, in mm;
- relative_power_b4, _b5, _b6: difference of a band's share in the power of mean
  curvature, mean of the hemispheres;
- spectral_distance: distance of these spectra up to the last fold band that is
  complete.
"""
SCORES: tuple[Score, ...] = get_args(Score)
SPECTRAL_SCORES: tuple[SpectralScore, ...] = get_args(SpectralScore)


def rounded_elements(elements: float) -> float:
    """Return a number of elements through the cortex to two digits, as texts show it
    and verdicts judge it."""
    return float(f"{elements:.2g}")


def is_too_coarse(order: int, elements: float) -> bool:
    """Return whether fewer elements lie through the cortex than are needed; NaN: no
    element lies in it at all."""
    return not rounded_elements(elements) >= ELEMENTS_NEEDED[order]


def element_error(order: int, elements: float) -> tuple[float, str]:
    """Return the error of the fastest wave in % for a number of elements through the
    cortex, and text with both."""
    counts = np.log(list(ELEMENT_ERRORS[order]))
    errors = np.log(list(ELEMENT_ERRORS[order].values()))
    error = float(
        np.exp(
            np.interp(
                np.log(max(0.1, elements)),
                counts,
                errors,
            )
        )
    )
    bound = "more than" if is_too_coarse(order, elements) else "up to"
    kind = "linear" if order == 1 else "quadratic"
    text = (
        f"{rounded_elements(elements):g} {kind} elements through the cortex: the"
        f" fastest wave of folding grows {bound} {error:.0f} % too slowly (at Poisson's"
        " ratio 0.45)"
    )
    if order == 1 and error > LARGE_ELEMENT_ERROR:
        quadratic, _ = element_error(2, max(elements / 2, 1.0))
        text += f" (quadratic elements on as many nodes: up to {quadratic:.0f} %)"
    return error, text


def run_names(folded: Iterable[Sequence[str]]) -> list[str]:
    """Return names of (run, brain) pairs for figures: the run, with the brain if the
    run has several."""
    pairs = list(folded)
    counts = Counter(run for run, _ in pairs)
    names = []
    for run, brain in pairs:
        has_several = counts[run] > 1
        names.append(f"{run} · {brain}" if has_several else run)
    return names
