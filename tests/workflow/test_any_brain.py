"""Brains of clinics and labs in the real program: each ends right, or is refused with
its true cause."""

import nibabel as nib
import numpy as np
import odd_brains
import pandas as pd
import pytest
from facts import Facts
from nibabel.freesurfer.io import write_geometry
from shapes import cerebrum_surface, inner, phantom, save_labels

from gyriflow.anatomy.repair import pieces
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.settings.terms import SIDES

from .conftest import Workflow

pytestmark = pytest.mark.slow

LABELS, AFFINE = phantom(voxel_mm=2.0)
SCHEME = "spina-bifida-atlas"


def halves():
    """Return the surfaces of the left and the right hemisphere."""
    both = cerebrum_surface(odd_brains.apart(LABELS, AFFINE), AFFINE)
    return sorted(pieces(both), key=lambda piece: piece.vertices[:, 0].mean())


def labelled(change, scheme=SCHEME, **entry):
    """Write labels that a function changes."""

    def made(folder, name):
        save_labels(folder / f"{name}.nii.gz", change(LABELS, AFFINE), AFFINE)
        return {"labels": f"{name}.nii.gz", "scheme": scheme, **entry}

    return made


def stored_oddly(folder, name):
    """Write labels as floats with a fourth axis and two matrices, of which the
    configuration names one, and with a scheme of the user's."""
    image = nib.Nifti1Image(LABELS[..., None].astype(np.float32), AFFINE)
    image.header.set_xyzt_units("mm")
    image.set_sform(AFFINE, code=1)
    image.set_qform(np.diag([2.0, 2.0, 2.0, 1.0]), code=2)
    nib.save(image, folder / f"{name}.nii.gz")
    entry = {"labels": f"{name}.nii.gz", "scheme": "mine", "week": 24.5}
    return entry | {"affine_from": "sform"}


def surfaces(order=1, white_mm=1.5):
    """Write the surfaces of both hemispheres as FreeSurfer does, left and right in some
    order, and white ones inside them."""

    def made(folder, name):
        files, white = {}, []
        for side, mesh in zip(SIDES, halves()[::order], strict=True):
            files[side] = f"{name}.{side}.pial"
            white.append(f"{name}.{side}.white.stl")
            write_geometry(folder / files[side], mesh.vertices, mesh.faces)
            write_surface(folder / white[-1], inner(mesh, white_mm))
        return {"hemispheres": files, "white": white, "coordinates": "ras"}

    return made


def unchanged(labels, affine):
    return labels


def with_small_hemisphere(labels, affine):
    small = odd_brains.small_hemisphere(labels, affine)
    return odd_brains.add_sides(small, affine)


PATHOLOGIES = {
    "holoprosencephaly": labelled(odd_brains.holoprosencephaly),
    "hypoplasia": labelled(with_small_hemisphere, "dhcp-19"),
    "hemispherectomy": labelled(odd_brains.one_hemisphere, side="left"),
}
USED = PATHOLOGIES | {
    "plain": labelled(unchanged),
    "polyp": labelled(odd_brains.with_fourth_ventricle),
    "stored_oddly": stored_oddly,
    "freesurfer": surfaces(),
}
REFUSED = {
    "small_half": (labelled(odd_brains.small_hemisphere), ["volume", 0.5]),
    "whole_as_half": (labelled(unchanged, side="right"), [0.56]),
    "swapped": (surfaces(order=-1), ["left", "right", "x =", "ras"]),
}
MINE = {
    "cerebrum": [1, 2, 5, 6, 8],
    "cortex": [5],
    "known": {3: "cerebellum", 4: "CSF", 7: "brainstem"},
}


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over all of them, and the metrics of pathologies."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("any"))
    makers = USED | {name: make for name, (make, _) in REFUSED.items()}
    makers["crossing"] = surfaces(white_mm=-1.5)
    brains = [
        {"id": name, "week": 24} | make(workflow.directory, name)
        for name, make in makers.items()
    ]
    config = {
        "schemes": {"mine": MINE},
        "brains": brains,
        "start": "plain",
        "folding": {"end_week": 25},
        "surface": {"edge_length_mm": 2.5, "asymmetric": True},
        "metrics": {"curvature_radius_mm": 7.0, "spangy_modes": 50},
    }
    brain = "results/brains/{}/{}".format
    measured = ("freesurfer", "crossing", "stored_oddly")
    return workflow.surfaces(
        config,
        *(brain(name, "surface/thickness.shape.gii") for name in measured),
        *(brain(name, "metrics/metrics.csv") for name in ("plain", *PATHOLOGIES)),
    )


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_refused_with_its_cause_and_nothing_is_left(study, name):
    study.require_exit_code(2)
    study.require_refused(name, *REFUSED[name][1])


