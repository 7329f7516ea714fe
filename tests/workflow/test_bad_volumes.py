"""Label volumes: bad ones end with a message in the real program and exit code 2; the same brain is the same in any."""

import nibabel as nib
import numpy as np
import pytest
from reliability import trying
from shapes import phantom, save_labels

from .conftest import Workflow

pytestmark = pytest.mark.slow

LABELS, AFFINE = phantom(21.0, 2.0)


def image(labels=LABELS, affine=AFFINE, kind=np.int16, unit="mm"):
    made = nib.Nifti1Image(np.asarray(labels, dtype=kind), affine)
    made.header.set_xyzt_units(unit)
    made.set_sform(affine, code=1)
    made.set_qform(affine, code=1)
    return made


def with_two_matrices(made):
    """Return an image whose qform is not its sform."""
    made.set_qform(np.diag([2.0, 2.0, 2.0, 1.0]), code=2)
    return made


def flat():
    """Return the same brain in slices of 2.4 mm, three times the voxels' edge in the other directions."""
    labels, affine = phantom(21.0, 0.8)
    return image(labels[1::3], affine @ np.array([[3, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))


# what else is refused, or read as it is meant: tests/unit/io/test_volumes.py
BAD = {
    "headers": (lambda: with_two_matrices(image()), "qform and sform disagree by up to"),
    "metres": (lambda: image(unit="meter"), "The file seems to be in micrometres"),
}
REFUSED = trying({"headers": 2, "metres": 4})
SAME = {
    # floats with a fourth axis, and two matrices of which the configuration names one
    "told": lambda: with_two_matrices(image(LABELS[..., None], kind=np.float32)),
    "flat": flat,
}
READING = {"told": {"affine_from": "sform"}}
GOOD = "good"


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over bad volumes and good ones."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("bad"))
    brains = []
    for name, made in {**{name: made for name, (made, _) in BAD.items()}, **SAME}.items():
        nib.save(made(), workflow.directory / f"{name}.nii.gz")
        brain = {"id": name, "week": 21, "labels": f"{name}.nii.gz", "scheme": "spina-bifida-atlas"}
        brains.append(brain | READING.get(name, {}))
    nib.save(image(), workflow.directory / "whole.nii.gz")
    brains.append({"id": GOOD, "week": 21.5, "labels": "whole.nii.gz", "scheme": "mine"})
    mine = {"cerebrum": [1, 2, 5, 6, 8], "cortex": [5], "known": {3: "cerebellum", 4: "CSF", 7: "brainstem"}}
    config = {
        "schemes": {"mine": mine},
        "brains": brains,
        "start": GOOD,
        "surface": {"edge_length_mm": 2.0},
        "folding": {"end_week": 23},
    }
    return workflow.surfaces(config, f"results/brains/{GOOD}/surface/thickness.json")


@pytest.mark.parametrize("name", REFUSED)
def test_a_bad_input_is_refused_with_a_message_and_nothing_is_left(study, name):
    study.require_exit_code(2)
    study.require_refused(name, BAD[name][1])


@pytest.mark.fault(2)
def test_matrices_that_disagree_are_both_printed(study):
    assert "qform (code 2)\n[[" in study.log("headers")
    assert "sform (code 1)\n[[" in study.log("headers")


@pytest.mark.parametrize("name", trying({"told": (2, 6), "flat": 5}))
def test_a_brain_is_the_same_however_it_is_stored(study, name):
    sizes, expected = (
        [*report["area_cm2"].values(), report["volume_mL"]] for report in map(study.report, (name, GOOD))
    )
    np.testing.assert_allclose(sizes, expected, rtol=0.06 if name == "flat" else 0.005)


@pytest.mark.fault(5)
def test_flat_voxels_are_used_with_a_warning(study):
    assert "flat.nii.gz: voxels of 2.4 x 0.8 x 0.8 mm are used as they are" in study.log("flat")
    assert "are used as they are" not in study.log(GOOD)


@pytest.mark.fault(16)
def test_labels_of_a_scheme_of_ones_own_give_a_surface_with_its_thickness_at_its_week(study):
    folder = study.results / GOOD / "surface"
    report = study.report(GOOD)
    assert (report["week"], report["scheme"], report["euler_number"]) == (21.5, "mine", 2)
    assert abs(report["smoothing"]["volume_change"]) < 0.01
    (thickness,) = nib.load(folder / "thickness.shape.gii").darrays
    assert len(thickness.data) == report["vertices"]


@pytest.mark.fault(12)
def test_a_study_whose_every_brain_is_refused_ends_with_the_cause_of_each(workflow):
    save_labels(workflow.directory / "whole.nii.gz", LABELS, AFFINE)
    whole = (workflow.directory / "whole.nii.gz").read_bytes()
    (workflow.directory / "torn.nii.gz").write_bytes(whole[: len(whole) // 2])
    brain = {"id": "a", "week": 21, "labels": "torn.nii.gz", "scheme": "binary"}
    name = workflow.write("study.yaml", {"brains": [brain], "start": "a", "folding": {"end_week": 23}})
    outcome = workflow.run("--keep-going", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 2
    assert "torn.nii.gz: cannot be read as an image" in outcome.stderr
    assert "ValueError" not in outcome.stdout + outcome.stderr
