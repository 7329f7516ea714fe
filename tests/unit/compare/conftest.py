"""What takes long before surfaces are compared, done once a surface."""

from functools import cache

import pytest

from gyriflow.compare import comparison
from gyriflow.compare.shapes import prepare_for_comparison

prepared_once = cache(prepare_for_comparison)


@pytest.fixture(autouse=True)
def surfaces_prepared_once(monkeypatch):
    """Prepare a surface once for comparison with another, however often they meet."""
    monkeypatch.setattr(comparison, "prepare_for_comparison", prepared_once)
