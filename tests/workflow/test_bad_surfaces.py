"""Broken surfaces of hemispheres in the real program: mended and reported, or refused with nothing left."""

import numpy as np
import pytest
from shapes import HALF_AXES, hemisphere, save_gifti

from gyriflow.anatomy.extraction import isosurface, smooth_mask
from gyriflow.anatomy.repair import pieces
from gyriflow.geometry.remeshing import self_intersecting_faces
from gyriflow.geometry.triangles import TriangleMesh, euler_number, is_closed, signed_volume
from gyriflow.io.surfaces import read_surface

from .conftest import Workflow

pytestmark = pytest.mark.slow

VOLUME_ML = 4 / 3 * np.pi * HALF_AXES.prod() / 1e3
LEFT, RIGHT = hemisphere(-1), hemisphere(1)


def without(mesh, faces):
    return TriangleMesh(mesh.vertices, mesh.faces[~faces])


def with_more(mesh, vertices, faces):
    return TriangleMesh(np.vstack([mesh.vertices, vertices]), np.vstack([mesh.faces, faces]))


def holed():
    """Returns the left hemisphere without the faces of its leftmost vertex."""
    return without(LEFT, (LEFT.faces == LEFT.vertices[:, 0].argmin()).any(axis=1))


def with_a_fin():
    a, b = RIGHT.faces[0, :2]
    return with_more(RIGHT, RIGHT.vertices[[a]] * 1.02, [[a, b, len(RIGHT.vertices)]])


def partly_turned():
    faces = LEFT.faces.copy()
    faces[100:300] = faces[100:300, ::-1]
    return TriangleMesh(LEFT.vertices, faces)


def tangled():
    """Returns the right hemisphere with its uppermost vertex pushed through its base."""
    vertices = RIGHT.vertices.copy()
    vertices[vertices[:, 2].argmax(), 2] = -20.0
    return TriangleMesh(vertices, RIGHT.faces)


def pierced(side):
    """Returns a hemisphere through which a tunnel of 4 mm leads from top to bottom."""
    voxel_mm = 1.0
    middle = np.array([14, 27, 19])
    place = (np.stack(np.indices(2 * middle + 1), axis=-1) - middle) * voxel_mm
    mask = ((place / HALF_AXES) ** 2).sum(axis=-1) < 1
    mask &= np.hypot(place[..., 0], place[..., 1]) > 2.0
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = [12.5 * side, 0.0, 0.0] - middle * voxel_mm
    return isosurface(smooth_mask(mask, 0.7), affine)


GAPING = without(LEFT, LEFT.vertices[LEFT.faces][:, :, 2].max(axis=1) > 10.0)
# brains that are mended
GOOD = {
    "open": (holed, with_a_fin),
    "tangled": (partly_turned, tangled),
    "pierced": (lambda: pierced(-1), lambda: pierced(1)),
}
STUDY = {
    "brains": [
        {
            "id": name,
            "week": 21,
            "coordinates": "ras",
            "hemispheres": {"left": f"{name}.l.gii", "right": f"{name}.r.gii"},
        }
        for name in (*GOOD, "gaping")
    ],
    "start": "open",
    "surface": {"edge_length_mm": 3.0, "max_hole_mm": 5.0},
    "folding": {"end_week": 22},
}


@pytest.fixture(scope="module")
def study(checkout_copy, tmp_path_factory):
    """One run of the surface stage over broken hemispheres."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("broken"))
    for name, (left, right) in (GOOD | {"gaping": (lambda: GAPING, lambda: RIGHT)}).items():
        save_gifti(workflow.directory / f"{name}.l.gii", left())
        save_gifti(workflow.directory / f"{name}.r.gii", right())
    return workflow.surfaces(STUDY)


def repairs(study, name):
    """Returns what the report says of both hemispheres, without what did not occur, and the whole report."""
    report = study.report(name)
    sides = [{key: n for key, n in report[f"repair_{side}"].items() if n} for side in ("left", "right")]
    return *sides, report


@pytest.mark.parametrize("name", GOOD)
def test_a_mended_brain_is_two_closed_outward_spheres_of_its_size(study, name):
    surface = read_surface(study.results / name / "surface" / "pial.surf.gii")
    assert is_closed(surface)
    assert not self_intersecting_faces(surface).any()
    assert [euler_number(piece) for piece in pieces(surface)] == [2, 2]
    for piece in pieces(surface):
        assert signed_volume(piece) / 1e3 == pytest.approx(VOLUME_ML, rel=0.05)


@pytest.mark.fault(17)
def test_a_broken_surface_is_refused_with_a_message_and_nothing_is_left(study):
    study.require_exit_code(3)
    said = "the surface has holes that are too large to close; found 1 of 1 holes, up to 3"
    study.require_refused("gaping", f"gaping.l.gii, {study.directory / 'gaping'}.r.gii: {said}")


@pytest.mark.fault(17, 18)
def test_a_small_hole_and_a_non_manifold_edge_are_mended_and_reported(study):
    left, right, _ = repairs(study, "open")
    assert left.pop("largest_hole_mm") == pytest.approx(3.2, abs=0.1)
    assert left == {"pieces": 1, "holes_closed": 1}
    assert right == {"pieces": 1, "non_manifold_edges_opened": 1}


@pytest.mark.fault(19, 20)
def test_faces_that_disagree_or_cut_others_are_counted(study):
    left, right, _ = repairs(study, "tangled")
    assert left == {"pieces": 1, "faces_turned_to_agree": 200}
    # the needle's faces and those of the base around it
    assert 6 < right["faces_that_cut_others"] < 20


@pytest.mark.fault(21)
def test_a_handle_of_each_hemisphere_is_closed_and_reported(study):
    *_, report = repairs(study, "pierced")
    assert report["euler_number"] == 4
    for side in ("left", "right"):
        assert report[f"remade_{side}"]["tunnels_filled"] == 1
        assert report[f"remade_{side}"]["handles_left"] == 0
    assert sum("rebuilt through voxels, since it had Euler numbers [0]" in text for text in report["warnings"]) == 2
