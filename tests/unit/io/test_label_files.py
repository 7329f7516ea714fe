"""Label files are read and written with their names."""

import nibabel as nib
import numpy as np
import pytest
from nibabel.gifti import GiftiDataArray, GiftiImage

from gyriflow.errors import InputError
from gyriflow.io.label_files import read_vertex_labels, write_vertex_labels


def test_labels_and_names_come_back(tmp_path):
    path = tmp_path / "left.label.gii"
    labels = np.array([0, 3, 3, 12])
    write_vertex_labels(path, labels, {3: "frontal", 12: "insula"}, "CortexLeft")
    found, names = read_vertex_labels(path)
    assert found.tolist() == labels.tolist()
    # the label of no region is none of the names
    assert names == {3: "frontal", 12: "insula"}
    assert nib.load(path).meta["AnatomicalStructurePrimary"] == "CortexLeft"


def test_numbers_between_labels_are_refused(tmp_path):
    path = tmp_path / "thick.shape.gii"
    nib.save(GiftiImage(darrays=[GiftiDataArray(np.array([1.0, 2.5], np.float32))]), path)
    with pytest.raises(InputError, match="no whole numbers"):
        read_vertex_labels(path)


def test_several_arrays_are_refused(tmp_path):
    path = tmp_path / "two.label.gii"
    nib.save(GiftiImage(darrays=[GiftiDataArray(np.array([1, 2], np.int32))] * 2), path)
    with pytest.raises(InputError, match="one array"):
        read_vertex_labels(path)
