"""Contact of the hemispheres with two fixed planes in the interhemispheric fissure (penalty method)."""

import ufl
from ufl.core.expr import Expr


def contact_energy_density(x: Expr, plane: Expr, side: int, penalty: Expr) -> Expr:
    """Returns ε/2 ⟨penetration⟩² in J/m², whose derivative is the contact pressure ε⟨penetration⟩.

    Penetration is how far a point stands beyond its plane, 0 where it does not, in m.

    Parameters
    ----------
    x, plane
        Current left-right coordinate of the point, and position of the plane, in m.
    side
        -1 for the left hemisphere, which must stay at x ≤ plane; +1 for the right one, at x ≥ plane.
    penalty
        ε in Pa/m.
    """
    return penalty / 2 * ufl.max_value(-side * (x - plane), 0) ** 2
