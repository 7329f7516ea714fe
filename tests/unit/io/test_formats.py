"""Each format of surfaces and volumes is read, recognised by `gyriflow init`, and
hidden where a report shows keys."""

import gzip

import nibabel as nib
import numpy as np
import pytest
import pyvista as pv
from facts import Facts
from nibabel.freesurfer.io import write_geometry
from shapes import sphere

from gyriflow.cli.recognition import recognise
from gyriflow.errors import InputError
from gyriflow.formats import FORMATS, is_volume
from gyriflow.geometry.triangles import is_closed, signed_volume
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.volumes import read_label_volume
from gyriflow.report.page import hide_paths

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
            packed = gzip.compress(path.read_bytes())
            path.with_name(f"{path.name}.gz").write_bytes(packed)
            path.unlink()
    return folder / f"{stem}{suffix}"


def recognised(folder, names):
    """Return whether a folder has one brain, of files with these names."""
    (found,) = recognise(folder).brains
    return all(repr(name) in repr(found.entry) for name in names)


@pytest.mark.parametrize(
    ("form", "suffix"),
    [
        (form, suffix)
        for form in FORMATS
        for suffix in form.suffixes
        if form.content == "surface"
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_a_format_of_surfaces_is_read_recognised_and_hidden(tmp_path, form, suffix):
    # FreeSurfer's ending is the layer
    pial = "" if form.name == "FreeSurfer" else ".pial"
    paths = [written(form, tmp_path, f"{side}{pial}", suffix) for side in ("lh", "rh")]
    surface = read_surface(paths[0])
    assert is_closed(surface)
    assert signed_volume(surface) == pytest.approx(signed_volume(BALL), rel=1e-5)
    places = np.sort(surface.vertices, axis=0)
    assert places == pytest.approx(np.sort(BALL.vertices, axis=0), abs=1e-4)
    assert not is_volume(paths[0])
    assert hide_paths({"file": paths[0].name}) == {"file": "(file)"}
    if suffix == ".white":
        for side in ("lh", "rh"):
            written(form, tmp_path, side, ".pial")
    assert recognised(tmp_path, [path.name for path in paths])


@pytest.mark.parametrize(
    ("form", "suffix"),
    [
        (form, suffix)
        for form in FORMATS
        for suffix in form.suffixes + form.data_suffixes
        if form.content == "volume"
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_a_format_of_volumes_is_read_recognised_and_hidden(tmp_path, form, suffix):
    path = written(form, tmp_path, "case_week22_dseg", suffix)
    assert (read_label_volume(path).labels == LABELS).all()
    assert is_volume(path)
    assert hide_paths({"file": path.name}) == {"file": "(file)"}
    # a pair is named by its header
    assert recognised(tmp_path, [path.name.replace(".img", ".hdr")])


@pytest.mark.parametrize("ending", ["dlabel", "dtseries", "pconn"])
def test_cifti_files_are_not_volumes(tmp_path, ending):
    assert not is_volume(f"a.{ending}.nii")
    assert is_volume(f"a.{ending}.nii.gz")
    name = f"sub-1_week24_seg.{ending}.nii"
    (tmp_path / name).touch()
    with pytest.raises(InputError, check=Facts(name, "CIFTI")):
        recognise(tmp_path)
    save_volume(nib.Nifti1Image)(tmp_path / "sub-1_week24_dseg.nii.gz")
    assert recognised(tmp_path, ["sub-1_week24_dseg.nii.gz"])


def mni_text(coloured_by=2, corners=3):
    """Return a surface as programs of the MNI write it, coloured as a whole (0), by
    faces (1) or by vertices (2)."""
    colours = {0: 1, 1: len(BALL.faces), 2: len(BALL.vertices)}[coloured_by]
    ends = corners * np.arange(1, len(BALL.faces) + 1)
    parts = [
        f"P 0.3 0.3 0.4 10 1 {len(BALL.vertices)}",
        "\n".join(" ".join(map(str, point)) for point in BALL.vertices),
        "0 0 1\n" * len(BALL.vertices),
        f"{len(BALL.faces)}\n{coloured_by} " + "0 1 1 1\n" * colours,
        " ".join(map(str, ends)),
        " ".join(map(str, BALL.faces.ravel())),
    ]
    return "\n".join(parts)


def wavefront_text(corner):
    """Return a surface as a Wavefront file in which a function of a vertex and its face
    writes the corners."""
    lines = ["mtllib none.mtl", "vt 0 0", "vt 1 1"]
    lines += ["v " + " ".join(map(str, point)) for point in BALL.vertices]
    lines += ["vn 0 0 1"] * len(BALL.faces)
    for number, face in enumerate(BALL.faces):
        words = [corner(int(vertex), number) for vertex in face]
        lines += [f"usemtl colour{number % 3}", "f " + " ".join(words)]
    return "\n".join(lines)


OBJ_TEXTS = {
    "MNI, one colour": mni_text(0),
    "MNI, a colour of each face": mni_text(1),
    "MNI, a colour of each vertex": mni_text(2),
    "from the end": wavefront_text(lambda vertex, _: f"{vertex - len(BALL.vertices)}"),
    "with texture and normals": wavefront_text(
        lambda vertex, face: f"{vertex + 1}/{face % 2 + 1}/{face + 1}"
    ),
}


@pytest.mark.parametrize("text", OBJ_TEXTS.values(), ids=OBJ_TEXTS)
def test_an_obj_file_keeps_its_vertices_and_faces(tmp_path, text):
    (tmp_path / "a.obj").write_text(text)
    found = read_surface(tmp_path / "a.obj")
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


VTK_HEAD = (
    "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n"
    "0 0 0\n9 0 0\n0 9 0\n9 9 0\n"
)


@pytest.mark.parametrize(
    ("name", "content", "facts"),
    [
        ("a.obj", mni_text(corners=4), ["triangles"]),
        ("a.obj", mni_text()[:-500], []),
        ("a.obj", b"p\x3e\x99\x99\x9a" + b"\0" * 100, ["binary", "MNI"]),
        ("a.obj", "# nothing\n", []),
        ("a.vtk", f"{VTK_HEAD}POLYGONS 1 5\n4 0 1 3 2", ["1 faces", "Triangulate"]),
        ("a.vtk", f"{VTK_HEAD}TRIANGLE_STRIPS 1 5\n4 0 1 2 3", ["1 strips"]),
        (
            "a.vtk",
            f"{VTK_HEAD}LINES 1 3\n2 0 1\nPOLYGONS 2 8\n3 0 1 2\n3 1 3 2",
            ["1 lines"],
        ),
        (
            "lh.pial.asc",
            "#!ascii version of lh.pial\n3 1\n",
            ["as text", "mris_convert"],
        ),
    ],
)
def test_what_is_no_surface_of_triangles_is_named(tmp_path, name, content, facts):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, check=Facts(path, *facts)):
        read_surface(path)


SURFACE_FILES = [form.suffixes[0] for form in FORMATS if form.content == "surface"]


@pytest.mark.parametrize("suffix", SURFACE_FILES)
def test_what_is_no_file_with_content_is_named_in_each_format(tmp_path, suffix):
    empty, folder, link = (tmp_path / f"{name}{suffix}" for name in "abc")
    empty.touch()
    folder.mkdir()
    link.symlink_to(link)
    for path, fact in ((empty, "is empty"), (folder, "folder"), (link, "back to it")):
        with pytest.raises(InputError, check=Facts(path, fact)) as caught:
            read_surface(path)
        assert ("truncated" in str(caught.value)) == (path == empty)
