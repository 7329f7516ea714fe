"""Label schemes, whose faults are named; what hangs on a brain by a stalk, and
ventricles that are no part of it."""

import numpy as np
import pytest
from atlas_brains import atlas_labels
from facts import Facts
from odd_brains import (
    CEREBRUM,
    VENTRICLES,
    add_sides,
    positions,
    with_fourth_ventricle,
)
from scipy import ndimage
from shapes import phantom, rigid, scaling

from gyriflow.anatomy.extraction import without_stalks
from gyriflow.anatomy.labels import (
    Layout,
    layout_of,
    read_cerebrum,
    require_labels,
    require_sides,
    scheme_contradictions,
)
from gyriflow.anatomy.pose import pose_of_labels
from gyriflow.errors import InputError
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.schemes import LabelScheme

ATLAS = SCHEMES["spina-bifida-atlas"]
AFFINE = scaling(0.8)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_tissues_of_shipped_schemes_share_no_labels(scheme):
    hindbrain = {*scheme.cerebellum, *scheme.brainstem}
    assert hindbrain.isdisjoint(scheme.cerebrum)
    assert {*scheme.white_matter, *scheme.ventricles}.isdisjoint(scheme.cortex)
    assert len(scheme.left) == len(scheme.right)


@pytest.mark.parametrize(
    ("labels", "facts"),
    [
        (range(11), ["spina-bifida-atlas", "9, 10", "5 cortex"]),
        ({*range(9)} - {1}, ["spina-bifida-atlas", "1 white matter"]),
        ([3, 4], ["cerebrum", "1 white matter"]),
    ],
)
def test_unknown_labels_and_missing_tissues_are_named(labels, facts):
    with pytest.raises(InputError, check=Facts(*facts)):
        require_labels(np.array([[[*labels]]]), ATLAS)


def test_transient_zones_stand_for_white_matter():
    # CRL's volumes have white matter at late weeks only
    labels = [112, 113, 114, 115, 92, 93]
    scheme = SCHEMES["crl"]
    require_labels(np.array([[labels]]), scheme)
    assert set(labels) <= set(scheme.cerebrum)


def test_a_scheme_whose_cortex_lies_inside_is_another_volumes():
    labels = np.full((9, 9, 9), 1)
    labels[2:7, 2:7, 2:7] = 5
    facts = Facts("spina-bifida-atlas", "cortex", "0 %", "50 %")
    with pytest.raises(InputError, check=facts):
        read_cerebrum(labels, AFFINE, ATLAS, 0.5)
    assert read_cerebrum(6 - labels, AFFINE, ATLAS, 0.5).warnings == []


X, Y, Z = np.indices((50, 50, 50)) - 24.5
RADIUS = np.sqrt(X**2 + Y**2 + Z**2)
BESIDE = np.zeros(RADIUS.shape, dtype=bool)
BESIDE[:6, :6, :6] = True


def test_little_cortex_at_the_surface_is_reported_with_its_share():
    for limit, facts in ((-3.0, [Facts("63 %")]), (-9.0, [])):
        is_cortex = (RADIUS > 13.0) & (limit < X + 0.3 * Z)
        labels = np.where(RADIUS < 16.0, np.where(is_cortex, 5, 1), 0)
        found = read_cerebrum(labels, AFFINE, ATLAS).warnings
        assert [text for text in found if "cortex lies at" in text] == facts


@pytest.mark.parametrize(
    ("place", "label", "ventricle", "facts"),
    [
        (BESIDE, 5, 1, [f"{100 * 6**3 / (RADIUS < 16.0).sum():.1f} %"]),
        # a void in the middle, where other brains have ventricles
        (RADIUS < 6.0, 0, 1, []),
        # or other labels there, beside a ventricle that has its own
        ((RADIUS >= 3.0) & (RADIUS < 9.0) & (X < -0.5), 3, 2, ["3 cerebellum"]),
    ],
)
def test_what_is_left_out_or_filled_is_reported_with_its_volume(
    place, label, ventricle, facts
):
    ball = np.select([RADIUS < 3.0, RADIUS < 13.0, RADIUS < 16.0], [ventricle, 1, 5], 0)
    found = read_cerebrum(np.where(place, label, ball), AFFINE, ATLAS).warnings
    assert Facts(f"{place.sum() * 0.8**3 / 1000:.2f} mL", *facts) in found


def test_labels_of_the_left_on_the_right_are_refused():
    scheme = SCHEMES["dhcp-19"]
    labels = np.zeros((4, 1, 1), dtype=int)
    labels[0], labels[3] = 3, 4
    to_right = np.array([1.0, 0, 0])
    require_sides(labels, scheme, np.eye(4), to_right)
    with pytest.raises(InputError, check=Facts("left", "right", "3.0 mm")):
        require_sides(labels, scheme, scaling((-1.0, 1.0, 1.0)), to_right)


