"""All numbers of the room's functions on bodies without a symmetry, far from the
origin, and on series with two brains a week."""

import numpy as np
import pandas as pd
import pytest
from recording import answer_of
from shapes import (
    FAR,
    LONG_MM,
    inner,
    rigid,
    scaling,
    smooth_field,
    uneven_body,
    uneven_surface,
)

from gyriflow.geometry.deformations import Deformation, MatchedSurfaces
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.growth import (
    atlas_path,
    carried_regions,
    carrying,
    curves,
    expected,
    rates,
    registration,
    series_shapes,
)

WEEKS = np.array([21.0, 21.0, 22.5, 23.0, 25.0, 25.0, 26.5, 28.0])


def grown(points, week):
    """Return (n, 3) points after growth since 21 GW that bends and moves them."""
    centre = FAR[0][:3, 3]
    age = week - 21.0
    offset = (points - centre) * (1.0 + np.array([0.02, 0.04, 0.03]) * age)
    bent = 0.2 * age * np.sin(points[:, [1, 2, 0]] / 9.0)
    return centre + offset + bent + [0.5 * age, -0.2 * age, 0.3]


@pytest.fixture(scope="module")
def path():
    """Return shapes of a body in four weeks, of which one was not observed."""
    mesh = uneven_body(4)
    shapes = [
        series_shapes.WeekShape(week, grown(mesh.vertices, week), week == 23.5)
        for week in (21.0, 22.5, 23.5, 26.0)
    ]
    return atlas_path.AtlasPath(mesh.tets, series_shapes.SeriesShapes.of(shapes))


def series():
    """Return sizes of two series of brains, that of the second week out of line."""
    tables = []
    for name, factor in (("volume", 1.0), ("surface", 1.3)):
        areas = factor * 90 * np.exp(0.09 * (WEEKS - 21) - 0.002 * (WEEKS - 21) ** 2)
        areas[1] *= 1.2
        brains = {"series": name, "subject": list("abcdefgh"), "week": WEEKS}
        brains |= {"area_cm2": areas, "volume_ml": 0.04 * areas**1.5}
        brains["tissue_ml"] = 0.03 * areas**1.45
        tables.append(pd.DataFrame(brains))
    return pd.concat(tables, ignore_index=True)


def test_numbers_of_curves(recorded):
    areas = series()
    fits = curves.fits_of_series(areas)
    table = []
    for name, by_size in fits.items():
        by_name = {size: fit.curve for size, fit in by_size.items()}
        table.append(curves.curve_table(by_name).assign(series=name))
    table = pd.concat(table)
    kept = curves.fitted(
        WEEKS, areas["area_cm2"][:8], degrees_of_freedom=3.5, keeps_first=True
    )
    at = np.array([20.0, 21.7, 24.0, 29.0])
    growth = {"model": "sizes", "area_cm2": "measured", "volume_ml": {21: 40, 27: 99}}
    weeks = [21.0, 22.0, 24.0]
    recorded(
        {
            "fits": fits,
            "errors": curves.errors(fits["surface"]),
            "table": table,
            "kept": kept,
            "values": [curves.value(kept.curve, at)],
            "rates": [curves.rate(kept.curve, at)],
            "followed": curves.followed_sizes(growth, table, "surface", weeks, False),
            "sizes": curves.sizes_on_curves({"model": "rates"}, table, "volume", weeks),
        }
    )


def test_numbers_of_rates(recorded):
    random = np.random.default_rng(2)
    frames = {}
    for number, week in enumerate((21.0, 22.0, 24.5)):
        mesh = uneven_surface(2)
        fields = {
            "tangential_growth_per_step": 0.01 * number + 0.001 * random.random(162),
            "radial_growth_per_step": 0.02 * number + 0.001 * random.random(162),
            "growth_direction_per_step": random.normal(size=(162, 3)),
        }
        frames[week] = (mesh, fields)
    found = rates.growth_per_week(frames, 86400.0)
    members = []
    for factor in (0.9, 1.2, 1.3):
        maps = {name: factor * values for name, values in found[22.0, 24.5].items()}
        members.append(maps)
    recorded(
        {
            "pairs": rates.growth_rates(
                [21, 22.5, 25], [9e3, 1e4, 1.4e4], [4e4, 5e4, 8e4]
            ),
            "series": answer_of(rates.rates_of_series, series(), ["volume", "surface"]),
            "per week": {str(interval): maps for interval, maps in found.items()},
            "sd": rates.growth_sd(found[22.0, 24.5], members),
            "sd of one": rates.growth_sd(found[22.0, 24.5], members[:1]),
        }
    )


def test_numbers_of_an_atlas_path(recorded, path):
    mesh = path.mesh(21.0)
    volumes = 60 * np.exp(0.1 * (WEEKS[1:] - 21))
    volumes[2] *= 1.1
    weeks = np.array([21.0, 22.0, 23.0, 24.5, 25.0, 26.0, 28.0])
    norm = dict(zip(weeks[weeks < 25], 1.1 * volumes[weeks < 25], strict=True))
    ages = atlas_path.ages_by_size(weeks, volumes, [norm])
    own = path.ages()
    points = mesh.vertices * 0.98 + 0.02 * mesh.vertices.mean(axis=0)
    points[::5] += 2.0
    places = path.carry(points, 22.5)
    knots = path.knots(own)
    sizes = vertex_sizes(mesh.vertices, mesh.tets)
    recorded(
        {
            "ages": ages.table(),
            "volume": curves.value(ages.curve, [20.0, 23.7, 29.0]),
            "own": own.table(),
            "knots": knots,
            "observed": path.observed,
            "carried": list(places),
            "resampled": list(
                atlas_path.resample_by_size(
                    mesh, path.shapes.positions, [22.0, 25.0], own, knots
                )
            ),
            "at": atlas_path.positions_at(
                23.0, path.shapes.positions, path.shapes.weeks, sizes
            ),
        },
        rtol=1e-3,
    )


