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
LABELS = np.zeros((4, 5, 6), dtype=np.int16)
LABELS[1, 2, 3], LABELS[3, 4, 5] = 7, 2


def saved(path, values=LABELS, affine=AFFINE, unit="mm", **matrices):
    """Write a volume and return its path; `sform` and `qform` are a matrix and its code
    each."""
    if path.suffix in (".mgz", ".mgh"):
        values = values.astype(np.int32)
        nib.save(nib.MGHImage(values, affine.astype(np.float32)), path)
        return path
    image = (nib.Nifti1Image if ".nii" in path.name else nib.Nifti1Pair)(values, None)
    image.header.set_xyzt_units(unit)
    image.header.set_sform(*matrices.get("sform", (affine, 1)))
    image.header.set_qform(*matrices.get("qform", (affine, 1)))
    nib.save(image, path)
    return path


def overwritten(path, place, values, kind):
    """Write numbers into the header of a volume from a byte on, and return its path."""
    is_packed = path.suffix in (".gz", ".mgz")
    content = bytearray(path.read_bytes())
    if is_packed:
        content = bytearray(gzip.decompress(content))
    numbers = np.array(values, kind).tobytes()
    content[place : place + len(numbers)] = numbers
    path.write_bytes(gzip.compress(content) if is_packed else content)
    return path


def position(volume, label):
    index = np.argwhere(volume.labels == label)[0]
    return volume.affine[:3, :3] @ index + volume.affine[:3, 3]


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
def test_storage_order_changes_neither_array_nor_place(tmp_path, pose):
    path, affine = tmp_path / "a.nii", pose @ AFFINE
    image = nib.Nifti1Image(LABELS, affine)
    found = []
    for order in storage_orders():
        turn = nib.orientations.ornt_transform(
            nib.io_orientation(affine), nib.orientations.axcodes2ornt(order)
        )
        nib.save(image.as_reoriented(turn), path)
        volume, (values, affine_of_map) = read_label_volume(path), read_volume_map(path)
        assert np.array_equal(volume.labels, LABELS), order
        assert np.array_equal(values, LABELS), order
        assert np.array_equal(affine_of_map, volume.affine), order
        found.append(volume.affine)
    assert found[0] == pytest.approx(affine, abs=1e-3)
    # no digit may depend on the order, or surfaces are meshed differently
    assert all(np.array_equal(each, found[0]) for each in found)


@pytest.mark.parametrize(
    ("name", "unit", "per_mm"),
    [
        ("a.nii", "meter", 1e-3),
        ("a.hdr", "micron", 1e3),
        ("a.img", "mm", 1.0),
        ("a.hdr.gz", "mm", 1.0),
        ("a.img.gz", "mm", 1.0),
        ("a.mgz", "mm", 1.0),
    ],
)
def test_a_volume_is_the_same_in_any_format_and_unit(tmp_path, name, unit, per_mm):
    stored = np.diag([per_mm] * 3 + [1.0]) @ AFFINE
    saved(tmp_path / name.replace("hdr", "img"), affine=stored, unit=unit)
    volume = read_label_volume(tmp_path / name)
    assert np.array_equal(volume.labels, LABELS)
    assert volume.affine == pytest.approx(AFFINE, rel=1e-5)
    header = read_header(tmp_path / name)
    assert (header.shape, header.unit, header.space) == ((4, 5, 6), unit, "scanner")
    assert header.voxel_mm == pytest.approx([0.8, 0.9, 1.0], rel=1e-5)


def test_disagreeing_qform_and_sform_are_refused_both_printed(tmp_path):
    other = AFFINE.copy()
    other[0, 3] = 33.0
    path = saved(tmp_path / "a.nii", qform=(other, 1))
    facts = Facts("a.nii", "qform", 33, "sform", -10, "affine_from")
    with pytest.raises(InputError, check=facts):
        read_label_volume(path)
    assert read_label_volume(path, "qform").affine[0, 3] == pytest.approx(33.0)
    assert read_label_volume(path, "sform").affine[0, 3] == pytest.approx(-10.0)


@pytest.mark.parametrize("unset", ["sform", "qform"])
def test_of_two_matrices_the_one_that_is_set_counts(tmp_path, unset):
    path = saved(tmp_path / "a.nii", **{unset: (scaling(3.0), 0)})
    assert read_label_volume(path).affine == pytest.approx(AFFINE, abs=1e-5)


