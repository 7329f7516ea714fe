"""Where results come from: the code that a step depends on, and the versions of everything that made them.

The code of a step is the modules that its program imports, directly or through others.
"""

import ast
import hashlib
import platform
import sys
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from .version import commit, version

PACKAGE = Path(__file__).resolve().parent
PACKAGES = (
    *(
        "fenics-dolfinx",
        "fenics-basix",
        "fenics-ffcx",
        "fenics-ufl",
        "petsc4py",
        "slepc4py",
        "mpi4py",
        "numpy",
        "scipy",
    ),
    *("snakemake", "nibabel", "scikit-image", "pymeshlab", "pytetwild", "trimesh", "libigl", "ipctk", "lapy", "pandas"),
    *("picsl-greedy", "SimpleITK", "pyvista", "vtk", "matplotlib", "h5py", "pydantic"),
)
"""Packages whose versions are recorded: those that results depend on."""


def software() -> dict[str, Any]:
    """Returns the versions of gyriflow, Python and the packages that results depend on, the commit, and now (UTC)."""
    packages: dict[str, str | None] = {}
    for name in PACKAGES:
        try:
            packages[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            packages[name] = None
    return {
        "gyriflow": version(),
        "commit": commit(),
        "recorded": datetime.now(UTC).isoformat(timespec="seconds"),
        "python": sys.version.split()[0],
        "system": platform.platform(),
        "packages": packages,
    }


def code_hash(program: Path) -> str:
    """Returns a hash of all modules of this package that a Python program imports, the program itself left out.

    Data files beside the modules count too. As a parameter of a rule it makes a change of the code rerun exactly what
    depends on it.
    """
    files = modules_behind(program)
    total = hashlib.sha256()
    for path in sorted(files | {data for module in files for data in _data_beside(module)}):
        total.update(f"{path.relative_to(PACKAGE).as_posix()}\0".encode())
        total.update(_content(path))
    return total.hexdigest()[:12]


def modules_behind(program: Path) -> set[Path]:
    """Returns the files of all modules of this package that a Python program imports, directly or through others."""
    reached: set[Path] = set()
    waiting = set(imported_modules(program))
    while waiting:
        module = waiting.pop()
        reached.add(module)
        waiting |= imported_modules(module) - reached
    return reached - {program}


@cache
def imported_modules(source: Path) -> frozenset[Path]:
    """Returns the files of the modules of this package that a source file imports, at the top or inside functions."""
    inside = source.resolve().is_relative_to(PACKAGE)
    here = [PACKAGE.name, *source.resolve().relative_to(PACKAGE).parts[:-1]] if inside else []
    names: list[str] = []
    for node in ast.walk(ast.parse(_content(source))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = here[: len(here) - node.level + 1] if node.level else []
            start = ".".join([*base, *([node.module] if node.module else [])])
            names += [start, *(f"{start}.{alias.name}" for alias in node.names)]
    return frozenset(file for name in names for file in _files_of(name))


def room_of(module: Path) -> str:
    """Returns the room that a source file belongs to: the folder, or the single module, directly under the package."""
    return module.resolve().relative_to(PACKAGE).parts[0].removesuffix(".py")


def _files_of(name: str) -> list[Path]:
    """Returns the file of a module and those of the packages around it; none for other packages' modules."""
    package, *parts = name.split(".")
    if package != PACKAGE.name:
        return []
    around = [PACKAGE.joinpath(*parts[:count], "__init__.py") for count in range(len(parts) + 1)]
    return [path for path in (*around, PACKAGE.joinpath(*parts).with_suffix(".py")) if path.is_file()]


def _data_beside(module: Path) -> list[Path]:
    return [path for path in module.parent.iterdir() if path.suffix in (".yaml", ".json", ".csv")]


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()
