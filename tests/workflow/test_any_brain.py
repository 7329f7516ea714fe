"""Brains of clinics and labs in the real program: each ends right, or is refused with its true cause.

By what may be odd about a brain:

1. Closed hemispheres beside a midline that bends: `bent`, `freesurfer`, `shifted`.
2. Matrices of GIFTI files: `talairach`; test_bad_hemispheres.py, `placed`; tests/unit/io/test_surfaces.py.
3. Missing tissues: `agenesis`, `holoprosencephaly`.
4. Front and back, up and down: `upside_down`, `backwards`; tests/unit/anatomy/test_brain_pose.py.
5. One hemisphere: `small_half`, `pial_half`, `hypoplasia`, `whole_as_half`; test_cohort.py to the end.
6. Poses: test_bad_hemispheres.py; tests/unit/anatomy/test_posing.py; benchmarks/orientation.py.
7. Losses: `cropped`, `polyp`, `pial_vtk`.
8. Asymmetry: `wide`, `unequal`, `hypoplasia`, `shifted`.
9. Formats: `freesurfer`, `pial_vtk`; tests/unit/io/test_volumes.py.
10. White surfaces: `freesurfer`, `crossing`.
11. Quality control: test_cohort.py; tests/unit/report/test_report_quality.py.
12. A cohort: test_cohort.py.
"""

import numpy as np
import odd_brains
import pandas as pd
import pytest
import pyvista as pv
from nibabel.freesurfer.io import write_geometry
from phantoms import CENTRE_MM
from reliability import trying
from shapes import cerebrum_surface, phantom, rigid, save_gifti, save_labels

from gyriflow.anatomy.extraction import isosurface, smooth_mask
from gyriflow.anatomy.repair import pieces
from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.triangles import TriangleMesh, transformed, vertex_normals
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface, read_vertex_maps, write_surface

from .conftest import Workflow

pytestmark = pytest.mark.slow

LABELS, AFFINE = phantom(voxel_mm=2.0)
WHOLE = cerebrum_surface(LABELS, AFFINE)
APART = odd_brains.apart(LABELS, AFFINE)
LEFT, RIGHT = sorted(pieces(cerebrum_surface(APART, AFFINE)), key=lambda piece: piece.vertices[:, 0].mean())


def inner(mesh, depth_mm):
    return TriangleMesh(mesh.vertices - depth_mm * vertex_normals(mesh), mesh.faces)


def with_polyp(mesh):
    """Returns the surface with a ball of 4 mm radius on a stalk of 1 mm radius and 8 mm length below it."""
    grid = np.indices((40, 40, 60)).reshape(3, -1).T * 0.4 - [8.0, 8.0, 18.0]
    ball = np.linalg.norm(grid - [0, 0, -12.0], axis=1) < 4.0
    stalk = (np.hypot(grid[:, 0], grid[:, 1]) < 1.1) & (grid[:, 2] > -12.0) & (grid[:, 2] < 4.0)
    affine = np.diag([0.4, 0.4, 0.4, 1.0])
    lowest = mesh.vertices[mesh.vertices[:, 2].argmin()]
    affine[:3, 3] = lowest - [8.0, 8.0, 18.0]
    polyp = isosurface(smooth_mask((ball | stalk).reshape(40, 40, 60), 1.0), affine)
    body = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=int))
    part = pv.PolyData.from_regular_faces(np.array(polyp.vertices), np.array(polyp.faces, dtype=int))
    both = body.boolean_union(part).triangulate().clean()
    return TriangleMesh(both.points, both.regular_faces)


def labelled(change=lambda labels, affine: labels, scheme="spina-bifida-atlas", turn=None):
    def made(folder, name):
        labels = change(LABELS, AFFINE)
        labels, affine = labels if isinstance(labels, tuple) else (labels, AFFINE)
        save_labels(folder / f"{name}.nii.gz", labels, affine if turn is None else turn @ affine)
        return {"labels": f"{name}.nii.gz", "scheme": scheme}

    return made


def whole(mesh, suffix="surf.gii", **more):
    def made(folder, name):
        if suffix == "vtk":
            body = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=int))
            body.save(folder / f"{name}.vtk")
        else:
            write_surface(folder / f"{name}.{suffix}", mesh)
        return {"pial": f"{name}.{suffix}"} | more

    return made


