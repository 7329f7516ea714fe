"""What `gyriflow check` says of the input files of brains."""

import numpy as np
import pytest
from shapes import hemisphere

from gyriflow.config import load
from gyriflow.io.surfaces import write_surface
from gyriflow.io.volumes import LabelVolume, write_label_volume
from gyriflow.shell.checking import input_problems


def problems(folder, **keys):
    brain = {"id": "a", "week": 23} | keys
    return list(input_problems(load({"brains": [brain], "start": "a", "folding": {"end_week": 26}}, folder)))


@pytest.fixture
def volume(tmp_path):
    """Labels of the spina bifida atlas in a block of white matter with cortex on one side only."""
    labels = np.zeros((20, 20, 20), np.int32)
    labels[4:16, 4:16, 4:16] = 1
    labels[4:6, 4:16, 4:16] = 5
    write_label_volume(tmp_path / "l.nii.gz", LabelVolume(labels, np.eye(4)))
    labels[0, 0, 0] = 99
    write_label_volume(tmp_path / "unknown.nii.gz", LabelVolume(labels, np.eye(4)))
    return tmp_path


def test_the_labels_of_one_hemisphere_are_read_as_labels(volume):
    scheme = "spina-bifida-atlas"
    # its wall towards the side that is not there may have no cortex
    assert problems(volume, hemisphere={"file": "l.nii.gz", "side": "left"}, scheme=scheme) == []
    assert "does not lie around" in problems(volume, labels="l.nii.gz", scheme=scheme)[0]
    (said,) = problems(volume, hemisphere={"file": "unknown.nii.gz", "side": "left"}, scheme=scheme)
    assert f"labels that the scheme '{scheme}' does not know" in said


def test_the_surface_of_one_hemisphere_is_of_its_side(tmp_path):
    write_surface(tmp_path / "r.surf.gii", hemisphere(1), "CortexRight")
    assert problems(tmp_path, hemisphere={"file": "r.surf.gii", "side": "right"}) == []
    (said,) = problems(tmp_path, hemisphere={"file": "r.surf.gii", "side": "left"})
    assert "is of the other hemisphere; found CortexRight; expected CortexLeft" in said
