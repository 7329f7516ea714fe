"""The tangent of an iterate: its products with displacements, and the blocks on its
diagonal.

The elastic part has the same sparsity pattern at every iterate. Contact couples other
nodes each time and is a small matrix of its own; no solver needs all entries in one
matrix. In a free body, which no support holds, rigid motions are removed from all
products (inertia relief).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import dolfinx
import numpy as np
from dolfinx.la import BlockMode, MatrixCSR
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from ..geometry.triangles import Floats, Ints, Mask
from .domain import Domain
from .products import PartMotions, SymmetricProducts


def part_arms(positions: Floats, part: Ints) -> NDArray[np.float32]:
    """Return (n, 3) positions relative to the centres of their parts (n,), divided by
    the largest component of all."""
    sums = []
    for coordinates in positions.T:
        sums.append(np.bincount(part, coordinates))
    counts = np.maximum(np.bincount(part), 1)
    centres = np.stack(sums, axis=1) / counts[:, None]
    arms = positions - centres[part]
    longest = np.abs(arms).max()
    return np.asarray(arms / longest, dtype=np.float32)


def rigid_motions(arms: NDArray[np.float32]) -> Floats:
    """Return the (n, 3, 6) translations of points and their rotations about centres,
    from (n, 3) arms."""
    motions = np.zeros((len(arms), 3, 6))
    for axis in range(3):
        second = (axis + 1) % 3
        third = (axis + 2) % 3
        rotation = 3 + axis
        motions[:, axis, axis] = 1.0
        motions[:, second, rotation] = -arms[:, third]
        motions[:, third, rotation] = arms[:, second]
    return motions


class RigidMotions:
    """Translations and rotations of parts of the mesh, where it is now; `part` (n,) is
    the part of each vertex."""

    def __init__(self, domain: Domain, part: Ints) -> None:
        self._domain = domain
        self._parts = int(part.max()) + 1
        owned = domain.vertex_of_node[: domain.n_owned]
        own_arms = part_arms(domain.positions, part)[owned]
        own_part = part[owned]
        self._motions = PartMotions(own_part, own_arms)
        # six columns for each part, zero elsewhere
        node = np.arange(len(owned))
        modes = np.zeros(
            (
                len(owned),
                3,
                self._parts,
                6,
            )
        )
        modes[node, :, own_part] = rigid_motions(own_arms)
        self.modes: Floats = modes.reshape(-1, 6 * self._parts)
        gram = domain.sum_over_ranks(self.modes.T @ self.modes)
        self._inverse_gram = np.linalg.inv(gram)

    def remove(self, values: Floats) -> None:
        """Remove the rigid motions from the owned components of a vector, in place."""
        own = self._motions.restrict(values, self._parts)
        amounts = self._domain.sum_over_ranks(own)
        self._motions.add(-self._inverse_gram @ amounts, values)


class ElasticMatrix:
    """The elastic tangent as 3 × 3 blocks, in a matrix of dolfinx, which is filled
    twice as fast as PETSc's.

    Blocks below the diagonal between owned nodes are not read, since the matrix is
    symmetric; `add` may omit them.

    `coupling` is a form with the same sparsity pattern, `add` adds the blocks at a
    displacement, and `fixed` (owned, 3) is the mask of the owned nodes' components
    whose rows and columns are those of the unit matrix. The attribute `fixed` (all
    nodes, 3) is the same for all global nodes. `products` multiplies the matrix with
    vectors. The (b,) blocks of the owned rows are stored row by row: `nodes` are their
    rows, as local nodes, `columns` their columns, as global nodes; `row_ends` (owned +
    1,) are the first block of each row and the end of the last one.
    """

    def __init__(
        self,
        coupling: dolfinx.fem.Form,
        add: Callable[[Floats, MatrixCSR], None],
        fixed: Mask,
    ) -> None:
        self._add = add
        self._blocks = dolfinx.fem.create_matrix(coupling, block_mode=BlockMode.compact)
        row_map = self._blocks.index_map(0)
        column_map = self._blocks.index_map(1)
        n_owned = row_map.size_local
        first_row, _ = row_map.local_range
        self.row_ends = self._blocks.indptr[: n_owned + 1]
        self.nodes = np.repeat(
            np.arange(n_owned),
            np.diff(self.row_ends),
        )
        local_columns = self._blocks.indices[: len(self.nodes)]
        self.columns = column_map.local_to_global(local_columns)
        # by global nodes, since columns include nodes of other ranks' elements
        self.fixed = np.concatenate(row_map.comm.allgather(fixed))
        rows = first_row + self.nodes
        is_diagonal = rows == self.columns
        is_ghost = local_columns >= n_owned
        self._diagonal = np.flatnonzero(is_diagonal)
        has_fixed_row = self.fixed[rows][:, :, None]
        has_fixed_column = self.fixed[self.columns][:, None, :]
        is_fixed = has_fixed_row | has_fixed_column
        self._fixed_entries = np.flatnonzero(is_fixed)
        node, component = np.nonzero(fixed)
        self._fixed_diagonal = 9 * self._diagonal[node] + 4 * component
        # without the mirror images of blocks within a rank
        stored = np.flatnonzero((self.columns >= rows) | is_ghost)
        self._stored = stored.astype(np.int32)
        self.products = SymmetricProducts(
            column_map, self.nodes[stored], local_columns[stored]
        )
        # so that these blocks and their transposes add up to the matrix
        self._half_weights = np.where(is_diagonal | is_ghost, 0.5, 1.0)[stored]

    def assemble(self, u: Floats) -> None:
        """Assemble the tangent at a displacement (k, 3) of the local nodes in m."""
        self._blocks.set_value(0.0)
        self._add(u, self._blocks)
        self._blocks.scatter_reverse()
        values = self.values
        entries = values.reshape(-1)
        entries[self._fixed_entries] = 0.0
        entries[self._fixed_diagonal] = 1.0
        self.products.take(values, self._stored)

    def half(self) -> sparse.bsr_matrix:
        """Return the owned rows of a matrix that adds up to this one with its
        transpose."""
        stored = self._stored
        n_rows = len(self.row_ends) - 1
        rows = self.nodes[stored]
        columns = self.columns[stored]
        ends = np.searchsorted(rows, np.arange(n_rows + 1))
        blocks = self.values[stored] * self._half_weights[:, None, None]
        shape = (3 * n_rows, 3 * len(self.fixed))
        return sparse.bsr_matrix((blocks, columns, ends), shape=shape)

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
    """The residual at a displacement (k, 3) of the local nodes in m: `owned` components
    (3 · n_owned,) and norm in N.

    `elastic` are the forces of the elements alone; in a free body, their resultant is
    not removed.
    """

    displacement: Floats
    elastic: Floats
    owned: Floats
    norm: float


class LaggedTangent:
    """The elastic tangent, kept from one displacement to the next while it predicts how
    forces change.

    It is `lagged` while the tangent in use is that of an earlier displacement;
    `assembled` counts assemblies.
    """

    def __init__(self, matrix: ElasticMatrix, domain: Domain) -> None:
        self.matrix = matrix
        self.lagged = False
        self.assembled = 0
        self._domain = domain
        self._last: Residual | None = None

    def forget(self) -> None:
        """Require that the next tangent is assembled, since mesh, stiffness, growth or
        stretch have changed."""
        self._last = None

    def update(self, at: Residual, within: float) -> None:
        """Assemble the tangent at a displacement, unless it `predicts` the elastic
        forces there."""
        self.lagged = within > 0 and self.predicts(at, within)
        if not self.lagged:
            self.matrix.assemble(at.displacement)
            self.assembled += 1
        self._last = at

    def predicts(self, at: Residual, within: float) -> bool:
        """Return whether it predicts how elastic forces changed since the last update,
        to a relative error `within`."""
        if self._last is None:
            return False
        change = at.displacement - self._last.displacement
        change = change[: self._domain.n_owned].ravel()
        predicted = np.empty_like(change)
        self.matrix.products.multiply(change, predicted)
        error = predicted + self._last.elastic - at.elastic
        return self._domain.norm(error) <= within * self._domain.norm(predicted)


class Tangent:
    """The tangent of one iterate, which acts on displacements as a PETSc matrix of type
    python.

    All iterates share one symmetric `matrix`. Further `parts`, in N/m, have no entries
    in rows and columns of fixed components. `motions` are removed from all products.
    """

    def __init__(self, elastic: LaggedTangent, domain: Domain) -> None:
        self.elastic = elastic
        self.parts: Sequence[PETSc.Mat] = ()
        self.motions: RigidMotions | None = None
        self._shift: Floats | None = None
        size = 3 * domain.n_owned, 3 * len(domain.positions)
        self.matrix = PETSc.Mat().createPython(
            (size, size), context=self, comm=domain.comm
        )
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.matrix.setUp()

    def shift_diagonal(self, part: float) -> None:
        """Shift the diagonal by a fraction of its absolute values in all further
        products; 0 removes the shift."""
        self._shift = None
        if part:
            self._shift = part * np.abs(_diagonals(self._diagonal())).ravel()

    def mult(
        self,
        _: PETSc.Mat,
        x: PETSc.Vec,
        y: PETSc.Vec,
    ) -> None:
        """Set y to the product with x."""
        self.elastic.matrix.products.multiply(x.array_r, y.array_w)
        for part in self.parts:
            part.multAdd(x, y, y)
        if self._shift is not None:
            y.array_w[:] += self._shift * x.array_r
        if self.motions is not None:
            self.motions.remove(y.array_w)

    def diagonal(self) -> Floats:
        """Return the (n_owned, 3, 3) blocks on the diagonal, with the shift."""
        blocks = self._diagonal()
        if self._shift is not None:
            _diagonals(blocks)[:] += self._shift.reshape(-1, 3)
        return blocks

    def _diagonal(self) -> Floats:
        blocks = self.elastic.matrix.diagonal
        for part in self.parts:
            start, columns, values = part.getValuesCSR()
            first_row, _ = part.getOwnershipRange()
            row = np.repeat(
                np.arange(len(start) - 1),
                np.diff(start),
            )
            node, component = np.divmod(row, 3)
            other_node, other_component = np.divmod(columns - first_row, 3)
            is_diagonal = node == other_node
            entries = node, component, other_component
            entries = tuple(numbers[is_diagonal] for numbers in entries)
            np.add.at(blocks, entries, values[is_diagonal])
        return blocks


def _diagonals(blocks: NDArray) -> NDArray:
    """Return the (n, 3) diagonals of (n, 3, 3) blocks: a view, that can be set."""
    return np.einsum("nii->ni", blocks)
