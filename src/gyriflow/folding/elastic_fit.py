"""Elastic registration with contact: deform a mesh towards a shape while elements stay valid and folds do not cross.

A shape made by carrying vertices along a registration may turn elements inside out, or move one bank of a sulcus
through the other. Here the body itself does the fitting: it takes the smoothed stretch of that shape as growth, springs
draw its boundary there, and elasticity and the contact barrier keep elements positive and folds apart. It is the same
solver as that of a simulation; the reference is updated after each step, so stress does not accumulate.
"""

import logging
import math
from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.spatial import cKDTree

from ..errors import SolverError
from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.matching import faces_that_cross
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, linear_pieces, volumes_between
from ..geometry.triangles import Floats, Ints, TriangleMesh, signed_volume, vertex_areas
from ..mechanics.materials import MATERIALS
from ..settings.terms import FREE
from ..units import M_PER_MM, MM_PER_M
from .contact import SelfContact
from .diagnosis import worst_places
from .domain import Domain
from .linear_solver import NotConvergedError
from .newton import NewtonSettings, NewtonSolver, residual_floor
from .problem import NonlinearProblem
from .stress import unpacked
from .stretches import Stretches
from .targets import PARTS_OF_PATH, inverse_exponential, log_growth, path_through
from .tissue import Elements
from .zones import Zones

log = logging.getLogger(__name__)

MODULUS_PA, POISSON_RATIO = 1000.0, 0.3
"""Shear modulus and Poisson's ratio of the body that is fitted. The modulus only sets the unit of forces; a
compressible body yields more evenly."""
BARRIER_PA = 1000.0
"""Stiffness of the contact barrier: stiffer than in a simulation, since springs press folds together harder."""
SPRING_LENGTH_MM = 3.3
CLOSE_SPRING_LENGTH_MM = 0.2
"""Shear modulus over the springs' stiffness, on the way to a shape and close to it: a spring holds as strongly as this
depth of tissue. Stiff springs over the whole way take more iterations and press elements flat."""
SOFT_MM = 4.0
"""Radius around an inverted element or crossing face on the path within which springs stay soft."""
SOFTER = 4.0
"""Factor by which springs are softened if no solution is found with them."""
MAX_DRAWS = 2
"""Attempts to draw the boundary to its goals with no such element or face on the path."""
SMOOTHING_MM = 1.5
"""Smoothing (SD, mm) of the stretch that the body grows by."""
STRAIN_PER_STEP = 0.1
"""Largest mean linear strain per step; more steps than one take longer and press elements flatter."""
MAX_LEFT_MM = 1.0
"""Largest distance, as a root mean square, at which a body may stay from a shape."""
MAX_HALVINGS, MAX_DRAW_HALVINGS = 5, 1
"""Largest number of times that a step which fails is halved, and one that only draws the boundary."""
SETTINGS = NewtonSettings(newton_tolerance=1e-2, krylov_tolerance=1e-2, max_newton=4, max_krylov=500)
"""Loose tolerances and low limits: the next step starts from where the body is, and a failed one is made smaller."""


