"""Brains of clinics and labs in the real program: each ends right, or is refused with
its true cause."""

import nibabel as nib
import numpy as np
import odd_brains
import pandas as pd
import pytest
import pyvista as pv
from atlas_brains import atlas_halves
from facts import Facts
from nibabel.freesurfer.io import write_geometry
from phantoms import CENTRE_MM
from shapes import cerebrum_surface, inner, phantom, rigid, save_labels, scaling

from gyriflow.anatomy.extraction import isosurface, smooth_mask
from gyriflow.anatomy.repair import pieces
from gyriflow.geometry.triangles import TriangleMesh, flipped, transformed
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface, write_surface

from .conftest import Workflow

pytestmark = pytest.mark.slow

LABELS, AFFINE = phantom(voxel_mm=2.0)
APART = odd_brains.apart(LABELS, AFFINE)


def halves():
    """Return the surfaces of the left and the right hemisphere."""
    both = pieces(cerebrum_surface(APART, AFFINE))
    return sorted(both, key=lambda piece: piece.vertices[:, 0].mean())


def bent():
    """Return the surface of a brain whose midline is bent."""
    return cerebrum_surface(odd_brains.bent_midline(APART, AFFINE), AFFINE)


def with_polyp():
    """Return the surface of the brain with a ball of 4 mm radius on a stalk of 1 mm
    radius and 8 mm length below it."""
    mesh = cerebrum_surface(LABELS, AFFINE)
    grid = np.indices((40, 40, 60)).reshape(3, -1).T * 0.4 - [8.0, 8.0, 18.0]
    ball = np.linalg.norm(grid - [0, 0, -12.0], axis=1) < 4.0
    stalk = (
        (np.hypot(grid[:, 0], grid[:, 1]) < 1.1)
        & (grid[:, 2] > -12.0)
        & (grid[:, 2] < 4.0)
    )
    affine = scaling(
        0.4, mesh.vertices[mesh.vertices[:, 2].argmin()] - [8.0, 8.0, 18.0]
    )
    polyp = isosurface(smooth_mask((ball | stalk).reshape(40, 40, 60), 1.0), affine)
    body = pv.PolyData.from_regular_faces(
        np.array(mesh.vertices), np.array(mesh.faces, dtype=int)
    )
    part = pv.PolyData.from_regular_faces(
        np.array(polyp.vertices), np.array(polyp.faces, dtype=int)
    )
    both = body.boolean_union(part).triangulate().clean()
    return TriangleMesh(both.points, both.regular_faces)


def labelled(change=lambda labels, affine: labels, scheme="spina-bifida-atlas"):
    def made(folder, name):
        labels = change(LABELS, AFFINE)
        labels, affine = labels if isinstance(labels, tuple) else (labels, AFFINE)
        save_labels(folder / f"{name}.nii.gz", labels, affine)
        return {"labels": f"{name}.nii.gz", "scheme": scheme}

    return made


def stored_oddly(folder, name):
    """Write labels as floats with a fourth axis and two matrices, of which the
    configuration names one."""
    image = nib.Nifti1Image(LABELS[..., None].astype(np.float32), AFFINE)
    image.header.set_xyzt_units("mm")
    image.set_sform(AFFINE, code=1)
    image.set_qform(np.diag([2.0, 2.0, 2.0, 1.0]), code=2)
    nib.save(image, folder / f"{name}.nii.gz")
    return {
        "labels": f"{name}.nii.gz",
        "scheme": "spina-bifida-atlas",
        "affine_from": "sform",
    }


