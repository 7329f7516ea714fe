"""Search for near pairs of vertices, edges and faces, and collision detection, with the
IPC Toolkit."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Protocol

import ipctk
import numpy as np

from ..geometry.triangles import Floats, Indices, Ints, Mask
from .contact_surface import SurfacePart, part_of_surface

CANDIDATE_MARGIN_MM = 0.05
"""Displacement of the surface after which candidates for pairs are searched for
again."""
PART_MARGIN_MM = 1.0
"""Displacement of the surface after which each rank determines its part of the surface
again."""
MAX_CLOSING = 0.9
"""Largest fraction of a gap by which a step may close it."""
CCD = ipctk.AdditiveCCD(conservative_rescaling=MAX_CLOSING)
"""Continuous collision detection (Li et al. 2021) that leaves a tenth of each pair's
distance. Interval bisection, the alternative, takes minutes if flat surfaces meet face
to face."""

PARALLEL_TOL = 1e-6
"""Sine of the angle below which two edges count as parallel."""
MIN_STEP = 1e-9
"""Smaller collision-free steps are due to parallel edges whose distance is computed as
zero."""


class EdgePair(Protocol):
    """A pair of two edges, by their numbers."""

    edge0_id: int
    edge1_id: int


@dataclass(frozen=True, eq=False)
class SearchRange:
    """The range of a search: positions (s, 3) in mm between which the surface moves,
    and half the distance searched."""

    first: Floats
    last: Floats
    reach: float


@dataclass(frozen=True, eq=False)
class NearPairs:
    """A rank's own pairs within the contact distance, for (s, 3) positions in mm of the
    whole surface.

    `mesh` is the rank's part for the IPC Toolkit, with areas as at the step's start;
    `part_positions` (p, 3) in mm.
    """

    positions: Floats
    part: SurfacePart
    mesh: ipctk.CollisionMesh
    part_positions: Floats
    pairs: ipctk.NormalCollisions

    @property
    def gap_mm(self) -> float:
        """The smallest distance between the pairs, infinite without any."""
        if not len(self.pairs):
            return np.inf
        squared = self.pairs.compute_minimum_distance(self.mesh, self.part_positions)
        return float(np.sqrt(squared))

    def distance_mm(self, i: int) -> float:
        """Return the distance between the two sides of pair `i`."""
        # ipctk's pairs do not keep their list alive: a pair with a name may outlive it,
        # and then reads freed memory
        ends = self.pairs[i].dof(
            self.part_positions,
            self.mesh.edges,
            self.mesh.faces,
        )
        squared = self.pairs[i].compute_distance(ends)
        return float(np.sqrt(squared))

    def vertices_of_pairs(self) -> list[list[int]]:
        """Return the vertices of each pair, as numbers of the part's vertices."""
        found = []
        for i in range(len(self.pairs)):
            vertices = self.pairs[i].vertex_ids(
                self.mesh.edges,
                self.mesh.faces,
            )
            # negative numbers stand for missing vertices
            found.append([vertex for vertex in vertices if vertex >= 0])
        return found


