"""Quantities that are measured on brains: a record for each map over a surface and each
number in metrics tables.

Whatever measures, draws, tabulates or exports a quantity looks it up here by name; a
name without a record is an error. Units are written as in the tables: "1/mm2" for mm⁻²,
"1" for none.
"""

from dataclasses import dataclass, replace
from enum import Flag, auto
from typing import Any


class Registry[Record](dict[str, Record]):
    """Records by name; KeyError that names this file for a name without a record."""

    def __missing__(self, name: str) -> Record:
        raise KeyError(f"{name!r} has no record in gyriflow/quantities.py")


class Shown(Flag):
    """The places where a metric is shown or used, besides in the tables of the study
    and of the brain, with the function that looks it up."""

    CHART = auto()  # chart of metrics over the weeks (metrics_figure)
    NORMS = auto()  # chart of norms (norms_figure)
    REGIONS = auto()  # chart of regions (regions_chart)
    BRAINS = auto()  # the report's table of brains (brain_rows)
    SHEET = auto()  # the first sheet of a brain's page (brain_content)
    PREDICTION = auto()  # the report's table of a predicted brain (_predicted_table)
    INTERVALS = auto()  # intervals of ensembles (interval_table, intervals_figure)
    SIZE = auto()  # relative difference of a sweep's runs (member_comparison)
    WHITE = auto()  # also of white surfaces, as `white_…` (measure_white)


CHART, NORMS, REGIONS, BRAINS, SHEET, PREDICTION, INTERVALS, SIZE, WHITE = Shown
NOWHERE = Shown(0)


@dataclass(frozen=True)
class VertexMap:
    """A value at each vertex of a surface.

    `name` is that of the array in its file. The maps of measured brains are exported
    with a `bids_suffix` and a `description`, and with values times `export_sign`, so
    that names of other tools have their signs. `is_averaged`: its mean is given by
    region. A map with `colours`, a colour map of Matplotlib, is drawn, between `limits`
    or else from 0 to the `quantile` of the vertices, and as far below 0 if it
    `is_signed` or has negative values. The colour bar has the `label` with the unit, or
    with what the `ends` of the scale mean. `mean_shown`: where its mean is shown.
    """

    name: str
    unit: str
    label: str
    bids_suffix: str = ""
    description: str = ""
    export_sign: int = 1
    is_averaged: bool = True
    colours: str = ""
    limits: tuple[float, float] | None = None
    quantile: float = 0.995
    is_signed: bool = False
    ends: str = ""
    mean_shown: Shown = NOWHERE

    @property
    def mean_name(self) -> str:
        """The metric that is the mean of the map over a region."""
        return f"mean_{self.name.removesuffix('_mm').removeprefix('mean_')}"


@dataclass(frozen=True)
class Metric:
    """A number of a whole brain, a hemisphere or a region.

    `label` is its name in figures and reports, `digits` how many significant ones these
    give. `has_norm` is False if it describes the mesh or the analysis rather than the
    brain: it is not compared with that of other brains. `is_reported` is False if it is
    only given in the tables of the study. `is_signed`: it may be negative.
    """

    name: str
    unit: str
    label: str
    shown: Shown = NOWHERE
    has_norm: bool = True
    is_reported: bool = True
    is_signed: bool = False
    digits: int = 4

    def text(self, value: float) -> str:
        """Return a value as text, without the unit."""
        return f"{value:.{self.digits}g}".replace("-", "−")


POSITIVE_COLOURS, SIGNED_COLOURS = "YlGnBu", "RdBu_r"
DISTINCT_COLOURS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#8C6D31",
    "#F0E442",
)
"""Okabe and Ito's colour-blind-safe colours, without black."""

