"""Each format of surfaces and volumes is read, recognised by `gyriflow init`, and
hidden where a report shows keys."""

import gzip

import nibabel as nib
import numpy as np
import pytest
import pyvista as pv
from facts import Facts
from nibabel.freesurfer.io import write_geometry
from pydantic import ValidationError
from shapes import sphere

from gyriflow.cli.recognition import recognise
from gyriflow.errors import InputError
from gyriflow.formats import FORMATS, is_volume
from gyriflow.geometry.triangles import is_closed, signed_volume
from gyriflow.io.surfaces import SURFACE_READERS, read_surface, write_surface
from gyriflow.io.volumes import VOLUME_READERS, read_label_volume
from gyriflow.report.page import hide_paths
from gyriflow.settings.brains import BrainConfig

BALL = sphere(20.0, 2, (30.0, -20.0, 5.0))
LABELS = np.zeros((4, 5, 6), dtype=np.uint8)
LABELS[1:3, 1:4, 1:5] = 1


def save_surface(path):
    write_surface(path, BALL)


def save_with_vtk(path):
    pv.PolyData.from_regular_faces(BALL.vertices, BALL.faces).save(path)


def save_volume(kind):
    return lambda path: nib.save(kind(LABELS.astype(np.int16), np.eye(4)), path)


WRITERS = {
    **dict.fromkeys(("GIFTI", "STL", "PLY", "OBJ", "OFF"), save_surface),
    "VTK": save_with_vtk,
    "FreeSurfer": lambda path: write_geometry(path, BALL.vertices, BALL.faces),
    "NIfTI": save_volume(nib.Nifti1Image),
    "NIfTI pair": save_volume(nib.Nifti1Pair),
    "MGH": save_volume(nib.MGHImage),
}


def written(form, folder, stem, suffix):
    """Write a file of a format and return its path; what is packed is packed
    afterwards."""
    WRITERS[form.name](folder / f"{stem}{suffix.removesuffix('.gz')}")
    if suffix.endswith(".gz"):
        for path in folder.glob(f"{stem}.*"):
            path.with_name(f"{path.name}.gz").write_bytes(
                gzip.compress(path.read_bytes())
            )
            path.unlink()
    return folder / f"{stem}{suffix}"


@pytest.mark.parametrize(
    ("form", "suffix"),
    [(form, suffix) for form in FORMATS for suffix in form.all_suffixes],
    ids=lambda value: str(value),
)
def test_a_format_is_read_recognised_and_hidden(tmp_path, form, suffix):
    # FreeSurfer's ending is the layer
    pial = "" if suffix in (".pial", ".white") else ".pial"
    stems = (
        ["case_week22_dseg"] if form.content == "volume" else [f"lh{pial}", f"rh{pial}"]
    )
    paths = [written(form, tmp_path, stem, suffix) for stem in stems]
    if suffix == ".white":
        for side in ("lh", "rh"):
            written(form, tmp_path, side, ".pial")
    for path in paths:
        if form.content == "surface":
            surface = read_surface(path)
            assert is_closed(surface)
            assert signed_volume(surface) == pytest.approx(
                signed_volume(BALL), rel=1e-5
            )
            assert np.sort(surface.vertices, axis=0) == pytest.approx(
                np.sort(BALL.vertices, axis=0), abs=1e-4
            )
        else:
            assert (read_label_volume(path).labels == LABELS).all()
        assert is_volume(path) == (form.content == "volume")
        assert hide_paths({"file": path.name}) == {"file": "(file)"}
    (found,) = recognise(tmp_path).brains
    # a pair is named by its header
    assert all(
        repr(path.name.replace(".img", ".hdr")) in repr(found.entry) for path in paths
    )


def write_mni(path, ball=BALL, coloured_by=2, corners=3):
    """Write a surface as programs of the MNI do, coloured as a whole (0), by faces (1)
    or by vertices (2)."""
    colours = {0: 1, 1: len(ball.faces), 2: len(ball.vertices)}[coloured_by]
    ends = corners * np.arange(1, len(ball.faces) + 1)
    parts = [
        f"P 0.3 0.3 0.4 10 1 {len(ball.vertices)}",
        "\n".join(" ".join(map(str, point)) for point in ball.vertices),
        "0 0 1\n" * len(ball.vertices),
        f"{len(ball.faces)}\n{coloured_by} " + "0 1 1 1\n" * colours,
        " ".join(map(str, ends)),
        " ".join(map(str, ball.faces.ravel())),
    ]
    path.write_text("\n".join(parts))