def both_sides(left, right, *, white_mm=None, **more):
    """Writes hemispheres as FreeSurfer does, and white surfaces inside the pial ones."""

    def made(folder, name):
        entry = {}
        for side, mesh in (("left", left), ("right", right)):
            write_geometry(folder / f"{name}.{side}.pial", mesh.vertices, mesh.faces)
            entry[side] = f"{name}.{side}.pial"
            if white_mm is not None:
                write_surface(folder / f"{name}.{side}.white.stl", inner(mesh, white_mm))
                entry.setdefault("white", {})[side] = f"{name}.{side}.white.stl"
        return {"hemispheres": entry, "coordinates": "ras"} | more

    return made


def with_matrix(mesh, data, to, matrix):
    """Writes a surface whose file has a matrix from one space to another."""

    def made(folder, name):
        save_gifti(folder / f"{name}.surf.gii", mesh, matrix, data, to)
        return {"pial": f"{name}.surf.gii"}

    return made


def alone(side, change):
    """Writes labels as the only hemisphere of a brain."""

    def made(folder, name):
        entry = labelled(change)(folder, name)
        return {"hemisphere": {"file": entry["labels"], "side": side}, "scheme": entry["scheme"]}

    return made


LARGER = transformed(RIGHT, np.diag([1.09, 1.09, 1.09, 1.0]))
GOOD = {
    "plain": labelled(),
    "polyp": labelled(odd_brains.with_fourth_ventricle),
    "agenesis": labelled(odd_brains.without_callosum),
    "holoprosencephaly": labelled(odd_brains.holoprosencephaly),
    "wide": labelled(lambda labels, affine: odd_brains.wide_hemisphere(labels, affine, ventricle=True)),
    "hypoplasia": labelled(
        lambda labels, affine: odd_brains.add_sides(odd_brains.small_hemisphere(labels, affine), affine), "dhcp-19"
    ),
    "shifted": labelled(odd_brains.shifted_midline),
    "hemimegalencephaly": labelled(odd_brains.wide_hemisphere),
    "cropped": labelled(odd_brains.crop),
    "upside_down": labelled(turn=rigid(180, 0, 0)),
    "backwards": labelled(odd_brains.add_sides, "dhcp-19", rigid(0, 0, 180)),
    "pial_vtk": whole(with_polyp(WHOLE), "vtk"),
    "freesurfer": both_sides(LEFT, RIGHT, white_mm=1.5),
    "unequal": both_sides(LEFT, LARGER),
    "bent": whole(cerebrum_surface(odd_brains.bent_midline(APART, AFFINE), AFFINE)),
    "talairach": with_matrix(WHOLE, "UNKNOWN", "TALAIRACH", np.diag([1.16, 1.16, 1.16, 1.0])),
}
BAD = {
    "small_half": (labelled(odd_brains.small_hemisphere), "the volume seems to hold one hemisphere only"),
    "whole_as_half": (alone("right", lambda labels, affine: labels), "this is no single hemisphere"),
    "pial_half": (whole(LEFT), "the surface seems to be one hemisphere only"),
}
NAMED = ("agenesis", "holoprosencephaly", "wide", "hypoplasia", "shifted", "hemimegalencephaly", "hemispherectomy")
"""The pathologies that go on to metrics."""
REFUSED = trying(dict.fromkeys(BAD, 41))
HEMISPHERECTOMY = alone("left", odd_brains.one_hemisphere)
CROSSING = both_sides(LEFT, RIGHT, white_mm=-1.5)


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over all of them."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("any"))
    makers = GOOD | {name: make for name, (make, _) in BAD.items()} | {"crossing": CROSSING}
    makers["hemispherectomy"] = HEMISPHERECTOMY
    brains = [{"id": name, "week": 24} | make(workflow.directory, name) for name, make in makers.items()]
    surface = {"edge_length_mm": 2.5, "max_hemisphere_ratio": 1.4, "max_asymmetry": 0.05}
    metrics = {"curvature_radius_mm": 7.0, "spangy_modes": 50}
    config = {"brains": brains, "start": "plain", "surface": surface, "metrics": metrics, "folding": {"end_week": 25}}
    thickness = [f"results/brains/{name}/surface/thickness.shape.gii" for name in ("freesurfer", "crossing")]
    return workflow.surfaces(config, *thickness)


@pytest.fixture(scope="module")
def measuring(checkout_copy, study):
    """The metrics of pathologies."""
    tables = [f"results/brains/{name}/metrics/metrics.csv" for name in ("plain", *NAMED)]
    run = Workflow(checkout_copy, study.directory).run
    return run(*tables, "--cores", "2", "--configfile", "study.yaml", timeout_s=600)


