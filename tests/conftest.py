"""What all tests share."""

# pymeshlab brings libraries that keep PETSc from loading after it; in this order both work
import petsc4py.PETSc  # noqa: F401