_BRAIN_MAPS = (
    VertexMap(
        "shape_index",
        "1",
        "shape index",
        "shapeIndex",
        "Shape index, -1 in pits, -0.5 in sulci, 0.5 on gyri, 1 on caps",
        colours=SIGNED_COLOURS,
        limits=(-1.0, 1.0),
        ends="sulci −½, gyri +½",
        is_signed=True,
    ),
    VertexMap(
        "curvedness",
        "1/mm",
        "curvedness",
        "curvedness",
        "Curvedness, the root mean square of the principal curvatures",
        colours=POSITIVE_COLOURS,
        quantile=0.98,
    ),
    VertexMap(
        "mean_curvature",
        "1/mm",
        "mean curvature",
        "curv",
        "Mean curvature, positive on gyri as in HCP's files; FreeSurfer's have the"
        " opposite sign",
        is_signed=True,
        mean_shown=REGIONS,
    ),
    VertexMap(
        "gaussian_curvature",
        "1/mm2",
        "Gaussian curvature",
        "gaussCurv",
        "Gaussian curvature, positive on caps and in pits, negative on saddles",
        is_averaged=False,
    ),
    VertexMap(
        "sulcal_depth_mm",
        "mm",
        "sulcal depth",
        "sulc",
        "Minus the distance to the convex hull of the hemisphere: 0 on gyri and"
        " negative in sulci, so larger on gyri as in HCP's files; FreeSurfer's have the"
        " opposite sign",
        export_sign=-1,
        colours=POSITIVE_COLOURS,
    ),
    VertexMap(
        "local_gyrification_index",
        "1",
        "local gyrification index",
        "localGyrificationIndex",
        "Local gyrification index",
        mean_shown=REGIONS,
    ),
    VertexMap(
        "reliable",
        "1",
        "reliable",
        "reliable",
        "1 where the maps can be relied on, 0 near a cut",
        is_averaged=False,
    ),
    VertexMap(
        "thickness_mm",
        "mm",
        "cortical thickness",
        "thickness",
        "Cortical thickness; NaN where it was not measured: without cortex below, such"
        " as at the cut between the hemispheres, and where the fissure or fused sulci"
        " were opened. The share of the area that has a value is"
        " thickness_measured_share in metrics_wide.tsv",
        colours=POSITIVE_COLOURS,
    ),
    VertexMap(
        "spangy_dominant_band",
        "1",
        "dominant SpAnGy band",
        "spangyDominantBand",
        "Spangy dominant band by mean curvature",
        is_averaged=False,
    ),
    VertexMap(
        "spangy_shape_index_dominant_band",
        "1",
        "dominant SpAnGy band, shape index",
        "spangyShapeIndexDominantBand",
        "Spangy dominant band by shape index",
        is_averaged=False,
    ),
    VertexMap(
        "template_distance_mm",
        "mm",
        "distance from the template",
        "templateDistance",
        "Template distance",
        is_averaged=False,
    ),
)
_SIGNED: Any = {"colours": SIGNED_COLOURS, "is_signed": True}
_DEVIATION_MAPS = (
    VertexMap("distance_mm", "mm", "distance, outwards", **_SIGNED),
    VertexMap("log_area", "1", "logarithm of the area's ratio", **_SIGNED),
    VertexMap("thickness_difference_mm", "mm", "difference of thickness", **_SIGNED),
)
_DRAWN: Any = {"colours": POSITIVE_COLOURS, "is_averaged": False}
_PROBABILITY: Any = {"limits": (0.0, 1.0), **_DRAWN}
_SIMULATION_MAPS = (
    VertexMap("displacement_mm", "mm", "displacement since the start", **_DRAWN),
    VertexMap("area_growth_percent_per_gw", "% per week", "growth of area", **_DRAWN),
    VertexMap(
        "thickness_growth_percent_per_gw",
        "% per week",
        "growth across the surface",
        is_averaged=False,
    ),
    VertexMap("position_sd_mm", "mm", "SD of position", **_DRAWN),
    VertexMap("sulcus_probability", "1", "probability of a sulcus", **_PROBABILITY),
    VertexMap("gyrus_probability", "1", "probability of a gyrus", **_PROBABILITY),
)
VERTEX_MAPS = Registry(
    {
        record.name: record
        for record in (*_BRAIN_MAPS, *_DEVIATION_MAPS, *_SIMULATION_MAPS)
    }
)
"""The maps, by name."""


def name_in_interval(
    name: str,
    before: float,
    week: float,
) -> str:
    """Return the name of a map between two weeks, in a file with maps of several
    intervals."""
    return f"{name} {before:g}-{week:g} GW"


COMPARED_MAPS = ("shape_index", "mean_curvature")
"""The maps by which a simulated brain is correlated with an observed one."""

