"""Tags of elements and facets on an ellipsoid, whose answer is known by symmetry."""

import numpy as np
import pytest
from ellipsoid import RUN, SEMI_AXES
from shapes import ellipsoid_mesh

from gyriflow.folding.layers import PialSearch, cortical_weight
from gyriflow.folding.regions import cell_tags, facet_tags, no_growth_ellipsoid
from gyriflow.folding.zones import inside_ellipsoid, zones_of_run
from gyriflow.geometry.tetrahedra import signed_volumes
from gyriflow.parameters.reading import parameters_from
from gyriflow.parameters.terms import BRIDGE, CORE, CORTEX, LEFT, RIGHT


@pytest.fixture(scope="module")
def brain():
    mesh = ellipsoid_mesh(12, SEMI_AXES)
    zones = zones_of_run(mesh, parameters_from(RUN))
    weight = cortical_weight(PialSearch(mesh.vertices, zones.facets).distance(mesh.vertices), 4.0)
    return mesh, zones, cell_tags(mesh, zones, weight)


def test_elements_are_left_right_or_between_the_planes(brain):
    mesh, _, tags = brain
    x = mesh.vertices[mesh.tets, 0].mean(axis=1)
    # the planes stand a quarter of the gap to both sides
    np.testing.assert_array_equal(tags["hemisphere"] == LEFT, x <= -2.0)
    np.testing.assert_array_equal(tags["hemisphere"] == RIGHT, x >= 2.0)
    assert (np.abs(x[tags["hemisphere"] == BRIDGE]) < 2.0).all()
    volumes = signed_volumes(mesh)
    left, right = (volumes[tags["hemisphere"] == side].sum() for side in (LEFT, RIGHT))
    assert left == pytest.approx(right)


def test_cortex_is_the_outer_layer_of_its_thickness(brain):
    mesh, _, tags = brain
    volumes = signed_volumes(mesh)
    inner = np.prod([axis - 4.0 for axis in SEMI_AXES]) / np.prod(SEMI_AXES)
    assert volumes[tags["layer"] == CORE].sum() / volumes.sum() == pytest.approx(inner, abs=0.05)
    assert set(tags["layer"]) == {CORTEX, CORE}


def test_an_element_grows_where_one_of_its_vertices_does(brain):
    mesh, zones, tags = brain
    growing = zones.growth[mesh.tets]
    np.testing.assert_array_equal(tags["growing"] == 0, (growing == 0).all(axis=1))
    assert 0 < tags["growing"].sum() < len(mesh.tets)


def test_facets_have_their_zone_and_their_hemisphere(brain):
    mesh, zones, _ = brain
    x, y = mesh.vertices[zones.facets].mean(axis=1)[:, :2].T
    tags = facet_tags(zones, x < 0.2 * y)
    np.testing.assert_array_equal(tags["zone"], zones.facet_zone)
    np.testing.assert_array_equal(tags["hemisphere"], np.where(x < 0.2 * y, LEFT, RIGHT))


def test_the_ellipsoid_is_the_one_in_which_the_zones_let_nothing_grow(brain):
    mesh, _, _ = brain
    run = parameters_from(RUN)
    centre, semi_axes = no_growth_ellipsoid(mesh.vertices, run)
    inside = (((mesh.vertices - centre) / semi_axes) ** 2).sum(axis=1) <= 1
    p = run.no_growth
    np.testing.assert_array_equal(inside, inside_ellipsoid(mesh.vertices, p.shift_y, p.shift_z, p.semi_axes))
    assert 0 < inside.sum() < len(inside)
    assert no_growth_ellipsoid(mesh.vertices, parameters_from(RUN | {"no_growth": {"kind": "none"}})) is None