@pytest.mark.parametrize("coloured_by", [0, 1, 2])
def test_an_obj_file_of_the_mni_is_read(tmp_path, coloured_by):
    path = tmp_path / "sub-1_gray_surface_left_81920.obj"
    write_mni(path, coloured_by=coloured_by)
    found = read_surface(path)
    assert found.vertices == pytest.approx(BALL.vertices)
    assert (found.faces == BALL.faces).all()


def test_other_obj_files_of_the_mni_are_named(tmp_path):
    path = tmp_path / "a.obj"
    write_mni(path, corners=4)
    with pytest.raises(InputError, check=Facts(path, "triangles")):
        read_surface(path)
    write_mni(path)
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(InputError, check=Facts(path)):
        read_surface(path)
    path.write_bytes(
        b"p" + np.array([0.3, 0.3, 0.4, 10.0], ">f4").tobytes() + b"\0" * 100
    )
    with pytest.raises(InputError, check=Facts(path, "binary", "MNI")):
        read_surface(path)
    path.write_text("# nothing\n")
    with pytest.raises(InputError, check=Facts(path)):
        read_surface(path)


@pytest.mark.parametrize(
    "ending", ["dlabel", "dscalar", "dtseries", "pconn", "dpconn", "plabel"]
)
def test_cifti_files_are_not_volumes(tmp_path, ending):
    assert not is_volume(f"a.{ending}.nii")
    assert is_volume(f"a.{ending}.nii.gz")
    assert is_volume("a.label.nii")
    save_volume(nib.Nifti1Image)(tmp_path / "sub-1_week24_dseg.nii.gz")
    (tmp_path / f"sub-1_week24_seg.{ending}.nii").touch()
    (brain,) = recognise(tmp_path).brains
    assert brain.entry["labels"] == "sub-1_week24_dseg.nii.gz"
    (tmp_path / "sub-1_week24_dseg.nii.gz").unlink()
    with pytest.raises(
        InputError, check=Facts(f"sub-1_week24_seg.{ending}.nii", "CIFTI")
    ):
        recognise(tmp_path)


def test_each_format_has_a_reader_and_each_reader_a_format():
    readers = {"surface": SURFACE_READERS, "volume": VOLUME_READERS}
    for content, by_name in readers.items():
        assert list(by_name) == [
            form.name for form in FORMATS if form.content == content
        ]
    suffixes = [suffix for form in FORMATS for suffix in form.all_suffixes]
    assert len(suffixes) == len(set(suffixes))


@pytest.mark.parametrize("suffix", [".nii.gz", ".HDR", ".mgz"])
def test_a_single_hemisphere_with_a_scheme_may_be_any_volume(suffix):
    one = {"id": "a", "week": 22, "labels": f"a{suffix}", "side": "left"}
    assert BrainConfig(**one, scheme="feta-7").labels == f"a{suffix}"
    with pytest.raises(ValidationError, match="scheme"):
        BrainConfig(**one)


CORNERS = {
    "positive": lambda corner, number: f"{corner + 1}",
    "from the end": lambda corner, number: f"{corner - len(BALL.vertices)}",
    "textured": lambda corner, number: f"{corner + 1}/{number % 2 + 1}",
    "with normals": lambda corner, number: f"{corner + 1}//{number + 1}",
    "with both": lambda corner, number: f"{corner + 1}/{number % 2 + 1}/{number + 1}",
}


@pytest.mark.parametrize("corners", CORNERS)
def test_an_obj_file_keeps_its_vertices_however_it_names_corners(tmp_path, corners):
    lines = ["mtllib none.mtl", "vt 0 0", "vt 1 1"]
    lines += ["v " + " ".join(map(str, point)) for point in BALL.vertices]
    lines += ["vn 0 0 1"] * len(BALL.faces)
    for number, face in enumerate(BALL.faces):
        lines.append(f"usemtl colour{number % 3}")
        words = [CORNERS[corners](int(corner), number) for corner in face]
        lines.append("f " + " ".join(words))
    path = tmp_path / "a.obj"
    path.write_text("\n".join(lines))
    found = read_surface(path)
    assert found.vertices == pytest.approx(BALL.vertices)
    assert (found.faces == BALL.faces).all()


