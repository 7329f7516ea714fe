"""Label volumes: whatever their storage, units and headers, the same positions in RAS+
mm, or a refusal."""

import gzip
from itertools import permutations, product

import nibabel as nib
import numpy as np
import pytest
from facts import Facts
from shapes import rigid, scaling

from gyriflow.errors import InputError
from gyriflow.io.volumes import (
    LabelVolume,
    read_header,
    read_label_volume,
    read_volume_map,
    write_label_volume,
)
from gyriflow.shipped import SHIPPED

AFFINE = np.array([[0.8, 0, 0, -10], [0, 0.9, 0, 5], [0, 0, 1.0, 20], [0, 0, 0, 1.0]])


@pytest.fixture
def labels():
    values = np.zeros((4, 5, 6), dtype=np.int16)
    values[1, 2, 3], values[3, 4, 5] = 7, 2
    return values


def saved(path, values, affine=AFFINE, unit="mm", sform=1, qform=1, qform_affine=None):
    image = (nib.Nifti1Image if ".nii" in path.name else nib.Nifti1Pair)(values, None)
    image.header.set_xyzt_units(unit)
    image.header.set_sform(affine, code=sform)
    image.header.set_qform(affine if qform_affine is None else qform_affine, code=qform)
    nib.save(image, path)
    return path


def position(volume, label):
    return (
        volume.affine[:3, :3] @ np.argwhere(volume.labels == label)[0]
        + volume.affine[:3, 3]
    )


def storage_orders():
    """Yield the 48 orders and directions of axes in which a volume can be stored, as
    "RAS" or "LIP"."""
    for axes in permutations(("RL", "AP", "SI")):
        for ends in product(*axes):
            yield "".join(ends)


@pytest.mark.parametrize(
    "pose",
    [np.eye(4), rigid(20, -15, 25, shift=(40, 200, -90))],
    ids=["straight", "tilted"],
)
def test_storage_order_changes_neither_array_nor_place(tmp_path, labels, pose):
    path, affine = tmp_path / "a.nii", pose @ AFFINE
    image = nib.Nifti1Image(labels, affine)
    found = []
    for order in storage_orders():
        turn = nib.orientations.ornt_transform(
            nib.io_orientation(affine), nib.orientations.axcodes2ornt(order)
        )
        nib.save(image.as_reoriented(turn), path)
        volume, (values, affine_of_map) = read_label_volume(path), read_volume_map(path)
        assert np.array_equal(volume.labels, labels), order
        assert np.array_equal(values, labels), order
        assert np.array_equal(affine_of_map, volume.affine), order
        found.append(volume.affine)
    assert found[0] == pytest.approx(affine, abs=1e-3)
    # no digit may depend on the order, or surfaces are meshed differently
    assert all(np.array_equal(each, found[0]) for each in found)


@pytest.mark.parametrize(
    ("unit", "per_mm"), [("mm", 1.0), ("meter", 1e-3), ("micron", 1e3)]
)
def test_units_of_the_header_become_mm(tmp_path, labels, unit, per_mm):
    stored = np.diag([per_mm] * 3 + [1.0]) @ AFFINE
    volume = read_label_volume(saved(tmp_path / "a.nii", labels, stored, unit))
    assert volume.affine == pytest.approx(AFFINE, rel=1e-5)


def test_labels_of_freesurfer_volumes_are_read(tmp_path, labels):
    nib.save(
        nib.MGHImage(labels.astype(np.int32), AFFINE.astype(np.float32)),
        tmp_path / "aseg.mgz",
    )
    volume = read_label_volume(tmp_path / "aseg.mgz")
    assert np.array_equal(volume.labels, labels)
    assert volume.affine == pytest.approx(AFFINE, abs=1e-4)


