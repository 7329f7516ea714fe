"""Growth and remembered stress with known answers, a body that nothing holds, and what
the mesh does between steps."""

from dataclasses import replace

import numpy as np
import pytest
from boxes import EvenGrowth, curved_box, distorted_box, problem_on, zones_of
from contact_bodies import at_start
from shapes import box_mesh

from gyriflow.folding.layers import PialSearch, cortical_weight
from gyriflow.folding.stretches import packed, unpacked
from gyriflow.mechanics.materials import MATERIALS
from gyriflow.settings.folding import parameters_from
from gyriflow.units import M_PER_MM, SECONDS_PER_GW

BULK_PA = 1000.0 * 2 * 1.45 / (3 * 0.1)
RUN = {
    "start_week": 21.0,
    "end_week": 36.0,
    "fissure_x_mm": 0.0,
    "output_weeks": [21.0, 36.0],
    "newton_tolerance": 1e-12,
    "contact": "none",
}
ORDERS = ["linear", "quadratic"]
STRETCH = np.array([[1.1, 0.03, 0.0], [0.03, 0.95, -0.02], [0.0, -0.02, 1.02]])


def even(shear_modulus_pa):
    """Return the parameters of cortex and core of one stiffness."""
    return {
        f"shear_modulus_{layer}_pa": shear_modulus_pa for layer in ("cortex", "core")
    }


@pytest.mark.parametrize("material", MATERIALS)
def test_a_run_has_the_material_that_it_names(material):
    # Fe = diag(1.2, 1, 1): tr(FeᵀFe) = 3.44, Je = 1.2
    mesh = distorted_box()
    values = even(1000.0) | {"growth_rate_per_s": 0}
    folding, start = run_on(mesh, zones_of(mesh), material=material, **values)
    folding.begin(start, 43200.0)
    problem = folding.problem
    u = problem.domain.local(problem.domain.positions) * [0.2, 0.0, 0.0]
    lame_pa = BULK_PA - 2000 / 3
    densities = {
        "neo-hookean": 500.0 * (3.44 * 1.2 ** (-2 / 3) - 3) + BULK_PA / 2 * 0.04,
        "compressible-neo-hookean": 500.0 * (0.44 - 2 * np.log(1.2)) + lame_pa * 0.02,
    }
    assert problem.energy(u) == pytest.approx(densities[material] * 288e-9, rel=1e-12)


def run_on(mesh, zones, **changes):
    """Return what folds a mesh with tight tolerances, and its state at the start."""
    return at_start(mesh, zones, parameters_from(RUN | changes))


def test_the_energy_of_a_kept_stretch_is_counted_per_volume_without_stress():
    mesh = distorted_box()
    problem = problem_on(mesh, zones_of(mesh), stretch=STRETCH)
    Je, volume = np.linalg.det(STRETCH), 288e-9
    shape = 500.0 * ((STRETCH**2).sum() * Je ** (-2 / 3) - 3)
    density = shape + BULK_PA / 2 * (Je - 1) ** 2
    found = problem.energy(problem.rest())
    assert found == pytest.approx(density * volume / Je, rel=1e-12)


@pytest.mark.parametrize("memory_gw", [0.25, np.inf])
@pytest.mark.parametrize(
    ("mesh", "points"), [(distorted_box(), 1), (curved_box((2, 2, 2)), 8)], ids=ORDERS
)
def test_growth_that_is_held_back_all_around_loads_up_and_relaxes_as_known(
    mesh, points, memory_gw
):
    # uniform isotropic growth of a body whose whole surface is fixed: nothing moves,
    # and ln V adds up and decays
    zones = zones_of(mesh, lambda centre: np.ones(len(centre), bool))
    folding, state = run_on(mesh, zones, stress_memory_gw=memory_gw, **even(300.0))
    folding.model = EvenGrowth(folding.parameters, None, 0.01).growth
    expected = 0.0
    # steps of unequal length, as where one has failed or a week ends
    for step_s in (43200.0, 21600.0, 10800.0, 43200.0, 30000.0):
        state = folding.step(state, step_s)
        expected *= np.exp(-step_s / SECONDS_PER_GW / memory_gw)
        expected -= np.log(1.01)
    strain = np.log(np.linalg.eigvalsh(unpacked(state.stretch)))
    assert strain.shape == (len(mesh.tets), points, 3)
    np.testing.assert_allclose(strain, expected, rtol=1e-9)
    weeks = [row["week"] for row in state.rows]
    ends_s = np.cumsum([row["dt_s"] for row in state.rows])
    np.testing.assert_allclose(weeks, 21.0 + ends_s / SECONDS_PER_GW)


