"""Deviation of an observed brain from the expected one: maps, means by region, and
centiles among other brains."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..geometry.diffusion import diffuse
from ..geometry.matching import match_surface, values_at
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    vertex_areas,
    vertex_normals,
)
from ..metrics.norms import cohort_norms, measured_scores
from ..metrics.tables import region_metrics
from ..metrics.thickness import at_part
from ..settings.terms import OBSERVED

SMOOTHING_MM = 3.0
"""Standard deviation of the Gaussian that smooths areas before they are compared."""
SCORES = ["expected", "sd", "z", "centile", "brains", "flag"]
type SurfaceThickness = tuple[TriangleMesh, Floats]
"""A pial surface in mm, and the (n,) cortical thickness at its vertices in mm."""


def deviation_maps(expected: TriangleMesh, fitted: TriangleMesh) -> dict[str, Floats]:
    """Return distance_mm and log_area of the observed brain at the (n,) vertices of the
    expected surface.

    `expected` is aligned with the observed surface, in mm, and `fitted` is the same
    surface deformed to fit it. distance_mm is along the normal, positive where the
    observed brain lies outside; log_area is the logarithm of the observed over the
    expected area.
    """
    ratio = vertex_areas(fitted) / vertex_areas(expected)
    return {
        "distance_mm": (
            ((fitted.vertices - expected.vertices) * vertex_normals(expected)).sum(
                axis=1
            )
        ),
        "log_area": np.log(
            diffuse(expected.vertices, expected.faces, ratio, SMOOTHING_MM)
        ),
    }


def thickness_difference(
    fitted: TriangleMesh,
    observed: SurfaceThickness,
    start: SurfaceThickness,
    simulated_start: SurfaceThickness,
    expected_mm: Floats,
) -> Floats:
    """Return the observed minus the expected thickness in mm at the (n,) vertices of
    the expected surface.

    The expected thickness is that of the observed start brain, multiplied by its growth
    in the run: `expected_mm`, at the week compared, over that of the `simulated_start`,
    at the same vertices. `fitted` is the expected surface deformed to fit the observed
    one of the week.
    """
    surface, simulated_mm = simulated_start
    observed_mm = _thickness_on(fitted, observed)
    start_mm = _thickness_on(surface, start)
    return observed_mm - start_mm * expected_mm / simulated_mm


def _thickness_on(mesh: TriangleMesh, known: SurfaceThickness) -> Floats:
    surface, thickness_mm = known
    return values_at(match_surface(mesh, surface), thickness_mm)


def deviation_table(
    columns: Mapping[str, Any],
    surface: TriangleMesh,
    maps: Mapping[str, Floats],
    sides: Mapping[str, TriangleMesh],
    regions: Mapping[str, tuple[Ints, Mapping[int, str]]],
) -> pd.DataFrame:
    """Average maps over the whole brain, its hemispheres and their regions, by area.

    The maps are at the (n,) vertices of the expected surface in mm; the vertices of its
    `sides` are among them. `regions` are by side the labels of the hemisphere's
    vertices and the names of the labels, empty without regions.

    The table has the given `columns`, hemisphere, region ("" for all of it), metric
    (the map, without its unit), value, unit.
    """
    parts = {"whole": surface, **sides}
    part_maps = {
        part: {name: at_part(values, surface, mesh) for name, values in maps.items()}
        for part, mesh in parts.items()
    }
    everywhere = {
        part: np.ones(
            len(mesh.vertices),
            dtype=np.int64,
        )
        for part, mesh in parts.items()
    }
    tables = [region_metrics(parts, part_maps, everywhere, {1: ""})]
    tables += [
        region_metrics(
            {side: sides[side]},
            part_maps,
            {side: vertex_labels},
            names,
        )
        for side, (vertex_labels, names) in regions.items()
    ]
    table = pd.concat(tables, ignore_index=True)
    means = table[table["metric"].str.startswith("mean_")]
    table = means.assign(
        metric=means["metric"].str.removeprefix("mean_"),
        **columns,
    )
    return table[[*columns, "hemisphere", "region", "metric", "value", "unit"]]


def deviation_scores(deviations: pd.DataFrame, *, individuals: bool) -> pd.DataFrame:
    """Add to each deviation its z-score and centile among those of the other brains of
    the run.

    Deviations are rows of `deviation_table` with the columns run, subject and week;
    those without a value are left out. Averages, which do not differ as `individuals`
    do, have no centiles.
    """
    tables = []
    for _, table in deviations.dropna(subset=["value"]).groupby("run", sort=False):
        # scores are computed by hemisphere, so each region is passed as a hemisphere of
        # its own
        parts = table["hemisphere"] + " " + table["region"].fillna("")
        # brains of one run have norms as observed brains have
        rows = table.assign(run=OBSERVED, hemisphere=parts)
        subjects = list(table["subject"])
        norms = cohort_norms(
            rows,
            subjects,
            individuals=individuals,
        )
        scores = measured_scores(rows, subjects, norms)
        tables.append(table.reset_index(drop=True).join(scores[SCORES]))
    return pd.concat(tables, ignore_index=True)
