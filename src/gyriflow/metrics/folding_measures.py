"""Measures of folding as integrals of curvature over the surface, and how the area is spread over curvature."""

import numpy as np

from ..geometry.triangles import Floats
from .curvature import Curvature

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Shares of the area at which its distribution over mean curvature is given."""


def intrinsic_curvature_index(bend: Curvature, areas: Floats) -> float:
    """Returns ICI = 1/4π ∫ max(K, 0) dA with (n,) areas of the vertices in mm²; 1 for all convex surfaces.

    Van Essen and Drury 1997, J. Neurosci. 17, 7079-7102.
    """
    return float(np.maximum(bend.gaussian, 0.0) @ areas) / (4.0 * np.pi)


def folding_index(bend: Curvature, areas: Floats) -> float:
    """Returns FI = 1/4π ∫ |k₁|(|k₁| − |k₂|) dA, |k₁| the larger one; 0 for a sphere.

    Van Essen and Drury 1997, J. Neurosci. 17, 7079-7102.
    """
    sizes = np.abs([bend.maximum, bend.minimum])
    larger, smaller = sizes.max(axis=0), sizes.min(axis=0)
    return float((larger * (larger - smaller)) @ areas) / (4.0 * np.pi)


def mean_curvature_norm(bend: Curvature, areas: Floats) -> float:
    """Returns the L² norm MLN = 1/4π ∫ H² dA; 1 for a sphere of any size.

    Batchelor et al. 2002, IEEE Trans. Med. Imaging 21, 953-965; a quarter of the Willmore energy over π.
    """
    return float(bend.mean**2 @ areas) / (4.0 * np.pi)


def gaussian_curvature_norm(bend: Curvature, areas: Floats) -> float:
    """Returns the L² norm GLN = 1/4π √(A ∫ K² dA) with A the area; 1 for a sphere of any size.

    Batchelor et al. 2002, IEEE Trans. Med. Imaging 21, 953-965.
    """
    return float(np.sqrt(areas.sum() * (bend.gaussian**2 @ areas))) / (4.0 * np.pi)


def mean_curvature_quantiles(bend: Curvature, areas: Floats) -> dict[str, float]:
    """Returns the mean curvatures in 1/mm below which 5, 25, 50, 75 and 95 % of the area are, by name."""
    values = np.quantile(bend.mean, QUANTILES, weights=areas, method="inverted_cdf")
    return {
        f"mean_curvature_q{round(100 * share):02d}": float(value)
        for share, value in zip(QUANTILES, values, strict=True)
    }


def join(bends: list[Curvature]) -> Curvature:
    """Returns the curvature of surfaces side by side."""
    return Curvature(
        *(np.concatenate([getattr(bend, name) for bend in bends]) for name in Curvature.__dataclass_fields__)
    )
