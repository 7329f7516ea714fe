"""Contact of the pial surface with itself: Incremental Potential Contact (Li et al.
2020), with the IPC Toolkit.

Pairs of vertices, edges or faces that are nearer than a distance d̂ repel each other
with a barrier potential, which tends to infinity as their distance tends to zero. No
displacement may move one through the other. Every rank has the whole surface
(`contact_surface`) and searches for the pairs of its own part (`contact_search`).
Energies, forces and stiffness are summed over the ranks, gaps and collision-free steps
are minima over them, so that all ranks take the same decisions.
"""

import ipctk
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from ..errors import MeshError
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    connected,
    edge_lengths,
    edges,
)
from ..units import M_PER_MM
from .contact_search import ContactSearch, NearPairs
from .contact_surface import ContactSurface
from .domain import Domain, bisect_points

DISTANCE_PER_MEAN_EDGE = 0.1
"""Largest contact distance d̂ as a multiple of the mean edge length of the contact
surface: well below what the mesh resolves. It grows with the edges of the surface; a
fixed distance would only make contact harder to solve."""
DISTANCE_PER_SHORT_EDGE = 0.2
"""Largest contact distance as a multiple of the length of a short edge. With a larger
one a compressed surface would repel itself and resist compression
(docs/verification.md)."""
SHORT_EDGES = 0.05
"""The share of edges that are shorter than a short edge."""
STIFFNESS_PER_MODULUS = 0.1
"""The barrier's stiffness κ as a multiple of the cortex' shear modulus. The pressure
between folds, some tenths of the modulus, then keeps them at about half of the contact
distance; a stiffer barrier takes more iterations and changes nothing else."""
STIFFEN_BELOW = 0.1
"""Fraction of the contact distance. Where the smallest gap at a step's start is
smaller, the barrier is stiffer, by the square root of the ratio, if it may stiffen:
with stress memory folds press on each other ever harder, and a barrier that is too soft
lets them come so near that Newton's method stagnates."""
MAX_STIFFENING = 32.0
"""Largest stiffness of the barrier, as a multiple of the initial one."""
MAX_GAP_FRACTION = 0.999
"""Largest contact distance as a fraction of the small gap at the start of a run
(`_small_gap_mm`)."""
FEW_VERTICES, FEW_SHARE, MAX_FEW_SHARE = 12, 0.001, 0.02
"""Number of vertices, at least those around one, that may be nearer than the rest and
do not set the distance: this number or this share of all, and at most the last
share."""
FEW_BELOW = 0.25
"""Factor by which these must be nearer than the rest."""
NEIGHBOUR_EDGES = {1: 3, 2: 6}
"""Vertices that so few edges connect are neighbours, by the order of the elements: a
node of a quadratic element is two edges from the next. Neighbours on small faces are
nearer to each other than the contact distance, but no gap is between them."""
MAX_DISPLACEMENT_MM = 8.0
"""Longest displacement of a vertex in one iteration; a solve with a longer one
diverges."""
BARRIER = ipctk.TwoStageBarrier()
N_PER_PA_MM2, N_PER_M_PER_PA_MM, J_PER_PA_MM3 = 1e-6, 1e-3, 1e-9


