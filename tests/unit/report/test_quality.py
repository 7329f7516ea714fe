"""The page of a brain for quality control, its verdict, and the table of all brains."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from pictures import tone, words
from PIL import Image
from scripts import run_script
from shapes import box, rigid, scaling, sphere

from gyriflow.anatomy.extraction import isosurface
from gyriflow.geometry.poses import LPS_TO_RAS, Pose
from gyriflow.geometry.triangles import merged, transformed
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.messages import Message, write_message
from gyriflow.report.quality import (
    QualityBrain,
    quality_page,
    quality_row,
    tissue_groups,
)
from gyriflow.report.tables import quality_table

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
    groups = tissue_groups(np.array([[[0, 1, 2, 3, 4, 5]]]), scheme)
    assert groups.tolist() == [[[0, 2, 3, 4, 4, 1]]]


def test_verdicts_and_refused_brains_stand_in_one_table(recorded):
    known = {"mean_mm": 1.5, "measured_area_share": 0.9}
    fine = quality_row(LABELS, REPORT, known, [], 80.0, area_is_lower_bound=True)
    # of one hemisphere half a brain is expected
    half = LABELS | {"subject": "b", "sides": "left"}
    look = quality_row(half, REPORT, {}, ["one", "two"], 80.0)
    refused = [
        {"subject": "c", "week": None, "cause": "no such file"},
        {"subject": "e", "week": 22.0, "cause": "no labels"},
    ]
    table = quality_table([fine, look], refused, ["c", "b", "a", "d"])
    assert table["subject"].tolist() == ["c", "b", "a", "e"]
    recorded(table.set_index("subject").T.to_dict())


# the page


def test_the_page_shows_planes_views_and_warnings(recorded):
    radius = np.linalg.norm(np.indices((60, 60, 60)) - 30, axis=0)
    inner = [radius < 5, radius < 18, radius < 20, radius < 24]
    tissues = np.select(inner, [3, 2, 1, 4], 0), scaling(1.0, -30)
    warnings = ["it is crooked"]
    thin = {"mean_mm": 0.84, "measured_area_share": 0.7}
    row = quality_row(
        LABELS, REPORT, thin, warnings, 80.0, thickness_is_inaccurate=True
    )
    brain = QualityBrain(sphere(20.0, 3), 0.0, tissues=tissues)
    figure = quality_page(brain, row, warnings, notes=["it is small"])
    recorded({"words": sorted(words(figure))})
    # the inner border is a circle of 18 mm in the coronal plane
    (coronal,) = (
        axes for axes in figure.axes if axes.get_title().startswith("coronal")
    )
    radii = []
    for artist in coronal.collections:
        for path in artist.get_paths():
            if len(path.vertices) > 20:
                radii.append(np.linalg.norm(path.vertices, axis=1).mean())
    assert min(np.abs(np.array(radii) - 18.0)) < 0.7


CENTRE, HALF = np.array([12.0, -7.0, 3.0]), np.array([15.0, 21.0, 12.0])
SHIFT = np.array([1.0, 2.0, 3.0])


@pytest.fixture(scope="module")
def figure():
    """The page of an ellipsoid in a volume stored obliquely, both turned upright."""
    oblique = rigid(25, -10, 40) @ scaling(1.6)
    oblique[:3, 3] = CENTRE - oblique[:3, :3] @ np.full(3, 20.0)
    index = np.stack(np.indices((41, 41, 41)), axis=-1)
    places = index @ oblique[:3, :3].T + oblique[:3, 3]
    away = np.linalg.norm((places - CENTRE) / HALF, axis=-1)
    surface = isosurface((1.5 - away).astype(np.float32), oblique)
    pose = rigid(shift=SHIFT)
    # 50 at the surface, and in proportion to the distance around it
    image = 50.0 * (2.0 - away).clip(0.0), pose @ oblique
    middle_x_mm = CENTRE[0] + SHIFT[0]
    brain = QualityBrain(transformed(surface, pose), middle_x_mm, image=image)
    return quality_page(brain, quality_row(LABELS, REPORT, {}, [], 80.0), [])


@pytest.mark.parametrize(
    ("number", "name", "axes", "ends", "share"),
    [
        (0, "coronal", [0, 2], "LR", 1.0),
        (1, "axial", [0, 1], "LR", 1.0),
        # half-way to the right, where the ellipse is smaller
        (2, "sagittal", [1, 2], "PA", np.sqrt(0.75)),
    ],
)
def test_line_and_edge_agree_in_every_plane(figure, number, name, axes, ends, share):
    panel = figure.axes[number]
    centre, half = (CENTRE + SHIFT)[axes], share * HALF[axes]
    assert panel.get_title().startswith(name)
    # letters stand at the ends of the axis: left is at low x, posterior at low y
    letters = [text for text in panel.texts if len(text.get_text()) == 1]
    letters.sort(key=lambda text: text.get_position()[0])
    assert "".join(text.get_text() for text in letters) == ends
    assert np.diff(panel.get_xlim()) > 0
    (lines,) = [item for item in panel.collections if isinstance(item, LineCollection)]
    points = np.concatenate(lines.get_segments())
    np.testing.assert_allclose(np.ptp(points, axis=0) / 2, half, atol=0.15)
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    np.testing.assert_allclose(middle, centre, atol=0.15)
    image = panel.images[0]
    left, right, low, high = image.get_extent()
    bright = np.asarray(image.get_array()) > 50
    rows, columns = (np.flatnonzero(bright.any(axis=axis)) for axis in (1, 0))
    first, last = (np.array([columns[end], rows[end]]) for end in (0, -1))
    size = np.array([right - left, high - low]) / bright.shape[::-1]
    middle = np.array([left, low]) + ((first + last) / 2 + 0.5) * size
    np.testing.assert_allclose(middle, centre, atol=0.4)
    np.testing.assert_allclose((last - first) * size / 2, half, atol=0.5)


@pytest.mark.usefixtures("recorded_outputs")
def test_the_figures_of_a_brain_are_drawn_of_its_own_files(tmp_path):
    left, right = box((18, 20, 20), (-9, 0, 0)), box((18, 20, 20), (9, 0, 0))
    surfaces = {"left": left, "right": right, "whole": merged(left, right)}
    for name, mesh in surfaces.items():
        n_vertices = len(mesh.vertices)
        maps = {"shape_index": np.full(n_vertices, 0.7)}
        maps["sulcal_depth_mm"] = np.zeros(n_vertices)
        write_surface(tmp_path / f"{name}.surf.gii", mesh)
        write_vertex_maps(tmp_path / f"{name}.shape.gii", maps)
    thick = {"thickness_mm": np.full(n_vertices, 1.5)}
    write_vertex_maps(tmp_path / "thickness.shape.gii", thick)
    write_json(tmp_path / "surface.json", REPORT | {"week": 24.0, "fissure_x_mm": 0.0})
    thickness = {"mean_mm": 1.5, "measured_area_share": 0.9, "area_ratio": 0.9}
    write_json(tmp_path / "thickness.json", thickness | {"voxels_through_cortex": 1.4})
    for _ in range(2):
        write_message(tmp_path / "surface.log", Message("warning", "it is crooked"))
    inputs = {
        "surface": "whole.surf.gii",
        "report": "surface.json",
        "image": [],
        "thickness": "thickness.shape.gii",
        "measured": "thickness.json",
        "hemispheres": ["left.surf.gii", "right.surf.gii"],
        "maps": ["left.shape.gii", "right.shape.gii"],
    }
    outputs = {"row": "row.json"}
    for name in ("quality", "depth", "maps", "small"):
        outputs |= {name: f"{name}.png", f"{name}_pdf": f"{name}.pdf"}
    params = {
        "columns": LABELS,
        "labels": None,
        "white_files": {},
        "sides": ["left", "right"],
        "log": tmp_path / "surface.log",
    }
    run_script("brain_figures.py", tmp_path, inputs, outputs, params)
    assert all((tmp_path / file).stat().st_size for file in outputs.values())
    # all red, as ridges are
    for name in ("maps", "small"):
        pixels = np.asarray(Image.open(tmp_path / f"{name}.png"))[..., :3]
        red, _, blue = tone(pixels)
        assert red > blue + 20
