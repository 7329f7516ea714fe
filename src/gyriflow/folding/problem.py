"""The discrete problem of one step: energy, residual and tangent on the updated reference.

With `domain` and `tangent`, the only files that use dolfinx: what differs between its versions is kept to them.
"""

from functools import cached_property
from typing import Literal

import basix.ufl
import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx.la import MatrixCSR
from numpy.typing import NDArray
from petsc4py import PETSc

from ..geometry.triangles import Floats
from ..mechanics.materials import Material
from ..settings.terms import LEFT_CONTACT, RIGHT_CONTACT
from ..units import M_PER_MM
from .compilation import form_compiler
from .contact import SelfContact
from .domain import Domain
from .linear_elements import LinearElements
from .points import IntegrationPoints
from .tangent import ElasticMatrix, KeptTangent, RigidMotions, Tangent
from .zones import Zones

FACET_DEGREE = {1: 2, 2: 4}
"""Degree of integration on facets by the order of the elements."""


class Problem:
    """Energy, residual and tangent of the displacement of one step.

    Planes at the fissure press back with `penalty_pa_per_m` per depth, with 0 not at all. With `remembers_stress` the
    present mesh may be stretched elastically (`set_stretch`). `quadrature_degree` is that of the polynomials that are
    integrated exactly; None takes what the elements' order needs.

    Attributes: the unknown displacement `u` in m, further `contributions` to the energy, such as contact between
    folds, whether the body is `free`, and the q `points` of each element at which stiffness, growth and kept stretch
    are taken.
    """

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
        self.contributions: list[SelfContact] = []
        mesh = domain.mesh
        self.u = dolfinx.fem.Function(domain.space)
        self.points = IntegrationPoints.of_degree(domain.order, quadrature_degree)
        # reference coordinates, and parts of the regular element's volume
        self._rule = self.points.places[:, 1:].copy(), self.points.weights / 6
        self._mu, self._G_inverse = self._field_at_points(()), self._field_at_points((3, 3))
        undeformed = np.tile(np.eye(3), (len(domain.cells), len(self.points.weights), 1, 1))
        set_at_points(self._G_inverse, undeformed)

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

        # finite growth (Rodriguez et al. 1994) on the updated reference
        F = ufl.Identity(3) + ufl.grad(self.u)
        moduli = self._mu, ratio * self._mu
        if remembers_stress:
            self._V = self._field_at_points((3, 3))
            set_at_points(self._V, undeformed)
            Fe = F * self._V * self._G_inverse
            # counted per volume of the state without stress
            energy = material.energy_density(Fe, *moduli) / ufl.det(self._V) * dx
        else:
            Fe = F * self._G_inverse
            energy = material.energy_density(Fe, *moduli) * dx
        # in the place of the form compiler's code where there is code of our own
        self._linear: LinearElements | None = None
        if domain.order == 1 and len(self.points.weights) == 1 and not remembers_stress:
            self._linear, energy = LinearElements(domain, material), 0
        self._outcomes = {"deformation": F, "elastic": Fe, "stress": material.cauchy_stress(Fe, *moduli)}
        self._evaluated: dict[str, dolfinx.fem.Expression] = {}
        x = ufl.SpatialCoordinate(mesh)[0] + self.u[0]
        if penalty_pa_per_m and len(zones.vertices_of(LEFT_CONTACT, RIGHT_CONTACT)):
            # ε/2 ⟨penetration⟩² per area: the left hemisphere stays below its plane, the right one above
            for beyond, tag in ((x - planes[0], LEFT_CONTACT), (planes[1] - x, RIGHT_CONTACT)):
                energy += penalty / 2 * ufl.max_value(beyond, 0) ** 2 * ds(tag)
        self._energy = energy
        (coupling,) = self._compiled(ufl.inner(ufl.TrialFunction(domain.space), ufl.TestFunction(domain.space)) * dx)

        fixed = domain.local(zones.fixed)[: domain.owned]
        self._fixed_owned = np.flatnonzero(fixed.ravel())
        first = 3 * domain.space.dofmap.index_map.local_range[0]
        self._fixed_global = (first + self._fixed_owned).astype(PETSc.IntType)
        self.free = zones.free
        self.vector = self.u.x.petsc_vec
        self._elastic = KeptTangent(ElasticMatrix(coupling, self._add_stiffness, fixed), self.vector)
        self._tangent = Tangent(self._elastic, self.vector)
        self.mesh_moved(domain.part)

    def _compiled(self, *forms: ufl.Form) -> list[dolfinx.fem.Form]:
        with form_compiler(self.domain.comm) as options:
            return [dolfinx.fem.form(form, jit_options=options) for form in forms]

    @cached_property
    def _forms(self) -> list[dolfinx.fem.Form]:
        """The energy, its residual and its tangent, as far as the form compiler has a part in them."""
        if not self._energy:
            return []
        residual = ufl.derivative(self._energy, self.u)
        return self._compiled(self._energy, residual, ufl.derivative(residual, self.u))

    def _field_at_points(self, shape: tuple[int, ...]) -> dolfinx.fem.Function:
        element = basix.ufl.quadrature_element("tetrahedron", shape, points=self._rule[0], weights=self._rule[1])
        return dolfinx.fem.Function(dolfinx.fem.functionspace(self.domain.mesh, element))

    def mesh_moved(self, part: NDArray[np.int64]) -> None:
        """Take note of a mesh that has been placed anew.

        Where the body is unconstrained, its rigid motions are taken out of each of the parts that the (n,) numbers of
        all vertices name.
        """
        self._elastic.forget()
        if self.free:
            self._tangent.motions = RigidMotions(self.domain, part)

    def admissible(self, values: Floats) -> Floats:
        """Return (k, 3) displacements of the local nodes in m without the rigid motions of an unconstrained body."""
        if self._tangent.motions is None:
            return values
        self.displacement[:] = values
        self._tangent.motions.remove(self.displacement[: self.domain.owned].reshape(-1))
        self.u.x.scatter_forward()
        return self.displacement.copy()

    def set_shear_modulus(self, mu: Floats) -> None:
        """Set the shear modulus (c, q) in Pa at the integration points."""
        self._elastic.forget()
        set_at_points(self._mu, mu)
        if self._linear:
            self._linear.mu = mu

    def set_growth(self, G_inverse: Floats) -> None:
        """Set the inverse (c, q, 3, 3) of the step's growth tensor at the integration points."""
        self._elastic.forget()
        set_at_points(self._G_inverse, G_inverse)
        if self._linear:
            self._linear.G_inverse = G_inverse

    def set_stretch(self, V: Floats) -> None:
        """Set the elastic left stretch (c, q, 3, 3) that the present mesh has kept at the integration points."""
        self._elastic.forget()
        set_at_points(self._V, V)

    def outcome(self, name: Literal["deformation", "elastic", "stress"]) -> Floats:
        """Return the (c, q, 3, 3) tensors at the integration points of the local elements; all ranks have to ask.

        `deformation` is the step's F and `elastic` its Fe = F·V·G⁻¹; `stress` is Cauchy's, in Pa, of the energy that
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
        """Set the (k, 3) displacements of the local nodes in m."""
        self.displacement[:] = values

    def energy(self) -> float:
        """Return the total energy in J, contact included."""
        local = self._linear.assemble(self.displacement) if self._linear else 0.0
        if self._forms:
            local += float(np.real(dolfinx.fem.assemble_scalar(self._forms[0])))
        return self.domain.comm.allreduce(local) + sum(part.energy() for part in self.contributions)

    def residual(self, out: PETSc.Vec) -> float:
        """Assemble the residual in N into `out`, zero where the displacement is fixed, and return its norm."""
        with out.localForm() as local:
            local.set(0.0)
            if self._linear:
                self._linear.assemble(self.displacement, forces=local.array_w)
        if self._forms:
            dolfinx.fem.petsc.assemble_vector(out, self._forms[1])
        out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        out.array[self._fixed_owned] = 0.0
        self._elastic.note_forces(out)
        for part in self.contributions:
            part.add_residual(out)
        out.array[self._fixed_owned] = 0.0
        if self._tangent.motions is not None:
            self._tangent.motions.remove(out.array_w)
        return out.norm()

    def _add_stiffness(self, blocks: MatrixCSR) -> None:
        if self._linear:
            self._linear.assemble(self.displacement, matrix=blocks)
        if self._forms:
            dolfinx.fem.assemble_matrix(blocks, self._forms[2])

    def tangent(self, *, within: float = 0.0) -> Tangent:
        """Return the assembled tangent in N/m, that of the unit matrix where the displacement is fixed.

        Terms of the contributions are those of the present displacement. The elastic part may be a kept one where its
        error is at most a part `within`, see `KeptTangent.at`; the residual must then have been assembled at this
        displacement.
        """
        # petsc4py keeps what several ranks share until all of them agree to let go of it
        PETSc.garbage_cleanup(self.domain.comm)
        self._elastic.move_to(self.vector, within)
        self._set_parts(convex=False)
        return self._tangent

    @property
    def kept_tangent(self) -> bool:
        """Whether the elastic part of the last tangent is that of an earlier displacement."""
        return self._elastic.kept

    @property
    def convex(self) -> bool:
        """Whether the energy is convex but for what large rotations make of it: not with contributions."""
        return not self.contributions

    def convexify(self) -> None:
        """Make the contributions' terms in the present tangent positive semidefinite."""
        self._set_parts(convex=True)

    def _set_parts(self, *, convex: bool) -> None:
        parts = [part for part in (part.stiffness(convex=convex) for part in self.contributions) if part is not None]
        for part in parts:
            part.zeroRowsColumns(self._fixed_global, diag=0.0)
        self._tangent.parts = parts

    def apply_boundary_conditions(self, direction: PETSc.Vec) -> None:
        """Set the fixed components of a direction to exactly 0, which preconditioners miss by their tolerance."""
        direction.array[self._fixed_owned] = 0.0

    def largest_step(self, direction: Floats) -> float:
        """Return the part of (k, 3) local displacements in m that all contributions allow to add, at most 1."""
        return min((part.largest_step(direction) for part in self.contributions), default=1.0)

    def new_vector(self) -> PETSc.Vec:
        """Return a vector for residuals and directions, without values."""
        return self.vector.duplicate()

    def volume_ratios(self) -> Floats:
        """Return det F of the local elements: (c, 1), or (c, 10) at the nodes of quadratic ones."""
        return self.domain.volume_ratios(self._moved())

    def smallest_volume_ratio(self) -> float:
        """Return a number that det F is nowhere below: positive only where no element is inside out anywhere."""
        return self.domain.smallest_volume_ratio(self._moved())

    def _moved(self) -> Floats:
        return np.asarray(self.domain.local(self.domain.positions) + self.displacement)


def set_at_points(field: dolfinx.fem.Function, values: Floats) -> None:
    """Gives a field at integration points its (c, q, ...) values."""
    places = field.function_space.dofmap.list
    field.x.array.reshape(-1, field.function_space.dofmap.bs)[places] = values.reshape(*places.shape, -1)