class SelfContact:
    """The barrier between all parts of the pial surface, a contribution to the energy
    of a step.

    Displacements `u` are those of the local nodes, (k, 3) in m, from the mesh at the
    start of the step. `facets` (f, 3) are vertex indices of the mesh, `stiffness_pa` is
    the barrier's initial stiffness. The contact distance is the given `distance_mm`, or
    else by the edge lengths at each step's start, but below the small gap at the start
    of the run, neighbours aside: a body that does not grow must not move, except where
    neighbours on thin triangles or a few vertices are nearer to each other. `stiffens`
    is for runs with stress memory. MeshError where the surface crosses itself at the
    start.

    Attributes: contact distance d̂, `distance_mm`, and stiffness κ of the barrier,
    `stiffness_pa`, in the current step.
    """

    def __init__(
        self,
        domain: Domain,
        facets: Ints,
        stiffness_pa: float,
        distance_mm: float | None = None,
        *,
        stiffens: bool = False,
    ) -> None:
        ipctk.set_num_threads(1)  # more threads would compete with other ranks
        self.domain = domain
        self.surface = ContactSurface(domain, facets)
        self._stiffens = stiffens
        self._initial_pa = stiffness_pa
        self._given_mm = distance_mm
        self._max_mm = np.inf
        start = self.surface.reference_mm()
        self._edges, _ = edges(TriangleMesh(start, self.surface.faces))
        # from rank 0, since other processors may round differently
        rank_of_vertex = bisect_points(start, domain.comm.size)
        rank_of_vertex = domain.comm.bcast(rank_of_vertex, root=0)
        self._owned = rank_of_vertex == domain.comm.rank
        self._search = ContactSearch(
            self.surface.faces,
            self._owned,
            start,
            0.0,
        )
        self.begin_step()
        if self.crosses(start):
            raise MeshError(
                "the pial surface of the mesh crosses itself, which contact cannot"
                " undo",
                remedy="Repair the surface, or mesh with shorter mesh.surface_edge_mm.",
            )
        if distance_mm is None:
            gaps = np.full(len(start), np.inf)
            self._lower_gaps(gaps, self._search.near(start))
            gaps = np.min(
                domain.comm.allgather(gaps),
                axis=0,
            )
            # round-off must not make a pair of surface elements exactly at the limit
            self._max_mm = MAX_GAP_FRACTION * _small_gap_mm(gaps)
            self.begin_step()

    def crosses(self, positions: Floats) -> bool:
        """Return whether the surface at (s, 3) positions in mm crosses itself."""
        part, mesh = self._search.part_at(positions)
        crosses = ipctk.has_intersections(
            mesh, part.restrict(positions), broad_phase=ipctk.LBVH()
        )
        return self.domain.comm.allreduce(crosses, op=MPI.LOR)

    def _lower_gaps(self, gaps: Floats, near: NearPairs) -> None:
        """Lower the gap (n,) of each vertex to the smallest of a rank's pairs with it
        that are not neighbours."""
        pairs = [near.part.vertices[corners] for corners in near.vertices_of_pairs()]
        if not pairs:
            return
        in_pairs = np.unique(np.concatenate(pairs))
        count = len(self._rest)
        first, second = self._edges.T
        ones = np.ones(len(self._edges))
        one_way = sparse.coo_array(
            (ones, (first, second)),
            shape=(count, count),
        )
        links = (one_way + one_way.T + sparse.eye_array(count)).tocsr()
        # nonzero where a few edges connect a vertex in pairs (row) and another one
        connections = links[in_pairs]
        for _ in range(NEIGHBOUR_EDGES[self.domain.order] - 1):
            connections = connections @ links
        for number, vertices in enumerate(pairs):
            rows = np.searchsorted(in_pairs, vertices)
            are_neighbours = connections[rows][:, vertices].toarray() > 0
            if not are_neighbours.all():
                gap_mm = near.distance_mm(number)
                gaps[vertices] = np.minimum(gaps[vertices], gap_mm)

    def begin_step(self) -> None:
        """Start from the current positions; set the barrier by edge lengths and the
        smallest gap there."""
        self._rest = self.surface.reference_mm()
        lengths = edge_lengths(self._rest, self._edges)
        # from rank 0, as above
        by_edges = self.domain.comm.bcast(_contact_distance_mm(lengths), root=0)
        self.distance_mm = self._given_mm or min(by_edges, self._max_mm)
        self._search = ContactSearch(
            self.surface.faces,
            self._owned,
            self._rest,
            self.distance_mm,
            self._search,
        )
        self._near: NearPairs | None = None
        self.stiffness_pa = self._initial_pa
        if self._stiffens:
            # the first residual of the step needs them again
            self._near = self._search.near(self._rest)
            gap_mm = self.domain.comm.allreduce(
                self._near.gap_mm,
                op=MPI.MIN,
            )
            self.stiffness_pa *= _stiffening(gap_mm / self.distance_mm)
        self._potential = ipctk.BarrierPotential(
            BARRIER,
            self.distance_mm,
            self.stiffness_pa,
            use_physical_barrier=True,
        )

    def _near_pairs(self, u: Floats) -> NearPairs:
        """Return this rank's pairs. Those of the last displacement are cached."""
        positions = self._rest + self.surface.displacement_mm(u)
        if self._near is None or not np.array_equal(positions, self._near.positions):
            self._near = self._search.near(positions)
        return self._near

    def join_touching(self, part: Ints) -> Ints:
        """Return new part numbers (n,) of the mesh's vertices: parts in contact at the
        start of the step become one."""
        if part.max() == 0:
            return part
        no_motion = np.zeros((len(self.domain.vertex_of_node), 3))
        near = self._near_pairs(no_motion)
        nearest_node = np.asarray(self.surface.weights.argmax(axis=1)).ravel()
        part_of_node = part[self.surface.nodes]
        part_of_vertex = part_of_node[nearest_node]
        own_links = set()
        for corners in near.vertices_of_pairs():
            vertices = near.part.vertices[corners]
            parts = part_of_vertex[vertices]
            own_links.add((int(parts.min()), int(parts.max())))
        all_links = set().union(*self.domain.comm.allgather(own_links))
        links = np.array(sorted(all_links)).reshape(-1, 2)
        joined = connected(links, int(part.max()) + 1)
        return joined[part].astype(np.int64)

    def energy(self, u: Floats) -> float:
        """Return the barrier's energy in J."""
        near = self._near_pairs(u)
        energy = self._potential(
            near.pairs,
            near.mesh,
            near.part_positions,
        )
        return self.domain.comm.allreduce(float(energy) * J_PER_PA_MM3)

    def forces(self, u: Floats) -> Floats:
        """Return the (n, 3) derivative of the energy in N at the surface's nodes."""
        near = self._near_pairs(u)
        return self.surface.nodal_sum(near.part, self._forces_of(near))

    def _forces_of(self, near: NearPairs) -> Floats:
        """Return the (p, 3) derivative of the energy of a rank's pairs in N."""
        if not len(near.pairs):
            return np.zeros_like(near.part_positions)
        gradient = self._potential.gradient(
            near.pairs,
            near.mesh,
            near.part_positions,
        )
        return np.asarray(gradient.reshape(-1, 3) * N_PER_PA_MM2)

    def add_forces(self, u: Floats, out: Floats) -> None:
        """Add the forces in N to the owned components (3 · n_owned,) of a vector."""
        surface = self.surface
        out.reshape(-1, 3)[surface.local] += self.forces(u)[surface.rows]

    def stiffness(self, u: Floats, *, convex: bool = False) -> PETSc.Mat | None:
        """Return the second derivative in N/m, None without any pair; `convex` makes
        each pair's part semidefinite."""
        near = self._near_pairs(u)
        if not self.domain.comm.allreduce(len(near.pairs)):
            return None
        own = None
        if len(near.pairs):
            methods = ipctk.PSDProjectionMethod
            projection = methods.CLAMP if convex else methods.NONE
            own = self._potential.hessian(
                near.pairs,
                near.mesh,
                near.part_positions,
                projection,
            )
            own = own * N_PER_M_PER_PA_MM
        return self.surface.matrix_sum(near.part, own)

    def max_step(self, u: Floats, direction: Floats) -> float:
        """Return the largest fraction, up to 1, of a direction (k, 3) in m that can be
        added to u without collision."""
        displacement = self.surface.displacement_mm(direction)
        lengths = np.linalg.norm(displacement, axis=1)
        # the candidates near a longer displacement would fill the memory
        longest_mm = max(float(lengths.max()), MAX_DISPLACEMENT_MM)
        part = MAX_DISPLACEMENT_MM / longest_mm
        near = self._near_pairs(u)
        step = self._search.collision_free_step(near, part * displacement)
        return part * self.domain.comm.allreduce(step, op=MPI.MIN)

    def smallest_distance_mm(self, u: Floats) -> float:
        """Return the smallest distance between the two sides of a pair, infinite
        without pairs."""
        return self.domain.comm.allreduce(
            self._near_pairs(u).gap_mm,
            op=MPI.MIN,
        )

    def pair_count(self, u: Floats) -> int:
        """Return the number of pairs within the contact distance."""
        return self.domain.comm.allreduce(len(self._near_pairs(u).pairs))

    def pressure(self, u: Floats) -> Floats:
        """Return the (n,) contact pressure in Pa at all vertices of the mesh, force per
        area, 0 off the surface."""
        near = self._near_pairs(u)
        part = near.part
        forces = np.zeros_like(self._rest)
        forces[part.vertices] = self._forces_of(near)
        # only the owner of a vertex is sure to have all faces around it
        areas_mm2 = np.array(near.mesh.vertex_areas)[part.owned]
        areas = np.zeros(len(self._rest))
        areas[part.vertices[part.owned]] = areas_mm2 * M_PER_MM**2
        total_forces = self.domain.sum_over_ranks(forces)
        total_areas = self.domain.sum_over_ranks(areas)
        pressure = np.linalg.norm(total_forces, axis=1) / total_areas
        values = np.zeros(len(self.domain.positions))
        # the first vertices of the surface are the nodes
        values[self.surface.nodes] = pressure[: len(self.surface.nodes)]
        return values