FETA = np.array([0, 3, 4, 5, 1, 2, 6, 7, 3])
"""The numbers of FeTA for those of the spina bifida atlas."""


def test_a_hindbrain_inside_the_cerebrum_is_another_schemes():
    labels, affine = atlas_labels(25.0)
    feta = FETA[labels], affine
    assert pose_of_labels(*feta, SCHEMES["feta-7"]).by == "file"
    with pytest.raises(InputError, check=Facts("drawem-9", "cerebellum", 0.17, 0.25)):
        pose_of_labels(*feta, SCHEMES["drawem-9"])


def body(stalk_mm, ball_mm=4.0):
    """Return a ball of 15 mm radius from which a smaller one hangs by a stalk of a
    radius."""
    centre = np.reshape([24.0, 24.0, 40.0], (3, 1, 1, 1))
    x, y, z = 0.8 * np.indices((60, 60, 80)) - centre
    large = np.sqrt(x**2 + y**2 + z**2) < 15.0
    stalk = (np.hypot(x, y) < stalk_mm) & (z < 0) & (z > -24.0)
    small = np.sqrt(x**2 + y**2 + (z + 24.0) ** 2) < ball_mm
    return large | stalk | small, large


def test_a_ball_on_a_thin_stalk_is_cut_off_with_the_stalk_and_reported():
    mask, large = body(1.0)
    left, (found,) = without_stalks(mask, AFFINE)
    # at most a millimetre of the stalk stays
    assert (left ^ large).sum() < 12
    cut_mm3 = (mask & ~large).sum() * 0.8**3
    assert found["volume_mm3"] == pytest.approx(cut_mm3, rel=0.1)
    assert found["stalk_mm2"] == pytest.approx(np.pi, rel=0.6)
    # the ball's, nearly: in the affine's mm
    assert found["place_mm"] == pytest.approx([24.0, 24.0, 17.0], abs=1.5)
    # long voxels, their axes exchanged and turned
    turn, order = rigid(20, -30, 10, shift=(5, -7, 2)), (2, 0, 1)
    affine = turn @ AFFINE @ scaling((1.0, 1.0, 2.0))[:, [*order, 3]]
    _, (same,) = without_stalks(mask[:, :, ::2].transpose(order), affine)
    assert same["volume_mm3"] == pytest.approx(found["volume_mm3"], rel=0.1)
    assert same["stalk_mm2"] == pytest.approx(found["stalk_mm2"], rel=0.6)
    place = turn[:3, :3] @ found["place_mm"] + turn[:3, 3]
    assert same["place_mm"] == pytest.approx(place, abs=0.6)
    inner = ndimage.binary_erosion(mask, iterations=3)
    brain = np.where(mask, np.where(inner, 1, 5), 0)
    facts = Facts(f"{found['volume_mm3'] / 1000:.2f} mL")
    assert facts in read_cerebrum(brain, AFFINE, ATLAS).warnings


@pytest.mark.parametrize("case", ["a thick stalk", "a blade"])
def test_parts_that_are_joined_broadly_stay(case):
    mask, _ = body(2.5)
    if case == "a blade":
        # a gyrus as thin as a stalk, but long, and thicker at its crown
        mask, _ = body(0.0, 0.0)
        mask[10:50, 29:32, 2:40] = mask[10:50, 27:34, 2:8] = True
    left, stalks = without_stalks(mask, AFFINE)
    assert stalks == []
    assert (left == mask).all()


def inside(cerebrum, labels, affine):
    """Return the mask of a cerebrum on the grid of its whole volume."""
    to_volume = np.linalg.inv(affine) @ cerebrum.affine
    first = to_volume[:3, 3].round().astype(int)
    places = np.argwhere(cerebrum.mask) + first
    mask = np.zeros(labels.shape, dtype=bool)
    mask[tuple(places.T)] = True
    return mask


def test_the_fourth_ventricle_is_outside_and_the_third_is_not():
    labels, affine = phantom()
    made = with_fourth_ventricle(labels, affine)
    x, y, z = positions(made, affine)
    added = (made == VENTRICLES) & (labels != VENTRICLES)
    middle = (np.abs(x) < 2.0) & (np.abs(y + 6.0) < 3.0)
    below = z[np.isin(labels, CEREBRUM) & middle].min()
    found = read_cerebrum(made, affine, ATLAS)
    out = (made == VENTRICLES) & ~inside(found, made, affine)
    volume_ml = found.report["outside"]["ventricles_mL"]
    assert volume_ml == pytest.approx(out.sum() * 1.2**3 / 1000)
    assert out[added & (z < below - 2.0)].all()
    assert not out[z > below + 5.0].any()


