"""Quantities that are measured on brains: a record for each map over a surface and each number in metrics tables.

Whatever measures, draws, tabulates or exports a quantity looks it up here by name; a name without a record is an error.
Units are written as in the tables: "1/mm2" for mm⁻², "1" for none.
"""

import re
from dataclasses import dataclass


class Registry[Record](dict[str, Record]):
    """Records by name; KeyError that names this file for a name without a record."""

    def __missing__(self, name: str) -> Record:
        raise KeyError(f"{name!r} has no record in gyriflow/quantities.py")


@dataclass(frozen=True)
class VertexMap:
    """A value at each vertex of a surface.

    `name` is that of the array in its file; `bids_suffix` and `description` are used in the export, whose values are
    those of our file times `export_sign`, so that names of other tools have their signs. `is_averaged`: its mean is
    given by region. A map with `colours`, a colour map of Matplotlib, is drawn, between `limits` or else from 0 to the
    `quantile` of the vertices, and as far below 0 if it `is_signed` or has negative values. The colour bar has
    the `label` with the unit, or with what the `ends` of the scale mean.
    """

    name: str
    unit: str
    label: str
    bids_suffix: str
    description: str
    export_sign: int = 1
    is_averaged: bool = True
    colours: str = ""
    limits: tuple[float, float] | None = None
    quantile: float = 0.995
    is_signed: bool = False
    ends: str = ""

    @property
    def mean_name(self) -> str:
        """The metric that is the mean of the map over a region."""
        return f"mean_{self.name.removesuffix('_mm').removeprefix('mean_')}"


@dataclass(frozen=True)
class Metric:
    """A number of a whole brain, a hemisphere or a region.

    `label` is its name in figures and reports. `has_norm` is False if it describes the mesh or the analysis rather than
    the brain: it is not compared with that of other brains. `is_reported` is False if it is only given in the tables.
    """

    name: str
    unit: str
    label: str
    has_norm: bool = True
    is_reported: bool = True

    @property
    def is_signed(self) -> bool:
        """Whether the metric may be negative."""
        return SIGNED_NAMES.fullmatch(self.name) is not None


SIGNED_NAMES = re.compile(r"(white_)?mean_shape_index|mean_curvature(_q\d\d)?|distance|log_area|thickness_difference")
POSITIVE_COLOURS, SIGNED_COLOURS = "YlGnBu", "RdBu_r"