class ContactSearch:
    """A rank's search for pairs within a distance, in one step that begins with the
    surface at `rest_mm` (s, 3).

    The rank's part of the surface and the candidates for pairs are cached, from the
    `previous` step on, as long as they cover the positions: this saves time and changes
    no result. `owned` (s,) is the mask of the rank's vertices.
    """

    def __init__(
        self,
        faces: Ints,
        owned: Mask,
        rest_mm: Floats,
        distance_mm: float,
        previous: "ContactSearch | None" = None,
    ) -> None:
        self._faces = faces
        self._owned = owned
        self._rest = rest_mm
        self._distance = distance_mm
        # each with the range of positions for which it holds
        self._part: tuple[SurfacePart, SearchRange] | None = None
        self._candidates: tuple[ipctk.Candidates, SearchRange] | None = None
        # it has the areas at the step's start
        self._mesh: ipctk.CollisionMesh | None = None
        if previous is not None:
            self._part = previous._part
            self._candidates = previous._candidates
            if np.array_equal(rest_mm, previous._rest):
                self._mesh = previous._mesh
        self._broad_phase = ipctk.LBVH()

    def near(self, positions: Floats) -> NearPairs:
        """Return the rank's pairs at (s, 3) positions in mm."""
        part, mesh = self.part_at(positions)
        candidates = self._candidates_at(positions)
        if candidates is None:
            part, mesh, candidates = self._search(self._rest, positions)
        places = part.restrict(positions)
        pairs = ipctk.NormalCollisions()
        pairs.use_area_weighting = True
        pairs.build(candidates, mesh, places, self._distance)
        pairs = _drop_parallel_edges(pairs, part.edges, places)
        return NearPairs(
            positions,
            part,
            mesh,
            places,
            part.owned_pairs(pairs),
        )

    def collision_free_step(self, start: NearPairs, displacement: Floats) -> float:
        """Return the largest fraction, at most 1, of a displacement (s, 3) in mm from
        `start` without a collision."""
        # everything that is not a pair is farther away than the contact distance
        gap = min(self._distance, start.gap_mm)
        longest = float(np.linalg.norm(displacement, axis=1).max())
        if 2 * longest <= MAX_CLOSING * gap:
            return 1.0
        first = start.positions
        last = first + displacement
        part, mesh = self.part_at(first, last)
        candidates = self._candidates_at(first, last)
        if candidates is None and np.abs(displacement).max() <= PART_MARGIN_MM:
            # the initial guess of a step is close to its solution, so the whole step
            # needs no other search
            part, mesh, candidates = self._search(first, last)
        ends = part.restrict(first), part.restrict(last)
        if candidates is None:
            step = ipctk.compute_collision_free_stepsize(
                mesh, *ends, broad_phase=self._broad_phase, narrow_phase_ccd=CCD
            )
        else:
            step = candidates.compute_collision_free_stepsize(
                mesh, *ends, narrow_phase_ccd=CCD
            )
        if step < MIN_STEP:
            if candidates is None:
                part, mesh, candidates = self._search(first, last)
            candidates = _drop_distant_parallel_edges(candidates, part.edges, *ends)
            step = candidates.compute_collision_free_stepsize(
                mesh, *ends, narrow_phase_ccd=CCD
            )
        return float(step)

    def part_at(self, *positions: Floats) -> tuple[SurfacePart, ipctk.CollisionMesh]:
        """Return a part of the surface with all pairs of the rank, at each of the given
        (s, 3) positions in mm."""
        if self._part is None or not self._covers(self._part[1], *positions):
            self._part = self._new_part(*positions)
            # candidates refer to vertex numbers of the old part
            self._mesh = None
            self._candidates = None
        part, _ = self._part
        if self._mesh is None:
            rest = part.restrict(self._rest)
            self._mesh = ipctk.CollisionMesh(
                rest,
                part.edges,
                part.faces,
            )
        return part, self._mesh

    def _new_part(
        self, first: Floats, *others: Floats
    ) -> tuple[SurfacePart, SearchRange]:
        margin = PART_MARGIN_MM
        for places in others:
            margin = max(
                margin,
                float(np.abs(places - first).max()),
            )
        if self._owned.all():
            # a single rank has the whole surface
            margin = np.inf
        covered = SearchRange(first, first, self._distance / 2 + margin)
        part = part_of_surface(
            first,
            self._faces,
            self._owned,
            2 * covered.reach,
        )
        return part, covered

    def _covers(self, searched: SearchRange, *positions: Floats) -> bool:
        """Return whether a search has found all pairs at other positions."""
        margin = searched.reach - self._distance / 2
        if np.isinf(margin):
            return True
        low = np.minimum(searched.first, searched.last) - margin
        high = np.maximum(searched.first, searched.last) + margin
        for places in positions:
            if (places < low).any() or (places > high).any():
                return False
        return True

    def _candidates_at(self, *positions: Floats) -> ipctk.Candidates | None:
        if self._candidates is None:
            return None
        candidates, covered = self._candidates
        return candidates if self._covers(covered, *positions) else None

    def _search(
        self, first: Floats, last: Floats
    ) -> tuple[SurfacePart, ipctk.CollisionMesh, ipctk.Candidates]:
        part, mesh = self.part_at(first, last)
        reach = self._distance / 2 + CANDIDATE_MARGIN_MM
        candidates = ipctk.Candidates()
        candidates.build(
            mesh, part.restrict(first), part.restrict(last), reach, self._broad_phase
        )
        self._candidates = candidates, SearchRange(first, last, reach)
        return part, mesh, candidates


