"""The tangent of one iterate: what it does to a displacement, and the blocks on its diagonal.

The elastic part has the same places at every iterate. Contact couples other nodes each time and stays a small matrix of
its own. No solver needs all entries in one matrix. Where nothing holds a body, its rigid motions are taken out.
"""

from collections.abc import Callable, Sequence

import dolfinx
import numpy as np
from dolfinx.la import BlockMode, MatrixCSR
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from ..geometry.triangles import Floats
from .domain import Domain
from .products import PartMotions, SymmetricProducts


def part_arms(positions: Floats, part: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return (n, 3) places from the centres of the parts that (n,) numbers name, over the size of the largest part."""
    counts = np.bincount(part)
    centres = np.stack([np.bincount(part, weights=x) for x in positions.T], axis=1) / np.maximum(counts, 1)[:, None]
    arms = positions - centres[part]
    return np.asarray(arms / np.abs(arms).max(), dtype=np.float32)


def rigid_motions(arms: NDArray[np.float32]) -> Floats:
    """Return the (n, 3, 6) translations of points, and their rotations about centres from which (n, 3) arms lead."""
    motions = np.zeros((len(arms), 3, 6))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        motions[:, i, i] = 1.0
        motions[:, j, 3 + i], motions[:, k, 3 + i] = -arms[:, k], arms[:, j]
    return motions


class RigidMotions:
    """The translations and rotations of the parts of the present mesh that vertices belong to by (n,) numbers."""

    def __init__(self, domain: Domain, part: NDArray[np.int64]) -> None:
        vertices = domain.vertex_of_node[: domain.owned]
        arms, of_part = part_arms(domain.positions, part)[vertices], part[vertices]
        self._domain, self._motions, self._parts = domain, PartMotions(of_part, arms), int(part.max()) + 1
        motions = rigid_motions(arms)
        of_number = [np.where((of_part == number)[:, None, None], motions, 0.0) for number in range(self._parts)]
        self.modes: Floats = np.concatenate(of_number, axis=2).reshape(-1, 6 * self._parts)
        self._inverse_gram = np.linalg.inv(domain.summed(self.modes.T @ self.modes))

    def remove(self, values: Floats) -> None:
        """Take the rigid motions out of the owned components of a vector, in place."""
        amounts = self._domain.summed(self._motions.restrict(values, self._parts))
        self._motions.add(-self._inverse_gram @ amounts, values)


class ElasticMatrix:
    """The elastic tangent as 3 × 3 blocks, which dolfinx holds.

    dolfinx' own block matrices are filled about twice as fast as PETSc's. Of two blocks between nodes of one rank that
    mirror each other, `add` may leave out the one below the diagonal, which nothing reads.

    `coupling` is a form with the same places of entries, which `add` adds at the present displacement, `fixed` (owned,
    3) the components of the owned nodes whose rows and columns are those of the unit matrix; as an attribute it is (all
    nodes, 3), by global nodes. `products` multiplies. Of the (b,) blocks of the owned rows, row by row, `nodes` are the
    owned nodes, counted on this rank, and `columns` the global ones; `row_ends` (owned + 1,) says where each row begins
    and ends.
    """

    def __init__(self, coupling: dolfinx.fem.Form, add: Callable[[MatrixCSR], None], fixed: NDArray[np.bool_]) -> None:
        self._add = add
        self._blocks = dolfinx.fem.create_matrix(coupling, block_mode=BlockMode.compact)
        row_map, column_map = self._blocks.index_map(0), self._blocks.index_map(1)
        owned, first = row_map.size_local, row_map.local_range[0]
        self.row_ends = self._blocks.indptr[: owned + 1]
        self.nodes = np.repeat(np.arange(owned), np.diff(self.row_ends))
        local_columns = self._blocks.indices[: len(self.nodes)]
        self.columns = column_map.local_to_global(local_columns)
        # by global numbers, since the columns reach nodes that no local element has
        self.fixed = np.concatenate(row_map.comm.allgather(fixed))
        rows = first + self.nodes
        self._diagonal = np.flatnonzero(rows == self.columns)
        crossed = self.fixed[rows][:, :, None] | self.fixed[self.columns][:, None, :]
        self._crossed = np.flatnonzero(crossed)
        self._crossed_diagonal = np.einsum("bii->bi", crossed)[self._diagonal]
        # one of two blocks that mirror each other is enough, but where they belong to different ranks
        self._kept = np.flatnonzero((self.columns >= rows) | (local_columns >= owned)).astype(np.int32)
        of_kept = self.nodes[self._kept], local_columns[self._kept]
        self.products = SymmetricProducts(column_map, *of_kept)
        # that and its transpose are the whole
        self._share_of_half = np.where((rows == self.columns) | (local_columns >= owned), 0.5, 1.0)[self._kept]

    def assemble(self) -> None:
        """Assemble the tangent at the present displacement."""
        self._blocks.set_value(0.0)
        self._add(self._blocks)
        self._blocks.scatter_reverse()
        values = self.values
        values.reshape(-1)[self._crossed] = 0.0
        np.einsum("bii->bi", values)[self._diagonal] += self._crossed_diagonal
        self.products.take(values, self._kept)

    def half(self) -> sparse.bsr_matrix:
        """Return the owned rows of a matrix that is the whole one together with its transpose."""
        ends = np.searchsorted(self.nodes[self._kept], np.arange(len(self.row_ends)))
        blocks = self.values[self._kept] * self._share_of_half[:, None, None]
        shape = 3 * (len(self.row_ends) - 1), 3 * len(self.fixed)
        return sparse.bsr_matrix((blocks, self.columns[self._kept], ends), shape=shape)

    @property
    def values(self) -> Floats:
        """The (b, 3, 3) blocks of the owned rows: a view."""
        return self._blocks.data[: 9 * len(self.nodes)].reshape(-1, 3, 3)

    @property
    def diagonal(self) -> Floats:
        """The (owned, 3, 3) blocks on the diagonal."""
        return self.values[self._diagonal]


class KeptTangent:
    """The elastic tangent of a step, kept from one displacement to the next while it predicts how forces change.

    `like` is a vector of the displacement's layout. `kept` says whether the last tangent was that of an earlier
    displacement, `assembled` how often it has been assembled.
    """

    def __init__(self, matrix: ElasticMatrix, like: PETSc.Vec) -> None:
        self.matrix = matrix
        self.kept = False
        self.assembled = 0
        self._valid = False
        # forces last noted; displacement and forces when the tangent was asked for; for products
        self._forces, self._at_u, self._at_forces, self._change, self._product = (like.duplicate() for _ in range(5))

    def forget(self) -> None:
        """Take note that mesh, stiffness, growth or kept stretch have changed: the next tangent is assembled."""
        self._valid = False

    def note_forces(self, forces: PETSc.Vec) -> None:
        """Take note of the elastic forces at the present displacement."""
        forces.copy(self._forces)

    def move_to(self, displacement: PETSc.Vec, within: float) -> None:
        """Make the matrix that of a displacement, unless the kept one is good enough.

        It is good enough where it predicts the change of the forces since the last call with an error of at most a part
        `within`. If `within` is above 0, the forces at this displacement must have been noted last.
        """
        self.kept = within > 0 and self.predicts(displacement, within)
        if not self.kept:
            self.matrix.assemble()
            self.assembled += 1
            self._valid = True
        displacement.copy(self._at_u)
        self._forces.copy(self._at_forces)

    def predicts(self, displacement: PETSc.Vec, within: float) -> bool:
        """Return whether the tangent predicts the change of forces since the last call to within a part."""
        if not self._valid:
            return False
        self._change.waxpy(-1.0, self._at_u, displacement)
        self.matrix.products.multiply(self._change.array_r, self._product.array_w)
        predicted = self._product.norm()
        self._product.axpy(1.0, self._at_forces)
        self._product.axpy(-1.0, self._forces)
        return bool(self._product.norm() <= within * predicted)


class Tangent:
    """The tangent of one iterate, which acts on displacements as a matrix of type python.

    There is one for all iterates: the symmetric `matrix`. `like` is a vector of the displacement's layout. Further
    `parts`, in N/m, have no entries in rows and columns of fixed components. `motions` are taken out of all products.
    """

    def __init__(self, elastic: KeptTangent, like: PETSc.Vec) -> None:
        self.elastic = elastic
        self.parts: Sequence[PETSc.Mat] = ()
        self.motions: RigidMotions | None = None
        self._shift: Floats | None = None
        sizes = like.getSizes()
        self.matrix = PETSc.Mat().createPython((sizes, sizes), context=self, comm=like.comm)
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.matrix.setUp()

    def raise_diagonal(self, part: float) -> None:
        """Add a part of its absolute diagonal to all products from now on; with 0 nothing."""
        self._shift = part * np.abs(np.einsum("nii->ni", self._diagonal())).ravel() if part else None

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the product with x."""
        self.elastic.matrix.products.multiply(x.array_r, y.array_w)
        for part in self.parts:
            part.multAdd(x, y, y)
        if self._shift is not None:
            y.array_w[:] += self._shift * x.array_r
        if self.motions is not None:
            self.motions.remove(y.array_w)

    def diagonal(self) -> Floats:
        """Return the (owned, 3, 3) blocks on the diagonal, as raised."""
        blocks = self._diagonal()
        if self._shift is not None:
            np.einsum("nii->ni", blocks)[:] += self._shift.reshape(-1, 3)
        return blocks

    def _diagonal(self) -> Floats:
        blocks = self.elastic.matrix.diagonal
        for part in self.parts:
            start, columns, values = part.getValuesCSR()
            rows = np.repeat(np.arange(len(start) - 1), np.diff(start))
            columns = columns - part.getOwnershipRange()[0]
            within = rows // 3 == columns // 3
            rows, columns = rows[within], columns[within]
            np.add.at(blocks, (rows // 3, rows % 3, columns % 3), values[within])
        return blocks
