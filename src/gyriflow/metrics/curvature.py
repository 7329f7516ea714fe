"""Curvature of triangle surfaces, from quadrics fitted round each vertex, and its
integrals over a surface.

Normals are outward, so that gyri are positive and sulci negative.
"""

import logging
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree
from scipy.special import jv

from ..errors import MeshError
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    edge_lengths,
    edges,
    mean_edge_length,
    unit,
    vertex_areas,
    vertex_normals,
)
from ..settings.terms import CURVATURE_RADIUS_MM

RESOLVED_RADII = 4.0
"""The shortest wavelength of folds that count as resolved, in radii. ∫ H² is short
there by 3 % for folds a quarter as deep as long, by 21 % for shallow ones; by 17 and 43
% at 2.6 radii, by 58 and 74 % at 1.7."""

log = logging.getLogger(__name__)
EDGES_PER_RADIUS = 2.0
"""Radius of the smallest ball in edges: with fewer neighbours a quadric follows the
noise."""
NOT_MUCH_LARGER = 1.1
"""A radius that is so many times larger than that asked for is used without a
warning."""
MAX_FAILED_SHARE = 0.01
CHUNK = 512
"""Vertices worked on at once: the arrays of their neighbours then stay in the
processor's cache."""
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Shares of the area at which its distribution over mean curvature is given."""
_POWERS = ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1), (0, 0))
_MONOMIALS = sorted({(a + c, b + d) for a, b in _POWERS for c, d in _POWERS})
_NORMAL_EQUATIONS = np.array(
    [[_MONOMIALS.index((a + c, b + d)) for a, b in _POWERS] for c, d in _POWERS]
)


class Curvature(NamedTuple):
    """Curvature per vertex of a surface with n vertices, and the (n,) radius of the
    ball that each is fitted in.

    `maximum` and `minimum` (n,) are the principal curvatures κ1 ≥ κ2 in 1/mm, both 1/R
    on a sphere of radius R. `reliable` (n,) is False where the ball reaches the
    boundary of an open surface, or no quadric could be fitted.
    """

    maximum: Floats
    minimum: Floats
    reliable: NDArray[np.bool_]
    radius_mm: Floats

    @property
    def mean(self) -> Floats:
        """The (n,) mean curvature (κ1 + κ2)/2 in 1/mm."""
        return 0.5 * (self.maximum + self.minimum)

    @property
    def gaussian(self) -> Floats:
        """The (n,) Gaussian curvature κ1 κ2 in 1/mm²."""
        return self.maximum * self.minimum

    @property
    def shape_index(self) -> Floats:
        """The (n,) shape index 2/π·atan2(κ1 + κ2, κ1 − κ2): −1 sulcal pit, 0 saddle, +1
        gyral node.

        Koenderink and van Doorn 1992, with outward normals; 0 on a plane.
        """
        return (
            2.0
            / np.pi
            * np.arctan2(
                self.maximum + self.minimum,
                self.maximum - self.minimum,
            )
        )

    @property
    def curvedness(self) -> Floats:
        """The (n,) curvedness √((κ1² + κ2²)/2) in 1/mm (Koenderink and van Doorn
        1992)."""
        return np.sqrt(0.5 * (self.maximum**2 + self.minimum**2))


def curvature(
    mesh: TriangleMesh, *, radius_mm: float = CURVATURE_RADIUS_MM
) -> Curvature:
    """Return the curvature from quadrics fitted to the surface within `radius_mm` of
    each vertex.

    The quadric is a local height function with slope (Cazals and Pouget 2005 call it a
    jet of degree 2); its principal curvatures are those at the vertex's foot. It need
    not pass through the vertex, which averages noise out. Where the local edges are
    longer than half of `radius_mm`, the ball grows to two of them, with a warning if it
    is more than a tenth larger. MeshError where a vertex in a hundred has no usable
    neighbourhood.
    """
    finest = EDGES_PER_RADIUS * mean_edge_length(mesh)
    if finest > NOT_MUCH_LARGER * radius_mm:
        log.warning(
            "the mesh is too coarse for curvature at a radius of %.3g mm: %.3g mm is"
            " used",
            radius_mm,
            finest,
        )
    radii = np.maximum(radius_mm, EDGES_PER_RADIUS * _edge_lengths(mesh))
    coefficients, fitted, one_sided = _quadrics(mesh, radii)
    failed = int(np.count_nonzero(~fitted))
    if failed > MAX_FAILED_SHARE * len(mesh.vertices):
        failures = (
            f"{failed} of {len(mesh.vertices)} vertices without a regular neighbourhood"
        )
        raise MeshError(
            "no curvature can be fitted",
            found=failures,
            remedy="Repair or remesh the surface.",
        )
    a, b, c, d, e, _ = coefficients.T
    # first and second fundamental form of the height function; outward normals make a
    # cap negative
    stretch = 1.0 + d**2 + e**2
    mean = -((1.0 + e**2) * a - d * e * b + (1.0 + d**2) * c) / stretch**1.5
    gaussian = (4.0 * a * c - b**2) / stretch**2
    half_difference = np.sqrt(np.maximum(mean**2 - gaussian, 0.0))
    return Curvature(
        mean + half_difference, mean - half_difference, fitted & ~one_sided, radii
    )


def kept_curvature(wavelength_mm: Floats, radius_mm: float) -> Floats:
    """Return the share of its mean curvature that a shallow wave keeps in the quadric
    fit: 384 J₄(k)/k⁴, k = 2πr/λ.

    Exact for many vertices in the ball of radius r, and within 0.04 for the coarsest
    mesh, with two edges to a radius. Folds whose depth is a quarter of their length
    keep more.
    """
    k = np.maximum(
        2.0 * np.pi * radius_mm / np.asarray(wavelength_mm),
        0.01,
    )
    return np.asarray(384.0 * jv(4, k) / k**4)


def curvature_metrics(curvature: Curvature, areas: Floats) -> dict[str, float]:
    """Return integrals over a surface with (n,) areas of the vertices in mm², |k₁| the
    larger principal curvature, and quantiles of mean curvature.

    intrinsic_curvature_index is 1/4π ∫ max(K, 0) dA, 1 for all convex surfaces, and
    folding_index 1/4π ∫ |k₁|(|k₁| − |k₂|) dA, 0 for a sphere (Van Essen and Drury 1997,
    J. Neurosci. 17, 7079-7102). mean_curvature_norm is the L² norm 1/4π ∫ H² dA and
    gaussian_curvature_norm 1/4π √(A ∫ K² dA) with A the area, both 1 for a sphere
    (Batchelor et al. 2002, IEEE Trans. Med. Imaging 21, 953-965). mean_curvature_q05 to
    q95 are those in 1/mm below which 5, 25, 50, 75 and 95 % of the area are.
    """
    mean, gaussian = curvature.mean, curvature.gaussian
    smaller, larger = np.sort(
        np.abs([curvature.maximum, curvature.minimum]),
        axis=0,
    )
    integrals = {
        "intrinsic_curvature_index": np.maximum(gaussian, 0.0) @ areas,
        "folding_index": (larger * (larger - smaller)) @ areas,
        "mean_curvature_norm": mean**2 @ areas,
        "gaussian_curvature_norm": np.sqrt(areas.sum() * (gaussian**2 @ areas)),
    }
    found = {name: float(value) / (4.0 * np.pi) for name, value in integrals.items()}
    quantiles = np.quantile(
        mean,
        QUANTILES,
        weights=areas,
        method="inverted_cdf",
    )
    for share, value in zip(QUANTILES, quantiles, strict=True):
        found[f"mean_curvature_q{round(100 * share):02d}"] = float(value)
    return found


def _edge_lengths(mesh: TriangleMesh) -> Floats:
    """Return the (n,) mean length in mm of the edges at each vertex, 0 without one."""
    pairs, _ = edges(mesh)
    ends = pairs.ravel()
    lengths = np.repeat(edge_lengths(mesh.vertices, pairs), 2)
    size = len(mesh.vertices)
    sums = np.bincount(ends, lengths, size)
    counts = np.bincount(ends, minlength=size)
    return sums / np.maximum(counts, 1)


def _quadrics(
    mesh: TriangleMesh, radii_mm: Floats
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return quadrics over the tangent planes of n vertices, by weighted least squares
    in a ball round each.

    The ball contains the vertices that edges inside it link to its centre, so not the
    other wall of a sulcus. The weight is area × cosine × (1 − d²/radius²). The area of
    the vertex is projected onto the tangent plane: the sum is like an integral and does
    not depend on the mesh. The weight falls to zero at the rim, and vertices whose
    normal differs by more than 90° do not count. The tangent plane is that of the
    weighted mean of the normals.

    Returns the (n, 6) coefficients of z = a x² + b x y + c y² + d x + e y + f in mm, z
    along the outward normal, 0 where nothing could be fitted; whether (n,) the
    neighbours determine a quadric; and whether (n,) the ball holds a vertex of the
    boundary of an open surface.
    """
    # neighbours follow each other, so that the balls of a chunk stay in the cache
    order = cKDTree(mesh.vertices).indices
    place = np.argsort(order)
    mesh = TriangleMesh(
        mesh.vertices[order],
        place[mesh.faces],
    )
    radii_mm = radii_mm[order]
    (pairs, uses), size = edges(mesh), len(mesh.vertices)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    links = sparse.csr_matrix(
        (np.ones(len(both), dtype=bool), both.T), shape=(size, size)
    )
    boundary = np.isin(
        np.arange(size),
        pairs[uses == 1],
    )
    normals, areas = vertex_normals(mesh), vertex_areas(mesh)
    fits = [
        (
            *_fit(
                mesh.vertices,
                normals,
                areas,
                radii_mm,
                centres,
                balls,
            ),
            balls @ boundary,
        )
        for centres, balls in _balls(mesh.vertices, radii_mm, links)
    ]
    coefficients, fitted, one_sided = (
        np.concatenate(parts) for parts in zip(*fits, strict=True)
    )
    return coefficients[place], fitted[place], one_sided[place]


