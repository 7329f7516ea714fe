"""Searches that take long and have tests of their own, made short for the others."""

import pytest

from gyriflow.anatomy import fissure


@pytest.fixture
def few_starts(monkeypatch):
    """Search planes of symmetry from few directions, for brains that lie upright."""
    monkeypatch.setattr(fissure, "DIRECTIONS", 100)
    monkeypatch.setattr(fissure, "STARTS", 1)
