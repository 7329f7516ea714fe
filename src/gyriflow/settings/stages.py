"""Settings of the stages around the folding: surface, mesh, metrics."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from .base import Settings
from .brains import GivenRegions
from .terms import CURVATURE_RADIUS_MM, MOST_HOLE_MM, SPANGY_MODES, LastBand, Mesher


class SurfaceSettings(Settings):
    """How label volumes and surface files become clean pial surfaces."""

    edge_length_mm: float = Field(1.0, gt=0.1, le=5)
    """Edge length of the remeshed surface, on which metrics are measured. [mm]"""
    max_hole_mm: float = Field(3.0, ge=0, le=MOST_HOLE_MM)
    """Largest hole that is closed; a larger one is an error. [mm]"""
    asymmetric: bool = False
    """Whether hemisphere surfaces may differ in size and shape, as with unilateral pathology; else those that do
    are refused as of two brains."""
    open_sulci: bool = True
    """Whether sulci that labels keep shut are opened by slits, where labels have cortex and white matter. Studies with
    `runs` keep them shut in all brains: elements are wider than slits."""


class MeshSettings(Settings):
    """How the start brain's pial surface is filled with tetrahedra."""

    mesher: Mesher = "pytetwild"
    """`pytetwild` (fTetWild) makes the best elements, with a surface of its own within `envelope_mm`; `tetgen`
    takes seconds and makes a finer surface, with few elements below it."""
    order: Literal[1, 2] = 2
    """Order of the elements: linear, or quadratic with curved sides. Both have about as many nodes; quadratic
    elements are an eighth as many."""
    surface_edge_mm: float = Field(0.72, gt=0.1, le=10)
    """Distance between neighbouring nodes in the cortex of the start brain: a little less than half its
    thickness. It grows with the tissue. This is the edge length of linear elements and half that of quadratic
    ones. [mm]"""
    core_edge_mm: float = Field(2.5, gt=0.1, le=20)
    """Distance between neighbouring nodes deep inside. [mm]"""
    envelope_mm: float = Field(0.1, gt=0.001, le=2)
    """Largest distance of the mesh's surface from the pial surface (`pytetwild`). [mm]"""
    min_radius_ratio: float = Field(0.02, ge=0, lt=1)
    """Least accepted quality of an element: 3 × inradius / circumradius, 1 if regular."""
    max_surface_distance_mm: float = Field(0.1, gt=0, le=5)
    """Distance from mesh to pial surface, and back, within which 99 % of either must lie. [mm]"""


Modes = Annotated[
    Annotated[int, Field(ge=2, le=20000), Tag("(number)")] | Annotated[LastBand, Tag("(word)")],
    Discriminator(lambda value: "(word)" if isinstance(value, str) and not value.isdigit() else "(number)"),
]


Regions = Annotated[
    Annotated[dict[str, GivenRegions], Tag("(table)")] | Annotated[Literal["named_sulci"], Tag("(word)")],
    Discriminator(lambda value: "(word)" if isinstance(value, str) else "(table)"),
]


class MetricsSettings(Settings):
    """How curvature and the spectra of gyrification (SpAnGy) are measured, on real and simulated brains alike."""

    curvature_radius_mm: float = Field(CURVATURE_RADIUS_MM, ge=0.5, le=20)
    """Radius of the neighbourhood in which curvature is fitted: at least two edges of the surfaces. [mm]"""
    spangy_modes: Modes = SPANGY_MODES
    """Number of eigenmodes, 2 to 20000; or the last complete band, `B4`, `B5` or `B6`, each with four times as
    many modes as the one before."""
    norm_reference: tuple[str, ...] | None = None
    """Ids of the measured brains that others are compared with, or names of atlases. `null`: all real ones (of
    several populations, the start brain's). Brains with other hemispheres than
    the first start brain are left out. Averages such as an atlas' give no centiles."""
    colour_by: str | None = None
    """Covariate whose values have colours in charts of measured brains. `null`: the first that has 2 to 6 values, and
    fewer than there are subjects."""
    regions: Regions = Field({})
    """Regions of the cortex, by the id of the brain on which they are given, or `named_sulci`, drawn on a brain of
    the spina bifida atlas. Registration carries them to other brains, and the tissue to simulated ones."""
    white_surfaces: Literal["given", "all"] = "given"
    """White surfaces that are measured: those given, or `all`, also the inner border of cortex in labels."""
    template: str | None = None
    """Id of a measured brain. The target `export` then has all maps at its vertices, too, by registration."""
