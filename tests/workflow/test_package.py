"""The package as a wheel: what it carries, and that its command works in an empty
folder without the checkout."""

import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest
import yaml
from facts import Facts
from processes import ran

from .conftest import CHECKOUT

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    pip = sys.executable, "-m", "pip", "wheel", "--no-deps"
    built = ran(*pip, "--wheel-dir", folder, CHECKOUT)
    assert built.returncode == 0, built.stdout + built.stderr
    (found,) = folder.glob("gyriflow-*.whl")
    return found


FOLD = (
    "dolfinx dolfinx_solver petsc4py slepc4py mpi4py ipctk SimpleITK picsl_greedy"
    " optuna pytetwild"
)


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """The site-packages, the command and the variables of a virtual environment with
    the wheel and the packages of this environment."""
    folder = tmp_path_factory.mktemp("installed")
    venv = [sys.executable, "-m", "venv", "--system-site-packages", folder]
    subprocess.run(venv, check=True, timeout=120)
    python = folder / "bin" / "python"
    found = "import sysconfig; print(sysconfig.get_path('purelib'))"
    site = Path(ran(python, "-c", found).stdout.strip())
    (site / "environment.pth").write_text(sysconfig.get_path("purelib") + "\n")
    names = set(os.environ) - {"PYTHONPATH", "VIRTUAL_ENV"}
    plain = {name: os.environ[name] for name in names} | {"PATH": "/usr/bin:/bin"}
    install = [python, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, wheel], env=plain, check=True, timeout=120)
    return site, folder / "bin" / "gyriflow", plain


def test_the_wheel_carries_all_that_stands_beside_the_package(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    folders = ("workflow", "atlases", "schemes", "norms", "config", "profiles", "envs")
    git = "git", "-C", CHECKOUT, "ls-files"
    tracked = ran(*git, "Snakefile", *folders).stdout.split()
    assert len(tracked) > 100
    assert {f"gyriflow/shipped/{name}" for name in tracked} <= names
    sources = ran(*git, "src/*.py", "src/*.c").stdout.split()
    assert "src/gyriflow/folding/products.c" in sources
    assert {name.removeprefix("src/") for name in sources} <= names
    assert "snakemake_logger_plugin_gyriflow/__init__.py" in names
    assert not [
        name for name in names if "__pycache__" in name or name.startswith("tests")
    ]


def test_the_command_works_in_an_empty_folder(installed, tmp_path):
    _, command, environment = installed

    def gyriflow(*arguments):
        return ran(command, *arguments, cwd=tmp_path, env=environment)

    assert gyriflow("--version").stdout.startswith("gyriflow 0.")
    target = "results/brains/spina-bifida-operated-25/surface/pial.surf.gii"
    # where there is no configuration, it is told where the demo's is
    demo = re.search(r"(\S+/config\.yaml)", gyriflow("run").stderr)[1]
    outcome = gyriflow("run", demo, "--cores", "1", target)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    assert (tmp_path / target).is_file()
    assert str(CHECKOUT) not in outcome.stdout + outcome.stderr
    # nothing is missing further down
    dry = gyriflow("run", demo, "--dry-run")
    assert dry.returncode == 0
    assert " core hours, " in dry.stdout


@pytest.fixture
def without_solver(installed):
    """The command and variables of this environment, in which imports of the packages
    of `fold` fail."""
    site, command, environment = installed
    blocked = f"import sys; sys.modules.update(dict.fromkeys({FOLD!r}.split()))"
    (site / "blocked.pth").write_text(blocked + "\n")
    yield command, environment
    (site / "blocked.pth").unlink()


def test_a_brain_is_measured_without_the_solver(without_solver, tmp_path):
    command, environment = without_solver
    python = command.with_name("python")
    blocked = ran(python, "-c", "import mpi4py", cwd=tmp_path, env=environment)
    assert blocked.returncode == 1
    program = CHECKOUT / "tests" / "measure_installed.py"
    outcome = ran(python, "-P", program, cwd=tmp_path, env=environment)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    assert outcome.stdout.splitlines()[-1] == "measured"


def test_simulating_without_the_solver_names_the_extra_before_the_first_job(
    without_solver, tmp_path
):
    command, environment = without_solver
    shape = {"id": "a", "week": 21, "shape": {}}
    study = {"brains": [shape], "start": "a", "folding": {"end_week": 22}}
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    call = "run", "study.yaml", "--cores", "1"
    outcome = ran(command, *call, cwd=tmp_path, env=environment)
    assert outcome.returncode == 2
    assert outcome.stderr == Facts("dolfinx", "gyriflow[fold]")
    assert not list(tmp_path.glob("results/brains/*/surface"))
