"""A few flat elements of a mesh are improved without moving its surface."""

import numpy as np
import pytest
from shapes import box_mesh

from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    radius_ratios,
    signed_volumes,
)
from gyriflow.mesh.improvement import MIN_RADIUS_RATIO, improve_flat_elements

MESH = box_mesh((5, 5, 5), (10.0, 10.0, 10.0))
"""Cells of 2 mm."""


def flattened(vertex, towards):
    """Return the mesh with a vertex close to the middle of a face of one of its
    elements, and that element."""
    element = MESH.tets[(MESH.tets == vertex).any(axis=1)][towards]
    middle = MESH.vertices[element[element != vertex]].mean(axis=0)
    vertices = MESH.vertices.copy()
    vertices[vertex] += 0.985 * (middle - vertices[vertex])
    return TetrahedralMesh(vertices, MESH.tets)


@pytest.mark.parametrize("towards", [0, 5])
def test_a_flat_element_inside_is_improved_and_the_surface_stays(towards):
    centre = int(
        np.argmin(np.linalg.norm(MESH.vertices - MESH.vertices.mean(axis=0), axis=1))
    )
    # not the centre itself: a vertex beside it, with uneven surroundings
    flat = flattened(centre + 1, towards)
    assert 0 < radius_ratios(flat).min() < MIN_RADIUS_RATIO
    found = improve_flat_elements(flat)
    assert radius_ratios(found).min() > MIN_RADIUS_RATIO
    assert signed_volumes(found).min() > 0
    used = boundary_surface(flat)[1]
    assert np.abs(found.vertices - flat.vertices)[used].max() <= 0.05 * 10
    assert signed_volumes(found).sum() == pytest.approx(1000.0, rel=2e-3)


def test_a_sound_mesh_is_returned_as_it_is():
    assert improve_flat_elements(MESH) is MESH
