"""Each test of commands keeps what it has read in a folder of its own, and searches the
pose of a shape once."""

import pytest


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    """The folder in which results are kept."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder / "gyriflow"


@pytest.fixture(autouse=True)
def poses_searched_once(quick_poses):
    """The searches themselves have tests of their own."""