def _drop_parallel_edges(
    pairs: ipctk.NormalCollisions,
    edges: Indices,
    positions: Floats,
) -> ipctk.NormalCollisions:
    """Return the pairs without those of two edges (e, 2) that are parallel, at
    positions (p, 3) of their vertices.

    Parallel edges do not repel each other (Li et al. 2020, section 5.1): their ends do,
    which are pairs of their own. The distance between two edges that are parallel but
    for round-off may be computed as zero, however far apart they are on one line, and
    then their barrier would be infinite.
    """
    are_parallel = _parallel_edges(pairs.ee_collisions, edges, positions)
    if not are_parallel.any():
        return pairs
    # a new object, since items of the old lists read the memory of their list when they
    # are released
    result = ipctk.NormalCollisions()
    result.use_area_weighting = pairs.use_area_weighting
    result.vv_collisions = pairs.vv_collisions
    result.ev_collisions = pairs.ev_collisions
    result.ee_collisions = list(compress(pairs.ee_collisions, ~are_parallel))
    result.fv_collisions = pairs.fv_collisions
    return result


def _drop_distant_parallel_edges(
    candidates: ipctk.Candidates,
    edges: Indices,
    first: Floats,
    last: Floats,
) -> ipctk.Candidates:
    """Return the candidates without those of parallel edges that cannot meet between
    positions `first` and `last` (p, 3).

    The collision detection may compute the distance of parallel edges as zero, and then
    allows no step. Their distance is the smallest one from an end to the other edge:
    they cannot meet if no end moves half of it, apart from the mean displacement.
    """
    pairs = candidates.ee_candidates
    are_parallel = _parallel_edges(pairs, edges, first)
    kept = []
    for pair, is_parallel in zip(pairs, are_parallel, strict=True):
        vertices = np.array([*edges[pair.edge0_id], *edges[pair.edge1_id]])
        if not is_parallel or _can_meet(first[vertices], last[vertices]):
            kept.append(pair)
    result = ipctk.Candidates()
    result.vv_candidates = candidates.vv_candidates
    result.ev_candidates = candidates.ev_candidates
    result.ee_candidates = kept
    result.fv_candidates = candidates.fv_candidates
    return result


def _parallel_edges(
    pairs: Sequence[EdgePair],
    edges: Indices,
    positions: Floats,
) -> Mask:
    """Return for each pair whether its two edges (e, 2) are parallel at (p, 3)
    positions of their vertices."""
    numbers = np.array(
        [(pair.edge0_id, pair.edge1_id) for pair in pairs],
        np.int64,
    )
    # of the edges in pairs only, which are few: this is called at each evaluation of
    # forces
    ends = positions[edges[numbers.reshape(-1, 2)]]
    directions = ends[:, :, 1] - ends[:, :, 0]
    first = directions[:, 0]
    second = directions[:, 1]
    crosses = np.linalg.norm(
        np.cross(first, second),
        axis=1,
    )
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.asarray(crosses < PARALLEL_TOL * lengths)


def _can_meet(first: Floats, last: Floats) -> bool:
    """Return whether two parallel edges may meet, from (4, 3) places of their ends
    before and after a motion."""
    a, b, c, d = first
    squared_distances = [
        ipctk.point_edge_distance(a, c, d),
        ipctk.point_edge_distance(b, c, d),
        ipctk.point_edge_distance(c, a, b),
        ipctk.point_edge_distance(d, a, b),
    ]
    distance = np.sqrt(min(squared_distances))
    displacement = last - first
    relative = displacement - displacement.mean(axis=0)
    motion = np.linalg.norm(relative, axis=1).max()
    return bool(2 * motion >= distance)
