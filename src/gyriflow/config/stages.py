"""Settings of the stages around the folding: surface, mesh, metrics, report."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from ..parameters.settings import Settings, setting
from ..parameters.terms import (
    CURVATURE_RADIUS_MM,
    MOST_HOLE_MM,
    SPANGY_MODES,
    SPANGY_PROXY,
    ExportNames,
    LastBand,
    Mesher,
    SpangyProxy,
)
from .brains import GivenRegions


class SurfaceSettings(Settings):
    """How label volumes and surface files become clean pial surfaces."""

    smoothing_voxels: float = setting(
        1.0, "voxels", "Standard deviation of the Gaussian that smooths labels before the surface is extracted.",
        ge=0, le=5,
    )  # fmt: skip
    edge_length_mm: float = setting(
        1.0, "mm", "Edge length of the remeshed surface, on which metrics are measured.", gt=0.1, le=5
    )
    smoothing_iterations: int = setting(10, "", "Iterations of Taubin smoothing.", ge=0, le=200)
    max_hole_mm: float = setting(
        3.0, "mm", "Largest hole that is closed; a larger one is an error.", ge=0, le=MOST_HOLE_MM
    )
    fissure_mm: float = setting(
        1.5, "mm", "Width to which the fissure is opened where labels show none; 0: not at all.", ge=0, le=5
    )
    max_hemisphere_ratio: float = setting(
        1.15, "", "Largest accepted ratio of the volumes of two hemisphere surfaces.", ge=1, le=20
    )
    max_asymmetry: float = setting(
        0.02, "", "Largest accepted mean distance of two hemisphere surfaces from their mirror image, over the brain's "
        "length.", gt=0, le=0.5,
    )  # fmt: skip
    gap_mm: float = setting(0.5, "mm", "Gap kept between two hemisphere surfaces that would touch.", ge=0, le=5)


class MeshSettings(Settings):
    """How the start brain's pial surface is filled with tetrahedra."""

    mesher: Mesher = setting(
        "pytetwild", "",
        "`pytetwild` (fTetWild) makes the best elements, with a surface of its own within `envelope_mm`; `tetgen` "
        "takes seconds and makes a finer surface, with few elements below it.",
    )  # fmt: skip
    order: Literal[1, 2] = setting(
        2, "",
        "Order of the elements: linear, or quadratic with curved sides. Both have about as many nodes; quadratic "
        "elements are an eighth as many.",
    )  # fmt: skip
    surface_edge_mm: float = setting(
        0.72, "mm",
        "Distance between neighbouring nodes in the cortex of the start brain: a little less than half its thickness. "
        "It grows with the tissue. This is the edge length of linear elements and half that of quadratic ones.",
        gt=0.1, le=10,
    )  # fmt: skip
    pial_faces: int | None = setting(
        None, "", "About how many triangles between nodes the surface has, instead of `surface_edge_mm`.",
        ge=100, le=2_000_000,
    )  # fmt: skip
    core_edge_mm: float = setting(2.5, "mm", "Distance between neighbouring nodes deep inside.", gt=0.1, le=20)
    fine_depth_edges: float = setting(
        2.5, "surface edges", "Depth down to which nodes are as close as at the surface (`pytetwild`).", ge=0, le=20
    )
    edge_growth: float = setting(
        0.5, "mm/mm", "Increase of node distance with depth below that (`pytetwild`).", gt=0, le=2
    )
    envelope_mm: float = setting(
        0.1, "mm", "Largest distance of the mesh's surface from the pial surface (`pytetwild`).", gt=0.001, le=2
    )
    time_limit_s: float = setting(1800.0, "s", "Time after which the mesher is stopped.", gt=0)
    min_radius_ratio: float = setting(
        0.02, "", "Least accepted quality of an element: 3 × inradius / circumradius, 1 if regular.", ge=0, lt=1
    )
    min_dihedral_deg: float = setting(1.0, "deg", "Least accepted dihedral angle of an element.", ge=0, lt=70)
    max_dihedral_deg: float = setting(178.0, "deg", "Largest accepted dihedral angle of an element.", gt=71, le=180)
    min_volume_mm3: float = setting(1e-6, "mm³", "Least accepted volume of an element.", ge=0, lt=1)
    min_jacobian_ratio: float = setting(
        0.1, "", "Least accepted Jacobian determinant of a quadratic element over its mean: 1 straight, 0 folded over.",
        ge=0, lt=1,
    )  # fmt: skip
    max_volume_change: float = setting(
        0.01, "", "Largest accepted relative difference of the mesh's volume from the pial surface's.", gt=0, lt=1
    )
    max_surface_distance_mm: float = setting(
        0.1, "mm", "Distance from mesh to pial surface, and back, within which 99 % of either must lie.", gt=0, le=5
    )
    min_gap_kept: float = setting(
        0.95, "", "Least accepted part of the fissure and other gaps under 3 mm, by the area of their walls, that "
        "stays open to at least half its width.", ge=0, le=1,
    )  # fmt: skip


