"""Regions, change and export with the real commands, on phantoms whose regions are
known."""

import numpy as np
import pandas as pd
import pytest
from phantoms import CORTEX, phantom_labels
from scripts import run_script
from shapes import LPS, hemisphere, rigid

from gyriflow.anatomy.pial import from_surface
from gyriflow.geometry.triangles import merged, transformed
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_labels,
    read_vertex_maps,
    write_surface,
)
from gyriflow.io.volumes import LabelVolume, write_label_volume
from gyriflow.settings.terms import SIDES

from .conftest import COARSE, labelled

VOXEL_MM = 2.0
STUDY = {
    "brains": [
        {"id": f"p{week}", "week": week, "subject": "one", **labelled(week)}
        for week in (21, 22)
    ],
    "start": "p21",
    "surface": {"edge_length_mm": 2.5},
    "mesh": COARSE,
    "folding": {"end_week": 22, "thickness_mm": 4.0, "step_s": 302400},
    "metrics": {
        "curvature_radius_mm": 6,
        "spangy_modes": 60,
        "template": "p22",
        "white_surfaces": "all",
        "regions": {
            "p22": {
                "labels": "regions.nii.gz",
                "names": {1: "front", 2: "front", 3: "back", 4: "back"},
            }
        },
    },
}
NAMES = ["front", "back"]
TABLES = ("metrics", "regions", "asymmetry", "change")
TARGETS = [
    "export",
    "results/study/figures/regions.png",
    *(f"results/study/{name}.csv" for name in TABLES),
]


def middle(points: np.ndarray) -> float:
    """Return where the middle of points is from back to front."""
    return float(points[:, 1].min() + points[:, 1].max()) / 2


def write_regions(path) -> None:
    """Write the cortex of the phantom of week 22, in front of its middle and behind it,
    right and left."""
    labels, affine = phantom_labels(22, voxel_mm=VOXEL_MM)
    cortex = np.argwhere(labels == CORTEX)
    points = cortex @ affine[:3, :3].T + affine[:3, 3]
    regions = np.zeros_like(labels)
    regions[tuple(cortex.T)] = np.where(points[:, 1] > middle(points), 1, 3) + (
        points[:, 0] > points[:, 0].mean()
    )
    write_label_volume(path, LabelVolume(regions, affine))


