"""The tangent of one iterate in the forms that solvers want: for products, for smoothing, and as a whole.

The elastic part has the same places at every iterate and is kept in forms that are fast to fill. Contact couples other
nodes each time: it stays a small matrix of its own, and joins the other only where a solver needs all entries.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import dolfinx
import numpy as np
from petsc4py import PETSc

from .block_matrix import BlockMatrix
from .rigid import RigidMotions
from .versions import keeps_old_inverses

NODES_PER_TERM = {1: 4, 2: 12}
"""Nodes that a single term of a contribution couples at most, by the order of the elements: a corner and a face, or two
edges, of which each vertex follows the six nodes of a curved face."""


class Operator:
    """The action of a sum of matrices, less the rigid part of the product where the body is unconstrained.

    `parts` are the matrices, at least one, which change; `matrix` acts as their sum: one object for all iterates, since
    multigrid keeps the first it is given. `like` is a vector of their layout.
    """

    def __init__(self, like: PETSc.Vec) -> None:
        self.parts: Sequence[PETSc.Mat] = ()
        self._like = like
        self._motions: RigidMotions | None = None
        sizes = like.getSizes()
        self.matrix = PETSc.Mat().createPython((sizes, sizes), context=self, comm=like.comm)
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.matrix.setUp()

    def remove(self, motions: RigidMotions) -> None:
        """Has rigid motions taken out of all products from now on; they become the matrix' null space."""
        self._motions = motions
        self.matrix.setNullSpace(motions.null_space(self._like))

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Sets y to the product with x."""
        self.parts[0].mult(x, y)
        for part in self.parts[1:]:
            part.multAdd(x, y, y)
        if self._motions is not None:
            self._motions.remove(y.array_w)


class KeptTangent:
    """The elastic tangent of a step, kept from one displacement to the next while it predicts how forces change.

    It is assembled into `blocks` by its form; `kept` says whether the last one was that of an earlier displacement.
    """

    def __init__(self, blocks: BlockMatrix, form: dolfinx.fem.Form, like: PETSc.Vec) -> None:
        self.kept = False
        self._blocks, self._form = blocks, form
        self._known: tuple[PETSc.Mat, PETSc.Mat] | None = None
        # forces last noted; displacement and forces when the tangent was asked for; for products
        self._forces, self._at_u, self._at_forces, self._change, self._product = (like.duplicate() for _ in range(5))

    def forget(self) -> None:
        """Takes note that mesh, stiffness, growth or kept stretch have changed: the next tangent is assembled."""
        self._known = None

    def note_forces(self, forces: PETSc.Vec) -> None:
        """Takes note of the elastic forces at the present displacement."""
        forces.copy(self._forces)

    def at(self, displacement: PETSc.Vec, within: float) -> tuple[PETSc.Mat, PETSc.Mat]:
        """Returns the tangent as a whole and for products: the kept one where that is good enough.

        It is good enough where it predicts the change of the forces since the last call with an error of at most a part
        `within`. If `within` is above 0, the forces at this displacement must have been noted last.
        """
        self.kept = self._known is not None and within > 0 and self.predicts(displacement, within)
        if self._known is None or not self.kept:
            self._known = self.assembled()
        displacement.copy(self._at_u)
        self._forces.copy(self._at_forces)
        return self._known

    def predicts(self, displacement: PETSc.Vec, within: float) -> bool:
        """Returns whether the known tangent predicts the change of forces since the last call to within a part."""
        if self._known is None:
            return False
        self._change.waxpy(-1.0, self._at_u, displacement)
        self._known[1].mult(self._change, self._product)
        predicted = self._product.norm()
        self._product.axpy(1.0, self._at_forces)
        self._product.axpy(-1.0, self._forces)
        return bool(self._product.norm() <= within * predicted)

    def assembled(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        """Returns the tangent at the present displacement, as a whole and for products."""
        self._blocks.blocks.set_value(0.0)
        dolfinx.fem.assemble_matrix(self._blocks.blocks, self._form)
        return self._blocks.assembled(), self._blocks.for_products()


class Tangent:
    """The tangent of one iterate; good until the next one is assembled.

    `matrix` is the elastic part, stored by rows; `products` acts like the whole tangent; `parts` are further ones in
    N/m, without entries of fixed components, of terms that couple `nodes_per_term` nodes at most. `smoothing` is the
    matrix with a block diagonal that bounds the tangent as Jacobi's smoother needs it: a positive semidefinite term
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


def raising(matrix: PETSc.Mat, nodes_per_term: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns what is to be added to a block diagonal for a further matrix.

    These are the owned global nodes with entries on its diagonal, (b,), and positive semidefinite (b, 3, 3) blocks.
    """
    start, columns, values = matrix.getValuesCSR()
    first = matrix.getOwnershipRange()[0]
    rows = first + np.repeat(np.arange(len(start) - 1), np.diff(start))
    own = rows // 3 == columns // 3
    nodes, place = np.unique(rows[own] // 3, return_inverse=True)
    blocks = np.zeros((len(nodes), 3, 3))
    blocks[place, rows[own] % 3, columns[own] % 3] = values[own]
    values, directions = np.linalg.eigh((blocks + blocks.swapaxes(1, 2)) / 2)
    positive = nodes_per_term * np.maximum(values, 0.0)
    return nodes.astype(PETSc.IntType), np.einsum("bij,bj,bkj->bik", directions, positive, directions)


def add_block_diagonal(matrix: PETSc.Mat, nodes: np.ndarray, blocks: np.ndarray) -> None:
    """Adds (b, 3, 3) blocks on the diagonal at (b,) owned global nodes, where the matrix has entries already."""
    ends = np.arange(len(nodes) + 1, dtype=PETSc.IntType)
    matrix.setValuesBlockedIJV(ends, nodes, blocks, addv=PETSc.InsertMode.ADD_VALUES, rowmap=nodes)
    matrix.assemble()
