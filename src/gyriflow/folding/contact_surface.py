"""The contact surface: its positions on every rank, and sums over ranks, which each
compute on a part of it.

Each rank owns a compact set of vertices and has a part of the surface: all faces that
can come near its own. A pair of vertices, edges or faces near each other belongs to the
owner of one of its vertices. That rank has all faces at the vertices of the pair, so
that area weights and contributions of several faces are those of the whole surface.
"""

from dataclasses import dataclass

import ipctk
import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from ..geometry.tetrahedra import finer_surface
from ..geometry.triangles import (
    Floats,
    Ints,
    Mask,
    TriangleMesh,
    edges,
    used_part,
)
from ..units import MM_PER_M
from .domain import Domain, gather


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """A rank's part of a surface.

    The (p,) numbers of its vertices in the whole surface, ascending; (f, 3) faces and
    (e, 2) edges by numbers of these, each edge once; and which of its vertices the rank
    owns.
    """

    vertices: Ints
    faces: NDArray[np.int32]
    edges: NDArray[np.int32]
    owned: Mask

    def restrict(self, values: Floats) -> Floats:
        """Return the (p, 3) values at the part's vertices from those of the whole
        surface, in Fortran order."""
        return np.asfortranarray(values[self.vertices])

    def owned_pairs(self, pairs: ipctk.NormalCollisions) -> ipctk.NormalCollisions:
        """Return the pairs that belong to this rank; each pair of the surface belongs
        to one rank.

        The vertex that decides is the lower of two, the one opposite an edge or a face,
        or the lowest of two edges.
        """
        if self.owned.all():
            return pairs
        # as lists, which are faster to index one by one
        owned: list[bool] = list(self.owned)
        lowest: list[int] = list(self.edges[:, 0])
        result = ipctk.NormalCollisions()
        result.use_area_weighting = pairs.use_area_weighting
        result.vv_collisions = [
            pair
            for pair in pairs.vv_collisions
            if owned[min(pair.vertex0_id, pair.vertex1_id)]
        ]
        result.ev_collisions = [
            pair for pair in pairs.ev_collisions if owned[pair.vertex_id]
        ]
        result.ee_collisions = [
            pair
            for pair in pairs.ee_collisions
            if owned[
                min(
                    lowest[pair.edge0_id],
                    lowest[pair.edge1_id],
                )
            ]
        ]
        result.fv_collisions = [
            pair for pair in pairs.fv_collisions if owned[pair.vertex_id]
        ]
        return result


def part_of_surface(
    positions: Floats,
    faces: Ints,
    owned: Mask,
    reach: float,
) -> SurfacePart:
    """Return the part of a surface that has all pairs of the (n,) `owned` vertices.

    `reach` is the largest distance, along the axes, between the two sides of a pair.
    """
    if not owned.all():
        low = positions[faces].min(axis=1)
        high = positions[faces].max(axis=1)
        is_owned = owned[faces].any(axis=1)
        box_low = low[is_owned].min(axis=0) - reach
        box_high = high[is_owned].max(axis=0) + reach
        is_near = ((low <= box_high) & (high >= box_low)).all(axis=1)
        # and the faces that adjoin these, for the areas at their vertices
        is_touched = np.zeros(len(positions), dtype=bool)
        is_touched[faces[is_near]] = True
        faces = faces[is_touched[faces].any(axis=1)]
    part, vertices = used_part(TriangleMesh(positions, faces))
    sides, _ = edges(part)
    return SurfacePart(
        vertices,
        np.asfortranarray(part.faces, dtype=np.int32),
        np.asfortranarray(sides, dtype=np.int32),
        owned[vertices],
    )