def test_disagreeing_qform_and_sform_are_refused_both_printed(tmp_path, labels):
    other = AFFINE.copy()
    other[0, 3] = 33.0
    path = saved(tmp_path / "a.nii", labels, qform_affine=other)
    with pytest.raises(
        InputError, check=Facts("a.nii", "qform", 33, "sform", -10, "affine_from")
    ) as caught:
        read_label_volume(path)
    assert caught.value.exit_code == 2
    assert read_label_volume(path, "qform").affine[0, 3] == pytest.approx(33.0)
    assert read_label_volume(path, "sform").affine[0, 3] == pytest.approx(-10.0)


def test_a_broken_qform_is_not_read_where_the_sform_holds(tmp_path, labels):
    path = saved(tmp_path / "a.nii", labels)
    image = nib.load(path)
    image.header["quatern_b"] = image.header["quatern_c"] = 0.9
    image.header["vox_offset"] = 352
    content = bytearray(path.read_bytes())
    content[:348] = image.header.binaryblock
    path.write_bytes(content)
    with pytest.raises(InputError, check=Facts("a.nii:", "affine_from: sform")):
        read_label_volume(path)
    assert np.allclose(read_label_volume(path, "sform").affine[:3, :3], AFFINE[:3, :3])


@pytest.mark.parametrize(("sform", "qform"), [(1, 0), (0, 1)])
def test_of_two_matrices_the_one_that_is_set_counts(tmp_path, labels, sform, qform):
    wrong = np.diag([3.0, 3.0, 3.0, 1.0])
    path = saved(
        tmp_path / "a.nii",
        labels,
        AFFINE if sform else wrong,
        "mm",
        sform,
        qform,
        AFFINE if qform else wrong,
    )
    assert read_label_volume(path).affine == pytest.approx(AFFINE, abs=1e-5)


@pytest.mark.parametrize("suffix", ["", ".gz"])
@pytest.mark.parametrize("name", ["a.hdr", "a.img"])
def test_header_and_image_in_two_files_are_one_volume(tmp_path, labels, name, suffix):
    saved(
        tmp_path / f"a.img{suffix}",
        labels,
        np.diag([1e3, 1e3, 1e3, 1.0]) @ AFFINE,
        "micron",
    )
    volume = read_label_volume(tmp_path / f"{name}{suffix}")
    assert np.array_equal(volume.labels, labels)
    assert volume.affine == pytest.approx(AFFINE, rel=1e-5)


def with_odd_unit(path, labels):
    image = nib.Nifti1Image(labels, AFFINE)
    image.header["xyzt_units"] = 5
    nib.save(image, path)


def with_values(path, labels, value):
    values = labels.astype(np.float32)
    values[0, 0, :3] = value
    saved(path, values)


def with_slope(path, labels, slope, kind):
    image = nib.Nifti1Image(np.rint(labels / slope).astype(kind), AFFINE)
    image.header.set_slope_inter(slope, 0)
    nib.save(image, path)


@pytest.mark.parametrize(
    ("name", "make", "off"),
    [
        # labels 2 and 7 become 2.01 and 6.99
        ("a.nii", lambda path, labels: with_slope(path, labels, 0.03, np.uint8), 0.01),
        (
            "a.nii",
            lambda path, labels: with_slope(path, labels, 1 / 255, np.int16),
            None,
        ),
        (
            "a.nii",
            lambda path, labels: saved(path, (labels * 0.994).astype(np.float32)),
            0.042,
        ),
        (
            "a.mgz",
            lambda path, labels: nib.save(
                nib.MGHImage((labels + 0.02).astype("f4"), AFFINE), path
            ),
            0.02,
        ),
    ],
)
def test_labels_that_their_storage_moved_are_rounded_with_a_warning(
    tmp_path, labels, caplog, name, make, off
):
    make(tmp_path / name, labels)
    assert np.array_equal(read_label_volume(tmp_path / name).labels, labels)
    warnings = [record.getMessage() for record in caplog.records]
    assert warnings == ([] if off is None else [Facts(tmp_path / name, off)])


