"""Requirements of jobs besides the base packages: the extras, a C compiler, and
libraries of the system.

`python -m gyriflow.running.requirements` prints the Debian packages that this machine
lacks; `./run` installs them.
"""

import ctypes
import platform
import re
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from importlib.machinery import PathFinder
from pathlib import Path

from ..code_hash import PACKAGE, modules_behind
from ..errors import InputError
from ..folding.compiler import has_compiler
from ..shipped import SHIPPED

EXTRAS = {
    "dolfinx": "fold",
    "ipctk": "fold",
    "picsl_greedy": "fold",
    "pytetwild": "fold",
    "SimpleITK": "fold",
    "optuna": "calibrate",
}
"""The extra of each module that is not among the base packages."""
LIBRARIES = {
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libOpenGL.so.0": "libopengl0",
    "libcom_err.so.2": "libcom-err2",
    "libgmp.so.10": "libgmp10",
    "libp11-kit.so.0": "libp11-kit0",
}
"""Libraries that pymeshlab and VTK load on Linux, with their Debian packages."""
SOLVER = PACKAGE / "folding" / "__main__.py"
CONDA = f"conda env create -f {SHIPPED / 'envs' / 'gyriflow.yaml'}"
IMPORT = re.compile(r"^[ \t]*(?:import|from)[ \t]+(\w+)", re.MULTILINE)


def require_for(programs: Mapping[str, Path]) -> None:
    """Raise InputError if steps, given by their names and programs, lack a package, a
    library or a compiler."""
    missing: dict[str, str] = {}
    compiles = False
    for name, program in programs.items():
        needed = _packages_behind(program)
        compiles |= "dolfinx" in needed
        for package in needed:
            if not _is_installed(package):
                missing.setdefault(package, name)
    if missing:
        package, rule = next(iter(missing.items()))
        extras = sorted({EXTRAS[name] for name in missing})
        remedy = f'Install what is missing: pip install "gyriflow[{",".join(extras)}]"'
        if "dolfinx" in missing and not _has_dolfinx_wheels():
            remedy = f"PyPI has no dolfinx with PETSc for this system: {_elsewhere()}"
        names = ", ".join(missing)
        problem = (
            "simulations, registrations and calibrations need packages that are not"
            f" installed ({names})"
        )
        raise InputError(
            problem, found=f"step {rule}, which imports {package}", remedy=remedy
        )
    lacking = _missing_libraries()
    if lacking:
        names = ", ".join(lacking)
        raise InputError(
            f"this system has no {names}",
            remedy=_install(LIBRARIES[name] for name in lacking),
        )
    if compiles and not has_compiler():
        remedy = (
            f"{_install(['gcc', 'libc6-dev'])}, or without root: pip install ziglang"
        )
        raise InputError(
            "simulations need a C compiler, and there is none", remedy=remedy
        )
    if compiles and not _has_python_headers():
        raise InputError(
            "simulations need Python.h, and there is none",
            remedy=_install([_headers_package()]),
        )


def _elsewhere() -> str:
    """Return how simulations run on a system for which PyPI has no solver."""
    if sys.platform == "win32":
        return "use WSL with Ubuntu 22.04 or later, and install gyriflow[fold] there"
    if sys.platform == "linux":
        return f"use conda, {CONDA}"
    return f"use conda, {CONDA}, without its lines for Linux (docs/environment.md)"


def _packages_behind(program: Path) -> list[str]:
    """Return the packages of the extras that a program or the modules behind it
    import."""
    imported: set[str] = set()
    for source in {program, *modules_behind(program)}:
        if source.suffix == ".py":
            imported.update(IMPORT.findall(source.read_text(encoding="utf-8")))
    return [name for name in EXTRAS if name in imported]


def _is_installed(package: str) -> bool:
    """Return whether a package is installed; `importlib.util.find_spec` would import
    MPI for dolfinx."""
    is_blocked = package in sys.modules and sys.modules[package] is None
    return not is_blocked and PathFinder.find_spec(package) is not None


def _has_dolfinx_wheels() -> bool:
    """Return whether PyPI has dolfinx with PETSc for this system: Linux x86_64 with
    glibc 2.34 or later."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return False
    library, version = platform.libc_ver()
    numbers = re.findall(r"\d+", version)
    return library == "glibc" and [int(number) for number in numbers[:2]] >= [2, 34]


def _missing_libraries() -> list[str]:
    """Return the `LIBRARIES` that this system lacks."""
    if sys.platform != "linux":
        return []
    lacking = []
    for name in LIBRARIES:
        try:
            ctypes.CDLL(name)
        except OSError:
            lacking.append(name)
    return lacking


def _has_python_headers() -> bool:
    """Return whether C code can be compiled for this Python."""
    return Path(sysconfig.get_path("include"), "Python.h").is_file()


def _missing_debian_packages() -> list[str]:
    """Return the Debian packages that this system lacks."""
    packages = [LIBRARIES[name] for name in _missing_libraries()]
    if not has_compiler():
        packages += ["gcc", "libc6-dev"]
    if not _has_python_headers():
        packages.append(_headers_package())
    return packages


def _headers_package() -> str:
    # python3-dev is of the system's default Python, which may be another
    return f"python3.{sys.version_info.minor}-dev"


def _install(packages: Iterable[str]) -> str:
    return f"On Debian or Ubuntu: sudo apt-get install {' '.join(packages)}"


if __name__ == "__main__":
    print(*_missing_debian_packages())
