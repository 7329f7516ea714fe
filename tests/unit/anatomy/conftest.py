"""Searches that take long and have tests of their own, made short for the others."""

import numpy as np
import pytest

from gyriflow.anatomy import fissure, template
from gyriflow.geometry.alignment import CUBE_ROTATIONS

HALF_TURNS = [turn for turn in CUBE_ROTATIONS if np.diag(turn).all()]
"""The identity, and half turns about x, y and z."""


@pytest.fixture
def few_starts(request, monkeypatch, quick_poses):
    """Search planes of symmetry from few directions, and poses from few ones in one
    week's template, for brains that lie upright, upside down or back to front."""
    if "recorded_outputs" in request.fixturenames:
        return
    monkeypatch.setattr(fissure, "DIRECTIONS", 100)
    monkeypatch.setattr(fissure, "STARTS", 1)
    monkeypatch.setattr(template, "CUBE_ROTATIONS", HALF_TURNS)
    shapes = template.template_shapes
    monkeypatch.setattr(template, "template_shapes", lambda kind: shapes(kind)[1:2])
