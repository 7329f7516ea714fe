"""Folders and files whose names a shell could take apart, through the real program: they are names and nothing else."""

import pytest
from shapes import phantom, save_labels

from .conftest import Workflow

FOLDER = "-a b; touch pwned; $(touch pwned) `touch pwned` 'it\"s é {brain}"
FILE = "$(touch pwned) 'x' \"y\"; touch pwned & -é.nii.gz"


@pytest.mark.slow
@pytest.mark.fault(57)
def test_brains_in_a_folder_of_any_name_are_segmented_and_have_surfaces(checkout_copy, tmp_path):
    folder = tmp_path / FOLDER
    folder.mkdir()
    save_labels(folder / "plain.nii.gz", *phantom(21.0, 2.0))
    (folder / "plain.nii.gz").rename(folder / FILE)
    scheme = {"week": 21, "scheme": "spina-bifida-atlas"}
    brains = [
        {"id": "given", "labels": FILE} | scheme,
        {"id": "made", "image": FILE, "segmentation": {"command": "cp -- {image} {labels}"}} | scheme,
    ]
    config = {"brains": brains, "start": "given", "surface": {"edge_length_mm": 3.0}, "folding": {"end_week": 22}}
    study = Workflow(checkout_copy, folder).surfaces(config, "surface")
    assert study.outcome.returncode == 0, study.outcome.stderr
    for brain in ("given", "made"):
        assert (study.results / brain / "surface" / "pial.surf.gii").stat().st_size > 0
    assert not list(tmp_path.rglob("pwned*"))
    assert not (checkout_copy / "pwned").exists()