@pytest.mark.parametrize(
    "mesh", [distorted_box((3, 2, 2), by=0.4), curved_box((3, 2, 2))], ids=ORDERS
)
def test_thickness_and_stiffness_of_a_step_are_those_of_its_middle(mesh, monkeypatch):
    by_week = {
        "thickness_mm": {"weeks": {21.0: 0.2, 22.0: 3.0}},
        "shear_modulus_cortex_pa": {"weeks": {21.0: 300.0, 22.0: 1000.0}},
        "shear_modulus_core_pa": {"weeks": {21.0: 200.0, 22.0: 900.0}},
    }
    zones = zones_of(mesh)
    folding, start = run_on(mesh, zones, **by_week)
    moduli_pa = []
    monkeypatch.setattr(
        folding.problem, "set_step", lambda mu, *others: moduli_pa.append(mu)
    )
    # a step of a day, two days after the start: its middle is 2.5 / 7 of the first week
    day_s = SECONDS_PER_GW / 7
    tissue, _ = folding.begin(replace(start, time_s=2 * day_s), day_s)
    part = 2.5 / 7
    # to the triangles, however far a node is from the nearest vertex
    search = PialSearch(mesh.vertices, zones.cortex_facets)
    depth_mm, _ = search.nearest(mesh.vertices[tissue.elements.vertices])
    if mesh.order == 2:
        points = folding.problem.points
        depth_mm = depth_mm[tissue.elements.cells] @ points.interpolation.T
        depth_mm = np.maximum(depth_mm, 0.0)
    weight = cortical_weight(depth_mm, 0.2 + 2.8 * part)
    np.testing.assert_allclose(tissue.weight, weight)
    assert weight.min() < 0.1 < weight.max()
    cortex_pa, core_pa = 300.0 + 700.0 * part, 200.0 + 700.0 * part
    expected_pa = tissue.at_points(cortex_pa * weight + core_pa * (1 - weight))
    np.testing.assert_allclose(moduli_pa, [expected_pa])


def test_an_elastic_state_stays_where_it_is_in_equilibrium():
    # no growth, one stiffness: what is kept from a stretched start is released in part;
    # then nothing is left to do
    mesh = box_mesh((3, 3, 3), (6.0, 6.0, 6.0))
    zones = zones_of(mesh, lambda centre: centre[:, 2] < -2.99)
    elastic = even(800.0) | {"stress_memory_gw": "infinite", "growth_rate_per_s": 0.0}
    folding, start = run_on(mesh, zones, **elastic)
    start = replace(start, stretch=packed(np.tile(STRETCH, (len(mesh.tets), 1, 1, 1))))
    once = folding.step(start, 43200.0)
    again = folding.step(once, 43200.0)
    moved = np.abs(once.positions - start.positions).max()
    assert moved > 1e-4
    assert np.abs(again.positions - once.positions).max() <= 1e-8 * moved


@pytest.mark.parametrize("mesh", [distorted_box(), curved_box()], ids=ORDERS)
def test_a_free_body_grows_without_drifting(mesh):
    zones = replace(zones_of(mesh), free=True)
    folding, state = run_on(mesh, zones, thickness_mm=2.0, support="free")
    # growth on one side only, which would turn a body that is only extrapolated
    folding.zones = replace(zones, growing=(mesh.vertices[:, 0] > 0).astype(float))
    for _ in range(4):
        before, state = state.positions, folding.step(state, 43200.0)
        u, x = state.last, before - before.mean(axis=0)
        size = np.abs(u).max()
        assert size > 1e-6
        assert np.abs(u.mean(axis=0)).max() <= 1e-12 * size
        turn = np.abs(np.cross(x, u).mean(axis=0)).max()
        assert turn <= 1e-9 * np.abs(x).max() * size


@pytest.mark.parametrize(
    ("mesh", "shares"),
    [
        (distorted_box(), [1 / 4] * 4),
        # the means of the shape functions over an element
        (curved_box(), [-1 / 20] * 4 + [1 / 5] * 6),
    ],
    ids=ORDERS,
)
def test_values_of_tissue_have_their_places(mesh, shares):
    folding, start = run_on(mesh, zones_of(mesh))
    tissue, _ = folding.begin(start, 43200.0)
    at_points = [tissue.at_points(tissue.places_mm[..., axis]) for axis in range(3)]
    means = np.stack(at_points, axis=-1).swapaxes(1, 2) @ tissue.elements.points.weights
    corners_mm = tissue.nodes[tissue.elements.cells] / M_PER_MM
    centres = np.einsum("k,ckx->cx", shares, corners_mm)
    np.testing.assert_allclose(means, centres, atol=1e-12)