class Springs:
    """Springs from the nodes on the boundary to their goals, a contribution to the energy of a step.

    `vertices` (b,) are the ascending vertices of the mesh that have a spring.
    """

    def __init__(self, domain: Domain, vertices: Ints) -> None:
        self._domain = domain
        owned = domain.vertex_of_node[: domain.n_owned]
        place = np.searchsorted(vertices, owned).clip(max=len(vertices) - 1)
        self._local = np.flatnonzero(vertices[place] == owned)
        self._rows, self._vertices = place[self._local], vertices

    def draw_to(self, goals_mm: Floats, areas_mm2: Floats, lengths_mm: Floats) -> None:
        """Set the (b, 3) goals in mm, for a step from the present positions, and (b,) areas and lengths of springs."""
        weights = MODULUS_PA / (lengths_mm * M_PER_MM) * areas_mm2 * M_PER_MM**2
        self._weights = weights[self._rows, None]
        self._gaps = (self._domain.positions[self._vertices] - goals_mm * M_PER_MM)[self._rows]

    def energy(self, u: Floats) -> float:
        local = 0.5 * float((self._weights * (u[self._local] + self._gaps) ** 2).sum())
        return self._domain.comm.allreduce(local)

    def add_forces(self, u: Floats, out: Floats) -> None:
        out.reshape(-1, 3)[self._local] += self._weights * (u[self._local] + self._gaps)

    def stiffness(self, u: Floats, *, convex: bool = False) -> PETSc.Mat:
        domain = self._domain
        diagonal = np.zeros((domain.n_owned, 3))
        diagonal[self._local] = self._weights
        rows = np.arange(diagonal.size + 1, dtype=PETSc.IntType)
        columns = rows[:-1] + 3 * domain.space.dofmap.index_map.local_range[0]
        size = diagonal.size, 3 * len(domain.positions)
        csr = rows, columns.astype(PETSc.IntType), diagonal.ravel()
        return PETSc.Mat().createAIJ((size, size), bsize=3, csr=csr, comm=domain.comm)

    def max_step(self, u: Floats, direction: Floats) -> float:
        return 1.0


