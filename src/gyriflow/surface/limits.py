"""How unequal and how asymmetric the hemispheres of one brain may be."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Bounds beyond which hemispheres are refused.

    Attributes
    ----------
    max_hemisphere_ratio
        Volume of the larger hemisphere over that of the smaller one. Those of one fetus differ by a few percent,
        those of successive weeks by 15 %; unilateral pathology goes further.
    max_asymmetry
        Mean distance of the surface from its mirror image, relative to the brain's length.
    """

    max_hemisphere_ratio: float = 1.15
    max_asymmetry: float = 0.02


USUAL = Limits()
"""The limits of normal brains."""
