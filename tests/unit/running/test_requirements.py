"""What a job needs is found from what its program imports, and named before the first
job."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from facts import Facts
from processes import ran

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


def test_measuring_needs_nothing_but_the_base_packages(machine):
    machine(without=requirements.EXTRAS)
    names = ("pial", "measure", "brain_figures", "quality_table", "html_report")
    require_for({name: SCRIPTS / f"{name}.py" for name in names})


@pytest.mark.parametrize(
    ("programs", "facts"),
    [
        ([SCRIPTS / "register.py"], ["(picsl_greedy, SimpleITK)", "gyriflow[fold]"]),
        ([SCRIPTS / "tetrahedralise.py"], ["(pytetwild)", "step 0"]),
        ([SCRIPTS / "calibration_design.py"], ["(optuna)", "gyriflow[calibrate]"]),
        (
            [SCRIPTS / "measure.py", SCRIPTS / "calibration_design.py", SOLVER],
            ["(optuna, dolfinx, ipctk)", "step 1", "gyriflow[calibrate,fold]"],
        ),
    ],
)
def test_missing_packages_are_named_with_a_step_and_their_extras(
    machine, monkeypatch, programs, facts
):
    machine(without=requirements.EXTRAS)
    monkeypatch.setattr(requirements, "_has_dolfinx_wheels", lambda: True)
    with pytest.raises(InputError, check=Facts(*facts)):
        require_for({str(number): path for number, path in enumerate(programs)})


PIP, CONDA = ["pip", "gyriflow[fold]"], ["conda", "envs/gyriflow.yaml"]


@pytest.mark.parametrize(
    ("system", "processor", "libc", "facts"),
    [
        ("linux", "x86_64", ("glibc", "2.34"), PIP),
        ("linux", "x86_64", ("glibc", "2.100"), PIP),
        ("linux", "x86_64", ("glibc", "2.31"), CONDA),
        # musl
        ("linux", "x86_64", ("", "2.34"), CONDA),
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
    assert requirements._missing_debian_packages() == [package]


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
    done = ran(sys.executable, "-c", program)
    assert done.returncode == 0, done.stderr
