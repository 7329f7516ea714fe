"""Elastic registration with contact: deform a mesh towards a shape while elements stay
valid and folds do not cross.

A shape made by carrying vertices along a registration may turn elements inside out, or
move one bank of a sulcus through the other. Here the body itself does the fitting: it
takes the smoothed stretch of that shape as growth, springs draw its boundary there, and
elasticity and the contact barrier keep elements positive and folds apart. It is the
same solver as that of a simulation; the reference is updated after each step, so stress
does not accumulate. The states that the body passes through are valid, too: where the
straight way to a shape is not, some of them lie between.
"""

import logging
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.spatial import cKDTree

from ..errors import SolverError
from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.diffusion import integrals_at_vertices, smooth_integrals, vertex_sizes
from ..geometry.flat_elements import open_flat_elements
from ..geometry.jacobians import SLOPES, determinants, inverted_on_the_way
from ..geometry.matching import faces_that_cross
from ..geometry.straightening import may_fold_over, straighten_sides
from ..geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    has_volume,
    linear_pieces,
    volumes_between,
)
from ..geometry.triangles import (
    Floats,
    Ints,
    Mask,
    TriangleMesh,
    rms_length,
    signed_volume,
    vertex_areas,
)
from ..mechanics.materials import MATERIALS
from ..settings.terms import FREE
from ..units import M_PER_MM, MM_PER_M
from .contact import SelfContact
from .domain import Domain
from .linear_solver import CoarseSettings, NotConvergedError
from .newton import NewtonSettings, NewtonSolver, residual_floor
from .problem import NonlinearProblem
from .stretches import (
    deformation_gradients,
    from_principal,
    log_stretch,
    packed,
    unpacked,
)
from .zones import Zones

log = logging.getLogger(__name__)

MODULUS_PA, POISSON_RATIO = 1000.0, 0.3
"""Shear modulus and Poisson's ratio of the body that is fitted. The modulus only sets
the unit of forces; a compressible body yields more evenly."""
BARRIER_PA = 1000.0
"""Stiffness of the contact barrier: stiffer than in a simulation, since springs press
folds together harder."""
SPRING_LENGTH_MM = 3.3
CLOSE_SPRING_LENGTHS_MM = (0.2, 0.8)
"""Shear modulus over the springs' stiffness, on the way to a shape, and close to it in
turn: a spring holds as strongly as this depth of tissue. Stiff springs over the whole
way take more iterations and press elements flat."""
FREED_SPRING_LENGTH_MM = 20.0
"""The same for springs around flat elements, which open while the rest is drawn."""
MAX_PULL_MM = 1.0
"""Largest distance over which close springs draw, if it is more than twice the root
mean square: longer ones press elements flat, and the next draw draws further."""
PARTS_OF_WAY = (1 / 3, 2 / 3, 1.0)
"""Fractions of a straight way at which faces are checked for crossings."""
MAX_WAY_HALVINGS = 3
"""Largest number of times that a way with faults is divided by a stop."""
UNTANGLING_MM, UNTANGLING_REACH = (1.0, 2.0, 4.0, 8.0), 2.0
"""Lengths over which a displacement is smoothed around faults, round by round (the
first two where the shape is that of an observed brain), and the distance from these, as
a multiple of them."""
FARTHEST = 3.0
"""Multiple of that distance beyond which nothing is smoothed: the share of the smoothed
displacement would be 1e-4."""
MAX_CHANGE_MM = 0.25
"""Largest change of a shape by smoothing around faults, as a root mean square on the
boundary: shapes that would change more are followed."""
REOPENING_ROUNDS = 4
"""Largest number of rounds in which elements that straightened sides have left flat are
opened again."""
HOLDING_MM = (1.0, 1.0, 2.0, 2.0, 4.0, 4.0, 8.0, 16.0, 32.0)
"""Lengths around curved elements that fold over at which the body is held, round by
round, with the same reach: others may fold over in its turn."""
MIN_VOLUME_ON_WAY = 0.2
"""Fraction of an element's volume that it should keep on the way from one shape to the
next."""
MAX_LOG_STRETCH = 0.3
"""Largest principal Hencky strain of a shape that is followed; larger ones, as of
inverted elements, count as this."""
SMOOTHING_MM = 1.5
"""Smoothing (SD, mm) of the stretch that the body grows by."""
FLATTENING_ROUNDS = 3
"""Rounds of averaging over neighbours of the strain that an element's own is compared
with."""
MIN_FLATTENING, MAX_FLATTENING = math.log(2.0), math.log(4.0)
"""Loss of an element's volume (a logarithm), since the start and by comparison with
those around it, from which a step opens it again, and from which it makes up for all of
the difference."""
MAX_OPENING = 0.5
"""Largest principal Hencky strain that a step takes back: with more stress the tangent
cannot be made definite."""
MIN_VOLUME_LEFT, MAX_OUTER_MOVE_MM = 0.2, 0.1
"""Fraction of their volume at the start below which elements are opened after a step,
by moving vertices inside, and the largest move of vertices on the boundary for elements
that have no others."""
STRAIN_PER_STEP = 0.1
"""Largest mean linear strain per step; more steps than one take longer and press
elements flatter."""
MAX_LEFT_MM = 3.0
"""Largest distance, as a root mean square, at which a body may stay from a shape: the
way to the next shape begins there."""
FOLDS_OVER = (
    "curved elements fold over. Mesh with smaller elements (mesh.surface_edge_mm) or"
    " linear ones (mesh.order: 1)"
)
SETTINGS = NewtonSettings(
    newton_tolerance=2e-2,
    krylov_tolerance=1e-2,
    max_newton=2,
    max_krylov=150,
    min_progress=0.01,
    keeps_iterates=True,
    coarse=CoarseSettings(
        max_parts=64,
        lifetime=2,
        with_contributions=True,
    ),
)
"""Loose tolerances and low limits: each iterate is a shape that the body can have, and
the next step starts from it. Without the stiff springs in the coarse level a linear
solve takes four times as many iterations."""