_SIZES = (
    Metric(
        "volume",
        "mL",
        "volume, with ventricles",
        CHART | NORMS | BRAINS | SHEET | PREDICTION | INTERVALS | SIZE,
    ),
    Metric("volume_tissue", "mL", "volume of tissue", SHEET),
    Metric("volume_ventricles", "mL", "volume of ventricles", SHEET),
    Metric("volume_cortex", "mL", "volume of cortex"),
    Metric(
        "area",
        "cm2",
        "pial area",
        CHART
        | NORMS
        | REGIONS
        | BRAINS
        | SHEET
        | PREDICTION
        | INTERVALS
        | SIZE
        | WHITE,
    ),
    Metric("area_share", "1", "area share"),
    # cm² over mL^(2/3) is a number
    Metric("relative_area", "1", "area / volume^(2/3)", PREDICTION),
    Metric("area_ratio", "1", "area ratio", has_norm=False),
    Metric("crossing_faces", "1", "crossing faces", has_norm=False, is_reported=False),
)
_GYRIFICATION = CHART | NORMS | BRAINS | SHEET | PREDICTION | INTERVALS | SIZE | WHITE
_DEPTH = CHART | NORMS | REGIONS | BRAINS | SHEET | PREDICTION | INTERVALS | WHITE
_FOLDING = (
    Metric("gyrification_index", "1", "gyrification index, hulls", _GYRIFICATION),
    Metric(
        "gyrification_index_envelope",
        "1",
        "gyrification index, envelopes",
        CHART | WHITE,
    ),
    Metric("mean_shape_index", "1", "mean shape index", CHART | WHITE, is_signed=True),
    Metric(
        "mean_curvedness", "1/mm", "mean curvedness", CHART | NORMS | PREDICTION | WHITE
    ),
    Metric("sulcal_area_share", "1", "sulcal area share", WHITE),
    Metric(
        "curvature_radius", "mm", "curvature radius", has_norm=False, is_reported=False
    ),
    Metric("curvature_wavelength", "mm", "curvature wavelength", has_norm=False),
    Metric("mean_sulcal_depth", "mm", "mean depth below the hull", _DEPTH),
    Metric("sulcal_depth_95", "mm", "depth below the hull, 95 %", WHITE),
    Metric("intrinsic_curvature_index", "1", "intrinsic curvature index"),
    Metric("folding_index", "1", "folding index", CHART),
    Metric("mean_curvature_norm", "1", "mean curvature norm"),
    Metric("gaussian_curvature_norm", "1", "Gaussian curvature norm"),
    *(
        Metric(
            f"mean_curvature_q{part}",
            "1/mm",
            f"mean curvature q{part}",
            is_reported=False,
            is_signed=True,
        )
        for part in ("05", "25", "50", "75", "95")
    ),
)
_THICKNESS = (
    Metric(
        "mean_thickness",
        "mm",
        "mean cortical thickness",
        CHART | NORMS | REGIONS | BRAINS | SHEET,
    ),
    Metric("thickness_sd", "mm", "cortical thickness, SD"),
    Metric("thickness_q05", "mm", "thickness q05", is_reported=False),
    Metric("thickness_q95", "mm", "thickness q95", is_reported=False),
    Metric(
        "thickness_measured_share",
        "1",
        "thickness measured share",
        has_norm=False,
        is_reported=False,
    ),
)
_SHAPE = "spangy_shape_index_"
_SPECTRUM = (
    *(
        Metric(
            f"spangy_B{band}_power",
            "1",
            f"SpAnGy B{band} power",
        )
        for band in range(7)
    ),
    *(
        Metric(
            f"spangy_B{band}_relative_power",
            "1",
            f"SpAnGy B{band} relative power",
        )
        for band in range(1, 7)
    ),
    Metric("spangy_captured_share", "1", "SpAnGy captured share", has_norm=False),
    # of the shape index, to compare with the FetalFoldSim paper
    *(
        Metric(
            f"{_SHAPE}B{band}_power",
            "mm2",
            f"shape index B{band} power",
            has_norm=False,
        )
        for band in range(7)
    ),
    *(
        Metric(
            f"{_SHAPE}B{band}_relative_power",
            "1",
            f"shape index B{band} relative power",
            has_norm=False,
        )
        for band in range(1, 7)
    ),
    Metric(
        f"{_SHAPE}captured_share", "1", "shape index captured share", has_norm=False
    ),
    Metric("spangy_modes", "1", "SpAnGy modes", has_norm=False),
    Metric("weyl_number", "1", "Weyl number", has_norm=False),
)
_DEVIATIONS = tuple(
    Metric(
        m.mean_name.removeprefix("mean_"),
        m.unit,
        m.label,
        is_signed=True,
    )
    for m in _DEVIATION_MAPS
)
_PIAL = (*_SIZES, *_FOLDING, *_THICKNESS, *_SPECTRUM, *_DEVIATIONS)
_WHITE = tuple(
    replace(
        m,
        name=f"white_{m.name}",
        label=f"white {m.name.replace('_', ' ')}",
        shown=NOWHERE,
    )
    for m in _PIAL
    if WHITE in m.shown
)
_REGION_MEANS = tuple(
    Metric(
        m.mean_name,
        m.unit,
        m.label,
        m.mean_shown,
        is_signed=m.is_signed,
    )
    for m in _BRAIN_MAPS
    # the mean over a region has the name and the record of that over a hemisphere
    if m.is_averaged and m.mean_name not in {metric.name for metric in _PIAL}
)
METRICS = Registry({m.name: m for m in (*_PIAL, *_WHITE, *_REGION_MEANS)})
"""The metrics, by name."""


def metrics_shown(where: Shown) -> list[str]:
    """Return the names of the metrics that are shown somewhere, in their order."""
    return [metric.name for metric in METRICS.values() if where in metric.shown]
