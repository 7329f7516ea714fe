"""The distributed mesh of the solver, and the way between its numbering and that of the mesh file.

Every rank also holds the positions of all vertices in the file's order: searches on the pial surface then give the same
answer on every rank, and output needs no further communication.
"""

import basix.ufl
import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, connected_parts, volumes_between
from ..units import M_PER_MM

Floats = NDArray[np.float64]


class Domain:
    """A tetrahedral mesh spread over the ranks of a communicator, in metres.

    Attributes
    ----------
    mesh : dolfinx.mesh.Mesh
        The updated reference: moves with every step.
    space : dolfinx.fem.FunctionSpace
        Continuous piecewise linear vectors: the displacement in m.
    positions : (n, 3) float
        Positions of all vertices in m, in the file's order, equal on every rank.
    vertex_of_node : (k,) int
        File index of each local node (owned nodes first, then ghosts).
    owned : int
        Number of owned nodes.
    cells : (c, 4) int
        Local nodes of the local elements.
    part : (n,) int
        The connected part of the mesh that each vertex belongs to, equal on every rank.
    tet_of_cell : (c,) int
        File index of each local element.
    volumes : (c,) float
        Volumes of the local elements in m³.
    node_of_vertex : (n,) int
        The global node of each vertex: rank by rank, owned nodes in their order.
    """

    def __init__(self, comm: MPI.Comm, mesh: TetrahedralMesh) -> None:
        self.comm = comm
        self.positions: Floats = np.array(mesh.vertices) * M_PER_MM
        element = basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,))
        cells = mesh.tets if comm.rank == 0 else np.empty((0, 4), dtype=np.int64)
        points = self.positions if comm.rank == 0 else np.empty((0, 3))
        # by keywords, whose order changed between versions; without ghost cells, the default in all of them
        self.mesh = dolfinx.mesh.create_mesh(comm, cells=cells, x=points, e=ufl.Mesh(element))
        self.space = dolfinx.fem.functionspace(self.mesh, ("Lagrange", 1, (3,)))
        self.cells = self.space.dofmap.list
        self.owned = self.space.dofmap.index_map.size_local
        nodes = self.owned + self.space.dofmap.index_map.num_ghosts
        self._geometry_node = np.empty(nodes, dtype=np.int64)
        self._geometry_node[self.cells.ravel()] = self.mesh.geometry.dofmap.ravel()
        self.vertex_of_node = self.mesh.geometry.input_global_indices[self._geometry_node]
        self.part = connected_parts(mesh)
        self._counts = [3 * owned for owned in comm.allgather(self.owned)]
        self.volumes = self.cell_volumes(self.local(self.positions))
        self.tet_of_cell = np.array(self.mesh.topology.original_cell_index[: len(self.cells)])
        self._cell_counts = comm.allgather(len(self.cells))
        self._tets = np.concatenate(comm.allgather(self.tet_of_cell))
        self._order = np.concatenate(comm.allgather(self.vertex_of_node[: self.owned]))
        self.node_of_vertex = np.empty_like(self._order)
        self.node_of_vertex[self._order] = np.arange(len(self._order))

    def gathered(self, owned_values: Floats) -> Floats:
        """Returns on every rank the (n, 3) vectors of all vertices from the owned (owned, 3) ones of each."""
        received = np.empty((len(self._order), 3))
        self.comm.Allgatherv(np.ascontiguousarray(owned_values), (received, self._counts))
        values = np.empty_like(received)
        values[self._order] = received
        return values

    def gathered_cells(self, cell_values: Floats) -> Floats:
        """Returns on every rank the (m, k) values of all elements, in the file's order, from the local (c, k) ones."""
        width = cell_values.shape[1]
        received = np.empty((len(self._tets), width))
        counts = [width * count for count in self._cell_counts]
        self.comm.Allgatherv(np.ascontiguousarray(cell_values), (received, counts))
        values = np.empty_like(received)
        values[self._tets] = received
        return values

    def local(self, values: NDArray) -> NDArray:
        """Returns the values of the local nodes from those of all vertices."""
        return values[self.vertex_of_node]

    def place(self, positions: Floats) -> None:
        """Moves the mesh to (n, 3) positions in m."""
        self.positions = positions
        nodes = self.local(positions)
        self.mesh.geometry.x[self._geometry_node] = nodes
        self.volumes = self.cell_volumes(nodes)

    def cell_volumes(self, node_positions: Floats) -> Floats:
        """Returns the signed volumes in m³ of the local elements for (k, 3) positions of the local nodes."""
        return volumes_between(node_positions, self.cells)

    def minimum(self, local_values: Floats) -> float:
        """Returns the smallest value over all ranks."""
        return self.comm.allreduce(float(local_values.min(initial=np.inf)), op=MPI.MIN)

    def least(self, values: Floats, numbers: NDArray, places: Floats) -> tuple[float, int, Floats]:
        """Returns the smallest of the local values over all ranks, with its number in the file and its place."""
        found = (np.inf, -1, np.full(3, np.nan))
        if len(values):
            i = int(values.argmin())
            found = (float(values[i]), int(numbers[i]), places[i])
        return min(self.comm.allgather(found), key=lambda entry: entry[:2])

    def local_facets(self, facets: NDArray[np.int64], tags: NDArray[np.int64]) -> dolfinx.mesh.MeshTags:
        """Returns the tags of boundary facets, given as vertex indices of the file, on the local facets."""
        topology = self.mesh.topology
        topology.create_entities(2)
        topology.create_connectivity(2, 3)
        local = dolfinx.mesh.exterior_facet_indices(topology)
        nodes = dolfinx.mesh.entities_to_geometry(self.mesh, 2, local).reshape(-1, 3)
        names = np.sort(self.mesh.geometry.input_global_indices[nodes], axis=1)
        count = len(self.positions)
        weights = np.array([count * count, count, 1], dtype=np.int64)
        known = np.sort(facets, axis=1) @ weights
        order = np.argsort(known)
        wanted = names @ weights
        place = order[np.minimum(np.searchsorted(known, wanted, sorter=order), len(order) - 1)]
        if (known[place] != wanted).any():
            raise ValueError("the facets are not the boundary of the mesh")
        return dolfinx.mesh.meshtags(self.mesh, 2, local, tags[place].astype(np.int32))
