"""Brains that cannot be solved as they are clamped, in the real program: refused before the solve, or warned of."""

import numpy as np
import pytest
from shapes import HALF_AXES, ellipsoid_mesh, hemisphere

from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import write_surface
from gyriflow.io.tetmeshes import write_tetrahedral_mesh

from .conftest import Workflow, labelled

pytestmark = pytest.mark.slow


def files_in(folder):
    return [path for path in folder.rglob("*") if path.is_file()]


FOLDED = {
    "brains": [{"id": "a", "week": 21, **labelled(21)}],
    "start": "a",
    "folding": {"end_week": 21.25, "output_every_gw": 0.25, "thickness_mm": 4.0},
    "runs": {
        # within the fissure
        "drifting": {"no_growth": {"semi_axes": [0.05, 0.05, 0.05]}},
        # one step, in which nothing moves
        "thin": {"thickness_mm": 0.5, "contact": {"kind": "none"}, "growth_rate_per_s": 0, "step_s": 151_200},
    },
}


@pytest.fixture(scope="module")
def meshed(checkout_copy, tmp_path_factory):
    """A study whose mesh counts as made: two hemispheres."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("meshed"))
    name = workflow.write("study.yaml", FOLDED)
    workflow.lay_out("mesh", "--configfile", name)
    results = workflow.directory / "results" / "brains" / "a"
    write_json(results / "surface" / "surface.json", {"fissure_x_mm": 0.0})
    for side, sign in (("left", -1), ("right", 1)):
        write_surface(results / "surface" / f"{side}.pial.surf.gii", hemisphere(sign))
    parts = [(ellipsoid_mesh(10, HALF_AXES), [x, 0, 0]) for x in (-12.5, 12.5)]
    first = np.cumsum([0, *(len(part.vertices) for part, _ in parts)])
    brain = TetrahedralMesh(
        np.vstack([part.vertices + place for part, place in parts]),
        np.vstack([part.tets + start for (part, _), start in zip(parts, first, strict=False)]),
    )
    write_tetrahedral_mesh(results / "mesh" / "brain.xdmf", brain)
    workflow.count_as_made("mesh", "--configfile", name)
    return workflow


@pytest.fixture(scope="module")
def folded(meshed):
    """A run that cannot be solved, and one that can."""
    targets = [f"results/runs/{run}/a/folding/summary.json" for run in ("drifting", "thin")]
    return meshed.run(*targets, "--cores", "1", "--keep-going", "--configfile", "study.yaml")


@pytest.mark.fault(26)
def test_a_brain_that_nothing_clamps_is_refused_before_the_solve(meshed, folded):
    assert folded.returncode == 2, folded.stderr
    message = "no facet is clamped, so the brain would drift"
    assert message in folded.stderr
    assert message in (meshed.directory / "results/runs/drifting/a/logs/regions.log").read_text()
    assert not files_in(meshed.directory / "results/runs/drifting/a/folding")


@pytest.mark.fault(25)
@pytest.mark.usefixtures("folded")
def test_a_cortex_thinner_than_an_element_is_warned_of_with_the_ratio(meshed):
    log = (meshed.directory / "results/runs/thin/a/logs/simulate.log").read_text()
    before, _, _ = log.partition("step    1")
    ratio = read_json(meshed.directory / "results/runs/thin/a/folding/zones.json")["elements_through_cortex"]
    assert 0.05 < ratio < 0.5
    assert f"elements through the cortex: {ratio:.1f}" in before
    assert "from the start on fewer than 2 elements lie through the cortex: folds may be mesh noise" in log
