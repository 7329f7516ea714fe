"""Matched surfaces with the real commands: their correspondence, where it is known."""

import numpy as np
import odd_brains
import pytest
from shapes import LPS, cerebrum_surface, phantom, rigid

from gyriflow.anatomy.repair import pieces
from gyriflow.geometry.alignment import without_rigid_motion
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import read_json
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_pose, write_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.settings.terms import SIDES

from .conftest import COARSE

WEEKS = (21, 22, 23)
FASTER_PER_MM = 0.002
"""How the growth of length from back to front differs from place to place, per week."""
STUDY = {
    "start": "b21",
    "surface": {"edge_length_mm": 2.5},
    "mesh": COARSE | {"surface_edge_mm": 2.5},
    "folding": {
        "end_week": 23,
        "thickness_mm": 4.0,
        "step_s": 302400,
        "preset": "measured",
    },
    "metrics": {"curvature_radius_mm": 6, "spangy_modes": 60},
}
# files of one study are in unlike poses, as those of some programs are
POSES = {21: np.eye(4), 22: LPS, 23: rigid(4, -3, 5, shift=(30.0, -20.0, 10.0))}


def grown(points: np.ndarray, week: int) -> np.ndarray:
    """Return where places of week 21 are in another week: a harmonic displacement, so
    that the inside is known too."""
    weeks = week - 21
    x, y, z = points.T
    faster = FASTER_PER_MM * weeks * (y**2 - x**2) / 2
    return np.stack(
        [1.04**weeks * x, 1.04**weeks * y + faster, 1.02**weeks * z], axis=1
    )


@pytest.fixture(scope="module")
def hemispheres() -> dict[str, TriangleMesh]:
    """Closed hemispheres of a phantom of week 21, about its centre."""
    labels, affine = phantom(21.0, 2.0)
    brain = cerebrum_surface(odd_brains.apart(labels, affine), affine)
    centre = brain.vertices.mean(axis=0)
    sides = sorted(pieces(brain), key=lambda piece: piece.vertices[:, 0].mean())
    return {
        side: TriangleMesh(mesh.vertices - centre, mesh.faces)
        for side, mesh in zip(SIDES, sides, strict=True)
    }


def write_study(workflow, hemispheres, kind="hemispheres") -> str:
    """Write the surfaces of all weeks and their study."""
    brains = []
    for week in WEEKS:
        files = {}
        for side, mesh in hemispheres.items():
            vertices = transform_points(grown(mesh.vertices, week), POSES[week])
            faces = mesh.faces
            # the order of corners is the other one in one of the weeks
            faces = faces[::-1, ::-1] if week == 22 else faces
            files[side] = f"week{week}.{side}.surf.gii"
            write_surface(
                workflow.directory / files[side], TriangleMesh(vertices, faces)
            )
        one = {"pial": files["left"], "side": "left"}
        source = {"hemispheres": files} if kind == "hemispheres" else one
        brains.append(
            {
                "id": f"b{week}",
                "week": week,
                **source,
                "coordinates": "lps" if week == 22 else "ras",
            }
        )
    return workflow.write("study.yaml", STUDY | {"brains": brains})


def in_week_21(results, points: np.ndarray) -> np.ndarray:
    """Return the places of mesh points in the files of week 21, by the motion of their
    hemisphere."""
    path = results / "brains/b21/surface/surface.json"
    pose = read_pose(path)
    left, right = (
        transform_points(points, np.linalg.inv(pose.of_file(side))) for side in SIDES
    )
    return np.where(points[:, :1] < read_json(path)["fissure_x_mm"], left, right)


@pytest.mark.slow
@pytest.mark.extended
def test_the_mesh_goes_where_the_surface_goes(workflow, hemispheres):
    name = write_study(workflow, hemispheres)
    outcome = workflow.run(
        "results/brains/b21/mesh/targets.self.h5", "--cores", "2", "--configfile", name
    )
    assert outcome.returncode == 0, outcome.stderr[-3000:]
    results = workflow.directory / "results"
    mesh = read_tetrahedral_mesh(results / "brains/b21/mesh/brain.xdmf")
    targets = read_weekly_shapes(results / "brains/b21/mesh/targets.self.h5")
    places = in_week_21(results, mesh.vertices)
    # where the surface goes, whatever the pose of the files
    pial = boundary_surface(mesh)[1]
    moved, wanted = targets.positions[targets.index(23)][pial], grown(places[pial], 23)
    away = without_rigid_motion(wanted, moved, np.ones(len(pial)))
    assert np.linalg.norm(wanted - places[pial], axis=1).mean() > 1
    assert np.linalg.norm(away, axis=1).mean() < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hemispheres", "hemisphere"])
def test_matched_vertices_take_the_place_of_registration(workflow, hemispheres, kind):
    jobs = workflow.jobs(
        "all", "validate", "--configfile", write_study(workflow, hemispheres, kind)
    )
    assert [jobs[rule] for rule in ("match_surfaces", "targets", "validation")] == [
        2,
        1,
        1,
    ]
    assert "register" not in jobs
