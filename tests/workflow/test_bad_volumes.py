"""Label volumes: bad ones end with a message in the real program and exit code 2; the same brain is the same in any."""

import nibabel as nib
import numpy as np
import pytest
from reliability import trying
from shapes import phantom, rigid

from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface

from .conftest import Workflow

pytestmark = pytest.mark.slow

LABELS, AFFINE = phantom(21.0, 2.0)


def image(labels=LABELS, affine=AFFINE, kind=np.int16, unit="mm"):
    made = nib.Nifti1Image(np.asarray(labels, dtype=kind), affine)
    made.header.set_xyzt_units(unit)
    made.set_sform(affine, code=1)
    made.set_qform(affine, code=1)
    return made


def with_wrong(matrix, code, made=None):
    """Returns an image with one of its two matrices moved and turned; `code` 0 says that this one is not set."""
    made = made or image()
    wrong = np.diag([2.0, 2.0, 2.0, 1.0])
    if matrix == "sform":
        made.set_sform(wrong, code=code)
    else:
        made.set_qform(wrong, code=code)
    return made


def with_values(*values):
    labels = LABELS.astype(float)
    labels[: len(values), 0, 0] = values
    return image(labels, kind=np.float32)


def relabelled(old, new):
    labels = LABELS.copy()
    np.place(labels, np.isin(labels, old), new)
    return image(labels)


def stored(made, axes):
    """Returns an image with its voxels stored in another order, such as LAS, and its affine to match."""
    turn = nib.orientations.ornt_transform(nib.io_orientation(made.affine), nib.orientations.axcodes2ornt(tuple(axes)))
    return made.as_reoriented(turn)


def oblique():
    return image(affine=rigid(20, -30, 40, shift=(5.0, 0.0, 9.0)) @ AFFINE)


