"""The distributed mesh of the solver, and the map between its numbering and that of the
mesh file.

Every rank also holds the positions of all vertices in the file's order, so that
searches on the pial surface give the same result on every rank and output needs no
further communication.
"""

import os

import basix.ufl
import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from numpy.typing import NDArray

from ..geometry.jacobians import NODES as NODE_COORDINATES
from ..geometry.jacobians import coefficients, jacobians, lower_bounds, shape_slopes
from ..geometry.tetrahedra import (
    NODES_OF_ORDER,
    TetrahedralMesh,
    connected_parts,
    volumes_between,
)
from ..geometry.triangles import Floats, Ints
from ..units import M_PER_MM

# Scotch reads these when it first partitions a mesh; without them runs are not
# reproducible
for name in (
    "SCOTCH_RANDOM_FIXED_SEED",
    "SCOTCH_DETERMINISTIC",
    "SCOTCH_PTHREAD_NUMBER",
):
    os.environ.setdefault(name, "1")

# dolfinx numbers the nodes on edges from the last edge to the first
TO_DOLFINX = {
    1: [0, 1, 2, 3],
    2: [0, 1, 2, 3, 9, 8, 5, 7, 6, 4],
}
FROM_DOLFINX = {order: np.argsort(nodes) for order, nodes in TO_DOLFINX.items()}
GRADIENTS_AT_NODES = shape_slopes(NODE_COORDINATES)


def gather(
    comm: MPI.Comm,
    values: Floats,
    order: Ints,
) -> Floats:
    """Return on every rank the (n, ...) values of all ranks; `order` (n,) has the index
    of each, rank by rank."""
    received = values
    if comm.size > 1:
        received = np.empty((len(order), *values.shape[1:]))
        sizes = comm.allgather(values.size)
        comm.Allgatherv(np.ascontiguousarray(values), (received, sizes))
    result = np.empty_like(received)
    result[order] = received
    return result


def bisect_points(positions: Floats, count: int) -> Ints:
    """Divide (n, 3) points into `count` boxes with nearly equal numbers of points;
    return the box (n,) of each point.

    A box is split across its longest side, in proportion to the counts on both sides,
    and so on (recursive coordinate bisection, Berger and Bokhari 1987).
    """
    box = np.zeros(len(positions), dtype=np.int64)
    # points, the first of the boxes that they are divided into, and how many
    stack: list[tuple[Ints, int, int]] = [(np.arange(len(positions)), 0, count)]
    while stack:
        inside, first, number = stack.pop()
        if number == 1 or not len(inside):
            box[inside] = first
            continue
        axis = np.ptp(positions[inside], axis=0).argmax()
        order = np.argsort(positions[inside, axis], kind="stable")
        inside = inside[order]
        low = number // 2
        cut = len(inside) * low // number
        stack.append((inside[:cut], first, low))
        stack.append(
            (
                inside[cut:],
                first + low,
                number - low,
            )
        )
    return box