@pytest.mark.slow
@pytest.mark.extended
def test_regions_of_phantoms_are_where_they_are_known_to_be(workflow):
    write_regions(workflow.directory / "regions.nii.gz")
    name = workflow.write("study.yaml", STUDY)
    outcome = workflow.run(
        *TARGETS, "--cores", "2", "--configfile", name, timeout_s=900
    )
    assert outcome.returncode == 0, outcome.stderr[-3000:]
    results = workflow.directory / "results"

    places = {
        "given": ("brains/p22/metrics", "brains/p22/surface"),
        "carried": ("brains/p21/metrics", "brains/p21/surface"),
        "simulated": (
            "runs/reference/p21/metrics",
            "runs/reference/p21/surfaces/week-21.00",
        ),
    }
    for labels, surfaces in places.values():
        for side in SIDES:
            mesh = read_surface(results / surfaces / f"{side}.pial.surf.gii")
            found, names = read_vertex_labels(
                results / labels / f"{side}.regions.label.gii"
            )
            assert list(names.values()) == NAMES
            y = mesh.vertices[:, 1] - middle(mesh.vertices)
            clear = np.abs(y) > 3.0
            right = found[clear] == np.where(y[clear] > 0, 1, 2)
            assert right.mean() > 0.97, (labels, side)

    regions = pd.read_csv(results / "study" / "regions.csv")
    areas = (
        regions[regions["metric"] == "area"]
        .groupby(["subject", "run", "week", "hemisphere"])["value"]
        .sum()
    )
    metrics = pd.read_csv(results / "study" / "metrics.csv")
    whole = metrics[metrics["metric"] == "area"].set_index(
        ["subject", "run", "week", "hemisphere"]
    )["value"]
    # the regions cover the hemispheres but for what is near the cut
    assert ((areas / whole.reindex(areas.index)).between(0.93, 1.0001)).all()
    assert set(regions["metric"]) >= {
        "area",
        "mean_sulcal_depth",
        "mean_curvature",
        "mean_thickness",
    }
    asymmetry = pd.read_csv(results / "study" / "asymmetry.csv")
    area = asymmetry[(asymmetry["metric"] == "area") & asymmetry["region"].isin(NAMES)]
    # 2 regions of 2 measured brains and of the run at 2 weeks; phantoms are nearly
    # symmetric
    assert len(area) == 8
    assert area["asymmetry_index"].abs().max() < 0.1

    change = pd.read_csv(results / "study" / "change.csv").fillna({"region": ""})
    assert set(change["run"]) == {"observed", "reference"}
    grown = change[(change["metric"] == "area") & (change["region"] == "front")]
    assert len(grown) == 4
    assert (grown["change"] > 0).all()

    for where in (
        "brains/p21/metrics",
        "brains/p22/metrics",
        "runs/reference/p21/metrics/week-22.00",
    ):
        maps = read_vertex_maps(results / where / "left.template.shape.gii")
        template = read_surface(
            results / "brains" / "p22" / "surface" / "left.pial.surf.gii"
        )
        assert len(maps["thickness_mm"]) == len(template.vertices)
        assert np.median(maps["template_distance_mm"]) < 0.5
        own = read_vertex_maps(results / where / "left.shape.gii")["sulcal_depth_mm"]
        assert maps["sulcal_depth_mm"].mean() == pytest.approx(own.mean(), rel=0.2)
    white = metrics[metrics["metric"] == "white_area"].set_index(
        ["subject", "hemisphere"]
    )["value"]
    assert set(white.index) == {
        (brain, part) for brain in ("p21", "p22") for part in ("whole", *SIDES)
    }
    measured = whole[:, "observed"].droplevel("week").reindex(white.index)
    assert (white / measured).between(0.6, 0.95).all()


def test_a_volume_of_regions_fits_a_pial_surface_in_lps(tmp_path):
    """The volume is in RAS+ whatever the axes of the surface; taken as they are, front
    and back would change places."""
    brain = merged(
        *(
            transformed(hemisphere(side), rigid(shift=(0.0, 6.0, 3.0)))
            for side in (-1, 1)
        )
    )
    surface = from_surface(
        transformed(brain, LPS), week=21.0, coordinates="lps", edge_length_mm=2.5
    )
    write_json(tmp_path / "surface.json", surface.report)
    for side in SIDES:
        write_surface(tmp_path / f"{side}.gii", getattr(surface, side))
    low = np.floor(brain.vertices.min(axis=0)) - 2
    index = np.ceil(brain.vertices.max(axis=0) - low).astype(int) + 2
    y = low[1] + np.arange(index[1])
    regions = np.broadcast_to(np.where(y > 6.0, 1, 3)[None, :, None], index).copy()
    write_label_volume(
        tmp_path / "regions.nii.gz", LabelVolume(regions, rigid(shift=low))
    )
    files = {"report": "surface.json", "volume": "regions.nii.gz"} | {
        side: f"{side}.gii" for side in SIDES
    }
    labels = {f"{side}_regions": f"{side}.label.gii" for side in SIDES}
    params = {
        "names": STUDY["metrics"]["regions"]["p22"]["names"],
        "affine_from": "auto",
    }
    run_script("given_regions.py", tmp_path, files, labels, params)
    for side in SIDES:
        found, _ = read_vertex_labels(tmp_path / f"{side}.label.gii")
        y = getattr(surface, side).vertices[:, 1]
        clear = np.abs(y - 6.0) > 2.0
        np.testing.assert_array_equal(found[clear], np.where(y[clear] > 6.0, 1, 2))