def _balls(
    vertices: Floats,
    radii_mm: Floats,
    links: sparse.csr_matrix,
) -> Iterator[tuple[Ints, sparse.csr_matrix]]:
    """Yield centres, in chunks of c, and the Boolean (c, n) matrix of the vertices in
    the ball of each: those that edges inside the ball link to its centre."""
    for start in range(0, len(vertices), CHUNK):
        centres = np.arange(
            start,
            min(start + CHUNK, len(vertices)),
        )
        middles = vertices[centres]
        radii = radii_mm[centres, None]
        # balls are found among the vertices of a box around them all
        is_near = (vertices > (middles - radii).min(axis=0)) & (
            vertices < (middles + radii).max(axis=0)
        )
        near = np.flatnonzero(is_near.all(axis=1))
        near_links = links[near][:, near]
        degrees = np.diff(near_links.indptr)
        width = len(near)
        reached = np.zeros(len(centres) * width, dtype=bool)
        last = np.empty(len(reached), dtype=np.int32)
        # a vertex of a ball has the place ball · width + column
        place = np.arange(len(centres)) * width + np.searchsorted(near, centres)
        reached[place] = True
        found = [place]
        # at first each centre by itself, then the neighbours of what came last
        while len(place):
            column = place % width
            counts = degrees[column]
            first = near_links.indptr[column] - np.cumsum(counts) + counts
            link = np.repeat(first, counts) + np.arange(counts.sum())
            place = np.repeat(place - column, counts) + near_links.indices[link]
            place = place[~reached[place]]
            # each once: the last of equal places remains
            number = np.arange(len(place), dtype=np.int32)
            last[place] = number
            place = place[last[place] == number]
            reached[place] = True
            ball, column = np.divmod(place, width)
            offset = vertices[near[column]] - middles[ball]
            squared = np.einsum("ij,ij->i", offset, offset)
            place = place[squared < radii[ball, 0] ** 2]
            found.append(place)
        ball, column = np.divmod(np.concatenate(found), width)
        shape = (len(centres), len(vertices))
        yield (
            centres,
            sparse.csr_matrix(
                (np.ones(len(ball), dtype=bool), (ball, near[column])), shape=shape
            ),
        )


