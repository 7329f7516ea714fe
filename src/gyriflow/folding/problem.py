"""The discrete problem of one step: energy, residual and tangent on the updated reference.

With `domain` and `block_matrix`, the only files that use dolfinx: what differs between its versions is kept to them.
"""

from typing import Literal, Protocol

import basix.ufl
import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx.la import BlockMode
from numpy.typing import NDArray
from petsc4py import PETSc

from ..mechanics.fissure import contact_energy_density
from ..mechanics.growth import inverse_growth_tensor
from ..mechanics.kinematics import deformation_gradient, elastic_deformation
from ..mechanics.materials import Material
from ..parameters.terms import LEFT_CONTACT, RIGHT_CONTACT
from ..units import M_PER_MM
from .block_matrix import BlockMatrix
from .compilation import form_compiler
from .domain import Domain
from .multigrid import OrderHierarchy
from .points import IntegrationPoints
from .rigid import FreeOperator, RigidMotions
from .tangent import NODES_PER_TERM, SumOperator, Tangent
from .zones import Zones

Floats = NDArray[np.float64]


FACET_DEGREE = {1: 2, 2: 4}
"""Degree of integration on facets by the order of the elements."""


class Contribution(Protocol):
    """A further part of the energy, such as contact between folds; all of it at the problem's present displacement."""

    def energy(self) -> float:
        """Returns the energy in J, the same on every rank."""

    def add_residual(self, out: PETSc.Vec) -> None:
        """Adds the energy's derivative in N to the owned components of a vector."""

    def stiffness(self, *, convex: bool = False) -> PETSc.Mat | None:
        """Returns the energy's second derivative in N/m, or one made positive semidefinite; None where it is zero.

        A sum of terms that couple few nodes each (`NODES_PER_TERM`). Rows and columns of fixed components need no care.
        """

    def largest_step(self, direction: Floats) -> float:
        """Returns the part of (k, 3) local displacements that can safely be added: at most 1, equal on all ranks."""