def test_a_ventricle_that_opens_to_the_outer_csf_stays_whole():
    labels, affine = phantom()
    x, y, z = positions(labels, affine)
    # a cleft as wide as the ventricle is long, through the whole mantle on the left
    cleft = (x < -8.0) & (np.abs(y) < 9.0) & (np.abs(z - 2.0) < 7.0)
    split = np.where(cleft & np.isin(labels, CEREBRUM), VENTRICLES, labels)
    assert read_cerebrum(split, affine, ATLAS).report["outside"]["ventricles_mL"] == 0


def test_without_labels_of_the_hindbrain_all_that_is_open_is_outside():
    scheme = LabelScheme(name="mine", cerebrum=(1, 2), ventricles=(2,))
    labels = np.zeros((40, 40, 40), dtype=int)
    labels[5:35, 5:35, 20:36] = 1
    labels[15:25, 15:25, 4:30] = 2
    # where the volume ends there is no tissue
    labels[:6, :6, :6] = labels[-6:, -6:, :4] = 2
    out = (labels == 2) & ~inside(read_cerebrum(labels, AFFINE, scheme), labels, AFFINE)
    assert out[15:25, 15:25, 4:18].all()
    assert not out[:, :, 24:].any()
    assert out[:6, :6, :6].all()
    assert out[-6:, -6:, :4].all()


HINDBRAIN = {3: "cerebellum", 4: "CSF", 7: "brainstem"}
UNNAMED = LabelScheme(name="", cerebrum=(1, 5, 6, 8), known=HINDBRAIN | {2: "CSF"})
SOLID = LabelScheme(name="", cerebrum=(1, 2, 5, 6, 8), known=HINDBRAIN)


@pytest.mark.parametrize(("number", "scheme"), [(0, ATLAS), (2, UNNAMED)])
def test_ventricles_without_labels_are_filled_and_no_fissure_or_cistern(number, scheme):
    labels, affine = atlas_labels(25.0)
    labelled = read_cerebrum(labels, affine, ATLAS)
    assert "ventricles" not in " ".join(labelled.warnings)
    without = np.where(labels == VENTRICLES, number, labels)
    filled = read_cerebrum(without, affine, scheme)
    assert "ventricles" in " ".join(filled.warnings)
    # as ventricles, and not as tissue
    volumes = labelled.report["label_volumes_mL"]
    found = filled.report["label_volumes_mL"]
    assert found == pytest.approx({name: volumes[name] for name in found}, rel=0.01)
    masks = [inside(brain, labels, affine) for brain in (labelled, filled)]
    ventricles = (labels == VENTRICLES) & masks[0]
    assert masks[1][ventricles].mean() > 0.98
    assert (masks[1] & ~masks[0]).sum() < 0.01 * ventricles.sum()


def test_nothing_is_filled_where_the_cerebrum_is_whole():
    found = read_cerebrum(*atlas_labels(25.0), SOLID)
    assert "ventricles" not in " ".join(found.warnings)


def test_stray_voxels_and_voids_change_neither_the_cerebrum_nor_its_volume():
    labels, affine = phantom()
    clean = read_cerebrum(labels, affine, ATLAS)
    inside = ndimage.binary_erosion(np.isin(labels, CEREBRUM), iterations=2)
    far = ~ndimage.binary_dilation(labels > 0, iterations=2)
    is_noise = np.random.default_rng(0).random(labels.shape) < 0.02
    strewn = np.select([far & is_noise, inside & is_noise], [5, 0], labels)
    found = read_cerebrum(strewn, affine, ATLAS)
    assert (strewn != labels).sum() > 1000
    assert np.array_equal(found.mask, clean.mask)
    volumes = [brain.report["label_volumes_mL"]["cerebrum"] for brain in (found, clean)]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-6)
    assert Facts(found.report["outside"]["parts"], "mL", "%") in found.warnings


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("end", [0, -1])
def test_a_brain_that_is_cut_at_any_border_of_its_volume_has_the_share(axis, end):
    block = np.zeros((20, 18, 16), dtype=int)
    block[5:13, 5:13, 5:13] = 1
    shift = -5 if end == 0 else block.shape[axis] - 13
    cut = np.roll(block, shift, axis)
    whole, found = (
        read_cerebrum(labels, np.eye(4), SCHEMES["binary"]).report["border_share"]
        for labels in (block, cut)
    )
    # a side of 8 × 8 voxels; the rest of the surface has those of the other five
    rest = 8**3 - 6 * 6 * 7
    assert (whole, found) == (0.0, pytest.approx(64 / (64 + rest)))


