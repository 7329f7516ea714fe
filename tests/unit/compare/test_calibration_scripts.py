"""What the scripts of a calibration write: the runs of a round, their scores, and the
optimum."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from ellipsoid import CENTRE_MM, RUN, brain_mesh
from facts import Facts
from scripts import run_script

from gyriflow.compare.calibration import next_round
from gyriflow.folding.start_regions import start_regions
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, corners
from gyriflow.io.files import read_table, write_json, write_table
from gyriflow.io.frames import join_frames, write_frame
from gyriflow.io.surfaces import write_surface
from gyriflow.io.tetmeshes import write_regions
from gyriflow.metrics import measure
from gyriflow.settings.folding import parameters_from
from gyriflow.shipped import SHIPPED

from .made_spectra import folded

SEMI_AXES = (5.0, 6.5, 4.5)
SIMULATED = (1.1, 1.2)
"""Growth of the brain in each simulation, in length."""
OBSERVED = ((1.0, 1.3), (1.05, 1.15, 1.4))
"""Growth of the observed brains that each is compared with."""
SETTINGS = {"curvature_radius_mm": 3.0, "spangy_modes": 150}
WEIGHTS = {"size": 2.0, "relative_power_b4": 5.0}


def grown(points, factor):
    """Return (n, 3) points of a brain that grows by a factor, and more in length."""
    return (points - CENTRE_MM) * factor * [1.0, factor, 1.0] + CENTRE_MM


def length(surface):
    return np.ptp(surface.vertices[:, 1])


def made_spectra(left, right, **settings):
    """Return spectra that depend on the length of a brain, in place of measured ones,
    which take a finer mesh."""
    assert settings == SETTINGS
    assert left.vertices[:, 0].mean() < right.vertices[:, 0].mean()
    return folded(length(left) / 7.5)


def is_left(surface):
    return corners(surface)[:, :, 0].mean(axis=1) < CENTRE_MM[0]


def score(folder, run, causes):
    """Return the row that the script writes for a run whose simulations have diverged
    for some causes, or None."""
    inputs = {
        name: [f"{name}-{factor}.{ending}" for factor in SIMULATED]
        for name, ending in (("frames", "h5"), ("summaries", "json"))
    }
    factors = [factor for brains in OBSERVED for factor in brains]
    inputs |= {
        "regions": ["regions.xdmf"] * len(SIMULATED),
        "observed": [f"{factor}.gii" for factor in factors],
        "spectra": [f"{factor}.csv" for factor in factors],
        "design": "design.csv",
    }
    for file, cause in zip(inputs["summaries"], causes, strict=True):
        write_json(folder / file, {"diverged": cause})
    params = {
        "week": 22.0,
        "round": 3,
        "compared": [len(brains) for brains in OBSERVED],
        "weights": WEIGHTS,
        "settings": SETTINGS,
    }
    wildcards = SimpleNamespace(run=run)
    output = {0: f"{run}.csv"}
    run_script(
        "calibration_score.py", folder, inputs, output, params, wildcards=wildcards
    )
    return read_table(folder / f"{run}.csv").iloc[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the files of two simulations and of five observed brains."""
    folder = tmp_path_factory.mktemp("calibration")
    mesh = brain_mesh(6, SEMI_AXES)
    write_regions(
        folder / "regions.xdmf", start_regions(mesh, parameters_from(RUN), {}, is_left)
    )
    for factor in SIMULATED:
        frames = []
        for week, positions in (
            (21.0, mesh.vertices),
            (22.0, grown(mesh.vertices, factor)),
        ):
            frames.append(folder / f"{week}.h5")
            write_frame(frames[-1], week, {"positions": positions})
        join_frames(folder / f"frames-{factor}.h5", mesh.tets, frames)
    surface, _ = boundary_surface(mesh)
    for brains in OBSERVED:
        for factor in brains:
            brain = TriangleMesh(grown(surface.vertices, factor), surface.faces)
            write_surface(folder / f"{factor}.gii", brain)
            write_table(folder / f"{factor}.csv", folded(length(brain) / 7.5))
    design = pd.DataFrame({"run": ["r1", "r2"], "thickness_mm": [1.5, 2.5]})
    write_table(folder / "design.csv", design)
    return folder


@pytest.mark.usefixtures("recorded_outputs")
def test_a_run_s_score_is_the_mean_over_each_simulation_and_each_of_its_brains(
    folder, monkeypatch
):
    monkeypatch.setattr(measure, "surface_spectra", made_spectra)
    row = score(folder, "r2", [None, None])
    # the other numbers are recorded
    assert row["score"] == pytest.approx(2 * row["size"] + 5 * row["relative_power_b4"])


def test_a_run_has_no_score_if_one_of_its_simulations_has_diverged(folder):
    row = score(folder, "r1", [None, "too large a step"])
    assert np.isnan(row["score"])
    assert (row["outcome"], row["thickness_mm"]) == ("diverged", 1.5)
    assert row["cause"] == Facts("too large a step")


BOUNDS = {"thickness_mm": (1.0, 3.0), "growth_rate_per_s": (1e-7, 5e-7)}


def designed(folder, runs, scores):
    params = {"bounds": BOUNDS, "score": ["size"], "runs": runs}
    inputs = {"spectra": [], "scores": scores}
    run_script("calibration_design.py", folder, inputs, {0: "design.csv"}, params)
    return read_table(folder / "design.csv")


@pytest.mark.usefixtures("recorded_outputs")
def test_rounds_are_designed_by_all_scores_before_and_end_in_the_best_run(tmp_path):
    first = designed(tmp_path, ["r1", "r2", "r3", "r4"], [])
    files = []
    for number, score in enumerate([0.4, 0.1, 0.3, np.nan]):
        row = first[number : number + 1].assign(score=score, cause="", round=1)
        files.append(f"score-{number}.csv")
        write_table(tmp_path / files[-1], row)
    second = designed(tmp_path, ["r5", "r6"], files)
    runs = pd.concat([read_table(tmp_path / file) for file in files])
    expected = next_round(runs, BOUNDS, 2, seed=0)
    assert second[list(BOUNDS)].to_numpy() == pytest.approx(expected.to_numpy())
    run_script(
        "calibration_tables.py",
        tmp_path,
        {"scores": files, "noise": SHIPPED / "norms" / "repeatability.yaml"},
        {"runs": "runs.csv", "optimum": "optimum.csv"},
        {"bounds": BOUNDS, "weights": {"size": 2.0}},
    )