def _contact_distance_mm(lengths: Floats) -> float:
    """Return the contact distance d̂ in mm for a surface whose edges have (e,) lengths
    in mm."""
    by_mean = DISTANCE_PER_MEAN_EDGE * float(lengths.mean())
    by_short = DISTANCE_PER_SHORT_EDGE * float(np.quantile(lengths, SHORT_EDGES))
    return min(by_mean, by_short)


def _small_gap_mm(gaps: Floats) -> float:
    """Return the gap that limits the contact distance, from those (n,) of all vertices,
    infinite where none is near.

    It is the smallest, unless few vertices are nearer than a quarter of the gap of the
    next one: then it is that quarter. These few are pressed apart in the first step.
    """
    count = len(gaps)
    few = max(FEW_VERTICES, FEW_SHARE * count)
    few = min(few, MAX_FEW_SHARE * count)
    ascending = np.sort(gaps)
    next_gap = float(ascending[int(few)])
    return max(float(ascending[0]), FEW_BELOW * next_gap)


def _stiffening(gap: float) -> float:
    """Return the stiffness of a step's barrier, as a multiple of the initial one.

    `gap` is the smallest gap at the step's start as a fraction of the contact distance,
    infinite where nothing is near.
    """
    if gap >= STIFFEN_BELOW:
        return 1.0
    ratio = STIFFEN_BELOW / max(gap, 1e-9)
    return min(ratio**0.5, MAX_STIFFENING)