def test_numbers_of_a_prediction(recorded, path):
    mesh = uneven_body(3)
    start = TetrahedralMesh(1.02 * mesh.vertices, mesh.tets)
    places = path.carry(mesh.vertices, 21.0)
    found = expected.expected_positions(
        start, 21.0, places, path.shapes.weeks, [21.0, 22.0, 25.0], smoothing_mm=5.0
    )
    recorded({"positions": list(found.positions), "kept": found.kept}, rtol=1e-3)


def test_numbers_of_what_is_carried(recorded):
    first = uneven_surface(3)
    second = transformed(
        TriangleMesh(grown(first.vertices, 24.0), first.faces),
        rigid(4.0, -6.0, 3.0, shift=(5.0, 2.0, 1.0)),
    )
    pair, report = carrying.match_surfaces(first, second)
    other = transformed(uneven_surface(2), rigid(shift=(0.3, -0.2, 0.4)))
    labels = 1 + (other.vertices[:, 1] > other.vertices[:, 1].mean())
    body = uneven_body(3)
    shape = np.array([14, 12, 10])
    grid = scaling(np.multiply(12.0, LONG_MM), first.vertices.min(axis=0) - 15.0)
    u = np.stack(np.meshgrid(*(np.linspace(0, 2, n) for n in shape), indexing="ij"), -1)
    between = Deformation(rigid(2.0, 3.0, -5.0), u**2, grid)
    maps = {"depth_mm": smooth_field(other.vertices)}
    recorded(
        {
            "report": report,
            "through surfaces": carrying.maps_on_template(
                {"depth_mm": smooth_field(second.vertices)}, second, other, [pair]
            ),
            "followed": carrying.follow_surfaces(other, [pair]),
            "over weeks": carrying.carry_over_weeks(body.vertices, [between]),
            "regions": np.bincount(carrying.carry_regions(labels, other, second, pair)),
            "on template": carrying.maps_on_template(maps, other, first, []),
            "numbers": carried_regions.number_regions(
                {1: "a", 5: "b"}, {2: "b", 3: "c"}
            ),
            "renumbered": carried_regions.renumber(
                np.array([1, 5, 1, 0]), {1: "a", 5: "b"}, {"b": 1, "a": 2}
            ),
            "from surface": np.bincount(
                carried_regions.regions_from_surface(first, other, labels)
            ),
        },
        rtol=1e-3,
    )


def layered(matrix):
    """Return labels and the affine of an uneven body in long voxels, cortex outside."""
    size = np.array([30, 26, 24])
    affine = matrix @ scaling(np.multiply(1.6, LONG_MM), -12.0)
    x, y, z = (np.indices(size).T * np.multiply(1.6, LONG_MM) - 12.0).T
    depth = 1.0 - np.sqrt((x / 9) ** 2 + (y / 11) ** 2 + ((z - 3) / 13) ** 2)
    depth += 0.05 * np.sin(x + y / 2)
    return np.digitize(depth, [0.0, 0.25]), affine


def test_numbers_of_a_registration(recorded):
    labels, affine = layered(FAR[0])
    later, other = layered(rigid(3.0, 2.0, -4.0, shift=(4.0, 3.0, 1.0)) @ FAR[0])
    common = {"cerebrum": (1, 2), "cortex": (1,)}
    image = (np.sin(np.arange(labels.size)).reshape(labels.shape), affine)
    first = registration.channels(labels, affine, **common, image=image)
    second = registration.channels(later, other, **common, voxel_mm=1.5)
    ticks = [np.linspace(0.0, 2.0, length) for length in first.tissue.shape]
    u = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1) ** 2
    bend = Deformation(other @ np.linalg.inv(affine), u, first.affine)
    quality = registration._measure_quality(first, second, bend)
    recorded(
        {
            "first": first,
            "second": second,
            "voxel": [first.voxel_mm, second.voxel_mm],
            "perturbed": registration.perturb_labels(labels, 3, "b"),
            "quality": quality,
        },
        rtol=2e-3,
        atol=2e-4,
    )


def test_numbers_of_fitted_surfaces(recorded, path):
    mesh = path.mesh(21.0)
    boundary, _ = boundary_surface(mesh)
    target = uneven_surface(3)
    near = TriangleMesh(
        target.vertices * 1.01 - 0.01 * target.vertices.mean(axis=0), target.faces
    )
    below = inner(target, 2.0).vertices
    later, _ = boundary_surface(path.mesh(26.0))
    pair = Deformation(np.eye(4), np.full((2, 2, 2, 3), 0.3), np.eye(4))
    pairs = [
        MatchedSurfaces(
            TriangleMesh(boundary.vertices, boundary.faces),
            grown(boundary.vertices, week),
        )
        for week in (22.0, 24.0)
    ]
    pairs[1] = MatchedSurfaces(
        TriangleMesh(pairs[0].second, boundary.faces), pairs[1].second
    )
    recorded(
        {
            "fitted": series_shapes.fit_onto_surface(target, near),
            "by tissue": series_shapes.fit_onto_surface(target, near, inner=below),
            "tissue below": series_shapes.tissue_below(target, near, pair),
            "misfit": series_shapes.misfit_mm(boundary, later),
            "sizes": series_shapes.sizes_of(mesh, path.shapes.positions),
            "by week": path.shapes.by_week(),
            "series": series_shapes.follow_series(mesh, [21.0, 22.0, 24.0], pairs, []),
        },
        rtol=1e-3,
    )
