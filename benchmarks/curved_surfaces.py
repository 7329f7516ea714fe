"""Closed surfaces whose curvature is known at every point, as even triangle meshes of any density."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import trimesh
from numpy.typing import NDArray

from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import TriangleMesh, unit, vertex_normals

Floats = NDArray[np.float64]
Pair = tuple[Floats, Floats]


class Surface(Protocol):
    """A surface in mm: a first mesh, the projection of points onto it, and κ1 ≥ κ2 in 1/mm at (n, 3) points of it."""

    def start(self) -> TriangleMesh: ...
    def projected(self, points: Floats) -> Floats: ...
    def curvature(self, points: Floats) -> Pair: ...


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid, or a sphere, by its semi-axes in mm."""

    semi_axes: tuple[float, float, float]

    def start(self) -> TriangleMesh:
        return icosphere()

    def projected(self, points: Floats) -> Floats:
        directions = unit(points)
        return directions / np.linalg.norm(directions / np.array(self.semi_axes), axis=1, keepdims=True)

    def curvature(self, points: Floats) -> Pair:
        inverse_squares = 1.0 / np.array(self.semi_axes) ** 2
        return implicit_curvature(points * inverse_squares, np.tile(np.diag(inverse_squares), (len(points), 1, 1)))


@dataclass(frozen=True)
class Torus:
    """A torus round z: radius of its centre line and of its tube in mm."""

    radius: float
    tube: float

    def start(self) -> TriangleMesh:
        shape = trimesh.creation.torus(self.radius, self.tube, major_sections=160, minor_sections=64)
        return TriangleMesh(shape.vertices, shape.faces)

    def projected(self, points: Floats) -> Floats:
        flat = points * [1.0, 1.0, 0.0]
        centres = self.radius * unit(flat)
        return centres + self.tube * unit(points - centres)

    def curvature(self, points: Floats) -> Pair:
        across = np.linalg.norm(points[:, :2], axis=1)
        return np.full(len(points), 1.0 / self.tube), (across - self.radius) / (self.tube * across)


@dataclass(frozen=True)
class Folded:
    """A sphere with folds |x| = radius + height Σ sin(number xᵢ/|x|), in mm."""

    radius: float
    height: float
    number: float

    def start(self) -> TriangleMesh:
        return icosphere()

    def projected(self, points: Floats) -> Floats:
        directions = unit(points)
        waves = np.sin(self.number * directions).sum(axis=1, keepdims=True)
        return directions * (self.radius + self.height * waves)

    def curvature(self, points: Floats) -> Pair:
        distance = np.linalg.norm(points, axis=1)
        u = points / distance[:, None]
        # derivatives of f = |x| − radius − Σ h(uᵢ) with u = x/|x|: ∇|x| = u, ∇uᵢ = turn[i]
        turn = (np.eye(3) - u[:, :, None] * u[:, None, :]) / distance[:, None, None]
        first = self.height * self.number * np.cos(self.number * u)
        second = -self.height * self.number**2 * np.sin(self.number * u)
        hessian = turn - np.einsum("ni,nij,nik->njk", second, turn, turn)
        mixed = np.einsum("ni,nij,nk->njk", first, turn, u)
        radial = np.einsum("ni,ni->n", first, u)[:, None, None] * turn
        hessian += (mixed + mixed.transpose(0, 2, 1) + radial) / distance[:, None, None]
        return implicit_curvature(u - np.einsum("nij,nj->ni", turn, first), hessian)


def icosphere() -> TriangleMesh:
    """Returns a unit sphere of 41 000 vertices."""
    shape = trimesh.creation.icosphere(subdivisions=6)
    return TriangleMesh(shape.vertices, shape.faces)


def implicit_curvature(gradients: Floats, hessians: Floats) -> Pair:
    """Returns κ1 ≥ κ2 of the level sets of a function that grows outwards (Goldman 2005, CAGD 22).

    Parameters
    ----------
    gradients : (n, 3) and hessians : (n, 3, 3), of the function at the points
    """
    lengths = np.linalg.norm(gradients, axis=1)
    normals = gradients / lengths[:, None]
    tangential = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    shape = tangential @ (hessians / lengths[:, None, None]) @ tangential
    mean = 0.5 * np.trace(shape, axis1=1, axis2=2)
    half_difference = np.sqrt(np.maximum(0.5 * np.einsum("nij,nji->n", shape, shape) - mean**2, 0.0))
    return mean + half_difference, mean - half_difference


def meshed(surface: Surface, edge_length_mm: float) -> TriangleMesh:
    """Returns the surface with irregular triangles of about that edge length, every vertex exactly on it."""
    mesh = surface.start()
    mesh = TriangleMesh(surface.projected(mesh.vertices), mesh.faces)
    for _ in range(2):
        mesh = remesh(mesh, edge_length_mm)
        mesh = TriangleMesh(surface.projected(mesh.vertices), mesh.faces)
    return mesh


def noisy(mesh: TriangleMesh, deviation_mm: float, seed: int) -> TriangleMesh:
    """Returns the surface with every vertex moved along its normal by independent normal deviates."""
    shifts = deviation_mm * np.random.default_rng(seed).standard_normal((len(mesh.vertices), 1))
    return TriangleMesh(mesh.vertices + shifts * vertex_normals(mesh), mesh.faces)