@pytest.mark.parametrize(
    ("name", "flips"),
    [("a.nii.gz", 150), ("a.img.gz", 20), ("a.hdr.gz", 20), ("a.mgz", 20)],
)
def test_a_flipped_bit_of_a_compressed_volume_changes_no_label(tmp_path, name, flips):
    shipped = (
        SHIPPED
        / "atlases"
        / "spina-bifida"
        / "fetal_SB_atlas_GA21_notoperated"
        / "parcellation.nii.gz"
    )
    path, volume, random = tmp_path / name, nib.load(shipped), np.random.default_rng(0)
    kind = {"a.nii.gz": nib.Nifti1Image, "a.mgz": nib.MGHImage}.get(
        name, nib.Nifti1Pair
    )
    labels = np.asarray(volume.dataobj, np.int16)[::3, ::3, ::3]
    nib.save(kind(labels, volume.affine.astype("f4")), path)
    whole, true, refused = path.read_bytes(), read_label_volume(path), 0
    for place in random.integers(8 * len(whole), size=flips):
        damaged = bytearray(whole)
        damaged[place // 8] ^= 1 << place % 8
        path.write_bytes(damaged)
        try:
            found = read_label_volume(path)
        except InputError as error:
            refused += Facts(path) == error
        else:
            assert np.array_equal(found.labels, true.labels)
            assert np.array_equal(found.affine, true.affine)
    # a few bits have no meaning
    assert refused > 0.3 * flips


def test_further_members_and_bytes_of_gzip_are_taken_as_gzip_does(
    tmp_path, labels, caplog
):
    labels = np.pad(labels, 10)
    whole = gzip.decompress(saved(tmp_path / "a.nii.gz", labels).read_bytes())
    (tmp_path / "b.nii.gz").write_bytes(
        gzip.compress(whole[:400]) + gzip.compress(whole[400:]) + b"\0further"
    )
    assert np.array_equal(read_label_volume(tmp_path / "b.nii.gz").labels, labels)
    assert [record.getMessage() for record in caplog.records] == [
        Facts(tmp_path / "b.nii.gz")
    ]


@pytest.mark.parametrize(
    ("name", "make", "facts"),
    [
        ("a.nii", with_odd_unit, ["xyzt_units", 5, 0, 1, 2, 3]),
        (
            "a.nii",
            lambda path, labels: saved(path, labels, sform=0, qform=0),
            ["qform", "sform", "affine_from"],
        ),
        (
            "a.img",
            lambda path, labels: saved(path, labels, sform=0, qform=0),
            ["qform", "sform", "affine_from"],
        ),
        (
            "a.img",
            lambda path, labels: nib.save(nib.Spm2AnalyzeImage(labels, None), path),
            ["Analyze", "NIfTI"],
        ),
        (
            "a.nii",
            lambda path, _: saved(path, np.zeros((3, 3, 3, 2), np.int16)),
            ["(3, 3, 3, 2)"],
        ),
        ("a.nii", lambda path, _: saved(path, np.zeros((3, 3), np.int16)), ["(3, 3)"]),
        (
            "a.nii",
            lambda path, labels: with_values(path, labels, 0.4),
            [3, 0.4, 0.05, "nearest neighbour", "segment"],
        ),
        (
            "a.nii",
            lambda path, labels: with_slope(path, labels, 0.3, np.uint8),
            [2, 6.9],
        ),
        ("a.nii", lambda path, labels: with_values(path, labels, np.nan), [3, "NaN"]),
        ("a.nii", lambda path, labels: with_values(path, labels, np.inf), [3, "NaN"]),
    ],
)
def test_what_is_no_volume_of_labels_in_the_world_is_refused(
    tmp_path, labels, name, make, facts
):
    make(tmp_path / name, labels)
    with pytest.raises(InputError, check=Facts(f"{name}:", *facts)):
        read_label_volume(tmp_path / name)


def without_directions(path, labels):
    nib.save(nib.MGHImage(labels.astype(np.int32), AFFINE.astype(np.float32)), path)
    content = bytearray(gzip.decompress(path.read_bytes()))
    content[28:30] = b"\0\0"  # goodRASFlag
    path.write_bytes(gzip.compress(bytes(content)))


def test_a_freesurfer_volume_without_valid_directions_is_refused(tmp_path, labels):
    without_directions(tmp_path / "aseg.mgz", labels)
    for read in (read_label_volume, read_volume_map):
        with pytest.raises(
            InputError, check=Facts("aseg.mgz:", "goodRASFlag", 0, 1, "mri_convert")
        ):
            read(tmp_path / "aseg.mgz")


FOREIGN = {
    "a.nrrd": (b"NRRD0004\ntype: uchar\n", ["NRRD", "NIfTI"]),
    "a.mha": (b"ObjectType = Image\nNDims = 3\n", ["MetaImage", "NIfTI"]),
    "b.mhd": (b"Comment = x\nObjectType = Image\n", ["MetaImage"]),
    "a.dcm": (b"\0" * 128 + b"DICM" + b"\0" * 400, ["DICOM", "dcm2niix"]),
    "a.nii.gz": (b"<!DOCTYPE html>\n<html>", ["web page"]),
    "packed.nii": (gzip.compress(b"\0" * 500), ["gzip", ".gz"]),
    "twice.nii.gz": (gzip.compress(gzip.compress(b"\0" * 500)), ["twice", "gunzip"]),
    "a.nii.xz": (b"\xfd7zXZ\0" + b"\0" * 500, ["xz", "Uncompress"]),
    "a.nii.zst": (b"\x28\xb5\x2f\xfd" + b"\0" * 500, ["zstd", "Uncompress"]),
    "zip.nii.gz": (b"PK\3\4" + b"\0" * 500, ["ZIP", "Unpack it"]),
    "nrrd.nii.gz": (gzip.compress(b"NRRD0004\n"), ["NRRD", "NIfTI"]),
    "plain.mgz": (b"\0\0\0\1\0\0\0\4" + b"\0" * 500, ["MGH", ".mgh"]),
    "packed.mgh": (gzip.compress(b"\0\0\0\1\0"), ["gzip", ".mgz"]),
    "empty.nii.gz": (b"", ["is empty"]),
    "plain.nii.gz": (
        b"\0" * 344 + b"n+1\0" + b"\0" * 500,
        ["without compression", ".nii."],
    ),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_files_of_other_formats_are_named_with_what_to_do(tmp_path, name):
    content, facts = FOREIGN[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, check=Facts(f"{name}:", *facts)):
        read_label_volume(tmp_path / name)


def test_values_that_begin_in_the_header_are_not_read(tmp_path, labels):
    path = saved(tmp_path / "a.nii", labels)
    content = bytearray(path.read_bytes())
    content[108:112] = np.float32(0).tobytes()
    path.write_bytes(content)
    with pytest.raises(InputError, check=Facts(path, "vox_offset 0", 352)):
        read_label_volume(path)


def test_a_freesurfer_volume_with_negative_sizes_of_voxels_is_refused(tmp_path, labels):
    path = tmp_path / "aseg.mgh"
    nib.save(nib.MGHImage(labels.astype(np.int32), AFFINE), path)
    content = bytearray(path.read_bytes())
    content[30:42] = np.array([-0.8, 0.9, 1.0], ">f4").tobytes()
    path.write_bytes(content)
    with pytest.raises(InputError, check=Facts(path, "-0.8 x 0.9 x 1 mm")):
        read_label_volume(path)


def test_sizes_of_voxels_that_disagree_in_a_header_are_reported(
    tmp_path, labels, caplog
):
    path = saved(tmp_path / "a.nii", labels, qform=0)
    read_label_volume(path)
    assert not caplog.records
    content = bytearray(path.read_bytes())
    content[80:92] = np.array([0.5, 0.5, 0.5], "<f4").tobytes()
    path.write_bytes(content)
    volume = read_label_volume(path)
    (record,) = caplog.records
    found = "0.5 x 0.5 x 0.5", "0.8 x 0.9 x 1 mm"
    assert record.getMessage() == Facts(path, *found, "sform")
    assert np.diag(volume.affine)[:3] == pytest.approx([0.8, 0.9, 1.0])


def test_a_volume_of_numbers_keeps_fractions_nan_and_its_oblique_affine(tmp_path):
    values = np.random.default_rng(0).normal(size=(4, 5, 6)).astype(np.float32)
    values[0, 0, 0] = np.nan
    oblique = rigid(20, -15, 25) @ AFFINE
    metres = np.diag([1e-3, 1e-3, 1e-3, 1.0]) @ oblique
    found, affine = read_volume_map(
        saved(tmp_path / "a.nii.gz", values[..., None], metres, "meter")
    )
    np.testing.assert_array_equal(found, values)
    assert affine == pytest.approx(oblique, abs=1e-3)


@pytest.mark.parametrize("shear", [0.0, 0.2])
def test_written_volume_comes_back(tmp_path, labels, shear):
    affine = AFFINE.copy()
    affine[0, 2] = shear
    write_label_volume(
        tmp_path / "a.nii.gz", LabelVolume(labels.astype(np.int32), affine)
    )
    back = read_label_volume(tmp_path / "a.nii.gz")
    assert np.array_equal(back.labels, labels)
    assert back.affine == pytest.approx(affine, abs=1e-5)
    assert nib.load(tmp_path / "a.nii.gz").get_data_dtype() == np.uint8


def test_volumes_of_labels_are_their_voxels_in_ml():
    labels = np.zeros((4, 5, 6), np.int32)
    labels[0, :, :], labels[1, :2, :3] = 7, 2
    assert LabelVolume(labels, scaling((2.0, 5.0, 1.0))).volumes_ml == {
        2: pytest.approx(0.06),
        7: pytest.approx(0.3),
    }


ANISOTROPIC = np.diag([0.8, 0.6, 1.5, 1.0])
TURNS = {
    "diagonal": AFFINE,
    "turned": rigid(20, -30, 40, shift=(5, -7, 9)) @ ANISOTROPIC,
    "flipped": rigid(shift=(5, -7, 9)) @ np.diag([-1, -1, 1, 1.0]) @ ANISOTROPIC,
    "permuted and mirrored": rigid(0, 0, 90) @ np.diag([1, 1, -1, 1.0]) @ ANISOTROPIC,
}


@pytest.mark.parametrize("affine", TURNS.values(), ids=TURNS)
def test_an_empty_border_is_left_out_and_nothing_moves(tmp_path, labels, affine):
    padding = ((20, 30), (10, 0), (0, 40))
    path = saved(tmp_path / "a.nii.gz", np.pad(labels, padding), affine)
    whole, volume = read_label_volume(path), read_label_volume(path, cropped=True)
    # a voxel around the labels, but not beyond the volume's own end
    assert sorted(volume.labels.shape) == [4, 5, 5]
    for label in (7, 2):
        assert position(volume, label) == pytest.approx(position(whole, label))
    index = np.add((1, 2, 3), (20, 10, 0))
    assert position(volume, 7) == pytest.approx(
        affine[:3, :3] @ index + affine[:3, 3], abs=1e-3
    )
    assert sum(volume.volumes_ml.values()) == pytest.approx(
        2e-3 * abs(np.linalg.det(affine[:3, :3])), rel=1e-5
    )
    shape, sizes, unit, space = read_header(path)
    assert shape == (54, 15, 46)
    assert sizes == pytest.approx(np.linalg.norm(affine[:3, :3], axis=0), rel=1e-5)
    assert (unit, space) == ("mm", "scanner")
    empty = saved(tmp_path / "b.nii.gz", np.zeros((3, 4, 5), dtype=np.int16))
    assert read_label_volume(empty, cropped=True).labels.shape == (3, 4, 5)
