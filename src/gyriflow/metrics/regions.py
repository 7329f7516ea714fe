"""Metrics by region, from labels at the vertices of hemispheres."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import Ints, TriangleMesh, area, vertex_areas
from ..quantities import VERTEX_MAPS
from ..settings.terms import NO_REGION
from ..units import CM2_PER_MM2


def region_metrics(
    sides: Mapping[str, TriangleMesh],
    maps: Mapping[str, Mapping[str, NDArray]],
    labels: Mapping[str, Ints],
    names: Mapping[int, str],
) -> pd.DataFrame:
    """Return area and means of maps by region of each hemisphere, weighted by area.

    Sides are the pial surfaces of "left" and "right", or of the only hemisphere. Per hemisphere there are maps, as
    `measure.BrainMetrics.maps`, and the (n,) label of each vertex, 0 for none; names are those of the regions by label.
    NaN is left out of means, and so is what lies near a cut where `reliable` is 0.

    Columns hemisphere, region, metric, value, unit. Metrics are area (cm2), area_share (of the hemisphere) and the mean
    of each map that is averaged (`VertexMap.mean_name`); a region that is all NaN or near a cut has NaN. InputError for
    labels that have no name, or are not as many as vertices.
    """
    rows = []
    for side, mesh in sides.items():
        label = np.asarray(labels[side])
        unknown = sorted({int(number) for number in np.unique(label)} - {NO_REGION, *names})
        if unknown or len(label) != len(mesh.vertices):
            summary = f"{len(label)} labels, without a name: {', '.join(map(str, unknown)) or 'none'}"
            expected = f"{len(mesh.vertices)} labels, each named"
            raise InputError(f"regions of the {side} hemisphere do not fit", found=summary, expected=expected)
        areas, total = vertex_areas(mesh), area(mesh)
        reliable = np.asarray(maps[side].get("reliable", np.ones(len(label))), dtype=bool)
        for number, name in names.items():
            inside = label == number
            covered = float(areas[inside].sum())
            rows.append((side, name, "area", covered * CM2_PER_MM2, "cm2"))
            rows.append((side, name, "area_share", covered / total, "1"))
            for key, vertex_values in maps[side].items():
                if VERTEX_MAPS[key].is_averaged:
                    values = np.asarray(vertex_values, dtype=float)
                    used = inside & np.isfinite(values) & reliable
                    mean = float(np.average(values[used], weights=areas[used])) if areas[used].any() else np.nan
                    rows.append((side, name, VERTEX_MAPS[key].mean_name, mean, VERTEX_MAPS[key].unit))
    return pd.DataFrame(rows, columns=["hemisphere", "region", "metric", "value", "unit"])