@pytest.mark.parametrize("name", [name for name in USED if name != "hemispherectomy"])
def test_each_hemisphere_is_one_piece_on_its_side(study, name):
    folder = study.results / name / "surface"
    left, right = (read_surface(folder / f"{side}.pial.surf.gii") for side in SIDES)
    assert len(pieces(left)) == len(pieces(right)) == 1
    fissure_mm = study.report(name)["fissure_x_mm"]
    assert left.vertices[:, 0].mean() < fissure_mm < right.vertices[:, 0].mean()


@pytest.mark.parametrize(
    ("name", "facts"), [("polyp", ["mL", "stalk"]), ("hypoplasia", ["areas", "%"])]
)
def test_what_is_doubtful_is_reported(study, name, facts):
    assert Facts(*facts) in study.report(name)["warnings"]
    assert Facts(*facts) in study.messages(name, "warning")
    assert Facts(*facts) not in study.report("plain")["warnings"]


@pytest.mark.parametrize("name", ["stored_oddly", "polyp"])
def test_a_brain_is_the_same_in_any_storage_and_with_a_piece_on_a_stalk(study, name):
    found, plain = study.report(name), study.report("plain")
    assert found["volume_mL"] == pytest.approx(plain["volume_mL"], rel=0.005)
    assert found["extents_mm"] == pytest.approx(plain["extents_mm"], abs=1.0)


def test_labels_of_a_user_s_scheme_give_a_surface_with_its_thickness(study):
    report = study.report("stored_oddly")
    assert (report["week"], report["scheme"]) == (24.5, "mine")
    file = study.results / "stored_oddly" / "surface" / "thickness.shape.gii"
    assert len(nib.load(file).darrays[0].data) == report["vertices"]


def test_thickness_is_the_distance_to_white_surfaces_which_may_not_cross(study):
    found = read_json(study.results / "freesurfer" / "surface" / "thickness.json")
    assert found["mean_mm"] == pytest.approx(1.5, abs=0.15)
    (cause,) = study.messages("crossing", "error")
    assert cause == Facts("left", "1 %", "0.5 mm")
    assert not list((study.results / "crossing" / "surface").glob("*thickness*"))


@pytest.mark.parametrize(
    ("name", "share"),
    [("holoprosencephaly", 1.0), ("hypoplasia", 0.51), ("hemispherectomy", 0.49)],
)
def test_pathologies_go_through_to_metrics(study, name, share):
    def sizes(brain, metric):
        table = pd.read_csv(study.results / brain / "metrics" / "metrics.csv")
        rows = table[table["metric"] == metric]
        return rows.set_index("hemisphere")["value"]

    area, volume = sizes(name, "area"), sizes(name, "volume")
    sides = {"left"} if name == "hemispherectomy" else {*SIDES}
    assert set(area.index) == {"whole"} | sides
    assert area["whole"] == pytest.approx(study.report(name)["area_cm2"]["whole"])
    whole = sizes("plain", "volume")["whole"]
    assert volume["whole"] / whole == pytest.approx(share, abs=0.04)


def test_a_study_whose_every_brain_is_refused_ends_with_its_cause(workflow):
    torn = workflow.directory / "torn.nii.gz"
    torn.write_bytes(b"torn")
    brain = {"id": "a", "week": 21, "labels": torn.name, "scheme": "binary"}
    study = {"brains": [brain], "start": "a", "folding": {"end_week": 23}}
    call = ("--keep-going", "--cores", "1", "--configfile")
    outcome = workflow.run(*call, workflow.write("study.yaml", study))
    assert outcome.returncode == 2
    assert outcome.stderr == Facts(torn)
    assert "ValueError" not in outcome.stdout + outcome.stderr