_BRAIN_MAPS = (
    VertexMap(
        name="shape_index",
        unit="1",
        label="shape index",
        bids_suffix="shapeIndex",
        description="Shape index, -1 in pits, -0.5 in sulci, 0.5 on gyri, 1 on caps",
        colours=SIGNED_COLOURS,
        limits=(-1.0, 1.0),
        ends="sulci −½, gyri +½",
    ),
    VertexMap(
        name="curvedness",
        unit="1/mm",
        label="curvedness",
        bids_suffix="curvedness",
        description="Curvedness, the root mean square of the principal curvatures",
        colours=POSITIVE_COLOURS,
        quantile=0.98,
    ),
    VertexMap(
        name="mean_curvature",
        unit="1/mm",
        label="mean curvature",
        bids_suffix="curv",
        description="Mean curvature, positive on gyri as in HCP's files; FreeSurfer's have the opposite sign",
    ),
    VertexMap(
        name="gaussian_curvature",
        unit="1/mm2",
        label="Gaussian curvature",
        bids_suffix="gaussCurv",
        description="Gaussian curvature, positive on caps and in pits, negative on saddles",
        is_averaged=False,
    ),
    VertexMap(
        name="sulcal_depth_mm",
        unit="mm",
        label="sulcal depth",
        bids_suffix="sulc",
        description="Minus the distance to the convex hull of the hemisphere: 0 on gyri and negative in sulci, "
        "so larger on gyri as in HCP's files; FreeSurfer's have the opposite sign",
        export_sign=-1,
        colours=POSITIVE_COLOURS,
    ),
    VertexMap(
        name="local_gyrification_index",
        unit="1",
        label="local gyrification index",
        bids_suffix="localGyrificationIndex",
        description="Local gyrification index",
    ),
    VertexMap(
        name="reliable",
        unit="1",
        label="reliable",
        bids_suffix="reliable",
        description="1 where the maps can be relied on, 0 near a cut",
        is_averaged=False,
    ),
    VertexMap(
        name="thickness_mm",
        unit="mm",
        label="cortical thickness",
        bids_suffix="thickness",
        description="Cortical thickness",
        colours=POSITIVE_COLOURS,
    ),
    VertexMap(
        name="spangy_dominant_band",
        unit="1",
        label="dominant SpAnGy band",
        bids_suffix="spangyDominantBand",
        description="Spangy dominant band by mean curvature",
        is_averaged=False,
    ),
    VertexMap(
        name="spangy_shape_index_dominant_band",
        unit="1",
        label="dominant SpAnGy band, shape index",
        bids_suffix="spangyShapeIndexDominantBand",
        description="Spangy dominant band by shape index",
        is_averaged=False,
    ),
    VertexMap(
        name="template_distance_mm",
        unit="mm",
        label="distance from the template",
        bids_suffix="templateDistance",
        description="Template distance",
        is_averaged=False,
    ),
)
_DEVIATION_MAPS = (
    VertexMap(
        name="distance_mm",
        unit="mm",
        label="distance, outwards",
        bids_suffix="distance",
        description="Distance of the real surface from the expected one, positive outwards",
        colours=SIGNED_COLOURS,
        is_signed=True,
    ),
    VertexMap(
        name="log_area",
        unit="1",
        label="logarithm of the area's ratio",
        bids_suffix="logArea",
        description="Logarithm of the real over the expected area, positive where the real one is larger",
        colours=SIGNED_COLOURS,
        is_signed=True,
    ),
    VertexMap(
        name="thickness_difference_mm",
        unit="mm",
        label="difference of thickness",
        bids_suffix="thicknessDifference",
        description="Real less expected cortical thickness, positive where the real one is thicker",
        colours=SIGNED_COLOURS,
        is_signed=True,
    ),
)
_SIMULATION_MAPS = (
    VertexMap(
        name="displacement_mm",
        unit="mm",
        label="displacement since the start",
        bids_suffix="displacement",
        description="Displacement since the start of the simulation",
        is_averaged=False,
        colours=POSITIVE_COLOURS,
    ),
    VertexMap(
        name="area_growth_percent_per_gw",
        unit="% per week",
        label="growth of area",
        bids_suffix="areaGrowth",
        description="Growth of area, positive where it grows",
        is_averaged=False,
        colours=POSITIVE_COLOURS,
    ),
    VertexMap(
        name="thickness_growth_percent_per_gw",
        unit="% per week",
        label="growth across the surface",
        bids_suffix="thicknessGrowth",
        description="Growth along the normal of the surface, positive where it grows",
        is_averaged=False,
    ),
    VertexMap(
        name="position_sd_mm",
        unit="mm",
        label="SD of position",
        bids_suffix="positionSd",
        description="Standard deviation of the position over the members of an ensemble",
        is_averaged=False,
        colours=POSITIVE_COLOURS,
    ),
    VertexMap(
        name="sulcus_probability",
        unit="1",
        label="probability of a sulcus",
        bids_suffix="sulcusProbability",
        description="Share of a run and the members of its ensemble in which the vertex is in a sulcus",
        is_averaged=False,
        colours=POSITIVE_COLOURS,
        limits=(0.0, 1.0),
    ),
    VertexMap(
        name="gyrus_probability",
        unit="1",
        label="probability of a gyrus",
        bids_suffix="gyrusProbability",
        description="Share of a run and the members of its ensemble in which the vertex is on a gyrus",
        is_averaged=False,
        colours=POSITIVE_COLOURS,
        limits=(0.0, 1.0),
    ),
)
VERTEX_MAPS = Registry({record.name: record for record in (*_BRAIN_MAPS, *_DEVIATION_MAPS, *_SIMULATION_MAPS)})
"""The maps, by name."""


def name_in_interval(name: str, before: float, week: float) -> str:
    """Return the name of a map between two weeks, in a file with maps of several intervals."""
    return f"{name} {before:g}-{week:g} GW"


COMPARED_MAPS = ("shape_index", "mean_curvature")
"""The maps by which a simulated brain is correlated with a real one."""

