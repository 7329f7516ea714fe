"""Deviation of an observed brain from the expected one: distances, areas and thickness
that are known."""

import numpy as np
import pytest
from scripts import run_script
from shapes import FAR, sphere

from gyriflow.compare.deviation import thickness_difference
from gyriflow.geometry.triangles import transformed
from gyriflow.io.surfaces import write_surface, write_vertex_maps

BALL = sphere(20.0)


def test_the_expected_thickness_is_the_start_s_grown_as_in_the_run():
    # thickness differs between above and below, on surfaces with vertices of their own
    def thickness(mesh, above, below):
        return mesh, np.where(mesh.vertices[:, 2] > 0, above, below)

    expected = sphere(22.0)
    difference = thickness_difference(
        fitted=sphere(23.0),
        observed=thickness(sphere(23.0, 5), 2.5, 6.0),
        start=thickness(sphere(19.5, 3), 2.0, 1.5),
        simulated_start=thickness(BALL, 1.0, 2.0),
        expected_mm=thickness(expected, 1.5, 5.0)[1],
    )
    height = expected.vertices[:, 2]
    assert difference[height > 4] == pytest.approx(2.5 - 2.0 * 1.5 / 1.0)
    assert difference[height < -4] == pytest.approx(6.0 - 1.5 * 5.0 / 2.0)


# the turn of a sphere onto another is decided by rounding
@pytest.mark.remeshed
@pytest.mark.usefixtures("recorded_outputs")
def test_the_script_takes_each_surface_with_its_own_thickness(tmp_path):
    """The observed brain is in another pose, and a millimetre larger than expected; no
    two thicknesses are equal."""
    brains = {
        "start": (sphere(19.5, 3), 2.0),
        "first": (BALL, 1.0),
        "expected": (sphere(22.0), 1.5),
        "observed": (transformed(sphere(23.0), FAR[0]), 2.7),
    }
    inputs = {"thickness": [f"{name}.shape.gii" for name in brains], "regions": []}
    for name, (mesh, thickness_mm) in brains.items():
        write_surface(tmp_path / f"{name}.gii", mesh)
        values = np.full(len(mesh.vertices), thickness_mm)
        write_vertex_maps(tmp_path / f"{name}.shape.gii", {"thickness_mm": values})
        inputs[name] = f"{name}.gii"
    inputs["sides"] = ["expected.gii"]
    params = {"sides": ["left"], "columns": {"run": "r", "subject": "b", "week": 24.0}}
    outputs = {"maps": "maps.gii", "table": "table.csv"}
    run_script("deviation.py", tmp_path, inputs, outputs, params)
