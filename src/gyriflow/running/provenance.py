"""Whose results are in a folder, what the inputs hold, and the versions of everything that made them."""

import platform
import sys
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.files import contents, read_json, write_json
from ..settings.root import Config
from ..study.atlases import known_checksums
from ..version import commit, version

PACKAGES = (
    *("fenics-dolfinx", "fenics-basix", "fenics-ffcx", "fenics-ufl", "petsc4py", "slepc4py", "mpi4py", "numpy"),
    *("scipy", "snakemake", "nibabel", "scikit-image", "pymeshlab", "pytetwild", "trimesh", "libigl", "ipctk"),
    *("pandas", "picsl-greedy", "SimpleITK", "pyvista", "vtk", "matplotlib", "h5py", "pydantic"),
)
"""Packages whose versions are recorded: those that results depend on."""
STUDY = Path("results", "study", "study.json")
"""Where, in a working directory, it is recorded whose results it has."""


def software() -> dict[str, Any]:
    """Return the versions of gyriflow, Python and the packages that results depend on, the commit, and now (UTC)."""
    packages: dict[str, str | None] = dict.fromkeys(PACKAGES)
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            packages[name] = metadata.version(name)
    return {
        "gyriflow": version(),
        "commit": commit(),
        "recorded": datetime.now(UTC).isoformat(timespec="seconds"),
        "python": sys.version.split()[0],
        "system": platform.platform(),
        "packages": packages,
    }


def check_results_belong_to(directory: Path, files: Sequence[Path], config: Config, record: bool) -> None:
    """Raise InputError where the results in a working directory are those of another study.

    Another study is one of other configuration files without a brain in common; a configuration that was changed,
    copied or moved goes on. With `record` the study is written down as the one whose results these are.
    """
    path = directory / STUDY
    brains: list[list[Any]] = [
        [brain.id, brain.week, brain.source, *(Path(file).name for file in brain.files)] for brain in config.brains
    ]
    study: dict[str, Any] = {"configuration": [str(file.resolve()) for file in files], "brains": brains}
    recorded = read_json(path) if path.is_file() else study
    there = [brain[0] for brain in recorded["brains"] if (directory / "results" / "brains" / brain[0]).is_dir()]
    shared = recorded["configuration"] == study["configuration"] or any(b in recorded["brains"] for b in brains)
    if there and not shared:
        results_of = f"{', '.join(there)} of {', '.join(recorded['configuration'])}"
        expected = f"{', '.join(brain[0] for brain in brains)} of {', '.join(study['configuration'])}"
        remedy = f"Choose another --directory; or delete these results, or study/{path.name} to have both here."
        problem, results = "the results here are those of another study", path.parents[1].resolve()
        raise InputError(problem, path=results, found=results_of, expected=expected, remedy=remedy)
    if record and (recorded != study or not path.is_file()):
        write_json(path, study)


def texts_in(value: Any) -> list[str]:
    """Return all texts in nested mappings and lists, such as a brain's entry, names of files among them."""
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else []
    return [value] if isinstance(value, str) else [text for item in items for text in texts_in(item)]


def input_contents(directory: Path, config: Config, record: bool) -> dict[str, str]:
    """Return the SHA-256 of each input file of a study by its path; that of its atlas where the file is not there yet.

    With `record` they are kept in the results, with sizes and times, so that unchanged files are not read again.
    """
    path = directory / "results" / "study" / "inputs.json"
    recorded: dict[str, Any] = {}
    with suppress(InputError):
        recorded = read_json(path)
    files = contents(dict.fromkeys(texts_in(config.model_dump())), recorded)
    if record and files != recorded:
        write_json(path, files)
    expected = {name: sha256 for name, (_, sha256) in known_checksums(config).items()}
    return expected | {name: state[0] for name, state in files.items()}
