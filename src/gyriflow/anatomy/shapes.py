"""Spheres and ellipsoids as closed surfaces in mm, RAS+ around the origin, for tests of
a folding model."""

from itertools import product

import numpy as np

from ..errors import InputError
from ..geometry.remeshing import remesh
from ..geometry.triangles import Floats, TriangleMesh, convex_hull, unit

# root mean square height of the bumps that start the folding
NOISE_MM = 0.05
REMESHING_ROUNDS = 10
# the edges of a finely sampled curved face are far less sharp
SHARP_DEG = 45.0
# bumps of all these wavelengths, so that they contain that of the folds
WAVELENGTHS_MM = (8.0, 40.0)
WAVES = 64
PATTERN_SEED = 0


def shape_surface(
    semi_axes_mm: tuple[float, float, float],
    *,
    edge_length_mm: float,
    noise_mm: float = NOISE_MM,
) -> TriangleMesh:
    """Return an ellipsoid as a closed, outward surface of even triangles, with smooth
    bumps along the normal.

    They have the root mean square height `noise_mm`. InputError if the edges are too
    long.
    """
    size = np.array(semi_axes_mm, dtype=float)
    longest = 0.5 * size.min() ** 2 / size.max()
    if edge_length_mm > longest:
        raise InputError(
            "the edges are too long for the shape",
            found=f"{edge_length_mm:g} mm",
            expected=f"at most {longest:.3g} mm",
        )
    points = size * _directions(int(np.ceil(np.pi * size.max() / edge_length_mm)))
    mesh = remesh(
        convex_hull(
            TriangleMesh(
                points,
                np.empty((0, 3), dtype=np.int64),
            )
        ),
        edge_length_mm,
        REMESHING_ROUNDS,
        SHARP_DEG,
    )
    vertices = mesh.vertices / np.linalg.norm(
        mesh.vertices / size, axis=1, keepdims=True
    )
    heights = noise_mm * _pattern(vertices)
    return TriangleMesh(
        vertices + heights[:, None] * unit(vertices / size**2), mesh.faces
    )


def _directions(count: int) -> Floats:
    """Return (n, 3) unit vectors through a lattice on an octahedron with `count`
    intervals along each edge."""
    i, j = np.indices((count + 1, count + 1))
    on_face = i + j <= count
    face = np.stack(
        [i, j, count - i - j],
        axis=-1,
    )[on_face]
    octants = []
    for signs in product((1, -1), repeat=3):
        octants.append(face * signs)
    # edges belong to two octants
    lattice = np.unique(np.concatenate(octants), axis=0)
    return unit(lattice.astype(float))


def _pattern(points: Floats) -> Floats:
    random = np.random.default_rng(PATTERN_SEED)
    waves = random.normal(size=(WAVES, 3))
    shortest, longest = np.log(WAVELENGTHS_MM)
    lengths = np.exp(random.uniform(shortest, longest, WAVES))
    factors = 2.0 * np.pi / lengths / np.linalg.norm(waves, axis=1)
    waves *= factors[:, None]
    phases = random.uniform(0.0, 2.0 * np.pi, WAVES)
    angles = points @ waves.T + phases
    heights = np.cos(angles).sum(axis=1)
    return np.sqrt(2.0 / WAVES) * heights
