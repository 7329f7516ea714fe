"""Contact: the pairs that a rank finds, edges on one line, and the gap that limits the
contact distance."""

import numpy as np
import pytest
from shapes import box, rigid

from gyriflow.folding.contact import _small_gap_mm
from gyriflow.folding.contact_search import ContactSearch
from gyriflow.geometry.triangles import merged, transformed

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


def test_edges_on_one_line_whose_ends_are_near_are_pairs_and_stop_each_other():
    upper, gap_mm = [2, 3, 5], 0.04
    positions = POSITIONS.copy()
    positions[upper, 2] += positions[1, 2] + gap_mm - positions[3, 2]
    search = search_at(positions)
    near = search.near(positions)
    assert near.gap_mm == pytest.approx(gap_mm, rel=1e-3)
    towards = np.zeros_like(positions)
    towards[upper, 2] = -2 * gap_mm
    assert search.collision_free_step(near, towards) == pytest.approx(0.45, abs=0.02)


def test_each_pair_in_contact_belongs_to_one_rank():
    below = box((8.0, 6.0, 2.0), subdivisions=3)
    above = transformed(box((7.0, 6.5, 2.0), subdivisions=3), rigid(2.0, 1.0, 20.0))
    mesh = merged(below, transformed(above, rigid(shift=(0.4, 0.3, 2.2))))
    x = mesh.vertices[:, 0]
    masks = [x < -1.0, (x >= -1.0) & (x < 2.0), x >= 2.0]

    def pairs_of(owned):
        search = ContactSearch(mesh.faces, owned, mesh.vertices, 0.6)
        found = search.near(mesh.vertices).pairs
        kinds = "vv_collisions", "ev_collisions", "ee_collisions", "fv_collisions"
        return np.array([len(getattr(found, kind)) for kind in kinds])

    every = pairs_of(np.ones(len(x), dtype=bool))
    assert (every > 3).sum() >= 3
    assert sum(map(pairs_of, masks)).tolist() == every.tolist()


def gaps(near, others, far):
    """Return shuffled gaps in mm: a list of small ones, and counts of uneven ones from
    0.5 mm on and infinite ones."""
    rng = np.random.default_rng(4)
    return rng.permutation(
        [*near, *np.linspace(0.5, 0.9, others), *np.full(far, np.inf)]
    )


UNEVEN = np.linspace(0.5, 0.9, 300)


@pytest.mark.parametrize(
    ("gaps_mm", "limit_mm"),
    [
        # a quarter of the gap of the vertex after the twelve that are left out
        (gaps([0.012, 0.01, 0.03], 300, 700), UNEVEN[9] / 4),
        (gaps(np.linspace(0.01, 0.02, 12), 300, 700), UNEVEN[0] / 4),
        # many near vertices, or few that are hardly nearer than the rest, set it
        (gaps(np.linspace(0.01, 0.02, 13), 300, 700), 0.01),
        (gaps([0.13, 0.4], 300, 700), 0.13),
        # few are a thousandth of 40 000 vertices, a fiftieth of 100
        (gaps(np.full(40, 0.01), 5000, 34_960), 0.125),
        (gaps(np.full(41, 0.01), 5000, 34_959), 0.01),
        (gaps(np.full(2, 0.01), 30, 68), 0.125),
        (gaps(np.full(3, 0.01), 30, 67), 0.01),
        # where nothing else is near, few limit nothing
        (gaps([0.01, 0.02], 0, 998), np.inf),
    ],
)
def test_few_vertices_do_not_set_the_contact_distance(gaps_mm, limit_mm):
    assert _small_gap_mm(gaps_mm) == pytest.approx(limit_mm)
