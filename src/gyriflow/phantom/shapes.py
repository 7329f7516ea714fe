"""Simple geometries as closed surfaces in mm: what a folding model is taught, tried and verified on.

All stand in RAS+ with x = 0 as their middle.
"""

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from ..errors import InputError
from ..geometry.remeshing import remesh
from ..geometry.triangles import TriangleMesh, edges, submesh, unit
from ..parameters.synthetic import ShapeKind, ShapeSettings

Floats = NDArray[np.float64]

REMESHING_ROUNDS = 10
# the sharp edges have 90°, a finely sampled curved face far less
SHARP_DEG = 45.0
# how close to a flat face vertices belong to it, as part of the shape's smallest size
FLAT = 1e-3
# vertices inside the base keep away from its rim by this part of an edge length
RIM = 0.7
# bumps of all these wavelengths, so that folding finds its own among them
WAVELENGTHS_MM = (8.0, 40.0)
WAVES = 64


def shape_surface(
    kind: ShapeKind,
    size_mm: tuple[float, float, float],
    *,
    edge_length_mm: float,
    noise_mm: float = ShapeSettings.model_fields["noise_mm"].default,
    seed: int = ShapeSettings.model_fields["seed"].default,
) -> TriangleMesh:
    """Returns a closed, outward surface of even triangles, its vertices on the shape and its sharp edges kept.

    "sphere" and "ellipsoid" are centred on the origin; "half-ellipsoid" is the half above a flat base at z = 0; "slab"
    is a box from its base at z = 0 upwards, centred on x = y = 0. `size_mm` are semi-axes along x, y, z, of a slab its
    whole extents. Smooth bumps along the normal, which folding needs to start from, have the root mean square height
    `noise_mm`; their pattern follows from `seed`, not from the edge length. The base and the sides of a slab stay flat.
    InputError where the edges are too long for the shape.
    """
    size = np.array(size_mm, dtype=float)
    longest = _longest_edge(kind, size)
    if edge_length_mm > longest:
        raise InputError(
            f"the edges are too long for the {kind}",
            found=f"{edge_length_mm:g} mm",
            expected=f"at most {longest:.3g} mm",
            remedy="Set a smaller surface.edge_length_mm, or make the shape larger.",
        )
    mesh = _slab(size, edge_length_mm) if kind == "slab" else _ellipsoid(kind, size, edge_length_mm)
    return mesh if noise_mm == 0 else _with_bumps(mesh, kind, size, noise_mm, seed)


def _longest_edge(kind: ShapeKind, size: Floats) -> float:
    """Returns half the smallest radius of curvature of an ellipsoid, a quarter of the smallest extent of a slab."""
    return float(0.25 * size.min() if kind == "slab" else 0.5 * size.min() ** 2 / size.max())


def _slab(size: Floats, edge_length_mm: float) -> TriangleMesh:
    low, high = size * [-0.5, -0.5, 0.0], size * [0.5, 0.5, 1.0]
    box = _even_hull(np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3), edge_length_mm)
    vertices = box.vertices.copy()
    for end in (low, high):
        vertices = np.where(np.abs(vertices - end) < FLAT * size.min(), end, vertices)
    return TriangleMesh(vertices, box.faces)


def _ellipsoid(kind: ShapeKind, size: Floats, edge_length_mm: float) -> TriangleMesh:
    """Returns a whole ellipsoid, or its upper half with a base."""
    half = kind == "half-ellipsoid"
    mesh = _even_hull(size * _directions(int(np.ceil(np.pi * size.max() / edge_length_mm)), half), edge_length_mm)
    vertices = mesh.vertices.copy()
    dome = np.ones(len(mesh.faces), dtype=bool)
    if half:
        below = vertices[:, 2] < FLAT * size.min()
        vertices[below, 2] = 0.0
        dome = ~below[mesh.faces].all(axis=1)
    mesh, _ = submesh(TriangleMesh(vertices, mesh.faces), dome)
    mesh = TriangleMesh(mesh.vertices / np.linalg.norm(mesh.vertices / size, axis=1, keepdims=True), mesh.faces)
    return _with_base(mesh, edge_length_mm) if half else mesh


