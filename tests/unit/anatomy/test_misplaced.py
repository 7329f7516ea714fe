"""Cortex where none can be is warned of with its volume and place; cortex around white
matter is not."""

import re

import numpy as np
import pytest
from facts import Facts
from phantoms import BRAINSTEM, CEREBELLUM, CORTEX, CSF, DEEP_GREY, VENTRICLES, WHITE
from shapes import rigid

from gyriflow.anatomy.labels import read_cerebrum
from gyriflow.anatomy.misplaced import around_cerebrum, misplaced_cortex
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


def warnings_of_cortex(labels, mask):
    """Return the warnings of labels that have cortex in a mask."""
    around = around_cerebrum(np.where(mask, CORTEX, labels), AFFINE, ATLAS)
    return list(misplaced_cortex(around))


def test_a_brain_without_fault_has_no_warning(brain):
    # a cut by the border of a volume is no bare surface
    for labels in (brain, brain[: len(brain) // 2]):
        around = around_cerebrum(labels, AFFINE, ATLAS)
        assert list(misplaced_cortex(around, is_whole=True)) == []
    assert "hindbrain" not in read_cerebrum(brain, AFFINE, ATLAS).report


def test_cerebellum_and_brainstem_labelled_as_cortex_are_named(brain):
    hindbrain = np.isin(brain, (CEREBELLUM, BRAINSTEM))
    (found,) = warnings_of_cortex(brain, hindbrain)
    assert found == Facts("6 mm", "cerebellum", "brainstem")
    cerebrum = read_cerebrum(np.where(hindbrain, CORTEX, brain), AFFINE, ATLAS)
    assert found in cerebrum.warnings
    assert cerebrum.report["hindbrain"] == Facts("cerebellum", "brainstem")


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
    faulty = np.where(brain == tissue, label, brain)
    around = around_cerebrum(faulty, AFFINE, ATLAS)
    (found,) = misplaced_cortex(around, is_whole=True)
    assert found == Facts("8 mm", f"{label} {name}")
    # check and the surface take their warnings from here, but for a hemisphere
    assert found in read_cerebrum(faulty, AFFINE, ATLAS, 0.5).warnings
    assert found not in read_cerebrum(faulty, AFFINE, ATLAS).warnings


@pytest.mark.parametrize("label", [WHITE, CSF])
def test_cortex_that_lacks_a_label_on_one_side_is_named(brain, label):
    x_mm = np.arange(len(brain))[:, None, None] * SIZE[0]
    missing = (brain == CORTEX) & (x_mm < CENTRE[0] - 8.0)
    faulty = np.where(missing, label, brain)
    around = around_cerebrum(faulty, AFFINE, ATLAS)
    (found,) = misplaced_cortex(around, is_whole=True)
    assert found == Facts("1 white matter", "cortex")
    x, y, z = re.search(r"\((-?\d+), (-?\d+), (-?\d+)\) mm", found).groups()
    assert [int(x), int(y), int(z)] == pytest.approx(place(missing), abs=6)


def test_a_blob_has_its_volume_outside_and_its_place(brain):
    outside = ball(CENTRE + [0.0, 0.0, 25.5], 2.5) & (brain != CORTEX)
    volume = f"{outside.sum() * 0.8 * 1.2e-3:.2f} mL"
    assert warnings_of_cortex(brain, outside) == [Facts(volume, *place(outside))]
    inside = ball(CENTRE, 4.0)
    facts = Facts("inside the cerebrum", *place(inside))
    assert warnings_of_cortex(brain, inside) == [facts]


def test_a_layer_around_the_ventricle_is_found(brain):
    # joined to the outer cortex, so that it is no separate piece
    joint = ball(CENTRE, 18.0) & ball(CENTRE + [19.0, 0.0, 0.0], 10.0)
    layer = (brain == DEEP_GREY) | (joint & (brain == WHITE))
    assert warnings_of_cortex(brain, layer)[-1] == Facts("ventricles", "100 %")


def test_a_sheet_that_touches_no_brain_is_found(brain):
    x, _, z = (np.indices(brain.shape).T * SIZE).T
    sheet = (np.abs(x - CENTRE[0]) < 1.0) & (z > CENTRE[2] + 21.5) & ball(CENTRE, 25.0)
    # nearer to the white matter than cortex may be
    assert warnings_of_cortex(brain, sheet) == [Facts("apart", *place(sheet))]


def test_pieces_of_a_few_voxels_are_warned_of_only_if_they_meet_at_a_corner(brain):
    pieces = np.zeros((2, *brain.shape), dtype=bool)
    pieces[0, 32:38, 24:28, 55:57] = pieces[1, 38:44, 28:32, 57:59] = True
    ml = pieces[0].sum() * 0.96e-3
    assert ml < 0.05 < 2 * ml
    assert warnings_of_cortex(brain, pieces[0]) == []
    both = pieces.any(axis=0)
    assert warnings_of_cortex(brain, both) == [Facts(f"{2 * ml:.2f} mL", *place(both))]
