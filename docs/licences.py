"""The licences that the packages of the environment state: PyPI packages with all they
need, and Debian's libraries.

    ./run python docs/licences.py [--doc FOLDER]

prints two tables and, as its last line, a JSON object with the number of packages by
kind of licence. Debian packages are those of FOLDER, in which each has its `copyright`
file (default /usr/share/doc, which images have; the tree that `./run` makes has none:
unpack the packages with `dpkg-deb -x PACKAGE.deb ROOT` and name ROOT/usr/share/doc).
"""

import argparse
import json
import re
from collections import Counter
from importlib import metadata
from pathlib import Path

ENVIRONMENT = Path(__file__).resolve().parents[1] / "envs"
DEBIAN = (
    *(
        "dolfinx",
        "petsc",
        "slepc",
        "mumps",
        "scotch",
        "hypre",
        "superlu",
        "umfpack",
        "cholmod",
        "fftw3",
        "metis",
    ),
    *("scalapack", "openblas", "openmpi", "hdf5", "adios2", "combblas", "gmp"),
)
"""Libraries that the solver is linked with, by a part of their packages' names."""
KINDS = {
    "AGPL": r"AGPL|Affero",
    "LGPL": r"LGPL|Lesser|LESSER|CeCILL-C|CeCill-C",
    "GPL": r"GPL|GNU General",
    "MPL": r"MPL|Mozilla",
    "permissive": (
        r"MIT|BSD|Apache|PSF|Python Software|Expat|ISC|public.domain|Public"
        r" Domain|matplotlib"
    ),
}
"""Kinds of licences, of which the first that fits counts."""
TEXTS = {
    "GNU LESSER GENERAL PUBLIC LICENSE": "LGPL",
    "Mozilla Public License": "MPL-2.0",
    "MIT License": "MIT",
}
"""What a licence's own text begins with."""


def required(name: str, found: dict[str, metadata.Distribution]) -> None:
    """Add a distribution and those that it needs, extras aside, to `found`."""
    key = re.sub(r"[-_.]+", "-", name).lower()
    if key in found:
        return
    try:
        distribution = metadata.distribution(name)
    except metadata.PackageNotFoundError:  # for another Python or system
        return
    found[key] = distribution
    for requirement in distribution.requires or []:
        if "extra ==" not in requirement:
            required(re.match(r"[\w.-]+", requirement)[0], found)  # type: ignore[index]


def stated(distribution: metadata.Distribution) -> str:
    """Return the licence that a distribution states: as an expression, in a class, in a
    word, or by its text."""
    about = distribution.metadata
    classes = [
        name.split(" :: ")[-1]
        for name in about.get_all("Classifier") or []
        if name.startswith("License")
    ]
    text = about.get("License-Expression") or "; ".join(classes) or ""
    first = (about.get("License") or "").strip().split("\n")[0]
    if not text and first:
        text = next(
            (name for start, name in TEXTS.items() if first.startswith(start)),
            first[:60],
        )
    if not text:
        files = [
            file
            for file in distribution.files or []
            if re.search(r"(?i)licen[cs]e|copying", file.name)
        ]
        starts = [file.read_text(encoding="utf-8").strip() for file in files]
        text = "; ".join(
            name
            for start, name in TEXTS.items()
            if any(found.startswith(start) for found in starts)
        )
    return text or "not stated"


def in_copyright(folder: Path) -> list[tuple[str, str]]:
    """Return Debian packages with the licences in their `copyright` files, the most
    frequent first."""
    rows = []
    for file in sorted(folder.glob("*/copyright")):
        if file.parent.name.startswith("lib") and any(
            part in file.parent.name for part in DEBIAN
        ):
            names = re.findall(
                r"^License: *(\S.*)$",
                file.read_text(encoding="utf-8", errors="replace"),
                re.MULTILINE,
            )
            rows.append(
                (
                    file.parent.name,
                    "; ".join(name for name, _ in Counter(names).most_common()),
                )
            )
    return rows


def kind(licence: str) -> str:
    """Return the kind of a licence."""
    return next(
        (name for name, pattern in KINDS.items() if re.search(pattern, licence)),
        "other",
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--doc", type=Path, default=Path("/usr/share/doc"))
    folder = parser.parse_args().doc
    text = (ENVIRONMENT / "requirements.txt").read_text()
    direct = re.findall(r"^([\w.-]+)", text, re.MULTILINE)
    found: dict[str, metadata.Distribution] = {}
    for name in (*direct, "fenics-dolfinx", "petsc4py", "mpi4py"):
        required(name, found)
    python = [
        (found[name].name, found[name].version, stated(found[name]))
        for name in sorted(found)
    ]
    debian = in_copyright(folder)
    print("| Python package | version | licence as stated |\n| --- | --- | --- |")
    for row in python:
        print("| " + " | ".join(row) + " |")
    print(
        "\n| Debian package | licences in its files, the most frequent first |\n| --- |"
        " --- |"
    )
    for package in debian:
        print("| " + " | ".join(package) + " |")
    counts = Counter(kind(licence) for _, _, licence in python)
    print(json.dumps({"python": dict(counts), "debian_packages": len(debian)}))


if __name__ == "__main__":
    main()
