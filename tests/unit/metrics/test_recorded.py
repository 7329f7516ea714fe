"""All numbers of the room's functions on a brain of two unequal, uneven hemispheres,
and of tables of two brains a week."""

import numpy as np
import pandas as pd
import pytest
import yaml
from shapes import FAR, rigid, smooth_field, uneven_body, uneven_surface

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import (
    TriangleMesh,
    corners,
    merged,
    submesh,
    transformed,
    vertex_areas,
)
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.metrics import (
    curvature,
    gyrification,
    laplace_beltrami,
    lms,
    measure,
    norms,
    repeatability,
    spangy,
    tables,
    thickness,
)
from gyriflow.settings.terms import SIDES
from gyriflow.shipped import SHIPPED

BRAIN = ["subject", "run", "week"]


@pytest.fixture(scope="module")
def sides():
    """Return a left hemisphere, open at its medial wall, and a larger one, closed."""
    closed = uneven_surface(3)
    x = corners(closed)[:, :, 0].mean(axis=1)
    left = submesh(closed, x < np.quantile(x, 0.8))[0]
    right = transformed(
        closed, FAR[1] @ np.diag([-1.1, 1.0, 0.95, 1.0]) @ np.linalg.inv(FAR[0])
    )
    centre = left.vertices.mean(axis=0) - right.vertices.mean(axis=0)
    right = transformed(right, rigid(shift=centre + [45.0, 3.0, -2.0]))
    return {"left": left, "right": right}


@pytest.fixture(scope="module")
def brain(sides):
    """Return the measured brain."""
    whole = merged(gyrification.cap(sides["left"]), sides["right"])
    mm = 1.0 + smooth_field(whole.vertices)
    mm[::7] = np.nan
    known = {"cerebrum": 70.0, "tissue": 66.0, "cortex": 20.0, "ventricles": 4.0}
    return measure.measure_brain(
        whole,
        sides["left"],
        sides["right"],
        thickness_mm=mm,
        label_volumes_ml=known,
        curvature_radius_mm=7.0,
        spangy_modes=40,
    )


def test_numbers_of_a_brain(recorded, brain):
    by_name = {}
    for _, row in brain.table.iterrows():
        by_name[f"{row['hemisphere']} {row['metric']} {row['unit']}"] = row["value"]
    recorded(
        {
            "metrics": by_name,
            "maps": brain.maps,
            "spectra": brain.spectra,
            # rounding decides the signs of modes
            "modes": brain.coefficients.map(
                lambda value: abs(value) if isinstance(value, float) else value
            ),
        },
        rtol=1e-3,
    )


def test_numbers_of_white_surfaces(recorded, sides):
    table, maps = measure.measure_white(sides, 8.0)
    recorded({"table": table, "maps": maps}, rtol=1e-3)


def test_numbers_of_curvature_and_gyrification(recorded, sides):
    mesh = sides["left"]
    bend = curvature.curvature(mesh, radius_mm=7.0)
    areas = vertex_areas(mesh)
    capped = gyrification.cap(mesh)
    envelope = gyrification.envelope(capped)
    around = gyrification.pieces_without_cuts(envelope, capped)
    recorded(
        {
            "curvature": bend,
            "mean": bend.mean,
            "gaussian": bend.gaussian,
            "index": bend.shape_index,
            "curvedness": bend.curvedness,
            "kept": curvature.kept_curvature(np.array([3.0, 9.0, 30.0]), 4.0),
            "metrics": curvature.curvature_metrics(bend, areas),
            "cap": capped,
            "depth": gyrification.sulcal_depth(mesh, envelope),
            "area of pieces": around.areas.sum(),
            "index of gyrification": gyrification.gyrification_index([mesh], [around]),
            "local": gyrification.local_gyrification_index(mesh, around),
        },
        rtol=1e-3,
    )


def test_numbers_of_modes(recorded):
    # of more vertices than are solved as a whole
    mesh = uneven_surface(4)
    results = {}
    for mass in ("mean", "lumped"):
        matrices = laplace_beltrami.laplacian(mesh, mass)
        first = laplace_beltrami.first_eigenvalue(*matrices)
        modes = laplace_beltrami.lowest_modes(*matrices, 12)
        results[mass] = {
            "stiffness": matrices[0],
            "mass": matrices[1],
            "first": first,
            "eigenvalues": modes.eigenvalues,
            "sizes": np.abs(modes.functions).mean(axis=0),
            "below": laplace_beltrami.modes_below(*matrices, 6 * first).eigenvalues,
            "count": laplace_beltrami.count_below(*matrices, 9 * first),
        }
    results["weyl"] = spangy.weyl_number(5000.0, 0.004)
    recorded(results, rtol=1e-3)


def test_numbers_of_simulated_thickness(recorded):
    start = uneven_body(6)
    centre = start.vertices.mean(axis=0)
    distance = np.linalg.norm((start.vertices - centre) / [16, 24, 19], axis=1)
    weight = np.clip(1.3 - distance, 0.0, 1.0)
    depth = thickness.depth_of_weight(weight)
    grown = start.vertices + 0.1 * (start.vertices - centre) * [1.0, 0.5, 2.0]
    moved, _ = boundary_surface(TetrahedralMesh(grown, start.tets))
    values = thickness.simulated_thickness(start, 5 * weight, grown, moved)
    part, _ = submesh(moved, np.arange(len(moved.faces)) % 3 > 0)
    recorded(
        {
            "depth": depth,
            "thickness": values,
            "at part": thickness.at_part(values, moved, part),
        },
        rtol=1e-3,
    )


