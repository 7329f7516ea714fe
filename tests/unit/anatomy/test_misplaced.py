"""Cortex where none can be is warned of with its volume and place; cortex around white
matter is not."""

import re

import numpy as np
import pytest
from facts import Facts
from phantoms import BRAINSTEM, CEREBELLUM, CORTEX, CSF, DEEP_GREY, VENTRICLES, WHITE
from shapes import rigid

from gyriflow.anatomy.labels import read_cerebrum
from gyriflow.anatomy.misplaced import bare_surface, hindbrain_note, misplaced_cortex
from gyriflow.io.yaml_files import SCHEMES

ATLAS = SCHEMES["spina-bifida-atlas"]
SIZE = np.array([0.8, 1.0, 1.2])
# far from the origin and turned
AFFINE = rigid(10, -20, 30, shift=(120, -300, 80)) @ np.diag([*SIZE, 1.0])


def ball(centre_mm, radius_mm):
    index = np.indices((70, 60, 60)).T
    distance_mm = np.linalg.norm(index * SIZE - centre_mm, axis=-1).T
    return distance_mm < radius_mm


CENTRE = np.array([28.0, 28.0, 44.0])
BELOW = CENTRE + [0.0, 2.0, -26.0]


@pytest.fixture
def brain():
    """A ball of cortex around white matter around a ventricle, on a brainstem and a
    cerebellum, in CSF."""
    labels = np.where(ball(CENTRE, 23.0), CSF, 0)
    labels[ball(BELOW, 8.0)] = CEREBELLUM
    labels[ball(BELOW - [0.0, 12.0, 0.0], 6.0)] = BRAINSTEM
    for radius_mm, tissue in (
        (20.0, CORTEX),
        (17.5, WHITE),
        (10.5, DEEP_GREY),
        (9.0, VENTRICLES),
    ):
        labels[ball(CENTRE, radius_mm)] = tissue
    return labels


def place(mask):
    centre = AFFINE[:3, :3] @ np.argwhere(mask).mean(axis=0) + AFFINE[:3, 3]
    return [round(x) for x in centre]


def relabelled(labels, mask):
    return np.where(mask, CORTEX, labels)


def test_a_brain_without_fault_has_no_warning(brain):
    assert list(misplaced_cortex(brain, AFFINE, ATLAS)) == []
    assert hindbrain_note(brain, ATLAS) == ""


def test_cerebellum_and_brainstem_labelled_as_cortex_are_named(brain):
    faulty = relabelled(brain, np.isin(brain, (CEREBELLUM, BRAINSTEM)))
    assert list(misplaced_cortex(faulty, AFFINE, ATLAS)) == [
        Facts("6 mm", "cerebellum", "brainstem")
    ]
    assert hindbrain_note(faulty, ATLAS) == Facts("cerebellum", "brainstem")
    # check and the surface take their warnings from here
    cerebrum = read_cerebrum(faulty, AFFINE, ATLAS)
    assert any("cerebellum" in warning for warning in cerebrum.warnings)
    assert "cerebellum" in cerebrum.report["hindbrain"]


@pytest.mark.parametrize(
    ("tissue", "label", "name"),
    [
        (CEREBELLUM, WHITE, "white matter"),
        (BRAINSTEM, DEEP_GREY, "deep grey matter"),
    ],
)
def test_hindbrain_labelled_as_inner_tissue_is_named_with_its_place(
    brain, tissue, label, name
):
    assert list(bare_surface(brain, AFFINE, ATLAS)) == []
    faulty = np.where(brain == tissue, label, brain)
    (found,) = bare_surface(faulty, AFFINE, ATLAS)
    assert found == Facts("8 mm", f"{label} {name}")
    # check and the surface take their warnings from here, but for a hemisphere
    assert found in read_cerebrum(faulty, AFFINE, ATLAS, 0.5).warnings
    assert found not in read_cerebrum(faulty, AFFINE, ATLAS).warnings


@pytest.mark.parametrize("label", [WHITE, CSF])
def test_cortex_that_lacks_a_label_on_one_side_is_named(brain, label):
    x_mm = np.arange(len(brain))[:, None, None] * SIZE[0]
    missing = (brain == CORTEX) & (x_mm < CENTRE[0] - 8.0)
    (found,) = bare_surface(np.where(missing, label, brain), AFFINE, ATLAS)
    assert found == Facts("1 white matter", "cortex")
    x, y, z = re.search(r"\((-?\d+), (-?\d+), (-?\d+)\) mm", found).groups()
    assert [int(x), int(y), int(z)] == pytest.approx(place(missing), abs=6)


def test_a_cut_by_the_border_of_a_volume_is_no_bare_surface(brain):
    half = len(brain) // 2
    assert list(bare_surface(brain[:half], AFFINE, ATLAS)) == []


def test_a_blob_outside_has_its_volume_and_place(brain):
    blob = ball(CENTRE + [0.0, 0.0, 25.5], 2.5)
    blob = blob & (brain != CORTEX)
    assert list(misplaced_cortex(relabelled(brain, blob), AFFINE, ATLAS)) == [
        Facts(f"{blob.sum() * 0.8 * 1.2e-3:.2f} mL", *place(blob))
    ]


def test_a_blob_in_a_ventricle_has_its_place(brain):
    blob = ball(CENTRE, 4.0)
    assert list(misplaced_cortex(relabelled(brain, blob), AFFINE, ATLAS)) == [
        Facts("inside the cerebrum", *place(blob))
    ]


def test_a_layer_around_the_ventricle_is_found(brain):
    # joined to the outer cortex, so that it is no separate piece
    layer = (brain == DEEP_GREY) | (
        ball(CENTRE, 18.0) & ball(CENTRE + [19.0, 0.0, 0.0], 10.0) & (brain == WHITE)
    )
    found = list(misplaced_cortex(relabelled(brain, layer), AFFINE, ATLAS))
    assert found[-1] == Facts("ventricles", "100 %")


def test_a_sheet_that_touches_no_brain_is_found(brain):
    x, _, z = (np.indices(brain.shape).T * SIZE).T
    sheet = (np.abs(x - CENTRE[0]) < 1.0) & (z > CENTRE[2] + 21.5) & ball(CENTRE, 25.0)
    # nearer to the white matter than cortex may be
    assert list(misplaced_cortex(relabelled(brain, sheet), AFFINE, ATLAS)) == [
        Facts("apart", *place(sheet))
    ]


def test_strays_of_a_few_voxels_are_not_warned_of(brain):
    blob = ball(CENTRE + [0.0, 0.0, 25.0], 1.5)
    assert 0 < blob.sum() * 0.96e-3 < 0.05
    assert list(misplaced_cortex(relabelled(brain, blob), AFFINE, ATLAS)) == []


def test_pieces_that_meet_at_a_corner_count_together(brain):
    pieces = np.zeros(brain.shape, dtype=bool)
    pieces[32:38, 24:28, 55:57] = pieces[38:44, 28:32, 57:59] = True
    half_ml = pieces.sum() / 2 * 0.96e-3
    assert half_ml < 0.05 < 2 * half_ml
    assert list(misplaced_cortex(relabelled(brain, pieces), AFFINE, ATLAS)) == [
        Facts(f"{2 * half_ml:.2f} mL", *place(pieces))
    ]