class ElasticFit:
    """A brain's mesh that is drawn to one shape after the other, on one process.

    `positions_mm` (n, 3) are those of its vertices now. Quadratic elements are fitted as their linear pieces.
    MeshError if the boundary of the mesh crosses itself.
    """

    def __init__(self, mesh: TetrahedralMesh) -> None:
        pieces = linear_pieces(mesh)
        mesh = TetrahedralMesh(mesh.vertices, pieces)
        self.positions_mm: Floats = mesh.vertices
        self._surface, self._used = boundary_surface(mesh)
        self._pieces, self._stretches = pieces, Stretches(pieces, len(mesh.vertices))
        facets = self._used[self._surface.faces]
        whole = np.ones(len(mesh.vertices))
        zones = Zones(facets, np.full(len(facets), FREE), whole, 0.0, (-math.inf, math.inf), free=True)
        domain = self._domain = Domain(MPI.COMM_SELF, mesh)
        self._problem = NonlinearProblem(domain, zones, MATERIALS["neo-hookean"](POISSON_RATIO))
        self._contact = SelfContact(domain, facets, BARRIER_PA)
        self._springs = Springs(domain, self._used)
        self._problem.contributions += [self._contact, self._springs]
        self._solver = NewtonSolver(self._problem, SETTINGS, residual_floor(mesh, MODULUS_PA))
        self._elements = Elements(domain.cells, domain.vertex_of_node, self._problem.points)

    @property
    def boundary(self) -> TriangleMesh:
        """The boundary of the body as it is now."""
        return TriangleMesh(self.positions_mm[self._used], self._surface.faces)

    def follow(self, shape: Floats) -> Floats:
        """Move the body to near a shape (n, 3) in mm, which may have inverted elements; return its (n, 3) positions.

        The body grows by the shape's smoothed stretch while springs draw its boundary to that of the shape. Where it
        cannot go on it stays, with a warning, or SolverError with the place if its boundary is still more than
        `MAX_LEFT_MM` from that of the shape (root mean square).
        """
        boundary = self.boundary
        motion = rigid_fit(shape[self._used], boundary.vertices, vertex_areas(boundary))
        goal = transform_points(shape, motion)
        ratio = signed_volume(TriangleMesh(goal[self._used], boundary.faces)) / signed_volume(boundary)
        steps = max(1, math.ceil(abs(math.log(max(ratio, 1e-3))) / 3 / STRAIN_PER_STEP))
        lengths = np.full(len(self._used), SPRING_LENGTH_MM)
        for left in range(steps, 0, -1):
            displacement = (goal - self.positions_mm) / left
            strain = log_growth(self.positions_mm, self._stretches, displacement, SMOOTHING_MM)
            try:
                self._step((self.positions_mm + displacement)[self._used], lengths, strain, MAX_HALVINGS)
            except SolverError as error:
                misfit_mm = math.sqrt(3 * np.mean((goal - self.positions_mm)[self._used] ** 2))
                if misfit_mm > MAX_LEFT_MM:
                    raise
                log.warning("the body comes within %.2f mm of a shape and no further: %s", misfit_mm, error)
                break
        return self._move(np.linalg.inv(motion))

    def draw(self, goals: Floats, before: Sequence[Floats] = ()) -> Floats:
        """Draw the boundary to (b, 3) goals in mm close to it, without growth; return the (n, 3) positions in mm.

        `before` are the last two shapes (n, 3) at most, if any. The path from them must have no inverted elements and
        no crossing faces: where it has, the boundary is drawn less, and faults left after the last attempt are warned
        of. Springs with which no solution is found are softened; a body that cannot be drawn at all stays as it is.
        """
        boundary, start = self.boundary, self.positions_mm
        motion = rigid_fit(goals, boundary.vertices, vertex_areas(boundary))
        lengths: Floats = np.full(len(goals), CLOSE_SPRING_LENGTH_MM)
        for _ in range(MAX_DRAWS):
            self.positions_mm, problem = start, ""
            try:
                self._step(transform_points(goals, motion), lengths, None, MAX_DRAW_HALVINGS)
            except SolverError as error:
                self.positions_mm, problem = start, f"the body is not drawn to a surface: {error}"
                lengths = np.minimum(SOFTER * lengths, SPRING_LENGTH_MM)
                continue
            faults = self._faults_since(before) if before else np.empty((0, 3))
            if not len(faults):
                break
            place = np.round(faults[0], 1).tolist()
            problem = f"{len(faults)} elements or faces are inverted or cross on the way to a shape, near {place} mm"
            distance, _ = cKDTree(faults).query(self.boundary.vertices)
            lengths[distance < SOFT_MM] = SPRING_LENGTH_MM
        if problem:
            log.warning("%s", problem)
        return self._move(np.linalg.inv(motion))

    def _faults_since(self, before: Sequence[Floats]) -> Floats:
        """Return the (k, 3) places of inverted elements and crossing faces on the path from the last shapes."""
        now, places = self.positions_mm, [np.empty((0, 3))]
        path = path_through(range(len(before) + 1), [*before, now], self._pieces)
        for part in PARTS_OF_PATH:
            on_way = path(len(before) - 1 + part)
            inverted = self._pieces[volumes_between(on_way, self._pieces) <= 0]
            crossing = faces_that_cross(TriangleMesh(on_way[self._used], self._surface.faces))
            places += [now[inverted].mean(axis=1), self.boundary.vertices[self._surface.faces[crossing]].mean(axis=1)]
        return np.concatenate(places)

    def _move(self, motion: NDArray) -> Floats:
        self.positions_mm = transform_points(self.positions_mm, motion)
        return self.positions_mm

    def _step(self, goals: Floats, lengths: Floats, strain: Floats | None, halvings: int) -> None:
        domain, problem = self._domain, self._problem
        domain.place(self.positions_mm * M_PER_MM)
        self._contact.begin_step()
        self._springs.draw_to(goals, vertex_areas(self.boundary), lengths)
        shape = len(domain.cells), len(problem.points.weights)
        inverse = np.tile(np.eye(3), (*shape, 1, 1))
        if strain is not None:
            nodal = strain[self._elements.vertices][self._elements.cells]
            inverse = inverse_exponential(unpacked(problem.points.interpolation @ nodal))
        # as one body, also if its parts are not connected
        problem.set_step(np.full(shape, MODULUS_PA), inverse, part=np.zeros_like(domain.part))
        try:
            solution = self._solver.solve()
        except NotConvergedError as error:
            if not halvings:
                raise SolverError(
                    "a shape cannot be reached without turning elements inside out or folds into each other",
                    found=f"{error}; {worst_places(self._solver)}",
                    remedy="Look at the labels or surfaces of this week and the one before at that place.",
                ) from None
            half = None if strain is None else strain / 2
            self._step(0.5 * (goals + self.positions_mm[self._used]), lengths, half, halvings - 1)
            self._step(goals, lengths, half, halvings - 1)
            return
        self.positions_mm = self.positions_mm + domain.gather(solution.displacement[: domain.n_owned]) * MM_PER_M