def test_a_broken_qform_is_not_read_where_the_sform_holds(tmp_path):
    path = overwritten(saved(tmp_path / "a.nii"), 256, [0.9, 0.9], "<f4")
    with pytest.raises(InputError, check=Facts("a.nii:", "affine_from: sform")):
        read_label_volume(path)
    assert np.allclose(read_label_volume(path, "sform").affine[:3, :3], AFFINE[:3, :3])


def with_values(value):
    values = LABELS.astype(np.float32)
    values[0, 0, :3] = value
    return values


def with_slope(path, slope, kind):
    image = nib.Nifti1Image(np.rint(LABELS / slope).astype(kind), AFFINE)
    image.header.set_slope_inter(slope, 0)
    nib.save(image, path)
    return path


@pytest.mark.parametrize(
    ("make", "difference"),
    [
        # labels 2 and 7 become 2.01 and 6.99
        (lambda path: with_slope(path, 0.03, np.uint8), 0.01),
        (lambda path: with_slope(path, 1 / 255, np.int16), None),
        (lambda path: saved(path, (LABELS * 0.994).astype(np.float32)), 0.042),
    ],
)
def test_labels_that_their_storage_moved_are_rounded_with_a_warning(
    tmp_path, caplog, make, difference
):
    path = make(tmp_path / "a.nii")
    assert np.array_equal(read_label_volume(path).labels, LABELS)
    assert caplog.messages == ([Facts(path, difference)] if difference else [])


