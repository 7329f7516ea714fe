"""The tangent of one iterate: what it does to a displacement, and the blocks on its diagonal.

The elastic part has the same places at every iterate. Contact couples other nodes each time and stays a small matrix of
its own. No solver needs all entries in one matrix. Where nothing holds a body, its rigid motions are taken out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

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

    `coupling` is a form with the same sparsity pattern, `add` adds the blocks at a displacement, and `fixed` (owned, 3)
    are the components of the owned nodes whose rows and columns are those of the unit matrix; as an attribute it is
    (all nodes, 3), by global nodes. `products` multiplies. Of the (b,) blocks of the owned rows, row by row, `nodes`
    are the owned nodes, counted on this rank, and `columns` the global ones; `row_ends` (owned + 1,) are the first
    blocks of the rows and the end of the last one.
    """

    def __init__(
        self, coupling: dolfinx.fem.Form, add: Callable[[Floats, MatrixCSR], None], fixed: NDArray[np.bool_]
    ) -> None:
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

    def assemble(self, u: Floats) -> None:
        """Assemble the tangent at a displacement (k, 3) of the local nodes in m."""
        self._blocks.set_value(0.0)
        self._add(u, self._blocks)
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


@dataclass(frozen=True, eq=False)
class Residual:
    """The residual at a displacement (k, 3) of the local nodes in m: owned components (3 · owned,) and their norm in N.

    `elastic` is the part without contributions such as contact, and with a free body's resultant.
    """

    displacement: Floats
    elastic: Floats
    owned: Floats
    norm: float


class LaggedTangent:
    """The elastic tangent, kept from one displacement to the next while it predicts how forces change.

    `lagged` says whether the tangent in use is that of an earlier displacement, `assembled` how often it was assembled.
    """

    def __init__(self, matrix: ElasticMatrix, domain: Domain) -> None:
        self.matrix = matrix
        self.lagged = False
        self.assembled = 0
        self._domain = domain
        self._last: Residual | None = None

    def forget(self) -> None:
        """Have the next tangent assembled, since mesh, stiffness, growth or kept stretch have changed."""
        self._last = None

    def update(self, at: Residual, within: float) -> None:
        """Assemble the tangent at a displacement, unless it `predicts` the elastic forces there to within a part."""
        self.lagged = within > 0 and self.predicts(at, within)
        if not self.lagged:
            self.matrix.assemble(at.displacement)
            self.assembled += 1
        self._last = at

    def predicts(self, at: Residual, within: float) -> bool:
        """Return whether the tangent predicts the change of elastic forces since the last update to within a part."""
        if self._last is None:
            return False
        change = (at.displacement - self._last.displacement)[: self._domain.owned].ravel()
        predicted = np.empty_like(change)
        self.matrix.products.multiply(change, predicted)
        error = predicted + self._last.elastic - at.elastic
        return self._domain.norm(error) <= within * self._domain.norm(predicted)


class Tangent:
    """The tangent of one iterate, which acts on displacements as a PETSc matrix of type python.

    There is one for all iterates: the symmetric `matrix`. Further `parts`, in N/m, have no entries in rows and columns
    of fixed components. `motions` are taken out of all products.
    """

    def __init__(self, elastic: LaggedTangent, domain: Domain) -> None:
        self.elastic = elastic
        self.parts: Sequence[PETSc.Mat] = ()
        self.motions: RigidMotions | None = None
        self._shift: Floats | None = None
        size = 3 * domain.owned, 3 * len(domain.positions)
        self.matrix = PETSc.Mat().createPython((size, size), context=self, comm=domain.comm)
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
