"""What all tests share."""

from pathlib import Path

# pymeshlab brings libraries that keep PETSc from loading after it; in this order both work
import petsc4py.PETSc  # noqa: F401
from reliability import Collector


def pytest_addoption(parser):
    parser.addoption(
        "--reliability", metavar="PAGE", help="write the page of faults, promises and their tests' outcomes"
    )


def pytest_configure(config):
    page = config.getoption("--reliability")
    config.pluginmanager.register(Collector(Path(page) if page else None), "reliability")
