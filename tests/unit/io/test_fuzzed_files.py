"""Files with random damage: a reader gives something sound or refuses with a message
that names the file.

Nothing else is raised, and nothing is left beside the file.
"""

import gzip

import nibabel as nib
import numpy as np
import pytest
import pyvista as pv
from facts import Facts
from fuzzing import BOUNDED, damaged, outcome
from hypothesis import given
from hypothesis import strategies as st
from nibabel.freesurfer.io import write_geometry
from shapes import sphere

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import read_json, read_table, read_text_table
from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_labels,
    read_vertex_maps,
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)
from gyriflow.io.tetmeshes import read_maps, write_maps
from gyriflow.io.volumes import LabelVolume, read_label_volume, read_volume_map
from gyriflow.io.yaml_files import read_yaml

LABELS = np.random.default_rng(3).integers(0, 9, (5, 6, 7)).astype(np.int16)
BALL = sphere(20.0, 1)
TEXTS = {
    "participants.tsv": (
        b"participant_id\tage\tfiles\nsub-01\t24.5\ta.nii.gz\nsub-02\tn/a\tb.nii.gz\n"
    ),
    "a.json": b'{"a": [1, 2.5, null], "b": {"c": "text"}}',
    "study.yaml": (
        b"brains:\n  - {id: a, week: 21.5}\nstart: a\n"
        b"folding: &f {end_week: 23}\nruns: {b: *f}\n"
    ),
}


class Wholes(dict):
    """Bytes of files by name."""

    def __repr__(self):
        return f"Wholes of {', '.join(self)}"


@pytest.fixture(scope="module")
def wholes(tmp_path_factory):
    """Return the bytes of a small whole file of each kind."""
    folder = tmp_path_factory.mktemp("whole")
    image = nib.Nifti1Image(LABELS, np.diag([2.0, 2.0, 2.0, 1.0]))
    image.header.set_xyzt_units("mm")
    nib.save(image, folder / "a.nii")
    nib.save(
        nib.MGHImage(LABELS.astype(np.int32), np.diag([2.0, 2.0, 2.0, 1.0])),
        folder / "a.mgh",
    )
    for name in ("a.surf.gii", "a.stl", "a.ply", "a.obj", "a.off"):
        write_surface(folder / name, BALL)
    info = {
        "head": [2, 0, 20],
        "valid": "1  # volume info valid",
        "filename": "a.mgz",
        "volume": [8, 8, 8],
    }
    axes = {
        "xras": [-1.0, 0, 0],
        "yras": [0, 0, -1.0],
        "zras": [0, 1.0, 0],
        "cras": [1.0, 2.0, 3.0],
    }
    write_geometry(
        folder / "lh.pial",
        BALL.vertices,
        BALL.faces,
        volume_info=info | {"voxelsize": [1.0] * 3} | axes,
    )
    body = pv.PolyData.from_regular_faces(BALL.vertices, BALL.faces)
    body.save(folder / "a.vtk", binary=False)
    body.save(folder / "a.vtp")
    write_vertex_labels(
        folder / "a.label.gii", np.arange(len(BALL.vertices)) % 3, {1: "one", 2: "two"}
    )
    write_vertex_maps(folder / "a.shape.gii", {"depth": BALL.vertices[:, 0]})
    write_maps(folder / "a.h5", {"thickness_mm": BALL.vertices[:, 0]})
    (folder / "a.nii.gz").write_bytes(gzip.compress((folder / "a.nii").read_bytes()))
    return Wholes({path.name: path.read_bytes() for path in folder.iterdir()} | TEXTS)


@pytest.mark.parametrize(
    ("name", "read", "header"),
    [
        ("a.nii", read_label_volume, 352),
        ("a.mgh", read_label_volume, 284),
        ("a.nii.gz", read_volume_map, 16),
        ("a.surf.gii", read_surface, 1500),
        ("lh.pial", read_surface, 80),
        ("a.stl", read_surface, 84),
        ("a.ply", read_surface, 250),
        ("a.obj", read_surface, None),
        ("a.off", read_surface, None),
        ("a.vtk", read_surface, 200),
        ("a.vtp", read_surface, 1000),
        ("a.label.gii", read_vertex_labels, 800),
        ("a.shape.gii", read_vertex_maps, 800),
        ("a.h5", read_maps, 200),
        ("a.json", read_json, None),
        ("participants.tsv", read_text_table, None),
        ("participants.tsv", read_table, None),
        ("study.yaml", read_yaml, None),
    ],
)
@BOUNDED
@given(data=st.data())
def test_damaged_files_give_something_sound_or_are_refused(
    tmp_path, wholes, name, read, header, data
):
    (tmp_path / name).write_bytes(data.draw(damaged(wholes[name], header)))
    found = outcome(read, tmp_path / name)
    if isinstance(found, TriangleMesh):
        assert np.isfinite(found.vertices).all()
        assert 0 <= found.faces.min() <= found.faces.max() < len(found.vertices)
    elif isinstance(found, LabelVolume):
        assert abs(np.linalg.det(found.affine)) > 0
    elif read is read_volume_map and found is not None:
        assert abs(np.linalg.det(found[1])) > 0
    elif read is read_text_table and found is not None:
        assert all(isinstance(value, str) for row in found for value in row.values())


@pytest.mark.parametrize("suffix", ["nii", "nii.gz", "mgz"])
def test_a_header_that_asks_for_more_than_its_file_has_takes_no_memory(
    tmp_path, suffix
):
    kind = nib.MGHImage if suffix == "mgz" else nib.Nifti1Image
    data = bytearray(kind(LABELS.astype(np.int32), np.eye(4)).to_bytes())
    # 30000 x 30000 x 30000 voxels
    places = (
        {4: ">i4", 8: ">i4", 12: ">i4"}
        if suffix == "mgz"
        else {42: "<i2", 44: "<i2", 46: "<i2"}
    )
    for place, number in places.items():
        data[place : place + np.dtype(number).itemsize] = np.array(
            30000, number
        ).tobytes()
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(data if suffix == "nii" else gzip.compress(data))
    with pytest.raises(
        InputError, check=Facts(path, "30000 x 30000 x 30000", 108_000_000_000_000)
    ):
        read_label_volume(path)


@pytest.mark.parametrize(("old", "new"), [(b"\n3 ", b"\n3 7777"), (b"\n3 ", b"\n9 ")])
def test_vtk_cells_that_name_missing_points_do_not_end_the_process(tmp_path, old, new):
    points = "0 0 0 1 0 0 0 1 0 0 0 1"
    faces = "\n3 0 1 2\n3 0 1 3\n3 0 2 3\n3 1 2 3\n"
    text = (
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n"
        f"POINTS 4 float\n{points}\nPOLYGONS 4 16{faces}"
    )
    path = tmp_path / "a.vtk"
    path.write_bytes(text.encode())
    assert len(read_surface(path).faces) == 4
    path.write_bytes(text.encode().replace(old, new))
    assert outcome(read_surface, path) is None
