"""The discrete problem of one step: energy, residual and tangent on the updated
reference."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import basix.ufl
import dolfinx
import numpy as np
import ufl
from dolfinx.la import InsertMode, MatrixCSR
from petsc4py import PETSc

from ..geometry.jacobians import determinants
from ..geometry.tetrahedra import PIECES_OF_ORDER, whole_faces
from ..geometry.triangles import Floats, Indices, Ints
from ..mechanics.materials import Material
from ..settings.terms import LEFT_CONTACT, RIGHT_CONTACT
from ..units import M_PER_MM
from .compilation import form_compiler
from .domain import Domain
from .linear_elements import ElementTotals, LinearElements
from .points import IntegrationPoints
from .tangent import ElasticMatrix, LaggedTangent, Residual, RigidMotions, Tangent
from .zones import Zones

PLANE_PENALTY_PA_PER_M = 5.0e5
"""Pressure of the fissure's planes per depth of penetration, ε_N of the FetalFoldSim
paper, whose contact they are."""
FACET_DEGREE = {1: 2, 2: 4}
"""Degree of integration on facets by the order of the elements."""


class Contribution(Protocol):
    """A further term of the energy, such as contact, as a function of displacements u
    (k, 3) of the local nodes in m.

    The energy is in J and the same on all ranks; forces are its derivative by the owned
    components, in N; stiffness is in N/m, None if it is zero.
    """

    def energy(self, u: Floats) -> float: ...
    def add_forces(self, u: Floats, out: Floats) -> None: ...
    def stiffness(self, u: Floats, *, convex: bool = False) -> PETSc.Mat | None: ...
    def max_step(self, u: Floats, direction: Floats) -> float: ...


@dataclass(frozen=True, eq=False)
class Forms:
    """Compiled forms of an energy and its first and second derivative."""

    energy: dolfinx.fem.Form
    residual: dolfinx.fem.Form
    tangent: dolfinx.fem.Form


@dataclass(frozen=True, eq=False)
class _ElementForces:
    """Forces (3 k,) in N of a rank's linear elements, and their totals, at a
    displacement (k, 3) in m from (n, 3) positions."""

    positions: Floats
    displacement: Floats
    forces: Floats
    totals: ElementTotals


class NonlinearProblem:
    """Energy, residual and tangent of one step, as functions of the displacement.

    Displacements `u` (k, 3) are those of the local nodes with ghosts, in m, from the
    mesh as it is placed. All else that differs between steps is set by `set_step`.

    With `has_planes`, planes at the fissure press back by `PLANE_PENALTY_PA_PER_M`.

    Attributes: further `contributions` to the energy (without any, it is convex except
    for large rotations), whether the body is `free` of
    supports, and the q integration `points` of each element.
    """

    def __init__(
        self,
        domain: Domain,
        zones: Zones,
        material: Material,
        *,
        has_planes: bool = False,
    ) -> None:
        self.domain = domain
        self.free = zones.free
        self.contributions: list[Contribution] = []
        # the coefficient of compiled forms; each evaluation sets it
        self._u = dolfinx.fem.Function(domain.space)
        self._forces = dolfinx.la.vector(
            domain.space.dofmap.index_map,
            3,
        )
        self.points = IntegrationPoints.for_order(domain.order)
        # coordinates in the regular element, and parts of its volume
        self._places = self.points.barycentric[:, 1:].copy()
        self._volumes = self.points.weights / 6
        self._weight = self._field_at_points(())
        self._H = self._field_at_points((3, 3))
        # a constant, so that another value needs no new form
        ratio = dolfinx.fem.Constant(domain.mesh, material.bulk_to_shear_ratio)
        moduli = self._weight, ratio * self._weight
        deformation = ufl.Identity(3) + ufl.grad(self._u)
        elastic = deformation * self._H
        self._tensors = {
            "deformation": deformation,
            "elastic": elastic,
            "stress": material.cauchy_stress(elastic, *moduli),
        }
        self._expressions: dict[str, dolfinx.fem.Expression] = {}
        dx = self._volume_measure()
        self._linear: LinearElements | None = None
        self._last_forces: _ElementForces | None = None
        self._energy: ufl.Form | int = 0
        if domain.order == 1:
            # written by hand, instead of the form compiler's code
            self._linear = LinearElements(domain, material)
        else:
            self._energy = material.energy_density(elastic, *moduli) * dx
        if has_planes:
            self._energy = self._energy + self._plane_energy(zones)

        trial = ufl.TrialFunction(domain.space)
        coupling = self._compiled(ufl.inner(trial, ufl.TestFunction(domain.space)) * dx)
        fixed = domain.local(zones.fixed)[: domain.n_owned]
        self._fixed_owned = np.flatnonzero(fixed.ravel())
        first_node, _ = domain.space.dofmap.index_map.local_range
        fixed_global = 3 * first_node + self._fixed_owned
        self._fixed_global = fixed_global.astype(PETSc.IntType)
        matrix = ElasticMatrix(coupling, self._add_stiffness, fixed)
        self._tangent = Tangent(LaggedTangent(matrix, domain), domain)
        n_cells = len(domain.cells)
        n_points = len(self.points.weights)
        no_growth = np.tile(
            np.eye(3),
            (n_cells, n_points, 1, 1),
        )
        self.set_step(np.zeros((n_cells, n_points)), no_growth)

    def _volume_measure(self) -> ufl.Measure:
        # as tuples, since arrays are shortened in the names of compiled forms
        metadata = {
            "quadrature_rule": "custom",
            "quadrature_points": tuple(map(tuple, self._places)),
            "quadrature_weights": tuple(self._volumes),
        }
        return ufl.dx(metadata=metadata)

    def _plane_energy(self, zones: Zones) -> ufl.Form | int:
        """Return the form of the energy of the fissure's planes, ε/2 ⟨penetration⟩²
        integrated over the walls; 0 without walls.

        The left hemisphere stays below its plane, the right one above.
        """
        if not len(zones.vertices_of(LEFT_CONTACT, RIGHT_CONTACT)):
            return 0
        mesh = self.domain.mesh
        penalty = dolfinx.fem.Constant(mesh, PLANE_PENALTY_PA_PER_M)
        left_mm, right_mm = zones.planes_mm
        left = dolfinx.fem.Constant(mesh, left_mm * M_PER_MM)
        right = dolfinx.fem.Constant(mesh, right_mm * M_PER_MM)
        ds = ufl.ds(
            domain=mesh,
            subdomain_data=_facet_tags(self.domain, zones),
            metadata={"quadrature_degree": FACET_DEGREE[self.domain.order]},
        )
        x = ufl.SpatialCoordinate(mesh)[0] + self._u[0]
        energy = 0
        for depth, wall in ((x - left, LEFT_CONTACT), (right - x, RIGHT_CONTACT)):
            energy += penalty / 2 * ufl.max_value(depth, 0) ** 2 * ds(wall)
        return energy

    def _compiled(self, form: ufl.Form) -> dolfinx.fem.Form:
        with form_compiler(self.domain.comm) as options:
            return dolfinx.fem.form(form, jit_options=options)

    @cached_property
    def _forms(self) -> Forms | None:
        """The form compiler's part of the energy with its derivatives, None if it has
        none."""
        if not self._energy:
            return None
        residual = ufl.derivative(self._energy, self._u)
        tangent = ufl.derivative(residual, self._u)
        return Forms(
            self._compiled(self._energy),
            self._compiled(residual),
            self._compiled(tangent),
        )

    def _field_at_points(self, shape: tuple[int, ...]) -> dolfinx.fem.Function:
        element = basix.ufl.quadrature_element(
            "tetrahedron",
            shape,
            points=self._places,
            weights=self._volumes,
        )
        space = dolfinx.fem.functionspace(self.domain.mesh, element)
        return dolfinx.fem.Function(space)

    def set_step(
        self,
        mu: Floats,
        G_inverse: Floats,
        V: Floats | None = None,
        part: Ints | None = None,
    ) -> None:
        """Set the coefficients of a step, on the mesh as it is placed now.

        At the integration points of the local elements: the shear modulus (c, q) in Pa,
        the inverse (c, q, 3, 3) of the growth tensor and the elastic left stretch V (c,
        q, 3, 3) that the mesh has, by default none. `part` (n,) are numbers of the
        vertices' parts, by default the connected parts; in a free body the rigid
        motions of each part are removed.

        The energy is the integral of ψ(F·H; w) over the mesh as it is placed, with H =
        V·G⁻¹ and w = μ/det V. That is finite growth (Rodriguez et al. 1994) on the
        updated reference, per volume of the state without stress, since ψ is
        proportional to μ.
        """
        weight = mu
        H = G_inverse
        self._det_V = np.ones_like(mu)
        if V is not None:
            self._det_V = determinants(V)
            weight = mu / self._det_V
            H = V @ G_inverse
        _set_at_points(self._weight, weight)
        _set_at_points(self._H, H)
        if self._linear:
            self._linear.weight = np.ascontiguousarray(weight)
            self._linear.H = np.ascontiguousarray(H)
        self._last_forces = None
        self._tangent.elastic.forget()
        if self.free:
            part = self.domain.part if part is None else part
            self._tangent.motions = RigidMotions(self.domain, part)

    def rest(self) -> Floats:
        """Return a displacement of zero."""
        return np.zeros((len(self.domain.vertex_of_node), 3))

    def without_rigid_motion(self, u: Floats) -> Floats:
        """Return a displacement without the rigid motions of a free body; that of
        another body as it is."""
        if self._tangent.motions is None:
            return u
        owned = u[: self.domain.n_owned].flatten()
        self._tangent.motions.remove(owned)
        return self.domain.with_ghosts(owned)

    def evaluate(
        self, name: Literal["deformation", "elastic", "stress"], u: Floats
    ) -> Floats:
        """Return (c, q, 3, 3) tensors at the integration points of the local elements;
        collective over the ranks.

        `deformation` is the step's F, `elastic` its Fe = F·V·G⁻¹, and `stress`
        Cauchy's, in Pa, of ψ(Fe; μ).
        """
        self._load(u)
        if name not in self._expressions:
            with form_compiler(self.domain.comm) as options:
                self._expressions[name] = dolfinx.fem.Expression(
                    self._tensors[name], self._places, jit_options=options
                )
        cells = np.arange(
            len(self.domain.cells),
            dtype=np.int32,
        )
        values = self._expressions[name].eval(self.domain.mesh, cells)
        tensors = values.reshape(
            len(cells),
            -1,
            3,
            3,
        )
        if name == "stress":
            # that of w = μ/det V
            tensors = tensors * self._det_V[..., None, None]
        return tensors

    def _load(self, u: Floats) -> Floats:
        self._u.x.array[:] = u.ravel()
        return self._u.x.array.reshape(-1, 3)

    def _elements_at(self, linear: LinearElements, u: Floats) -> _ElementForces:
        """Return the forces and totals of linear elements. Those of the last
        displacement are cached."""
        last = self._last_forces
        positions = self.domain.positions
        if (
            last is None
            or last.positions is not positions
            or not np.array_equal(last.displacement, u)
        ):
            u = u.copy()
            forces = np.zeros(u.size)
            totals = linear.assemble(u, forces=forces)
            last = _ElementForces(positions, u, forces, totals)
            self._last_forces = last
        return last

    def volume_range(self, u: Floats) -> tuple[float, float]:
        """Return the smallest and the largest det F of all ranks' elements, NaN if one
        is; in quadratic elements, those at the nodes."""
        domain = self.domain
        if self._linear:
            totals = self._elements_at(self._linear, u).totals
            ends = np.array([totals.smallest, -totals.largest])
        else:
            ratios = domain.volume_ratios(u)
            ends = np.array([ratios.min(initial=np.inf), -ratios.max(initial=-np.inf)])
        smallest, negative = (domain.min_over_ranks(end) for end in ends)
        return smallest, -negative

    def keeps_volume(self, u: Floats) -> bool:
        """Return whether no element is inverted anywhere."""
        if self._linear:
            return self.volume_range(u)[0] > 0  # false for NaN
        return self.domain.smallest_volume_ratio(u) > 0

    def energy(self, u: Floats) -> float:
        """Return the total energy in J, contact included."""
        self._load(u)
        local = 0.0
        if self._linear:
            local += self._elements_at(self._linear, u).totals.energy
        if self._forms:
            local += float(np.real(dolfinx.fem.assemble_scalar(self._forms.energy)))
        total = self.domain.comm.allreduce(local)
        return total + sum(part.energy(u) for part in self.contributions)

    def residual(self, u: Floats) -> Residual:
        """Return the forces (N) at a displacement, zero where it is fixed: the elastic
        ones, with those of the fissure's planes, and all. A free body's have no rigid
        motions."""
        self._load(u)
        forces = self._forces
        forces.array[:] = 0.0
        if self._linear:
            forces.array[:] = self._elements_at(self._linear, u).forces
        if self._forms:
            dolfinx.fem.assemble_vector(forces.array, self._forms.residual)
        forces.scatter_reverse(InsertMode.add)
        elastic = forces.array[: 3 * self.domain.n_owned].copy()
        self.clear_fixed(elastic)
        total = elastic.copy()
        for contribution in self.contributions:
            contribution.add_forces(u, total)
        self.clear_fixed(total)
        if self._tangent.motions is not None:
            self._tangent.motions.remove(total)
        return Residual(
            u,
            elastic,
            total,
            self.domain.norm(total),
        )

    def clear_fixed(self, owned: Floats) -> None:
        """Set the fixed components among the owned ones (3 · n_owned,) to exactly 0."""
        owned[self._fixed_owned] = 0.0

    def _add_stiffness(self, u: Floats, blocks: MatrixCSR) -> None:
        u = self._load(u)
        if self._linear:
            self._linear.assemble(u, matrix=blocks)
        if self._forms:
            dolfinx.fem.assemble_matrix(blocks, self._forms.tangent)

    def tangent(self, at: Residual, *, within: float = 0.0) -> Tangent:
        """Return the tangent in N/m at a residual's displacement, with unit rows and
        columns of fixed components.

        Its elastic part may be lagged, that is of an earlier iterate, if it predicts
        the change of the elastic forces since then with a relative error of at most
        `within`. All calls return the same object.
        """
        # petsc4py keeps objects that several ranks share until all ranks agree to
        # destroy them
        PETSc.garbage_cleanup(self.domain.comm)
        self._tangent.elastic.update(at, within)
        self._tangent.parts = self._stiffness_parts(at.displacement, convex=False)
        return self._tangent

    def convexify(self, tangent: Tangent, u: Floats) -> None:
        """Make the contributions' parts of the tangent at a displacement positive
        semidefinite."""
        tangent.parts = self._stiffness_parts(u, convex=True)

    def _stiffness_parts(self, u: Floats, *, convex: bool) -> list[PETSc.Mat]:
        parts = []
        for contribution in self.contributions:
            part = contribution.stiffness(u, convex=convex)
            if part is not None:
                part.zeroRowsColumns(self._fixed_global, diag=0.0)
                parts.append(part)
        return parts

    def max_step(self, u: Floats, direction: Floats) -> float:
        """Return the largest fraction, up to 1, of a direction (k, 3) in m that all
        contributions allow to add to u."""
        steps = [part.max_step(u, direction) for part in self.contributions]
        return min(steps, default=1.0)


def _facet_tags(domain: Domain, zones: Zones) -> dolfinx.mesh.MeshTags:
    """Return the zones of the local boundary facets.

    The four triangles of a quadratic element's face have one zone. ValueError where the
    facets of the zones are not the boundary.
    """
    topology = domain.mesh.topology
    topology.create_entities(2)
    topology.create_connectivity(2, 3)
    local = dolfinx.mesh.exterior_facet_indices(topology)
    # the corners are the first three nodes
    nodes = dolfinx.mesh.entities_to_geometry(domain.mesh, 2, local)
    corners = nodes.reshape(len(local), -1)[:, :3]
    count = len(domain.positions)
    keys = _face_numbers(whole_faces(zones.facets, domain.order), count)
    local_faces = domain.mesh.geometry.input_global_indices[corners]
    local_keys = _face_numbers(local_faces, count)
    order = np.argsort(keys)
    place = np.searchsorted(keys, local_keys, sorter=order)
    index = order[place.clip(max=len(order) - 1)]
    if (keys[index] != local_keys).any():
        raise ValueError("the facets are not the boundary of the mesh")
    face_zone = zones.facet_zone[:: PIECES_OF_ORDER[domain.order]]
    tags = face_zone[index].astype(np.int32)
    return dolfinx.mesh.meshtags(domain.mesh, 2, local, tags)


def _face_numbers(faces: Indices, count: int) -> Ints:
    """Return one number (f,) for each face, whatever the order of its vertices, of
    which there are `count`."""
    low, middle, high = np.sort(faces, axis=1).astype(np.int64).T
    return (low * count + middle) * count + high


def _set_at_points(field: dolfinx.fem.Function, values: Floats) -> None:
    """Set a field at integration points to (c, q, ...) values."""
    dofmap = field.function_space.dofmap
    places = dofmap.list
    by_place = field.x.array.reshape(-1, dofmap.bs)
    by_place[places] = values.reshape(*places.shape, -1)
