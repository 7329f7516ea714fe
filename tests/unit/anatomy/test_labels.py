"""Label schemes, whose faults are named; what hangs on a brain by a stalk, and
ventricles that are no part of it."""

import numpy as np
import pytest
from facts import Facts
from odd_brains import (
    CEREBRUM,
    VENTRICLES,
    add_sides,
    positions,
    with_fourth_ventricle,
)
from scipy import ndimage
from shapes import phantom, rigid

from gyriflow.anatomy.extraction import isosurface, smooth_mask, without_stalks
from gyriflow.anatomy.labels import (
    REPORTED_LOSS,
    Layout,
    border_share,
    layout_of,
    outside_ventricles,
    read_cerebrum,
    require_cortex_outside,
    require_labels,
    require_sides,
    scheme_contradictions,
    unlabelled_ventricles,
)
from gyriflow.anatomy.pose import pose_of_labels
from gyriflow.anatomy.repair import surface_without_stalks
from gyriflow.errors import InputError
from gyriflow.geometry.triangles import euler_number, is_closed, signed_volume
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.schemes import LabelScheme
from gyriflow.shipped import SHIPPED

ATLAS = SCHEMES["spina-bifida-atlas"]


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_schemes_name_only_labels_that_they_have(scheme):
    inside = {
        *scheme.cortex,
        *scheme.left,
        *scheme.right,
        *scheme.white_matter,
        *scheme.ventricles,
    }
    outside = {*scheme.cerebellum, *scheme.brainstem}
    named = {*scheme.cerebrum, *inside, *outside}
    assert named <= set(scheme.labels)
    assert inside <= set(scheme.cerebrum)
    assert not outside & set(scheme.cerebrum)
    assert not set(scheme.cortex) & {*scheme.white_matter, *scheme.ventricles}
    assert not set(scheme.left) & set(scheme.right)
    assert len(scheme.left) == len(scheme.right)


