"""The page of a brain for quality control, its verdict, and the table of all brains."""

import numpy as np
import pytest
from facts import Facts
from matplotlib.collections import LineCollection
from pictures import tone, words
from PIL import Image
from scripts import run_script
from shapes import rigid, scaling, sphere

from gyriflow.anatomy.extraction import isosurface
from gyriflow.geometry.poses import LPS_TO_RAS, Pose
from gyriflow.geometry.triangles import merged, transformed
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.messages import Message, write_message
from gyriflow.report.quality import (
    QualityBrain,
    quality_page,
    quality_row,
    quality_table,
    tissue_groups,
)

LABELS = {
    "subject": "a",
    "week": 24.0,
    "population": None,
    "source": "labels",
    "sides": "left right",
    "page": "a.png",
}
REPORT = {
    "area_cm2": {"whole": 100.0, "left": 49.0, "right": 51.0},
    "volume_mL": 40.0,
    "pose": Pose(np.eye(4), {"whole": LPS_TO_RAS}, "shape").plain(),
    "asymmetry_mm": 0.5,
    "cut_share": 0.31,
    "usual_cut_share": 0.23,
}


def test_labels_are_grouped_by_tissue():
    scheme = SCHEMES["spina-bifida-atlas"]
    assert tissue_groups(np.array([[[0, 1, 2, 3, 4, 5]]]), scheme).tolist() == [
        [[0, 2, 3, 4, 4, 1]]
    ]


def test_the_page_shows_planes_views_and_warnings():
    radius = np.linalg.norm(np.indices((60, 60, 60)) - 30, axis=0)
    groups = np.select(
        [radius < 5, radius < 18, radius < 20, radius < 24], [3, 2, 1, 4], 0
    )
    warnings = ["it is crooked"]
    thin = {"mean_mm": 0.84, "measured_area_share": 0.7}
    row = quality_row(
        LABELS, REPORT, thin, warnings, 80.0, thickness_is_inaccurate=True
    )
    figure = quality_page(
        QualityBrain(sphere(20.0, 3), 0.0, tissues=(groups, scaling(1.0, -30))),
        row,
        warnings,
        notes=["it is small"],
    )
    shown = words(figure)
    parts = {
        "a, 24 GW",
        "NEEDS REVIEW",
        "Warnings:\n• it is crooked\nNote: it is small",
        "coronal, y = 0 mm",
    }
    assert parts | {"left", "right medial", "front"} <= shown
    (head,) = (
        text.replace("\N{NO-BREAK SPACE}", " ") for text in shown if "cm²" in text
    )
    assert head == Facts(
        "labels",
        "100.0 cm²",
        49,
        51,
        "with ventricles: 40.0 mL",
        "0.84 mm (inaccurate, measured on 70 %)",
        "180.0°",
        "mirror image: 0.5 mm",
        "31 %",
        "23 %",
    )
    # the inner border is a circle of 18 mm in the coronal plane
    (coronal,) = [
        axes for axes in figure.axes if axes.get_title().startswith("coronal")
    ]
    rings = [
        path.vertices for artist in coronal.collections for path in artist.get_paths()
    ]
    radii = [np.linalg.norm(ring, axis=1) for ring in rings if len(ring) > 20]
    assert min(abs(radius.mean() - 18.0) for radius in radii) < 0.7


def test_verdicts_and_refused_brains_stand_in_one_table():
    known = {"mean_mm": 1.5, "measured_area_share": 0.9}
    fine = quality_row(LABELS, REPORT, known, [], 80.0, area_is_lower_bound=True)
    look = quality_row(
        LABELS | {"subject": "b", "sides": "left"}, REPORT, {}, ["one", "two"], 80.0
    )
    refused = [
        {"subject": "c", "week": None, "cause": "no such file"},
        {"subject": "e", "week": 22.0, "cause": "no labels"},
    ]
    table = quality_table([fine, look], refused, ["c", "b", "a", "d"])
    assert table["subject"].tolist() == ["c", "b", "a", "e"]
    assert table["verdict"].tolist() == ["refused", "needs review", "fine", "refused"]
    assert table["cause"].tolist() == ["no such file", "", "", "no labels"]
    assert table["warnings"].tolist()[1] == "one | two"
    assert table["area_is_lower_bound"].tolist()[1:3] == [False, True]
    assert table["thickness_is_inaccurate"].tolist()[1:3] == [False, False]
    assert table["cut_share"].tolist()[1:3] == [0.31, 0.31]
    # of one hemisphere half a brain is expected
    assert table["share_of_expected_volume"].tolist()[1:3] == [1.0, 0.5]


@pytest.fixture(scope="module")
def figure():
    """An ellipsoid in a volume stored obliquely, and the page of quality with both
    turned upright."""
    centre, half = np.array([12.0, -7.0, 3.0]), np.array([15.0, 21.0, 12.0])
    oblique = rigid(25, -10, 40) @ scaling(0.8)
    oblique[:3, 3] = centre - oblique[:3, :3] @ np.full(3, 40.0)
    index = np.stack(np.indices((81, 81, 81)), axis=-1)
    away = np.linalg.norm(
        (index @ oblique[:3, :3].T + oblique[:3, 3] - centre) / half, axis=-1
    )
    surface = isosurface((1.5 - away).astype(np.float32), oblique)
    pose = rigid(shift=(1, 2, 3))
    centre = centre + pose[:3, 3]
    brain = QualityBrain(
        transformed(surface, pose),
        centre[0],
        image=(100.0 * (away < 1), pose @ oblique),
    )
    return (
        quality_page(brain, quality_row(LABELS, REPORT, {}, [], 80.0), []),
        centre,
        half,
    )