def in_flat_voxels(*_):
    """Return the same brain in slices of 2.4 mm, three times the voxels' edge in the
    other directions."""
    labels, affine = phantom(voxel_mm=0.8)
    return labels[1::3], affine @ np.array(
        [[3, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]
    )


def whole(surface, suffix="surf.gii"):
    """Write the surface that a function returns."""

    def made(folder, name):
        write_surface(folder / f"{name}.{suffix}", surface())
        return {"pial": f"{name}.{suffix}"}

    return made


def both_sides(pair, *, white_mm=None, coordinates="ras"):
    """Write the hemispheres that a function returns as FreeSurfer does, and white
    surfaces inside the pial ones."""

    def made(folder, name):
        entry, white = {}, []
        for side, mesh in zip(("left", "right"), pair(), strict=True):
            write_geometry(folder / f"{name}.{side}.pial", mesh.vertices, mesh.faces)
            entry[side] = f"{name}.{side}.pial"
            if white_mm is not None:
                write_surface(
                    folder / f"{name}.{side}.white.stl", inner(mesh, white_mm)
                )
                white.append(f"{name}.{side}.white.stl")
        return {"hemispheres": entry, "coordinates": coordinates} | (
            {"white": white} if white else {}
        )

    return made


def alone(side, change):
    """Write labels as the only hemisphere of a brain."""

    def made(folder, name):
        entry = labelled(change)(folder, name)
        return {
            "labels": entry["labels"],
            "side": side,
            "scheme": entry["scheme"],
        }

    return made


MOTIONS = {
    "left": rigid(100, 40, -70, shift=(30.0, 0.0, -50.0)),
    "right": rigid(-20, 130, 60, shift=(0.0, 9.0, 0.0)),
}


def posed():
    """Return the hemispheres of an atlas, inside out and each in a pose of its own."""
    moved = zip(atlas_halves(), MOTIONS.values(), strict=True)
    return [flipped(transformed(half, turn)) for half, turn in moved]


GOOD = {
    "plain": labelled(),
    "polyp": labelled(odd_brains.with_fourth_ventricle),
    "agenesis": labelled(odd_brains.without_callosum),
    "holoprosencephaly": labelled(odd_brains.holoprosencephaly),
    "wide": labelled(
        lambda labels, affine: odd_brains.wide_hemisphere(
            labels, affine, 1.35, ventricle=True
        )
    ),
    "hypoplasia": labelled(
        lambda labels, affine: odd_brains.add_sides(
            odd_brains.small_hemisphere(labels, affine), affine
        ),
        "dhcp-19",
    ),
    "shifted": labelled(odd_brains.shifted_midline),
    "cropped": labelled(odd_brains.crop),
    "pial_ply": whole(with_polyp, "ply"),
    "freesurfer": both_sides(halves, white_mm=1.5),
    "bent": whole(bent),
    "posed": both_sides(posed, coordinates="auto"),
    # what else is read as it is meant, or refused: tests/unit/io/test_volumes.py
    "stored_oddly": stored_oddly,
    "flat": labelled(in_flat_voxels),
    "own_scheme": lambda folder, name: (
        labelled(scheme="mine")(folder, name) | {"week": 24.5}
    ),
}
MINE = {
    "cerebrum": [1, 2, 5, 6, 8],
    "cortex": [5],
    "known": {3: "cerebellum", 4: "CSF", 7: "brainstem"},
}
BAD = {
    "small_half": (labelled(odd_brains.small_hemisphere), ["volume", 0.5]),
    "whole_as_half": (alone("right", lambda labels, affine: labels), [0.56]),
    "pial_half": (whole(lambda: halves()[0]), ["surface", 0.5]),
    "swapped": (both_sides(lambda: halves()[::-1]), ["left", "right", "x =", "ras"]),
}
NAMED = ("holoprosencephaly", "wide", "hypoplasia", "hemispherectomy")
"""The pathologies that go on to metrics."""
REFUSED = list(BAD)
HEMISPHERECTOMY = alone("left", odd_brains.one_hemisphere)
CROSSING = both_sides(halves, white_mm=-1.5)


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over all of them."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("any"))
    makers = (
        GOOD | {name: make for name, (make, _) in BAD.items()} | {"crossing": CROSSING}
    )
    makers["hemispherectomy"] = HEMISPHERECTOMY
    brains = [
        {"id": name, "week": 24} | make(workflow.directory, name)
        for name, make in makers.items()
    ]
    surface = {"edge_length_mm": 2.5, "asymmetric": True}
    metrics = {"curvature_radius_mm": 7.0, "spangy_modes": 50}
    config = {
        "schemes": {"mine": MINE},
        "brains": brains,
        "start": "plain",
        "folding": {"end_week": 25},
    }
    config |= {"surface": surface, "metrics": metrics}
    measured = ("freesurfer", "crossing", "own_scheme")
    thickness = [
        f"results/brains/{name}/surface/thickness.shape.gii" for name in measured
    ]
    return workflow.surfaces(config, *thickness)


@pytest.fixture(scope="module")
def measuring(checkout_copy, study):
    """The metrics of pathologies."""
    tables = [
        f"results/brains/{name}/metrics/metrics.csv" for name in ("plain", *NAMED)
    ]
    run = Workflow(checkout_copy, study.directory).run
    return run(*tables, "--cores", "2", "--configfile", "study.yaml", timeout_s=600)


# what is said of brains that are used all the same
WARNED = {
    "polyp": Facts("mL", "stalk"),
    "pial_ply": Facts("mm³", "stalk", "mm²"),
    "wide": Facts("areas", "%"),
    "cropped": Facts("border", "%"),
    "hypoplasia": Facts("areas", "%"),
}
WARNINGS = ("polyp", "pial_ply", "wide", "cropped", "hypoplasia")


def cerebrum_ml(labels):
    return np.isin(labels, odd_brains.CEREBRUM).sum() * 2.0**3 / 1e3


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_refused_with_its_cause_and_nothing_is_left(study, name):
    study.require_exit_code(2)
    study.require_refused(name, *BAD[name][1])


@pytest.mark.parametrize("name", GOOD)
def test_each_hemisphere_is_one_piece_on_its_side(study, name):
    folder = study.results / name / "surface"
    left, right = (
        read_surface(folder / f"{side}.pial.surf.gii") for side in ("left", "right")
    )
    assert len(pieces(left)) == len(pieces(right)) == 1
    report = study.report(name)
    assert (
        left.vertices[:, 0].mean()
        < report["fissure_x_mm"]
        < right.vertices[:, 0].mean()
    )
    # found by their shapes, as the configuration asks for
    assert report["pose"]["together"] == (name != "posed")


@pytest.mark.parametrize("name", WARNINGS)
def test_what_is_doubtful_is_reported(study, name):
    assert WARNED[name] in study.report(name)["warnings"]
    assert WARNED[name] in study.messages(name, "warning")
    assert WARNED[name] not in study.report("plain")["warnings"]


@pytest.mark.parametrize("name", ["stored_oddly", "flat"])
def test_a_brain_is_the_same_however_it_is_stored(study, name):
    sizes, expected = (
        [*report["area_cm2"].values(), report["volume_mL"]]
        for report in map(study.report, (name, "plain"))
    )
    np.testing.assert_allclose(sizes, expected, rtol=0.06 if name == "flat" else 0.005)
    warned = "\n".join(study.messages(name, "warning"))
    assert (warned == Facts("flat.nii.gz:", "2.4 x 0.8 x 0.8 mm")) == (name == "flat")
    assert "2 x 2 x 2" not in "\n".join(study.messages("plain", "warning"))


def test_labels_of_a_user_s_scheme_give_a_surface_with_its_thickness_at_its_week(
    study,
):
    report = study.report("own_scheme")
    assert (report["week"], report["scheme"], report["euler_number"]) == (
        24.5,
        "mine",
        2,
    )
    assert abs(report["smoothing"]["volume_change"]) < 0.01
    (thickness,) = nib.load(
        study.results / "own_scheme" / "surface" / "thickness.shape.gii"
    ).darrays
    assert len(thickness.data) == report["vertices"]


def test_what_hangs_below_the_brain_is_left_out(study):
    polyp, plain = study.report("polyp"), study.report("plain")
    assert polyp["outside"]["ventricles_mL"] > 0.4
    assert polyp["volume_mL"] == pytest.approx(plain["volume_mL"], rel=0.005)
    assert polyp["extents_mm"][2] == pytest.approx(plain["extents_mm"][2], abs=1.0)
    assert len(study.report("pial_ply")["stalks"]) == 1


def test_missing_tissues_are_named_and_a_missing_fissure_is_cut(study):
    assert study.report("agenesis")["missing_tissues"] == ["8 corpus callosum"]
    found, plain = study.report("holoprosencephaly"), study.report("plain")
    assert found["volume_mL"] == pytest.approx(
        cerebrum_ml(odd_brains.holoprosencephaly(LABELS, AFFINE)), rel=0.01
    )
    area = found["area_cm2"]
    # in front, each side is what is nearer to its own tissue
    assert area["left"] == pytest.approx(area["right"], rel=0.05)
    # the walls of the fissure in front are not there
    assert area["whole"] / plain["area_cm2"]["whole"] == pytest.approx(0.93, abs=0.02)


@pytest.mark.parametrize("name", ["wide", "cropped"])
def test_all_of_the_cerebrum_that_is_there_counts(study, name):
    made = {
        "wide": lambda: odd_brains.wide_hemisphere(
            LABELS, AFFINE, 1.35, ventricle=True
        ),
        "cropped": lambda: odd_brains.crop(LABELS, AFFINE)[0],
    }
    assert study.report(name)["volume_mL"] == pytest.approx(
        cerebrum_ml(made[name]()), rel=0.01
    )


def test_a_midline_that_bends_or_is_shifted_is_followed(study):
    bent, shifted = (study.report(name)["area_cm2"] for name in ("bent", "shifted"))
    assert bent["left"] == pytest.approx(bent["right"], rel=0.1)
    assert shifted["left"] > 1.2 * shifted["right"]
    assert study.report("shifted")["fissure_x_mm"] == pytest.approx(
        CENTRE_MM[0] + 8.0, abs=2.5
    )


def test_thickness_is_the_distance_to_white_surfaces(study):
    found = read_json(study.results / "freesurfer" / "surface" / "thickness.json")
    assert found["mean_mm"] == pytest.approx(1.5, abs=0.15)


def test_white_surfaces_outside_the_pial_ones_are_refused(study):
    (cause,) = study.messages("crossing", "error")
    assert cause == Facts("left", "1 %", "0.5 mm")
    assert not list((study.results / "crossing" / "surface").glob("*thickness*"))


@pytest.mark.parametrize("name", NAMED)
def test_pathologies_go_through_to_metrics(study, measuring, name):
    assert measuring.returncode == 0, measuring.stderr
    tables = [
        pd.read_csv(study.results / brain / "metrics" / "metrics.csv")
        for brain in (name, "plain")
    ]
    found, plain = (
        table.set_index(["hemisphere", "metric"])["value"] for table in tables
    )
    sides = (
        {"whole", "left"} if name == "hemispherectomy" else {"whole", "left", "right"}
    )
    assert set(found.index.get_level_values("hemisphere")) == sides
    assert found["whole", "area"] == pytest.approx(
        study.report(name)["area_cm2"]["whole"], rel=1e-6
    )
    ratio = {"hypoplasia": 0.51, "hemispherectomy": 0.49, "wide": 1.16}.get(name, 1.0)
    assert found["whole", "volume"] / plain["whole", "volume"] == pytest.approx(
        ratio, abs=0.04
    )


def test_a_study_whose_every_brain_is_refused_ends_with_the_cause_of_each(workflow):
    save_labels(workflow.directory / "whole.nii.gz", LABELS, AFFINE)
    whole = (workflow.directory / "whole.nii.gz").read_bytes()
    (workflow.directory / "torn.nii.gz").write_bytes(whole[: len(whole) // 2])
    brain = {"id": "a", "week": 21, "labels": "torn.nii.gz", "scheme": "binary"}
    name = workflow.write(
        "study.yaml", {"brains": [brain], "start": "a", "folding": {"end_week": 23}}
    )
    # a user's; tables of an earlier run go: test_snakemake_internals.py
    table = workflow.directory / "results" / "study" / "volumes.csv"
    table.parent.mkdir(parents=True)
    table.touch()
    outcome = workflow.run("--keep-going", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 2
    assert outcome.stderr == Facts(workflow.directory / "torn.nii.gz")
    assert table.exists()
    assert "ValueError" not in outcome.stdout + outcome.stderr