def _directions(count: int, upper: bool) -> Floats:
    """Returns unit vectors all around or upwards, `count` steps from one axis to the next, the axes among them."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    lattice = np.stack([i, j, count - i - j], axis=-1)[i + j <= count].astype(float)
    signs = np.array([(x, y, z) for x in (1, -1) for y in (1, -1) for z in ((1,) if upper else (1, -1))])
    mirrored = np.unique((lattice * signs[:, None]).reshape(-1, 3), axis=0)
    return unit(mirrored)


def _even_hull(points: Floats, edge_length_mm: float) -> TriangleMesh:
    """Returns the convex hull with triangles close to equilateral, its sharp edges and corners where they were."""
    hull = trimesh.convex.convex_hull(points)
    return remesh(TriangleMesh(hull.vertices, hull.faces), edge_length_mm, REMESHING_ROUNDS, SHARP_DEG)


def _with_base(dome: TriangleMesh, edge_length_mm: float) -> TriangleMesh:
    """Returns the dome closed by a flat face at z = 0, downward, on the vertices of its rim and a lattice inside."""
    pairs, uses = edges(dome)
    rim = np.unique(pairs[uses == 1])
    around = dome.vertices[rim, :2]
    steps = np.arange(2 * int(np.ceil(np.abs(around).max() / edge_length_mm)) + 1)
    i, j = np.meshgrid(steps - steps.mean(), steps - steps.mean(), indexing="ij")
    lattice = edge_length_mm * np.stack([i + 0.5 * (j % 2), np.sqrt(0.75) * j], axis=-1).reshape(-1, 2)
    middles = dome.vertices[pairs[uses == 1], :2].mean(axis=1)
    clear = cKDTree(np.concatenate([around, middles])).query(lattice)[0] > RIM * edge_length_mm
    lattice = lattice[clear & (Delaunay(around).find_simplex(lattice) >= 0)]
    # the rim is convex, so that it is the triangulation's outline
    flat = np.concatenate([around, lattice])
    own = np.concatenate([rim, len(dome.vertices) + np.arange(len(lattice))])
    triangles = Delaunay(flat).simplices
    a, b, c = flat[triangles].transpose(1, 0, 2)
    upward = (b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0]
    triangles[upward] = triangles[upward][:, ::-1]
    inside = np.column_stack([lattice, np.zeros(len(lattice))])
    return TriangleMesh(np.concatenate([dome.vertices, inside]), np.concatenate([dome.faces, own[triangles]]))


def _with_bumps(mesh: TriangleMesh, kind: ShapeKind, size: Floats, noise_mm: float, seed: int) -> TriangleMesh:
    """Returns the surface with bumps along the normal of its curved face, or upwards on the top of a slab.

    In flat cuts the vertices move along, less and less away from the bumps, and stay in the cut.
    """
    if kind == "slab":
        fading = mesh.vertices[:, 2] / size[2]
        direction = np.array([[0.0, 0.0, 1.0]])
    else:
        fading = np.linalg.norm(mesh.vertices / size, axis=1)
        direction = unit(mesh.vertices / size**2)
    heights = noise_mm * fading * _pattern(mesh.vertices, seed)
    return TriangleMesh(mesh.vertices + heights[:, None] * direction, mesh.faces)


def _pattern(points: Floats, seed: int) -> Floats:
    """Returns a smooth random field of unit variance at (n, 3) points: a sum of plane waves of all directions."""
    random = np.random.default_rng(seed)
    waves = random.normal(size=(WAVES, 3))
    shortest, longest = np.log(WAVELENGTHS_MM)
    lengths = np.exp(random.uniform(shortest, longest, WAVES))
    waves *= (2.0 * np.pi / lengths / np.linalg.norm(waves, axis=1))[:, None]
    phases = random.uniform(0.0, 2.0 * np.pi, WAVES)
    return np.asarray(np.sqrt(2.0 / WAVES) * np.cos(points @ waves.T + phases).sum(axis=1))
