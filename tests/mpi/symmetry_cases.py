"""Two hemispheres that are mirror images fold as mirror images, contact with the planes included."""

import numpy as np
import pytest
from boxes import COMM
from verification_cases.mirrored import block, folded, hemisphere, reflected_and_merged, rounded

from gyriflow.geometry.tetrahedra import signed_volumes


@pytest.mark.one_rank
@pytest.mark.parametrize("half", [hemisphere(6), rounded(hemisphere(4))])
def test_the_halves_are_mirror_images_of_whole_elements(half):
    mesh = reflected_and_merged(half)
    one, other = np.split(signed_volumes(mesh), 2)
    assert one.min() > 0
    np.testing.assert_allclose(one, other, rtol=1e-12)


@pytest.mark.parametrize(
    ("half", "steps", "memory_gw", "penetration_mm"),
    [(hemisphere(6), 5, 0.0, 0.05), (hemisphere(6), 5, 1.0, 0.05), (rounded(hemisphere(4)), 4, 1.0, 0.01)],
    ids=["forgetting", "remembering", "quadratic"],
)
def test_mirrored_hemispheres_stay_mirror_images(half, steps, memory_gw, penetration_mm):
    state, found = folded(half, steps, COMM, stress_memory_gw=memory_gw)
    # contact acts, and what is compared is large
    assert found.penetration_mm > penetration_mm
    assert found.displacement_mm > 0.5
    assert found.relative <= 1e-9
    assert (COMM.bcast(state.positions) == state.positions).all()


def test_equal_distances_to_several_pial_vertices_do_not_break_the_symmetry():
    _, found = folded(block(6), 4, COMM)
    assert found.displacement_mm > 0.1
    assert found.relative <= 1e-9
