"""Bad inputs end with a message in the real program, exit code 2 and nothing half-written; good ones do not."""

import json
from types import SimpleNamespace

import nibabel as nib
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import hemisphere, save_gifti

from gyriflow.geometry.triangles import flipped, transformed
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface
from gyriflow.phantom.brain import CENTRE_MM, phantom_labels
from gyriflow.surface.extraction import isosurface, made_simple, smoothed_mask

LABELS, AFFINE = phantom_labels(21.0, voxel_mm=2.0)


def image(labels=LABELS, affine=AFFINE, kind=np.int16, unit="mm"):
    made = nib.Nifti1Image(np.asarray(labels, dtype=kind), affine)
    made.header.set_xyzt_units(unit)
    made.set_sform(affine, code=1)
    made.set_qform(affine, code=1)
    return made


def disagreeing():
    made = image()
    made.set_qform(np.diag([2.0, 2.0, 2.0, 1.0]), code=1)
    return made


def with_value(value):
    labels = LABELS.astype(float)
    labels[:2, 0, 0] = value
    return image(labels, kind=np.float32)


def with_labels(change):
    labels = LABELS.copy()
    change(labels)
    return image(labels)


def relabelled(old, new):
    return with_labels(lambda labels: np.place(labels, np.isin(labels, old), new))


BAD = {
    "headers": (disagreeing, "qform and sform disagree by up to"),
    "metres": (lambda: image(unit="meter"), "The file seems to be in micrometres"),
    "series": (lambda: image(np.stack([LABELS] * 2, axis=-1)), "is not a volume of labels"),
    "fractions": (lambda: with_value(1.5), "gyriflow does not segment images"),
    "unknown": (lambda: relabelled([3], 30), "does not know; found 30 among"),
    "missing": (lambda: relabelled([8], 1), "missing from the label volume"),
    "empty": (lambda: relabelled([1, 2, 5, 6, 8], 0), "no voxel belongs to the cerebrum"),
    "infinite": (lambda: with_value(np.inf), "values that are NaN or infinite; found 2 voxels"),
}
LEFT, RIGHT = hemisphere(-1), hemisphere(1)


def motion(*degrees, shift=(0.0, 0.0, 0.0), size=1.0):
    matrix = np.eye(4)
    matrix[:3, :3] = size * Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
    matrix[:3, 3] = shift
    return matrix


# pairs of hemispheres in RAS+
BAD_PAIRS = {
    "swapped": (RIGHT, LEFT, "the left hemisphere lies to the right of the right one"),
    "unequal": (LEFT, transformed(RIGHT, motion(0, 0, 0, size=1.06)), "too different in size to be of one brain"),
    "microns": (
        *(transformed(side, motion(0, 0, 0, size=1e3)) for side in (LEFT, RIGHT)),
        "seems to be in micrometres",
    ),
}


def oblique():
    return image(affine=motion(20, -30, 40, shift=(5.0, 0.0, 9.0)) @ AFFINE)


def stored_otherwise():
    stored = image()
    turn = nib.orientations.ornt_transform(nib.io_orientation(AFFINE), nib.orientations.axcodes2ornt("PIR"))
    return stored.as_reoriented(turn)