Modes = Annotated[
    Annotated[int, Field(ge=2, le=20000), Tag("(number)")] | Annotated[LastBand, Tag("(word)")],
    Discriminator(lambda value: "(word)" if isinstance(value, str) and not value.isdigit() else "(number)"),
]


class MetricsSettings(Settings):
    """How curvature and the spectra of gyrification (SpAnGy) are measured, on real and simulated brains alike."""

    curvature_radius_mm: float = setting(
        CURVATURE_RADIUS_MM, "mm",
        "Radius of the neighbourhood in which curvature is fitted: at least two edges of the surfaces.", ge=0.5, le=20,
    )  # fmt: skip
    spangy_proxy: SpangyProxy = setting(SPANGY_PROXY, "", "The map whose spectrum is analysed.")
    spangy_modes: Modes = setting(
        SPANGY_MODES, "",
        "Number of eigenmodes, 2 to 20000; or the last complete band, `B4`, `B5` or `B6`, each with four times as many "
        "modes as the one before.",
    )  # fmt: skip
    mirrored_patches: bool = setting(
        False, "", "Intervals draw patches of the surface together with their mirror images even in brains that differ "
        "from their mirror image; where both are within half a voxel they always do.",
    )  # fmt: skip
    norm_reference: tuple[str, ...] | None = setting(
        None, "",
        "Ids of the measured brains that others are compared with in tables of centiles. `null`: all "
        "real ones (of several populations, the start brain's), or all phantoms if none is real. Brains with other "
        "hemispheres than the first start brain are left out.",
    )  # fmt: skip
    regions: dict[str, GivenRegions] = setting(
        {}, "",
        "Regions of the cortex, by the id of the brain on which they are given. Registration carries them to other "
        "brains, and the tissue to simulated ones.",
    )  # fmt: skip
    white_surfaces: Literal["given", "all"] = setting(
        "given",
        "",
        "White surfaces that are measured: those given, or `all`, also the inner border of cortex in labels.",
    )
    template: str | None = setting(
        None, "", "Id of a measured brain. The target `export` then has all maps at its vertices, too, by registration."
    )
    named_sulci: bool = setting(
        False, "", "Without `regions`: whether named sulci are the regions, as drawn on a brain of the spina bifida "
        "atlas and carried to others by registration. The weeks in which sulci begin have their names always.",
    )  # fmt: skip
    export: ExportNames = setting("plain", "", "How the target `export` names files; `bids` as in derivatives.")


class EnergySettings(Settings):
    """The estimated energy is t × (cores × core_power_w + GB × memory_w_per_gb) × pue.

    The formula and the defaults are those of Green Algorithms (Lannelongue, Grealey & Inouye 2021,
    doi:10.1002/advs.202100707) for an unknown processor, a private machine, and no particular country.
    """

    core_power_w: float = setting(12.0, "W", "Power of a busy core: the processor's over its cores.", gt=0, le=1000)
    memory_w_per_gb: float = setting(0.3725, "W/GB", "Power of the memory in use.", ge=0, le=100)
    pue: float = setting(
        1.0, "", "Power usage effectiveness: 1 for your own machine, 1.67 for an average data centre.", ge=1, le=10
    )
    carbon_intensity_g_per_kwh: float = setting(
        475.0, "g/kWh", "CO₂ emitted for electricity; 475 is the world's average of 2019 (IEA).", ge=0, le=5000
    )


class ReportSettings(Settings):
    """Figures, and assumptions of the estimated energy."""

    figures: Literal["essential", "all"] = setting(
        "essential", "", "Whether figures of the mesh, the zones and the solver, and all maps are drawn, too."
    )
    dpi: int = setting(300, "dots per inch", "Resolution of PNG figures; journals ask for 300 to 600.", ge=50, le=1200)
    paths: bool = setting(
        False, "", "Whether the report shows paths of files, which may hold names. It never shows headers of images."
    )
    energy: EnergySettings = setting(EnergySettings(), "", "Energy and emissions in the table of resources.")