_SIZES = (
    Metric("volume", "mL", "volume"),
    Metric("area", "cm2", "pial area"),
    Metric("area_share", "1", "area share"),
    # cm² over mL^(2/3) is a number
    Metric("relative_area", "1", "area / volume^(2/3)"),
    Metric("volume_tissue", "mL", "volume of tissue"),
    Metric("volume_ventricles", "mL", "volume of ventricles"),
    Metric("volume_cortex", "mL", "volume of cortex"),
    Metric("area_ratio", "1", "area ratio", has_norm=False),
    Metric("crossing_faces", "1", "crossing faces", has_norm=False, is_reported=False),
)
_FOLDING = (
    Metric("gyrification_index", "1", "gyrification index, hulls"),
    Metric("gyrification_index_envelope", "1", "gyrification index, envelopes"),
    Metric("mean_shape_index", "1", "mean shape index"),
    Metric("mean_curvedness", "1/mm", "mean curvedness"),
    Metric("sulcal_area_share", "1", "sulcal area share"),
    Metric("curvature_radius", "mm", "curvature radius", has_norm=False, is_reported=False),
    Metric("curvature_wavelength", "mm", "curvature wavelength", has_norm=False),
    Metric("mean_sulcal_depth", "mm", "mean depth below the hull"),
    Metric("sulcal_depth_95", "mm", "depth below the hull, 95 %"),
    Metric("intrinsic_curvature_index", "1", "intrinsic curvature index"),
    Metric("folding_index", "1", "folding index"),
    Metric("mean_curvature_norm", "1", "mean curvature norm"),
    Metric("gaussian_curvature_norm", "1", "Gaussian curvature norm"),
    Metric("mean_curvature_q05", "1/mm", "mean curvature q05", is_reported=False),
    Metric("mean_curvature_q25", "1/mm", "mean curvature q25", is_reported=False),
    Metric("mean_curvature_q50", "1/mm", "mean curvature q50", is_reported=False),
    Metric("mean_curvature_q75", "1/mm", "mean curvature q75", is_reported=False),
    Metric("mean_curvature_q95", "1/mm", "mean curvature q95", is_reported=False),
)
_THICKNESS = (
    Metric("mean_thickness", "mm", "mean cortical thickness"),
    Metric("thickness_sd", "mm", "cortical thickness, SD"),
    Metric("thickness_q05", "mm", "thickness q05", is_reported=False),
    Metric("thickness_q95", "mm", "thickness q95", is_reported=False),
    Metric("thickness_measured_share", "1", "thickness measured share", has_norm=False, is_reported=False),
)
_SHAPE = "spangy_shape_index_"
_SPECTRUM = (
    *(Metric(f"spangy_B{band}_power", "1", f"SpAnGy B{band} power") for band in range(7)),
    *(Metric(f"spangy_B{band}_relative_power", "1", f"SpAnGy B{band} relative power") for band in range(1, 7)),
    Metric("spangy_captured_share", "1", "SpAnGy captured share", has_norm=False),
    # of the shape index, to compare with the FetalFoldSim paper
    *(Metric(f"{_SHAPE}B{band}_power", "mm2", f"shape index B{band} power", has_norm=False) for band in range(7)),
    *(
        Metric(f"{_SHAPE}B{band}_relative_power", "1", f"shape index B{band} relative power", has_norm=False)
        for band in range(1, 7)
    ),
    Metric(f"{_SHAPE}captured_share", "1", "shape index captured share", has_norm=False),
    Metric("spangy_modes", "1", "SpAnGy modes", has_norm=False),
    Metric("weyl_number", "1", "Weyl number", has_norm=False),
)
_DEVIATIONS = tuple(Metric(m.mean_name.removeprefix("mean_"), m.unit, m.label) for m in _DEVIATION_MAPS)
_REGION_MEANS = tuple(Metric(m.mean_name, m.unit, m.label) for m in _BRAIN_MAPS if m.is_averaged)
WHITE_METRICS = (
    "area",
    "gyrification_index",
    "gyrification_index_envelope",
    "mean_shape_index",
    "mean_curvedness",
    "sulcal_area_share",
    "mean_sulcal_depth",
    "sulcal_depth_95",
)
"""The metrics that are also given of white surfaces, with `white_` before their names."""
_PIAL = {m.name: m for m in (*_REGION_MEANS, *_SIZES, *_FOLDING, *_THICKNESS, *_SPECTRUM, *_DEVIATIONS)}
_WHITE = (Metric(f"white_{n}", _PIAL[n].unit, f"white {n.replace('_', ' ')}") for n in WHITE_METRICS)
METRICS = Registry(_PIAL | {m.name: m for m in _WHITE})
"""The metrics, by name."""