def flat():
    """Returns the same brain in slices of 2.4 mm, three times the voxels' edge in the other directions."""
    labels, affine = phantom_labels(21.0, voxel_mm=0.8)
    return image(labels[1::3], affine @ np.array([[3, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))


# the same brain, stored in other ways
SAME = {"oblique": oblique, "reordered": stored_otherwise, "flat": flat}
MATRIX = motion(0, 0, 90, shift=(7.0, 8.0, 9.0))
GOOD = "good"
SHIFTED = "shifted"


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over bad inputs and two good ones."""
    from .conftest import Workflow

    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("bad"))
    brains = []
    for name, (made, _) in BAD.items():
        nib.save(made(), workflow.directory / f"{name}.nii.gz")
        brains.append({"id": name, "week": 21, "labels": f"{name}.nii.gz", "scheme": "spina-bifida-atlas"})
    nib.save(image(), workflow.directory / "whole.nii.gz")
    whole = (workflow.directory / "whole.nii.gz").read_bytes()
    (workflow.directory / "torn.nii.gz").write_bytes(whole[: len(whole) // 2])
    brains.append({"id": "torn", "week": 21, "labels": "torn.nii.gz", "scheme": "spina-bifida-atlas"})
    nib.save(image(1000 + LABELS), workflow.directory / "t2w.nii.gz")
    for name, made in SAME.items():
        nib.save(made(), workflow.directory / f"{name}.nii.gz")
        brains.append({"id": name, "week": 21, "labels": f"{name}.nii.gz", "scheme": "spina-bifida-atlas"})
    pairs = BAD_PAIRS | {"placed": (*(transformed(side, np.linalg.inv(MATRIX)) for side in (LEFT, RIGHT)), None)}
    for name, (left, right, _) in pairs.items():
        for side, surface in {"left": left, "right": right}.items():
            save_gifti(workflow.directory / f"{name}.{side}.gii", surface, MATRIX if name == "placed" else None)
        files = {side: f"{name}.{side}.gii" for side in ("left", "right")}
        brains.append({"id": name, "week": 21, "coordinates": "ras", "hemispheres": files})
    moved = AFFINE.copy()
    moved[:3, 3] += 1.0
    nib.save(image(affine=moved), workflow.directory / "moved.nii.gz")
    for name, source in {GOOD: "whole", SHIFTED: "moved"}.items():
        command = f"echo my model on {{image}}; cp {workflow.directory / source}.nii.gz {{labels}}"
        segmented = {"image": "t2w.nii.gz", "scheme": "mine", "segmentation": {"command": command}}
        brains.append({"id": name, "week": 21.5, **segmented})
    mine = {"cerebrum": [1, 2, 5, 6, 8], "cortex": [5], "known": {3: "cerebellum", 4: "CSF", 7: "brainstem"}}
    config = {
        "schemes": {"mine": mine},
        "brains": brains,
        "start": GOOD,
        "surface": {"edge_length_mm": 2.0},
        "folding": {"end_week": 23},
    }
    name = workflow.write("study.yaml", config)
    targets = [f"results/{brain['id']}/surface/pial.surf.gii" for brain in brains]
    outcome = workflow.run(*targets, "--cores", "2", "--keep-going", "--configfile", name)
    return SimpleNamespace(directory=workflow.directory, outcome=outcome, results=workflow.directory / "results")


def test_the_run_ends_in_2_without_a_traceback(study):
    assert study.outcome.returncode == 2
    assert "Traceback" not in study.outcome.stderr


@pytest.mark.parametrize("name", [*BAD, "torn"])
def test_a_bad_input_is_refused_with_a_message_and_nothing_is_left(study, name):
    expected = BAD[name][1] if name in BAD else f"{study.directory / 'torn.nii.gz'}: cannot be read as an image"
    log = (study.results / name / "logs" / "pial_surface.log").read_text()
    assert expected in log
    assert expected in study.outcome.stderr
    assert not [path for path in (study.results / name / "surface").rglob("*") if path.is_file()]


@pytest.mark.parametrize("name", BAD_PAIRS)
def test_hemispheres_that_are_not_one_brain_are_refused_with_both_files(study, name):
    expected = BAD_PAIRS[name][2]
    log = (study.results / name / "logs" / "pial_surface.log").read_text()
    assert expected in log
    assert f"{study.directory / name}.left.gii, {study.directory / name}.right.gii: the " in study.outcome.stderr
    assert not [path for path in (study.results / name / "surface").rglob("*") if path.is_file()]


def measured(study, name):
    report = read_json(study.results / name / "surface" / "surface.json")
    return np.array([*report["area_cm2"].values(), report["volume_mL"]])


@pytest.mark.parametrize(("name", "tolerance"), [("oblique", 0.005), ("reordered", 0.005), ("flat", 0.06)])
def test_a_brain_is_the_same_however_it_is_stored(study, name, tolerance):
    np.testing.assert_allclose(measured(study, name), measured(study, GOOD), rtol=tolerance)


def test_flat_voxels_are_used_with_a_warning(study):
    log = (study.results / "flat" / "logs" / "pial_surface.log").read_text()
    assert "flat.nii.gz: voxels of 2.4 x 0.8 x 0.8 mm are used as they are" in log
    assert "are used as they are" not in (study.results / GOOD / "logs" / "pial_surface.log").read_text()


def test_the_coordinate_system_matrix_of_a_gifti_file_is_applied(study):
    surface = read_surface(study.results / "placed" / "surface" / "pial.surf.gii")
    np.testing.assert_allclose(surface.vertices.min(axis=0), [-23.5, -24.0, -16.0], atol=0.6)
    log = (study.results / "placed" / "logs" / "pial_surface.log").read_text()
    assert "placed.left.gii: the coordinate-system matrix of the file was applied" in log


def halves():
    """Returns a phantom's left and right hemisphere, a millimetre apart, with the fissure at x = 0."""
    labels, affine = phantom_labels(24.0, voxel_mm=1.2)
    x = affine[0, 2] * np.arange(labels.shape[2]) + affine[0, 3] - CENTRE_MM[0]
    affine[:3, 3] -= CENTRE_MM
    masks = [np.isin(labels, (1, 2, 5, 6, 8)) & side for side in (x < -0.6, x > 0.6)]
    return [isosurface(made_simple(smoothed_mask(mask, 1.0))[0], affine) for mask in masks]


def test_hemispheres_in_any_pose_are_posed_and_swapped_ones_refused_by_their_shape(workflow):
    motions = motion(100, 40, -70, shift=(30.0, 0.0, -50.0)), motion(-20, 130, 60, shift=(0.0, 9.0, 0.0))
    for side, half, turn in zip(("left", "right"), halves(), motions, strict=True):
        save_gifti(workflow.directory / f"{side}.gii", flipped(transformed(half, turn)))
    study = {"start": "a", "surface": {"edge_length_mm": 2.0}, "folding": {"end_week": 25}}
    brain = {"id": "a", "week": 24, "coordinates": "auto", "hemispheres": {"left": "left.gii", "right": "right.gii"}}
    name = workflow.write("study.yaml", study | {"brains": [brain]})
    target = "results/a/surface/pial.surf.gii"
    outcome = workflow.run(target, "--cores", "2", "--configfile", name)
    assert outcome.returncode == 0, outcome.stderr
    report = read_json(workflow.directory / "results/a/surface/surface.json")
    assert (report["euler_number"], report["posing"]["together"]) == (4, False)
    for side, turn in zip(("left", "right"), motions, strict=True):
        rest = np.array(report["posing"]["matrices"][side]) @ turn
        assert np.degrees(Rotation.from_matrix(rest[:3, :3]).magnitude()) < 3.0
    swapped = brain | {"hemispheres": {"left": "right.gii", "right": "left.gii"}}
    name = workflow.write("swapped.yaml", study | {"brains": [swapped]})
    outcome = workflow.run(target, "--cores", "1", "--configfile", name)
    assert outcome.returncode == 2
    assert "seem to be swapped" in outcome.stderr
    assert "seem to be swapped" in (workflow.directory / "results/study/logs/poses.log").read_text()
    assert not (workflow.directory / "results/a/surface/pose.json").exists()


def test_labels_on_another_grid_than_their_image_are_refused(study):
    log = (study.results / SHIFTED / "logs" / "segmentation.log").read_text()
    assert "labels.nii.gz: is not on the grid of its image" in log
    assert not [path for path in (study.results / SHIFTED / "surface").rglob("*") if path.is_file()]


def test_a_segmentation_of_ones_own_gives_a_surface_with_its_thickness_at_its_week(study):
    folder = study.results / GOOD / "surface"
    log = (study.results / GOOD / "logs" / "segmentation.log").read_text()
    assert f"my model on {study.directory / 't2w.nii.gz'}" in log
    report = json.loads((folder / "surface.json").read_text())
    assert (report["week"], report["scheme"], report["euler_number"]) == (21.5, "mine", 2)
    assert abs(report["smoothing"]["volume_change"]) < 0.01
    thickness = nib.load(folder / "thickness.shape.gii").darrays
    assert [len(array.data) for array in thickness] == [report["vertices"]]
    assert report["cortical_thickness"]["mean_mm"] == pytest.approx(thickness[0].data.mean(), abs=0.2)
    assert "a suggestion for thickness_mm" in (study.results / GOOD / "logs" / "pial_surface.log").read_text()


def test_images_are_segmented_and_shown_where_they_are_given(workflow):
    for name in ("t2w.nii.gz", "labels.nii.gz"):
        (workflow.directory / name).touch()
    volume = {"image": "t2w.nii.gz", "scheme": "feta-7"}
    brains = [
        {"id": "a", "week": 21, **volume, "segmentation": {"command": "model {image} {labels}"}},
        {"id": "b", "week": 22, **volume, "labels": "labels.nii.gz"},
        {"id": "c", "week": 23, "labels": "labels.nii.gz", "scheme": "binary"},
    ]
    study = {"brains": brains, "start": "a", "folding": {"end_week": 22}}
    jobs = workflow.jobs("--configfile", workflow.write("study.yaml", study))
    assert (jobs["segmentation"], jobs["overlay_figure"], jobs["pial_surface"], jobs["pial_surface_alone"]) == (
        1,
        2,
        2,
        1,
    )


def test_an_image_alone_is_refused_before_any_job(workflow):
    (workflow.directory / "t2w.nii.gz").touch()
    study = {"brains": [{"id": "a", "week": 21, "image": "t2w.nii.gz"}], "start": "a", "folding": {"end_week": 22}}
    outcome = workflow.run("--cores", "1", "--configfile", workflow.write("study.yaml", study))
    assert outcome.returncode == 2
    assert "brains[0].image: gyriflow does not segment images" in outcome.stderr
    assert not (workflow.directory / "results").exists()
