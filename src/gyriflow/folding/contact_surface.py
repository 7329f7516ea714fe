"""The contact surface: its positions on every rank, and sums over ranks, which each compute on a part of it."""

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from ..geometry.tetrahedra import finer_surface
from ..geometry.triangles import Floats
from ..units import MM_PER_M
from .domain import Domain, gather
from .surface_parts import SurfacePart


class ContactSurface:
    """The pial surface as flat triangles; `facets` (f, 3) are its faces as vertex indices of the mesh.

    A face of a quadratic element becomes 16 triangles whose vertices are interpolated between its nodes. With only four
    triangles between the nodes, a uniform pressure would give non-uniform nodal forces, and waves as long as an
    element.

    Attributes: the mesh vertices on the surface, `nodes` (n,); the triangles, `faces` (f, 3), by the numbers of the
    surface's own s vertices; and `weights` (s, n), which interpolate from the nodes to these s vertices. The first n of
    the s vertices are the nodes themselves.
    """

    def __init__(self, domain: Domain, facets: NDArray[np.int64]) -> None:
        self.domain = domain
        self.nodes, faces = np.unique(facets, return_inverse=True)
        faces = faces.reshape(-1, 3)
        self.weights = sparse.eye_array(len(self.nodes)).tocsr()
        if domain.order == 2:
            self.weights, faces = finer_surface(faces)
        self.faces = faces
        owned = domain.vertex_of_node[: domain.n_owned]
        place = np.searchsorted(self.nodes, owned).clip(max=len(self.nodes) - 1)
        self._local = np.flatnonzero(self.nodes[place] == owned)
        self._rows_by_rank = domain.comm.allgather(place[self._local])
        self._rows = self._rows_by_rank[domain.comm.rank]
        self._gathered_rows = np.concatenate(self._rows_by_rank)
        self._columns = domain.node_of_vertex[self.nodes]
        self._part: SurfacePart | None = None

    def reference_mm(self) -> Floats:
        """Return the (s, 3) positions in mm of the mesh before the displacement of the step."""
        return np.asarray(self.weights @ self.domain.positions[self.nodes] * MM_PER_M)

    def displacement_mm(self, u: Floats) -> Floats:
        """Return the (s, 3) displacements in mm from those of the local nodes (k, 3) in m."""
        return np.asarray(self.weights @ gather(self.domain.comm, u[self._local], self._gathered_rows) * MM_PER_M)

    def nodal_sum(self, part: SurfacePart, values: Floats) -> Floats:
        """Return the (n, 3) sum over all ranks of (p, 3) values on their parts, moved to the nodes."""
        self._interpolate(part)
        return self.domain.sum_over_ranks(self._part_weights.T @ values)

    def add_to(self, out: Floats, nodal: Floats) -> None:
        """Add (n, 3) values at the nodes to the owned components (3 · n_owned,) of a vector."""
        out.reshape(-1, 3)[self._local] += nodal[self._rows]

    def matrix_sum(self, part: SurfacePart, matrix: sparse.csc_matrix | None) -> PETSc.Mat:
        """Return the sum over ranks of their parts' symmetric (3p, 3p) matrices, as a matrix of all mesh nodes."""
        comm, components = self.domain.comm, np.arange(3)
        rows_for: list[sparse.csr_matrix | None] = [None] * comm.size
        if matrix is not None:
            self._interpolate(part)
            nodal = sparse.csr_matrix(self._part_to_nodes @ matrix @ self._nodes_to_part)
            rows_for = [nodal[(3 * rows[:, None] + components).ravel()] for rows in self._rows_by_rank]
        # each rank receives the rows that it owns from all others
        own, rows_for[comm.rank] = rows_for[comm.rank], None
        received = [own, *comm.alltoall(rows_for)]
        rows = sparse.csr_matrix((3 * len(self._rows), 3 * len(self.nodes)))
        rows = sum((block for block in received if block is not None), rows)
        counts = np.zeros((self.domain.n_owned, 3), dtype=PETSc.IntType)
        counts[self._local] = np.diff(rows.indptr).reshape(-1, 3)
        # owned rows are in the order of the nodes
        start = np.concatenate([[0], np.cumsum(counts.ravel())]).astype(PETSc.IntType)
        node, component = np.divmod(rows.indices, 3)
        columns = (3 * self._columns[node] + component).astype(PETSc.IntType)
        size = (3 * self.domain.n_owned, 3 * len(self.domain.positions))
        result = PETSc.Mat().createAIJ((size, size), bsize=3, csr=(start, columns, rows.data), comm=comm)
        result.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return result

    def _interpolate(self, part: SurfacePart) -> None:
        """Set the matrices between the nodes and a part, unless they are those of the last call."""
        if self._part is not part:
            self._part, self._part_weights = part, self.weights[part.vertices]
            components = sparse.kron(self._part_weights, np.eye(3), format="csr")
            # stored by columns like the stiffness, so that products need no conversion
            self._nodes_to_part, self._part_to_nodes = components.tocsc(), components.T
