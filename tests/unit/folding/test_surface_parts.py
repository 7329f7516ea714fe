"""A surface shared out between ranks: every pair is one rank's, as it is on the whole surface."""

import ipctk
import numpy as np
import pytest

from gyriflow.folding.surface_parts import part_of_surface, shared_out
from gyriflow.geometry.triangles import TriangleMesh, edges

DISTANCE = 0.3


def sheets(cells=24):
    """Returns vertices and faces of two rough sheets that nearly touch, edges of about 1."""
    x, y = (place.ravel() for place in np.meshgrid(*2 * [np.arange(cells + 1.0)]))
    corner = np.arange((cells + 1) ** 2).reshape(2 * (cells + 1,))
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    random = np.random.default_rng(2)
    low = np.stack([x, y, random.uniform(0.0, 0.25, len(x))], axis=1)
    high = np.stack([x + 0.2, y + 0.1, random.uniform(0.3, 0.55, len(x))], axis=1)
    # some of the vertices face each other
    high[::3, :2] = low[::3, :2] + 0.02
    return np.concatenate([low, high]), np.concatenate([faces, faces + len(x)])


def described(vertices, faces, sides, start, place, numbers, choose=lambda pairs: pairs):
    """Returns the weight of each pair by its kind and the numbers of its vertices."""
    mesh = ipctk.CollisionMesh(
        np.asfortranarray(start[vertices]), np.asfortranarray(sides, np.int32), np.asfortranarray(faces, np.int32)
    )
    pairs = ipctk.NormalCollisions()
    pairs.use_area_weighting = True
    pairs.build(mesh, np.asfortranarray(place[vertices]), DISTANCE)
    pairs = choose(pairs)
    found = {}
    for kind in ("vv", "ev", "ee", "fv"):
        for pair in getattr(pairs, f"{kind}_collisions"):
            ids = [numbers[i] for i in pair.vertex_ids(mesh.edges, mesh.faces) if i >= 0]
            key = (kind, *sorted(int(i) for i in ids))
            assert key not in found
            found[key] = pair.weight
    return found


@pytest.mark.parametrize("ranks", [2, 3, 5])
def test_each_pair_is_one_ranks_with_the_weight_it_has_on_the_whole_surface(ranks):
    start, faces = sheets()
    room = 0.4
    place = start + np.random.default_rng(3).uniform(-0.05, 0.05, start.shape) + [0.3, -0.2, 0.1]
    whole = described(
        np.arange(len(start)), faces, edges(TriangleMesh(start, faces))[0], start, place, np.arange(len(start))
    )
    assert {kind: sum(key[0] == kind for key in whole) > 30 for kind in ("vv", "ev", "ee", "fv")} == dict.fromkeys(
        ("vv", "ev", "ee", "fv"), True
    )
    owner, together = shared_out(start, ranks), {}
    for rank in range(ranks):
        part = part_of_surface(start, faces, owner == rank, DISTANCE + 2 * room)
        assert len(part.faces) < 0.75 * len(faces)
        own = described(part.vertices, part.faces, part.edges, start, place, part.vertices, part.of_own)
        assert len(own) > len(whole) / (2 * ranks)
        assert not own.keys() & together.keys()
        together |= own
    assert together.keys() == whole.keys()
    for key, weight in whole.items():
        assert together[key] == pytest.approx(weight, rel=1e-12), key
