"""Compare two results folders number by number, to show that a change of the code
leaves its results equal.

    ./run python benchmarks/same_results.py BEFORE --run ../before --hemispheres FOLDER
    ./run python benchmarks/same_results.py BEFORE AFTER --run --hemispheres FOLDER \\
        --renamed nearest.csv=closest.csv

`--run` first runs the studies of `benchmarks/regression` on one core, in a checkout
(default: this one), into the last folder named. FOLDER holds
`fetal.week{21,25,29}.{left,right}.pial.surf.gii`. Tables, JSON, YAML, HDF5, GIFTI and
NIfTI files are compared by content, other files by name. Times, memory, versions and
paths are left out. Numbers in tables, JSON and YAML are compared relative to
themselves, arrays relative to their largest value, and to single precision if stored
so. `--renamed OLD=NEW` applies to words in names of files, columns, keys and arrays,
and to whole texts. Each difference is printed. The last line is one JSON object; the
exit code is 1 if anything differs.
"""

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import nibabel as nib
import numpy as np
import pandas as pd
import yaml

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = {
    "demo": ["run", "-s", "folding", "-s", "metrics"],
    "measure": ["measure"],
    "prediction": ["run", "-s", "folding", "-s", "metrics", "-s", "export"],
    "sweep": ["run", "-s", "folding", "-s", "sweeps", "-s", "calibrate"],
}
"""The command for each configuration in `benchmarks/regression`."""
IGNORED = {
    "seconds",
    "cpu_seconds",
    "seconds_per_step",
    "cpu_s",
    "peak_memory_MiB",
    "commit",
    "gyriflow",
    "logs",
    "benchmarks",
    "report",
    "provenance.json",
    "resources.csv",
    "inputs.json",
}
"""Columns, keys, files and folders that differ between two runs of the same code."""
FOLDERS_OF_PATH = re.compile(r"/\S*/")
TOLERANCE = 2e-9
"""Tables have ten digits, and the last may be rounded differently."""


def run_studies(checkout: Path, out: Path, hemispheres: Path) -> None:
    """Run all studies in a checkout; CalledProcessError if one fails."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    for name, command in COMMANDS.items():
        folder = out.resolve() / name
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "hemispheres").exists():
            (folder / "hemispheres").symlink_to(hemispheres.resolve())
        config = str(ROOT / "benchmarks" / "regression" / f"{name}.yaml")
        program = [
            str(checkout.resolve() / "run"),
            "gyriflow",
            *command,
            config,
            "--cores=1",
        ]
        subprocess.run(
            program, cwd=folder, env=environment, stdout=sys.stderr, check=True
        )


def flatten(content: Any, name: str = "") -> dict[str, np.ndarray]:
    """Return the values of nested mappings and lists as texts, by their keys joined
    with dots."""
    if not isinstance(content, dict | list):
        return {name: np.array([FOLDERS_OF_PATH.sub("", str(content))], dtype=object)}
    items = content.items() if isinstance(content, dict) else enumerate(content)
    return {
        path: value
        for key, inner in items
        for path, value in flatten(inner, f"{name}.{key}".strip(".")).items()
    }


def read(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a file by name, texts from tables, JSON and YAML; {} for
    other kinds of files."""
    arrays: dict[str, np.ndarray] = {}
    if path.suffix in (".csv", ".tsv"):
        table = pd.read_csv(
            path,
            sep="\t" if path.suffix == ".tsv" else ",",
            dtype=str,
            keep_default_na=False,
        )
        arrays = {
            name: (
                table[name]
                .str.replace(FOLDERS_OF_PATH, "", regex=True)
                .to_numpy(object)
            )
            for name in table
        }
    elif path.suffix in (".json", ".yaml"):
        arrays = flatten(
            (json.loads if path.suffix == ".json" else yaml.safe_load)(path.read_text())
        )
    elif path.suffix == ".h5":
        with h5py.File(path) as file:
            file.visititems(
                lambda name, item: (
                    arrays.update({name: item[()]}) if hasattr(item, "shape") else None
                )
            )
    elif path.suffix == ".gii":
        image = nib.load(path)
        arrays = {
            f"{n} {array.metadata.get('Name', '')}": array.data
            for n, array in enumerate(image.darrays)
        }
        arrays |= flatten(image.labeltable.get_labels_as_dict(), "label")
    elif path.name.endswith(".nii.gz"):
        image = nib.load(path)
        arrays = {"voxels": np.asarray(image.dataobj), "affine": image.affine}
    return arrays


