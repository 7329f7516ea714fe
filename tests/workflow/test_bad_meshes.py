"""Meshes that are not good enough, in the real program: refused, with what is to be looked at."""

import numpy as np
import pytest
from shapes import HALF_AXES, hemisphere, moved

from gyriflow.geometry.triangles import merged
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import write_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh

from .conftest import Workflow, labelled

pytestmark = pytest.mark.slow

VOLUME_ML = 4 / 3 * np.pi * HALF_AXES.prod() / 1e3
LEFT, RIGHT = hemisphere(-1), hemisphere(1)
MESHING = {"surface_edge_mm": 4.0, "core_edge_mm": 10.0, "envelope_mm": 0.1, "max_surface_distance_mm": 1.0}
BRAIN = {"id": "apart", "week": 21, **labelled(21)}
STUDY = {"brains": [BRAIN], "start": "apart", "mesh": MESHING, "folding": {"end_week": 22}}
MESH = "results/brains/apart/mesh/brain.xdmf"
QUALITY = "results/study/mesh_quality.html"
REFUSED = "results/brains/apart/mesh/refused"


@pytest.fixture(scope="module")
def workflow(checkout_copy, tmp_path_factory):
    """A brain whose surface counts as made, of hemispheres 1 mm apart, and its mesh."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("meshes"))
    config = workflow.write("study.yaml", STUDY)
    workflow.lay_out("surface", "--configfile", config)
    write_surface(workflow.directory / "results/brains/apart/surface/pial.surf.gii", merged(LEFT, moved(RIGHT, -2.0)))
    workflow.count_as_made("surface", "--configfile", config)
    outcome = workflow.run(MESH, QUALITY, "--cores", "2", "--configfile", config)
    assert outcome.returncode == 0, outcome.stderr
    return workflow


@pytest.mark.fault(23)
def test_the_quality_of_the_mesh_is_in_the_report(workflow):
    quality = read_json(workflow.directory / "results/brains/apart/mesh/quality.json")
    assert quality["volume_mm3"] / 1e3 == pytest.approx(2 * VOLUME_ML, rel=0.05)
    assert quality["gap_mm"]["input"]["median"] == pytest.approx(1.5, abs=0.5)
    assert quality["gap_kept"] > 0.95
    assert f">{quality['tets']}<" in (workflow.directory / QUALITY).read_text()


@pytest.mark.fault(23)
@pytest.mark.promise(9)
def test_a_mesh_below_the_gates_is_refused_with_all_that_it_fails_and_can_be_looked_at(workflow):
    strict = {"min_radius_ratio": 0.9, "max_surface_distance_mm": 1e-3}
    name = workflow.write("changed.yaml", STUDY | {"mesh": MESHING | strict})
    outcome = workflow.run(MESH, "--cores", "1", "--configfile", name)
    assert outcome.returncode == 3, outcome.stderr
    assert "Traceback" not in outcome.stderr
    log = (workflow.directory / "results/brains/apart/logs/tetrahedralise.log").read_text()
    for message in (
        f"{REFUSED}/brain.xdmf: the mesh is not good enough",
        "elements with radius ratio to",
        "radius ratio at least 0.9",
        "at most 0.001 mm (mesh.max_surface_distance_mm)",
    ):
        assert message in log
        assert message in outcome.stderr
    assert not [path for path in (workflow.directory / MESH).parent.glob("*") if path.is_file()]
    quality = read_json(workflow.directory / REFUSED / "quality.json")
    assert quality["tets"] == len(read_tetrahedral_mesh(workflow.directory / REFUSED / "brain.xdmf").tets)
    assert quality["min_radius_ratio"] < 0.9
