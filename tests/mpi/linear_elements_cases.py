"""The C code of linear elements against the forms that UFL derives from the energy."""

from dataclasses import dataclass
from typing import ClassVar

import boxes
import dolfinx
import numpy as np
import pytest
import ufl
from boxes import COMM, distorted_box, problem_on, smooth_displacement, zones_of
from dolfinx.la import BlockMode

from gyriflow.mechanics.materials import MATERIALS, Material


@dataclass(frozen=True)
class Mixed(Material):
    """A law whose second derivatives are all other than zero."""

    name: ClassVar[str] = "mixed"

    @staticmethod
    def _energy_of_invariants(I1, J, mu, K):
        return mu / 7 * I1**2 / J + K * (J - 1) ** 4 - mu * ufl.ln(J) * I1


@pytest.mark.parametrize("law", [*MATERIALS.values(), Mixed])
def test_energy_forces_and_stiffness_are_those_of_the_form_compiler(law, monkeypatch):
    monkeypatch.setattr(boxes, "MATERIAL", law(0.45))
    mesh = distorted_box()
    layers = {
        "mu": lambda x: 300 + 2e5 * (x[:, 2] + 3e-3),
        "dg": lambda x: 0.004 + 0.4 * x[:, 2],
        "dr": 0.002,
    }
    problem = problem_on(mesh, zones_of(mesh), **layers)
    domain = problem.domain
    u = smooth_displacement(domain)
    at = problem.residual(u)

    Fe = (ufl.Identity(3) + ufl.grad(problem._u)) * problem._H
    ratio = 2 * 1.45 / (3 * 0.1)
    dx = ufl.dx(metadata={"quadrature_degree": 1})
    energy = law.energy_density(Fe, problem._weight, ratio * problem._weight) * dx
    residual = ufl.derivative(energy, problem._u)
    tangent = ufl.derivative(residual, problem._u)
    energy, residual, tangent = map(dolfinx.fem.form, (energy, residual, tangent))

    expected = COMM.allreduce(dolfinx.fem.assemble_scalar(energy))
    assert problem.energy(u) == pytest.approx(expected, rel=1e-12)

    forces = dolfinx.fem.assemble_vector(residual)
    forces.scatter_reverse(dolfinx.la.InsertMode.add)
    largest = COMM.allreduce(np.abs(forces.array).max(), op=boxes.MPI.MAX)
    owned = forces.array[: 3 * domain.n_owned]
    np.testing.assert_allclose(at.owned, owned, rtol=0, atol=1e-12 * largest)

    matrix = dolfinx.fem.assemble_matrix(tangent, block_mode=BlockMode.compact)
    matrix.scatter_reverse()
    elastic = problem.tangent(at).elastic.matrix
    found, stored = elastic.values, elastic._stored
    expected = matrix.data[: found.size].reshape(found.shape)[stored]
    assert found[stored] == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