class Domain:
    """A tetrahedral mesh distributed over the ranks of a communicator, in metres.

    Here, a vertex is a node of the mesh file: a corner of elements or, in quadratic
    elements (`order` 2), a node on an edge. `mesh` is the updated reference, which
    moves with every step; `space` is that of displacements in m on it.

    For all vertices in the file's order, equal on every rank: `positions` (n, 3) in m,
    the connected `part` of the mesh (n,), and the global node `node_of_vertex` (n,).
    For the local nodes, the first `n_owned` owned and the others ghosts: the vertex
    `vertex_of_node` (k,), and its position, `nodes` (k, 3) in m. For the local
    elements: their nodes in the file's order, `cells` (c, 4) or (c, 10), those at the
    `corners` (c, 4), and their index in the file `tet_of_cell` (c,).
    """

    def __init__(self, comm: MPI.Comm, mesh: TetrahedralMesh) -> None:
        self.comm = comm
        self.positions: Floats = np.array(mesh.vertices) * M_PER_MM
        self.order = mesh.order
        element = basix.ufl.element(
            "Lagrange",
            "tetrahedron",
            self.order,
            shape=(3,),
        )
        # from rank 0, without ghost cells
        n_read = len(mesh.tets) if comm.rank == 0 else 0
        n_points = len(mesh.vertices) if comm.rank == 0 else 0
        self.mesh = dolfinx.mesh.create_mesh(
            comm,
            cells=mesh.tets[:n_read, TO_DOLFINX[self.order]],
            x=self.positions[:n_points],
            e=ufl.Mesh(element),
        )
        self.space = dolfinx.fem.functionspace(
            self.mesh, ("Lagrange", self.order, (3,))
        )
        nodes_of_cells = self.space.dofmap.list
        self.cells = np.ascontiguousarray(nodes_of_cells[:, FROM_DOLFINX[self.order]])
        self.corners = self.cells[:, : NODES_OF_ORDER[1]]
        index_map = self.space.dofmap.index_map
        self.n_owned = index_map.size_local
        n_nodes = self.n_owned + index_map.num_ghosts
        self._geometry_node = np.empty(n_nodes, dtype=np.int64)
        # one array per cell type
        (geometry_nodes,) = self.mesh.geometry.dofmaps
        self._geometry_node[nodes_of_cells.ravel()] = geometry_nodes.ravel()
        vertices = self.mesh.geometry.input_global_indices
        self.vertex_of_node = vertices[self._geometry_node]
        self._shared = dolfinx.la.vector(index_map, 3)
        self.part = connected_parts(mesh)
        self._measure()
        tets = self.mesh.topology.original_cell_index[: len(self.cells)]
        self.tet_of_cell = np.array(tets)
        self._tets = np.concatenate(comm.allgather(self.tet_of_cell))
        owned_vertices = self.vertex_of_node[: self.n_owned]
        self._order = np.concatenate(comm.allgather(owned_vertices))
        self.node_of_vertex = np.empty_like(self._order)
        self.node_of_vertex[self._order] = np.arange(len(self._order))

    def gather(self, owned_values: Floats) -> Floats:
        """Return on every rank the (n, 3) vectors of all vertices from the (n_owned, 3)
        owned ones of each rank."""
        return gather(self.comm, owned_values, self._order)

    def gather_cells(self, cell_values: Floats) -> Floats:
        """Return on every rank the (m, ...) values of all elements in the file's order
        from the local (c, ...) ones."""
        return gather(self.comm, cell_values, self._tets)

    def sum_over_ranks(self, values: Floats) -> Floats:
        """Return on every rank the sum of the ranks' arrays."""
        total = np.empty_like(values, order="C")
        self.comm.Allreduce(np.ascontiguousarray(values), total)
        return total

    def with_ghosts(self, owned: Floats) -> Floats:
        """Return the (k, 3) vectors of the local nodes from the components (3 ·
        n_owned,) of the owned ones."""
        self._shared.array[: len(owned)] = owned
        self._shared.scatter_forward()
        return self._shared.array.reshape(-1, 3).copy()

    def dot(self, a: Floats, b: Floats) -> float:
        """Return the dot product of two distributed vectors, given their owned
        components (3 · n_owned,)."""
        return self.comm.allreduce(float(a @ b))

    def norm(self, owned: Floats) -> float:
        """Return the Euclidean norm of a distributed vector, given its owned
        components."""
        return float(np.sqrt(self.dot(owned, owned)))

    def local(self, values: NDArray) -> NDArray:
        """Return the values of the local nodes from those of all vertices."""
        return values[self.vertex_of_node]

    def owned_rows(self, vertices: Ints) -> tuple[Ints, Ints]:
        """Return the owned nodes (o,) that are among ascending vertices, and their
        places (o,) among these."""
        owned = self.vertex_of_node[: self.n_owned]
        place = np.searchsorted(vertices, owned)
        place = place.clip(max=len(vertices) - 1)
        is_among = vertices[place] == owned
        nodes = np.flatnonzero(is_among)
        return nodes, place[nodes]

    def place(self, positions: Floats) -> None:
        """Move the mesh to (n, 3) positions in m."""
        self.positions = positions
        self._measure()
        self.mesh.geometry.x[self._geometry_node] = self.nodes

    def _measure(self) -> None:
        self.nodes: Floats = self.local(self.positions)
        if self.order == 2:
            self._determinants_at_nodes = jacobians(
                self.nodes, self.cells, GRADIENTS_AT_NODES
            )
            self._upper_bounds = coefficients(self.nodes, self.cells).max(axis=1)

    def volume_ratios(self, u: Floats) -> Floats:
        """Return det F after displacements (k, 3) of the local nodes in m.

        It has one value in a linear element, (c, 1), and one at each node of a
        quadratic one, (c, 10).
        """
        places = self.nodes + u
        if self.order == 1:
            before = volumes_between(self.nodes, self.cells)
            ratios = volumes_between(places, self.cells) / before
            return ratios[:, None]
        after = jacobians(places, self.cells, GRADIENTS_AT_NODES)
        return after / self._determinants_at_nodes

    def smallest_volume_ratio(self, u: Floats) -> float:
        """Return a lower bound of det F after displacements, over the elements of all
        ranks.

        It is positive only if no element is inverted anywhere. In linear elements it is
        the smallest det F. In quadratic ones, where det F varies, it is the ratio of a
        lower bound of the Jacobian determinant after them to an upper bound of that
        before.
        """
        if self.order == 1:
            return self.min_over_ranks(self.volume_ratios(u))
        after = lower_bounds(self.nodes + u, self.cells)
        return self.min_over_ranks(after / self._upper_bounds)

    def min_over_ranks(self, local_values: Floats) -> float:
        """Return the smallest value of all ranks."""
        return self.comm.allreduce(
            float(local_values.min(initial=np.inf)),
            op=MPI.MIN,
        )

    def locate_minimum(
        self,
        values: Floats,
        indices: NDArray,
        positions: Floats,
    ) -> tuple[float, int, Floats]:
        """Return the smallest of the local values over all ranks, with its index in the
        file and its position."""
        smallest = np.inf, -1, np.full(3, np.nan)
        if len(values):
            i = int(values.argmin())
            smallest = float(values[i]), int(indices[i]), positions[i]
        return min(
            self.comm.allgather(smallest),
            key=lambda entry: entry[:2],
        )
