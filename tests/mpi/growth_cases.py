"""Growth with known answers, and what the mesh does between steps."""

import numpy as np
import pytest
from boxes import COMM, curved_box, distorted_box, problem_on, zones_of

from gyriflow.folding.checkpoint import State
from gyriflow.folding.domain import Domain
from gyriflow.folding.simulation import Folding
from gyriflow.geometry.tetrahedra import signed_volumes, volumes_between
from gyriflow.mechanics.materials import MATERIALS
from gyriflow.parameters.folding import parameters_from


@pytest.mark.parametrize("mesh", [distorted_box(), curved_box()], ids=["linear", "quadratic"])
def test_tangential_growth_stretches_across_the_normal_only(mesh):
    oblique = np.array([1.0, 2.0, 2.0]) / 3
    problem = problem_on(mesh, zones_of(mesh), dg=0.2, dr=-0.05, normals=lambda c: np.tile(oblique, (len(c), 1)))
    along = np.outer(oblique, oblique)
    growth = 1.2 * (np.eye(3) - along) + 0.95 * along
    x = problem.domain.local(problem.domain.positions)
    problem.set_displacement(x @ (growth - np.eye(3)).T)
    assert problem.energy() == pytest.approx(0.0, abs=1e-16)
    problem.set_displacement(x * [0.2, 0.0, 0.0])
    assert problem.volume_ratios() == pytest.approx(1.2)
    assert 0 < problem.smallest_volume_ratio() <= 1.2 * (1 + 1e-12)


@pytest.mark.parametrize("material", MATERIALS)
def test_a_run_has_the_material_that_it_names(material):
    # Fe = diag(1.2, 1, 1): tr(FeᵀFe) = 3.44, Je = 1.2
    mesh = distorted_box()
    values = {"start_week": 21.0, "end_week": 22.0, "output_weeks": [21.0, 22.0], "fissure_x_mm": 0.0}
    values |= {"shear_modulus_cortex_pa": 1000, "shear_modulus_core_pa": 1000, "growth_rate_per_s": 0}
    folding = Folding(COMM, mesh, zones_of(mesh), parameters_from(values | {"material": material}))
    folding.begin(State.at_start(folding.domain.positions, 43200.0), 43200.0)
    problem = folding.problem
    problem.set_displacement(problem.domain.local(problem.domain.positions) * [0.2, 0.0, 0.0])
    bulk = 1000.0 * 2 * 1.45 / (3 * 0.1)
    densities = {
        "neo-hookean": 500.0 * (3.44 * 1.2 ** (-2 / 3) - 3) + bulk / 2 * 0.04,
        "compressible-neo-hookean": 500.0 * (0.44 - 2 * np.log(1.2)) + (bulk - 2000 / 3) / 2 * 0.04,
    }
    assert problem.energy() == pytest.approx(densities[material] * 288e-9, rel=1e-12)


def test_gathering_and_placing_keep_every_vertex_in_its_place():
    mesh = distorted_box()
    domain = Domain(COMM, mesh)
    np.testing.assert_allclose(domain.gathered(domain.local(domain.positions)[: domain.owned]), mesh.vertices * 1e-3)
    moved = domain.positions * 1.5 + [0.1, 0.2, 0.3]
    domain.place(moved)
    volumes = volumes_between(domain.local(moved), domain.cells)
    total = COMM.allreduce(float(volumes.sum()))
    assert total == pytest.approx(1.5**3 * signed_volumes(mesh).sum() * 1e-9, rel=1e-12)
    used = domain.mesh.geometry.x[domain.mesh.geometry.dofmap].mean(axis=1)
    np.testing.assert_allclose(used, moved[domain.vertex_of_node[domain.cells]].mean(axis=1), rtol=1e-12)
