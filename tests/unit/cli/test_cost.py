"""What a study is predicted to take: within a factor of two of runs that were measured."""

import nibabel as nib
import numpy as np
import pytest

from gyriflow.cli.cost import (
    ERROR,
    LEAST_SURFACE_MIB,
    SECONDS_PER_ELEMENT_AND_STEP,
    folding_needs,
    job_limits,
    linear_elements,
    surface_memory_mib,
)
from gyriflow.config import load
from gyriflow.config.stages import MeshSettings
from gyriflow.study import resolve

STUDY = {
    "brains": [{"id": "a", "week": 21, "shape": {"semi_axes_mm": [20, 20, 20]}}],
    "start": "a",
    "mesh": {"mesher": "tetgen", "order": 1, "surface_edge_mm": 0.67, "core_edge_mm": 4.0},
    "folding": {"end_week": 25, "step_s": 86400, "ranks": 1},
}


@pytest.mark.parametrize(
    ("week", "mesher", "edge", "core", "elements"),
    [(21, "tetgen", 0.67, 4.0, 156_307), (21, "pytetwild", 0.72, 2.5, 463_621), (22, "tetgen", 1.6, 5.0, 31_232)],
)
def test_a_mesh_has_about_as_many_elements_as_those_that_were_made(week, mesher, edge, core, elements):
    mesh = MeshSettings(mesher=mesher, surface_edge_mm=edge, core_edge_mm=core)
    assert elements / 1.5 < linear_elements(week, mesh) < 1.5 * elements


def reference(raw):
    """Return the simulation of the run `reference` and the settings of its mesh."""
    study = resolve(load(raw))
    return study.simulations["reference", "a"], study.config.mesh


@pytest.mark.parametrize(
    ("elements", "steps", "seconds"),
    # reference and measured of the demo, and of a brain over nine weeks
    [(156_307, 28, 53), (156_307, 28, 63), (500_000, 126, 620), (500_000, 63, 470)],
)
def test_a_folding_takes_as_long_as_measured_ones_within_the_error(elements, steps, seconds):
    predicted = SECONDS_PER_ELEMENT_AND_STEP[1] * elements * steps
    assert seconds / 1.3 < predicted < 1.3 * seconds
    assert ERROR > 1.3


def test_the_limits_of_a_job_are_what_is_predicted_with_its_error():
    # a small one has what every job needs
    asked = reference(STUDY)
    assert job_limits(*asked) == (2000, 60)
    asked = reference(STUDY | {"folding": {"end_week": 40, "step_s": 600, "ranks": 4}})
    needs = folding_needs(*asked)
    assert job_limits(*asked) == pytest.approx((2 * needs.memory_mib, 2 * needs.seconds / 4 / 60), abs=1)


def test_the_memory_of_a_surface_follows_the_header(tmp_path):
    for name, edge, size in (("usual", 0.8, 100), ("fine", 0.25, 320), ("padded", 0.8, 512)):
        image = nib.Nifti1Image(np.zeros((size,) * 3, dtype=np.uint8), np.diag([edge] * 3 + [1.0]))
        image.header.set_xyzt_units("mm")
        nib.save(image, tmp_path / f"{name}.nii")
    usual, fine, padded = (surface_memory_mib(str(tmp_path / f"{n}.nii"), 25.0) for n in ("usual", "fine", "padded"))
    assert usual == surface_memory_mib(str(tmp_path / "none.nii"), 25.0) == LEAST_SURFACE_MIB
    assert fine > 1.2 * LEAST_SURFACE_MIB
    assert padded < fine