@pytest.mark.parametrize(
    ("labels", "facts"),
    [
        (range(11), ["spina-bifida-atlas", "9, 10", "5 cortex"]),
        ({*range(9)} - {5}, ["spina-bifida-atlas", "5 cortex"]),
        ({*range(9)} - {1}, ["spina-bifida-atlas", "1 white matter"]),
        ([0, 0], ["cerebrum", "1 white matter"]),
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
    with pytest.raises(
        InputError, check=Facts("spina-bifida-atlas", "cortex", "0 %", "50 %")
    ):
        require_cortex_outside(labels, ATLAS)
    assert require_cortex_outside(6 - labels, ATLAS) == 1.0
    # single voxels that are missing inside are no surface
    brain = np.full((21, 21, 21), 5)
    brain[2:-2, 2:-2, 2:-2] = 1
    brain[4:-4:3, 4:-4:3, 4:-4:3] = 0
    assert require_cortex_outside(brain, ATLAS) == 1.0


def test_little_cortex_at_the_surface_is_reported_with_its_share():
    x, _, z = np.indices((40, 40, 40)) - 19.5
    radius = np.linalg.norm(np.indices((40, 40, 40)).T - 19.5, axis=-1).T
    for limit, is_told in ((-3.0, True), (-9.0, False)):
        shell = (radius > 13.0) & (x + 0.3 * z > limit)
        labels = np.where(radius < 16.0, np.where(shell, 5, 1), 0)
        share = require_cortex_outside(labels, ATLAS)
        assert (share < 0.7) == is_told
        found = read_cerebrum(labels, AFFINE, ATLAS).warnings
        told = [text for text in found if "surface" in text and "cortex lies" in text]
        assert told == [Facts(f"{100 * share:.0f} %")] * is_told


def test_what_is_left_out_or_filled_is_reported_with_its_volume():
    voxel_ml = 0.8**3 / 1000
    radius = np.linalg.norm(np.indices((50, 50, 50)).T - 24.5, axis=-1).T
    ball = np.where(radius < 16.0, np.where(radius < 13.0, 1, 5), 0)
    n_inside = (ball > 0).sum()
    # a block beside it
    strewn = ball.copy()
    strewn[:6, :6, :6] = 5
    told = read_cerebrum(strewn, AFFINE, ATLAS).warnings
    share = 100 * 6**3 / n_inside
    assert Facts(f"{6**3 * voxel_ml:.2f} mL", f"{share:.1f} %") in told
    # a void in the middle, where other brains have ventricles
    hollow = np.where(radius < 6.0, 0, ball)
    told = read_cerebrum(hollow, AFFINE, ATLAS).warnings
    assert Facts(f"{(radius < 6.0).sum() * voxel_ml:.2f} mL") in told
    # or other labels there, beside a ventricle that has its own
    ventricle = np.where(radius < 3.0, 2, ball)
    x = np.indices(ball.shape)[0]
    inside = (radius >= 3.0) & (radius < 9.0) & (x < 24)
    filled = read_cerebrum(np.where(inside, 3, ventricle), AFFINE, ATLAS)
    assert Facts(f"{inside.sum() * voxel_ml:.2f} mL", "3 cerebellum") in filled.warnings
    # a smaller ball that hangs on a stalk
    mask, large = body(1.0)
    inner = ndimage.binary_erosion(mask, iterations=3)
    hanging = read_cerebrum(np.where(mask, np.where(inner, 1, 5), 0), AFFINE, ATLAS)
    (stalk,) = hanging.report["outside"]["stalks"]
    told = [text for text in hanging.warnings if "stalk" in text]
    assert told == [Facts(f"{stalk['volume_mm3'] / 1000:.2f} mL")]
    assert stalk["volume_mm3"] == pytest.approx(
        (mask & ~large).sum() * 1000 * voxel_ml, rel=0.1
    )


def test_labels_of_the_left_on_the_right_are_refused():
    scheme = SCHEMES["dhcp-19"]
    labels = np.zeros((4, 1, 1), dtype=int)
    labels[0], labels[3] = 3, 4
    require_sides(labels, scheme, np.eye(4), np.array([1.0, 0, 0]))
    with pytest.raises(InputError, check=Facts("left", "right", "3.0 mm")):
        require_sides(labels, scheme, np.diag([-1.0, 1, 1, 1]), np.array([1.0, 0, 0]))


@pytest.fixture(scope="module")
def atlas_brain():
    """The shipped atlas' brain of 25 GW, without the empty rim of its volume."""
    path = SHIPPED / "atlases/spina-bifida/fetal_SB_atlas_GA25_notoperated"
    volume = read_label_volume(path / "parcellation.nii.gz", cropped=True)
    return volume.labels, volume.affine


@pytest.fixture(scope="module")
def feta(atlas_brain):
    """That brain in the labels of FeTA."""
    return np.array([0, 3, 4, 5, 1, 2, 6, 7, 3])[atlas_brain[0]], atlas_brain[1]


def test_sides_that_are_no_hemispheres_are_another_schemes(feta):
    with pytest.raises(
        InputError, check=Facts("dhcp-19", "left", "right", "49 %", "90 %")
    ):
        require_sides(feta[0], SCHEMES["dhcp-19"], feta[1], np.array([1.0, 0, 0]))


def test_a_hindbrain_inside_the_cerebrum_is_another_schemes(feta):
    assert pose_of_labels(*feta, SCHEMES["feta-7"]).by == "file"
    with pytest.raises(InputError, check=Facts("drawem-9", "cerebellum", 0.17, 0.25)):
        pose_of_labels(*feta, SCHEMES["drawem-9"])


AFFINE = np.diag([0.8, 0.8, 0.8, 1.0])


def body(stalk_mm, ball_mm=4.0):
    """Return a ball of 15 mm radius from which a smaller one hangs by a stalk of a
    radius."""
    x, y, z = (0.8 * np.indices((60, 60, 80)).astype(float)) - np.array([24, 24, 40])[
        :, None, None, None
    ]
    large = np.sqrt(x**2 + y**2 + z**2) < 15.0
    stalk = (np.hypot(x, y) < stalk_mm) & (z < 0) & (z > -24.0)
    small = np.sqrt(x**2 + y**2 + (z + 24.0) ** 2) < ball_mm
    return large | stalk | small, large


def test_a_ball_on_a_thin_stalk_is_cut_off_with_the_stalk():
    mask, large = body(1.0)
    left, stalks = without_stalks(mask, AFFINE)
    # at most a millimetre of the stalk stays
    assert (left ^ large).sum() < 12
    (found,) = stalks
    assert found["volume_mm3"] == pytest.approx((mask & ~large).sum() * 0.8**3, rel=0.1)
    assert found["stalk_mm2"] == pytest.approx(np.pi, rel=0.6)
    # the ball's, nearly: in the affine's mm
    assert found["place_mm"] == pytest.approx([24.0, 24.0, 17.0], abs=1.5)
    # long voxels, their axes exchanged and turned
    turn, order = rigid(20, -30, 10, shift=(5, -7, 2)), (2, 0, 1)
    affine = turn @ AFFINE @ np.diag([1.0, 1.0, 2.0, 1.0])[:, [*order, 3]]
    (same,) = without_stalks(mask[:, :, ::2].transpose(order), affine)[1]
    assert same["volume_mm3"] == pytest.approx(found["volume_mm3"], rel=0.1)
    assert same["stalk_mm2"] == pytest.approx(found["stalk_mm2"], rel=0.6)
    assert same["place_mm"] == pytest.approx(
        turn[:3, :3] @ found["place_mm"] + turn[:3, 3], abs=0.6
    )


@pytest.mark.parametrize("case", ["a thick stalk", "a blade"])
def test_parts_that_are_joined_broadly_stay(case):
    mask, _ = body(2.5)
    if case == "a blade":
        # a gyrus as thin as a stalk, but long, and thicker at its crown
        mask, _ = body(0.0, 0.0)
        mask[10:50, 29:32, 2:40] = True
        mask[10:50, 27:34, 2:8] = True
    left, stalks = without_stalks(mask, AFFINE)
    assert stalks == []
    assert (left == mask).all()


def test_a_polyp_of_a_surface_is_cut_and_the_cut_closed():
    mask, large = body(1.4)
    mesh, stalks = surface_without_stalks(isosurface(smooth_mask(mask, 0.7), AFFINE))
    assert len(stalks) == 1
    assert is_closed(mesh)
    assert euler_number(mesh) == 2
    assert signed_volume(mesh) == pytest.approx(
        signed_volume(isosurface(smooth_mask(large, 0.7), AFFINE)), rel=0.01
    )


@pytest.fixture(scope="module")
def brain():
    return phantom()


def test_the_fourth_ventricle_is_outside_and_the_third_is_not(brain):
    labels, affine = brain
    made = with_fourth_ventricle(labels, affine)
    x, y, z = positions(made, affine)
    added = (made == VENTRICLES) & (labels != VENTRICLES)
    below = z[
        np.isin(labels, CEREBRUM) & (np.abs(x) < 2.0) & (np.abs(y + 6.0) < 3.0)
    ].min()
    out = outside_ventricles(made, SCHEMES["spina-bifida-atlas"])
    assert out[added & (z < below - 2.0)].all()
    assert not out[z > below + 5.0].any()


def test_a_ventricle_that_opens_to_the_outer_csf_stays_whole(brain):
    labels, affine = brain
    x, y, z = positions(labels, affine)
    # a cleft as wide as the ventricle is long, through the whole mantle on the left
    cleft = (
        (x < -8.0)
        & (np.abs(y) < 9.0)
        & (np.abs(z - 2.0) < 7.0)
        & np.isin(labels, CEREBRUM)
    )
    split = np.where(cleft, VENTRICLES, labels)
    assert not outside_ventricles(split, SCHEMES["spina-bifida-atlas"]).any()


def test_without_labels_of_the_hindbrain_all_that_is_open_is_outside():
    labels = np.zeros((40, 40, 40), dtype=int)
    labels[5:35, 5:35, 20:36] = 1
    labels[15:25, 15:25, 4:30] = 2
    out = outside_ventricles(
        labels, LabelScheme(name="mine", cerebrum=(1, 2), ventricles=(2,))
    )
    assert out[15:25, 15:25, 4:18].all()
    assert not out[:, :, 24:].any()
    # where the volume ends there is no tissue
    labels[:6, :6, :6] = labels[-6:, -6:, :4] = 2
    out = outside_ventricles(
        labels, LabelScheme(name="mine", cerebrum=(1, 2), ventricles=(2,))
    )
    assert out[:6, :6, :6].all()
    assert out[-6:, -6:, :4].all()


UNNAMED = LabelScheme(
    name="unnamed",
    cerebrum=(1, 5, 6, 8),
    known={2: "CSF", 3: "cerebellum", 4: "CSF", 7: "brainstem"},
)
SOLID = LabelScheme(
    name="solid",
    cerebrum=(1, 2, 5, 6, 8),
    known={3: "cerebellum", 4: "CSF", 7: "brainstem"},
)


@pytest.mark.parametrize(
    ("given", "scheme"),
    [
        (0, SCHEMES["spina-bifida-atlas"]),
        (4, SCHEMES["spina-bifida-atlas"]),
        (2, UNNAMED),
    ],
)
def test_ventricles_without_labels_are_filled_and_no_fissure_or_cistern(
    atlas_brain, given, scheme
):
    labels, affine = atlas_brain
    known = SCHEMES["spina-bifida-atlas"]
    ventricles = (labels == VENTRICLES) & ~outside_ventricles(labels, known)
    found = unlabelled_ventricles(
        np.where(labels == VENTRICLES, given, labels), scheme, affine
    )
    assert (found & ventricles).sum() > 0.98 * ventricles.sum()
    assert (found & ~ventricles).sum() < 0.01 * ventricles.sum()


@pytest.mark.parametrize("scheme", [SOLID, SCHEMES["spina-bifida-atlas"]])
def test_nothing_is_filled_where_the_cerebrum_is_whole(atlas_brain, scheme):
    assert not unlabelled_ventricles(atlas_brain[0], scheme, atlas_brain[1]).any()


def test_a_filled_ventricle_is_reported_and_counts_as_ventricle_and_not_as_tissue(
    atlas_brain,
):
    labels, affine = atlas_brain
    with_labels, without = (
        read_cerebrum(given, affine, SCHEMES["spina-bifida-atlas"])
        for given in (labels, np.where(labels == VENTRICLES, 0, labels))
    )
    assert [
        any("ventricles" in said for said in found.warnings)
        for found in (without, with_labels)
    ] == [True, False]
    for name, volume in with_labels.report["label_volumes_mL"].items():
        assert without.report["label_volumes_mL"][name] == pytest.approx(
            volume, rel=0.01
        )


def test_stray_voxels_and_voids_change_neither_the_cerebrum_nor_its_volume(brain):
    labels, affine = brain
    scheme, random = SCHEMES["spina-bifida-atlas"], np.random.default_rng(0)
    clean = read_cerebrum(labels, affine, scheme)
    inside = ndimage.binary_erosion(np.isin(labels, CEREBRUM), iterations=2)
    far = ~ndimage.binary_dilation(labels > 0, iterations=2)
    noise = random.random(labels.shape)
    strewn = np.where(
        far & (noise < 0.02), 5, np.where(inside & (noise < 0.02), 0, labels)
    )
    found = read_cerebrum(strewn, affine, scheme)
    assert (strewn != labels).sum() > 1000
    assert np.array_equal(found.mask, clean.mask)
    expected = clean.report["label_volumes_mL"]["cerebrum"]
    assert found.report["label_volumes_mL"]["cerebrum"] == pytest.approx(
        expected, rel=1e-6
    )
    assert Facts(found.report["outside"]["parts"], "mL", "%") in found.warnings


@pytest.mark.parametrize(
    ("axis", "end"), [(axis, end) for axis in range(3) for end in (0, -1)]
)
def test_a_brain_that_is_cut_at_any_border_of_its_volume_is_reported_with_the_share(
    axis, end
):
    block = np.zeros((20, 18, 16), dtype=bool)
    block[5:13, 5:13, 5:13] = True
    assert border_share(block) == 0.0
    shift = -5 if end == 0 else block.shape[axis] - 13
    # a side of 8 × 8 voxels; the rest of the surface has those of the other five
    rest = 8**3 - 6 * 6 * 7
    assert border_share(np.roll(block, shift, axis)) == pytest.approx(64 / (64 + rest))


def test_a_volume_that_ends_at_the_cerebrum_does_not_cut_it():
    labels, affine = phantom()
    (box,) = ndimage.find_objects(np.isin(labels, CEREBRUM).astype(int))
    tight = labels[box]
    assert read_cerebrum(tight, affine, ATLAS).report["border_share"] == 0.0
    for axis in range(3):
        missing = max(4, tight.shape[axis] // 8)
        for end in (slice(missing, None), slice(None, -missing)):
            cut = np.moveaxis(np.moveaxis(tight, axis, 0)[end], 0, axis)
            assert (
                read_cerebrum(cut, affine, ATLAS).report["border_share"] > REPORTED_LOSS
            )


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_volumes_of_labels_add_up_in_long_turned_voxels(order):
    axes = (
        np.arange(-21.0, 21.0, 0.7),
        np.arange(-21.0, 21.0, 0.7),
        np.arange(-21.0, 21.0, 2.1),
    )
    radius = np.sqrt(
        sum(axis**2 for axis in np.meshgrid(*axes, indexing="ij"))
    ).transpose(order)
    labels = np.digitize(radius, [5.0, 14.0, 18.0])
    labels = np.array([2, 1, 5, 0])[labels]
    affine = rigid(20, -30, 10) @ np.diag([0.7, 0.7, 2.1, 1.0])[:, [*order, 3]]
    volumes = read_cerebrum(labels, affine, ATLAS).report["label_volumes_mL"]
    balls = {radius: 4 / 3 * np.pi * radius**3 / 1e3 for radius in (5.0, 14.0, 18.0)}
    expected = {
        "cerebrum": balls[18.0],
        "ventricles": balls[5.0],
        "tissue": balls[18.0] - balls[5.0],
    }
    expected |= {
        "cortex": balls[18.0] - balls[14.0],
        "inside_cortex": balls[14.0] - balls[5.0],
    }
    assert volumes == pytest.approx(expected, rel=0.04)
    assert volumes["cortex"] + volumes["inside_cortex"] + volumes[
        "ventricles"
    ] == pytest.approx(volumes["cerebrum"])


FETA = np.array([0, 3, 4, 5, 1, 2, 6, 7, 3])
"""The numbers of FeTA for those of the spina bifida atlas."""


@pytest.mark.parametrize(
    ("left", "right"), [(10, 0), (0, 10), (11, 0), (0, 11), (10, 10)]
)
def test_numbers_that_occur_in_a_scheme_of_sides_by_accident_contradict_it(left, right):
    path = (
        SHIPPED
        / "atlases"
        / "spina-bifida"
        / "fetal_SB_atlas_GA22_notoperated"
        / "parcellation.nii.gz"
    )
    labels = FETA[read_label_volume(path, cropped=True).labels]
    is_left = np.indices(labels.shape)[0] < np.argwhere(labels == 3)[:, 0].mean()
    volume = labels + (labels > 0) * np.where(is_left, left, right)
    found = list(scheme_contradictions(layout_of(volume), SCHEMES["multi-bounti-43"]))
    assert "left and right would be mixed" in " ".join(found)


@pytest.mark.parametrize("missing", [(), (4, 6, 8, 17), (3,), (6,)])
def test_a_hemisphere_may_be_missing_but_only_with_all_of_its_tissues(missing):
    labels = add_sides(*phantom())
    labels = np.where(np.isin(labels, missing), 0, labels)
    found = list(scheme_contradictions(layout_of(labels), SCHEMES["dhcp-19"]))
    unequal = [text for text in found if "voxels of cortex" in text]
    if len(missing) == 1:
        counts = [int((labels == number).sum()) for number in (3, 4, 5, 6)]
        assert unequal == [Facts(*counts)]
    else:
        assert unequal == []


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


def contradictions_of(counts=None, contacts=None):
    """Return what contradicts the scheme if some counts or contacts are others."""
    labels = np.array(list(COUNTS))
    count = np.array(list((COUNTS | (counts or {})).values()))
    contact = np.zeros((len(labels), len(labels)))
    for (first, second), faces in (CONTACTS | (contacts or {})).items():
        i, j = np.searchsorted(labels, (first, second))
        contact[i, j] = contact[j, i] = faces
    return list(scheme_contradictions(Layout(labels, contact, count), SIDED))


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
    found = contradictions_of(counts, contacts)
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
