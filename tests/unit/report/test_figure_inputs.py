"""Figures get all that their rule lists, each input by its own reader."""

import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scripts import run_script
from shapes import smooth_field, uneven_body, uneven_surface

from gyriflow.folding.start_regions import start_regions
from gyriflow.geometry.triangles import corners
from gyriflow.io.files import write_json, write_table
from gyriflow.io.frames import join_frames, write_frame
from gyriflow.io.registrations import WeeklyShapes, write_weekly_shapes
from gyriflow.io.surfaces import (
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)
from gyriflow.io.tetmeshes import write_regions
from gyriflow.io.yaml_files import write_yaml
from gyriflow.settings.folding import parameters_from

MESH = uneven_body(4)
RUN = {
    "start_week": 21.0,
    "end_week": 24.0,
    "output_weeks": [21.0, 22.0, 24.0],
    "fissure_x_mm": float(MESH.vertices[:, 0].mean()),
    "thickness_mm": 4.0,
    "contact": "planes",
}


@pytest.fixture
def folder(tmp_path):
    """A folder with a file for each reader."""
    parameters = parameters_from(RUN)
    write_yaml(tmp_path / "parameters.yaml", RUN)
    regions = start_regions(MESH, parameters, {}, on_left)
    write_regions(tmp_path / "boundary.xdmf", regions)
    frames = []
    for week in RUN["output_weeks"]:
        frames.append(tmp_path / f"{week}.h5")
        places = MESH.vertices * (1.0 + 0.01 * (week - 21.0) ** 2)
        growth = 0.01 * week * smooth_field(places)
        fields = {"positions": places, "tangential_growth_per_step": growth}
        fields["radial_growth_per_step"] = 2 * growth
        fields["growth_direction_per_step"] = np.column_stack([growth] * 3)
        write_frame(frames[-1], week, fields)
    join_frames(tmp_path / "frames.h5", MESH.tets, frames)
    for number, side in enumerate(("left", "right")):
        surface = uneven_surface(2, number)
        write_surface(tmp_path / f"{side}.surf.gii", surface)
        depth = {"depth_mm": (1.0 + number) * smooth_field(surface.vertices)}
        write_vertex_maps(tmp_path / f"{side}.shape.gii", depth)
        labels = (np.arange(len(surface.vertices)) % 3) + number
        names = {1: "a", 2: "b", 3: "c"}
        write_vertex_labels(tmp_path / f"{side}.label.gii", labels, names)
    ages = pd.DataFrame({"stated_week": [21.0, 22.0], "age_by_size": [21.2, 21.9]})
    shapes = np.stack([MESH.vertices, 1.1 * MESH.vertices])
    sizes = {"volume_ml": np.array([20.0, 26.0])}
    kept = WeeklyShapes(np.array([21.0, 22.0]), shapes, sizes, {}, ages)
    write_weekly_shapes(tmp_path / "ages.h5", kept)
    write_json(tmp_path / "quality.json", {"min_radius_ratio": 0.3})
    for number in (1, 2):
        table = pd.DataFrame({"week": [21.0, 22.0], "area": [number, 2.0 * number]})
        write_table(tmp_path / f"metrics.{number}.csv", table)
    return tmp_path


def on_left(surface):
    """Return which faces of a surface lie on the left."""
    return corners(surface)[:, :, 0].mean(axis=1) < RUN["fissure_x_mm"]


def test_a_figure_is_drawn_of_all_its_inputs(folder, monkeypatch, recorded):
    given = {}

    def shown(
        ages, boundary, elements, frames, growth, parameters, quality, metrics, grid, a
    ):
        given.update(locals())
        return pd.DataFrame({"week": [21.0]})

    module = SimpleNamespace(shown=shown)
    monkeypatch.setitem(sys.modules, "gyriflow.report.drawn_here", module)
    inputs = {name: f"{name}.h5" for name in ("ages", "frames")}
    inputs |= {"elements": "frames.h5", "boundary": "boundary.xdmf"}
    inputs |= {"growth": "left.shape.gii", "parameters": "parameters.yaml"}
    inputs |= {"quality": "quality.json", "grid": ["left.surf.gii"]}
    inputs["metrics"] = ["metrics.1.csv", "metrics.2.csv"]
    paths = {
        end: [str(folder / f"{side}.{end}.gii") for side in ("left", "right")]
        for end in ("surf", "shape", "label")
    }
    brain = {"row": "r", "column": "c", "simulated": True}
    grid = [
        brain | {"surfaces": paths["surf"], "maps": paths["shape"]},
        brain | {"surfaces": paths["surf"][:1], "maps": paths["label"][:1]},
    ]
    params = {"modules": ["drawn_here"], "grid": grid, "a": 3.5}
    run_script("figures.py", folder, inputs, {"shown": "shown.html"}, params)
    assert "21" in (folder / "shown.html").read_text()
    tets, fields = given.pop("elements")
    del given["given"], given["parameters"]
    given |= {"tets": tets, "fields": fields}
    recorded(given, rtol=1e-3)