def flat():
    """Returns the same brain in slices of 2.4 mm, three times the voxels' edge in the other directions."""
    labels, affine = phantom(21.0, 0.8)
    return image(labels[1::3], affine @ np.array([[3, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))


BAD = {
    "headers": (lambda: with_wrong("qform", 2), "qform and sform disagree by up to"),
    "metres": (lambda: image(unit="meter"), "The file seems to be in micrometres"),
    "microns": (lambda: image(unit="micron"), "The file seems to be in metres"),
    "series": (lambda: image(np.stack([LABELS] * 2, axis=-1)), "is not a volume of labels"),
    "fractions": (lambda: with_values(1.5), "gyriflow does not segment images"),
    "unknown": (lambda: relabelled([3], 30), "does not know; found 30 among"),
    "missing": (lambda: relabelled([5], 1), "the cortex of the scheme 'spina-bifida-atlas' is missing"),
    "empty": (lambda: relabelled([1, 2, 5, 6, 8], 0), "no voxel belongs to the cerebrum"),
    "infinite": (lambda: with_values(np.inf, np.nan), "has NaN or infinite values; found 2 voxels"),
}
REFUSED = trying(
    {
        **dict.fromkeys(("metres", "microns"), 4),
        **dict.fromkeys(("series", "fractions"), 6),
        **dict.fromkeys(("unknown", "missing"), 7),
        **{"headers": 2, "empty": 8, "infinite": 13, "torn": 12},
    }
)
# the same brain stored in other ways; what is not turned has the same world coordinates
PLACED = {
    "pir": lambda: stored(image(), "PIR"),
    "las": lambda: stored(with_wrong("qform", 0), "LAS"),
    "lps": lambda: stored(with_wrong("sform", 0), "LPS"),
    "micrometres": lambda: image(affine=np.diag([1e3, 1e3, 1e3, 1.0]) @ AFFINE, unit="micron"),
    # floats with a fourth axis, and two matrices of which the configuration names one
    "told": lambda: with_wrong("qform", 2, image(LABELS[..., None], kind=np.float32)),
}
SAME = PLACED | {"oblique": oblique, "flat": flat}
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
    whole = (workflow.directory / "whole.nii.gz").read_bytes()
    (workflow.directory / "torn.nii.gz").write_bytes(whole[: len(whole) // 2])
    brains.append({"id": "torn", "week": 21, "labels": "torn.nii.gz", "scheme": "spina-bifida-atlas"})
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


def test_the_run_ends_in_2_without_a_traceback(study):
    study.require_exit_code(2)


@pytest.mark.parametrize("name", REFUSED)
def test_a_bad_input_is_refused_with_a_message_and_nothing_is_left(study, name):
    expected = BAD[name][1] if name in BAD else f"{study.directory / 'torn.nii.gz'}: cannot be read as an image"
    study.require_refused(name, expected)


@pytest.mark.fault(2)
def test_matrices_that_disagree_are_both_printed(study):
    log = study.log("headers")
    for matrix, code in (("qform", 2), ("sform", 1)):
        assert f"{matrix} (code {code})\n[[" in log
    assert "affine_from: qform or sform" in log


def measured(study, name):
    report = study.report(name)
    return np.array([*report["area_cm2"].values(), report["volume_mL"]])


@pytest.mark.parametrize(
    "name", trying({"pir": 3, "las": (2, 3), "lps": (2, 3), "micrometres": 4, "told": (2, 6), "oblique": 1, "flat": 5})
)
def test_a_brain_is_the_same_however_it_is_stored(study, name):
    tolerance = 0.06 if name == "flat" else 0.005
    np.testing.assert_allclose(measured(study, name), measured(study, GOOD), rtol=tolerance)


@pytest.mark.parametrize("name", PLACED)
def test_storage_order_and_units_leave_a_brain_where_it_is(study, name):
    found, expected = (
        read_surface(study.results / brain / "surface" / "pial.surf.gii").vertices for brain in (name, GOOD)
    )
    for end in (np.min, np.max):
        # a quarter of a voxel
        np.testing.assert_allclose(end(found, axis=0), end(expected, axis=0), atol=0.5)


@pytest.mark.fault(5)
def test_flat_voxels_are_used_with_a_warning(study):
    assert "flat.nii.gz: voxels of 2.4 x 0.8 x 0.8 mm are used as they are" in study.log("flat")
    assert "are used as they are" not in study.log(GOOD)


@pytest.mark.fault(16)
def test_a_scheme_of_ones_own_gives_a_surface_with_its_thickness_at_its_week(study):
    folder = study.results / GOOD / "surface"
    report = study.report(GOOD)
    assert (report["week"], report["scheme"], report["euler_number"]) == (21.5, "mine", 2)
    assert abs(report["smoothing"]["volume_change"]) < 0.01
    thickness = nib.load(folder / "thickness.shape.gii").darrays
    assert [len(array.data) for array in thickness] == [report["vertices"]]
    measured = read_json(folder / "thickness.json")
    assert measured["mean_mm"] == pytest.approx(thickness[0].data.mean(), abs=0.2)
    assert "a suggestion for thickness_mm" in study.log(GOOD, "cortical_thickness")


def test_images_are_shown_where_they_are_given(workflow):
    for name in ("t2w.nii.gz", "labels.nii.gz"):
        (workflow.directory / name).touch()
    volume = {"image": "t2w.nii.gz", "scheme": "feta-7"}
    brains = [
        {"id": "a", "week": 21, **volume, "labels": "labels.nii.gz"},
        {"id": "b", "week": 22, "labels": "labels.nii.gz", "scheme": "binary"},
    ]
    study = {"brains": brains, "start": "a", "folding": {"end_week": 22}}
    jobs = workflow.jobs("--configfile", workflow.write("study.yaml", study))
    assert (jobs["overlay_figure"], jobs["pial_from_labels"], jobs["cortical_thickness"]) == (1, 2, 1)


def test_a_study_whose_every_brain_is_refused_ends_with_the_cause_of_each(workflow):
    (workflow.directory / "torn.nii.gz").write_text("no volume")
    brain = {"id": "a", "week": 21, "labels": "torn.nii.gz", "scheme": "binary"}
    name = workflow.write("study.yaml", {"brains": [brain], "start": "a", "folding": {"end_week": 22}})
    outcome = workflow.run("--keep-going", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 2
    assert "torn.nii.gz: cannot be read as an image" in outcome.stderr
    assert "ValueError" not in outcome.stdout + outcome.stderr


def test_an_empty_configuration_is_refused(workflow):
    (workflow.directory / "study.yaml").write_text("# nothing\n")
    outcome = workflow.run("-n", "--configfile", "study.yaml")
    assert outcome.returncode == 2
    assert "study.yaml: holds no keys; found nothing" in outcome.stderr
