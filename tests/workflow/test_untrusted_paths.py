"""Folders and files whose names a shell could take apart, through the real program: they are names and nothing else."""

import pytest
from shapes import phantom, save_labels

from .conftest import Workflow

FOLDER = "-a b; touch pwned; $(touch pwned) `touch pwned` 'it\"s é {brain}"
FILE = "$(touch pwned) 'x' \"y\"; touch pwned & -é.nii.gz"


@pytest.mark.slow
@pytest.mark.fault(57)
def test_a_brain_in_a_folder_of_any_name_has_a_surface(checkout_copy, tmp_path):
    folder = tmp_path / FOLDER
    folder.mkdir()
    save_labels(folder / "plain.nii.gz", *phantom(21.0, 2.0))
    (folder / "plain.nii.gz").rename(folder / FILE)
    brain = {"id": "given", "week": 21, "labels": FILE, "scheme": "spina-bifida-atlas"}
    config = {"brains": [brain], "start": "given", "surface": {"edge_length_mm": 3.0}, "folding": {"end_week": 22}}
    study = Workflow(checkout_copy, folder).surfaces(config, "surface")
    assert study.outcome.returncode == 0, study.outcome.stderr
    assert (study.results / "given" / "surface" / "pial.surf.gii").stat().st_size > 0
    assert not list(tmp_path.rglob("pwned*"))
    assert not (checkout_copy / "pwned").exists()
