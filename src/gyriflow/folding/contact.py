"""Contact of the pial surface with itself: Incremental Potential Contact (Li et al. 2020), with the IPC Toolkit.

Pairs of surface parts nearer than a distance d̂ repel each other with a barrier that grows without bound as they close
in, and no displacement may cross a pair on its way. Every rank knows where the whole surface is, and looks for the
pairs of its own part (`surface_parts`). Energies, forces and stiffness are sums over the ranks, the smallest gap and
the first touch on a way are the least of any: all decide alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import ipctk
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..errors import MeshError
from ..geometry.tetrahedra import finer_surface
from ..geometry.triangles import Floats, TriangleMesh, edges, mean_length
from ..units import M_PER_MM, MM_PER_M
from .domain import Domain, gathered
from .surface_parts import SearchRange, SurfacePart, part_of_surface, shared_out

DISTANCE_PER_EDGE = 0.2
"""Distance at which contact begins, in mean edge lengths of the surface as it is: well below what the mesh resolves.
As the surface grows, its edges do; a distance that stayed behind would only make contact harder to solve."""
STIFFNESS_PER_MODULUS = 0.1
"""The barrier's stiffness in shear moduli of the cortex. The pressure between folds, some tenths of the modulus, holds
them at about half of the distance then; a stiffer barrier takes more iterations and changes nothing else."""
EDGES_PER_SPACING = {1: 1, 2: 2}
"""Edges of the surface of contact between neighbouring nodes, by the order of the elements."""
CLOSE, WIDE = 0.1, 0.75
"""Parts of the distance: where the smallest gap is below the first, the next step's barrier is twice as stiff, and half
where it is above the second. Stress that is kept presses folds ever harder; a barrier that is too soft for it lets them
so near that Newton's method creeps. A barrier that changes moves what it holds, so it changes only where it must."""
STIFFEST = 1024.0
"""Most that the barrier is made stiffer by."""
BESIDE = 0.999
"""Part of the smallest gap at the start that contact may begin at."""
BARRIER = ipctk.TwoStageBarrier()
MARGIN_MM = 0.05
"""How far the surface may move before pairs that can come near are looked for anew."""
ROOM_MM = 1.0
"""How far it may move before each rank takes its part of the surface anew."""
LONGEST_MM = 8.0
"""Longest way of a vertex in one iteration: a solve that asks for more has gone astray."""
CLOSED = 0.9
"""Part of a gap that a step may close."""
SWEEP = ipctk.AdditiveCCD(conservative_rescaling=CLOSED)
"""Search for the first touch on a way (Li et al. 2021); it leaves a tenth of each pair's distance. Where surfaces meet
flat on, interval bisection, the other choice, takes minutes."""
N_PER_PA_MM2, N_PER_M_PER_PA_MM, J_PER_PA_MM3 = 1e-6, 1e-3, 1e-9


@dataclass(frozen=True, eq=False)
class ContactCache:
    """What is near at a displacement (s, 3) in m of the whole surface.

    That is this rank's part as the IPC Toolkit wants it, its (p, 3) positions in mm, and the pairs of it that are the
    rank's own.
    """

    displacement: Floats
    surface: ipctk.CollisionMesh
    part: SurfacePart
    positions: Floats
    pairs: ipctk.NormalCollisions

    @property
    def gap(self) -> float:
        """The smallest distance in mm between the rank's own pairs, infinite without any."""
        if not len(self.pairs):
            return np.inf
        return float(np.sqrt(self.pairs.compute_minimum_distance(self.surface, self.positions)))