class ContactSurface:
    """The pial surface as flat triangles; `facets` (f, 3) are its faces as vertex
    indices of the mesh.

    A face of a quadratic element becomes 16 triangles whose vertices are interpolated
    between its nodes. With only four triangles between the nodes, a uniform pressure
    would give non-uniform nodal forces, and waves as long as an element.

    Attributes: the mesh vertices on the surface, `nodes` (n,); the triangles, `faces`
    (f, 3), by the numbers of the surface's own s vertices; and `weights` (s, n), which
    interpolate from the nodes to these s vertices. The first n of the s vertices are
    the nodes themselves. `local` are the owned nodes (o,) on the surface, `rows` their
    places (o,) among `nodes`.
    """

    def __init__(self, domain: Domain, facets: Ints) -> None:
        self.domain = domain
        self.nodes, faces = np.unique(facets, return_inverse=True)
        faces = faces.reshape(-1, 3)
        self.weights = sparse.eye_array(len(self.nodes)).tocsr()
        if domain.order == 2:
            self.weights, faces = finer_surface(faces)
        self.faces = faces
        self.local, self.rows = domain.owned_rows(self.nodes)
        self._rows_by_rank = domain.comm.allgather(self.rows)
        self._gathered_rows = np.concatenate(self._rows_by_rank)
        self._columns = domain.node_of_vertex[self.nodes]
        self._part: SurfacePart | None = None

    def reference_mm(self) -> Floats:
        """Return the (s, 3) positions in mm of the mesh before the displacement of the
        step."""
        positions = self.domain.positions[self.nodes]
        return np.asarray(self.weights @ positions * MM_PER_M)

    def displacement_mm(self, u: Floats) -> Floats:
        """Return the (s, 3) displacements in mm from those of the local nodes (k, 3) in
        m."""
        nodal = gather(
            self.domain.comm,
            u[self.local],
            self._gathered_rows,
        )
        return np.asarray(self.weights @ nodal * MM_PER_M)

    def nodal_sum(self, part: SurfacePart, values: Floats) -> Floats:
        """Return the (n, 3) sum over all ranks of (p, 3) values on their parts, moved
        to the nodes."""
        self._interpolate(part)
        return self.domain.sum_over_ranks(self._part_weights.T @ values)

    def matrix_sum(
        self, part: SurfacePart, matrix: sparse.csc_matrix | None
    ) -> PETSc.Mat:
        """Return the sum over ranks of their parts' symmetric (3p, 3p) matrices, as a
        matrix of all mesh nodes."""
        comm = self.domain.comm
        rows_for: list[sparse.csr_matrix | None] = [None] * comm.size
        if matrix is not None:
            self._interpolate(part)
            nodal = self._part_to_nodes @ matrix @ self._nodes_to_part
            nodal = sparse.csr_matrix(nodal)
            for rank, nodes in enumerate(self._rows_by_rank):
                components = 3 * nodes[:, None] + np.arange(3)
                rows_for[rank] = nodal[components.ravel()]
        # each rank receives the rows that it owns from all others; its own are not sent
        own = rows_for[comm.rank]
        rows_for[comm.rank] = None
        rows = sparse.csr_matrix((3 * len(self.rows), 3 * len(self.nodes)))
        for block in (own, *comm.alltoall(rows_for)):
            if block is not None:
                rows = rows + block
        counts = np.zeros(
            (self.domain.n_owned, 3),
            dtype=PETSc.IntType,
        )
        counts[self.local] = np.diff(rows.indptr).reshape(-1, 3)
        # PETSc has all owned nodes, in their order; rows of inner ones are empty
        start = np.concatenate([[0], np.cumsum(counts)]).astype(PETSc.IntType)
        node, component = np.divmod(rows.indices, 3)
        columns = (3 * self._columns[node] + component).astype(PETSc.IntType)
        size = (3 * self.domain.n_owned, 3 * len(self.domain.positions))
        result = PETSc.Mat().createAIJ(
            (size, size),
            bsize=3,
            csr=(start, columns, rows.data),
            comm=comm,
        )
        result.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return result

    def _interpolate(self, part: SurfacePart) -> None:
        """Set the matrices between the nodes and a part, unless they are those of the
        last call."""
        if self._part is part:
            return
        self._part = part
        self._part_weights = self.weights[part.vertices]
        components = sparse.kron(
            self._part_weights,
            np.eye(3),
            format="csr",
        )
        # stored by columns like the stiffness, so that products need no conversion
        self._nodes_to_part = components.tocsc()
        self._part_to_nodes = components.T
