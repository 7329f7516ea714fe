"""Regions, change and export with the real commands, on phantoms whose regions are
known."""

import numpy as np
import pandas as pd
import pytest
from phantoms import CORTEX, phantom_labels

from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_labels,
    read_vertex_maps,
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
        "regions": {
            "p22": {
                "labels": "regions.nii.gz",
                "names": {1: "front", 2: "front", 3: "back", 4: "back"},
            }
        },
    },
}
NAMES = ["front", "back"]
TARGETS = [
    "export",
    "results/study/figures/regions.png",
    "results/study/change.csv",
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

    run = "runs/reference/p21"
    for labels, surfaces in (
        ("brains/p22/metrics", "brains/p22/surface"),
        # carried along a registration, and kept by a run
        ("brains/p21/metrics", "brains/p21/surface"),
        (f"{run}/metrics", f"{run}/surfaces/week-21.00"),
    ):
        for side in SIDES:
            mesh = read_surface(results / surfaces / f"{side}.pial.surf.gii")
            file = results / labels / f"{side}.regions.label.gii"
            found, names = read_vertex_labels(file)
            assert list(names.values()) == NAMES
            y = mesh.vertices[:, 1] - middle(mesh.vertices)
            clear = np.abs(y) > 3.0
            right = found[clear] == np.where(y[clear] > 0, 1, 2)
            assert right.mean() > 0.97, (labels, side)

    regions, metrics, change = (
        pd.read_csv(results / "study" / f"{name}.csv")
        for name in ("regions", "metrics", "change")
    )
    keys = ["subject", "run", "week", "hemisphere"]
    areas = regions[regions["metric"] == "area"].groupby(keys)["value"].sum()
    whole = metrics[metrics["metric"] == "area"].set_index(keys)["value"]
    # the regions cover the hemispheres but for what is near the cut
    assert ((areas / whole.reindex(areas.index)).between(0.93, 1.0001)).all()
    grown = change[(change["metric"] == "area") & (change["region"] == "front")]
    assert set(grown["run"]) == {"observed", "reference"}
    assert (grown["change"] > 0).all()

    template = read_surface(results / "brains/p22/surface/left.pial.surf.gii")
    for where in (
        "brains/p21/metrics",
        "brains/p22/metrics",
        f"{run}/metrics/week-22.00",
    ):
        maps = read_vertex_maps(results / where / "left.template.shape.gii")
        assert len(maps["thickness_mm"]) == len(template.vertices)
        assert np.median(maps["template_distance_mm"]) < 0.5
    assert (results / "export" / "metrics_wide.tsv").is_file()
