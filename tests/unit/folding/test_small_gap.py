"""The gap that limits the contact distance: the smallest, unless few vertices are much
nearer than the rest."""

import numpy as np
import pytest

from gyriflow.folding.contact import small_gap_mm


def gaps(near, others, far):
    """Return shuffled gaps in mm: a list of small ones, and counts of uneven ones from
    0.5 mm on and infinite ones."""
    rng = np.random.default_rng(4)
    return rng.permutation(
        [*near, *np.linspace(0.5, 0.9, others), *np.full(far, np.inf)]
    )


@pytest.mark.parametrize(
    "near", [[0.01], [0.012, 0.01, 0.03], np.linspace(0.01, 0.02, 12)]
)
def test_few_vertices_do_not_set_the_contact_distance(near):
    found = small_gap_mm(gaps(near, 300, 700))
    # a quarter of the gap of the vertex after the twelve that are left out
    assert found == pytest.approx(0.25 * np.linspace(0.5, 0.9, 300)[12 - len(near)])


def test_many_near_vertices_set_it():
    assert small_gap_mm(gaps(np.linspace(0.01, 0.02, 13), 300, 700)) == pytest.approx(
        0.01
    )


def test_few_that_are_hardly_nearer_than_the_rest_set_it():
    assert small_gap_mm(gaps([0.13, 0.4], 300, 700)) == pytest.approx(0.13)
    assert small_gap_mm(np.linspace(0.02, 0.07, 1000)) == pytest.approx(0.02)


def test_the_number_of_few_grows_with_the_surface_and_is_none_on_a_tiny_one():
    # a thousandth of 40 000 vertices
    found = [
        small_gap_mm(gaps(np.full(count, 0.01), 5000, 35000 - count))
        for count in (40, 41)
    ]
    assert found == pytest.approx([0.125, 0.01])
    # a fiftieth of 100 vertices
    found = [
        small_gap_mm(gaps(np.full(count, 0.01), 30, 70 - count)) for count in (2, 3)
    ]
    assert found == pytest.approx([0.125, 0.01])


def test_where_nothing_else_is_near_they_limit_nothing():
    assert small_gap_mm(gaps([0.01, 0.02], 0, 998)) == np.inf
