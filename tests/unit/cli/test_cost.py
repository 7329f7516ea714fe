"""What a study is predicted to take: sizes against meshes that were made, sums and cores by hand."""

import nibabel as nib
import numpy as np
import pytest

from gyriflow.cli.cost import (
    LEAST_SURFACE_MIB,
    MEASURED,
    Job,
    cubes,
    folding_needs,
    predict,
    surface_memory_mib,
    typical_seconds,
)
from gyriflow.config import load
from gyriflow.config.stages import MeshSettings
from gyriflow.io.files import read_json

STUDY = {
    "brains": [{"id": "a", "week": 21, "phantom": {}}, {"id": "b", "week": 22, "phantom": {}}],
    "start": "a",
    "mesh": {"mesher": "tetgen", "order": 1},
    "folding": {"end_week": 22},
}
COEFFICIENTS = {
    "mesh": {"nodes_factor": {"tetgen": 1.0}, "tets_per_node": 4.0},
    "disk": {"MiB_per_face": 0.0, "MiB_per_node": 0.0, "MiB_per_job": 1.0},
    "other": {"s": 7.0, "s_per_work": 0.0, "MiB": 100.0, "MiB_per_work": 0.0},
    "rules": {
        "measure": {"s": 10.0, "s_per_work": 0.0, "MiB": 500.0, "MiB_per_work": 0.0},
        "simulate order 1": {"s": 0.0, "s_per_work": 1e-6, "MiB": 300.0, "MiB_per_work": 0.0},
    },
    "error": {"time": 2.0, "memory": 1.5, "disk": 1.5},
}


def test_a_ball_of_even_edges_is_filled_by_its_volume():
    radius = 20.0
    area, volume = 4 * np.pi * radius**2, 4 / 3 * np.pi * radius**3
    even = MeshSettings(core_edge_mm=1.0, surface_edge_mm=1.0)
    assert cubes(area, volume, even, 1.0) == pytest.approx(volume, rel=1e-3)
    # below 2.5 edges it grows by half a millimetre per millimetre: far fewer
    graded = MeshSettings(core_edge_mm=5.0, surface_edge_mm=1.0)
    assert cubes(area, volume, graded, 1.0) < 0.6 * volume


def test_times_add_up_and_are_shared_by_the_cores():
    config = load(STUDY)
    jobs = [Job("measure", None, "a"), Job("measure", None, "b"), Job("unheard_of")]
    one, two = (predict(jobs, config, COEFFICIENTS, cores) for cores in (1, 2))
    assert one.core_seconds == two.core_seconds == pytest.approx(27.0)
    assert one.wall_seconds == pytest.approx(27.0)
    assert two.wall_seconds == pytest.approx(13.5)
    # two jobs of 500 MiB side by side
    assert (one.memory_mib, two.memory_mib) == (500.0, 1000.0)
    # more cores do not make the longest chain shorter
    assert predict(jobs, config, COEFFICIENTS, 100).wall_seconds == pytest.approx(10.0)


def test_a_folding_takes_as_long_as_it_has_nodes_and_steps():
    run = [Job("simulate", "reference", "a", 2)]

    def seconds(**changes):
        study = STUDY | {"folding": {"end_week": 22, "step_s": 43200} | changes}
        return predict(run, load(study), COEFFICIENTS, 2).core_seconds

    assert seconds(end_week=23) == pytest.approx(2 * seconds(), rel=1e-6)
    assert seconds(step_s=21600) == pytest.approx(2 * seconds(), rel=1e-6)
    finer = STUDY | {"mesh": {"mesher": "tetgen", "order": 1, "surface_edge_mm": 0.5}}
    assert predict(run, load(finer), COEFFICIENTS, 2).core_seconds > 1.5 * seconds()


def test_the_memory_of_a_folding_is_that_of_its_solver():
    asked = []

    def memory(tets, ranks, contact, order):
        asked.append((ranks, contact, order))
        return 1234.0

    study = load(STUDY | {"folding": {"end_week": 22, "ranks": 3}})
    predicted = predict([Job("simulate", "reference", "a", 3)], study, COEFFICIENTS, 4, memory)
    assert predicted.memory_mib == 1234.0
    assert asked == [(3, "global", 1)]


def test_runs_of_studies_and_calibrations_cost_what_runs_do():
    study = STUDY | {
        "runs": {"reference": {}},
        "studies": {"thick": {"base": "reference", "vary": {"thickness_mm": [2.0, 3.0]}, "compare_week": 22}},
        "calibrate": {
            "base": "reference", "compare_week": 22, "parameters": {"thickness_mm": [1.0, 3.0]},
            "score": {"size": 1.0}, "first_runs": 3,
        },
    }  # fmt: skip
    config = load(study)
    assert config.calibrate is not None
    calibrated = next(iter(config.calibrate.runs))
    usual = predict([Job("simulate", "reference", "a", 2)], config, COEFFICIENTS, 2)
    assert usual.core_seconds == usual.folding_core_seconds > 0.5
    for run in (*config.study_runs, calibrated):
        member = predict([Job("simulate_member", run, "a", 2)], config, COEFFICIENTS, 2)
        assert member.core_seconds == pytest.approx(usual.core_seconds), run
        assert member.disk_mib == pytest.approx(usual.disk_mib), run


def test_the_limits_of_a_job_are_what_is_predicted_with_its_error():
    config = load(STUDY | {"folding": {"end_week": 40, "step_s": 60}})
    predicted = predict([Job("simulate", "reference", "a", 2)], config, COEFFICIENTS, 2, lambda *_: 4000.0)
    mib, minutes = folding_needs("reference", "a", config, COEFFICIENTS, lambda *_: 4000.0)
    assert mib == 6000
    assert minutes == pytest.approx(2 * predicted.wall_seconds / 60, abs=1)
    assert minutes > 60
    # a small one has what every job needs
    assert folding_needs("reference", "a", load(STUDY), COEFFICIENTS, lambda *_: 10.0) == (2000, 60)


def test_what_was_measured_has_all_that_predictions_need():
    measured = read_json(MEASURED)
    predicted = predict([Job("simulate", "reference", "a", 1), Job("measure", None, "a")], load(STUDY), measured, 1)
    assert 1 < predicted.core_seconds < 1e5
    assert 1 < predicted.error["time"] < 4
    assert typical_seconds()["simulate"] > typical_seconds()["study_table"]


def test_the_memory_of_a_surface_follows_the_header(tmp_path):
    for name, edge, size in (("usual", 0.8, 100), ("fine", 0.25, 320), ("padded", 0.8, 512)):
        image = nib.Nifti1Image(np.zeros((size,) * 3, dtype=np.uint8), np.diag([edge] * 3 + [1.0]))
        image.header.set_xyzt_units("mm")
        nib.save(image, tmp_path / f"{name}.nii")
    usual, fine, padded = (surface_memory_mib(str(tmp_path / f"{n}.nii"), 25.0) for n in ("usual", "fine", "padded"))
    assert usual == surface_memory_mib(str(tmp_path / "none.nii"), 25.0) == LEAST_SURFACE_MIB
    assert fine > 1.2 * LEAST_SURFACE_MIB
    assert padded < fine
    brain = {"id": "a", "week": 25, "labels": str(tmp_path / "fine.nii"), "scheme": "binary"}
    config = load({"brains": [brain], "start": "a", "folding": {"end_week": 26}})
    assert predict([Job("pial_from_labels", None, "a")], config, COEFFICIENTS, 1).memory_mib == fine
