"""Placement of folds: correlation of curvature with the observed brain, and gain over a
brain without new folds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.linalg import cholesky, solve_triangular
from scipy.spatial import cKDTree
from scipy.special import ndtri, stdtrit

from ..geometry.alignment import MIRROR, align
from ..geometry.matching import (
    Match,
    interpolation,
    match_points,
    match_surface,
    nearest_on,
    values_at,
)
from ..geometry.remeshing import remesh
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    submesh,
    transformed,
    vertex_areas,
    vertex_normals,
)
from ..metrics.laplace_beltrami import laplacian, modes_below
from .shapes import PreparedSurface

SYMMETRY_TOL_MM = 0.4
"""Mean distance to the mirror image below which both sides count as one observation:
half a voxel of atlases."""
SHORTEST_MODE_MM = 10.0
"""Shortest wavelength of the modes that are resampled one by one. What is finer is
resampled in patches as wide."""
MODE_EDGE_MM = 2.0
"""Edges of the surface whose modes are computed, a fifth of the shortest wavelength."""
MODES_PER_BLOCK = 12
"""Successive modes that are drawn among each other, so that each sample has the power
of all wavelengths."""
PATCH_EDGE_MM = 20.0
"""Width of the patches for resampling distances: wider than a gyrus with its sulcus."""
N_DRAWS = 2000
"""Bootstrap samples."""
INTERVAL = (0.025, 0.975)
"""Quantiles of the bootstrap samples at the ends of a 95 % interval."""
RESAMPLED = "modes and patches of one brain, not subjects"
"""Note in tables with bootstrap intervals, which do not include differences between
subjects."""


@dataclass(frozen=True, eq=False)
class Resampling:
    """A surface's modes, and patches for finer parts: the units that a bootstrap of
    maps over it draws.

    Folds run across borders of patches, but the modes of a random map are independent.
    If the brain is its own mirror image, the modes are those of its left half with a
    free rim, and both sides are drawn together.

    `areas` (n,) of the vertices and `side_areas` (m,) are in mm². `sides` are m points
    of the surface; if it is symmetric m points of its left half, and their mirror
    images on the right. The product of `basis`, (m, v) and (v, k), has the k modes at
    the points, orthonormal by area, in the order of their wavelengths; `patch` (m,) is
    the patch of each point, and `asymmetry_mm` the mean distance of the brain from its
    mirror image.
    """

    areas: Floats
    sides: tuple[Match, ...]
    side_areas: Floats
    basis: tuple[sparse.csr_matrix, Floats]
    patch: Ints
    asymmetry_mm: float

    @property
    def is_symmetric(self) -> bool:
        """Whether the brain is its own mirror image, so that its sides are drawn
        together."""
        return len(self.sides) > 1

    @cached_property
    def units(self) -> Ints:
        """The unit of each of the coordinates of a map: first modes, then patches."""
        modes = self.basis[1].shape[1]
        return np.tile(
            np.concatenate([np.arange(modes), modes + self.patch]), len(self.sides)
        )

    @cached_property
    def drawn(self) -> Floats:
        """Numbers of times that each unit is in the surface (once) and in each sample,
        (1 + N_DRAWS, units)."""
        modes, patches = self.basis[1].shape[1], int(self.patch.max()) + 1
        blocks = np.array_split(
            np.arange(modes), max(1, round(modes / MODES_PER_BLOCK))
        )
        return draw_units([*map(len, blocks), patches])

    def coordinates(self, values: Floats) -> Floats:
        """Return coordinates of a map (n,) less its mean, whose scalar products are
        those of maps over the area."""
        centred = values - np.average(values, weights=self.areas)
        places, functions = self.basis
        parts = []
        for side in self.sides:
            at_side = values_at(side, centred)
            modes = functions.T @ (places.T @ (self.side_areas * at_side))
            finer = at_side - places @ (functions @ modes)
            parts += [modes, np.sqrt(self.side_areas) * finer]
        return np.concatenate(parts)

    def correlations(self, truth: Floats, values: Floats) -> Floats:
        """Return the correlation of two maps (n,), and that in each bootstrap sample;
        NaN where one is constant.

        Samples are spread as Student's t of as many units as the power of `truth` comes
        from, Σp²⁻¹ of the shares p.
        """
        r = correlation(truth, values, self.areas)
        if np.isnan(r):
            return np.full(1 + N_DRAWS, np.nan)
        x = self.coordinates(truth)
        y = self.coordinates(values)
        sums = []
        for product in (x * x, y * y, x * y):
            sums.append(np.bincount(self.units, product))
        xx, yy, xy = (self.drawn @ np.stack(sums, axis=1)).T
        drawn = xy / np.sqrt(xx * yy)
        power = sums[0]
        shares = power / power.sum()
        freedom = max(
            1 / (shares**2).sum() - 2,
            1.0,
        )
        spread = stdtrit(freedom, INTERVAL[1]) / ndtri(INTERVAL[1])
        # about r, since the sides of a symmetric brain are not exactly equal
        return np.append(
            r,
            r + spread * (drawn[1:] - drawn[0]),
        )


def make_resampling(surface: PreparedSurface) -> Resampling:
    """Compute the modes and patches of a surface, or of its left half if it is its own
    mirror image."""
    mesh, (image, asymmetry_mm) = surface.mesh, mirror_image(surface)
    used: Ints = np.arange(len(mesh.vertices))
    sides = []
    if asymmetry_mm < SYMMETRY_TOL_MM:
        left = mesh.vertices[:, 0] < image.vertices[:, 0]
        mesh, used = submesh(
            surface.mesh,
            left[mesh.faces].sum(axis=1) >= 2,
        )
        sides = [
            match_points(
                image.vertices[used], vertex_normals(image)[used], surface.mesh
            )
        ]
    itself = Match(
        np.repeat(used[:, None], 3, axis=1),
        np.full((len(used), 3), 1 / 3),
        np.zeros(len(used)),
        used >= 0,
    )
    sides.insert(0, itself)
    coarse, areas = remesh(mesh, MODE_EDGE_MM), vertex_areas(mesh)
    modes = modes_below(
        *laplacian(coarse), (2 * np.pi / SHORTEST_MODE_MM) ** 2
    ).functions
    places = interpolation(match_surface(mesh, coarse), len(coarse.vertices))
    # orthonormal on the finer surface, in the same order
    products = modes.T @ (places.T @ places.multiply(areas[:, None]).tocsr() @ modes)
    modes = solve_triangular(
        cholesky(products, lower=True),
        modes.T,
        lower=True,
    ).T
    patch = number_patches(mesh.vertices, areas, SHORTEST_MODE_MM)
    return Resampling(
        surface.areas, tuple(sides), areas, (places, modes), patch, asymmetry_mm
    )


def correlation(
    x: Floats,
    y: Floats,
    weights: Floats,
) -> float:
    """Return the weighted Pearson correlation of (n,) values; NaN where one of them is
    constant to rounding."""
    (xx, xy), (_, yy) = np.cov(x, y, aweights=weights)
    squares = (np.average(values * values, weights=weights) for values in (x, y))
    if any(
        spread <= 1e-12 * square
        for spread, square in zip(
            (xx, yy),
            squares,
            strict=True,
        )
    ):
        return float("nan")
    return float(xy / np.sqrt(xx * yy))


def gain_columns(
    r: Floats,
    r_start: Floats,
    r_adjacent: Floats,
) -> dict[str, float]:
    """Compare correlations and their bootstrap samples with those of the start brain
    and of the week before.

    Columns r, r_start and r_adjacent; gain = r − r_start. r and gain have 95 %
    intervals …_low, …_high.
    """
    row = {
        "r_start": float(r_start[0]),
        "r_adjacent": float(r_adjacent[0]),
    }
    return row | with_interval("r", r) | with_interval("gain", r - r_start)


def with_interval(name: str, draws: Floats) -> dict[str, float]:
    """Return the first of (1 + k,) draws and the ends of its 95 % interval, from the
    others, by column."""
    low, high = (
        (float("nan"),) * 2
        if np.isnan(draws).all()
        else np.nanquantile(draws[1:], INTERVAL)
    )
    return {
        name: float(draws[0]),
        f"{name}_low": float(low),
        f"{name}_high": float(high),
    }


def mirror_image(surface: PreparedSurface) -> tuple[TriangleMesh, float]:
    """Mirror a surface along x (left to right), align it with itself, and return its
    mean distance in mm from itself.

    Vertices of the image are those of the surface.
    """
    aligned = align(transformed(surface.mesh, MIRROR), surface.mesh)
    return aligned, float(
        np.average(
            nearest_on(aligned.vertices, surface.mesh)[0],
            weights=surface.areas,
        )
    )


def number_patches(
    points: Floats,
    areas: Floats,
    edge_mm: float,
) -> Ints:
    """Divide (n, 3) points into patches about `edge_mm` wide and return the (n,) number
    of each point's patch.

    Patches are the Voronoi cells of seeds chosen by farthest-point sampling, which is
    deterministic.
    """
    count = max(
        2,
        round(float(areas.sum()) / edge_mm**2),
    )
    seeds = [0]
    distances = np.linalg.norm(
        points - points[0],
        axis=1,
    )
    for _ in range(count - 1):
        farthest = int(distances.argmax())
        seeds.append(farthest)
        to_seed = np.linalg.norm(
            points - points[farthest],
            axis=1,
        )
        distances = np.minimum(distances, to_seed)
    _, patches = cKDTree(points[seeds]).query(points)
    return np.asarray(patches, dtype=np.int64)


def draw_units(groups: Sequence[int]) -> Floats:
    """Return how often units of groups of these sizes are drawn: (1 + N_DRAWS, units),
    each once in the first row.

    A group of n is drawn n − 1 times, which makes the variance of the samples unbiased
    (Efron 1982, chapter 6).
    """
    generator = np.random.default_rng(0)
    drawn = [
        generator.multinomial(
            max(size - 1, 1),
            np.full(size, 1 / size),
            size=N_DRAWS,
        )
        for size in groups
    ]
    return np.concatenate([np.ones((1, sum(groups))), np.concatenate(drawn, axis=1)])
