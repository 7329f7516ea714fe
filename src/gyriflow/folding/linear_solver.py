"""Linear systems of Newton's method: conjugate gradients with a two-level additive
Schwarz preconditioner.

At tolerances of a hundredth any good method needs about thirty products with the
tangent, and the setup of multigrid costs more than that. The setup of this
preconditioner takes the time of a few products: inverse diagonal blocks, and the rigid
motions of some hundred parts of the mesh as the coarse level.
"""

from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc
from scipy import sparse
from scipy.linalg.lapack import dpotrf, dpotri

from ..errors import SolverError
from ..geometry.triangles import Floats, Ints
from .domain import Domain, bisect_points
from .problem import NonlinearProblem
from .products import PartMotions, multiply_blocks
from .tangent import Residual, Tangent, part_arms, rigid_motions

RUNGS = ("cg", "cg, tangent shifted")
"""Ways to solve a linear system: the second is tried where the first fails. A column of
the step table."""
PLAIN, SHIFTED = range(2)
REGULARISATION = 1e-6
"""Shift of the coarse matrix, as a fraction of its mean diagonal entry."""
_REASONS = PETSc.KSP.ConvergedReason
INDEFINITE = (
    _REASONS.DIVERGED_INDEFINITE_MAT,
    _REASONS.DIVERGED_INDEFINITE_PC,
    _REASONS.DIVERGED_DTOL,
)
"""PETSc's reasons if the tangent is not positive definite; the residual may grow (DTOL)
before that is detected."""
SHIFTS = (0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
"""Shifts of a tangent's diagonal, as fractions of it, tried in turn until the tangent
is positive definite."""


@dataclass(frozen=True)
class CoarseSettings:
    """The coarse level of the preconditioner: the rigid motions of at most `max_parts`
    parts of the mesh, used for `lifetime` assembled tangents.

    It has the stiffness of the elements, and `with_contributions` also that of the
    contributions to the energy, such as stiff springs.
    """

    max_parts: int = 256
    lifetime: int = 8
    with_contributions: bool = False


DEFAULT_COARSE = CoarseSettings()


class NotConvergedError(SolverError):
    """The step was not solved; a smaller one may be solvable."""


@dataclass(frozen=True, eq=False)
class Direction:
    """A descent direction (k, 3) of the local nodes in m, and its slope, the derivative
    of the energy along it, in J.

    In addition the iterations of the linear solve, its index in `RUNGS`, and whether
    the tangent was positive definite without a shift (`convex`).
    """

    values: Floats
    slope: float
    iterations: int
    rung: int = PLAIN
    convex: bool = True


class TwoLevelPreconditioner:
    """The sum D⁻¹ + Q (QᵀAQ)⁻¹ Qᵀ of block Jacobi and a coarse level: a two-level
    additive Schwarz method.

    Q holds the rigid motions of parts of the mesh (Nicolaides 1987, for elasticity), A
    is the elastic part alone.
    """

    def __init__(
        self,
        domain: Domain,
        tangent: Tangent,
        settings: CoarseSettings = DEFAULT_COARSE,
    ) -> None:
        self._domain = domain
        self._settings = settings
        self._tangent = tangent
        first, end = domain.space.dofmap.index_map.local_range
        self._own = slice(first, end)
        count = min(
            settings.max_parts,
            max(len(domain.positions) // 50, 1),
        )
        self._part_of_vertex = bisect_points(domain.positions, count)
        # by global nodes, as the columns of the matrix
        owned_vertices = domain.vertex_of_node[: domain.n_owned]
        self._vertex = np.concatenate(domain.comm.allgather(owned_vertices))
        self._part = self._part_of_vertex[self._vertex]
        self._parts = int(self._part.max()) + 1
        # the rows of the coarse inverse that this rank needs: motions of the parts that
        # contain its nodes
        own_parts = np.unique(self._part[self._own])
        self._moved = (6 * own_parts[:, None] + np.arange(6)).ravel()
        self._fixed = np.flatnonzero(tangent.elastic.matrix.fixed[self._own])
        self._made_at = -settings.lifetime

    def renew(self) -> None:
        """Update the diagonal to the present tangent, and the coarse level after
        its lifetime."""
        inverses = _inverse_blocks(self._tangent.diagonal())
        self._inverse_diagonal = inverses.astype(np.float32)
        n_assembled = self._tangent.elastic.assembled
        if n_assembled >= self._made_at + self._settings.lifetime:
            self._made_at = n_assembled
            self._set_coarse_level()

    def apply(
        self,
        _: PETSc.PC,
        x: PETSc.Vec,
        y: PETSc.Vec,
    ) -> None:
        """Set y to the preconditioned x."""
        own_coarse = self._motions.restrict(x.array_r, self._parts)
        coarse = self._domain.sum_over_ranks(own_coarse)
        coarse[self._moved] = self._inverse_coarse @ coarse.astype(np.float32)
        multiply_blocks(self._inverse_diagonal, x.array_r, y.array_w)
        self._motions.add(coarse, y.array_w)
        y.array_w[self._fixed] = 0.0
        if self._tangent.motions is not None:
            self._tangent.motions.remove(y.array_w)

    def _set_coarse_level(self) -> None:
        matrix = self._tangent.elastic.matrix
        own = self._own
        arms = part_arms(
            self._domain.positions,
            self._part_of_vertex,
        )[self._vertex]
        self._motions = PartMotions(
            self._part[own],
            arms[own],
        )
        modes = rigid_motions(arms)
        modes[matrix.fixed] = 0.0
        # Q, with one block in each row, and the transposed rows of this rank
        prolongation = self._in_parts(modes, self._part)
        restriction = self._in_parts(modes[own], self._part[own]).T.tobsr((6, 3))
        half = restriction @ (matrix.half() @ prolongation)
        coarse = self._domain.sum_over_ranks(half.toarray())
        coarse += coarse.T
        if self._settings.with_contributions:
            for part in self._tangent.parts:
                rows = sparse.csr_matrix(
                    part.getValuesCSR()[::-1],
                    part.getSize(),
                )
                added = restriction @ (rows @ prolongation)
                coarse += self._domain.sum_over_ranks(added.toarray())
        scale = np.trace(coarse) / len(coarse)
        coarse[np.diag_indices(len(coarse))] += REGULARISATION * scale
        motions = self._tangent.motions
        if motions is not None:
            # a stiffness against the removed motions, without which it would be
            # singular
            removed = self._domain.sum_over_ranks(restriction @ motions.modes)
            squared_norm = np.linalg.norm(removed, 2) ** 2
            coarse += 10 * scale / squared_norm * removed @ removed.T
        inverse = _inverse_matrix(coarse)
        self._inverse_coarse = inverse[self._moved].astype(np.float32)

    def _in_parts(self, modes: Floats, part: Ints) -> sparse.bsr_matrix:
        """Return (k, 3, 6) blocks as a (3 k, 6 · parts) matrix, each in the columns of
        its part."""
        count = len(modes)
        ends = np.arange(count + 1)
        return sparse.bsr_matrix(
            (modes, part, ends),
            shape=(3 * count, 6 * self._parts),
        )


def _inverse_blocks(blocks: Floats) -> Floats:
    """Return the inverses of (n, 3, 3) symmetric blocks, as `_positive_inverses` if
    they are indefinite."""
    a, b, c = blocks.swapaxes(0, 1)
    of_a = np.cross(b, c)
    of_b = np.cross(c, a)
    of_c = np.cross(a, b)
    cofactors = np.stack(
        [of_a, of_b, of_c],
        axis=1,
    )
    determinants = np.einsum("ni,ni->n", a, of_a)
    # Sylvester's criterion
    leading_minors = [
        a[:, 0],
        of_c[:, 2],
        determinants,
    ]
    definite = np.min(leading_minors, axis=0) > 0
    divisors = np.where(definite, determinants, 1.0)
    inverses = cofactors / divisors[:, None, None]
    inverses[~definite] = _positive_inverses(blocks[~definite])
    return np.asarray(inverses)


def _inverse_matrix(matrix: Floats) -> Floats:
    """Return the inverse of a (k, k) symmetric matrix, as `_positive_inverses` if it is
    indefinite."""
    factor, failed = dpotrf(matrix, lower=1)
    if failed:
        return _positive_inverses(matrix)
    inverse = np.tril(dpotri(factor, lower=1)[0])
    return np.asarray(inverse + np.tril(inverse, -1).T)


def _positive_inverses(matrices: Floats) -> Floats:
    """Return inverses of (..., k, k) symmetric matrices with the absolute values of
    their eigenvalues."""
    values, axes = np.linalg.eigh(matrices)
    sizes = np.abs(values)
    largest = sizes.max(axis=-1, keepdims=True)
    sizes = np.maximum(sizes, REGULARISATION * largest)
    scaled_axes = axes / sizes[..., None, :]
    return np.asarray(scaled_axes @ axes.swapaxes(-1, -2))


class LinearSolver:
    """Solver of the linear systems of a problem; a solve ends after `max_iterations`.

    It keeps the preconditioner and the last shift: they affect how a direction is
    found, not the solution of a step.
    """

    def __init__(
        self,
        problem: NonlinearProblem,
        max_iterations: int,
        coarse: CoarseSettings,
    ) -> None:
        self._problem = problem
        self._coarse = coarse
        self._preconditioner: TwoLevelPreconditioner | None = None
        self._level = 0  # index in SHIFTS of the shift that the last tangent needed
        self._cg = PETSc.KSP().create(problem.domain.comm)
        self._cg.setType("cg")
        # the norm of Newton's convergence criterion
        self._cg.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        self._cg.setTolerances(atol=0.0, max_it=max_iterations)

    def solve(
        self,
        tangent: Tangent,
        residual: Residual,
        reduction: float,
        *,
        convexify: bool,
    ) -> Direction:
        """Solve J d = −r for a descent direction d, with the tangent J and the residual
        r at the same displacement.

        `reduction` is the relative tolerance of the solve. An indefinite J is shifted;
        with `convexify`, the stiffness of contact in it is first made semidefinite.
        NotConvergedError if no shift helps.
        """
        iterations = 0
        self._cg.setTolerances(rtol=reduction)
        # a tangent after an indefinite one may still be indefinite
        first = max(self._level - 1, 0)
        if convexify and self._problem.contributions:
            # surfaces pressed together tend to slide sideways, which makes the tangent
            # indefinite; with semidefinite contact it rarely is, but it is not exact
            if first == 0:
                reason, direction = self._run(tangent, residual)
                iterations += direction.iterations
                if reason > 0:
                    self._level = 0
                    return direction
            self._problem.convexify(tangent, residual.displacement)
        for level in range(first, len(SHIFTS)):
            tangent.shift_diagonal(SHIFTS[level])
            reason, direction = self._run(tangent, residual)
            tangent.shift_diagonal(0.0)
            iterations += direction.iterations
            # conjugate gradients that end early have a descent direction as well (Dembo
            # and Steihaug 1983)
            if reason > 0 or reason == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
                self._level = level
                return replace(
                    direction,
                    iterations=iterations,
                    rung=SHIFTED if level else PLAIN,
                    convex=level == 0,
                )
            if reason not in INDEFINITE:
                break
        raise NotConvergedError("the linear solver found no descent direction")

    def _run(self, tangent: Tangent, residual: Residual) -> tuple[int, Direction]:
        """Return PETSc's convergence reason, 0 if the direction does not descend, and
        the direction."""
        domain = self._problem.domain
        if self._preconditioner is None:
            self._preconditioner = TwoLevelPreconditioner(domain, tangent, self._coarse)
            multilevel = self._cg.getPC()
            multilevel.setType("python")
            multilevel.setPythonContext(self._preconditioner)
            self._solution, self._right = tangent.matrix.createVecs()
        self._preconditioner.renew()
        self._cg.setOperators(tangent.matrix)
        self._right.array_w[:] = residual.owned
        self._cg.solve(self._right, self._solution)
        owned = -self._solution.array_r
        # fixed components are zero only to within the tolerance
        self._problem.clear_fixed(owned)
        slope = domain.dot(owned, residual.owned)
        reason = self._cg.getConvergedReason() if slope < 0 else 0  # False for NaN
        iterations = self._cg.getIterationNumber()
        return reason, Direction(domain.with_ghosts(owned), slope, iterations)
