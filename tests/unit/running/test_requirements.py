"""What a job needs is found from what its program imports, and named before the first
job."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.folding import compiler
from gyriflow.running import requirements
from gyriflow.running.requirements import SOLVER, require_for

SCRIPTS = Path(__file__).parents[3] / "workflow" / "scripts"
MEASURE = {"measure": SCRIPTS / "measure.py"}
SIMULATE = {"simulate": SOLVER}


@pytest.fixture
def machine(monkeypatch):
    """Return a function: let the machine have all libraries, and all packages or those
    without some."""

    def pretend(without=()):
        def find(name):
            return None if name in without else name

        finder = SimpleNamespace(find_spec=find)
        monkeypatch.setattr(requirements, "PathFinder", finder)
        monkeypatch.setattr(requirements, "LIBRARIES", {})

    return pretend


@pytest.mark.parametrize(
    "script",
    ["pial", "measure", "brain_figures", "quality_table", "html_report"],
)
def test_measuring_needs_nothing_but_the_base_packages(machine, script):
    machine(without=requirements.EXTRAS)
    require_for({script: SCRIPTS / f"{script}.py"})


@pytest.mark.parametrize(
    ("program", "packages"),
    [
        (SCRIPTS / "register.py", "picsl_greedy, SimpleITK"),
        (SCRIPTS / "tetrahedralise.py", "pytetwild"),
        (SCRIPTS / "calibration_design.py", "optuna"),
        (SOLVER, "dolfinx, ipctk"),
    ],
)
def test_simulations_and_registrations_need_the_extra(machine, program, packages):
    machine(without=requirements.EXTRAS)
    with pytest.raises(InputError, check=Facts("step a", f"({packages})")):
        require_for(MEASURE | {"a": program})


@pytest.mark.parametrize(
    ("without", "facts"),
    [
        (["ipctk"], ["ipctk", "simulate", "gyriflow[fold]"]),
        (["ipctk", "optuna"], ["ipctk", "optuna", "gyriflow[calibrate,fold]"]),
    ],
)
def test_a_missing_package_is_named_with_its_step_and_extra(machine, without, facts):
    machine(without)
    design = {"design": SCRIPTS / "calibration_design.py"}
    with pytest.raises(InputError, check=Facts(*facts)):
        require_for(SIMULATE | design)


PIP, CONDA = ["pip", "gyriflow[fold]"], ["conda", "envs/gyriflow.yaml"]


@pytest.mark.parametrize(
    ("system", "processor", "libc", "facts"),
    [
        ("linux", "x86_64", ("glibc", "2.34"), PIP),
        ("linux", "x86_64", ("glibc", "2.100"), PIP),
        ("linux", "x86_64", ("glibc", "2.31"), CONDA),
        ("linux", "x86_64", ("", ""), CONDA),
        ("linux", "aarch64", ("glibc", "2.34"), CONDA),
        ("win32", "AMD64", ("", ""), ["WSL", "gyriflow[fold]"]),
        # which leaves out what conda has for Linux only
        ("darwin", "arm64", ("", ""), [*CONDA, "docs/environment.md"]),
    ],
)
def test_where_pypi_has_no_dolfinx_it_is_said_how_simulations_run(
    machine, monkeypatch, system, processor, libc, facts
):
    machine(without=["dolfinx"])
    monkeypatch.setattr(requirements.sys, "platform", system)
    monkeypatch.setattr(requirements.platform, "machine", lambda: processor)
    monkeypatch.setattr(requirements.platform, "libc_ver", lambda: libc)
    with pytest.raises(InputError, check=Facts("dolfinx", *facts)):
        require_for(SIMULATE)


def test_a_missing_library_is_named_with_its_package(monkeypatch):
    monkeypatch.setattr(requirements, "LIBRARIES", {"libnowhere.so.7": "libnowhere7"})
    facts = Facts("libnowhere.so.7", "apt-get install libnowhere7")
    with pytest.raises(InputError, check=facts):
        require_for(MEASURE)


@pytest.fixture
def without_compiler(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)


def test_without_a_compiler_only_simulations_are_refused(
    machine, monkeypatch, without_compiler
):
    machine()
    monkeypatch.setattr(compiler, "_has_ziglang", lambda: False)
    require_for(MEASURE)
    facts = Facts("apt-get install gcc", "pip install ziglang")
    with pytest.raises(InputError, check=facts):
        require_for(SIMULATE)


def test_without_pythons_headers_only_simulations_are_refused(
    machine, monkeypatch, tmp_path
):
    machine()
    monkeypatch.setattr(requirements.sysconfig, "get_path", lambda name: str(tmp_path))
    monkeypatch.setattr(requirements, "has_compiler", lambda: True)
    require_for(MEASURE)
    # of this Python, which may not be the system's default
    package = f"python3.{sys.version_info.minor}-dev"
    with pytest.raises(InputError, check=Facts("Python.h", f"install {package}")):
        require_for(SIMULATE)
    assert requirements.missing_debian_packages() == [package]


def test_ziglang_serves_where_there_is_no_compiler(monkeypatch, without_compiler):
    monkeypatch.setenv("LDSHARED", "")
    monkeypatch.setattr(compiler, "_has_ziglang", lambda: True)
    compiler.set_compiler()
    assert compiler.os.environ["CC"] == f"{sys.executable} -m ziglang cc"


MEASURING = """
import sys
SOLVER = ("dolfinx", "dolfinx_solver", "petsc4py", "slepc4py", "mpi4py")
for name in (*SOLVER, "ipctk", "SimpleITK", "picsl_greedy", "optuna", "pytetwild"):
    sys.modules[name] = None
from gyriflow.metrics.measure import measure_brain
from gyriflow.folding.folded_surfaces import folded_surfaces
from gyriflow.running import launch
"""
SEARCHING = """
import sys
from gyriflow.running.requirements import SOLVER, require_for
require_for({"simulate": SOLVER})
assert not {"dolfinx", "dolfinx_solver", "mpi4py"} & set(sys.modules)
"""


@pytest.mark.parametrize("program", [MEASURING, SEARCHING])
def test_neither_measuring_nor_the_search_for_the_solver_imports_it(program):
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
