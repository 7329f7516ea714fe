"""Maps of growth in frames and regions, of the tutorial's law in a class."""

import re
import sys
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from mpi4py import MPI
from shapes import uneven_body

from gyriflow.folding.growth import GrowthInputs, StepStart, model_fields
from gyriflow.folding.growth_models import BUILDERS, growth_model
from gyriflow.folding.run import run
from gyriflow.folding.start_regions import start_regions
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import quadratic
from gyriflow.io.frames import read_field, read_positions
from gyriflow.io.tetmeshes import read_regions, write_regions
from gyriflow.settings.folding import parameters_from

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial-folding.md"
BODY = uneven_body(4)
CORTEX_PER_S, CORE_PER_S, STEP_S = 2e-7, 5e-8, 172800.0
RUN = {
    "start_week": 21.0,
    "end_week": 21.5,
    "output_weeks": [21.0, 21.5],
    "fissure_x_mm": float(BODY.vertices[:, 0].mean()),
    "step_s": STEP_S,
    "thickness_mm": 4.0,
    "growth_rate_per_s": CORTEX_PER_S,
    "core_growth_rate_per_s": CORE_PER_S,
    "support": "ellipsoid",
    "contact": "none",
    "fields": ["cortex_weight", "growth", "zones"],
}


@pytest.fixture
def law(monkeypatch):
    """The class of the tutorial, as the growth model of runs by rates."""
    (text,) = re.findall(
        r'```\n("""Growth that .*?)```', TUTORIAL.read_text(), re.DOTALL
    )
    module = ModuleType("gyriflow.folding.front")
    module.__package__ = "gyriflow.folding"
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(text, module.__dict__)
    law = module.GrowthInFront
    monkeypatch.setitem(BUILDERS, "rates", lambda p, inputs: partial(law, p))
    return law


def growth_in_front(positions_mm, weight, growing):
    """Return tangential and radial growth in a step, as the tutorial says."""
    y_mm = positions_mm[:, 1]
    place = 2 * (y_mm - y_mm.min()) / np.ptp(y_mm) - 1
    factor = (1 + 0.8 * place) * growing * STEP_S
    core = CORE_PER_S * (1 - weight) * factor
    return CORTEX_PER_S * weight * factor + core, core


@pytest.mark.parametrize("order", [1, 2])
def test_maps_of_growth_show_what_a_law_in_a_class_does(law, order, tmp_path):
    mesh = BODY if order == 1 else quadratic(BODY)
    parameters = parameters_from(RUN)
    zones = zones_of_run(mesh, parameters)
    run(MPI.COMM_SELF, mesh, zones, parameters, {}, tmp_path)
    start = start_regions(mesh, parameters, {}, lambda faces: faces.faces[:, 0] < 0)
    write_regions(tmp_path / "regions.xdmf", start)
    regions = read_regions(tmp_path / "regions.xdmf")
    maps = [(regions.mesh.vertices, regions.fields)]
    growths = "tangential_growth_per_step", "radial_growth_per_step"
    for week in RUN["output_weeks"]:
        frames = tmp_path / "frames.h5"
        names = "cortex_weight", "growing", *growths
        fields = {name: read_field(frames, week, name) for name in names}
        maps.append((read_positions(frames, week), fields))
    for positions_mm, fields in maps:
        expected = growth_in_front(
            positions_mm, fields["cortex_weight"], fields["growing"]
        )
        # in single precision
        found = [fields[name] for name in growths]
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-9)
    grows = fields["growing"] > 0
    assert 0 < grows.sum() < len(grows)
    assert expected[0][grows].max() > 3 * expected[0][grows].min()


def test_the_figure_of_the_model_shows_what_a_law_in_a_class_does(law):
    parameters = parameters_from(RUN)
    zones = zones_of_run(BODY, parameters)
    model = growth_model(parameters, GrowthInputs(BODY, zones, {}))
    growth = model(StepStart(BODY.vertices, 0.0, STEP_S))
    fields = model_fields(growth, zones, 1.1 * BODY.vertices, 21.5)
    tangential, _ = growth_in_front(
        fields["positions"], fields["weight"], fields["growing"]
    )
    np.testing.assert_allclose(fields["increment"], tangential, rtol=1e-9, atol=1e-12)