@pytest.mark.parametrize(
    ("number", "name", "axes"),
    [(0, "coronal", (0, 2)), (1, "axial", (0, 1)), (2, "sagittal", (1, 2))],
)
def test_line_and_edge_agree_in_every_plane(figure, number, name, axes):
    drawn, centre, half = figure
    panel = drawn.axes[number]
    assert panel.get_title().startswith(name)
    # letters stand at the ends of the axis: left is at low x, posterior at low y
    ends = sorted(
        (text.get_position()[0], text.get_text())
        for text in panel.texts
        if len(text.get_text()) == 1
    )
    assert "".join(end for _, end in ends) == ("PA" if name == "sagittal" else "LR")
    assert np.diff(panel.get_xlim()) > 0
    (lines,) = [item for item in panel.collections if isinstance(item, LineCollection)]
    points = np.concatenate(lines.get_segments())
    # the sagittal plane is half-way to the right, where the ellipse is smaller
    share = np.sqrt(0.75) if name == "sagittal" else 1.0
    expected = share * half[list(axes)]
    np.testing.assert_allclose(np.ptp(points, axis=0) / 2, expected, atol=0.15)
    np.testing.assert_allclose(
        (points.max(axis=0) + points.min(axis=0)) / 2, centre[list(axes)], atol=0.15
    )
    image = panel.images[0]
    left, right, low, high = image.get_extent()
    bright = np.asarray(image.get_array()) > 50
    rows, columns = (np.flatnonzero(bright.any(axis=axis)) for axis in (1, 0))
    size = (right - left) / bright.shape[1], (high - low) / bright.shape[0]
    found = (
        np.array([left, low])
        + (np.array([columns[[0, -1]].mean(), rows[[0, -1]].mean()]) + 0.5) * size
    )
    np.testing.assert_allclose(found, centre[list(axes)], atol=0.4)
    spans = np.array([np.ptp(columns), np.ptp(rows)]) * size / 2
    np.testing.assert_allclose(spans, expected, atol=0.5)


def test_the_figures_of_a_brain_are_drawn_of_its_own_files(tmp_path):
    sides = {
        side: sphere(10.0, 3, centre=(x, 0, 0))
        for side, x in (("left", -10.0), ("right", 10.0))
    }
    for name, mesh in (*sides.items(), ("whole", merged(*sides.values()))):
        write_surface(tmp_path / f"{name}.surf.gii", mesh)
        maps = {
            "shape_index": np.full(len(mesh.vertices), 0.7),
            "sulcal_depth_mm": np.zeros(len(mesh.vertices)),
        }
        write_vertex_maps(tmp_path / f"{name}.shape.gii", maps)
    write_vertex_maps(
        tmp_path / "thickness.shape.gii",
        {"thickness_mm": np.full(len(mesh.vertices), 1.5)},
    )
    write_json(tmp_path / "surface.json", REPORT | {"week": 24.0, "fissure_x_mm": 0.0})
    write_json(
        tmp_path / "thickness.json",
        {
            "mean_mm": 1.5,
            "measured_area_share": 0.9,
            "voxels_through_cortex": 1.4,
            "area_ratio": 0.9,
        },
    )
    for _ in range(2):
        write_message(tmp_path / "surface.log", Message("warning", "it is crooked"))
    inputs = {
        "surface": "whole.surf.gii",
        "report": "surface.json",
        "image": [],
        "thickness": "thickness.shape.gii",
    }
    inputs |= {
        "measured": "thickness.json",
        "hemispheres": [f"{side}.surf.gii" for side in sides],
    }
    inputs |= {"maps": [f"{side}.shape.gii" for side in sides]}
    names = ("quality", "depth", "maps", "small")
    pictures = {name: f"{name}.png" for name in names}
    outputs = (
        pictures
        | {f"{name}_pdf": f"{name}.pdf" for name in pictures}
        | {"row": "row.json"}
    )
    params = {
        "columns": LABELS,
        "labels": None,
        "white_files": {},
        "sides": ["left", "right"],
        "log": tmp_path / "surface.log",
    }
    run_script("brain_figures.py", tmp_path, inputs, outputs, params)
    row = read_json(tmp_path / "row.json")
    found = [
        row[name]
        for name in (
            "subject",
            "verdict",
            "warnings",
            "area_left_cm2",
            "mean_thickness_mm",
            # a thickness that is inaccurate tells nothing of the area
            "thickness_is_inaccurate",
            "area_is_lower_bound",
        )
    ]
    assert found == ["a", "needs review", "it is crooked", 49.0, 1.5, True, False]
    assert all((tmp_path / file).stat().st_size for file in outputs.values())
    # all red, as ridges are
    tones = [
        tone(np.asarray(Image.open(tmp_path / f"{name}.png"))[..., :3])
        for name in ("maps", "small")
    ]
    assert all(red > blue + 20 for red, _, blue in tones)
