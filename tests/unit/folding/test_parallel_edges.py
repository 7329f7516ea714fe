"""Edges on one line that are parallel but for round-off neither repel each other nor
stop a step."""

import numpy as np
import pytest

from gyriflow.folding.contact_search import ContactSearch

DISTANCE_MM = 0.053
FACES = np.array([[0, 1, 4], [2, 3, 5]])
POSITIONS = np.array(
    [
        [-4.0, 0.1999965352413356, -0.028901165626501607],
        [-4.0, 0.19999539941627953, 0.12053182420834901],
        [-4.0, 0.19999312776616743, 0.41887310336979133],
        [-4.0, 0.19999426359122344, 0.26978991387378004],
        [-3.0, 0.2, 0.05],
        [-3.0, 0.2, 0.35],
    ]
)
"""Two triangles in mm, each with an edge on the straight side of an element, as a
folding slab had them.

The ends are 0.149 mm apart, three times the contact distance; ipctk 1.6 takes the edges
for crossing lines.
"""
DISPLACEMENT = np.array(
    [
        [0.0, -3.4647586644176442e-06, 0.41219199524041217],
        [0.0, -4.60058372048211e-06, 0.41459393145988815],
        [0.0, -6.872233832611041e-06, 0.41887310339062334],
        [0.0, -5.7364087765465754e-06, 0.41682096750995845],
        [0.0, 0.0, 0.41],
        [0.0, 0.0, 0.41],
    ]
)


def search_at(positions):
    return ContactSearch(
        FACES, np.ones(len(positions), dtype=bool), positions, DISTANCE_MM
    )


def test_distant_edges_on_one_line_are_no_pair_and_do_not_stop_a_step():
    search = search_at(POSITIONS)
    near = search.near(POSITIONS)
    assert near.gap_mm == np.inf
    assert search.collision_free_step(near, DISPLACEMENT) == 1.0


@pytest.mark.parametrize("gap_mm", [0.02, 0.04])
def test_edges_on_one_line_whose_ends_are_near_are_pairs_and_stop_each_other(gap_mm):
    upper = [2, 3, 5]
    positions = POSITIONS.copy()
    positions[upper, 2] += positions[1, 2] + gap_mm - positions[3, 2]
    search = search_at(positions)
    near = search.near(positions)
    assert near.gap_mm == pytest.approx(gap_mm, rel=1e-3)
    towards = np.zeros_like(positions)
    towards[upper, 2] = -2 * gap_mm
    assert search.collision_free_step(near, towards) == pytest.approx(0.45, abs=0.02)