class _Springs:
    """Springs from the nodes on the boundary to their goals, a contribution to the
    energy of a step.

    `vertices` (b,) are the ascending vertices of the mesh that have a spring.
    """

    def __init__(self, domain: Domain, vertices: Ints) -> None:
        self._domain = domain
        self._vertices = vertices
        self._local, self._rows = domain.owned_rows(vertices)

    def draw_to(
        self,
        goals_mm: Floats,
        areas_mm2: Floats,
        lengths_mm: Floats,
    ) -> None:
        """Set the (b, 3) goals in mm, for a step from the present positions, and (b,)
        areas and lengths of springs."""
        stiffness = MODULUS_PA / (lengths_mm * M_PER_MM)
        weights = stiffness * areas_mm2 * M_PER_MM**2
        self._weights = weights[self._rows, None]
        positions = self._domain.positions[self._vertices]
        gaps = positions - goals_mm * M_PER_MM
        self._gaps = gaps[self._rows]

    def energy(self, u: Floats) -> float:
        stretched = u[self._local] + self._gaps
        energies = self._weights * stretched**2
        local = 0.5 * float(energies.sum())
        return self._domain.comm.allreduce(local)

    def add_forces(self, u: Floats, out: Floats) -> None:
        """Add the gradient of `energy` to `out`, (3 n,)."""
        forces = out.reshape(-1, 3)
        forces[self._local] += self._weights * (u[self._local] + self._gaps)

    def stiffness(self, u: Floats, *, convex: bool = False) -> PETSc.Mat:
        domain = self._domain
        diagonal = np.zeros((domain.n_owned, 3))
        diagonal[self._local] = self._weights
        rows = np.arange(
            diagonal.size + 1,
            dtype=PETSc.IntType,
        )
        first_node, _ = domain.space.dofmap.index_map.local_range
        columns = (rows[:-1] + 3 * first_node).astype(PETSc.IntType)
        size = (diagonal.size, 3 * len(domain.positions))
        return PETSc.Mat().createAIJ(
            (size, size),
            bsize=3,
            csr=(rows, columns, diagonal.ravel()),
            comm=domain.comm,
        )

    def max_step(self, u: Floats, direction: Floats) -> float:
        return 1.0


