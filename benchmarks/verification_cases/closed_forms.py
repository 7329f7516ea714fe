"""Closed forms that the theory in `modes` must reach in its limits.

Allen, H. G. (1969). Analysis and Design of Structural Sandwich Panels. Pergamon.

Biot, M. A. (1961). Theory of folding of stratified viscoelastic media and its
implications in tectonics and orogenesis. Geol. Soc. Am. Bull. 72, 1595-1620.

Biot, M. A. (1963). Surface instability of rubber in compression. Appl. Sci. Res. A 12,
168-182.

Chen, X., Hutchinson, J. W. (2004). Herringbone buckling patterns of compressed thin
films on compliant substrates. J. Appl. Mech. 71, 597-603.
"""

from dataclasses import dataclass

import numpy as np

from .modes import Slab

BIOT_STRETCH = 0.6661
"""Stretch at which an incompressible half space wrinkles at any length, equally
compressed along x and y (Biot 1963).

The root of ρ³ + ρ² + 3ρ = 1 is ρ = 0.2956, where ρ is the stretch along the surface
over that across it: λ³ here.
"""


def short_wave_rate(poisson_ratio: float) -> float:
    """Return the rate per growth of waves on an infinite cortex without stress memory:
    3 + 2ν at any wavelength.

    Relative to the surface, the flat state rises by 2ν/(1 − ν) per length (growth is
    held at the sides), rotating normals add 2, and the stress E/(1 − ν) acting on the
    slopes of the wave adds (1 − 2ν)(1 + ν)/(1 − ν).
    """
    return 3 + 2 * poisson_ratio


@dataclass(frozen=True)
class ThinFilm:
    """A thin stiff film on a half space: dominant wavelength and its rate without
    memory, critical growth with it."""

    wavelength: float
    growth_rate: float
    critical_growth: float


def thin_film(slab: Slab) -> ThinFilm:
    """Return the results of thin-plate theory for a slab's cortex.

    A plate of bending stiffness E'·I, E' = E/(1 − ν²), on a half space that resists a
    wave with Es'·k/2 (one side only: Biot's folds of an embedded layer have twice
    that), equally compressed in both directions by E/(1 − ν) times its growth: rate(k)
    = (1 + ν) A k²/(I k⁴ + k/2c) for the contrast c. Its maximum gives L = 2π
    (4cI)^(1/3), with I = 1/12 the usual 2π (E'/3Es')^(1/3). For ln h = rate·growth
    compare Biot (1961), for the critical growth 1/rate Allen (1969) and Chen and
    Hutchinson (2004). I, and the area A of the force, are those of the cortical weight.
    """
    s = slab.steepness
    # ∫w², ∫w·d and ∫w·d² of w = 1/(1 + exp(s (d − 1))) over the depth d
    area = 1 - 1 / s
    first = (1 + np.pi**2 / (3 * s**2)) / 2
    second = (1 + np.pi**2 / s**2) / 3
    inertia = second - first**2
    k = (4 * slab.contrast * inertia) ** (-1 / 3)
    rate = (1 + slab.poisson_ratio) * area / (3 * inertia * k**2)
    return ThinFilm(2 * np.pi / k, rate, 1 / rate)
