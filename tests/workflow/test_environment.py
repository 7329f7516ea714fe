"""The environment that ./run makes: solver, MPI, and the packages that need more than Python."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

CUBE = """
from mpi4py import MPI
import dolfinx, ufl
mesh = dolfinx.mesh.create_unit_cube(MPI.COMM_WORLD, 4, 4, 4)
one = dolfinx.fem.Constant(mesh, 1.0)
volume = mesh.comm.allreduce(dolfinx.fem.assemble_scalar(dolfinx.fem.form(one * ufl.dx)))
cells = mesh.comm.allgather(mesh.topology.index_map(3).size_local)
if mesh.comm.rank == 0:
    print(mesh.comm.size, round(volume, 9), sum(cells), min(cells) > 0)
"""

SPHERE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere(), color="white")
plotter.background_color = "black"
picture = plotter.screenshot(return_img=True)
print(picture[32, 32].min() > 60, picture[0, 0].max() == 0)
"""


def python(code: str, *, ranks: int = 1) -> str:
    """Returns what a program prints, run in processes of its own."""
    start = ["mpiexec", "-n", str(ranks)] if ranks > 1 else []
    done = subprocess.run([*start, sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_dolfinx_runs_on_three_ranks():
    assert python(CUBE, ranks=3) == "3 1.0 384 True"


def test_pictures_are_drawn_without_a_screen():
    assert python(SPHERE) == "True True"


def test_petsc_is_real_and_has_what_the_solver_uses():
    code = (
        "from petsc4py import PETSc; import numpy, slepc4py.SLEPc; "
        "print(numpy.dtype(PETSc.ScalarType), PETSc.Sys.hasExternalPackage('mumps'))"
    )
    assert python(code) == "float64 True"


def test_blas_is_an_optimised_one():
    loaded = python("import petsc4py.PETSc; print(open('/proc/self/maps').read())")
    assert "openblas" in loaded or "mkl" in loaded