class SelfContact:
    """The barrier between all parts of the pial surface: a contribution to the problem of a step.

    Curved faces are taken as 16 flat triangles each, whose vertices follow the nodes: with the four between the nodes,
    an even pressure would press the nodes unevenly, and quadratic elements would be pressed into waves of their size.

    `displacement` (k, 3) in m of the local nodes is what all methods refer to: the problem's own array; `facets` (f, 3)
    are vertex indices of the file. `stiffness_pa` and `distance_mm` are the barrier's stiffness κ at the start, and the
    distance d̂ below which parts of the surface repel; as attributes they are the present ones. As a distance, None
    takes `DISTANCE_PER_EDGE` of the mean edge length at each step's start, but no more than the smallest gap at the
    start of the run: what does not grow must stay where it is. MeshError where the surface crosses itself at the start.
    """

    def __init__(
        self,
        domain: Domain,
        displacement: Floats,
        facets: NDArray[np.int64],
        stiffness_pa: float,
        distance_mm: float | None = None,
    ) -> None:
        ipctk.set_num_threads(1)  # else threads would be in the way of another rank's
        self.domain = domain
        self.stiffness_pa = self._softest_pa = stiffness_pa
        self._given_mm = distance_mm
        self._displacement = displacement
        self._vertices, faces = np.unique(facets, return_inverse=True)
        faces = faces.reshape(-1, 3)
        # of the nodes at the vertices of the surface of contact
        self._weights = sparse.eye_array(len(self._vertices)).tocsr()
        if domain.order == 2:
            self._weights, faces = finer_surface(faces)
        self._faces = faces
        owned = domain.vertex_of_node[: domain.owned]
        place = np.searchsorted(self._vertices, owned).clip(max=len(self._vertices) - 1)
        self._owned_nodes = np.flatnonzero(self._vertices[place] == owned)
        self._rows_by_rank = domain.comm.allgather(place[self._owned_nodes])
        self._owned_rows = self._rows_by_rank[domain.comm.rank]
        self._gathered_rows = np.concatenate(self._rows_by_rank)
        self._columns = domain.node_of_vertex[self._vertices]
        start = self._weights @ domain.positions[self._vertices] * MM_PER_M
        self._edges = edges(TriangleMesh(start, faces))[0]
        # ranks on different processors may round differently, but each vertex has one owner
        self._owner = domain.comm.bcast(shared_out(start, domain.comm.size), root=0)
        self._broad_phase = ipctk.LBVH()
        self._candidates = ipctk.Candidates()
        self._part_range: SearchRange | None = None
        self._candidates_range: SearchRange | None = None
        self._widest_mm = np.inf
        self.mesh_moved()
        surface, part = self._surface_at(self._start)
        if domain.comm.allreduce(ipctk.has_intersections(surface, part.at(self._start)), op=MPI.LOR):
            raise MeshError(
                "the pial surface of the mesh crosses itself, which contact could not undo",
                remedy="Repair the surface, or mesh with a smaller mesh.envelope_mm.",
            )
        if distance_mm is None:
            gap = self._state_at(np.zeros_like(self._start)).gap
            # rounding must not make a pair of what is just at the limit
            self._widest_mm = BESIDE * domain.comm.allreduce(gap, op=MPI.MIN)
            self.mesh_moved()

    def mesh_moved(self) -> None:
        """Take note of a mesh that has been placed anew: areas weigh the barrier as they are now."""
        self._start = self._weights @ self.domain.positions[self._vertices] * MM_PER_M
        # the same whatever a rank's processor rounds
        spacing = EDGES_PER_SPACING[self.domain.order] * mean_length(self._start, self._edges)
        of_edges = DISTANCE_PER_EDGE * self.domain.comm.bcast(spacing, root=0)
        self.distance_mm = self._given_mm or min(of_edges, self._widest_mm)
        self._barrier = ipctk.BarrierPotential(BARRIER, self.distance_mm, self.stiffness_pa, use_physical_barrier=True)
        self._surface: ipctk.CollisionMesh | None = None
        self._known: ContactCache | None = None

    def adapt(self, rows: Sequence[dict]) -> None:
        """Set the stiffness of the next step from the table of the steps so far; call `mesh_moved` after it."""
        self.stiffness_pa = self._softest_pa
        if not rows:
            return
        row = rows[-1]
        part, last = row["min_distance_mm"] / row["contact_distance_mm"], row["contact_stiffness_pa"]
        if part < CLOSE:
            last = min(2 * last, STIFFEST * self._softest_pa)
        elif not part <= WIDE:  # also where nothing is near
            last = max(last / 2, self._softest_pa)
        self.stiffness_pa = last

    def _on_surface(self, local: Floats) -> Floats:
        return self._weights @ gathered(self.domain.comm, local[self._owned_nodes], self._gathered_rows)

    def _surface_at(self, *places: Floats) -> tuple[ipctk.CollisionMesh, SurfacePart]:
        if self._part_range is None or not self._part_range.at(self.distance_mm, *places):
            way = max(float(np.abs(place - places[0]).max()) for place in places)
            # a single rank's part is the whole surface, wherever it moves
            room = max(ROOM_MM, way) if self.domain.comm.size > 1 else np.inf
            self._part_range = SearchRange(places[0], places[0], self.distance_mm / 2 + room)
            owned = self._owner == self.domain.comm.rank
            self._part = part_of_surface(places[0], self._faces, owned, 2 * self._part_range.reach)
            self._follow = self._weights[self._part.vertices]
            # both stored by columns, as the stiffness is: their product needs no conversion
            follow = sparse.kron(self._follow, np.eye(3), format="csr")
            self._nodes_to_part, self._part_to_nodes = follow.tocsc(), follow.T
            # what is known goes by the numbers of the part before
            self._surface, self._known, self._candidates_range = None, None, None
        if self._surface is None:
            self._surface = ipctk.CollisionMesh(self._part.at(self._start), self._part.edges, self._part.faces)
        return self._surface, self._part

    def _state(self) -> ContactCache:
        return self._state_at(self._on_surface(self._displacement))

    def _state_at(self, u: Floats) -> ContactCache:
        if self._known is None or not np.array_equal(u, self._known.displacement):
            whole = self._start + u * MM_PER_M
            surface, part = self._surface_at(whole)
            if not self._searched(whole):
                surface, part = self._search_on_way(self._start, whole)
            positions = part.at(whole)
            pairs = ipctk.NormalCollisions()
            pairs.use_area_weighting = True
            pairs.build(self._candidates, surface, positions, self.distance_mm)
            self._known = ContactCache(u, surface, part, positions, part.of_own(pairs))
        return self._known

    def joined(self, part: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the numbers (n,) of parts of the mesh, those of parts that touch at the step's start made one."""
        if part.max() == 0:
            return part
        state = self._state_at(np.zeros_like(self._start))
        seen, pairs = state.part, state.pairs
        near = [pairs[i].vertex_ids(seen.edges, seen.faces) for i in range(len(pairs))]
        heaviest = np.asarray(self._weights.argmax(axis=1)).ravel()
        of_vertex = part[self._vertices][heaviest][seen.vertices]
        # the numbers below 0 stand for no vertex
        ends = [of_vertex[[vertex for vertex in pair if vertex >= 0]] for pair in near]
        own_pairs = {(int(two.min()), int(two.max())) for two in ends}
        links = np.array(sorted(set().union(*self.domain.comm.allgather(own_pairs)))).reshape(-1, 2)
        count = int(part.max()) + 1
        graph = sparse.coo_matrix((np.ones(len(links)), links.T), shape=(count, count))
        return connected_components(graph, directed=False)[1][part].astype(np.int64)

    def energy(self) -> float:
        """Return the barrier's energy in J."""
        state = self._state()
        of_rank = float(self._barrier(state.pairs, state.surface, state.positions)) * J_PER_PA_MM3
        return self.domain.comm.allreduce(of_rank)

    def forces(self) -> Floats:
        """Return the (n, 3) derivative of the energy in N at the surface's nodes."""
        state = self._state()
        return self.domain.summed(self._follow.T @ self._own_forces(state))

    def _own_forces(self, state: ContactCache) -> Floats:
        if not len(state.pairs):
            return np.zeros_like(state.positions)
        gradient = self._barrier.gradient(state.pairs, state.surface, state.positions)
        return gradient.reshape(-1, 3) * N_PER_PA_MM2

    def add_residual(self, out: PETSc.Vec) -> None:
        """Add the forces in N to the owned components of a vector."""
        out.array.reshape(-1, 3)[self._owned_nodes] += self.forces()[self._owned_rows]

    def stiffness(self, *, convex: bool = False) -> PETSc.Mat | None:
        """Return the second derivative in N/m, None without any pair; `convex` drops the negative part of each."""
        state, comm = self._state(), self.domain.comm
        if not comm.allreduce(len(state.pairs)):
            return None
        of_rank: sparse.csr_matrix | None = None
        if len(state.pairs):
            kind = ipctk.PSDProjectionMethod.CLAMP if convex else ipctk.PSDProjectionMethod.NONE
            hessian = self._barrier.hessian(state.pairs, state.surface, state.positions, kind) * N_PER_M_PER_PA_MM
            of_rank = sparse.csr_matrix(self._part_to_nodes @ hessian @ self._nodes_to_part)
        return self._distributed(of_rank)

    def _distributed(self, of_pairs: sparse.csr_matrix | None) -> PETSc.Mat:
        comm, components = self.domain.comm, np.arange(3)
        # each rank gets what all have of the rows that it owns
        of_rank = [
            None if of_pairs is None else of_pairs[(3 * rows[:, None] + components).ravel()]
            for rows in self._rows_by_rank
        ]
        kept, of_rank[comm.rank] = of_rank[comm.rank], None
        received = [kept, *comm.alltoall(of_rank)]
        rows = sparse.csr_matrix((3 * len(self._owned_rows), 3 * len(self._vertices)))
        rows = sum((part for part in received if part is not None), rows)
        counts = np.zeros((self.domain.owned, 3), dtype=PETSc.IntType)
        counts[self._owned_nodes] = np.diff(rows.indptr).reshape(-1, 3)
        # owned rows are in the order of the nodes
        start = np.concatenate([[0], np.cumsum(counts.ravel())]).astype(PETSc.IntType)
        vertex, component = np.divmod(rows.indices, 3)
        columns = (3 * self._columns[vertex] + component).astype(PETSc.IntType)
        size = (3 * self.domain.owned, 3 * len(self.domain.positions))
        result = PETSc.Mat().createAIJ((size, size), bsize=3, csr=(start, columns, rows.data), comm=self.domain.comm)
        result.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return result

    def largest_step(self, direction: Floats) -> float:
        """Return the part of (k, 3) local displacements that can be added without any touch on the way."""
        way = self._on_surface(direction) * MM_PER_M
        # what is near a longer way would fill the memory
        part = LONGEST_MM / max(float(np.linalg.norm(way, axis=1).max()), LONGEST_MM)
        return part * self.domain.comm.allreduce(self._free_part(self._state(), part * way), op=MPI.MIN)

    def _free_part(self, state: ContactCache, way: Floats) -> float:
        # what is no pair is farther apart than the distance
        gap = min(self.distance_mm, state.gap)
        if 2 * float(np.linalg.norm(way, axis=1).max()) <= CLOSED * gap:
            return 1.0
        whole = self._start + state.displacement * MM_PER_M
        end = whole + way
        surface, part = self._surface_at(whole, end)
        if not self._searched(whole, end) and np.abs(way).max() <= ROOM_MM:
            # a step's first guess leads nearly to its end, so that this search serves the whole step
            surface, part = self._search_on_way(whole, end)
        ends = part.at(whole), part.at(end)
        if self._searched(whole, end):
            return float(self._candidates.compute_collision_free_stepsize(surface, *ends, narrow_phase_ccd=SWEEP))
        return float(
            ipctk.compute_collision_free_stepsize(surface, *ends, broad_phase=self._broad_phase, narrow_phase_ccd=SWEEP)
        )

    def _searched(self, *places: Floats) -> bool:
        return self._candidates_range is not None and self._candidates_range.at(self.distance_mm, *places)

    def _search_on_way(self, first: Floats, last: Floats) -> tuple[ipctk.CollisionMesh, SurfacePart]:
        surface, part = self._surface_at(first, last)
        reach = self.distance_mm / 2 + MARGIN_MM
        self._candidates_range = SearchRange(first, last, reach)
        self._candidates.build(surface, part.at(first), part.at(last), reach, self._broad_phase)
        return surface, part

    def smallest_distance_mm(self) -> float:
        """Return the smallest distance between parts of the surface that do not adjoin, infinite if none is near."""
        return self.domain.comm.allreduce(self._state().gap, op=MPI.MIN)

    def pair_count(self) -> int:
        """Return the number of pairs within the distance."""
        return self.domain.comm.allreduce(len(self._state().pairs))

    def pressure(self) -> Floats:
        """Return the (n,) contact pressure in Pa at all vertices of the file, 0 off the surface: force per area."""
        state = self._state()
        forces, areas = np.zeros_like(self._start), np.zeros(len(self._start))
        forces[state.part.vertices] = self._own_forces(state)
        # all faces at a vertex are in its owner's part alone
        owned = state.part.owned
        areas[state.part.vertices[owned]] = np.array(state.surface.vertex_areas)[owned] * M_PER_MM**2
        values = np.zeros(len(self.domain.positions))
        # nodes are the first vertices of the surface of contact
        pressure = np.linalg.norm(self.domain.summed(forces), axis=1) / self.domain.summed(areas)
        values[self._vertices] = pressure[: len(self._vertices)]
        return values
