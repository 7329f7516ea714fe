"""Where the results come from: versions, commit, and the hashes of the input files."""

import platform
from datetime import UTC, datetime

from gyriflow.io.downloads import sha256_of
from gyriflow.io.files import write_json
from gyriflow.io.versions import package_versions, source_commit
from gyriflow.step import step
from gyriflow.version import version

PACKAGES = (
    *("fenics-dolfinx", "fenics-basix", "fenics-ufl", "fenics-ffcx", "petsc4py", "mpi4py", "numpy", "scipy", "pandas"),
    *("h5py", "nibabel", "pyvista", "vtk", "pymeshlab", "pytetwild", "libigl", "trimesh", "lapy", "picsl-greedy"),
    *("matplotlib", "pydantic", "snakemake"),
)

params = snakemake.params
with step(snakemake.log[0]):
    versions = {"gyriflow": version(), "Python": platform.python_version()} | package_versions(PACKAGES)
    files = [
        {"brain": brain, "what": what, "sha256": sha256_of(path)} | ({"path": path} if params.paths else {})
        for brain, what, path in params.files
    ]
    content = {"commit": source_commit(params.source), "versions": versions, "files": files}
    write_json(snakemake.output[0], content | {"made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")})