def warned(study, name, text):
    return any(text in warning for warning in study.report(name)["warnings"]) and text in study.log(name)


def test_the_run_ends_in_2_without_a_traceback(study):
    study.require_exit_code(2)


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_refused_with_its_cause_and_nothing_is_left(study, name):
    study.require_refused(name, BAD[name][1])


@pytest.mark.parametrize("name", GOOD)
def test_each_hemisphere_is_one_piece_on_its_side(study, name):
    folder = study.results / name / "surface"
    left, right = (read_surface(folder / f"{side}.pial.surf.gii") for side in ("left", "right"))
    assert len(pieces(left)) == len(pieces(right)) == 1
    assert left.vertices[:, 0].mean() < study.report(name)["fissure_x_mm"] < right.vertices[:, 0].mean()


@pytest.mark.fault(46)
def test_a_fourth_ventricle_below_the_brain_is_left_out_and_told(study):
    polyp, plain = study.report("polyp"), study.report("plain")
    assert polyp["outside"]["ventricles_mL"] > 0.4
    assert polyp["volume_mL"] == pytest.approx(plain["volume_mL"], rel=0.005)
    assert polyp["extents_mm"][2] == pytest.approx(plain["extents_mm"][2], abs=1.0)
    assert warned(study, "polyp", "lie outside it or hang on a thin stalk: left out")


def test_tissues_and_ventricles_are_told_apart(study):
    volumes = study.report("plain")["label_volumes_mL"]
    assert volumes["cerebrum"] == pytest.approx(volumes["tissue"] + volumes["ventricles"])
    assert volumes["tissue"] == pytest.approx(volumes["cortex"] + volumes["inside_cortex"])
    voxel_ml = 2.0**3 / 1e3
    assert volumes["ventricles"] == pytest.approx((LABELS == 2).sum() * voxel_ml)


@pytest.mark.fault(46)
def test_a_polyp_of_a_surface_is_cut_and_told(study):
    assert len(study.report("pial_vtk")["stalks"]) == 1
    assert warned(study, "pial_vtk", "hung on a stalk")


@pytest.mark.fault(47)
def test_missing_tissues_are_named_and_not_required(study):
    assert study.report("agenesis")["missing_tissues"] == ["8 corpus callosum"]
    assert study.report("agenesis")["pieces"] == 1


def cerebrum_ml(labels):
    return np.isin(labels, odd_brains.CEREBRUM).sum() * 2.0**3 / 1e3


@pytest.mark.fault(47)
def test_a_brain_without_a_fissure_in_front_is_cut_in_halves(study):
    found, plain = study.report("holoprosencephaly"), study.report("plain")
    assert found["volume_mL"] == pytest.approx(cerebrum_ml(odd_brains.holoprosencephaly(LABELS, AFFINE)), rel=0.01)
    area = found["area_cm2"]
    assert area["left"] == pytest.approx(area["right"], rel=0.03)
    # the walls of the fissure in front are not there
    assert area["whole"] / plain["area_cm2"]["whole"] == pytest.approx(0.94, abs=0.02)
    assert found["label_volumes_mL"]["ventricles"] > 2.5 * plain["label_volumes_mL"]["ventricles"]


@pytest.mark.fault(52)
def test_a_wide_ventricle_counts_as_brain_and_its_side_is_doubted(study):
    found = study.report("wide")
    labels = odd_brains.wide_hemisphere(LABELS, AFFINE, ventricle=True)
    assert found["volume_mL"] == pytest.approx(cerebrum_ml(labels), rel=0.01)
    assert found["label_volumes_mL"]["ventricles"] == pytest.approx((labels == 2).sum() * 2.0**3 / 1e3)
    assert found["area_cm2"]["right"] / found["area_cm2"]["left"] == pytest.approx(1.16, abs=0.02)
    assert warned(study, "wide", "the hemispheres' areas differ by 1")


@pytest.mark.fault(48)
def test_a_field_of_view_that_cuts_the_brain_is_warned_of(study):
    assert warned(study, "cropped", "the cerebrum touches the border of the volume")
    cropped, plain = study.report("cropped"), study.report("plain")
    assert cropped["volume_mL"] == pytest.approx(cerebrum_ml(odd_brains.crop(LABELS, AFFINE)[0]), rel=0.01)
    assert cropped["volume_mL"] / plain["volume_mL"] == pytest.approx(0.81, abs=0.02)
    # a third of the height is lost
    assert cropped["extents_mm"][2] / plain["extents_mm"][2] == pytest.approx(0.68, abs=0.03)
    assert not any("border" in warning for warning in study.report("plain")["warnings"])


