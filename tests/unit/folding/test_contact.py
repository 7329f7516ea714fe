"""How the stiffness of contact follows the smallest gap from step to step."""

import numpy as np
import pytest
from mpi4py import MPI
from shapes import ellipsoid_mesh

from gyriflow.folding.contact import STIFFEST, SelfContact
from gyriflow.folding.domain import Domain
from gyriflow.geometry.tetrahedra import boundary_faces

START_PA = 1000.0


@pytest.fixture(scope="module")
def contact():
    mesh = ellipsoid_mesh(2, (4.0, 4.0, 4.0))
    domain = Domain(MPI.COMM_SELF, mesh)
    return SelfContact(domain, np.zeros((len(mesh.vertices), 3)), boundary_faces(mesh)[0], START_PA, 0.2)


def after(part, stiffness_pa):
    """Return the table's row of a step whose smallest gap was a part of the distance."""
    return {"min_distance_mm": part * 0.2, "contact_distance_mm": 0.2, "contact_stiffness_pa": stiffness_pa}


@pytest.mark.parametrize(
    ("part", "before", "then"),
    [
        (0.09, 4.0, 8.0),
        (0.11, 4.0, 4.0),
        (0.74, 4.0, 4.0),
        (0.76, 4.0, 2.0),
        # nothing is near
        (np.nan, 4.0, 2.0),
        # no stiffer than the limit, and no softer than at the start
        (0.09, STIFFEST, STIFFEST),
        (0.09, 0.75 * STIFFEST, STIFFEST),
        (0.76, 1.0, 1.0),
        (np.nan, 1.5, 1.0),
    ],
)
def test_the_barrier_becomes_stiffer_where_folds_come_close_and_softer_where_they_part(contact, part, before, then):
    # only the last step counts
    contact.adapt([after(0.01, START_PA), after(part, before * START_PA)])
    assert contact.stiffness_pa == then * START_PA