def test_a_volume_that_ends_at_the_cerebrum_does_not_cut_it():
    tight = RADIUS[9:41, 9:41, 9:41] < 16.0
    found = read_cerebrum(tight.astype(int), AFFINE, SCHEMES["binary"])
    assert found.report["border_share"] == 0.0


@pytest.mark.parametrize(
    ("missing", "is_told"),
    [((), False), ((4, 6, 8, 17), False), ((3,), True), ((6,), True)],
)
def test_a_hemisphere_may_be_missing_but_only_with_all_of_its_tissues(missing, is_told):
    labels = add_sides(*phantom())
    labels = np.where(np.isin(labels, missing), 0, labels)
    found = scheme_contradictions(layout_of(labels), SCHEMES["dhcp-19"])
    counts = [int((labels == number).sum()) for number in (3, 4, 5, 6)]
    unequal = [text for text in found if "voxels of cortex" in text]
    assert unequal == [Facts(*counts)] * is_told


SIDED = LabelScheme(
    name="sided",
    cerebrum=(1, 2, 3, 4, 5),
    cortex=(3, 4),
    white_matter=(1, 2),
    ventricles=(5,),
    left=(1, 3),
    right=(2, 4),
    known={9: "other tissue"},
)
COUNTS = {0: 5000, 1: 400, 2: 400, 3: 200, 4: 200, 5: 50, 9: 100}
"""Voxels of air, white matter and cortex of both sides, ventricles and other tissue."""
CONTACTS = {
    (0, 3): 100,
    (0, 4): 100,
    (1, 3): 120,
    (2, 4): 120,
    (1, 5): 30,
    (2, 5): 30,
    (1, 2): 20,
    (3, 4): 10,
    (3, 9): 20,
    (4, 9): 20,
}
"""Faces between the voxels of two labels."""


@pytest.mark.parametrize(
    ("counts", "contacts", "facts"),
    [
        # cortex at half of the surface, here 240 faces
        ({}, {(0, 1): 235}, None),
        ({}, {(0, 1): 245}, ["cortex (3, 4)", "49%", "surface"]),
        # cortex is 3 to 60 % of the tissue, white matter 15 % or more
        ({3: 13, 4: 13}, {}, None),
        ({3: 12, 4: 12}, {}, ["cortex (3, 4)", "3%", "tissue"]),
        ({3: 595, 4: 595}, {}, None),
        ({3: 610, 4: 610}, {}, ["cortex (3, 4)", "60%", "tissue"]),
        # 40 % of the neighbours of white matter and ventricles are inside
        ({}, {(1, 9): 440, (0, 3): 999}, None),
        ({}, {(1, 9): 460, (0, 3): 999}, ["white matter (1, 2)", "39%", "neighbours"]),
        ({}, {(0, 5): 85}, None),
        ({}, {(0, 5): 95}, ["ventricles (5)", "39%", "neighbours"]),
        # half of the neighbours of other tissue, if it is more than a hundredth
        ({}, {(5, 9): 39}, None),
        ({}, {(5, 9): 42}, ["other tissue (9)", "51%", "neighbours"]),
        ({9: 12}, {(5, 9): 42}, None),
        # contacts with the other side
        ({}, {(1, 2): 165}, None),
        ({}, {(1, 2): 175}, ["left and right", "41%"]),
        # four times as much cortex per white matter on one side
        ({2: 101}, {}, None),
        ({2: 99}, {}, ["200 and 200 voxels", "400 and 99"]),
        ({1: 99}, {}, ["200 and 200 voxels", "99 and 400"]),
        ({4: 49}, {}, ["200 and 49 voxels"]),
    ],
)
def test_labels_contradict_a_scheme_beyond_its_limits_and_not_before(
    counts, contacts, facts
):
    labels = np.array(list(COUNTS))
    count = np.array(list((COUNTS | counts).values()))
    contact = np.zeros((len(labels), len(labels)))
    for (first, second), faces in (CONTACTS | contacts).items():
        i, j = np.searchsorted(labels, (first, second))
        contact[i, j] = contact[j, i] = faces
    found = list(scheme_contradictions(Layout(labels, contact, count), SIDED))
    if facts is None:
        assert [text for text in found if "(9)" not in text or counts] == []
    else:
        assert Facts(*facts) in found


def test_voids_between_labels_are_neither_inside_nor_outside():
    brain = np.full((21, 21, 21), 5)
    brain[4:-4, 4:-4, 4:-4] = 1
    brain[5:-5:2, 5:-5:2, 5:-5:2] = 0
    layout = layout_of(brain)
    air, white, cortex = (layout.labels == label for label in (0, 1, 5))
    # air touches cortex only
    assert layout.contact[np.ix_(air, white)].sum() == 0
    assert layout.contact[np.ix_(air, cortex)].sum() == 6 * 21**2
