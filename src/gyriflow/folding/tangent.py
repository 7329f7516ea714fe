"""The tangent of one iterate in the forms that solvers want: for products, for smoothing, and as a whole.

The elastic part has the same places at every iterate and is kept in forms that are fast to fill. Contact couples other
nodes each time: it stays a small matrix of its own, and joins the other only where a solver needs all entries.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from petsc4py import PETSc

from .versions import keeps_old_inverses

NODES_PER_TERM = {1: 4, 2: 12}
"""Nodes that a single term of a contribution couples at most, by the order of the elements: a corner and a face, or two
edges, of which each vertex follows the six nodes of a curved face."""


class SumOperator:
    """The sum of a matrix and of further ones, which change, for a PETSc matrix of type python."""

    def __init__(self, matrix: PETSc.Mat) -> None:
        self.matrix = matrix
        self.parts: Sequence[PETSc.Mat] = ()

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Sets y to the product of the sum with x."""
        self.matrix.mult(x, y)
        for part in self.parts:
            part.multAdd(x, y, y)

    def as_matrix(self) -> PETSc.Mat:
        """Returns the PETSc matrix that acts like this, symmetric."""
        matrix = PETSc.Mat().createPython(self.matrix.getSizes(), context=self, comm=self.matrix.comm)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setUp()
        return matrix


class Tangent:
    """The tangent of one iterate; good until the next one is assembled.

    Parameters
    ----------
    matrix
        The elastic part, stored by rows; its block diagonal is raised by the parts'.
    products
        What acts like the whole tangent, with fast products.
    parts
        Further parts in N/m, without entries in rows and columns of fixed components.
    nodes_per_term
        Nodes that a single term of a part couples at most.

    Attributes
    ----------
    products : PETSc.Mat
        As given.
    smoothing : PETSc.Mat
        A matrix whose block diagonal bounds the tangent as Jacobi's smoother needs it: a positive semidefinite term
        that couples k nodes is at most k times its own block diagonal. The negative part of each is left out.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        products: PETSc.Mat,
        parts: Sequence[PETSc.Mat],
        nodes_per_term: int = NODES_PER_TERM[1],
    ) -> None:
        self._nodes_per_term = nodes_per_term
        self.products = products
        self.smoothing = matrix
        self._raised: list[tuple[np.ndarray, np.ndarray]] = []
        self.set_parts(parts)

    def set_parts(self, parts: Sequence[PETSc.Mat]) -> None:
        """Takes other parts in the place of those there are; what acts like the whole must know of them already."""
        if self._raised and keeps_old_inverses():
            self.smoothing = self.smoothing.copy()
        for nodes, blocks in self._raised:
            add_block_diagonal(self.smoothing, nodes, -blocks)
        self._parts = parts
        self._raised = [raising(part, self._nodes_per_term) for part in parts]
        self._whole = None if parts else self.smoothing
        for nodes, blocks in self._raised:
            add_block_diagonal(self.smoothing, nodes, blocks)

    def whole(self) -> PETSc.Mat:
        """Returns the matrix with all entries, stored by rows."""
        if self._whole is None:
            # a copy: entries in new places would break the form in which the elastic part is filled
            self._whole = self.smoothing.copy()
            for part, (nodes, blocks) in zip(self._parts, self._raised, strict=True):
                add_block_diagonal(self._whole, nodes, -blocks)
                self._whole.axpy(1.0, part, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
            self._whole.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return self._whole

    @contextmanager
    def raised(self, part: float) -> Iterator[None]:
        """Raises the diagonal of the whole by a part of its absolute values for the time of the block."""
        if not part:
            yield
            return
        matrix = self.whole()
        # a copy: PETSc may have kept the inverses of the diagonal's blocks
        self._whole = matrix.copy()
        self._whole.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        diagonal = matrix.getDiagonal()
        raised = diagonal.copy()
        raised.abs()
        raised.aypx(part, diagonal)
        self._whole.setDiagonal(raised)
        raised.destroy()
        diagonal.destroy()
        try:
            yield
        finally:
            self._whole.destroy()
            self._whole = matrix


def block_diagonal(matrix: PETSc.Mat) -> tuple[np.ndarray, np.ndarray]:
    """Returns the owned global nodes that have entries on their diagonal, (b,), and their (b, 3, 3) blocks."""
    start, columns, values = matrix.getValuesCSR()
    first = matrix.getOwnershipRange()[0]
    rows = first + np.repeat(np.arange(len(start) - 1), np.diff(start))
    own = rows // 3 == columns // 3
    nodes, place = np.unique(rows[own] // 3, return_inverse=True)
    blocks = np.zeros((len(nodes), 3, 3))
    blocks[place, rows[own] % 3, columns[own] % 3] = values[own]
    return nodes.astype(PETSc.IntType), blocks


def raising(matrix: PETSc.Mat, nodes_per_term: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns what is to be added to a block diagonal for a further matrix: nodes, and positive semidefinite blocks."""
    nodes, blocks = block_diagonal(matrix)
    values, directions = np.linalg.eigh((blocks + blocks.swapaxes(1, 2)) / 2)
    positive = nodes_per_term * np.maximum(values, 0.0)
    return nodes, np.einsum("bij,bj,bkj->bik", directions, positive, directions)


def add_block_diagonal(matrix: PETSc.Mat, nodes: np.ndarray, blocks: np.ndarray) -> None:
    """Adds (b, 3, 3) blocks on the diagonal at (b,) owned global nodes, where the matrix has entries already."""
    ends = np.arange(len(nodes) + 1, dtype=PETSc.IntType)
    matrix.setValuesBlockedIJV(ends, nodes, blocks, addv=PETSc.InsertMode.ADD_VALUES, rowmap=nodes)
    matrix.assemble()
