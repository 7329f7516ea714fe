"""What a brain foretold is worth: its distance from the real one, its size and folds, beside simpler ways to do so."""

import numpy as np
import pandas as pd

from ..geometry.alignment import fit_onto
from ..geometry.matching import crossing_faces, match_points, nearest_on, values_at
from ..geometry.remeshing import remesh
from ..geometry.triangles import (
    TriangleMesh,
    area,
    edges,
    signed_volume,
    transformed,
    vertex_areas,
    vertex_normals,
)
from .placement import MEASURES, correlation
from .shapes import EDGE_MM, Shape

BASELINES = {
    "scaled": "the start brain, scaled to the volume that is foretold: no folding",
    "atlas": "the atlas' own brain of the week, scaled to that volume",
    "atlas_deformed": "the atlas' brain with all that sets the start apart from the atlas",
    "displaced": "the start moved by the atlas' displacement as registration alone sees it",
    "target": "what the run grows towards: the expected surface without mechanics",
}
"""Simpler ways to foretell a brain, by name."""
FAR = 0.95
"""Quantile of the distance that stands for its largest values."""


def distances(found: TriangleMesh, real: TriangleMesh) -> dict[str, float]:
    """Returns the symmetric distances of two surfaces in mm, laid onto each other rigidly, neither of them scaled.

    distance_mm is the mean over both surfaces, weighted by area, and distance95_mm the larger of their 95 % quantiles.
    """
    placed = transformed(found, fit_onto(found, real))
    means, far = [], []
    for one, other in ((placed, real), (real, placed)):
        even = remesh(one, EDGE_MM)
        away = nearest_on(even.vertices, other)[0]
        weights = vertex_areas(even)
        means.append(float(np.average(away, weights=weights)))
        order = np.argsort(away)
        share = np.cumsum(weights[order]) / weights.sum()
        far.append(float(away[order][np.searchsorted(share, FAR)]))
    return {"distance_mm": float(np.mean(means)), "distance95_mm": max(far)}


def roughness_mm(mesh: TriangleMesh) -> float:
    """Returns how far vertices lie from the mean of their neighbours along their normals, root mean square by area.

    Of surfaces with the same even triangles it tells wrinkles of the size of a triangle.
    """
    pairs = edges(mesh)[0]
    sums, count = np.zeros_like(mesh.vertices), np.zeros(len(mesh.vertices))
    for one, other in (pairs.T, pairs.T[::-1]):
        np.add.at(sums, one, mesh.vertices[other])
        np.add.at(count, one, 1)
    away = ((sums / count[:, None] - mesh.vertices) * vertex_normals(mesh)).sum(axis=1)
    return float(np.sqrt(np.average(away**2, weights=vertex_areas(mesh))))


def endpoints(found: TriangleMesh, real: TriangleMesh, shape: Shape, real_shape: Shape) -> dict[str, float]:
    """Returns what a foretold surface is worth against the real one.

    Columns: those of `distances`; area_error and volume_error as fractions of the real; r_… of each of `MEASURES`;
    crossing_faces; roughness_ratio, that of `roughness_mm` to the real surface's.

    Parameters
    ----------
    found, real
        Closed surfaces in mm as they are.
    shape, real_shape
        The same made ready for comparison.
    """
    match = match_points(real_shape.mesh.vertices, vertex_normals(real_shape.mesh), shape.mesh)
    return {
        **distances(found, real),
        "area_error": area(found) / area(real) - 1,
        "volume_error": signed_volume(found) / signed_volume(real) - 1,
        **{
            f"r_{name}": correlation(
                getattr(real_shape, name), values_at(match, getattr(shape, name)), real_shape.areas
            )
            for name in MEASURES
        },
        "crossing_faces": float(crossing_faces(found)),
        "roughness_ratio": roughness_mm(shape.mesh) / roughness_mm(real_shape.mesh),
    }


def scaled_to(mesh: TriangleMesh, volume_mm3: float) -> TriangleMesh:
    """Returns a closed surface scaled to a volume."""
    factor = (volume_mm3 / signed_volume(mesh)) ** (1 / 3)
    return transformed(mesh, np.diag([factor] * 3 + [1.0]))


def with_skill(rows: pd.DataFrame) -> pd.DataFrame:
    """Returns the rows of a prediction with skill = 1 − distance / distance of the best baseline of the week.

    The surface that the run grows towards is not among these baselines.

    Parameters
    ----------
    rows
        Columns week, model (`run` or one of `BASELINES`) and distance_mm.
    """
    simple = rows[~rows["model"].isin(["run", "target"])]
    best = rows["week"].map(simple.groupby("week")["distance_mm"].min())
    return rows.assign(skill=1 - rows["distance_mm"] / best)