def test_polygons_of_an_obj_file_are_triangles(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3 4\n")
    assert read_surface(path).faces.tolist() == [[0, 1, 2], [0, 2, 3]]


PLY_HEAD = (
    "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
    "property float z\nelement face {}\nproperty list uchar int vertex_indices\n"
    "end_header"
)
HEADS = {"a.ply": PLY_HEAD, "a.off": "OFF # made by hand\n\n{} {} 0"}


@pytest.mark.parametrize("name", HEADS)
def test_a_truncated_surface_of_text_is_not_one_with_fewer_faces(tmp_path, name):
    lines = [HEADS[name].format(len(BALL.vertices), len(BALL.faces))]
    lines += [" ".join(map(str, point)) for point in BALL.vertices]
    lines += [f"3 {a} {b} {c}" for a, b, c in BALL.faces]
    path = tmp_path / name
    path.write_text("\n".join(lines))
    assert (read_surface(path).faces == BALL.faces).all()
    path.write_text("\n".join(lines[:-2]))
    total = len(BALL.vertices) + len(BALL.faces)
    with pytest.raises(InputError, check=Facts(path, total - 2, total, "truncated")):
        read_surface(path)


VTK_CELLS = {
    "POLYGONS 1 5\n4 0 1 3 2": ["1 faces"],
    "TRIANGLE_STRIPS 1 5\n4 0 1 2 3": ["1 strips"],
    "LINES 1 3\n2 0 1\nPOLYGONS 2 8\n3 0 1 2\n3 1 3 2": ["1 lines"],
}


@pytest.mark.parametrize("cells", VTK_CELLS)
def test_cells_of_a_vtk_file_that_are_no_triangles_are_named(tmp_path, cells):
    path = tmp_path / "a.vtk"
    path.write_text(
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n"
        f"0 0 0\n9 0 0\n0 9 0\n9 9 0\n{cells}\n"
    )
    with pytest.raises(InputError, check=Facts(path, "Triangulate", *VTK_CELLS[cells])):
        read_surface(path)


SURFACE_FILES = [form.suffixes[0] for form in FORMATS if form.content == "surface"]


@pytest.mark.parametrize("suffix", SURFACE_FILES)
def test_what_is_no_file_with_content_is_named_in_each_format(tmp_path, suffix):
    empty, folder, link = (tmp_path / f"{name}{suffix}" for name in "abc")
    empty.touch()
    folder.mkdir()
    link.symlink_to(link)
    with pytest.raises(InputError, check=Facts(empty, "is empty")):
        read_surface(empty)
    with pytest.raises(InputError, check=Facts(folder, "folder")) as caught:
        read_surface(folder)
    assert "truncated" not in str(caught.value)
    with pytest.raises(InputError, check=Facts(link, "back to it")):
        read_surface(link)


def test_a_surface_of_freesurfer_as_text_is_named(tmp_path):
    path = tmp_path / "lh.pial.asc"
    path.write_text("#!ascii version of lh.pial\n3 1\n0 0 0 0\n")
    with pytest.raises(InputError, check=Facts(path, "as text", "mris_convert")):
        read_surface(path)


def test_the_shape_of_transposed_points_is_named(tmp_path):
    points = nib.gifti.GiftiDataArray(
        BALL.vertices.T.astype(np.float32), intent="NIFTI_INTENT_POINTSET"
    )
    faces = nib.gifti.GiftiDataArray(
        BALL.faces.astype(np.int32), intent="NIFTI_INTENT_TRIANGLE"
    )
    path = tmp_path / "a.surf.gii"
    nib.save(nib.gifti.GiftiImage(darrays=[points, faces]), path)
    shape = f"(3, {len(BALL.vertices)})"
    with pytest.raises(InputError, check=Facts(path, shape, "(n, 3)")):
        read_surface(path)
