"""Settings of the metrics."""

from typing import Literal

from .base import Settings, setting


class MetricsSettings(Settings):
    """How curvature and the spectral analysis of gyrification (SpAnGy) are measured, on real and simulated brains."""

    curvature_radius: int = setting(
        3, "edges", "Radius of the neighbourhood in which curvature is fitted.", ge=2, le=20
    )
    spangy_proxy: Literal["shape_index", "mean_curvature"] = setting(
        "shape_index", "", "The map whose spectrum is analysed."
    )
    spangy_modes: int | None = setting(
        None, "",
        "Number of eigenmodes; `null`: Weyl's estimate of what the shortest wavelength needs, a tenth of the vertices "
        "at most.",
        ge=2, le=20000,
    )  # fmt: skip
    spangy_wavelength: Literal["paper", "textbook"] = setting(
        "paper", "", "Relation of the shortest wavelength to λ: `paper` 2π/WL², `textbook` (2π/WL)²."
    )
