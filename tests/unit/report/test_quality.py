"""The page of a brain for quality control, its verdict, and the table of all brains."""

import numpy as np
from pictures import words
from shapes import sphere

from gyriflow.geometry.poses import LPS_TO_RAS, Pose
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.report.quality import (
    Brain,
    facts,
    quality_page,
    quality_row,
    quality_table,
    tissue_groups,
)

LABELS = {"subject": "a", "week": 24.0, "population": None, "source": "labels", "sides": "left right", "page": "a.png"}
REPORT = {
    "area_cm2": {"whole": 100.0, "left": 49.0, "right": 51.0},
    "volume_mL": 40.0,
    "pose": Pose(np.eye(4), {"whole": LPS_TO_RAS}, "shape").plain(),
    "asymmetry_mm": 0.5,
}
BALL = sphere(20.0, 3)


def page(brain, warnings=(), verdict="fine"):
    row = quality_row(LABELS, REPORT, {}, list(warnings), 80.0)
    return quality_page(brain, title="a, 24 GW", verdict=verdict, facts=facts(row), warnings=list(warnings))


def test_labels_are_grouped_by_tissue():
    scheme = SCHEMES["spina-bifida-atlas"]
    assert tissue_groups(np.array([[[0, 1, 2, 3, 4, 5]]]), scheme).tolist() == [[[0, 2, 3, 4, 4, 1]]]


def test_the_page_shows_planes_views_and_warnings():
    radius = np.linalg.norm(np.indices((60, 60, 60)) - 30, axis=0)
    groups = np.select([radius < 5, radius < 18, radius < 20, radius < 24], [3, 2, 1, 4], 0)
    affine = np.eye(4)
    affine[:3, 3] = -30
    figure = page(Brain(BALL, 0.0, tissues=(groups, affine)), ["it is crooked"], "look")
    shown = words(figure)
    assert {"LOOK", "Look at:\n• it is crooked", "coronal, y = 0 mm", "left", "right medial", "front"} <= shown
    (head,) = [text for text in shown if text.startswith("source")]
    assert "area: 100.0 cm² (49.0 + 51.0)" in head
    assert "50 % of that expected" in head
    assert "turned by 180.0°" in head
    # the inner border is a circle of 18 mm in the coronal plane
    (coronal,) = [axes for axes in figure.axes if axes.get_title().startswith("coronal")]
    rings = [path.vertices for artist in coronal.collections for path in artist.get_paths()]
    radii = [np.linalg.norm(ring, axis=1) for ring in rings if len(ring) > 20]
    assert min(abs(radius.mean() - 18.0) for radius in radii) < 0.7


def test_verdicts_and_refused_brains_stand_in_one_table():
    fine = quality_row(LABELS, REPORT, {"mean_mm": 1.5, "measured_area_share": 0.9}, [], 80.0)
    look = quality_row(LABELS | {"subject": "b", "sides": "left"}, REPORT, {}, ["one", "two"], 80.0)
    refused = [{"subject": "c", "week": None, "cause": "no such file"}]
    table = quality_table([fine, look], refused, ["c", "b", "a", "d"])
    assert table["subject"].tolist() == ["c", "b", "a"]
    assert table["verdict"].tolist() == ["refused", "look", "fine"]
    assert table["cause"].tolist() == ["no such file", "", ""]
    assert table["warnings"].tolist()[1] == "one | two"
    # of one hemisphere half a brain is expected
    assert table["share_of_expected_volume"].tolist()[1:] == [1.0, 0.5]