class Problem:
    """Energy, residual and tangent of the displacement of one step.

    Parameters
    ----------
    domain, zones, material
        The mesh, its fixed zones, and what the tissue is made of.
    penalty_pa_per_m
        Pressure per depth of what passes the planes at the fissure; with 0 they hold nothing back.
    remembers_stress
        Whether the present mesh may be stretched elastically, see `set_stretch`.
    quadrature_degree
        Degree of the polynomials that are integrated exactly; None takes what the elements' order needs.

    Attributes
    ----------
    u : dolfinx.fem.Function
        The displacement of the step in m, the unknown.
    contributions : list of Contribution
        Further parts of the energy.
    free : bool
        Whether the body is unconstrained.
    hierarchy : OrderHierarchy or None
        The linear level below quadratic elements for multigrid, None for linear ones.
    kept_tangent : bool
        Whether the elastic part of the last tangent is that of an earlier displacement.
    points : IntegrationPoints
        Where stiffness, growth, normals and kept stretch are taken: q points in each element.
    """

    summed = False
    """Whether products are those of a sum also while there are no contributions."""

    def __init__(
        self,
        domain: Domain,
        zones: Zones,
        material: Material,
        *,
        penalty_pa_per_m: float = 0.0,
        quadrature_degree: int | None = None,
        remembers_stress: bool = False,
    ) -> None:
        self.domain = domain
        self.contributions: list[Contribution] = []
        mesh = domain.mesh
        self.u = dolfinx.fem.Function(domain.space)
        self.points = IntegrationPoints.of_degree(domain.order, quadrature_degree)
        # reference coordinates, and parts of the regular element's volume
        self._rule = self.points.places[:, 1:].copy(), self.points.weights / 6
        self._mu, self._dg, self._dr = (self._field_at_points(()) for _ in range(3))
        self._N = self._field_at_points((3,))

        # constants, so that other values need no other forms
        ratio = dolfinx.fem.Constant(mesh, material.bulk_to_shear_ratio)
        penalty = dolfinx.fem.Constant(mesh, penalty_pa_per_m)
        planes = [dolfinx.fem.Constant(mesh, plane * M_PER_MM) for plane in zones.planes_mm]
        tags = domain.local_facets(zones.facets, zones.facet_zone)
        names = "quadrature_points", "quadrature_weights"
        # as tuples, since arrays are shortened in the names of compiled forms
        rule = [tuple(tuple(row) for row in self._rule[0]), tuple(self._rule[1])]
        dx = ufl.dx(metadata={"quadrature_rule": "custom"} | dict(zip(names, rule, strict=True)))
        ds = ufl.ds(domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": FACET_DEGREE[domain.order]})

        F, Fg_inverse = deformation_gradient(self.u), inverse_growth_tensor(self._dg, self._dr, self._N)
        moduli = self._mu, ratio * self._mu
        if remembers_stress:
            self._V = self._field_at_points((3, 3))
            self.set_stretch(np.tile(np.eye(3), (len(domain.cells), len(self.points.weights), 1, 1)))
            Fe = elastic_deformation(F * self._V, Fg_inverse)
            # counted per volume of the state without stress
            energy = material.energy_density(Fe, *moduli) / ufl.det(self._V) * dx
        else:
            Fe = elastic_deformation(F, Fg_inverse)
            energy = material.energy_density(Fe, *moduli) * dx
        self._outcomes = {"deformation": F, "elastic": Fe, "stress": material.cauchy_stress(Fe, *moduli)}
        self._evaluated: dict[str, dolfinx.fem.Expression] = {}
        x = ufl.SpatialCoordinate(mesh)[0] + self.u[0]
        if penalty_pa_per_m and len(zones.vertices_of(LEFT_CONTACT, RIGHT_CONTACT)):
            energy += contact_energy_density(x, planes[0], -1, penalty) * ds(LEFT_CONTACT)
            energy += contact_energy_density(x, planes[1], +1, penalty) * ds(RIGHT_CONTACT)
        residual = ufl.derivative(energy, self.u)
        tangent = ufl.derivative(residual, self.u)
        with form_compiler(domain.comm) as options:
            self._energy, self._residual, self._tangent = (
                dolfinx.fem.form(form, jit_options=options) for form in (energy, residual, tangent)
            )

        fixed = domain.local(zones.fixed)[: domain.owned]
        self._fixed_owned = np.flatnonzero(fixed.ravel())
        first = 3 * domain.space.dofmap.index_map.local_range[0]
        self._fixed_global = (first + self._fixed_owned).astype(PETSc.IntType)
        self._blocks = BlockMatrix(dolfinx.fem.create_matrix(self._tangent, block_mode=BlockMode.compact), fixed)
        self.hierarchy = OrderHierarchy(domain, fixed) if domain.order == 2 else None
        self._sum: SumOperator | None = None
        self._present: Tangent | None = None
        self.kept_tangent = False
        self._elastic: tuple[PETSc.Mat, PETSc.Mat] | None = None  # its elastic part, as a whole and for products
        self.free = zones.free
        self.vector = self.u.x.petsc_vec
        # elastic forces last asked for; displacement and forces when the tangent was; for products
        self._forces, self._known_u, self._known_forces, self._change, self._product = (
            self.new_vector() for _ in range(5)
        )
        self._motions: RigidMotions | None = None
        self._free_operator = FreeOperator(self.vector) if self.free else None
        self.mesh_moved(domain.part)

    def _field_at_points(self, shape: tuple[int, ...]) -> dolfinx.fem.Function:
        """Returns a field with values at the integration points alone."""
        element = basix.ufl.quadrature_element("tetrahedron", shape, points=self._rule[0], weights=self._rule[1])
        return dolfinx.fem.Function(dolfinx.fem.functionspace(self.domain.mesh, element))

    @property
    def quadratic(self) -> bool:
        """Whether the energy is quadratic, so that a linear solve ends a step."""
        return False

    def mesh_moved(self, part: NDArray[np.int64]) -> None:
        """Takes note of a mesh that has been placed anew.

        Where the body is unconstrained, its rigid motions are taken out of each of the parts that the (n,) numbers of
        all vertices name.
        """
        self._elastic = None
        if self._free_operator is not None:
            self._motions = RigidMotions(self.domain, part)
            self._free_operator.set_motions(self._motions)

    def admissible(self, values: Floats) -> Floats:
        """Returns (k, 3) displacements of the local nodes in m without the rigid motions of an unconstrained body."""
        if self._motions is None:
            return values
        self.displacement[:] = values
        self._motions.remove(self.displacement[: self.domain.owned].reshape(-1))
        self.u.x.scatter_forward()
        return self.displacement.copy()

    def near_null_space(self) -> PETSc.NullSpace:
        """Returns the rigid motions of the present mesh as a whole."""
        return RigidMotions(self.domain, np.zeros_like(self.domain.part)).null_space(self.vector)

    def set_layers(self, mu: Floats, dg: Floats, dr: Floats, normals: Floats) -> None:
        """Sets smooth layers: shear modulus (Pa) and growth (k,) at the local nodes, unit normals (c, 3) of cells."""
        modulus, along, across = (nodal[self.domain.cells] @ self.points.smooth.T for nodal in (mu, dg, dr))
        repeated = np.repeat(normals[:, None], len(self.points.weights), axis=1)
        self.set_layers_at_points(modulus, along, across, repeated)

    def set_layers_at_points(self, mu: Floats, dg: Floats, dr: Floats, normals: Floats) -> None:
        """Sets shear modulus (Pa) and growth increments (c, q), and unit normals (c, q, 3), at integration points."""
        self._elastic = None
        for function, values in ((self._mu, mu), (self._dg, dg), (self._dr, dr), (self._N, normals)):
            set_at_points(function, values)

    def set_stretch(self, V: Floats) -> None:
        """Sets the elastic left stretch (c, q, 3, 3) that the present mesh has kept at the integration points."""
        self._elastic = None
        set_at_points(self._V, V)

    def outcome(self, name: Literal["deformation", "elastic", "stress"]) -> Floats:
        """Returns the (c, q, 3, 3) tensors at the integration points of the local elements; all ranks have to ask.

        `deformation` is the step's F and `elastic` its Fe = F·V·Fg⁻¹; `stress` is Cauchy's, in Pa, of the energy that
        is minimised. They refer to the mesh before the step: while it has not been placed anew.
        """
        if name not in self._evaluated:
            with form_compiler(self.domain.comm) as options:
                expression = dolfinx.fem.Expression(self._outcomes[name], self._rule[0], jit_options=options)
            self._evaluated[name] = expression
        cells = np.arange(len(self.domain.cells), dtype=np.int32)
        return self._evaluated[name].eval(self.domain.mesh, cells).reshape(len(cells), -1, 3, 3)

    @property
    def displacement(self) -> Floats:
        """The (k, 3) displacements in m of the local nodes: a view."""
        return self.u.x.array.reshape(-1, 3)

    def set_displacement(self, values: Floats) -> None:
        """Sets the (k, 3) displacements of the local nodes in m."""
        self.displacement[:] = values

    def energy(self) -> float:
        """Returns the total energy in J, contact included."""
        return self.elastic_energy() + sum(part.energy() for part in self.contributions)

    def elastic_energy(self) -> float:
        """Returns the energy in J of all but the contributions."""
        local = dolfinx.fem.assemble_scalar(self._energy)
        return float(np.real(self.domain.comm.allreduce(local)))

    def residual(self, out: PETSc.Vec) -> float:
        """Assembles the residual in N into `out`, zero where the displacement is fixed, and returns its norm."""
        self._elastic_residual(out)
        out.array[self._fixed_owned] = 0.0
        out.copy(self._forces)
        for part in self.contributions:
            part.add_residual(out)
        out.array[self._fixed_owned] = 0.0
        if self._motions is not None:
            self._motions.remove(out.array_w)
        return out.norm()

    def _elastic_residual(self, out: PETSc.Vec) -> None:
        """Assembles the residual of all but the contributions."""
        with out.localForm() as local:
            local.set(0.0)
        dolfinx.fem.petsc.assemble_vector(out, self._residual)
        out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)

    def tangent(self, *, within: float = 0.0) -> Tangent:
        """Returns the assembled tangent in N/m, that of the unit matrix where the displacement is fixed.

        Terms of the contributions are those of the present displacement. The elastic part may be that of an earlier
        displacement in the same step, where it has foretold, but for a part `within`, how forces changed since it was
        last asked for; with `within` above 0 the residual must have been asked for last where the tangent is.
        """
        # petsc4py keeps what several ranks share until all of them agree to let go of it
        PETSc.garbage_cleanup(self.domain.comm)
        if self._present is not None:
            self._present.set_parts(())  # else its further blocks would stay on the diagonal
        self.kept_tangent = self._elastic is not None and within > 0 and self._foretold(within)
        if self._elastic is None or not self.kept_tangent:
            self._elastic = self._elastic_tangent()
        self.vector.copy(self._known_u)
        self._forces.copy(self._known_forces)
        matrix, products = self._elastic
        if not (self.contributions or self.summed):
            self._present = Tangent(matrix, products, ())
            return self._present
        if self._sum is None:
            # one object for all iterates, since multigrid keeps the first it is given
            self._sum = SumOperator(products)
            self._sum_matrix = self._sum.as_matrix()
        parts = self._further_parts(convex=False)
        self._present = Tangent(matrix, self._sum_matrix, parts, NODES_PER_TERM[self.domain.order])
        return self._present

    def _foretold(self, within: float) -> bool:
        """Returns whether the kept elastic tangent foretells, but for a part, the change of forces since last asked."""
        assert self._elastic is not None
        self._change.waxpy(-1.0, self._known_u, self.vector)
        self._elastic[1].mult(self._change, self._product)
        foretold = self._product.norm()
        self._product.axpy(1.0, self._known_forces)
        self._product.axpy(-1.0, self._forces)
        return bool(self._product.norm() <= within * foretold)

    def _elastic_tangent(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        """Returns the tangent of all but the contributions, as a whole and for products."""
        blocks = self._blocks.blocks
        blocks.set_value(0.0)
        dolfinx.fem.assemble_matrix(blocks, self._tangent)
        return self._blocks.assembled(), self._blocks.for_products()

    def convexify(self, tangent: Tangent) -> None:
        """Makes the contributions' terms in the present tangent positive semidefinite."""
        tangent.set_parts(self._further_parts(convex=True))

    def _further_parts(self, *, convex: bool) -> list[PETSc.Mat]:
        """Returns the contributions' tangents, without entries of fixed components, and has the products know them."""
        assert self._sum is not None
        parts = [part for part in (part.stiffness(convex=convex) for part in self.contributions) if part is not None]
        for part in parts:
            part.zeroRowsColumns(self._fixed_global, diag=0.0)
        self._sum.parts = parts
        return parts

    def hold(self, direction: PETSc.Vec) -> None:
        """Sets the fixed components of a direction to exactly 0, which preconditioners miss by their tolerance."""
        direction.array[self._fixed_owned] = 0.0

    def operator(self, tangent: PETSc.Mat) -> PETSc.Mat:
        """Returns what a tangent does to admissible displacements: for a free body, without rigid motions."""
        if self._free_operator is None:
            return tangent
        self._free_operator.set_tangent(tangent)
        return self._free_operator.matrix

    def largest_step(self, direction: Floats) -> float:
        """Returns the part of (k, 3) local displacements in m that all contributions allow to add, at most 1."""
        return min((part.largest_step(direction) for part in self.contributions), default=1.0)

    def new_vector(self) -> PETSc.Vec:
        """Returns a vector for residuals and directions, without values."""
        return self.vector.duplicate()

    def volume_ratios(self) -> Floats:
        """Returns det F of the local elements: (c, 1), or (c, 10) at the nodes of quadratic ones."""
        return self.domain.volume_ratios(self._moved())

    def smallest_volume_ratio(self) -> float:
        """Returns a number that det F is nowhere below: positive only where no element is inside out anywhere."""
        return self.domain.smallest_volume_ratio(self._moved())

    def _moved(self) -> Floats:
        """Returns the (k, 3) positions in m of the local nodes after the displacement."""
        return np.asarray(self.domain.local(self.domain.positions) + self.displacement)


def set_at_points(field: dolfinx.fem.Function, values: Floats) -> None:
    """Gives a field at integration points its (c, q, ...) values."""
    places = field.function_space.dofmap.list
    field.x.array.reshape(-1, field.function_space.dofmap.bs)[places] = values.reshape(*places.shape, -1)