def _fit(
    vertices: Floats,
    normals: Floats,
    areas: Floats,
    radii_mm: Floats,
    centres: Ints,
    balls: sparse.csr_matrix,
) -> tuple[Floats, NDArray[np.bool_]]:
    near = balls.indices
    starts = balls.indptr[:-1]
    counts = np.diff(balls.indptr)
    scale = np.repeat(radii_mm[centres], counts)
    middle = np.repeat(vertices[centres], counts, axis=0)
    offset = (vertices[near] - middle) / scale[:, None]
    facing = normals[near]
    share = areas[near] * (1.0 - np.einsum("ij,ij->i", offset, offset))

    upright = normals[centres]
    for _ in range(2):
        repeated = np.repeat(upright, counts, axis=0)
        cosines = np.einsum("ij,ij->i", facing, repeated)
        weights = share * np.maximum(cosines, 0.0)
        upright = unit(
            np.add.reduceat(
                weights[:, None] * facing,
                starts,
            )
        )
    least_upright = np.eye(3)[np.abs(upright).argmin(axis=1)]
    tangent = unit(np.cross(upright, least_upright))
    frames = np.stack(
        [tangent, np.cross(upright, tangent), upright],
        axis=1,
    )
    repeated_frames = np.repeat(frames, counts, axis=0)
    x, y, z = np.einsum("ijk,ik->ji", repeated_frames, offset)

    powers = {
        (0, 0): weights,
        (1, 0): weights * x,
        (0, 1): weights * y,
    }
    for a, b in _MONOMIALS:
        if (a, b) not in powers:
            powers[a, b] = powers[a - 1, b] * x if a else powers[a, b - 1] * y
    columns = [powers[key] for key in _MONOMIALS]
    columns += [powers[key] * z for key in _POWERS]
    sums = np.stack(
        [np.add.reduceat(column, starts) for column in columns],
        axis=1,
    )
    total_weight = sums[:, [_MONOMIALS.index((0, 0))]]
    sums /= np.maximum(total_weight, np.finfo(float).tiny)

    matrices = sums[:, _NORMAL_EQUATIONS]
    right = sums[:, len(_MONOMIALS) :]
    values = np.linalg.eigvalsh(matrices)
    fitted = values[:, 0] > 1e-9 * np.abs(values[:, -1])
    coefficients = np.zeros((len(centres), 6))
    solved = np.linalg.solve(
        matrices[fitted],
        right[fitted, :, None],
    )
    coefficients[fitted] = solved[..., 0]
    # back from units of the radius
    coefficients *= radii_mm[centres, None] ** np.array([-1, -1, -1, 0, 0, 1])
    return coefficients, fitted
