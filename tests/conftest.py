"""Fixtures of all tests, and their distribution to workers."""

import gc
import logging
import os
import re
from pathlib import Path

import pandas as pd
import pytest
from known_fits import fit_found_once, rough_templates
from recording import DIGITS, contents, numbers_in, renewed, table_of
from scripts import OUTPUTS
from xdist.scheduler import LoadScopeScheduling

# dolfinx, PETSc and MPI in the order that their wheels need
import gyriflow.folding  # noqa: F401
from gyriflow.anatomy import template

LONGEST_FIRST = ("tests/mpi/", "tests/mpi/test_ranks.py", "tests/workflow/", "tests/")
"""Cases on several ranks come after the same on one, which compile their forms while no
other rank waits for them."""
MOST_WORKERS = 8
"""Some tests start three ranks, or a workflow of two cores, of their own."""


class Sets(LoadScopeScheduling):
    """Deals out files, whose tests share what takes long to set up, and what else is
    not to be parted."""

    def _split_scope(self, nodeid):
        file, _, _ = nodeid.partition("::")
        # these compile forms of their own: two should not fill one cache at once
        return "tests/unit/folding" if file.startswith("tests/unit/folding/") else file


@pytest.fixture(autouse=True)
def default_logging_level():
    """Start each test at the default level, which scripts run in this process lower."""
    logging.getLogger().setLevel(logging.WARNING)


@pytest.fixture
def shapes_once(monkeypatch):
    """Search the pose of a shape once, however its copies are turned, shifted and
    scaled."""
    monkeypatch.setattr(template, "register_from_all_sides", fit_found_once)


@pytest.fixture
def quick_poses(request, monkeypatch, shapes_once):
    """Search poses with a third of the points, for tests of what follows from a pose.

    Recorded numbers are those of the whole search.
    """
    if "recorded_outputs" in request.fixturenames:
        return
    monkeypatch.setattr(template, "POINTS", template.POINTS // 3)
    monkeypatch.setattr(template, "template_shapes", rough_templates)


@pytest.fixture
def recorded(dataframe_regression, original_datadir, caplog, monkeypatch, request):
    """A function that compares results by their names with the table beside the test,
    and the numbers of all warnings with them.

    `rtol` is the relative tolerance of all numbers. `--force-regen` renews the rows
    that differ by more.
    """

    monkeypatch.setattr(type(dataframe_regression), "DISPLAY_PRECISION", DIGITS)

    def check(results, rtol=1e-4, atol=1e-11):
        warnings = [
            numbers_in(record.getMessage())
            for record in caplog.records
            if record.name.startswith("gyriflow") and record.levelname == "WARNING"
        ]
        table = table_of({**results, "warnings": warnings})
        if request.config.getoption("force_regen"):
            name = re.sub(r"\W", "_", request.node.name)
            file = original_datadir / f"{name}.csv"
            if file.exists():
                table = renewed(pd.read_csv(file, index_col=0), table, rtol, atol)
        dataframe_regression.check(
            table, default_tolerance={"rtol": rtol, "atol": atol}
        )

    return check


@pytest.fixture
def recorded_outputs(recorded, request):
    """Compare all that the scripts of a test write with the table beside the test."""
    OUTPUTS.clear()
    yield
    is_remeshed = request.node.get_closest_marker("remeshed") is not None
    files = {}
    for name, path in OUTPUTS.items():
        if path.is_file():
            files[name] = contents(path, is_remeshed)
    if is_remeshed:
        recorded(files, rtol=1e-2, atol=5e-3)
    else:
        recorded(files, rtol=1e-3)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Leave what is imported out of garbage collection, then and later: it takes a
    tenth of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items):
    """Put what takes long first, so that no worker is left alone with it at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}

    def place(item):
        folder = max(filter(item.nodeid.startswith, LONGEST_FIRST), key=len)
        return LONGEST_FIRST.index(folder), item.path not in slow

    items.sort(key=place)


@pytest.hookimpl(tryfirst=True)
def pytest_xdist_auto_num_workers(config):
    """Return a worker a core; none for a single file, which takes less long than
    workers to start."""
    single = len(config.args) == 1 and Path(config.args[0].partition("::")[0]).is_file()
    return 0 if single else min(len(os.sched_getaffinity(0)), MOST_WORKERS)


def pytest_xdist_make_scheduler(config, log):
    return Sets(config, log)
