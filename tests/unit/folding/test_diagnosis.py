"""What the step table and the log say of the resolution of a mesh whose resolution is known."""

import numpy as np
import pytest
from mpi4py import MPI
from shapes import box_mesh

from gyriflow.folding.checks import stiffness_warning
from gyriflow.folding.diagnosis import elements_through, resolution_warning, unconverged_warning
from gyriflow.folding.domain import Domain
from gyriflow.folding.predicted_memory import predicted_memory_mib
from gyriflow.geometry.tetrahedra import TetrahedralMesh


def test_elements_through_a_layer_are_its_thickness_over_the_edges_in_it():
    mesh = box_mesh((4, 4, 8), (4.0, 4.0, 8.0))
    # coarser below the layer, which is not to count
    z = mesh.vertices[:, 2] - 4.0
    stretched = np.where(z < -3, -3 + 4 * (z + 3), z)
    domain = Domain(MPI.COMM_SELF, TetrahedralMesh(np.column_stack([mesh.vertices[:, :2], stretched]), mesh.tets))
    depth = -domain.local(domain.positions)[:, 2]
    # a cube in six tetrahedra, each with three edges, two diagonals and the long one
    edge = (3 + 2 * np.sqrt(2) + np.sqrt(3)) / 6
    assert elements_through(domain, depth, 3e-3) == pytest.approx(3 / edge)
    domain.place(2 * domain.positions)
    assert elements_through(domain, 2 * depth, 3e-3) == pytest.approx(1.5 / edge)
    assert np.isnan(elements_through(domain, depth + 1.0, 3e-3))


def rows(*through):
    return [{"week": 21.0 + i, "elements_through_cortex": value} for i, value in enumerate(through)]


@pytest.mark.fault(25)
def test_a_cortex_that_outgrows_its_elements_is_told_once():
    assert resolution_warning(rows(2.3, 2.1), 1) == ""
    assert "GW 23.00" in resolution_warning(rows(2.3, 2.1, 1.9), 1)
    assert resolution_warning(rows(2.3, 1.9, 1.8), 1) == ""
    assert resolution_warning(rows(1.5), 1).startswith("from the start on fewer than 2")
    assert resolution_warning(rows(1.5), 2) == ""
    assert resolution_warning(rows(0.81), 2) == ""  # the default mesh at its start
    assert "fewer than 0.8" in resolution_warning(rows(1.2, 0.79), 2)
    assert "fewer than 2" in resolution_warning(rows(np.nan), 1)  # no element lies in the cortex at all


def test_nearly_incompressible_tissue_is_told():
    assert stiffness_warning(0.45) == stiffness_warning(0.46) == ""
    assert "0.48" in stiffness_warning(0.48)


def test_a_step_above_its_tolerance_is_told():
    row = {"step": 7, "residual": 3e-6, "converged": True}
    assert unconverged_warning(row) == ""
    assert "step 7" in unconverged_warning(row | {"converged": False})


@pytest.mark.fault(38)
@pytest.mark.parametrize(
    ("order", "tets", "ranks", "contact", "measured"),
    [
        *((1, 182_779, 1, "planes", 564), (1, 182_779, 1, "global", 649), (1, 448_597, 1, "planes", 877)),
        *((1, 448_597, 1, "global", 1001), (1, 499_373, 1, "global", 914), (1, 499_373, 2, "global", 1580)),
        *((2, 23_910, 1, "global", 600), (2, 23_910, 2, "global", 955), (2, 23_910, 2, "none", 838)),
        *((2, 34_684, 1, "global", 784), (2, 34_684, 2, "global", 1141)),
    ],
)
def test_predicted_memory_is_what_runs_have_taken(order, tets, ranks, contact, measured):
    assert predicted_memory_mib(tets, ranks, contact, order) == pytest.approx(measured, rel=0.155)