@pytest.mark.fault(49)
@pytest.mark.parametrize("name", ["upside_down", "backwards"])
def test_turned_volumes_are_turned_back(study, name):
    surface, plain = (read_surface(study.results / n / "surface" / "pial.surf.gii") for n in (name, "plain"))
    turned, middle = np.array(study.report(name)["pose"]["world"])[:3, :3], plain.vertices.mean(axis=0)
    expected = {"upside_down": rigid(180, 0, 0), "backwards": rigid(0, 0, 180)}[name]
    assert angle_deg(turned @ expected[:3, :3]) < 2.0
    for end in (np.min, np.max):
        there = end(surface.vertices - surface.vertices.mean(axis=0), axis=0)
        np.testing.assert_allclose(there, end(plain.vertices - middle, axis=0), atol=1.5)
    assert warned(study, name, "the brain was turned by 180°")


@pytest.mark.fault(50)
def test_matrices_that_lead_away_from_the_subject_are_not_applied_and_told(study):
    found, plain = study.report("talairach"), study.report("plain")
    assert found["volume_mL"] == pytest.approx(plain["volume_mL"], rel=0.03)
    assert found["fissure_x_mm"] == pytest.approx(plain["fissure_x_mm"], abs=0.5)
    assert "was not applied" in study.log("talairach")


@pytest.mark.fault(51)
def test_a_midline_that_bends_leaves_closed_hemispheres_whole(study):
    area = study.report("bent")["area_cm2"]
    assert area["left"] == pytest.approx(area["right"], rel=0.1)


@pytest.mark.fault(53)
def test_thickness_is_the_distance_to_white_surfaces(study):
    found = read_json(study.results / "freesurfer" / "surface" / "thickness.json")
    assert found["mean_mm"] == pytest.approx(1.5, abs=0.15)
    (values,) = read_vertex_maps(study.results / "freesurfer" / "surface" / "thickness.shape.gii").values()
    assert len(values) == study.report("freesurfer")["vertices"]


@pytest.mark.fault(45)
def test_white_surfaces_outside_the_pial_ones_are_refused(study):
    folder = study.results / "crossing"
    assert "crosses the pial one" in study.log("crossing", "thickness_from_white")
    assert "crosses the pial one" in study.outcome.stderr
    assert not list((folder / "surface").glob("*thickness*"))


@pytest.mark.fault(52)
def test_unequal_hemispheres_within_the_limits_asked_for_are_doubted(study):
    assert warned(study, "unequal", "the hemispheres' volumes differ by")


@pytest.mark.fault(52)
def test_a_small_hemisphere_that_labels_name_is_kept_and_doubted(study):
    assert warned(study, "hypoplasia", "the hemispheres' areas differ by")
    area = study.report("hypoplasia")["area_cm2"]
    assert 0.1 < area["right"] / area["left"] < 0.4


@pytest.mark.fault(51)
def test_a_shifted_midline_is_followed(study):
    area = study.report("shifted")["area_cm2"]
    assert area["left"] > 1.2 * area["right"]
    assert study.report("shifted")["fissure_x_mm"] == pytest.approx(CENTRE_MM[0] + 8.0, abs=2.5)


@pytest.mark.parametrize("name", NAMED)
def test_pathologies_go_through_to_metrics(study, measuring, name):
    assert measuring.returncode == 0, measuring.stderr
    tables = [pd.read_csv(study.results / brain / "metrics" / "metrics.csv") for brain in (name, "plain")]
    found, plain = (table.set_index(["hemisphere", "metric"])["value"] for table in tables)
    sides = {"whole", "left"} if name == "hemispherectomy" else {"whole", "left", "right"}
    assert set(found.index.get_level_values("hemisphere")) == sides
    # so few modes complete no relative power, and no band beyond B2
    measured = ~found.index.get_level_values("metric").str.startswith("spangy")
    assert np.isfinite(found[measured]).all()
    assert found["whole", "volume"] == pytest.approx(study.report(name)["volume_mL"], rel=1e-6)
    assert found["whole", "area"] == pytest.approx(study.report(name)["area_cm2"]["whole"], rel=1e-6)
    assert found["whole", "crossing_faces"] == 0
    ratio = {"hypoplasia": 0.51, "hemispherectomy": 0.49, "wide": 1.16, "hemimegalencephaly": 1.16}.get(name, 1.0)
    assert found["whole", "volume"] / plain["whole", "volume"] == pytest.approx(ratio, abs=0.04)