@pytest.mark.parametrize("name", ["a.nii.gz", "a.img.gz", "a.mgz"])
def test_a_flipped_bit_of_a_compressed_volume_changes_no_label(tmp_path, name):
    folder = SHIPPED / "atlases" / "spina-bifida" / "fetal_SB_atlas_GA21_notoperated"
    volume = read_label_volume(folder / "parcellation.nii.gz")
    path = saved(tmp_path / name, volume.labels[::3, ::3, ::3].astype(np.int16))
    whole, expected = path.read_bytes(), read_label_volume(path)
    flips, refused = 20, 0
    for place in np.random.default_rng(0).integers(8 * len(whole), size=flips):
        damaged = bytearray(whole)
        damaged[place // 8] ^= 1 << place % 8
        path.write_bytes(damaged)
        try:
            found = read_label_volume(path)
        except InputError as error:
            refused += Facts(path) == error
        else:
            assert np.array_equal(found.labels, expected.labels)
            assert np.array_equal(found.affine, expected.affine)
    # a few bits have no meaning
    assert refused > 0.3 * flips


def test_further_members_and_bytes_of_gzip_are_taken_as_gzip_does(tmp_path, caplog):
    labels = np.pad(LABELS, 10)
    whole = gzip.decompress(saved(tmp_path / "a.nii.gz", labels).read_bytes())
    members = gzip.compress(whole[:400]) + gzip.compress(whole[400:])
    (tmp_path / "b.nii.gz").write_bytes(members + b"\0further")
    assert np.array_equal(read_label_volume(tmp_path / "b.nii.gz").labels, labels)
    assert caplog.messages == [Facts(tmp_path / "b.nii.gz")]


@pytest.mark.parametrize(
    ("name", "make", "facts"),
    [
        (
            "a.nii",
            lambda path: saved(path, sform=(AFFINE, 0), qform=(AFFINE, 0)),
            ["qform", "sform", "affine_from"],
        ),
        (
            "a.img",
            lambda path: nib.save(nib.Spm2AnalyzeImage(LABELS, None), path),
            ["Analyze", "NIfTI"],
        ),
        (
            "a.nii",
            lambda path: saved(path, np.zeros((3, 3, 3, 2), np.int16)),
            ["(3, 3, 3, 2)"],
        ),
        (
            "a.nii",
            lambda path: saved(path, with_values(0.4)),
            [3, 0.4, 0.05, "nearest neighbour", "segment"],
        ),
        ("a.nii", lambda path: saved(path, with_values(np.nan)), [3, "NaN"]),
    ],
)
def test_what_is_no_volume_of_labels_in_the_world_is_refused(
    tmp_path, name, make, facts
):
    make(tmp_path / name)
    with pytest.raises(InputError, check=Facts(f"{name}:", *facts)):
        read_label_volume(tmp_path / name)


TOO_MANY = "30000 x 30000 x 30000"


@pytest.mark.parametrize(
    ("name", "place", "values", "kind", "facts"),
    [
        ("a.nii", 123, [5], "u1", ["xyzt_units", 5, 0, 1, 2, 3]),
        ("a.nii", 108, [0], "<f4", ["vox_offset 0", 352]),
        ("a.mgh", 30, [-0.8, 0.9, 1.0], ">f4", ["-0.8 x 0.9 x 1 mm"]),
        ("a.mgz", 28, [0], "u2", ["goodRASFlag", 0, 1, "mri_convert"]),
        # memory is not asked for more than a file can have
        ("a.nii", 42, [30000] * 3, "<i2", [TOO_MANY, 54_000_000_000_000]),
        ("a.nii.gz", 42, [30000] * 3, "<i2", [TOO_MANY, 54_000_000_000_000]),
        ("a.mgz", 4, [30000] * 3, ">i4", [TOO_MANY, 108_000_000_000_000]),
    ],
)
def test_a_volume_whose_header_cannot_be_is_refused(
    tmp_path, name, place, values, kind, facts
):
    path = overwritten(saved(tmp_path / name), place, values, kind)
    with pytest.raises(InputError, check=Facts(f"{path}:", *facts)):
        read_label_volume(path)


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


def test_sizes_of_voxels_that_disagree_in_a_header_are_reported(tmp_path, caplog):
    path = saved(tmp_path / "a.nii", qform=(AFFINE, 0))
    read_label_volume(path)
    assert not caplog.records
    volume = read_label_volume(overwritten(path, 80, [0.5, 0.5, 0.5], "<f4"))
    assert caplog.messages == [
        Facts(path, "0.5 x 0.5 x 0.5", "0.8 x 0.9 x 1 mm", "sform")
    ]
    assert np.diag(volume.affine)[:3] == pytest.approx([0.8, 0.9, 1.0])


def test_a_volume_of_numbers_keeps_fractions_nan_and_its_oblique_affine(tmp_path):
    values = np.random.default_rng(0).normal(size=(4, 5, 6)).astype(np.float32)
    values[0, 0, 0] = np.nan
    oblique = rigid(20, -15, 25) @ AFFINE
    path = saved(tmp_path / "a.nii.gz", values[..., None], oblique)
    found, affine = read_volume_map(path)
    np.testing.assert_array_equal(found, values)
    assert affine == pytest.approx(oblique, abs=1e-3)


@pytest.mark.parametrize("shear", [0.0, 0.2])
def test_written_volume_comes_back(tmp_path, shear):
    path, affine = tmp_path / "a.nii.gz", AFFINE.copy()
    affine[0, 2] = shear
    write_label_volume(path, LabelVolume(LABELS.astype(np.int32), affine))
    back = read_label_volume(path)
    assert np.array_equal(back.labels, LABELS)
    assert back.affine == pytest.approx(affine, abs=1e-5)
    assert nib.load(path).get_data_dtype() == np.uint8


def test_an_empty_border_is_left_out_and_nothing_moves(tmp_path):
    affine = rigid(20, -30, 140, shift=(5, -7, 9)) @ np.diag([0.8, 0.6, -1.5, 1.0])
    padding = ((20, 30), (10, 0), (0, 40))
    path = saved(tmp_path / "a.nii.gz", np.pad(LABELS, padding), affine)
    whole, volume = read_label_volume(path), read_label_volume(path, cropped=True)
    # a voxel around the labels, but not beyond the volume's own end
    assert sorted(volume.labels.shape) == [4, 5, 5]
    for label in (7, 2):
        assert position(volume, label) == pytest.approx(position(whole, label))
    expected = affine[:3, :3] @ [21, 12, 3] + affine[:3, 3]
    assert position(volume, 7) == pytest.approx(expected, abs=1e-3)


def test_a_volume_without_labels_has_no_border(tmp_path):
    path = saved(tmp_path / "a.nii.gz", np.zeros((3, 4, 5), dtype=np.int16))
    assert read_label_volume(path, cropped=True).labels.shape == (3, 4, 5)
