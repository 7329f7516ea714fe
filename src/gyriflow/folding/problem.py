"""The discrete problem of one step: energy, residual and tangent on the updated reference.

With `domain` and `block_matrix`, the only files that use dolfinx: what differs between its versions is kept to them.
"""

from dataclasses import dataclass

import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx.la import BlockMode
from numpy.typing import NDArray
from petsc4py import PETSc

from ..mechanics.fissure import contact_energy_density
from ..mechanics.growth_tensor import inverse_growth_tensor
from ..mechanics.kinematics import deformation_gradient, elastic_deformation
from ..mechanics.neo_hookean import bulk_to_shear_ratio, strain_energy_density
from ..units import M_PER_MM
from .block_matrix import BlockMatrix
from .compilation import form_compiler
from .domain import Domain
from .zones import CLAMPED, LEFT_CONTACT, RIGHT_CONTACT, Zones

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Material:
    """What the problem needs of the parameters, in SI units."""

    poisson_ratio: float
    penalty_pa_per_m: float


class Problem:
    """Energy, residual and tangent of the displacement of one step.

    Parameters
    ----------
    domain, zones, material
        The mesh, its fixed zones, and constants.
    quadrature_degree
        1 takes stiffness and growth at the centre of each element; higher degrees take them as linear in it.

    Attributes
    ----------
    u : dolfinx.fem.Function
        The displacement of the step in m, the unknown.
    """

    def __init__(self, domain: Domain, zones: Zones, material: Material, *, quadrature_degree: int = 1) -> None:
        self.domain = domain
        mesh = domain.mesh
        self.u = dolfinx.fem.Function(domain.space)
        field = ("DG", 0) if quadrature_degree == 1 else ("Lagrange", 1)
        space = dolfinx.fem.functionspace(mesh, field)
        self._mu, self._dg, self._dr = (dolfinx.fem.Function(space) for _ in range(3))
        self._N = dolfinx.fem.Function(dolfinx.fem.functionspace(mesh, ("DG", 0, (3,))))
        self._by_cell = quadrature_degree == 1

        ratio = dolfinx.fem.Constant(mesh, bulk_to_shear_ratio(material.poisson_ratio))
        penalty = dolfinx.fem.Constant(mesh, material.penalty_pa_per_m)
        planes = [dolfinx.fem.Constant(mesh, plane * M_PER_MM) for plane in zones.planes_mm]
        tags = domain.local_facets(zones.facets, zones.facet_zone)
        dx = ufl.dx(metadata={"quadrature_degree": quadrature_degree})
        ds = ufl.ds(domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": 2})

        Fe = elastic_deformation(deformation_gradient(self.u), inverse_growth_tensor(self._dg, self._dr, self._N))
        energy = strain_energy_density(Fe, self._mu, ratio * self._mu) * dx
        x = ufl.SpatialCoordinate(mesh)[0] + self.u[0]
        if len(zones.vertices_of(LEFT_CONTACT)) or len(zones.vertices_of(RIGHT_CONTACT)):
            energy += contact_energy_density(x, planes[0], -1, penalty) * ds(LEFT_CONTACT)
            energy += contact_energy_density(x, planes[1], +1, penalty) * ds(RIGHT_CONTACT)
        residual = ufl.derivative(energy, self.u)
        tangent = ufl.derivative(residual, self.u)
        with form_compiler(domain.comm) as options:
            self._energy, self._residual, self._tangent = (
                dolfinx.fem.form(form, jit_options=options) for form in (energy, residual, tangent)
            )

        clamped = np.zeros(len(domain.positions), dtype=bool)
        clamped[zones.vertices_of(CLAMPED)] = True
        nodes = np.flatnonzero(domain.local(clamped)).astype(np.int32)
        zero = np.zeros(3)
        self.clamps = [dolfinx.fem.dirichletbc(zero, nodes, domain.space)]
        self._clamped_owned = nodes[nodes < domain.owned]
        self._blocks = BlockMatrix(dolfinx.fem.create_matrix(self._tangent, block_mode=BlockMode.compact))
        self.vector = self.u.x.petsc_vec

    def set_layers(self, mu: Floats, dg: Floats, dr: Floats, normals: Floats) -> None:
        """Sets shear modulus (Pa) and growth increments at the local nodes, and the unit normals of the local cells."""
        for function, nodal in ((self._mu, mu), (self._dg, dg), (self._dr, dr)):
            if self._by_cell:
                function.x.array[function.function_space.dofmap.list[:, 0]] = nodal[self.domain.cells].mean(axis=1)
            else:
                function.x.array[function.function_space.dofmap.list] = nodal[self.domain.cells]
        self._N.x.array.reshape(-1, 3)[self._N.function_space.dofmap.list[:, 0]] = normals

    @property
    def displacement(self) -> Floats:
        """The (k, 3) displacements in m of the local nodes: a view."""
        return self.u.x.array.reshape(-1, 3)

    def set_displacement(self, values: Floats) -> None:
        """Sets the (k, 3) displacements of the local nodes in m."""
        self.displacement[:] = values

    def energy(self) -> float:
        """Returns the total energy in J, contact included."""
        local = dolfinx.fem.assemble_scalar(self._energy)
        return float(np.real(self.domain.comm.allreduce(local)))

    def residual(self, out: PETSc.Vec) -> float:
        """Assembles the residual in N into `out`, zero at clamped nodes, and returns its norm."""
        with out.localForm() as local:
            local.set(0.0)
        dolfinx.fem.petsc.assemble_vector(out, self._residual)
        out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        out.array.reshape(-1, 3)[self._clamped_owned] = 0.0
        return out.norm()

    def tangent(self) -> PETSc.Mat:
        """Returns the assembled tangent in N/m, with ones on the diagonal at clamped nodes."""
        blocks = self._blocks.blocks
        blocks.set_value(0.0)
        dolfinx.fem.assemble_matrix(blocks, self._tangent, bcs=self.clamps)
        return self._blocks.assembled()

    def new_vector(self) -> PETSc.Vec:
        """Returns a vector for residuals and directions, without values."""
        return self.vector.duplicate()

    def smallest_volume_ratio(self) -> float:
        """Returns the smallest det F over all elements: positive where no element is inverted."""
        current = self.domain.local(self.domain.positions)
        return self.domain.minimum(self.domain.cell_volumes(current + self.displacement) / self.domain.volumes)
