"""What a job needs is found from what its program imports, and named before the first
job."""

import subprocess
import sys
from pathlib import Path

import pytest
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.folding import compiler
from gyriflow.running import requirements
from gyriflow.running.requirements import packages_behind, require_for

SCRIPTS = Path(__file__).parents[3] / "workflow" / "scripts"


def test_measuring_needs_nothing_but_the_base_packages():
    for script in (
        "pial.py",
        "measure.py",
        "brain_figures.py",
        "quality_table.py",
        "html_report.py",
    ):
        assert packages_behind(SCRIPTS / script) == []


def test_simulations_and_registrations_need_the_extra():
    assert "dolfinx" in packages_behind(requirements.SOLVER)
    assert "ipctk" in packages_behind(requirements.SOLVER)
    assert packages_behind(SCRIPTS / "register.py") == ["picsl_greedy", "SimpleITK"]
    assert "pytetwild" in packages_behind(SCRIPTS / "tetrahedralise.py")
    assert packages_behind(SCRIPTS / "calibration_design.py") == ["optuna"]


def test_a_missing_package_is_named_with_its_step_and_extra(monkeypatch):
    monkeypatch.setattr(requirements, "is_installed", lambda name: name != "ipctk")
    measured = {"measure": SCRIPTS / "measure.py"}
    require_for(measured)
    monkeypatch.setattr(requirements, "has_dolfinx_wheels", lambda: True)
    with pytest.raises(InputError, check=Facts("ipctk", "simulate", "gyriflow[fold]")):
        require_for(measured | {"simulate": requirements.SOLVER})
    monkeypatch.setattr(
        requirements, "is_installed", lambda name: name not in ("ipctk", "optuna")
    )
    calibrated = {
        "simulate": requirements.SOLVER,
        "design": SCRIPTS / "calibration_design.py",
    }
    with pytest.raises(
        InputError, check=Facts("ipctk", "optuna", "gyriflow[calibrate,fold]")
    ):
        require_for(calibrated)


def test_where_pypi_has_no_dolfinx_conda_is_named(monkeypatch):
    monkeypatch.setattr(requirements, "is_installed", lambda name: False)
    monkeypatch.setattr(requirements, "has_dolfinx_wheels", lambda: False)
    with pytest.raises(
        InputError, check=Facts("dolfinx", "conda", "envs/gyriflow.yaml")
    ):
        require_for({"simulate": requirements.SOLVER})


def test_windows_is_sent_to_wsl(monkeypatch):
    monkeypatch.setattr(requirements, "is_installed", lambda name: False)
    monkeypatch.setattr(requirements.sys, "platform", "win32")
    with pytest.raises(InputError, check=Facts("dolfinx", "WSL", "gyriflow[fold]")):
        require_for({"simulate": requirements.SOLVER})


def test_a_mac_is_told_to_leave_out_what_conda_has_for_linux_only(monkeypatch):
    monkeypatch.setattr(requirements, "is_installed", lambda name: False)
    monkeypatch.setattr(requirements.sys, "platform", "darwin")
    with pytest.raises(
        InputError, check=Facts("conda", "envs/gyriflow.yaml", "docs/environment.md")
    ):
        require_for({"simulate": requirements.SOLVER})


@pytest.mark.parametrize(
    ("libc", "has_wheels"),
    [
        (("glibc", "2.34"), True),
        (("glibc", "2.100"), True),
        (("glibc", "2.31"), False),
        (("", ""), False),
    ],
)
def test_the_wheels_of_dolfinx_need_glibc_2_34(monkeypatch, libc, has_wheels):
    monkeypatch.setattr(requirements.sys, "platform", "linux")
    monkeypatch.setattr(requirements.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(requirements.platform, "libc_ver", lambda: libc)
    assert requirements.has_dolfinx_wheels() is has_wheels


def test_a_missing_library_is_named_with_its_package(monkeypatch):
    monkeypatch.setattr(requirements, "LIBRARIES", {"libnowhere.so.7": "libnowhere7"})
    with pytest.raises(
        InputError, check=Facts("libnowhere.so.7", "apt-get install libnowhere7")
    ):
        require_for({"measure": SCRIPTS / "measure.py"})


def test_without_a_compiler_only_simulations_are_refused(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiler, "_has_ziglang", lambda: False)
    monkeypatch.setattr(requirements, "is_installed", lambda name: True)
    monkeypatch.setattr(requirements, "LIBRARIES", {})
    require_for({"measure": SCRIPTS / "measure.py"})
    with pytest.raises(
        InputError, check=Facts("apt-get install gcc", "pip install ziglang")
    ):
        require_for({"simulate": requirements.SOLVER})


def test_without_pythons_headers_only_simulations_are_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(requirements.sysconfig, "get_path", lambda name: str(tmp_path))
    monkeypatch.setattr(requirements, "has_compiler", lambda: True)
    monkeypatch.setattr(requirements, "is_installed", lambda name: True)
    monkeypatch.setattr(requirements, "LIBRARIES", {})
    require_for({"measure": SCRIPTS / "measure.py"})
    # of this Python, which may not be the system's default
    package = f"python3.{sys.version_info.minor}-dev"
    with pytest.raises(InputError, check=Facts("Python.h", f"install {package}")):
        require_for({"simulate": requirements.SOLVER})
    assert requirements.missing_debian_packages() == [package]


def test_ziglang_serves_where_there_is_no_compiler(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("LDSHARED", "")
    monkeypatch.setattr(compiler, "_has_ziglang", lambda: True)
    compiler.set_compiler()
    assert compiler.os.environ["CC"] == f"{sys.executable} -m ziglang cc"


MEASURING = """
import sys
SOLVER = ("dolfinx", "dolfinx_solver", "petsc4py", "slepc4py", "mpi4py")
for name in (*SOLVER, "ipctk", "SimpleITK", "picsl_greedy", "optuna", "pytetwild"):
    sys.modules[name] = None
import trimesh
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.metrics.measure import measure_brain
from gyriflow.folding.folded_surfaces import folded_surfaces
from gyriflow.running import launch
sphere = trimesh.creation.icosphere(subdivisions=3, radius=20.0)
whole = TriangleMesh(sphere.vertices, sphere.faces)
found = measure_brain(
    whole, whole, None, curvature_radius_mm=8.0, spangy_modes=20
)
print(len(found.spectra))
"""


def test_a_brain_is_measured_where_the_solver_cannot_be_imported():
    done = subprocess.run(
        [sys.executable, "-c", MEASURING], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 0


SEARCH = """
import sys
from gyriflow.running.requirements import is_installed
assert is_installed("dolfinx") and not is_installed("no_such_package")
assert not {"dolfinx", "dolfinx_solver", "mpi4py"} & set(sys.modules)
"""


def test_looking_for_the_solver_starts_no_mpi():
    done = subprocess.run(
        [sys.executable, "-c", SEARCH], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
