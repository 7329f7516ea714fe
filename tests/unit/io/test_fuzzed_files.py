"""Files with random damage: a reader gives something sound or refuses with a message
that names the file.

Nothing else is raised, and nothing is left beside the file.
"""

import gzip

import nibabel as nib
import numpy as np
import pytest
import pyvista as pv
from fuzzing import BOUNDED, damaged, outcome
from hypothesis import given, settings
from hypothesis import strategies as st
from nibabel.freesurfer.io import write_geometry
from shapes import sphere

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
AFFINE = np.diag([2.0, 2.0, 2.0, 1.0])
BALL = sphere(20.0, 1)
TEXTS = {
    "participants.tsv": (
        "participant_id\tage\tfiles\nsub-01\t24.5\ta.nii.gz\nsub-02\tn/a\tb.nii.gz\n"
    ),
    "a.json": '{"a": [1, 2.5, null], "b": {"c": "text"}}',
    "study.yaml": (
        "brains:\n  - {id: a, week: 21.5}\nstart: a\n"
        "folding: &f {end_week: 23}\nruns: {b: *f}\n"
    ),
}
GEOMETRY = {
    "head": [2, 0, 20],
    "valid": "1  # volume info valid",
    "filename": "a.mgz",
    "volume": [8, 8, 8],
    "voxelsize": [1.0] * 3,
    "xras": [-1.0, 0, 0],
    "yras": [0, 0, -1.0],
    "zras": [0, 1.0, 0],
    "cras": [1.0, 2.0, 3.0],
}


@pytest.fixture(scope="module")
def undamaged(tmp_path_factory):
    """Return a folder with a small file of each kind."""
    folder = tmp_path_factory.mktemp("undamaged")
    image = nib.Nifti1Image(LABELS, AFFINE)
    image.header.set_xyzt_units("mm")
    nib.save(image, folder / "a.nii")
    (folder / "a.nii.gz").write_bytes(gzip.compress((folder / "a.nii").read_bytes()))
    nib.save(nib.MGHImage(LABELS.astype(np.int32), AFFINE), folder / "a.mgh")
    for name in ("a.surf.gii", "a.stl", "a.ply", "a.obj", "a.off"):
        write_surface(folder / name, BALL)
    write_geometry(folder / "lh.pial", BALL.vertices, BALL.faces, volume_info=GEOMETRY)
    body = pv.PolyData.from_regular_faces(BALL.vertices, BALL.faces)
    body.save(folder / "a.vtk", binary=False)
    labels = np.arange(len(BALL.vertices)) % 3
    write_vertex_labels(folder / "a.label.gii", labels, {1: "one", 2: "two"})
    write_vertex_maps(folder / "a.shape.gii", {"depth": BALL.vertices[:, 0]})
    write_maps(folder / "a.h5", {"thickness_mm": BALL.vertices[:, 0]})
    for name, text in TEXTS.items():
        (folder / name).write_text(text)
    return folder


def check_outcome(read, path):
    """Read a damaged file, and check that what is read is sound."""
    found = outcome(read, path)
    if isinstance(found, TriangleMesh):
        assert np.isfinite(found.vertices).all()
        assert 0 <= found.faces.min() <= found.faces.max() < len(found.vertices)
    elif isinstance(found, LabelVolume):
        assert abs(np.linalg.det(found.affine)) > 0
    elif read is read_volume_map and found is not None:
        assert abs(np.linalg.det(found[1])) > 0
    elif read is read_text_table and found is not None:
        assert all(isinstance(value, str) for row in found for value in row.values())


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
    tmp_path, undamaged, name, read, header, data
):
    whole = (undamaged / name).read_bytes()
    (tmp_path / name).write_bytes(data.draw(damaged(whole, header)))
    check_outcome(read, tmp_path / name)


# each is read by a process of its own, which takes a second to start
@settings(BOUNDED, max_examples=3)
@given(data=st.data())
def test_a_damaged_file_of_vtk_does_not_end_the_process(tmp_path, undamaged, data):
    whole = (undamaged / "a.vtk").read_bytes()
    (tmp_path / "a.vtk").write_bytes(data.draw(damaged(whole, 200)))
    check_outcome(read_surface, tmp_path / "a.vtk")