def difference(before: np.ndarray, after: np.ndarray) -> tuple[float, str]:
    """Return the largest relative difference, inf if shapes, texts or gaps differ, and
    an example."""
    if before.shape != after.shape:
        return np.inf, f"shapes {before.shape}, {after.shape}"
    # two NaN are equal
    changed = (before != after) & ((before == before) | (after == after))
    if not changed.any():
        return 0.0, ""
    try:
        old, new = before[changed].astype(float), after[changed].astype(float)
    except ValueError:
        return (
            np.inf,
            (
                f"{changed.sum()} texts, such as {before[changed][0]!r},"
                f" {after[changed][0]!r}"
            ),
        )
    scale = np.maximum(np.abs(old), np.abs(new))
    if before.dtype != object:
        scale = np.abs(before[np.isfinite(before)]).max(initial=0.0) or scale
    relative = np.nan_to_num(np.abs(old - new) / scale, nan=np.inf)
    worst = relative.argmax()
    return (
        float(relative[worst]),
        f"{len(old)} numbers, such as {float(old[worst])!r}, {float(new[worst])!r}",
    )


def compare(
    before: Path, after: Path, renamed: Mapping[str, str], ignored: set[str] = IGNORED
) -> tuple[list[str], dict[str, Any]]:
    """Return the differences of the files in two folders, one per line, and a
    summary."""

    def new_name(name: str) -> str:
        for old, new in renamed.items():
            name = re.sub(rf"(?<!\w){re.escape(old)}(?!\w)", new, name)
        return name

    def files(folder: Path) -> list[str]:
        paths = [
            path.relative_to(folder)
            for path in folder.glob("*/results/**/*")
            if path.is_file()
        ]
        return [str(path) for path in paths if not ignored & {*path.parts}]

    earlier, later = {new_name(name): name for name in files(before)}, set(files(after))
    lines, largest, place = [], 0.0, ""
    for file in sorted({*earlier} & later):
        old = {
            new_name(name): array
            for name, array in read(before / earlier[file]).items()
        }
        new = read(after / file)
        lines += [
            f"{file}: {name}: only {'before' if name in old else 'after'}"
            for name in sorted({*old} ^ {*new})
        ]
        for name in sorted(
            name
            for name in {*old} & {*new}
            if not ignored & {*re.split(r"[./ ]", name)}
        ):
            array, limit = old[name], TOLERANCE
            if array.dtype == object:
                array = np.array(
                    [renamed.get(text, text) for text in array], dtype=object
                )
            elif array.dtype == np.float32:
                limit = max(TOLERANCE, float(np.finfo(np.float32).eps))
            relative, example = difference(array, new[name])
            if relative > limit:
                lines.append(f"{file}: {name}: {relative:.3g}: {example}")
            if largest < relative < np.inf:
                largest, place = relative, f"{file}: {name}"
    summary = {
        "files": len({*earlier} & later),
        "differences": len(lines),
        "largest_relative_difference": largest,
    }
    only = {
        "only_before": sorted({*earlier} - later),
        "only_after": sorted(later - {*earlier}),
    }
    return lines, summary | {"largest_in": place} | only


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "folders",
        type=Path,
        nargs="+",
        metavar="FOLDER",
        help="BEFORE and AFTER; one if it only runs",
    )
    parser.add_argument("--run", type=Path, nargs="?", const=ROOT, metavar="CHECKOUT")
    parser.add_argument(
        "--hemispheres", type=Path, help="folder of surfaces, needed by --run"
    )
    parser.add_argument("--renamed", action="append", default=[], metavar="OLD=NEW")
    parser.add_argument(
        "--ignore",
        action="append",
        default=[],
        metavar="NAME",
        help="a column, key, file or folder",
    )
    arguments = parser.parse_args()
    if arguments.run:
        run_studies(arguments.run, arguments.folders[-1], arguments.hemispheres)
    if len(arguments.folders) == 2:
        renamed = dict(pair.split("=", 1) for pair in arguments.renamed)
        lines, summary = compare(
            *arguments.folders, renamed, IGNORED | {*arguments.ignore}
        )
        print(*lines, json.dumps(summary), sep="\n")
        sys.exit(bool(lines or summary["only_before"] or summary["only_after"]))


if __name__ == "__main__":
    main()