def cohort():
    """Return the metrics of people over the weeks, two brains a week, and of a run."""
    random = np.random.default_rng(3)
    rows = []
    for number in range(18):
        week = 21.0 + 0.9 * (number // 2)
        for side, share in (("left", 0.52), ("right", 0.48), ("whole", 1.0)):
            size = share * 9 * (week - 10) * np.exp(0.05 * random.normal())
            index = 0.1 * random.normal() - 0.01 * week
            for metric, value, unit in (
                ("area", size, "cm2"),
                ("mean_shape_index", index, "1"),
            ):
                common = {"hemisphere": side, "metric": metric, "unit": unit}
                brain = {"subject": f"s{number}", "run": "observed", "week": week}
                rows.append(brain | common | {"value": value})
                if number in (3, 8):
                    later = {"run": "fold", "week": week + 1, "value": 1.1 * value}
                    rows.append(brain | common | later)
    return pd.DataFrame(rows)


def test_numbers_of_tables(recorded):
    metrics = cohort()
    regions = metrics[::5].assign(region="insula", value=metrics["value"] / 9)
    long = tables.long_table([metrics, regions])
    scans = {"one": ["s2", "s5"], "two": ["s8", "s12", "s17"]}
    record = {"metrics": {}, "distances": {}}
    for number, metric in enumerate(sorted(metrics["metric"].unique()), start=1):
        record["metrics"][metric] = {"cv": 0.01 * number, "sd": 0.1 * number}
    change = tables.change_between_scans(long, scans)
    random = np.random.default_rng(1)
    places = [random.normal(size=(12, 3)) for _ in range(3)]
    described = tables.described_columns(long)
    recorded(
        {
            "long": long,
            "wide": tables.wide_table(long, {"s3": {"sex": "F"}, "s0": {"sex": "M"}}),
            "units": {name: unit for name, (_, unit) in described.items()},
            "asymmetry": tables.asymmetry(long),
            "change": repeatability.with_change_noise(change, record),
            "norms": tables.weekly_norms(
                [21.0, 21.5, 24.0], places, np.array([1, 5, 7])
            ),
        }
    )


def test_numbers_of_norms(recorded):
    metrics = cohort().query("hemisphere == 'whole' or metric == 'area'")
    metrics = metrics[metrics["hemisphere"] != "right"].reset_index(drop=True)
    reference = [f"s{number}" for number in range(16)]
    found = norms.cohort_norms(metrics, reference, made_with={"a": 1.0})
    again = norms.cohort_from_plain(found.plain)
    averages = norms.cohort_norms(metrics, reference, individuals=False)
    areas = metrics.query("metric == 'area' and hemisphere == 'whole'")
    weeks, values = areas["week"], areas["value"]
    people = np.arange(len(weeks)) // 2
    factors = np.where(metrics.index % 17, 1, 3)
    wrong = metrics.assign(value=metrics["value"] * factors)
    norm = lms.fit_norm(weeks.to_numpy(), values.to_numpy(), people, is_positive=True)
    at = np.array([20.5, 24.3, 27.0, 30.0])
    recorded(
        {
            "scores": norms.measured_scores(metrics, reference, again),
            "curves": norms.norm_curves(found),
            "averages": norms.norm_curves(averages),
            "outlying": norms.outlying_brains(wrong, reference, found),
            "norm": norm,
            "centiles": [norm.values(at, z) for z in (-1.6, 0.0, 0.7)],
            "z": norm.scores(at, norm.values(at, 0.0) * 1.05),
            "robust": norm.robust_scores(at, norm.values(at, 0.0) * 1.05),
            "interval": norm.median_interval(at),
            "without": norm.without(24.3, 150.0).values(at, 1.0),
        },
        rtol=1e-3,
    )


def test_numbers_of_published_norms(recorded):
    file = SHIPPED / "norms" / "svrtk-volumes.yaml"
    published = norms.published_norms(yaml.safe_load(file.read_text()))
    brains = []
    for number, (scheme, week) in enumerate(
        (("dhcp-19", 24.5), ("feta-7", 30.0), ("dhcp-19", 12.0), ("bounti", 33.0))
    ):
        if scheme in SCHEMES:
            volumes = {label: 1.0 + 0.7 * label for label in range(1, 20)}
            own = SIDES if number % 2 == 0 else ("right",)
            brains.append(
                norms.LabelledBrain(f"b{number}", week, own, SCHEMES[scheme], volumes)
            )
    volumes, scores = norms.volume_tables(brains, published)
    recorded({"norms": published, "volumes": volumes, "scores": scores})


def test_numbers_of_spectra_apart(recorded, sides):
    spectra = []
    for name, week, factor in (("a", 22.0, 1.0), ("b", 22.0, 1.2), ("c", 25.0, 0.9)):
        pair = {}
        for side, mesh in sides.items():
            pair[side] = TriangleMesh(factor * mesh.vertices, mesh.faces)
        found = measure.surface_spectra(pair["left"], pair["right"], 7.0, 40)
        run = "fold" if name == "c" else "observed"
        # as if there were modes enough
        found = found.assign(resolved=True, complete=True)
        spectra.append(found.assign(subject=name, run=run, week=week))
    recorded({"distances": spangy.spectral_distances(pd.concat(spectra))}, rtol=1e-3)


def test_numbers_of_regions(recorded, sides):
    maps, labels = {}, {}
    for number, (side, mesh) in enumerate(sides.items()):
        field = smooth_field(mesh.vertices)
        field[::9] = np.nan
        maps[side] = {"thickness_mm": field, "sulcal_depth_mm": field**2}
        labels[side] = (mesh.vertices[:, 2] > mesh.vertices[:, 2].mean()) * (1 + number)
    names = {1: "top", 2: "upper"}
    recorded({"regions": tables.region_metrics(sides, maps, labels, names)}, rtol=1e-3)
