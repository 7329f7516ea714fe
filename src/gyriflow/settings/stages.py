"""Settings of the stages surface, mesh and metrics."""

from typing import Annotated, Literal

from pydantic import Field

from .base import FirstIf, InputFile, Settings
from .brains import GivenRegions
from .terms import (
    CURVATURE_RADIUS_MM,
    SPANGY_MODES,
    LastBand,
    MassMatrix,
    Mesher,
)


class SurfaceSettings(Settings):
    """Extraction and repair of pial surfaces from label volumes and surface files."""

    edge_length_mm: float = Field(1.0, gt=0.1, le=5)
    """Edge length of the remeshed surface, on which metrics are measured. [mm]"""
    asymmetric: bool = False
    """Whether hemispheres may differ in size and shape, as with unilateral pathology.
    Otherwise such a pair is refused as belonging to two brains."""
    open_sulci: bool = True
    """Whether fused sulci of all brains are opened by slits, if the labels have cortex
    and white matter."""


class MeshSettings(Settings):
    """Tetrahedral mesh of the start brain."""

    mesher: Mesher = "pytetwild"
    """`pytetwild` (fTetWild) makes the best elements and remeshes the surface within
    0.1 mm. `tetgen` takes seconds; it makes a finer surface with few elements below
    it."""
    order: Literal[1, 2] = 2
    """Order of the elements: linear, or quadratic with curved sides. Both have about as
    many nodes; quadratic elements are an eighth as many."""
    surface_edge_mm: float = Field(0.72, gt=0.1, le=10)
    """Distance between neighbouring nodes in the cortex of the start brain: a little
    less than half the cortex' thickness. It grows with the tissue. It is the edge
    length of linear elements and half that of quadratic ones. [mm]"""
    core_edge_mm: float = Field(2.5, gt=0.1, le=20)
    """Distance between neighbouring nodes deep inside. [mm]"""
    max_surface_distance_mm: float = Field(0.1, gt=0, le=5)
    """Largest 99th percentile of the distance between mesh and pial surface, in both
    directions. [mm]"""


Modes = Annotated[LastBand | Annotated[int, Field(ge=2, le=20000)], FirstIf(str)]


class MetricsSettings(Settings):
    """Measurement of curvature and of spectra of gyrification (SpAnGy), the same for
    observed and simulated brains."""

    curvature_radius_mm: float = Field(CURVATURE_RADIUS_MM, ge=0.5, le=20)
    """Radius of the neighbourhood for fitting curvature: at least two edge lengths of
    the surfaces. [mm]"""
    spangy_modes: Modes = SPANGY_MODES
    """Number of eigenmodes, 2 to 20000; or the last complete band, `B4`, `B5` or `B6`.
    Each needs four times as many modes as the one before."""
    spangy_mass: MassMatrix = "mean"
    """Mass matrix of the eigenmodes: the `mean` of the consistent and the lumped one,
    with exact eigenvalues on few vertices; or `consistent`, as in LaPy and in the
    FetalFoldSim paper, on the surface as it is."""
    norm_reference: tuple[str, ...] | None = None
    """Ids of the measured brains that others are compared with, or names of atlases.
    `null`: all observed brains (of the start brain's population, if there are several).
    Brains with other hemispheres than the first start brain are left out. Averages,
    such as those of an atlas, give no centiles."""
    norms: InputFile | None = None
    """Norms of another study's cohort, its `results/study/norms.json`, instead of those
    of the observed brains. They must be made with the same settings."""
    regions: dict[str, GivenRegions] = Field({})
    """Regions of the cortex by the id of the brain on which they are given. They are
    carried to other observed brains by registration, to simulated ones by the
    tissue."""
    white_surfaces: Literal["given", "all"] = "given"
    """White surfaces that are measured: the given ones, or `all`, with the inner
    borders of cortex labels too."""
    template: str | None = None
    """Id of a measured brain. The target `export` then also resamples all maps to its
    vertices, by registration."""
