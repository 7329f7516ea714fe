"""In which week a sulcus appears that is not there at the start."""

from collections import Counter
from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.triangles import Floats, Ints, TriangleMesh, face_areas, face_components, submesh, vertex_areas

DEEP_MM = 2.0
"""A sulcus is there when it is so much below its neighbouring crowns."""

NEIGHBOURHOOD_MM = 10.0
"""Round a region, where its crowns are."""

LEAST_REGION_MM2 = 40.0
"""Smaller places are no sulci that are looked for."""

BOTTOM, CROWN = 0.9, 0.1
"""Quantiles of depth by area that stand for the bottom of a region and for the crowns beside it."""


def sulcal_regions(mesh: TriangleMesh, depth_mm: Floats, mean_curvature: Floats) -> Ints:
    """Number the sulci of a hemisphere at its (n,) vertices, 1 for the largest, 0 outside of sulci.

    A sulcus is a connected valley (mean curvature below 0, positive on gyri) deeper than `DEEP_MM` below the hull, of
    `LEAST_REGION_MM2` or more. Valleys of the medial wall and the Sylvian fissure are among them.
    """
    regions = np.zeros(len(mesh.vertices), dtype=np.int64)
    valley = (depth_mm >= DEEP_MM) & (mean_curvature < 0)
    deep = np.asarray(valley[mesh.faces].all(axis=1))
    if not deep.any():
        return regions
    part, used = submesh(mesh, deep)
    component = face_components(part)
    sizes = np.bincount(component, face_areas(part))
    largest = [number for number in np.argsort(-sizes, kind="stable") if sizes[number] >= LEAST_REGION_MM2]
    for name, number in enumerate(largest, start=1):
        regions[used[np.unique(part.faces[component == number])]] = name
    return regions


def relief(
    mesh: TriangleMesh, depth_mm: Floats, regions: NDArray[np.integer], names: Mapping[int, str]
) -> pd.DataFrame:
    """Tell how deep regions are below their neighbouring crowns: columns region, bottom_mm, crown_mm, relief_mm.

    The (n,) depth of the vertices is below the hull or envelope; their (n,) region labels are each the place of a
    sulcus, carried along from an atlas. Labels with names count; a region without vertices has NaN.
    """
    areas = vertex_areas(mesh)
    rows = []
    for label, name in names.items():
        inside = regions == label
        if not inside.any():
            rows.append((name, np.nan, np.nan, np.nan))
            continue
        away, _ = cKDTree(mesh.vertices[inside]).query(mesh.vertices, distance_upper_bound=NEIGHBOURHOOD_MM)
        near = np.isfinite(away)
        bottom, crown = (
            float(np.quantile(depth_mm[part], share, weights=areas[part], method="inverted_cdf"))
            for part, share in ((inside, BOTTOM), (near, CROWN))
        )
        rows.append((name, bottom, crown, bottom - crown))
    return pd.DataFrame(rows, columns=["region", "bottom_mm", "crown_mm", "relief_mm"])


def onset(reliefs: Mapping[float, pd.DataFrame]) -> pd.DataFrame:
    """Find the week in which each region's sulcus appears, from tables of `relief` by week.

    The first time that the relief reaches 2 mm, linear between weeks. Columns region, there_at_start, onset_week (NaN
    where it was there at the start or never comes), first_relief_mm, last_relief_mm.
    """
    weeks, rows = sorted(reliefs), []
    for name, table in pd.concat([reliefs[week] for week in weeks]).groupby("region", sort=False):
        depths = table["relief_mm"].to_numpy(dtype=float)
        reached = np.flatnonzero(depths >= DEEP_MM)
        week = np.nan
        if len(reached) and reached[0] > 0:
            before, after = reached[0] - 1, reached[0]
            part = (DEEP_MM - depths[before]) / (depths[after] - depths[before])
            # where the depth of the week before is not known, the week itself
            week = weeks[before] + part * (weeks[after] - weeks[before]) if np.isfinite(part) else weeks[after]
        rows.append((name, bool(depths[0] >= DEEP_MM), week, depths[0], depths[-1]))
    return pd.DataFrame(rows, columns=["region", "there_at_start", "onset_week", "first_relief_mm", "last_relief_mm"])


def named(
    mesh: TriangleMesh,
    sulci: NDArray[np.integer],
    regions: NDArray[np.integer],
    names: Mapping[int, str],
    side: str,
) -> tuple[Ints, dict[int, str]]:
    """Part the sulci of a hemisphere by the regions of the cortex that they lie in, and their names.

    A connected valley that reaches through several regions is parted between those that have `LEAST_REGION_MM2` or
    more of it; what is left of it goes to the largest part, and so does what is in no region, unless that is more
    than half. Names are as "left central", with a number from the second one of a region on, by size; parts outside
    of all regions are called by the number of their valley, as "left 4".

    Parameters
    ----------
    sulci
        (n,) numbers of `sulcal_regions`.
    regions, names
        (n,) labels of the vertices, and the names of those that are regions; without any, sulci are "left 1" and so on.
    """
    areas, parts = vertex_areas(mesh), []
    labels = np.where(np.isin(regions, list(names)), regions, 0)
    for number in range(1, int(sulci.max()) + 1):
        inside = sulci == number
        sizes = np.bincount(labels[inside], areas[inside], minlength=int(labels.max()) + 1)
        kept = [int(label) for label in np.flatnonzero(sizes >= LEAST_REGION_MM2)]
        # the rim of a sulcus is often in no region
        if sizes[0] <= sizes.sum() / 2:
            kept = [label for label in kept if label > 0]
        kept = kept or [int(np.argmax(sizes))]
        largest = max(kept, key=lambda label: sizes[label])
        part = np.where(np.isin(labels, kept), labels, largest)
        parts += [(number, label, inside & (part == label)) for label in kept]
    parts.sort(key=lambda part: -areas[part[2]].sum())
    numbers, count = np.zeros(len(sulci), dtype=np.int64), Counter[int]()
    named: dict[int, str] = {}
    for place, (number, label, vertices) in enumerate(parts, start=1):
        numbers[vertices] = place
        count[label] += 1
        again = f" {count[label]}" if count[label] > 1 else ""
        name = f"{side} {names[label]}{again}" if label in names else f"{side} {number}"
        # a region may be called by a number too
        named[place] = f"{name} ({place})" if name in named.values() else name
    return numbers, named