class ElasticFit:
    """A brain's mesh that is drawn to one shape after the other, on one process.

    `positions_mm` (n, 3) are those of its vertices now. Quadratic elements are fitted
    as their linear pieces and then straightened where they would fold over. MeshError
    if the boundary of the mesh crosses itself.
    """

    def __init__(self, mesh: TetrahedralMesh) -> None:
        self._tets = mesh.tets
        self._pieces = linear_pieces(mesh)
        self._is_curved = mesh.order == 2
        self._kept_open = self._pieces
        if self._is_curved:
            # straight sides need the corners of curved elements to have volume
            self._kept_open = np.concatenate([self._pieces, mesh.corners])
        mesh = TetrahedralMesh(mesh.vertices, self._pieces)
        self.positions_mm: Floats = mesh.vertices
        self._passed: list[Floats] = []
        self._moved_straight = False
        self._start_volumes = volumes_between(mesh.vertices, self._kept_open)
        self._surface, self._used = boundary_surface(mesh)
        is_outer = np.isin(
            np.arange(len(mesh.vertices)),
            self._used,
        )
        all_outer = self._kept_open[is_outer[self._kept_open].all(axis=1)]
        self._inner_moves_mm = np.where(is_outer, 0.0, np.inf)
        self._outer_moves_mm = np.zeros(len(mesh.vertices))
        self._outer_moves_mm[all_outer] = MAX_OUTER_MOVE_MM
        facets = self._used[self._surface.faces]
        zones = Zones(
            facets,
            facet_zone=np.full(len(facets), FREE),
            growing=np.ones(len(mesh.vertices)),
            fissure_x_mm=0.0,
            planes_mm=(-math.inf, math.inf),
            free=True,
        )
        self._domain = Domain(MPI.COMM_SELF, mesh)
        material = MATERIALS["neo-hookean"](POISSON_RATIO)
        self._problem = NonlinearProblem(self._domain, zones, material)
        self._contact = SelfContact(self._domain, facets, BARRIER_PA)
        self._springs = _Springs(self._domain, self._used)
        self._problem.contributions += [self._contact, self._springs]
        floor = residual_floor(mesh, MODULUS_PA)
        self._solver = NewtonSolver(self._problem, SETTINGS, floor)
        # the pieces in the order of the solver
        self._cells = self._domain.vertex_of_node[self._domain.cells]
        start_edges = self._edges(np.arange(len(self._cells)))
        self._inverse_edges = np.linalg.inv(start_edges)
        self._cell_volumes = determinants(start_edges)
        n_cells = len(self._cells)
        element = np.repeat(np.arange(n_cells), 4)
        self._incidence = sparse.csr_array(
            (np.ones(4 * n_cells), (self._cells.ravel(), element)),
            shape=(len(mesh.vertices), n_cells),
        )

    def _edges(self, cells: Ints) -> Floats:
        """Return the (c, 3, 3) edges of some of the solver's elements from their first
        corners, as columns."""
        corners = self.positions_mm[self._cells[cells]]
        return np.swapaxes(
            corners[:, 1:] - corners[:, :1],
            1,
            2,
        )

    @property
    def boundary(self) -> TriangleMesh:
        """The boundary of the body as it is now."""
        return self._boundary_at(self.positions_mm)

    def _boundary_at(self, places: Floats) -> TriangleMesh:
        return TriangleMesh(places[self._used], self._surface.faces)

    def follow(self, shape: Floats) -> Floats:
        """Move the body to near a shape (n, 3) in mm, which may have inverted elements;
        return its (n, 3) positions.

        The body grows by the shape's smoothed stretch while springs draw its boundary
        to that of the shape. It stays where it cannot go on; SolverError with the place
        if its boundary is still more than `MAX_LEFT_MM` from that of the shape (root
        mean square).
        """
        start = self.positions_mm
        boundary = self.boundary
        n_passed = len(self._passed)
        motion = rigid_fit(
            shape[self._used],
            boundary.vertices,
            vertex_areas(boundary),
        )
        goal = transform_points(shape, motion)
        lengths = np.full(len(self._used), SPRING_LENGTH_MM)
        strain_to_goal = self._strain_to(goal)
        n_steps = self._step_count(goal, strain_to_goal)
        for steps_left in range(n_steps, 0, -1):
            places = self.positions_mm
            next_places = places + (goal - places) / steps_left
            is_whole_way = n_steps == 1
            logs = packed(
                strain_to_goal if is_whole_way else self._strain_to(next_places)
            )
            integrals = integrals_at_vertices(places, self._pieces, logs)
            strain = smooth_integrals(places, self._pieces, integrals, SMOOTHING_MM)
            problem = self._step(next_places[self._used], lengths, strain)
        valid = self._valid(self.positions_mm, start)
        if valid is None:
            valid = start
            problem = FOLDS_OVER
            log.warning("the body does not follow a shape: %s", FOLDS_OVER)
            del self._passed[n_passed:]
        misfit_mm = rms_length((goal - valid)[self._used])
        if misfit_mm > MAX_LEFT_MM:
            self.positions_mm = valid
            found = f"{misfit_mm:.1f} mm from it (root mean square)"
            raise SolverError(
                "a shape cannot be reached without turning elements inside out or folds"
                " into each other",
                found=f"{found}: {problem}" if problem else found,
                expected=f"at most {MAX_LEFT_MM:g} mm",
                remedy=(
                    "Look at the labels or surfaces of this week and the one before at"
                    " that place."
                ),
            )
        return self._place_back(valid, motion)

    def _step_count(self, goal: Floats, strain: Floats) -> int:
        """Return the number of steps to a goal (n, 3), by the strain of the whole and
        of nine elements in ten, whose own are (m, 3, 3)."""
        volume = signed_volume(self.boundary)
        goal_volume = signed_volume(self._boundary_at(goal))
        ratio = max(goal_volume / volume, 1e-3)
        of_whole = abs(math.log(ratio))
        norms = np.linalg.norm(
            strain,
            axis=(1, 2),
        )
        of_elements = float(np.quantile(norms, 0.9))
        mean_strain = max(of_whole, of_elements) / 3
        return max(1, math.ceil(mean_strain / STRAIN_PER_STEP))

    def draw(self, goals: Floats) -> Floats:
        """Draw the boundary towards (b, 3) goals in mm close to it, without growth;
        return the (n, 3) positions in mm.

        What cannot be drawn further stays where it is. Springs that fold curved
        elements over are softened; where soft ones do, too, the body stays as it is,
        with a warning.
        """
        start = self.positions_mm
        boundary = self.boundary
        n_passed = len(self._passed)
        motion = rigid_fit(goals, boundary.vertices, vertex_areas(boundary))
        pull = transform_points(goals, motion) - boundary.vertices
        length = np.linalg.norm(
            pull,
            axis=1,
            keepdims=True,
        )
        longest_mm = max(
            MAX_PULL_MM,
            2 * math.sqrt(np.mean(length**2)),
        )
        pull *= np.minimum(
            1.0,
            longest_mm / np.maximum(length, 1e-9),
        )
        for length_mm in CLOSE_SPRING_LENGTHS_MM:
            lengths = np.full(len(goals), length_mm)
            lengths[self._near_flat_elements()] = FREED_SPRING_LENGTH_MM
            self._step(boundary.vertices + pull, lengths, None)
            valid = self._valid(self.positions_mm, start)
            if valid is not None:
                return self._place_back(valid, motion)
            self.positions_mm = start
            del self._passed[n_passed:]
        log.warning("the body is not drawn to a surface: %s", FOLDS_OVER)
        return start

    def move_to(self, shape: Floats) -> Floats:
        """Move the body to a shape (n, 3) in mm that it can nearly have; return its (n,
        3) positions in mm.

        Where elements would be inverted or faces cross on the straight way, the
        displacement is smoothed around them, over lengths that increase. The body
        follows the shape, and is drawn to it, if faults remain, if this changes the
        shape by more than `MAX_CHANGE_MM`, or if curved elements fold over there. If
        that leaves it farther from the shape, it is moved to the smoothed one after
        all.
        """
        start = self.positions_mm
        n_passed = len(self._passed)
        motion = self._fit(shape, start)
        goal = transform_points(shape, motion)
        untangled, faults = self._untangled(start, goal, UNTANGLING_MM)
        smoothed = None if len(faults) else self._valid_near(untangled)
        nearest = untangled if smoothed is None else smoothed
        changed_mm = rms_length((nearest - goal)[self._used])
        if smoothed is None or changed_mm > MAX_CHANGE_MM:
            text = "smoothing leaves %d faults and changes a shape by %.2f mm%s"
            folds_over = smoothed is None and not len(faults)
            and_then = "; curved elements fold over" if folds_over else ""
            log.info(text + ": the body follows it", len(faults), changed_mm, and_then)
            try:
                self.follow(shape)
                followed = self.draw(shape[self._used])
            except SolverError:
                if smoothed is None:
                    raise
                left_mm = math.inf
            else:
                left_mm = rms_length((followed - shape)[self._used])
            if smoothed is None or left_mm <= changed_mm:
                return followed
            log.info("the body is moved to the smoothed shape, which is nearer")
            del self._passed[n_passed:]
        # opened elements brought none onto the way, but straightened sides may have
        has_faults = self._is_curved and len(self._faults_between(start, smoothed)) > 0
        self._moved_straight = not has_faults
        return self._place_back(smoothed, motion)

    def _valid_near(self, places: Floats) -> Floats | None:
        """Return valid positions (n, 3) near given ones, to which the straight way has
        no more faults; None where curved elements fold over."""
        opened = self._opened_after(self.positions_mm, places)
        return self._valid(opened, self.positions_mm)

    def _untangled(
        self,
        before: Floats,
        after: Floats,
        lengths_mm: Sequence[float],
    ) -> tuple[Floats, Floats]:
        """Return the aligned shape `after`, changed around faults on the straight way
        to it, and those that remain.

        Elements that lose most of their volume count as faults in the first round only.
        """
        displacement = after - before
        least = MIN_VOLUME_ON_WAY
        faults = self._faults_between(before, after, least)
        for length in lengths_mm:
            if not len(faults):
                break
            nearness = _nearness(before, faults, length)
            is_near = nearness > 0
            # elsewhere nothing changes, and there are no faults
            pieces = self._pieces[is_near[self._pieces].any(axis=1)]
            integrals = vertex_sizes(before, pieces)[:, None] * displacement
            smooth = smooth_integrals(before, pieces, integrals, length)
            displacement += nearness[:, None] * (smooth - displacement)
            faults = self._faults_between(
                before,
                before + displacement,
                near=is_near,
            )
        return before + displacement, faults

    def way_from(self, before: Floats) -> list[tuple[float, Floats]]:
        """Return the shapes (n, 3) to pass on the way from an earlier shape to that of
        now, and the fraction of each.

        There are none where no element is inverted and no faces cross on the straight
        way, if need be after a change of the shape of now around the faults. Else they
        are states that the body has passed through since this was last called; elements
        and faces with faults between two of them that follow each other are warned of.
        """
        passed = self._passed
        self._passed = []
        if self._moved_straight:
            return []
        start = self.positions_mm
        places, stops = self._stops(
            before,
            self._aligned(start, before),
            passed,
        )
        # changes around faults flatten elements
        last = stops[-1] if stops else before
        places = self._opened_after(last, places)
        valid = self._valid(self._aligned(places, start), start)
        if valid is not None:
            self.positions_mm = valid
        self._warn_of_more_faults(last, places)
        chain = [before, *stops, places]
        lengths = [self._distance(first, second) for first, second in pairwise(chain)]
        fractions = np.cumsum(lengths) / max(sum(lengths), 1e-12)
        return list(
            zip(
                fractions.tolist(),
                stops,
                strict=False,
            )
        )

    def _warn_of_more_faults(self, before: Floats, places: Floats) -> None:
        """Warn if the body, whose sides were straightened at `places`, has more faults
        than these on the way from before."""
        if not self._is_curved:
            return
        reached = self._aligned(self.positions_mm, before)
        n_faults = len(self._faults_between(before, reached))
        if n_faults > len(self._faults_between(before, places)):
            text = "with straight sides %d elements or faces have faults on the way"
            log.warning(text, n_faults)

    def _stops(
        self,
        before: Floats,
        after: Floats,
        passed: Sequence[Floats],
        halvings: int = MAX_WAY_HALVINGS,
    ) -> tuple[Floats, list[Floats]]:
        """Return the shape `after`, changed around faults, and the shapes to pass
        before it."""
        untangled, faults = self._untangled(
            before,
            after,
            UNTANGLING_MM[:2],
        )
        # a change that flattens elements is the last resort
        flattens = self._flat_count(untangled) > self._flat_count(after)
        halfway = None
        if halvings and (len(faults) or flattens):
            halfway = self._halfway(before, after, passed)
        if halfway is not None:
            # each shape is fitted to the one before, as on the path
            middle = self._aligned(passed[halfway], before)
            earlier = passed[:halfway]
            stop, first = self._stops(
                before,
                middle,
                earlier,
                halvings - 1,
            )
            end = self._aligned(after, stop)
            later = passed[halfway + 1 :]
            last, second = self._stops(
                stop,
                end,
                later,
                halvings - 1,
            )
            return last, [*first, stop, *second]
        if len(faults):
            # the shape stays as it is: it is valid, and a changed one may not be
            untangled = after
            faults = self._faults_between(before, after)
        if len(faults):
            text = "%d elements or faces are inverted or cross near %s mm on the way"
            log.warning(
                text,
                len(faults),
                np.round(faults[0], 1).tolist(),
            )
        return untangled, []

    def _near_flat_elements(self) -> Mask:
        """Return (b,) whether a vertex of the boundary is a corner of a flat element or
        of one that touches it."""
        is_flat = self._are_flat(self.positions_mm, MIN_VOLUME_LEFT)
        is_near = np.zeros(len(self.positions_mm), dtype=bool)
        is_near[self._kept_open[is_flat]] = True
        is_touching = is_near[self._pieces].any(axis=1)
        is_near[self._pieces[is_touching]] = True
        return is_near[self._used]

    def _are_flat(self, places: Floats, least: float) -> Mask:
        """Return whether each element has less than a fraction of its volume at the
        start."""
        volumes = volumes_between(places, self._kept_open)
        return volumes < least * self._start_volumes

    def _flat_count(self, places: Floats) -> int:
        return int(self._are_flat(places, MIN_VOLUME_LEFT / 2).sum())

    def _halfway(
        self,
        before: Floats,
        after: Floats,
        passed: Sequence[Floats],
    ) -> int | None:
        """Return the number of the valid state that is nearest to the middle between
        two shapes; None without any."""
        ways = [
            abs(self._distance(before, shape) - self._distance(shape, after))
            for shape in passed
        ]
        for number in np.argsort(ways):
            # where curved elements fold over, their linear pieces may be valid
            if has_volume(passed[number], self._tets).all():
                return int(number)
        return None

    def _faults_between(
        self,
        before: Floats,
        after: Floats,
        least: float = 0.0,
        near: Mask | None = None,
    ) -> Floats:
        """Return the (k, 3) places before, of elements that are inverted and faces that
        cross on the straight way.

        With `near` (n,), elements without such a vertex are left out, and faces, if
        none is on the boundary.
        """
        tets = self._tets if near is None else self._tets[near[self._tets].any(axis=1)]
        inverted = inverted_on_the_way(before, after, tets, least)
        places = [before[tets[inverted]].mean(axis=1)]
        if near is not None and not near[self._used].any():
            return places[0]
        facets = self._used[self._surface.faces]
        for part in PARTS_OF_WAY:
            crossing = self._crossing_faces((1 - part) * before + part * after)
            places.append(before[facets[crossing]].mean(axis=1))
        return np.concatenate(places)

    def _crossing_faces(self, places: Floats) -> Ints:
        boundary = self._boundary_at(places)
        # the search for which of them cross takes twice as long
        if not self._contact.crosses(boundary.vertices):
            return np.empty(0, dtype=np.int64)
        return faces_that_cross(boundary)

    def _fit(self, shape: Floats, onto: Floats) -> Floats:
        # with the weights of the path (`paths.path_through`)
        return rigid_fit(shape, onto, vertex_sizes(onto, self._pieces))

    def _aligned(self, shape: Floats, onto: Floats) -> Floats:
        return transform_points(shape, self._fit(shape, onto))

    def _distance(self, first: Floats, second: Floats) -> float:
        """Return how far all but a hundredth of the boundary moves between two shapes,
        without rigid motion."""
        moves = (self._aligned(second, first) - first)[self._used]
        return float(
            np.quantile(
                np.linalg.norm(moves, axis=1),
                0.99,
            )
        )

    def _strain_to(self, goal: Floats) -> Floats:
        """Return the (m, 3, 3) Hencky strain of the pieces from now to a goal."""
        gradients = deformation_gradients(
            self.positions_mm, goal, self._pieces, SLOPES[None]
        )
        return log_stretch(gradients[:, 0], limit=MAX_LOG_STRETCH)

    def _valid(self, places: Floats, start: Floats) -> Floats | None:
        """Return positions (n, 3) near `places` at which no curved element folds over;
        None if there are none.

        Their sides are straightened, and the body is returned around those that still
        fold over towards a valid `start`.
        """
        if not self._is_curved:
            return places
        held = np.empty((0, 3))
        for length_mm in (0.0, *HOLDING_MM):
            trial = places
            if len(held):
                near = _nearness(places, held, length_mm)[:, None]
                trial = places + near * (start - places)
            trial = straighten_sides(trial, self._tets)
            is_fault = self._faults_at(trial)
            if not is_fault.any():
                return self._reopened(trial)
            held = np.concatenate([held, places[is_fault]])
        return None

    def _faults_at(self, places: Floats) -> Mask:
        """Return (n,) whether a vertex belongs to a curved element that may fold over
        or to a face that crosses another."""
        folded = self._tets[may_fold_over(places, self._tets)]
        crossing = self._surface.faces[self._crossing_faces(places)]
        is_fault = np.zeros(len(places), dtype=bool)
        is_fault[folded] = True
        is_fault[self._used[crossing]] = True
        return is_fault

    def _reopened(self, places: Floats) -> Floats:
        """Return valid positions (n, 3) at which fewer of the elements are flat that
        straight sides flatten, if there are any.

        Elements that fold over when others are opened, or faces that cross, stay as
        they are in the valid `places`.
        """
        n_flat = self._flat_count(places)
        for _ in range(REOPENING_ROUNDS):
            if not n_flat:
                break
            opened = straighten_sides(self._opened(places), self._tets)
            is_fault = self._faults_at(opened)
            while is_fault.any():
                opened[is_fault] = places[is_fault]
                is_fault = self._faults_at(opened)
            n_flat_before = n_flat
            n_flat = self._flat_count(opened)
            if n_flat >= n_flat_before:
                break
            places = opened
        return places

    def _place_back(self, places: Floats, motion: Floats) -> Floats:
        """Place the body, without the rigid motion that a shape was aligned by."""
        self.positions_mm = transform_points(places, np.linalg.inv(motion))
        return self.positions_mm

    def _step(
        self,
        goals: Floats,
        lengths: Floats,
        strain: Floats | None,
    ) -> str:
        """Grow by a strain (n, 6) and draw the boundary to goals (b, 3); return why the
        step did not converge, or "".

        The body moves as far as the iteration went: each iterate lowers the energy,
        inverts no element, and crosses no faces.
        """
        domain = self._domain
        problem = self._problem
        start = self.positions_mm
        self._moved_straight = False
        domain.place(start * M_PER_MM)
        self._contact.begin_step()
        self._springs.draw_to(goals, vertex_areas(self.boundary), lengths)
        inverse = np.tile(
            np.eye(3),
            (len(self._cells), 1, 1, 1),
        )
        if strain is not None:
            logs = unpacked(problem.points.interpolation @ strain[self._cells])
            inverse = _inverse_exponential(logs)
        # as one body, also if its parts are not connected
        one_part = np.zeros_like(domain.part)
        moduli = np.full(
            (len(self._cells), 1),
            MODULUS_PA,
        )
        # where the stress of flat elements prevents any iteration, without it
        for stretches in (self._flattening(), None):
            problem.set_step(moduli, inverse, stretches, part=one_part)
            reason = ""
            try:
                self._solver.solve()
            except NotConvergedError as error:
                reason = f"{error}; {self._solver.worst_places()}"
            if not reason or self._solver.iterates:
                break
        for displacement in self._solver.iterates:
            moved = domain.gather(displacement[: domain.n_owned]) * MM_PER_M
            self.positions_mm = start + moved
            self._passed.append(self.positions_mm)
        opened = self._opened(self.positions_mm)
        if opened is not self.positions_mm:
            self.positions_mm = opened
            self._passed.append(opened)
        return reason

    def _opened(self, places: Floats) -> Floats:
        """Return positions (n, 3) at which flat elements are opened, as far as moves
        inside and small ones outside can.

        No state is lost, since none is in the elements.
        """
        opened = self._opened_by(places, self._inner_moves_mm)
        # elements without a vertex inside need a small move of the boundary
        moved = self._opened_by(opened, self._outer_moves_mm)
        if moved is not opened and len(self._crossing_faces(moved)):
            return opened
        return moved

    def _opened_by(self, places: Floats, longest_mm: Floats) -> Floats:
        return open_flat_elements(
            places,
            self._kept_open,
            self._start_volumes,
            longest_mm,
            MIN_VOLUME_LEFT,
        )

    def _opened_after(self, before: Floats, places: Floats) -> Floats:
        """Return the positions of `_opened`, or those given where these have fewer
        faults on the way from before."""
        opened = self._opened(places)
        if opened is places:
            return places
        has_moved = (opened != places).any(axis=1)
        # faults elsewhere are the same
        n_faults, n_faults_before = (
            len(self._faults_between(before, after, near=has_moved))
            for after in (opened, places)
        )
        return places if n_faults > n_faults_before else opened

    def _flattening(self) -> Floats:
        """Return the (c, 1, 3, 3) stretches of flat elements, beyond that around them,
        which a step takes back.

        The strain since the start is compared with that of the elements around. An
        element that has lost volume, and more than these, is elastic as to the
        difference, while the body is without stress otherwise.
        """
        volumes = 6 * volumes_between(self.positions_mm, self._cells)
        stretches = np.tile(
            np.eye(3),
            (len(self._cells), 1, 1, 1),
        )
        ratios = volumes / self._cell_volumes
        may_be_flat = ratios < math.exp(-MIN_FLATTENING)
        if not may_be_flat.any():
            return stretches
        # only elements that the averages reach
        is_near = may_be_flat
        for _ in range(FLATTENING_ROUNDS):
            is_near = self._incidence.T @ (self._incidence @ is_near) > 0
        near = np.flatnonzero(is_near)
        incidence = self._incidence[:, near]
        logs = log_stretch(
            self._edges(near) @ self._inverse_edges[near],
            left=True,
        )
        volumes_around = (self._incidence @ volumes)[:, None]
        around = packed(logs)
        for _ in range(FLATTENING_ROUNDS):
            sums = incidence @ (volumes[near, None] * around)
            at_vertices = sums / volumes_around
            around = at_vertices[self._cells[near]].mean(axis=1)
        excess = logs - unpacked(around)
        grown = np.trace(logs, axis1=1, axis2=2)
        grown_more = np.trace(excess, axis1=1, axis2=2)
        lost = -np.maximum(grown, grown_more)
        flat = np.flatnonzero(may_be_flat[near] & (lost > MIN_FLATTENING))
        range_of_loss = MAX_FLATTENING - MIN_FLATTENING
        weight = np.minimum(
            (lost[flat] - MIN_FLATTENING) / range_of_loss,
            1.0,
        )
        taken_back = weight[:, None, None] * excess[flat]
        stretches[near[flat], 0] = _exponential(taken_back, MAX_OPENING)
        return stretches


def _nearness(
    places: Floats,
    faults: Floats,
    length_mm: float,
) -> Floats:
    """Return how near (n, 3) places are to (k, 3) faults: 1 there, and falling off as a
    Gaussian with `UNTANGLING_REACH` lengths; 0 beyond `FARTHEST` of these reaches."""
    reach_mm = UNTANGLING_REACH * length_mm
    # infinite beyond the bound
    distance, _ = cKDTree(faults).query(
        places,
        distance_upper_bound=FARTHEST * reach_mm,
    )
    return np.asarray(np.exp(-((distance / reach_mm) ** 2)))


def _exponential(logs: Floats, limit: float) -> Floats:
    """Return exp(L) of symmetric (..., 3, 3) matrices; principal values beyond the
    limit count as this."""
    values, axes = np.linalg.eigh(logs)
    return from_principal(
        np.exp(np.clip(values, -limit, limit)),
        axes,
    )


def _inverse_exponential(logs: Floats) -> Floats:
    """Return exp(−L) of small (..., 3, 3) matrices to fourth order in L: to 1e-7 for
    growth of a tenth."""
    result = np.eye(3) - logs / 4
    for order in (3, 2, 1):
        result = np.eye(3) - logs @ result / order
    return result
