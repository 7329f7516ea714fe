"""Record which study a folder's results belong to, the contents of its inputs, and the
software versions."""

import platform
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.files import contents, read_json, write_json
from ..io.origins import joined_contents
from ..settings.root import Config
from ..version import commit, version

PACKAGES = (
    "fenics-dolfinx",
    "dolfinx-solver-real",
    "fenics-basix",
    "fenics-ffcx",
    "fenics-ufl",
    "petsc4py",
    "mpi4py",
    "mpich",
    "numpy",
    "scipy",
    "snakemake",
    "nibabel",
    "scikit-image",
    "pymeshlab",
    "pytetwild",
    "trimesh",
    "libigl",
    "ipctk",
    "pandas",
    "picsl-greedy",
    "SimpleITK",
    "pyvista",
    "vtk",
    "matplotlib",
    "h5py",
    "pydantic",
)
"""Packages whose versions are recorded because results depend on them."""
STUDY_RECORD = Path("results", "study", "study.json")
"""Record of the study that the results belong to, in the working directory."""
INPUTS_RECORD = Path("results", "study", "inputs.json")
"""Record of the contents of the study's input files."""


def software() -> dict[str, Any]:
    """Return the versions of gyriflow, Python and the `PACKAGES`, the commit, and the
    present time (UTC)."""
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


def check_results_belong_to(
    directory: Path,
    files: Sequence[Path],
    config: Config,
    record: bool,
) -> None:
    """Raise InputError if the results in a working directory belong to another study.

    Two studies are the same if their configuration files are, or if they share a brain,
    by its entry or the content of a file. So a configuration may be edited, copied or
    moved, and data may be renamed. With `record`, this study is recorded as the owner
    of the results.
    """
    path = directory / STUDY_RECORD
    brains: list[list[Any]] = [
        [
            brain.id,
            brain.week,
            brain.source,
            *(Path(file).name for file in brain.files),
        ]
        for brain in config.brains
    ]
    study: dict[str, Any] = {
        "configuration": [str(file.resolve()) for file in files],
        "brains": brains,
    }
    is_recorded = path.is_file()
    recorded = read_json(path) if is_recorded else study
    folder = directory / "results" / "brains"
    ids = [brain_id for brain_id, *_ in recorded["brains"]]
    existing = [brain_id for brain_id in ids if (folder / brain_id).is_dir()]
    has_same_files = recorded["configuration"] == study["configuration"]
    shares_brain = any(brain in recorded["brains"] for brain in brains)
    is_same_study = has_same_files or shares_brain
    if existing and not is_same_study and not _have_recorded_content(directory, config):
        results_of = f"{', '.join(existing)} of {', '.join(recorded['configuration'])}"
        expected = (
            f"{', '.join(brain[0] for brain in brains)} of"
            f" {', '.join(study['configuration'])}"
        )
        remedy = (
            "Choose another --directory, or delete these results (or only"
            f" study/{path.name}, to keep both here)."
        )
        problem = "the results here belong to another study"
        results = path.resolve().parents[1]
        raise InputError(
            problem,
            path=results,
            found=results_of,
            expected=expected,
            remedy=remedy,
        )
    if record and (recorded != study or not is_recorded):
        write_json(path, study)


def _have_recorded_content(directory: Path, config: Config) -> bool:
    """Return whether any file of a study's brains has the content of an input of the
    results in a directory."""
    recorded = recorded_inputs(directory)
    known = {facts[0] for facts in recorded.values()}
    files: list[str] = []
    for brain in config.brains:
        files += brain.files
    found = contents(files, recorded)
    return any(facts[0] in known for facts in found.values())


def recorded_inputs(directory: Path) -> dict[str, Any]:
    """Return the recorded contents of the input files of the results in a directory, by
    path (see `io.files.contents`)."""
    with suppress(InputError):
        return read_json(directory / INPUTS_RECORD)
    return {}


def texts_in(value: Any) -> list[str]:
    """Return all strings in nested mappings and lists, such as the file names in a
    brain's entry."""
    if isinstance(value, str):
        return [value]
    if isinstance(value, dict):
        value = list(value.values())
    texts: list[str] = []
    if isinstance(value, list | tuple):
        for item in value:
            texts += texts_in(item)
    return texts


def input_contents(
    directory: Path,
    config: Config,
    checksums: Mapping[str, tuple[str, str]],
    record: bool,
) -> dict[str, str]:
    """Return the SHA-256 of each input file of a study and of its companions, by path.

    For a file of an atlas that is not downloaded yet, it is the one in `checksums`.
    With `record`, hashes are stored in the results with sizes and times, so that
    unchanged files are not read again.
    """
    recorded = recorded_inputs(directory)
    # a word of the configuration may be the name of a file, too
    named = [
        text for text in texts_in(config.model_dump()) if "/" in text or "." in text
    ]
    files = contents(dict.fromkeys(named), recorded)
    if record and files != recorded:
        write_json(directory / INPUTS_RECORD, files)
    expected = {name: sha256 for name, (_, sha256) in checksums.items()}
    return expected | joined_contents(files)
