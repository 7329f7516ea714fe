"""Onset of sulci: the week when each sulcus of the last observed brain appears."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.matching import labels_at, match_surface
from ..geometry.triangles import Floats, TriangleMesh, convex_hull, face_areas, face_components, submesh, vertex_areas
from ..metrics.curvature import curvature
from ..metrics.gyrification import sulcal_depth

MIN_DEPTH_MM = 2.0
"""A sulcus is present if it is at least this deep below its neighbouring crowns."""
CROWN_DISTANCE_MM = 10.0
"""Distance from a sulcus within which its neighbouring crowns are searched for."""

MIN_AREA_MM2 = 40.0
"""Smallest area of a valley that counts as a sulcus."""
BOTTOM_QUANTILE, CROWN_QUANTILE = 0.9, 0.1
"""Quantiles of depth by area that stand for the bottom of a sulcus and for the crowns around it."""


def find_named_sulci(
    mesh: TriangleMesh, side: str, labels: NDArray[np.integer] | None, names: Mapping[int, str], *, radius_mm: float
) -> tuple[NDArray[np.int64], dict[int, str]]:
    """Find the sulci of a hemisphere and name them by the regions that they lie in.

    Returns the (n,) number of the sulcus at each vertex, 0 outside, and the names of the numbers: see `find_sulci` and
    `name_sulci`. `labels` (n,) are the regions with `names`, None if the brain has none; `radius_mm` is that of the
    fitted curvature.
    """
    depth_mm = sulcal_depth(mesh, convex_hull(mesh))
    sulci = find_sulci(mesh, depth_mm, curvature(mesh, radius_mm=radius_mm).mean)
    return name_sulci(mesh, sulci, np.zeros_like(sulci) if labels is None else labels, names, side)


def find_sulci(mesh: TriangleMesh, depth_mm: Floats, mean_curvature: Floats) -> NDArray[np.int64]:
    """Number the sulci of a hemisphere at its (n,) vertices, 1 for the largest, 0 outside of sulci.

    A sulcus is a connected valley (negative mean curvature) deeper than `MIN_DEPTH_MM` below the hull, with an area of
    at least `MIN_AREA_MM2`. Valleys of the medial wall and the Sylvian fissure are included.
    """
    sulci = np.zeros(len(mesh.vertices), dtype=np.int64)
    valley = (depth_mm >= MIN_DEPTH_MM) & (mean_curvature < 0)
    deep = np.asarray(valley[mesh.faces].all(axis=1))
    if not deep.any():
        return sulci
    part, used = submesh(mesh, deep)
    component = face_components(part)
    sizes = np.bincount(component, face_areas(part))
    largest = [number for number in np.argsort(-sizes, kind="stable") if sizes[number] >= MIN_AREA_MM2]
    for number, valley_number in enumerate(largest, start=1):
        sulci[used[np.unique(part.faces[component == valley_number])]] = number
    return sulci


def name_sulci(
    mesh: TriangleMesh, sulci: NDArray[np.integer], labels: NDArray[np.integer], names: Mapping[int, str], side: str
) -> tuple[NDArray[np.int64], dict[int, str]]:
    """Divide the sulci of a hemisphere among the regions of the cortex, and name the parts.

    Sulci are the (n,) numbers of `find_sulci`, labels (n,) those of the vertices; `names` are those of labels that are
    regions. Returns the (n,) numbers of the parts, 1 for the largest, 0 outside of sulci, and their names, like "left
    central", then "left central 2" for the second largest part in that region. Parts outside all regions are named by
    the number of their valley, like "left 4".
    """
    areas = vertex_areas(mesh)
    named_labels = np.where(np.isin(labels, list(names)), labels, 0)
    parts = [
        (number, label, inside)
        for number in range(1, int(sulci.max()) + 1)
        for label, inside in _parts_by_region(sulci == number, named_labels, areas)
    ]
    parts.sort(key=lambda part: -areas[part[2]].sum())
    numbers, count = np.zeros(len(sulci), dtype=np.int64), Counter[int]()
    part_names: dict[int, str] = {}
    for place, (number, label, inside) in enumerate(parts, start=1):
        numbers[inside] = place
        count[label] += 1
        suffix = f" {count[label]}" if count[label] > 1 else ""
        name = f"{side} {names[label]}{suffix}" if label in names else f"{side} {number}"
        # the name of a region may be a number
        part_names[place] = f"{name} ({place})" if name in part_names.values() else name
    return numbers, part_names


def _parts_by_region(
    inside: NDArray[np.bool_], labels: NDArray[np.integer], areas: Floats
) -> list[tuple[int, NDArray[np.bool_]]]:
    """Divide a sulcus among the regions with `MIN_AREA_MM2` or more of it; the rest goes to the largest part.

    The area outside all regions goes to the largest part too, unless it is more than half of the sulcus.
    """
    sizes = np.bincount(labels[inside], areas[inside], minlength=int(labels.max()) + 1)
    large = [int(label) for label in np.flatnonzero(sizes >= MIN_AREA_MM2)]
    # the rim of a sulcus is often in no region
    if sizes[0] <= sizes.sum() / 2:
        large = [label for label in large if label > 0]
    large = large or [int(np.argmax(sizes))]
    largest = max(large, key=lambda label: sizes[label])
    part = np.where(np.isin(labels, large), labels, largest)
    return [(label, inside & (part == label)) for label in large]


def onset_table(
    surfaces: Mapping[float, TriangleMesh],
    carried: Sequence[TriangleMesh],
    last: TriangleMesh,
    sulci: NDArray[np.integer],
    names: Mapping[int, str],
) -> pd.DataFrame:
    """Find the week when each sulcus of the last observed brain appears in a series of surfaces, as `find_onset`.

    `surfaces` are a hemisphere by week in mm, and `carried` the same with vertices carried onto the last observed
    brain. `sulci` and `names` are the result of `find_named_sulci` on the `last` brain's hemisphere.
    """
    reliefs = {}
    for (week, mesh), on_last in zip(surfaces.items(), carried, strict=True):
        labels = labels_at(match_surface(on_last, last), sulci)
        reliefs[week] = measure_relief(mesh, sulcal_depth(mesh, convex_hull(mesh)), labels, names)
    return find_onset(reliefs)


def measure_relief(
    mesh: TriangleMesh, depth_mm: Floats, sulci: NDArray[np.integer], names: Mapping[int, str]
) -> dict[str, float]:
    """Return by name how deep in mm each sulcus is below its neighbouring crowns; NaN for sulci without vertices.

    `depth_mm` (n,) is the depth of the vertices below the hull or envelope.
    """
    areas, reliefs = vertex_areas(mesh), dict.fromkeys(names.values(), np.nan)
    for number, name in names.items():
        if not (inside := sulci == number).any():
            continue
        tree = cKDTree(mesh.vertices[inside])
        distances, _ = tree.query(mesh.vertices, distance_upper_bound=CROWN_DISTANCE_MM)
        bottom, crown = (
            float(np.quantile(depth_mm[part], share, weights=areas[part], method="inverted_cdf"))
            for part, share in ((inside, BOTTOM_QUANTILE), (np.isfinite(distances), CROWN_QUANTILE))
        )
        reliefs[name] = bottom - crown
    return reliefs


def find_onset(reliefs: Mapping[float, Mapping[str, float]]) -> pd.DataFrame:
    """Find the week when each sulcus appears, from the reliefs of `measure_relief` by week.

    That is the first week with a relief of `MIN_DEPTH_MM`, interpolated linearly from the week before (not interpolated
    if the relief of the week before is NaN). Columns: region, there_at_start, onset_week (NaN if the sulcus was present
    at the start or never appears), first_relief_mm, last_relief_mm.
    """
    weeks, rows = sorted(reliefs), []
    for name in reliefs[weeks[0]]:
        depths = np.array([reliefs[week][name] for week in weeks])
        reached = np.flatnonzero(depths >= MIN_DEPTH_MM)
        week = np.nan
        if len(reached) and reached[0] > 0:
            before, after = reached[0] - 1, reached[0]
            share = (MIN_DEPTH_MM - depths[before]) / (depths[after] - depths[before])
            week = weeks[before] + share * (weeks[after] - weeks[before]) if np.isfinite(share) else weeks[after]
        rows.append((name, bool(depths[0] >= MIN_DEPTH_MM), week, depths[0], depths[-1]))
    return pd.DataFrame(rows, columns=["region", "there_at_start", "onset_week", "first_relief_mm", "last_relief_mm"])
